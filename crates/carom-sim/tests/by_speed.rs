//! Restitution that depends on the approach speed.

use carom_impact::{AnyLaw, Coefficients, ImpactProblem, LAW_NAMES, Law, Newton};
use carom_sim::{
    Compliance, ContactLaw, ContactRule, EventKind, Parameter, RestitutionBySpeed, SeveralLaw, SimError, Simulation,
    Touch,
};
use carom_testing::build::{Part, Z, chain, falling_ball};
use carom_testing::scenes::{guided_box, on_floor, with_robots};
use nalgebra::{Matrix3, Vector3, matrix, vector};

const A: f64 = 0.3;

/// The formula, written again.
fn e(speed: f64) -> f64 {
    1.0 - A * f64::exp(0.2 * speed.ln())
}

fn rule() -> ContactRule {
    let law = Newton { restitution: 0.0, friction: 0.2 };
    ContactRule::new(ContactLaw::by_speed(law, RestitutionBySpeed::Viscoelastic(A)))
}

#[test]
fn every_bounce_of_a_ball_has_the_coefficient_of_its_own_speed_and_the_ball_comes_to_rest() {
    let sim = on_floor(falling_ball(), rule());
    let run = sim.run(&[1.0], &[0.0], 4.0).unwrap();
    let mut speeds = Vec::new();
    for event in &run.events {
        if let EventKind::Impact { hit, .. } = &event.kind {
            let (before, after) = (-hit.contact.u_minus.z, hit.contact.u_plus.z);
            assert!((after - e(before) * before).abs() < 1e-12, "{before} {after}");
            speeds.push(before);
        }
    }
    assert!(speeds.len() > 20 && speeds[0] > 4.0 && speeds[20] < 0.1, "{speeds:?}");
    assert!(speeds.windows(2).all(|two| two[1] < two[0]));
    assert!(run.events.iter().any(|event| matches!(event.kind, EventKind::Zeno { .. })));
    assert_eq!(run.summary.contacts.len(), 1);
    assert!(run.summary.energy.error().abs() < 1e-8, "{:?}", run.summary.energy);
}

#[test]
fn every_law_has_the_coefficient_of_the_approach_speed() {
    let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, 0.2; 0.5, 0.2, 1.0];
    for name in LAW_NAMES {
        for speed in [0.01, 0.7, 3.0] {
            let problem = ImpactProblem::new(h, vector![0.4, -0.2, -speed]).unwrap();
            let own = |restitution| {
                let coefficients = Coefficients { restitution, friction: 0.4, tangential_restitution: 0.2 };
                AnyLaw::named(name, coefficients).unwrap()
            };
            let by_speed = ContactLaw::by_speed(own(0.0), RestitutionBySpeed::Viscoelastic(A));
            assert_eq!(by_speed.name(), name);
            let [hit, alone] =
                [by_speed.resolve(&problem).unwrap(), Law::<f64, 3>::resolve(&own(e(speed)), &problem).unwrap()];
            assert!((hit.impulse - alone.impulse).norm() < 1e-12, "{name} {speed}");
        }
    }
}

#[test]
fn several_contacts_and_time_steps_have_the_coefficients_of_their_own_speeds() {
    for stepping in [false, true] {
        let sim = Simulation { stepping, contact_step: 1e-4, ..guided_box(rule()) };
        let run = sim.run(&[0.5], &[0.0], 0.4).unwrap();
        let speed = (2.0 * 9.81 * 0.4_f64).sqrt();
        let last = e(speed) * speed - 9.81 * (0.4 - speed / 9.81);
        let bound = if stepping { 5e-3 } else { 1e-8 };
        let found = run.summary.last.qd[0];
        assert!((found - last).abs() < bound, "{stepping}: {found} {last}");
        if !stepping {
            let hit = &run.events[0];
            assert!(matches!(hit.kind, EventKind::Several { .. }), "{:?}", hit.kind);
            assert!((hit.qd_plus[0] - e(speed) * speed).abs() < 1e-9, "{hit:?}");
        }
    }
}

#[test]
fn what_has_one_coefficient_refuses_a_function_of_the_speed_by_name() {
    let refused = |sim: Simulation| sim.run(&[0.5], &[0.0], 0.4).unwrap_err().to_string();
    for several in SeveralLaw::ALL.into_iter().filter(|law| *law != SeveralLaw::Moreau) {
        let said = refused(Simulation { several, ..guided_box(rule()) });
        assert!(said.contains("box on floor") && said.contains("several = \"moreau\""), "{said}");
    }
    let soft = ContactRule { compliance: Some(Compliance::new(1e7)), ..rule() };
    let said = refused(guided_box(soft));
    assert!(said.contains("box on floor") && said.contains("compliant contacts have one coefficient"), "{said}");
    for (table, what) in [
        (vec![], "at least one pair"),
        (vec![[0.1, 0.5], [0.1, 0.4]], "above the one before"),
        (vec![[-0.1, 0.5]], "not negative"),
        (vec![[0.1, 0.5], [0.2, 1.5]], "between 0 and 1"),
        (vec![[f64::NAN, 0.5]], "finite"),
    ] {
        let law = ContactLaw::by_speed(Newton { restitution: 0.0, friction: 0.0 }, RestitutionBySpeed::Table(table));
        let said = refused(guided_box(ContactRule::new(law)));
        assert!(said.contains("box on floor") && said.contains(what), "{said}");
    }
}

/// The first rebound of a ball that reaches the floor at `speed`, with these lines of a scene.
fn rebound(speed: f64, surface: &str, lines: &str) -> Result<(f64, String), SimError> {
    let scene = with_robots(&format!(
        "[robot]\nurdf = \"ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 1, 0, 0, 0, 1]\n\
         qd = [0, 0, -{speed}, 0, 0, 0]\n[[surface]]\nname = \"floor\"\n\
         shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n{surface}\n{lines}\n\
         [run]\nduration = 2.0\ngravity = [0, 0, 0]\n"
    ))?;
    let plan = scene.plan()?;
    let run = plan.simulation.run(&plan.q, &plan.qd, scene.duration)?;
    let said = plan.kept.iter().map(|it| format!("{}: {}", it.what, it.choice)).collect::<Vec<_>>().join("; ");
    Ok((run.summary.last.qd[2], said))
}

#[test]
fn a_scene_file_gives_the_table_for_all_contacts_one_surface_or_one_pair() {
    let table = "restitution = { table = [[0, 0.9], [10, 0.5]] }";
    let whole = format!("[contact]\nlaw = \"energetic\"\n{table}\n");
    let own = format!("contact = {{ {table} }}");
    let pair = format!("[[contact.pair]]\nsurface = \"floor\"\n{table}\n");
    let rough = format!("{whole}\n[[contact.pair]]\nlink = \"ball\"\nfriction = 0.3\n");
    for (surface, lines) in [("", &whole), (own.as_str(), &String::new()), ("", &pair), ("", &rough)] {
        let (speed, said) = rebound(2.0, surface, lines).unwrap();
        assert!((speed - 0.82 * 2.0).abs() < 1e-12, "{surface} {lines}: {speed}");
        assert!(said.contains("restitution: ball on floor: 0.9 at 0 m/s, 0.5 at 10 m/s"), "{said}");
    }
    let number = format!("{whole}\n[[contact.pair]]\nlink = \"ball\"\nrestitution = 1\n");
    let (speed, said) = rebound(2.0, "", &number).unwrap();
    assert!((speed - 2.0).abs() < 1e-12 && !said.contains("at 0 m/s"), "{speed} {said}");
    let (speed, said) = rebound(2.0, "", "[contact]\nrestitution = { viscoelastic = 0.1 }\n").unwrap();
    assert!((speed - 2.0 * (1.0 - 0.1 * 2.0_f64.powf(0.2))).abs() < 1e-12, "{speed}");
    assert!(said.contains("1 − 0.1 v^(1/5)"), "{said}");
    for (value, what) in [
        ("\"soft\"", "viscoelastic = a"),
        ("{ viscous = 1 }", "viscoelastic"),
        ("{ viscoelastic = -1 }", "not negative"),
        ("{ table = [[0, 0.5, 1]] }", "one has 3 numbers"),
        ("{ table = [] }", "at least one pair"),
    ] {
        let refused = rebound(2.0, "", &format!("[contact]\nrestitution = {value}\n")).unwrap_err().to_string();
        assert!(refused.contains(what), "{value}: {refused}");
    }
}

#[test]
fn a_joint_limit_has_the_coefficient_of_its_approach_speed() {
    let slide = Part::slider("box", "base", Z).weighing(2.0, [1.0; 3]).limits(-1.0, 1.0, 10.0);
    let mut sim = Simulation { gravity: Vector3::zeros(), ..on_floor(chain(&[slide]), rule()) };
    sim.touches = Touch::all(&sim.chain, &[], 0.0).unwrap().touches;
    sim.touches.iter_mut().for_each(|touch| touch.contact = rule());
    let run = sim.run(&[0.0], &[3.0], 0.5).unwrap();
    assert!((run.summary.last.qd[0] + 3.0 * e(3.0)).abs() < 1e-12, "{:?}", run.summary.last);
}

#[test]
fn sensitivity_by_friction_stays_and_restitution_by_speed_is_no_parameter() {
    let sim = guided_box(rule());
    let names: Vec<String> = Parameter::all(&sim).iter().map(|it| it.name().to_owned()).collect();
    assert_eq!(names, ["friction"]);
    let changed = Parameter::friction().apply(&sim, 0.1).unwrap();
    assert!((changed.touches[0].contact.law.friction() - 0.3).abs() < 1e-15);
    let problem = ImpactProblem::new(Matrix3::identity(), vector![0.0, 0.0, -2.0]).unwrap();
    let after = changed.touches[0].contact.law.resolve(&problem).unwrap().u_plus.z;
    assert!((after - 2.0 * e(2.0)).abs() < 1e-12, "{after}");
}
