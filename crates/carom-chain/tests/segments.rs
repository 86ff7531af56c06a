//! Links divided into segments by their bending stiffness, against the rigid link and the beam.

use carom_chain::Chain;
use carom_chain::urdf::{self, Beam, Bend, LoadOptions, Robot};
use nalgebra::{DMatrix, SymmetricEigen, Vector3};

const LENGTH: f64 = 0.8;
const MASS: f64 = 1.5;
const STIFFNESS: f64 = 40.0;

/// A link on a hinge about z, along x, with a tip at its end.
fn rod(com: [f64; 2], inertial: &str) -> Robot {
    let [x, y] = com;
    let text = format!(
        "<robot name='r'><link name='base'/><link name='rod'><inertial><origin xyz='{x} {y} 0'/><mass value='{MASS}'/>{inertial}\
         </inertial></link><link name='tip'/>\
         <joint name='hinge' type='continuous'><parent link='base'/><child link='rod'/><axis xyz='0 0 1'/></joint>\
         <joint name='end' type='fixed'><parent link='rod'/><child link='tip'/><origin xyz='{LENGTH} 0 0'/></joint></robot>"
    );
    urdf::read_str(&text, None, &LoadOptions::default()).unwrap()
}

/// The inertia of a uniform rod, of thickness besides.
fn uniform() -> String {
    let across = MASS * LENGTH * LENGTH / 12.0 + 1e-4;
    format!("<inertia ixx='2e-4' ixy='0' ixz='0' iyy='{across}' iyz='0' izz='{across}'/>")
}

fn beam(bends: usize, axes: &[Vector3<f64>]) -> Beam {
    let ends = [Vector3::zeros(), Vector3::new(LENGTH, 0.0, 0.0)];
    Beam { ends, bends, stiffness: axes.iter().map(|axis| (*axis, STIFFNESS)).collect() }
}

/// The chain of segments with all bends straight, its mass matrix, and the lateral Jacobian of the tip, y.
fn straight(robot: Robot, floating: bool) -> (Chain, DMatrix<f64>, Vec<f64>) {
    let options = LoadOptions { floating_base: floating, ..Default::default() };
    let chain = Chain::from_robot(robot, &options);
    let mut q = vec![0.0; chain.nq()];
    if floating {
        q[6] = 1.0;
    }
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let mut workspace = chain.workspace();
    let mut kinematics = workspace.update(&chain, &q).unwrap();
    let mass = kinematics.mass_matrix();
    let lateral = kinematics.point_jacobian(tip).row(1).iter().copied().collect();
    (chain, mass, lateral)
}

/// Mass, centre of mass and inertia are those of the link, whatever the number of bends and the place of the centre of mass: with
/// straight bends M of the joints of the file is that of the rigid robot. Tolerance: rounding.
#[test]
fn straight_segments_have_the_mass_matrix_of_the_rigid_link() {
    let (y, z) = (Vector3::y(), Vector3::z());
    for com in [0.3, 0.4, 0.52] {
        let link = rod([com, 0.01], "<inertia ixx='0.002' ixy='1e-4' ixz='0' iyy='0.1' iyz='0' izz='0.11'/>");
        let (_, rigid, _) = straight(link.clone(), true);
        for (bends, axes) in [(1, vec![z]), (4, vec![z]), (3, vec![z, y])] {
            let (robot, names) = link.with_segments("rod", &beam(bends, &axes)).unwrap();
            assert_eq!(names.len(), bends * axes.len());
            let (chain, mass, _) = straight(robot, true);
            assert_eq!(chain.nv(), rigid.nrows() + names.len());
            let difference = (mass.view((0, 0), rigid.shape()) - &rigid).abs().max();
            assert!(difference < 1e-14, "{bends} bends, centre at {com}: {difference}");
        }
    }
}

/// A force at the end of a cantilever moves it by F L³/(3 E I) (1 − 1/(4 n²)): the sum of (L − s)² over the bends, the midpoint
/// rule. Tolerance: rounding.
#[test]
fn the_static_deflection_is_that_of_the_cantilever_with_second_order() {
    for bends in [1, 2, 5, 20] {
        let (robot, springs) =
            rod([0.4, 0.01], &uniform()).with_segments("rod", &beam(bends, &[Vector3::z()])).unwrap();
        let (chain, _, lateral) = straight(robot, false);
        let compliance: f64 = springs.iter().map(|bend| lateral[number(&chain, bend)].powi(2) / bend.stiffness).sum();
        let exact = LENGTH.powi(3) / (3.0 * STIFFNESS) * (1.0 - 1.0 / (4.0 * (bends * bends) as f64));
        assert!((compliance / exact - 1.0).abs() < 1e-13, "{bends} bends: {compliance} for {exact}");
    }
}

/// The lowest frequency of the clamped rod tends to 3.516015 √(E I/(m L³)) (root 1.875104 of cos x cosh x = −1, squared) with second
/// order: 16 bends have a quarter of the error of 8. Thickness would add rotary inertia, so the
/// rod has none.
#[test]
fn the_lowest_frequency_tends_to_that_of_the_beam_with_second_order() {
    let across = MASS * LENGTH * LENGTH / 12.0;
    let thin = format!("<inertia ixx='1e-9' ixy='0' ixz='0' iyy='{across}' iyz='0' izz='{across}'/>");
    let exact = 1.875_104_068_711_961_f64.powi(2) * (STIFFNESS / (MASS * LENGTH.powi(3))).sqrt();
    let error = |bends: usize| {
        let (robot, springs) = rod([0.4, 0.0], &thin).with_segments("rod", &beam(bends, &[Vector3::z()])).unwrap();
        let (chain, mass, _) = straight(robot, false);
        let at: Vec<usize> = springs.iter().map(|bend| number(&chain, bend)).collect();
        // K^(-1/2) M K^(-1/2), of which the largest eigenvalue is 1/ω²
        let scaled = DMatrix::from_fn(bends, bends, |i, j| {
            mass[(at[i], at[j])] / (springs[i].stiffness * springs[j].stiffness).sqrt()
        });
        (1.0 / SymmetricEigen::new(scaled).eigenvalues.max()).sqrt() / exact - 1.0
    };
    let (coarse, fine) = (error(8), error(16));
    assert!(fine.abs() < 2e-3, "{fine}");
    assert!((3.8..4.2).contains(&(coarse / fine)), "errors {coarse} and {fine}");
}

/// Index of the joint of a bend in qd.
fn number(chain: &Chain, bend: &Bend) -> usize {
    (0..chain.nv()).find(|k| chain.joint_of_velocity(*k).unwrap().name == bend.joint).unwrap()
}

/// Joints, and shapes by their origin, are carried by the segment at their place, where they were.
#[test]
fn joints_and_shapes_stay_at_their_place() {
    let text = "<robot name='r'><link name='rod'><inertial><origin xyz='0.4 0 0'/><mass value='1'/>\
                <inertia ixx='0.06' ixy='0' ixz='0' iyy='0.06' iyz='0' izz='0.06'/></inertial>\
                <collision><origin xyz='0.5 0 0'/><geometry><sphere radius='0.1'/></geometry></collision></link>\
                <link name='side'/><joint name='mount' type='fixed'><parent link='rod'/><child link='side'/>\
                <origin xyz='0.2 0.1 0' rpy='0 0 0.3'/></joint></robot>";
    let robot = urdf::read_str(text, None, &LoadOptions::default()).unwrap();
    let (split, _) = robot.with_segments("rod", &beam(4, &[Vector3::z()])).unwrap(); // bends at 0.1, 0.3, 0.5, 0.7
    assert_eq!(split.links[split.joints[0].parent].name, "rod_part2");
    let owner: Vec<&str> =
        split.links.iter().filter(|it| !it.collisions.is_empty()).map(|it| it.name.as_str()).collect();
    assert_eq!(owner, ["rod_part4"]);
    let pose = |robot: Robot| {
        let chain = Chain::from_robot(robot, &LoadOptions::default());
        let side = chain.point(chain.frame("side").unwrap(), Vector3::new(0.01, 0.02, 0.03));
        let mut workspace = chain.workspace();
        workspace.update(&chain, &vec![0.0; chain.nq()]).unwrap().position(side)
    };
    assert!((pose(split) - pose(robot)).norm() < 1e-15);
}

#[test]
fn beams_that_make_no_sense_are_refused() {
    let link = rod([0.4, 0.01], &uniform());
    let told = |robot: &Robot, name: &str, beam: Beam| robot.with_segments(name, &beam).unwrap_err().to_string();
    let (good, z) = (beam(2, &[Vector3::z()]), Vector3::z());
    assert_eq!(told(&link, "rud", good.clone()), "no link is named 'rud'; did you mean 'rod'?");
    let cases = [
        ("base", good.clone(), "it has no mass that could be distributed"),
        ("rod", beam(0, &[z]), "0 bends: give at least 1"),
        ("rod", beam(2, &[]), "0 axes of bending: give one or two"),
        (
            "rod",
            Beam { ends: [z, z], ..good.clone() },
            "its ends are 0 m apart: the length must be positive and finite",
        ),
        ("rod", beam(2, &[Vector3::new(1.0, 1.0, 0.0)]), "axis of bending (1, 1, 0): it must be normal to the beam"),
        ("rod", beam(2, &[Vector3::zeros()]), "axis of bending (0, 0, 0): it must be normal to the beam"),
        (
            "rod",
            Beam { stiffness: vec![(z, -1.0)], ..good.clone() },
            "bending stiffness -1 N m²: it must be positive and finite",
        ),
    ];
    for (name, beam, problem) in cases {
        assert_eq!(told(&link, name, beam), format!("link '{name}' as a beam: {problem}"));
    }
    assert!(
        told(&rod([0.7, 0.01], &uniform()), "rod", good.clone())
            .contains("its centre of mass is 0.7 m from the first end")
    );
    let light = "<inertia ixx='2e-4' ixy='0' ixz='0' iyy='0.01' iyz='0' izz='0.01'/>";
    assert!(told(&rod([0.4, 0.01], light), "rod", good.clone()).contains("its inertia is less than that of its mass"));
    let (twice, _) = link.with_segments("rod", &good).unwrap();
    assert!(told(&twice, "rod", good).contains("link 'rod' as a beam"));
}
