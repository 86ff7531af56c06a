//! Loops in scene files: starts that are corrected or refused, messages, and the plan.

use carom_sim::{Scene, SimError};
use carom_testing::{files, scenes};

/// Reads a scene with the four-bar linkage of the repository.
fn read(text: &str) -> Result<Scene, SimError> {
    scenes::scene(&[("four_bar.urdf", &files::text("robots/four_bar.urdf"))], text)
}

fn said(text: &str) -> String {
    match read(text) {
        Err(error) => error.to_string(),
        Ok(scene) => panic!("{text}\n{:?}", scene.simulation.loops),
    }
}

const CLOSED: &str = "q = [1.5707963267948966, -1.04891532921801, 1.630572301105985]\n";
const HINGE: &str =
    "first = { link = \"coupler\", xyz = [0.6, 0, 0] }\nsecond = { link = \"rocker\", xyz = [0.5, 0, 0] }\n";

fn scene(state: &str, more: &str) -> String {
    format!("[robot]\nurdf = \"four_bar.urdf\"\n{state}[[loop]]\n{more}\n[run]\nduration = 0.1\n")
}

fn pin() -> String {
    format!("joint = \"pin\"\naxis = [0, 1, 0]\n{HINGE}")
}

#[test]
fn a_closed_start_is_taken_as_it_is() {
    let scene = read(&scene(CLOSED, &pin())).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert!((scene.q[1] + 1.04891532921801).abs() < 1e-12);
}

/// An open start is moved to a closed one: the warning says how far and where, and the velocities fit.
#[test]
fn an_open_start_is_closed_with_a_warning() {
    let open = "q = [1.57, -1.05, 1.7]\nqd = [8, -8, 3]\n";
    let scene = read(&scene(open, &pin())).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.starts_with("[robot] the start does not close the loops: moved by up to "), "{warning}");
    assert!(warning.contains(&format!("q = {:?}, qd = {:?}", scene.q, scene.qd)), "{warning}");
    // The ends of coupler and rocker, and their velocities.
    let ends = |q: &[f64], qd: &[f64]| {
        let (coupler, rocker) = (q[0] + q[1], q[2]);
        let place = [
            0.2 * q[0].cos() + 0.6 * coupler.cos() - 0.55 - 0.5 * rocker.cos(),
            0.2 * q[0].sin() + 0.6 * coupler.sin() - 0.5 * rocker.sin(),
        ];
        let rate = [
            -0.2 * qd[0] * q[0].sin() - 0.6 * (qd[0] + qd[1]) * coupler.sin() + 0.5 * qd[2] * rocker.sin(),
            0.2 * qd[0] * q[0].cos() + 0.6 * (qd[0] + qd[1]) * coupler.cos() - 0.5 * qd[2] * rocker.cos(),
        ];
        [place, rate].concat()
    };
    assert!(ends(&[1.57, -1.05, 1.7], &[8.0, -8.0, 3.0]).iter().any(|x| x.abs() > 1e-2));
    assert!(ends(&scene.q, &scene.qd).iter().all(|x| x.abs() < 1e-11), "{:?}", ends(&scene.q, &scene.qd));
    // A second reading of the new start changes nothing.
    let (again, qd) =
        scene.simulation.close_loops(&scene.q, &scene.qd).map(|(moment, _)| (moment.q, moment.qd)).unwrap();
    assert!(again.iter().zip(&scene.q).chain(qd.iter().zip(&scene.qd)).all(|(a, b)| (a - b).abs() < 1e-12));
}

/// Every message names the file, the loop, what is wrong and what to do.
#[test]
fn messages_name_the_loop_and_the_remedy() {
    let of = |joint: &str, first: &str, second: &str| {
        scene(CLOSED, &format!("joint = \"{joint}\"\nfirst = {{ {first} }}\nsecond = {{ {second} }}\n"))
    };
    let (coupler, rocker) = ("link = \"coupler\", xyz = [0.6, 0, 0]", "link = \"rocker\", xyz = [0.5, 0, 0]");
    for (name, text, parts) in [
        (
            "far",
            of("point", "link = \"coupler\", xyz = [5, 0, 0]", rocker),
            &["'loop 1'", "stays open by", "correct"][..],
        ),
        // A frame beside the plane, which no joint reaches: the direction says so.
        (
            "beside",
            of("point", "link = \"coupler\", xyz = [0.6, 0.01, 0]", rocker),
            &["'loop 1'", "0.01, ", "correct its frames"],
        ),
        ("unknown", of("point", "link = \"couple\"", rocker), &["[[loop]] 1", "couple", "coupler"]),
        (
            "same",
            of("weld", coupler, "link = \"tip\""),
            &["[[loop]] 1", "cannot move relative to each other", "name links"],
        ),
        ("twice", of("weld", coupler, coupler), &["cannot move relative to each other"]),
        ("world", of("weld", "xyz = [1, 0, 0]", "link = \"ground\""), &["cannot move relative to each other"]),
        (
            "axis",
            scene(CLOSED, &format!("joint = \"weld\"\naxis = [0, 1, 0]\n{HINGE}")),
            &["[[loop]] 1", "axis", "remove it"],
        ),
        (
            "zero",
            scene(CLOSED, &format!("joint = \"pin\"\naxis = [0, 0, 0]\n{HINGE}")),
            &["axis without direction", "give"],
        ),
        ("nan", of("point", "link = \"coupler\", xyz = [nan, 0, 0]", rocker), &["[[loop]] 1", "not finite"]),
        ("inf", of("point", "link = \"coupler\", rpy = [0, inf, 0]", rocker), &["[[loop]] 1", "not finite"]),
        ("kind", of("hinge", coupler, rocker), &["hinge", "pin"]),
        (
            "tip",
            scene(
                &format!("{CLOSED}tip = \"tip\"\ntip_velocity = {{ speed = 1, angle_deg = 30, along = [0, 0, 1] }}\n"),
                &pin(),
            ) + "[[surface]]\nshape = { halfspace = { point = [-0.12, 0, 0], normal = [1, 0, 0] } }\n",
            &["tip_velocity", "[[loop]]", "give qd"],
        ),
    ] {
        let said = said(&text);
        assert!(said.contains("scene.toml"), "{name}: {said}");
        for part in parts {
            assert!(said.contains(part), "{name}: '{part}' is missing in: {said}");
        }
    }
}

/// The controllers with formulas of a tree are refused, from a file and in a session.
#[test]
fn controllers_of_trees_are_refused() {
    let wall = "[[surface]]\nshape = { halfspace = { point = [-0.12, 0, 0], normal = [1, 0, 0] } }\n";
    let robot = format!("{CLOSED}tip = \"tip\"\n");
    let controller = "controller = \"impact-invariant\"\nkp = 1\nkd = 1\ntarget = [0, 0, 0]\n";
    let said = said(&(scene(&robot, &pin()) + controller + wall));
    assert!(said.contains("loop 1") && said.contains("choose another controller"), "{said}");
}

/// A plan keeps all joints, and says which loops it has.
#[test]
fn a_plan_keeps_all_joints_and_names_the_loops() {
    let wall = "[[surface]]\nshape = { halfspace = { point = [-0.12, 0, 0], normal = [1, 0, 0] } }\n";
    let closed = read(&(scene(CLOSED, &pin()) + wall)).unwrap().plan().unwrap();
    assert_eq!(closed.simulation.chain.nv(), 3);
    assert!(closed.kept.iter().any(|it| it.what == "loops" && it.choice == "loop 1 (pin)"), "{:?}", closed.kept);
    assert!(closed.flat.is_some());
    let text = (scene(CLOSED, &pin()) + wall).replace("[[loop]]", "[[spring]]");
    let open = text.split("[[spring]]").next().unwrap().to_owned() + "[run]\nduration = 0.1\n" + wall;
    let open = read(&open).unwrap().plan().unwrap();
    assert_eq!(open.simulation.chain.nv(), 3, "no contact reaches the rocker, but its motion is a result");
}

/// Axes that a file gives with five digits are not quite parallel: the loop closes along what its joints can move, and moves.
#[test]
fn a_linkage_with_rounded_axes_moves() {
    let rounded = "q = [1.5708, -1.0489, 1.6306]\nqd = [1, -1, 0.4]\n";
    for model in ["auto", "full"] {
        // The frame of the rocker's end is 1e-6 m beside the plane.
        let pin = pin().replace("xyz = [0.5, 0, 0]", "xyz = [0.5, 1e-6, 0]");
        let text = scene(rounded, &pin) + &format!("model = \"{model}\"\n");
        let plan = read(&text).unwrap().plan().unwrap();
        let last = plan.run(0.1).unwrap().summary.last;
        assert!((last.q[0] - std::f64::consts::FRAC_PI_2 - 0.1).abs() < 0.02, "{last:?}");
    }
}
