//! Links that bend in scenes: `[[robot.beam]]`.

use carom_sim::{Scene, SimError};
use carom_testing::build::{O, Part, X, Y, Z, ball, urdf};
use carom_testing::files::Folder;

const LENGTH: f64 = 0.8;
const MASS: f64 = 1.5;
/// Bending stiffness E I, N m².
const STIFFNESS: f64 = 40.0;
/// Gravity of the scenes with the hinged rod, m/s².
const GRAVITY: f64 = 9.81;

/// A folder with a rod along x that is fixed at its end, and another that hangs on a hinge about z.
struct Desk(Folder);

impl Desk {
    fn new() -> Self {
        let folder = Folder::new();
        let across = MASS * LENGTH * LENGTH / 12.0;
        for (file, kind) in [("clamped.urdf", "fixed"), ("hinged.urdf", "continuous")] {
            let rod = Part::new("rod", "base", kind, Z, O).com([LENGTH / 2.0, 0.0, 0.0]);
            folder.write(file, urdf(&[rod.weighing(MASS, [1e-9, across, across])]));
        }
        Self(folder)
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

/// One bend in the middle of a clamped rod: its outer half turns with the inertia m L²/24 on a spring E I/L with the damping
/// τ E I/L. Tolerance: the local tolerance of 1e-11 over some thousand steps.
#[test]
fn the_outer_half_of_a_clamped_rod_with_one_bend_is_a_damped_oscillator() {
    let desk = Desk::new();
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
    let desk = Desk::new();
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
    let desk = Desk::new();
    let robot = "[robot]\nurdf = \"hinged.urdf\"\nq = [0.3]";
    let said = |bends, rest: &str| desk.scene(robot, bends, rest).unwrap_err().to_string();
    let none = said(0, "");
    assert!(none.contains("link 'rod' as a beam") && none.contains("bends"), "{none}");
    let negative = said(2, "damping = -1");
    assert!(negative.contains("[[robot.beam]]") && negative.contains("damping of a spring"), "{negative}");
    let unknown = said(2, "damp = 1");
    assert!(unknown.contains("damp"), "{unknown}");
}

/// A free rod without gravity that falls at 60° on a compliant contact at its lower end. Rigid, it rebounds with the contact's e = 0.85.
/// With bends a part of the energy stays as vibration: it loses less energy in the contact, and its end rebounds less in the mean. Its
/// momentum is that of the contact's forces: the energies balance to the tolerance.
#[test]
fn a_bending_rod_keeps_a_part_of_its_bounce_as_vibration() {
    let desk = Desk::new();
    let across = MASS * LENGTH * LENGTH / 12.0;
    let rod = Part::hinge("rod", "b", Z).com([LENGTH / 2.0, 0.0, 0.0]).weighing(MASS, [1e-9, across, across]);
    let parts =
        [Part::slider("a", "base", X).massless(), Part::slider("b", "a", Y).massless(), rod.shaped(&ball(0.01))];
    desk.0.write("free.urdf", urdf(&parts));
    let run = |beam: &str| {
        let text = format!(
            "[robot]\nurdf = \"free.urdf\"\nq = [0, 0.0101, 1.0471975511965976]\nqd = [0, -1, 0]\n{beam}\n\
             [[surface]]\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 1, 0] }} }}\n\
             [contact]\nrestitution = 0.85\ncompliance = {{ stiffness = 1e9 }}\n[run]\nduration = 0.05\ntolerance = 1e-10\n"
        );
        let plan = Scene::from_toml(&text, &desk.0).unwrap().plan().unwrap();
        let summary = plan.run(0.05).unwrap().summary;
        assert!(summary.energy.error().abs() < 1e-8 * summary.energy.start, "{:?}", summary.energy);
        // Momentum along y over the mass: the velocity of the centre; the rigid rod's is 1 + 3 cos²60° times smaller than its end's.
        let mut workspace = plan.simulation.chain.workspace();
        let mass = workspace.update(&plan.simulation.chain, &summary.last.q).unwrap().mass_matrix();
        let momentum: f64 = summary.last.qd.iter().enumerate().map(|(k, x)| mass[(1, k)] * x).sum();
        (momentum / MASS, summary.energy)
    };
    let (rigid, _) = run("");
    // p = m (1 + e) v/(1 + 3 cos²θ), to the square of the contact's duration times the turn of the rod
    let expected = -1.0 + 1.85 / (1.0 + 3.0 * 0.25);
    assert!((rigid - expected).abs() < 2e-3, "{rigid} for {expected}");
    let (bent, energy) = run("[[robot.beam]]\nlink = \"rod\"\nfrom = [0, 0, 0]\nto = [0.8, 0, 0]\nbends = 8\n\
         bending = [{ axis = [0, 0, 1], stiffness = 40 }]");
    assert!(bent < rigid - 0.05, "{bent}, rigid {rigid}");
    assert!(energy.end > 0.5 * MASS * bent * bent, "{energy:?}");
}
