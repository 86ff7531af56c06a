//! The contract of the output: keys, orders, lines, streams.

use crate::command_line::desk::*;
use nalgebra::{DMatrix, DVector, Vector3};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::sync::mpsc;
use std::time::Duration;

/// The test of the page of answers compares the keys of every command with it.
#[test]
fn joints_of_two_robots_have_the_names_of_their_robots() {
    let desk = Desk::new();
    let arms = "[[robot]]\nname = \"a\"\nurdf = \"planar2.urdf\"\n\
                [[robot]]\nname = \"b\"\nurdf = \"planar2.urdf\"\nposition = [3, 0, 0]\n[run]\nduration = 0.1\n";
    desk.write("arms.toml", arms);
    let both = &desk.one("inspect arms.toml --json");
    assert_eq!(both["robots"][1], json!({"name": "b", "q": [2, 2], "qd": [2, 2]}));
    assert_eq!((&both["dof"], &both["joints"][0]["name"]), (&json!(4), &json!("a/shoulder")));
    let people = desk.run("inspect arms.toml");
    assert!(people.out.contains("\nrobot b: q 2 … 3, qd 2 … 3\n"), "{}", people.out);
    let run = &desk.one("simulate arms.toml --json");
    assert_eq!(run["joints"], json!(["a/shoulder", "a/elbow", "b/shoulder", "b/elbow"]));
    desk.refused(
        "inspect arms.toml --repair",
        "arms.toml: options for loading are keys of the scene: remove them here",
    );
}

#[test]
fn answers_have_qdd_and_tau_where_they_are_asked_for_and_all_laws_the_same_keys() {
    let desk = Desk::new();
    for (more, has) in
        [(json!({}), [false, false]), (json!({"tau": [0, 0]}), [true, false]), (json!({"qdd": [0, 0]}), [false, true])]
    {
        let mut state = json!({"q": [0, 0], "qd": [0, 0]});
        state.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let answer = desk.answer("dynamics planar2.urdf --json --tip tip --states -", &state);
        assert_eq!(["qdd", "tau"].map(|key| answer.get(key).is_some()), has, "{answer}");
    }
    let state = json!({"q": UP_ELBOW, "qd": [0.1, 0.3]});
    let impact = "impact planar2.urdf --json --tip tip --normal -1,0,0 --restitution 0.5 --friction 0.2 --states -";
    let problem = json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [0.3, -1]});
    let law = "law --json --restitution 0.5 --friction 0.2 --problems -";
    for (args, input) in [(impact, state), (law, problem)] {
        let all = desk.answer(&format!("{args} --law all"), &input);
        assert_eq!(keys(&all), ["outcomes"], "nothing was refused");
        let outcomes = all["outcomes"].as_array().unwrap();
        assert!(outcomes.len() >= 5);
        assert!(outcomes.iter().all(|outcome| keys(outcome) == keys(&outcomes[0])), "{all}");
    }
}

#[test]
fn inspect_reports_the_content_of_the_file() {
    let desk = Desk::new();
    let report = &desk.one("inspect planar2.urdf --json");
    for (key, value) in [
        ("name", json!("planar2")),
        ("dof", json!(2)),
        ("nq", json!(2)),
        ("nv", json!(2)),
        ("links", json!(["base", "link1", "elbow_stator", "link2", "tip"])),
        ("total_mass", json!(19.689)),
        ("planar", json!({"is": true, "normal": [0.0, 0.0, 1.0], "reason": null})),
        ("warnings", json!([])),
    ] {
        assert_eq!(report[key], value, "{key}");
    }
    assert_eq!(
        report["joints"][2],
        json!({
            "name": "elbow", "type": "revolute", "parent": "link1", "child": "link2",
            "lower": -3.1, "upper": 3.1, "velocity": 18.85, "effort": 40.0,
            "damping": 0.0, "friction": 0.0, "rotor_inertia": 0.0, "mimic": null
        })
    );
    let arm = &desk.one("inspect arm7.urdf --json");
    assert_eq!(
        arm["planar"],
        json!({
            "is": false, "normal": null,
            "reason": "joint 'shoulder_pitch' leaves the plane: its axis (0.000000, 1.000000, 0.000000) is not parallel to that of 'shoulder_yaw'"
        })
    );
    let floating = &desk.one("inspect planar2.urdf --floating --json");
    assert_eq!((&floating["dof"], &floating["nq"], &floating["nv"]), (&json!(8), &json!(9), &json!(8)));
    assert_eq!(
        floating["joints"][0],
        json!({
            "name": "root_joint", "type": "floating", "parent": "world", "child": "base",
            "lower": null, "upper": null, "velocity": null, "effort": null, "damping": 0.0,
            "friction": 0.0, "rotor_inertia": 0.0, "mimic": null
        })
    );
}

#[test]
fn the_total_mass_of_a_massless_robot_is_zero() {
    let desk = Desk::new();
    desk.write("r.urdf", robot("<link name='a'/>"));
    let ran = desk.run("inspect r.urdf --json");
    done(&ran);
    assert!(ran.out.contains(r#""total_mass":0.0"#), "{}", ran.out);
}

#[test]
fn tangential_restitution_acts_on_chatterjee_ruina_and_warns_with_other_laws() {
    let desk = Desk::new();
    let sphere = json!({"delassus": [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]], "u": [0.6, -0.8, -1]});
    let args = "law --json --restitution 0.8 --friction 0.9 --problems - --law";
    for (options, v_t) in [("", 0.0), (" --tangential-restitution 0.5", -0.5), (" --tangential-restitution -1", 1.0)] {
        let ran = desk.feed(&format!("{args} chatterjee-ruina{options}"), sphere.to_string());
        done(&ran);
        let hit: Value = serde_json::from_str(&ran.out).unwrap();
        let u_plus = numbers(&hit["u_plus"]);
        close("u⁺", (u_plus[0] - 0.6 * v_t).abs() + (u_plus[1] + 0.8 * v_t).abs(), 0.0, 1e-15);
        assert_eq!(ran.err, "", "no warning");
    }
    let ran = desk.feed(&format!("{args} newton --tangential-restitution 0.5"), sphere.to_string());
    assert!(ran.err.contains("--tangential-restitution is not used by newton"), "{}", ran.err);
}

#[test]
fn laws_without_an_answer_are_listed_beside_the_answers_of_the_others() {
    let desk = Desk::new();
    let problem = json!({"delassus": [[1, 1], [1, 1]], "u": [-1, -1]});
    let args = "law --json --restitution 0.5 --friction 2 --problems - --law";
    let all = desk.answer(&format!("{args} all"), &problem);
    let outcomes = all["outcomes"].as_array().unwrap();
    let refusals = all["refused"].as_array().unwrap();
    assert!(!outcomes.is_empty() && !refusals.is_empty() && outcomes.len() + refusals.len() == 8, "{all}");
    for outcome in outcomes {
        let law = outcome["law"].as_str().unwrap();
        assert_eq!(desk.answer(&format!("{args} {law}"), &problem), *outcome);
    }
    for refusal in refusals {
        let [law, reason] = ["law", "reason"].map(|key| refusal[key].as_str().unwrap());
        refused(desk.feed(&format!("{args} {law}"), problem.to_string()), &format!("<stdin>:1: {reason}"));
    }
}

#[test]
fn joints_option_permutes_all_inputs_and_outputs() {
    let desk = Desk::new();
    let (file, asked) = (["shoulder", "elbow", "wrist"], ["wrist", "shoulder", "elbow"]);
    let place: Vec<usize> = asked.iter().map(|name| file.iter().position(|own| own == name).unwrap()).collect();
    let permuted = |x: &[f64]| -> Vec<f64> { place.iter().map(|&i| x[i]).collect() };
    let (q, qd, tau, qdd) = ([0.3, -1.1, 0.7], [0.4, 0.9, -0.2], [1.0, -2.0, 0.5], [3.0, 0.1, -4.0]);

    let dynamics = "dynamics planar3.urdf --json --tip tip --gravity 0,-9.81,0 --states -";
    let plain = desk.answer(dynamics, &json!({"q": q, "qd": qd, "tau": tau, "qdd": qdd}));
    let theirs = desk.answer(
        &format!("{dynamics} --joints {}", asked.join(",")),
        &json!({"q": permuted(&q), "qd": permuted(&qd), "tau": permuted(&tau), "qdd": permuted(&qdd)}),
    );
    assert_eq!(plain["joints"], json!(file));
    assert_eq!(theirs["joints"], json!(asked));
    for key in ["bias", "gravity_force", "qdd", "tau"] {
        assert_eq!(numbers(&theirs[key]), permuted(&numbers(&plain[key])), "{key}");
        assert!(numbers(&plain[key]).iter().all(|x| *x != 0.0), "{key}: zeros would hide a wrong order");
    }
    let m = matrix(&plain["mass_matrix"]);
    assert_eq!(matrix(&theirs["mass_matrix"]), DMatrix::from_fn(3, 3, |i, j| m[(place[i], place[j])]));
    let jacobian = matrix(&plain["jacobian"]);
    assert_eq!(matrix(&theirs["jacobian"]), DMatrix::from_fn(3, 3, |i, j| jacobian[(i, place[j])]));
    for key in ["delassus", "kinetic_energy", "potential_energy"] {
        assert_eq!(theirs[key], plain[key], "{key}");
    }

    let impact =
        "impact planar3.urdf --json --tip tip --normal 0,-1,0 --law energetic --restitution 0.5 --friction 0.2";
    let plain = desk.answer(&format!("{impact} --states -"), &json!({"q": q, "qd": qd}));
    let theirs = desk.answer(
        &format!("{impact} --states - --joints {}", asked.join(",")),
        &json!({"q": permuted(&q), "qd": permuted(&qd)}),
    );
    assert_eq!(plain["flags"], json!([]));
    assert_eq!(numbers(&theirs["qd_plus"]), permuted(&numbers(&plain["qd_plus"])));
    assert_eq!(theirs["impulse"], plain["impulse"]);
}

/// A floating body with a hinged arm.
fn floater() -> String {
    let arm = limb("b", "a", "continuous", r#"<axis xyz="0 1 0"/>"#);
    robot(&format!(r#"<link name="a">{INERTIAL}</link>{arm}"#))
}

#[test]
fn floating_base_comes_first_or_where_joints_option_names_it() {
    let desk = Desk::new();
    desk.write("r.urdf", floater());
    let (base_q, base_qd) = ([0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let args = "dynamics r.urdf --floating --json --tip b --states -";
    let qd = [&base_qd[..], &[-2.0]].concat();
    let first = json!({"q": ([&base_q[..], &[0.7]].concat()), "qd": (qd)});
    let last = json!({"q": ([&[0.7], &base_q[..]].concat()), "qd": ([&[-2.0], &base_qd[..]].concat())});
    let plain = desk.answer(args, &first);
    assert_eq!(plain["joints"], json!(["root_joint", "continuous_b"]));
    assert_eq!(numbers(&plain["bias"]).len(), 7);
    assert_eq!(
        desk.answer(&format!("{args} --joints continuous_b"), &first),
        plain,
        "a base that is not named comes first"
    );
    assert_eq!(desk.answer(&format!("{args} --joints root_joint,continuous_b"), &first), plain);

    let turned = desk.answer(&format!("{args} --joints continuous_b,root_joint"), &last);
    assert_eq!(turned["joints"], json!(["continuous_b", "root_joint"]));
    let place = |i: usize| (i + 6) % 7;
    let (m, n) = (matrix(&plain["mass_matrix"]), matrix(&turned["mass_matrix"]));
    assert_eq!(n, DMatrix::from_fn(7, 7, |i, j| m[(place(i), place(j))]));
    let bias = numbers(&plain["bias"]);
    assert_eq!(numbers(&turned["bias"]), (0..7).map(|i| bias[place(i)]).collect::<Vec<_>>());
    assert_eq!(turned["delassus"], plain["delassus"]);

    // qd of the root: linear, then angular velocity in its own axes, which are rotated by 2 atan(0.6/0.8) about y.
    let own = |v: [f64; 3]| {
        let (c, s) = (0.28, 0.96);
        Vector3::new(c * v[0] + s * v[2], v[1], -s * v[0] + c * v[2])
    };
    let root = desk.answer("dynamics r.urdf --floating --json --tip a --states -", &first);
    let u = matrix(&root["jacobian"]) * DVector::from_vec(qd);
    assert!((u - own([1.0, 2.0, 3.0])).norm() < 1e-14);
}

#[test]
fn a_joint_of_the_file_named_root_joint_is_refused_with_floating() {
    let desk = Desk::new();
    desk.write("r.urdf", floater().replace("continuous_b", "root_joint"));
    let message = "r.urdf:1: joint 'root_joint': the floating base is added as a joint of this name: rename the joint, or \
                   load the robot without a floating base";
    for args in [
        "inspect r.urdf --floating",
        "dynamics r.urdf --floating --json --tip b --states -",
        "dynamics r.urdf --floating --json --tip b --joints root_joint --states -",
    ] {
        desk.refused(args, message);
    }
    // Without --floating it is a joint like any other.
    let answer = desk.answer("dynamics r.urdf --json --tip b --states -", &json!({"q": [0.5], "qd": [1]}));
    assert_eq!((&answer["joints"], matrix(&answer["mass_matrix"]).nrows()), (&json!(["root_joint"]), 1));
}

#[test]
fn joints_option_must_name_every_joint_but_a_floating_base() {
    let desk = Desk::new();
    let axis = r#"<axis xyz="1 0 0"/>"#;
    let arm = limb("b", "a", "continuous", axis) + &limb("c", "b", "continuous", axis);
    desk.write("r.urdf", robot(&format!(r#"<link name="a"/>{}"#, arm.replace("continuous_c", "root_joint"))));
    desk.refused(
        "dynamics r.urdf --json --tip c --joints continuous_b --states -",
        "r.urdf: --joints: joint 'root_joint' is not in the list: name every moving joint",
    );
}

#[test]
fn each_line_of_a_pipe_is_answered_before_the_next_is_read() {
    let desk = Desk::new();
    for (args, line) in [
        ("dynamics planar2.urdf --json --tip tip --states -", r#"{"q":[0,1],"qd":[1,0]}"#),
        ("dynamics planar2.urdf --tip tip --states -", r#"{"q":[0,1],"qd":[1,0]}"#),
        (
            "impact planar2.urdf --json --tip tip --normal -1,0,0 --law all --restitution 0.5 --states -",
            r#"{"q":[0,1],"qd":[1,0]}"#,
        ),
        ("law --json --law newton --restitution 0.5 --problems -", r#"{"delassus":[[2,0],[0,1]],"u":[0,-1]}"#),
    ] {
        let mut child = desk.command(args).spawn().unwrap();
        let (mut stdin, stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let (answered, answers) = mpsc::channel();
        let reader = std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines() {
                answered.send(line.unwrap()).unwrap();
            }
        });
        for _ in 0..3 {
            writeln!(stdin, "{line}").unwrap();
            stdin.flush().unwrap();
            // The pipe stays open, so a command that reads all of it first never answers. The time limit only ends the test then.
            let first = answers.recv_timeout(Duration::from_secs(60)).expect(args);
            assert!(!first.is_empty(), "{args}");
            if !args.contains("--json") {
                while !answers.recv_timeout(Duration::from_secs(60)).expect(args).is_empty() {}
            }
        }
        drop(stdin);
        assert!(child.wait().unwrap().success(), "{args}");
        reader.join().unwrap();
        assert!(answers.try_recv().is_err(), "{args}: three lines, three answers");
    }
}

#[test]
fn answers_are_in_the_order_of_the_lines() {
    let desk = Desk::new();
    let lines: Vec<String> = (0..500).map(|i| json!({"q": [0, 0], "qd": [i, 0]}).to_string()).collect();
    desk.write("s.jsonl", lines.join("\n"));
    let answers = desk.answers("dynamics planar2.urdf --json --tip tip --states s.jsonl", "");
    assert_eq!(answers.len(), 500);
    for (i, answer) in answers.iter().enumerate() {
        let energy = 0.5 * 3.957 * (i * i) as f64; // M₁₁ of the straight arm, kg m²
        close("kinetic energy", number(&answer["kinetic_energy"]), energy, 1e-13 * energy);
    }
}

/// The answers to the lines before a refused one are written, with `--json` and without; no file is written.
#[test]
fn a_refused_line_leaves_the_answers_before_it_and_no_file() {
    let desk = Desk::new();
    let state = |qd: f64| json!({"q": UP_ELBOW, "qd": [qd, 0.3]}).to_string();
    let problem = |v: f64| json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [v, -1]}).to_string();
    let law = "law --law all --restitution 0.5 --friction 0.2 --problems";
    for (args, lines, bad, reason) in [
        (
            "dynamics planar2.urdf --tip tip --states",
            [0.1, 0.2, 0.3].map(state),
            r#"{"q":[0],"qd":[0,0]}"#,
            "q has 1 numbers, 2 are needed (shoulder, elbow)",
        ),
        (
            "impact planar2.urdf --tip tip --normal -1,0,0 --law all --restitution 0.5 --states",
            [0.1, 0.2, 0.3].map(state),
            "oops",
            "expected value at column 1",
        ),
        (
            law,
            [0.1, 0.2, 0.3].map(problem),
            r#"{"delassus":[[1]],"u":[-1]}"#,
            "u has 1 numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed",
        ),
    ] {
        for json in ["", " --json"] {
            let three = lines.join("\n");
            let answered = desk.feed(&format!("{args} -{json}"), &three);
            done(&answered);
            let four = format!("{three}\n{bad}\n{}\n", lines[0]);
            desk.write("four.jsonl", &four);
            for (file, named) in [("-", "<stdin>"), ("four.jsonl", "four.jsonl")] {
                let ran = desk.feed(&format!("{args} {file}{json}"), &four);
                let expected =
                    Ran { code: Some(1), out: answered.out.clone(), err: format!("error: {named}:4: {reason}\n") };
                assert_eq!(ran, expected, "{args} {file}{json}");
            }
        }
    }
    let before = desk.files("");
    desk.write("four.jsonl", format!("{}\n{}\n{}\noops\n", problem(0.1), problem(0.2), problem(0.3)));
    let ran = desk.run(&format!("{law} four.jsonl --json --svg x.svg"));
    assert_eq!((ran.code, ran.out.lines().count()), (Some(1), 3));
    assert_eq!(desk.files(""), before, "no picture, no partial file");
    // A fit reads all of its lines first, and prints nothing if one is refused.
    let jump = json!({"delassus": [[1, 0], [0, 1]], "u_minus": [0.1, -1], "u_plus": [0, 0.5]});
    desk.write("jumps.jsonl", format!("{jump}\n{jump}\n{jump}\noops\n"));
    desk.refused("fit --velocities jumps.jsonl", "jumps.jsonl:4: expected value at column 1");
}
