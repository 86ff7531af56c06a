//! The energy of time steps, each loss by its own formula, and what is left over as error.

use carom_sim::{ContactMode, Event, EventKind, Simulation};
use carom_testing::build::{O, Part, X, ball, brick, free, one_body, shape, stl, urdf};
use carom_testing::scenes::{newton, on_floor, scene};

/// A body that spins freely about none of its axes, by time steps: the energy error is of second order in the step, and nothing is booked.
#[test]
fn time_steps_without_a_contact_keep_the_energy_to_their_order() {
    let chain = free(1.0, [0.01, 0.02, 0.025], "");
    let q = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let qd = [0.0, 0.0, 0.0, 20.0, 3.0, -15.0];
    let error = |step: f64| {
        let sim = Simulation { stepping: true, contact_step: step, ..Simulation::new(chain.clone(), Vec::new()) };
        let books = sim.run(&q, &qd, 1.0).unwrap().summary.energy;
        assert_eq!((books.impacts, books.drive, books.resistance), (0.0, 0.0, 0.0));
        books.error() / books.start
    };
    let (coarse, fine) = (error(1e-3), error(5e-4));
    // 0.025 rad in a step, of which the square is 6e-4.
    assert!(coarse.abs() < 6e-4 && fine.abs() < 0.3 * coarse.abs(), "{coarse:e} and {fine:e}");
}

/// A ball that falls and comes to rest, by time steps: impacts take its energy, by −½ Σ (u⁻ + u⁺) p, and the error falls with the step.
#[test]
fn impulses_of_time_steps_take_the_energy_of_a_fall() {
    let ball = on_floor(free(2.0, [0.01; 3], &shape(&ball(0.1), O, O)), newton(0.3, 0.0));
    let q = [0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 1.0];
    let run = |contact_step: f64| {
        let sim = Simulation { stepping: true, contact_step, ..ball.clone() };
        let summary = sim.run(&q, &[0.0; 6], 1.5).unwrap().summary;
        assert_eq!(summary.warnings(), Vec::<String>::new());
        summary.energy
    };
    let fall = 2.0 * 9.81 * 0.5;
    for step in [1e-3, 1e-4] {
        let books = run(step);
        // A step of fall at the first impact, 3.1 m/s, moves it by 3.1 m/s · h: 2 · 9.81 · 3.1 h of potential energy.
        assert!((books.impacts - fall).abs() < 61.0 * step, "{} of {fall} J in steps of {step} s", books.impacts);
        assert!(books.error().abs() < 61.0 * step, "{} J in steps of {step} s", books.error());
    }
}

/// Elastic impacts by time steps keep the energy up to rounding, and rounding is not a gain.
#[test]
fn elastic_time_steps_gain_nothing() {
    let ball = on_floor(free(2.0, [0.01; 3], &shape(&ball(0.1), O, O)), newton(1.0, 0.0));
    let sim = Simulation { stepping: true, gravity: nalgebra::Vector3::zeros(), ..ball };
    for k in 1..40 {
        let speed = 0.1 * f64::from(k) / 3.0;
        let qd = [0.7 * speed, 0.3, -speed, 0.0, 0.0, 0.0];
        let summary = sim.run(&[0.0, 0.0, 0.1 + 0.011 * speed, 0.0, 0.0, 0.0, 1.0], &qd, 0.03).unwrap().summary;
        assert!((summary.last.qd[2] - speed).abs() < 1e-9, "it rebounds: {:?}", summary.last);
        assert_eq!(summary.statistics.energy_gained, 0.0, "{speed} m/s");
    }
}

/// A light ball between the floor and one that is 1e5 times as heavy: its impacts accumulate within a way of no size, fast as they are.
/// The energies close, nothing is gained, and both come to rest without time steps.
#[test]
fn a_light_ball_under_a_heavy_one_gains_no_energy() {
    let ball = |mass: f64| one_body(mass, [0.004 * mass; 3], &shape(&ball(0.1), O, O));
    let robot = |name: &str, z: f64| {
        format!(
            "[[robot]]\nname = \"{name}\"\nurdf = \"{name}.urdf\"\nfloating = true\nposition = [0, 0, {z}]\ntip = \"body\"\n"
        )
    };
    let text = robot("light", 0.15)
        + &robot("heavy", 0.36)
        + "[[surface]]\nname = \"floor\"\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }\n[contact]\nrestitution = 0.9\n\
           [run]\nduration = 0.5\ngravity = [0, 0, -9.81]\n";
    let files = [("light.urdf", &*ball(1.0)), ("heavy.urdf", &*ball(1e5))];
    let plan = scene(&files, &text).unwrap().plan().unwrap();
    let summary = plan.simulation.run(&plan.q, &plan.qd, 0.5).unwrap().summary;
    let books = summary.energy;
    // The heavy ball falls by 0.06 m.
    let fall = 1e5 * 9.81 * 0.06;
    assert!((books.impacts - fall).abs() < 1e-4 * fall, "{books:?}");
    assert!(books.error().abs() < 1e-6 * fall, "{books:?}, error {}", books.error());
    assert_eq!(summary.statistics.contact_steps, 0);
}

/// A box falls flat onto a mesh, which takes time steps; a ball beside it lies on a compliant floor: it sinks by (m g/k)^(1/n), as alone.
#[test]
fn a_compliant_contact_keeps_its_force_in_time_steps() {
    let robot = |element: &str| one_body(1.5, [0.01; 3], &shape(element, O, O));
    let corner = |x: f64, y: f64| [x, y, 0.0];
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let table = stl([[a, b, c], [a, c, d]]);
    let files = [("block.urdf", &*robot(&brick([0.2; 3]))), ("ball.urdf", &*robot(&ball(0.1))), ("table.stl", &*table)];
    let text = "
        [[robot]]\nname = 'a'\nurdf = 'block.urdf'\nfloating = true\nposition = [0, 0, 0.101]\ntip = 'body'
        [[robot]]\nname = 'b'\nurdf = 'ball.urdf'\nfloating = true\nposition = [5, 0, 0.1]\ntip = 'body'
        [[surface]]\nname = 'table'\nshape = { mesh = { file = 'table.stl' } }
        [[surface]]\nname = 'floor'\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }
        [contact]\nrestitution = 0.2\nbetween_robots = false
        [[contact.pair]]\nlink = 'b'\nsurface = 'floor'\ncompliance = { stiffness = 1e4, force = 'kelvin-voigt' }
        [[contact.pair]]\nlink = 'a'\nsurface = 'floor'\nlatch = false
        [run]\nduration = 0.5\ngravity = [0, 0, -9.81]\n"
        .replace("        ", "");
    let plan = scene(&files, &text).unwrap().plan().unwrap();
    let summary = plan.simulation.run(&plan.q, &plan.qd, 0.5).unwrap().summary;
    assert!(summary.statistics.contact_steps > 50, "{:?}", summary.statistics);
    let sunk = 1.5 * 9.81 / 1e4;
    // What is left of the oscillation after 0.5 s, with e = 0.2, is far below.
    assert!((summary.last.q[9] - (0.1 - sunk)).abs() < 1e-3 * sunk, "{:?}", summary.last.q);
    assert!(summary.energy.error().abs() < 1e-3 * summary.energy.start, "{:?}", summary.energy);
}

/// A balance that does not close is told from a thousandth of the energies on, with time steps from a hundredth; what time steps add, from a
/// millionth.
#[test]
fn a_balance_that_does_not_close_is_told() {
    let sim = Simulation::new(free(1.0, [1.0; 3], ""), Vec::new());
    let run = sim.run(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.1).unwrap();
    let told = |missing: f64, gained: f64, steps: usize| {
        let mut summary = run.summary.clone();
        summary.energy.end -= missing * summary.energy.start;
        (summary.statistics.energy_gained, summary.statistics.contact_steps) = (gained * summary.energy.start, steps);
        summary.warnings()
    };
    assert_eq!((told(0.0, 0.0, 0), told(5e-4, 0.0, 0), told(5e-3, 1e-7, 9)), (vec![], vec![], vec![]));
    let [exact, stepped, gained] = [told(2e-3, 0.0, 0), told(0.02, 0.0, 9), told(0.0, 1e-5, 9)].map(|all| all.concat());
    assert!(exact.contains("lost without a cause") && exact.ends_with("use a smaller tolerance"), "{exact}");
    assert!(stepped.ends_with("use shorter time steps (contact_step)"), "{stepped}");
    assert!(gained.contains("have added"), "{gained}");
}

/// A box falls flat onto a mesh, which takes time steps, and rebounds from it. Beside it a wheel turns against dry friction alone, at the rate
/// 5 − f t/J, in the steps and after them.
#[test]
fn what_turns_against_dry_friction_keeps_its_velocity_where_time_steps_end() {
    let corner = |x: f64, y: f64| [x, y, 0.0];
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let table = stl([[a, b, c], [a, c, d]]);
    let wheel = Part::new("wheel", "base", "continuous", X, [3.0, 0.0, 1.0])
        .weighing(1.0, [0.1; 3])
        .joint("<dynamics friction='0.01'/>");
    let files = [
        ("block.urdf", &*one_body(1.5, [0.01; 3], &shape(&brick([0.2; 3]), O, O))),
        ("wheel.urdf", &*urdf(&[wheel])),
        ("table.stl", &*table),
    ];
    let text = "[[robot]]\nname = \"block\"\nurdf = \"block.urdf\"\nfloating = true\nposition = [0, 0, 0.2]\ntip = \"body\"\n\
        [[robot]]\nname = \"wheel\"\nurdf = \"wheel.urdf\"\nqd = [5]\n\
        [[surface]]\nname = \"table\"\nshape = { mesh = { file = \"table.stl\" } }\n\
        [contact]\nrestitution = 0.5\n[run]\nduration = 0.3\ngravity = [0, 0, -9.81]\n";
    let plan = scene(&files, text).unwrap().plan().unwrap();
    let run = plan.simulation.run(&plan.q, &plan.qd, 0.3).unwrap();
    let free = |event: &Event| matches!(event.kind, EventKind::Mode { mode: ContactMode::Free });
    assert!(run.summary.statistics.contact_steps > 0 && run.events.iter().any(free), "the steps end");
    let rate = run.summary.last.qd[plan.simulation.chain.nv() - 1];
    assert!((rate - (5.0 - 0.01 * 0.3 / 0.1)).abs() < 1e-9, "{rate} rad/s");
}
