//! In-place calls do not allocate, as counted by the allocator.

use carom_chain::{Chain, Keep, ResponseMemory, uniform_chain};
use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2, Vector3};

fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

#[test]
fn allocation_counter_counts_allocations() {
    assert!(allocations(|| drop(std::hint::black_box(vec![1.0; 100]))) > 0);
}

#[test]
fn in_place_calls_do_not_allocate() {
    let chain: Chain = uniform_chain(9, 2.0, 3.0).unwrap();
    let flat = chain.to_planar().unwrap();
    let tip = chain.frame("tip").unwrap();
    let (point, flat_point) = (chain.point(tip, Vector3::zeros()), flat.point(tip, Vector3::zeros()));
    let (mut ws, mut flat_ws) = (chain.workspace(), flat.chain.workspace());
    let q: Vec<f64> = (0..9).map(|i| 0.1 * i as f64).collect();
    let (qd, tau) = (vec![0.3; 9], vec![0.2; 9]);
    let (mut out, mut m, mut j) = (vec![0.0; 9], DMatrix::zeros(9, 9), DMatrix::zeros(3, 9));
    let (mut flat_j, mut row_along) = (DMatrix::zeros(2, 9), vec![0.0; 9]);
    let (mut h, mut flat_h) = (Matrix3::zeros(), Matrix2::zeros());
    let gravity = Vector3::new(0.0, -9.81, 0.0);

    let short = uniform_chain(3, 2.0, 3.0).unwrap().to_planar().unwrap();
    let row = carom_chain::PlanarRow::of(&short.chain).unwrap();

    let (fused, flat_fused) = (chain.contact_point(point).unwrap(), flat.chain.contact_point(flat_point).unwrap());
    let (mut memory, mut flat_memory) = (ResponseMemory::default(), ResponseMemory::default());
    let down = Vector2::new(0.0, 1.0);
    // The first call allocates.
    fused.visit(&q, gravity, &[], &mut memory, Keep).unwrap();
    flat_fused.visit(&q, down, &[], &mut flat_memory, Keep).unwrap();
    ws.update(&chain, &q).unwrap().contact(point, gravity, &[]).unwrap();

    let count = allocations(|| {
        fused.visit(&q, gravity, &[], &mut memory, Keep).unwrap();
        flat_fused.visit(&q, down, &[], &mut flat_memory, Keep).unwrap();
        assert!(row.accelerate(&q[..3], &qd[..3], &tau[..3], Vector2::new(0.0, -9.81), &mut out[..3]));
        let mut kin = ws.update(&chain, &q).unwrap();
        kin.point_jacobian_into(point, &mut j);
        kin.mass_matrix_into(&mut m);
        kin.inverse_dynamics_into(&qd, &qd, gravity, &mut out).unwrap();
        kin.contact(point, gravity, &tau).unwrap();
        kin.point_drift(point, &qd).unwrap();
        kin.kinetic_energy(&qd).unwrap();
        kin.forward_dynamics_into(&qd, &tau, gravity, &mut out).unwrap();
        let mut articulation = kin.articulate().unwrap();
        articulation.forward_dynamics_into(&qd, &tau, gravity, &mut out).unwrap();
        articulation.respond_along(point, gravity, &mut row_along, &mut out).unwrap();
        articulation.delassus_into(point, &mut h);

        let mut kin = flat_ws.update(&flat.chain, &q).unwrap();
        kin.point_jacobian_into(flat_point, &mut flat_j);
        kin.mass_matrix_into(&mut m);
        kin.inverse_dynamics_into(&qd, &qd, Vector2::new(0.0, -9.81), &mut out).unwrap();
        let mut articulation = kin.articulate().unwrap();
        articulation.respond_along(flat_point, Vector2::new(0.0, -9.81), &mut row_along, &mut out).unwrap();
        articulation.delassus_into(flat_point, &mut flat_h);
    });
    assert_eq!(count, 0);
    assert!(out.iter().all(|x| x.is_finite()) && h.determinant().is_finite() && flat_h.determinant() > 0.0);
    assert!(memory.response().mobility > 0.0 && flat_memory.response().mobility > 0.0);
}

#[test]
fn contacts_of_coupled_and_of_long_chains_allocate_once() {
    let text = |mimic: &str| {
        format!(
            r#"<robot name="pair"><link name="base"/>{}
            <joint name="a" type="continuous"><parent link="base"/><child link="l1"/><axis xyz="0 0 1"/></joint>
            <joint name="b" type="continuous"><parent link="l1"/><child link="l2"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
            <joint name="c" type="continuous"><parent link="l2"/><child link="l3"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>{mimic}</joint></robot>"#,
            ["l1", "l2", "l3"].map(|name| format!(
                r#"<link name="{name}"><inertial><origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"#
            )).concat()
        )
    };
    let coupled: Chain =
        Chain::from_urdf_str(&text(r#"<mimic joint="b" multiplier="0.5"/>"#), &Default::default()).unwrap();
    assert!(coupled.is_coupled());
    for (chain, link) in [(coupled, "l3"), (uniform_chain(60, 1.0, 1.0).unwrap(), "tip")] {
        let point = chain.point(chain.frame(link).unwrap(), Vector3::x());
        let q = vec![0.3; chain.nq()];
        let mut ws = chain.workspace();
        let mut kin = ws.update(&chain, &q).unwrap();
        kin.contact(point, Vector3::y(), &[]).unwrap();
        let again = allocations(|| assert!(kin.contact(point, Vector3::y(), &[]).unwrap().moves()));
        assert_eq!(again, 0, "{}", chain.name());
    }
}
