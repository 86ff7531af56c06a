//! Links that bend in scenes: `[[robot.beam]]`.

use carom_sim::{Scene, SimError};
use std::path::PathBuf;

const LENGTH: f64 = 0.8;
const MASS: f64 = 1.5;
/// Bending stiffness E I, N m².
const STIFFNESS: f64 = 40.0;
/// Gravity of the scenes with the hinged rod, m/s².
const GRAVITY: f64 = 9.81;

/// A folder with a rod along x that is fixed at its end, and another that hangs on a hinge about z.
struct Desk(PathBuf);

impl Desk {
    fn new(name: &str) -> Self {
        let desk = Self(std::env::temp_dir().join(format!("carom-beams-{name}-{}", std::process::id())));
        std::fs::create_dir_all(&desk.0).unwrap();
        let across = MASS * LENGTH * LENGTH / 12.0;
        for (file, kind) in [("clamped", "fixed"), ("hinged", "continuous")] {
            let text = format!(
                "<robot name='r'><link name='base'/><link name='rod'><inertial><origin xyz='{} 0 0'/><mass value='{MASS}'/>\
                 <inertia ixx='1e-9' ixy='0' ixz='0' iyy='{across}' iyz='0' izz='{across}'/></inertial></link>\
                 <joint name='hinge' type='{kind}'><parent link='base'/><child link='rod'/><axis xyz='0 0 1'/></joint></robot>",
                LENGTH / 2.0
            );
            std::fs::write(desk.0.join(format!("{file}.urdf")), text).unwrap();
        }
        desk
    }

    fn scene(&self, robot: &str, bends: usize, rest: &str) -> Result<Scene, SimError> {
        let beam = format!(
            "[[robot.beam]]\nlink = \"rod\"\nfrom = [0, 0, 0]\nto = [{LENGTH}, 0, 0]\nbends = {bends}\n\
             bending = [{{ axis = [0, 0, 1], stiffness = {STIFFNESS} }}]\n{rest}"
        );
        let run = "[run]\nduration = 0.5\ntolerance = 1e-11\n";
        let gravity = if robot.contains("hinged") { format!("gravity = [0, -{GRAVITY}, 0]") } else { String::new() };
        Scene::from_toml(&format!("{robot}\n{beam}\n{run}{gravity}\n"), &self.0)
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).unwrap();
    }
}

/// One bend in the middle of a clamped rod: its outer half turns with the inertia m L²/24 on a spring E I/L with the damping
/// τ E I/L. Tolerance: the local tolerance of 1e-11 over some thousand steps.
#[test]
fn the_outer_half_of_a_clamped_rod_with_one_bend_is_a_damped_oscillator() {
    let desk = Desk::new("clamped");
    let damping = 2e-3;
    let robot = "[robot]\nurdf = \"clamped.urdf\"\nq = [0.1]\nqd = [1.5]";
    let scene = desk.scene(robot, 1, &format!("damping = {damping}")).unwrap();
    let plan = scene.plan().unwrap();
    let run = plan.run(scene.duration).unwrap();
    let square = (STIFFNESS / LENGTH) / (MASS * LENGTH * LENGTH / 24.0); // ω²
    let decay = 0.5 * damping * square;
    let own = (square - decay * decay).sqrt();
    for time in [0.01, 0.1, 0.3, 0.5] {
        let exact = (-decay * time).exp() * (0.1 * (own * time).cos() + (1.5 + decay * 0.1) / own * (own * time).sin());
        let q = run.at(&plan.simulation.chain, time).q[0];
        assert!((q - exact).abs() < 1e-9, "{q} for {exact} at {time} s");
    }
}

/// A hinged rod that swings bends, and its energy is that of the start: m L² ω²/6 + m g (L/2) sin q of the straight rod. The bends start from 0 where q and qd leave them out, in `[robot]` and in one of several robots.
#[test]
fn numbers_of_bends_that_are_left_out_are_zero() {
    let desk = Desk::new("hinged");
    let one = desk.scene("[robot]\nurdf = \"hinged.urdf\"\nq = [0.3]\nqd = [2]", 3, "").unwrap();
    assert_eq!(
        (one.q.as_slice(), one.qd.as_slice()),
        ([0.3, 0.0, 0.0, 0.0].as_slice(), [2.0, 0.0, 0.0, 0.0].as_slice())
    );
    let summary = one.plan().unwrap().run(one.duration).unwrap().summary;
    let energy = MASS * LENGTH * LENGTH * 4.0 / 6.0 + MASS * GRAVITY * 0.5 * LENGTH * 0.3_f64.sin();
    assert!((summary.energy.start - energy).abs() < 1e-13, "{}", summary.energy.start);
    assert!((summary.energy.end - energy).abs() < 1e-9, "{}", summary.energy.end);
    assert!(summary.last.q[1..].iter().all(|bend| bend.abs() > 1e-6), "the rod does not bend: {:?}", summary.last.q);

    let named = desk.scene("[[robot]]\nname = \"a\"\nurdf = \"hinged.urdf\"\nq = [0.3]\nqd = [2]", 3, "").unwrap();
    assert_eq!((named.q, named.qd), (one.q, one.qd));
    let springs: Vec<&str> = named.simulation.springs.iter().map(|it| it.joint.as_str()).collect();
    assert_eq!(springs, ["a/rod_bend1", "a/rod_bend2", "a/rod_bend3"]);
}

#[test]
fn beams_that_cannot_be_are_refused_with_the_rule() {
    let desk = Desk::new("refused");
    let robot = "[robot]\nurdf = \"hinged.urdf\"\nq = [0.3]";
    let said = |bends, rest: &str| desk.scene(robot, bends, rest).unwrap_err().to_string();
    let none = said(0, "");
    assert!(none.contains("link 'rod' as a beam") && none.contains("bends"), "{none}");
    let negative = said(2, "damping = -1");
    assert!(negative.contains("[[robot.beam]]") && negative.contains("damping of a spring"), "{negative}");
    let unknown = said(2, "damp = 1");
    assert!(unknown.contains("damp"), "{unknown}");
}
