//! Numbers of answers are those of the library, whose tests compare them with closed forms and second computations; and the pictures of `law`.

use crate::command_line::desk::*;
use carom_impact::{Coefficients, ImpactProblem, LAW_NAMES, law_by_name};
use carom_sim::{Impacts, JointModel};
use carom_testing::files::robot;
use nalgebra::{DMatrix, Matrix2, Vector2, Vector3};
use serde_json::{Value, json};

/// Checks a number, or a list or a matrix by rows, but for the last bit, which the reader of JSON rounds.
#[track_caller]
fn same(what: &str, answer: &Value, key: &str, expected: &[f64]) {
    fn all(value: &Value) -> Vec<f64> {
        value.as_array().map_or_else(|| vec![number(value)], |items| items.iter().flat_map(all).collect())
    }
    let found = all(&answer[key]);
    assert_eq!(found.len(), expected.len(), "{what}: {key}");
    for (x, y) in found.iter().zip(expected) {
        close(&format!("{what}: {key}"), *x, *y, 1e-15 * y.abs().max(1.0));
    }
}

#[test]
fn numbers_of_dynamics_are_those_of_the_library() {
    let (desk, arm) = (Desk::new(), robot("arm7"));
    let q = [0.3, -1.1, 0.7, 0.5, -0.4, 0.9, 0.2];
    let (tau, qdd) = ([1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0], [7.0, 6.0, 5.0, -4.0, -3.0, -2.0, -1.0]);
    let (offset, gravity) = (Vector3::new(0.01, 0.02, 0.03), Vector3::new(0.0, 0.0, -9.81));
    let rows = |m: DMatrix<f64>| m.transpose().as_slice().to_vec();
    let mut workspace = arm.workspace();
    let mut at = workspace.update(&arm, &q).unwrap();
    let point = arm.point(arm.frame("tip").unwrap(), offset);
    for qd in [[0.4, 0.9, -0.2, 1.0, -0.7, 0.3, 2.0], [0.0; 7]] {
        let state = json!({"q": q, "qd": qd, "tau": tau, "qdd": qdd});
        let all = desk.answer("dynamics arm7.urdf --json --tip tip --point 0.01,0.02,0.03 --states -", &state);
        same("dynamics", &all, "mass_matrix", &rows(at.mass_matrix()));
        same("dynamics", &all, "jacobian", &rows(at.point_jacobian(point)));
        same("dynamics", &all, "delassus", at.delassus(point).unwrap().transpose().as_slice());
        same("dynamics", &all, "bias", at.bias(&qd, gravity).unwrap().as_slice());
        same("dynamics", &all, "gravity_force", at.gravity_force(gravity).as_slice());
        same("dynamics", &all, "kinetic_energy", &[at.kinetic_energy(&qd).unwrap()]);
        same("dynamics", &all, "potential_energy", &[at.potential_energy(gravity)]);
        same("dynamics", &all, "qdd", at.forward_dynamics(&qd, &tau, gravity).unwrap().as_slice());
        same("dynamics", &all, "tau", at.inverse_dynamics(&qd, &qdd, gravity).unwrap().as_slice());
    }
}

/// In the plane and in space, approaching and separating, with joints free, locked and driven; with one law the answer is its outcome.
#[test]
fn numbers_of_impacts_are_those_of_the_library() {
    let desk = Desk::new();
    let state = |n: u32| {
        let x = |k: u32| f64::from(7 * n + k);
        let q = [0.3 + 0.1 * x(0), -1.6 + 0.05 * x(1), 0.9 * x(2).sin(), 0.4, 0.5 * x(3).cos(), 0.6, 0.7];
        let qd = [(1.3 * x(0)).cos(), (2.1 * x(1)).sin(), 3.0 * (0.7 * x(2)).cos(), 0.4, 0.5, 0.6, (x(4)).sin()];
        (q, qd)
    };
    let driven = JointModel::Impedance { stiffness: &[0.0, 1e4, 0.0], damping: &[0.0, 5.0, 0.0], contact_time: 0.01 };
    let drives = "--joint-stiffness 0,1e4,0 --joint-damping 0,5,0 --contact-time 0.01";
    let (mut struck, mut apart) = (0, 0);
    for (name, n, normal, options, joints, [restitution, friction]) in [
        ("planar3", 3, [-0.8, 0.6, 0.0], "", JointModel::Free, [0.0, 0.0]),
        ("planar3", 3, [-0.8, 0.6, 0.0], "", JointModel::Free, [1.0, 2.0]),
        ("arm7", 7, [-1.0, -0.2, -0.4], "", JointModel::Free, [0.35, 0.3]),
        ("planar3", 3, [-0.8, 0.6, 0.0], "--locked elbow", JointModel::Locked(&["elbow"]), [0.4, 0.3]),
        ("planar3", 3, [-0.8, 0.6, 0.0], drives, driven, [0.4, 0.3]),
    ] {
        let chain = robot(name);
        let [x, y, z] = normal;
        let args = format!(
            "impact {name}.urdf --json --tip tip --normal {x},{y},{z} --restitution {restitution} --friction {friction} \
             {options} --states - --law"
        );
        let states: Vec<_> = (0..20).map(state).collect();
        let line = |(q, qd): &([f64; 7], [f64; 7])| json!({"q": q[..n], "qd": qd[..n]}).to_string() + "\n";
        let lines: String = states.iter().map(line).collect();
        let all = desk.answers(&format!("{args} all"), &lines);
        let laws = if options.is_empty() { &LAW_NAMES[..] } else { &[] };
        let alone: Vec<_> = laws.iter().map(|law| desk.answers(&format!("{args} {law}"), &lines)).collect();
        assert_eq!(all.len(), states.len());
        for (k, (all, (q, qd))) in all.iter().zip(&states).enumerate() {
            assert_eq!(keys(all), ["outcomes"], "nothing was refused");
            let outcomes = all["outcomes"].as_array().unwrap();
            assert_eq!(outcomes.len(), LAW_NAMES.len());
            for (law, answer) in LAW_NAMES.into_iter().zip(outcomes) {
                let of =
                    law_by_name::<3>(law, Coefficients { restitution, friction, ..Coefficients::default() }).unwrap();
                let strike =
                    chain.impact(&q[..n], &qd[..n]).at(chain.frame("tip").unwrap()).normal(normal).joints(joints);
                let hit = &strike.contact().unwrap().branches(&*of).unwrap()[0];
                let expected: [(&str, &[f64]); 8] = [
                    ("qd_plus", &hit.qd_plus),
                    ("impulse", hit.impulse.as_slice()),
                    ("u_minus", hit.u_minus.as_slice()),
                    ("u_plus", hit.u_plus.as_slice()),
                    ("energy_before", &[hit.energy_before]),
                    ("energy_after", &[hit.energy_after]),
                    ("normal_work", &[hit.contact.normal_work]),
                    ("friction_work", &[hit.contact.friction_work]),
                ];
                expected.iter().for_each(|(key, expected)| same(law, answer, key, expected));
                assert_eq!((texts(&answer["flags"]), &answer["law"]), (hit.flags.names().collect(), &json!(law)));
                assert_eq!(answer["mode"], json!(hit.mode.name()));
                if options.is_empty() {
                    assert!(answer.get("drive_work").is_none() && answer.get("drive_impulse").is_none());
                } else {
                    same(law, answer, "drive_work", &[hit.drive_work]);
                    same(law, answer, "drive_impulse", &hit.drive_impulse);
                }
                if hit.u_minus.dot(&Vector3::from(normal)) > 0.0 {
                    apart += 1;
                    assert_eq!((texts(&answer["flags"]), answer["mode"].as_str()), (vec!["no-approach"], Some("open")));
                    assert_eq!((&answer["impulse"], &answer["u_plus"]), (&json!([0.0, 0.0, 0.0]), &answer["u_minus"]));
                    assert_eq!(
                        (&answer["qd_plus"], &answer["energy_after"]),
                        (&answer["qd_minus"], &answer["energy_before"])
                    );
                }
                struck += usize::from(hit.impulse.norm() > 0.0);
            }
            for (outcome, alone) in outcomes.iter().zip(&alone) {
                assert_eq!(outcome, &alone[k]);
            }
        }
    }
    assert!(struck > 200 && apart > 100, "{struck} {apart}");
}

/// Of Kane and Levinson's pendulum, of a contact that separates, and of Painlevé's rod, which slides at u_n = 0 into a jam: every law with
/// friction has two solutions, and the answer lists both.
#[test]
fn numbers_of_laws_are_those_of_the_library_with_both_solutions_of_a_problem_that_has_two() {
    let desk = Desk::new();
    let b = -0.75 * 3.0_f64.sqrt();
    let pendulum = [[2.440338045696, 1.521308658011], [1.521308658011, 1.009560290504]];
    let mut twofold = 0;
    for (delassus, u, restitution, friction) in [
        (pendulum, [-0.267174342835, -0.134202014333], 0.5, 0.5),
        ([[2.0, 0.5], [0.5, 1.0]], [0.3, 0.1], 0.5, 0.3),
        ([[3.25, b], [b, 1.75]], [-1.0, 0.0], 0.0, 1.5),
    ] {
        let problem = ImpactProblem::new(Matrix2::from(delassus), Vector2::from(u)).unwrap();
        let args = format!("law --json --law all --restitution {restitution} --friction {friction} --problems -");
        let all = desk.answer(&args, &json!({"delassus": delassus, "u": u}));
        assert_eq!(all["outcomes"].as_array().unwrap().len(), LAW_NAMES.len(), "{all}");
        for (law, answer) in LAW_NAMES.into_iter().zip(all["outcomes"].as_array().unwrap()) {
            let of = law_by_name::<2>(law, Coefficients { restitution, friction, ..Coefficients::default() }).unwrap();
            let hits = of.branches(&problem).unwrap();
            assert_eq!((texts(&answer["flags"]), &answer["law"]), (hits[0].flags.names().collect(), &json!(law)));
            same(law, answer, "normal_work", &[hits[0].normal_work]);
            same(law, answer, "friction_work", &[hits[0].friction_work]);
            // A single solution is not listed; the first of several is the answer.
            let none = Vec::new();
            let listed = answer.get("branches").map_or(&none, |branches| branches.as_array().unwrap());
            assert_eq!(listed.len(), if hits.len() > 1 { hits.len() } else { 0 }, "{answer}");
            twofold += usize::from(hits.len() == 2);
            for (answer, hit) in [(answer, &hits[0])].into_iter().chain(listed.iter().zip(&hits)) {
                same(law, answer, "impulse", hit.impulse.as_slice());
                same(law, answer, "u_plus", hit.u_plus.as_slice());
                same(law, answer, "energy_ratio", &[hit.energy_ratio()]);
                assert_eq!(answer["mode"], json!(hit.mode.name()));
            }
        }
    }
    assert_eq!(twofold, 7);
    let problem = json!({"delassus": [[3.25, b], [b, 1.75]], "u": [-1.0, 0.0]});
    let ran = desk.feed("law --law energetic --restitution 0 --friction 1.5 --problems -", problem.to_string());
    done(&ran);
    assert!(ran.out.contains("  or also        stick        u⁺             0             0"), "{}", ran.out);
}

/// The first problem is drawn: a planar one as Routh diagram, one in space as hodograph.
#[test]
fn the_first_problem_is_drawn_in_the_plane_or_in_space() {
    let desk = Desk::new();
    let planar = json!({"delassus": [[2.44, 1.52], [1.52, 1.01]], "u": [-0.27, -0.13]});
    let spatial = json!({"delassus": [[2.0, 0.3, 0.5], [0.3, 1.5, -0.4], [0.5, -0.4, 1.2]], "u": [-0.25, 0.35, -1.0]});
    let args = "law --json --law all --restitution 0.6 --friction 0.3 --problems - --svg";
    let drawn = |file: &str, problems: &str| {
        assert!(!desk.answers(&format!("{args} {file}"), problems).is_empty());
        let svg = desk.read(file);
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for law in ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"]
        {
            assert!(svg.contains(law), "{law} in {file}");
        }
        svg
    };
    let routh = drawn("r.svg", &format!("{planar}\n{spatial}"));
    assert!(routh.contains("permissible") && !routh.contains("invariant"));
    let hodograph = drawn("h.svg", &format!("{spatial}\n{planar}"));
    // Reference values for this H and friction: -45.30081° outward, 151.39478° inward.
    assert!(hodograph.contains("invariant -45.3°, out") && hodograph.contains("invariant 151.4°, in"));
    assert!(!hodograph.contains("permissible"));
    let one = "law --law whittaker --restitution 0.6 --friction 0.3 --svg one.svg --problems -";
    done(&desk.feed(one, spatial.to_string()));
    let one = desk.read("one.svg");
    assert!(one.contains("whittaker") && one.contains("end of compression") && !one.contains("newton"));
}

#[test]
fn problems_that_cannot_be_drawn_are_refused_and_no_file_is_written() {
    let desk = Desk::new();
    let args = "law --law all --restitution 0.5 --friction 0.3 --problems - --svg";
    let refusals = [
        (
            r#"{"delassus":[[2,0,0],[0,2,0],[0,0,1]],"u":[1,0,1]}"#,
            "x.svg",
            "<stdin>:1: no picture can be drawn: the contact must approach (u_n < 0) and delassus must not be singular",
        ),
        (
            r#"{"delassus":[[1,1],[1,1]],"u":[1,-1]}"#,
            "x.svg",
            "<stdin>:1: no picture can be drawn: the contact must approach (u_n < 0) and delassus must not be singular",
        ),
        ("", "x.svg", "<stdin>: it holds no problem to draw: give at least one line"),
        (
            r#"{"delassus":[[2,0,0],[0,2,0],[0,0,1]],"u":[1,0,-1]}"#,
            "none/x.svg",
            "--out none/x.svg: there is no folder none: make it first",
        ),
    ];
    let before = desk.files("");
    for (problem, file, message) in refusals {
        refused(desk.feed(&format!("{args} {file}"), problem), message);
        assert_eq!(desk.files(""), before, "{message}");
    }
    let both = "law --law all --restitution 0.5 --friction 0.3 --problems - --svg x.svg --out x.rrd";
    let ran = desk.feed(both, r#"{"delassus":[[2,0,0],[0,2,0],[0,0,1]],"u":[1,0,-1]}"#);
    if cfg!(feature = "rerun") {
        done(&ran);
        assert!(std::fs::read(desk.join("x.rrd")).unwrap().starts_with(b"RRF2"));
        assert!(desk.join("x.svg").exists());
    } else {
        assert_eq!(ran.code, Some(1));
        assert!(ran.err.contains("build carom with the feature rerun"), "{}", ran.err);
        assert_eq!(desk.files(""), before);
    }
    let two = "--out x.rrd: a recording has one destination: leave out --connect and --spawn, or this file";
    refused(desk.feed(&format!("{both} --spawn"), ""), two);
}

/// Jᵀp = M (qd⁺ − qd⁻), and the moment through a hinge along its axis is the impulse of its drive: none where the joint is free.
#[test]
fn loads_are_those_that_change_the_velocities_and_that_drives_hold() {
    let desk = Desk::new();
    let state = json!({"q": [0.3, -1.1, 0.7], "qd": [0.4, 0.9, -0.2]});
    let args = "impact planar3.urdf --json --tip tip --normal -1,0,0 --law energetic --restitution 0.4 --friction 0.3 --states -";
    let mass = matrix(&desk.answer("dynamics planar3.urdf --json --tip tip --states -", &state)["mass_matrix"]);
    let free = desk.answer(&format!("{args} --loads"), &state);
    let asked = &free["loads"]["joint_impulse"];
    let change = vector(&free["qd_plus"]) - vector(&free["qd_minus"]);
    assert!((mass * change - vector(asked)).amax() < 1e-13 * vector(asked).amax());
    assert_eq!(free["q"], state["q"]);
    let locked = desk.answer(&format!("{args} --loads --locked elbow"), &state);
    for (hit, held) in [(&free, [0.0; 3]), (&locked, [0.0, number(&locked["drive_impulse"][1]), 0.0])] {
        let bearings = hit["loads"]["bearings"].as_array().unwrap();
        assert_eq!(bearings.len(), 3);
        for (bearing, held) in bearings.iter().zip(held) {
            let moment = number(&bearing["moment"][2]);
            close(bearing["joint"].as_str().unwrap(), moment, held, 1e-13);
        }
    }
    assert!(number(&locked["drive_impulse"][1]).abs() > 0.01, "the drive of a locked joint gets an impulse");
    let printed = desk.feed(&args.replace(" --json", " --loads"), state.to_string());
    done(&printed);
    assert!(printed.out.contains("through elbow") && printed.out.contains("Jᵀp"), "{}", printed.out);
}

/// A state may give the velocity of the contact point instead of qd: it is u⁻, and `--motion` says which joint velocities are taken.
#[test]
fn states_may_give_the_velocity_of_the_contact_point() {
    let desk = Desk::new();
    let args = "impact arm7.urdf --json --tip tip --point 0,0.1,0.05 --normal 0,0,1 --law energetic --restitution 0.4 --states -";
    let (q, u) = (json!([0, 0.5, 0.2, -1, 0, 1, 0]), [0.1, 0.0, -0.5]);
    let state = json!({"q": q, "tip_velocity": u});
    let least = desk.answer(args, &state);
    let mut energies = Vec::new();
    for motion in ["least-energy", "least-norm", "without-rotation"] {
        let hit = desk.answer(&format!("{args} --motion {motion}"), &state);
        assert!((vector(&hit["u_minus"]) - vector(&json!(u))).amax() < 1e-12, "{motion}");
        energies.push(number(&hit["energy_before"]));
        let again = desk.answer(args, &json!({"q": q, "qd": hit["qd_minus"]}));
        assert!((vector(&again["qd_plus"]) - vector(&hit["qd_plus"])).amax() < 1e-12, "{motion}");
    }
    assert_eq!(number(&least["energy_before"]), energies[0], "the least energy is taken without the option");
    assert!(energies[0] < energies[1] && energies[0] < energies[2], "{energies:?}");
    let refused = |state: serde_json::Value| {
        let ran = desk.feed(args, state.to_string());
        assert_eq!(ran.code, Some(1), "{}", ran.out);
        ran.err
    };
    let stretched = refused(json!({"q": [0, 0, 0, 0, 0, 0, 0], "tip_velocity": u}));
    assert!(
        stretched.contains("<stdin>:1") && stretched.contains("no joint velocities give the link 'tip'"),
        "{stretched}"
    );
    for both in [json!({"q": q, "qd": [0, 0, 0, 0, 0, 0, 0], "tip_velocity": u}), json!({"q": q})] {
        assert!(refused(both).contains("give qd or tip_velocity, one of both"));
    }
}
