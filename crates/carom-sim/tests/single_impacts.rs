//! Single impacts of a chain.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_impact::{Energetic, Frictionless, Law, Mode, Poisson};
use carom_sim::{Impacts, JointModel};
use nalgebra::{DVector, Vector3};

/// A uniform rod of 1 kg and 1 m that moves in the x–z plane: q = (x, z, angle about y). The frame `end` is at one end.
fn rod() -> Chain {
    let inertia = 1.0 / 12.0;
    let text = format!(
        r#"<robot name="rod"><link name="world"/><link name="a"/><link name="b"/><link name="end"/>
        <link name="rod"><inertial><mass value="1"/>
          <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial></link>
        <joint name="x" type="prismatic"><parent link="world"/><child link="a"/><axis xyz="1 0 0"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="z" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="turn" type="continuous"><parent link="b"/><child link="rod"/><axis xyz="0 1 0"/></joint>
        <joint name="weld" type="fixed"><parent link="rod"/><child link="end"/><origin xyz="-0.5 0 0"/></joint></robot>"#
    );
    Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap()
}

/// Painlevé's rod at 60°, whose lower end slides at 1 m/s in the direction that jams, with μ = 1.5: besides the motion without
/// impulse there is an impact without collision. With e = 0 it stops the end, by H⁻¹ (1, 0) = (7/16, 3√3/16) N s.
#[test]
fn a_jamming_rod_has_an_impact_without_collision_beside_its_sliding() {
    let chain = rod();
    let (q, qd) = ([0.2, 0.5, -60_f64.to_radians()], [-1.0, 0.0, 0.0]);
    let strike = || chain.impact(&q, &qd).at(chain.frame("end").unwrap()).normal([0.0, 0.0, 1.0]);
    let law = Poisson { restitution: 0.0, friction: 1.5 };
    let all = strike().branches(&law).unwrap();
    assert_eq!(all.len(), 2);
    let first = strike().resolve(&law).unwrap();
    assert_eq!((&all[0].qd_plus, all[0].impulse, all[0].mode), (&first.qd_plus, first.impulse, first.mode));
    assert_eq!((all[0].impulse, all[0].mode), (Vector3::zeros(), Mode::Open));
    assert_eq!(all[0].qd_plus, qd);
    let exact = Vector3::new(7.0 / 16.0, 0.0, 3.0 * 3.0_f64.sqrt() / 16.0);
    // Numbers of size one, through the inverse of H with the condition number 5.
    assert!((all[1].impulse - exact).amax() < 1e-14 && all[1].u_plus.amax() < 1e-14, "{:?}", all[1]);
    // M q̇⁺ = M q̇⁻ + Jᵀp with M = diag(1, 1, 1/12) and the lever from the centre to the end.
    let lever = Vector3::new(-0.25, 0.0, -0.25 * 3.0_f64.sqrt());
    let after = [exact.x - 1.0, exact.z, 12.0 * lever.cross(&exact).y];
    let off = DVector::from_column_slice(&all[1].qd_plus) - DVector::from_column_slice(&after);
    assert!(off.amax() < 1e-13, "{:?} against {after:?}", all[1].qd_plus);
    let of_contact = strike().contact().unwrap().branches(&law).unwrap();
    assert_eq!(of_contact.len(), 2);
    assert_eq!(of_contact[1].qd_plus, all[1].qd_plus);
}

/// Several laws and joint models at changing states: the same results as by `chain.impact`, and no allocation after the first.
#[test]
fn prepared_strike_equals_a_single_one_and_does_not_allocate() {
    let laws: [&dyn Law<f64, 3>; 3] = [
        &Frictionless { restitution: 0.5 },
        &Energetic { restitution: 0.5, friction: 0.3 },
        &Poisson { restitution: 0.2, friction: 0.8 },
    ];
    for robot in ["planar2", "planar3", "arm7", "humanoid29"] {
        let chain = Chain::from_urdf_file(format!("{}/../../robots/{robot}.urdf", env!("CARGO_MANIFEST_DIR"))).unwrap();
        let tip = chain.frame("tip").unwrap();
        let state = |k: usize| -> (Vec<f64>, Vec<f64>) {
            let draw = |a: f64| (0..chain.nv()).map(|i| (a * (i + 1) as f64 + k as f64).sin()).collect();
            (draw(0.7), draw(1.3))
        };
        let states: Vec<_> = (0..6).map(state).collect();
        let stiffness = vec![200.0; chain.nv()];
        let held = JointModel::Impedance { stiffness: &stiffness, damping: &stiffness, contact_time: 0.01 };
        for joints in [JointModel::Free, held] {
            let describe =
                |q, qd| chain.impact(q, qd).at(tip).offset([0.01, 0.0, 0.02]).normal([-1.0, 0.2, 0.1]).joints(joints);
            let mut prepared = describe(&[], &[]).prepare().unwrap();
            let mut hit = prepared.outcome();
            for (k, (q, qd)) in states.iter().enumerate() {
                for law in laws {
                    let count = allocation_counter::measure(|| prepared.resolve_into(q, qd, law, &mut hit).unwrap());
                    assert!(k == 0 || count.count_total == 0, "{robot}: {count:?}");
                    let single = describe(q, qd).resolve(law).unwrap();
                    let by_contact = describe(q, qd).contact().unwrap().resolve(law).unwrap();
                    assert_eq!((&hit.qd_plus, hit.mode), (&single.qd_plus, single.mode));
                    // ½ p·(u⁻ + u⁺) and the work of the drives are the change of T, from M and q̇ alone.
                    let work = 0.5 * hit.impulse.dot(&(hit.u_minus + hit.u_plus)) + hit.drive_work;
                    let scale = hit.energy_before.max(hit.energy_after).max(1e-3);
                    assert!((hit.energy_after - hit.energy_before - work).abs() < 1e-11 * scale, "{robot} {work}");
                    assert!((by_contact.energy_after - hit.energy_after).abs() < 1e-13 * scale);
                }
            }
        }
    }
}
