//! Numeric results, checked by a second computation or against the literature.

use crate::command_line::desk::*;
use serde_json::json;

/// `dynamics` and `impact` satisfy M q̈ + bias = τ, H = J M⁻¹ Jᵀ and M Δq̇ = Jᵀ p.
#[test]
fn dynamics_and_impact_agree() {
    let desk = Desk::new();
    let state = json!({
        "q": [0.3, -1.1, 0.7, 0.5, -0.4, 0.9, 0.2], "qd": [0.4, 0.9, -0.2, 1.0, -0.7, 0.3, 2.0],
        "tau": [1, -2, 3, -4, 5, -6, 7], "qdd": [7, 6, 5, -4, -3, -2, -1]
    });
    let all = desk.answer("dynamics arm7.urdf --json --tip tip --point 0.01,0.02,0.03 --states -", &state);
    let [m, jacobian, delassus] = ["mass_matrix", "jacobian", "delassus"].map(|key| matrix(&all[key]));
    let [q, qd, tau, qdd] = ["q", "qd", "tau", "qdd"].map(|key| vector(&state[key]));
    let [bias, answer_qdd, answer_tau] = ["bias", "qdd", "tau"].map(|key| vector(&all[key]));
    let inverse = m.clone().try_inverse().unwrap();
    assert!((&m * answer_qdd + &bias - tau).norm() < 1e-11);
    assert!((&m * qdd + bias - answer_tau).norm() < 1e-11);
    assert!((&jacobian * &inverse * jacobian.transpose() - &delassus).norm() < 1e-12 * delassus.norm());
    let energy = 0.5 * qd.dot(&(&m * &qd));
    close("kinetic energy", number(&all["kinetic_energy"]), energy, 1e-14 * energy);
    assert_eq!(m, m.transpose(), "the whole matrix is filled, and it is symmetric");

    let still = json!({"q": q.as_slice(), "qd": [0, 0, 0, 0, 0, 0, 0]});
    let still = desk.answer("dynamics arm7.urdf --json --tip tip --states -", &still);
    assert_eq!(vector(&still["bias"]), vector(&all["gravity_force"]), "at rest only gravity acts");

    let u = &jacobian * &qd;
    let normal = -&u;
    let args = format!(
        "impact arm7.urdf --json --tip tip --point 0.01,0.02,0.03 --normal {},{},{} --law frictionless --restitution 0.4",
        normal[0], normal[1], normal[2]
    );
    let state = json!({"q": q.as_slice(), "qd": qd.as_slice()});
    let hit = desk.answer(&format!("{args} --states -"), &state);
    let [impulse, qd_plus, u_minus, u_plus] = ["impulse", "qd_plus", "u_minus", "u_plus"].map(|key| vector(&hit[key]));
    assert!((&u_minus - &u).norm() < 1e-14 * u.norm());
    assert!((&jacobian * &qd_plus - &u_plus).norm() < 1e-12 * u.norm());
    assert!((&m * (qd_plus - qd) - jacobian.transpose() * impulse).norm() < 1e-12);
    close("u_n", u_plus.dot(&normal) / normal.dot(&normal), 0.4, 1e-13);
}

/// In the plane and in space, with coefficients from 0 to 2; with one law the answer is its outcome.
#[test]
fn every_law_has_an_answer_whose_work_is_the_energy_change() {
    let desk = Desk::new();
    let state = |n: u32| {
        let x = |k: u32| f64::from(7 * n + k);
        let q = [0.3 + 0.1 * x(0), -1.6 + 0.05 * x(1), 0.9 * x(2).sin(), 0.4, 0.5 * x(3).cos(), 0.6, 0.7];
        let qd = [(1.3 * x(0)).cos(), (2.1 * x(1)).sin(), 3.0 * (0.7 * x(2)).cos(), 0.4, 0.5, 0.6, (x(4)).sin()];
        (q, qd)
    };
    let laws = ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
    let mut impacts = 0;
    for (robot, joints, normal) in [("planar3", 3, "-0.8,0.6,0"), ("arm7", 7, "-1,-0.2,-0.4")] {
        let line = |n| json!({"q": state(n).0[..joints], "qd": state(n).1[..joints]}).to_string() + "\n";
        let lines: String = (0..20).map(line).collect();
        for options in
            ["--restitution 0 --friction 0", "--restitution 0.35 --friction 0.3", "--restitution 1 --friction 2"]
        {
            let args = format!("impact {robot}.urdf --json --tip tip --normal {normal} {options} --states - --law");
            let one = laws.map(|law| desk.answers(&format!("{args} {law}"), &lines));
            let all = desk.answers(&format!("{args} all"), &lines);
            assert_eq!(all.len(), 20);
            for (n, all) in all.iter().enumerate() {
                assert_eq!(keys(all), ["outcomes"], "nothing was refused");
                let outcomes = all["outcomes"].as_array().unwrap();
                assert_eq!(outcomes.len(), laws.len());
                for (hit, (law, one)) in outcomes.iter().zip(laws.iter().zip(&one)) {
                    assert_eq!((&hit["law"], hit), (&json!(law), &one[n]));
                    let [p, before, after] = ["impulse", "u_minus", "u_plus"].map(|key| vector(&hit[key]));
                    let [t_before, t_after, normal, friction] =
                        ["energy_before", "energy_after", "normal_work", "friction_work"].map(|key| number(&hit[key]));
                    // The tolerance is relative to the energy before, in which the rounding of M is.
                    close(law, 0.5 * p.dot(&(&before + &after)), t_after - t_before, 1e-12 * t_before);
                    close(law, normal + friction, t_after - t_before, 1e-12 * t_before);
                    let gains = hit["flags"].as_array().unwrap().contains(&json!("energy-gain"));
                    assert_eq!(gains, t_after > t_before * (1.0 + 1e-9), "{hit}");
                    impacts += usize::from(p.norm() > 0.0);
                }
            }
        }
    }
    assert!(impacts > 200, "{impacts}");
}

/// The stand-in arm strikes the wall x = 0.6364 at 0.2 m/s and 45° down the wall; the tangential speed more than doubles.
/// Expected values: closed form of the 2×2 problem of the arm, H_tn/H_nn = -0.887129.
#[test]
fn planar2_with_elbow_up_has_a_larger_tangential_speed_after_the_impact() {
    let desk = Desk::new();
    let speed = 0.2 / 2.0_f64.sqrt();
    let qd = rates(&desk, UP_ELBOW, [speed, -speed]);
    let args = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law frictionless --restitution 0.35 --states -";
    let hit = desk.answer(args, &json!({"q": UP_ELBOW, "qd": qd}));
    let [u_minus, u_plus, p] = ["u_minus", "u_plus", "impulse"].map(|key| vector(&hit[key]));
    close("u⁻ x", u_minus[0], 0.1414213562373095, 1e-15);
    close("u⁻ y", u_minus[1], -0.1414213562373095, 1e-15);
    close("u⁺ x", u_plus[0], -0.35 * 0.1414213562373095, 1e-15);
    close("u⁺ y", u_plus[1], -0.31079, 5e-6);
    assert_eq!((u_plus[2], hit["flags"].clone()), (0.0, json!([])));
    // H_nn = 0.547479 1/kg
    close("p x", p[0], -1.35 * 0.1414213562373095 / 0.547479, 5e-7);
    close("p y", p[1], 0.0, 1e-15);
    let gained = number(&hit["energy_after"]) - number(&hit["energy_before"]);
    close("½ p·(u⁻ + u⁺)", 0.5 * p.dot(&(u_minus + u_plus)), gained, 1e-12 * number(&hit["energy_before"]));
    close("energy lost", -gained, 16.028e-3, 5e-7);
}

#[test]
fn a_separating_contact_has_no_impulse() {
    let desk = Desk::new();
    let qd = rates(&desk, UP_ELBOW, [-0.1, 0.2]);
    let args =
        "impact planar2.urdf --json --tip tip --normal -1,0,0 --law all --restitution 0.5 --friction 0.3 --states -";
    let all = desk.answer(args, &json!({"q": UP_ELBOW, "qd": qd}));
    assert_eq!(all["outcomes"].as_array().unwrap().len(), 8, "{all}");
    for hit in all["outcomes"].as_array().unwrap() {
        assert_eq!(hit["flags"], json!(["no-approach"]), "{}", hit["law"]);
        assert_eq!((&hit["mode"], &hit["impulse"]), (&json!("open"), &json!([0.0, 0.0, 0.0])));
        assert_eq!((&hit["qd_plus"], &hit["u_plus"]), (&json!(qd), &hit["u_minus"]));
        assert_eq!(hit["energy_after"], hit["energy_before"]);
    }
    let problem = json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [0.3, 0.1]});
    let all = desk.answer("law --json --law all --restitution 0.5 --friction 0.3 --problems -", &problem);
    assert_eq!(all["outcomes"].as_array().unwrap().len(), 8, "{all}");
    for hit in all["outcomes"].as_array().unwrap() {
        assert_eq!((&hit["flags"], &hit["impulse"]), (&json!(["no-approach"]), &json!([0.0, 0.0])), "{}", hit["law"]);
    }
}

/// The double pendulum of Kane & Levinson (1985), e = μ = 0.5. Whittaker's law gains 59 % of the kinetic energy.
#[test]
fn outcomes_of_the_pendulum_of_kane_and_levinson_are_the_published_ones() {
    let desk = Desk::new();
    let problem = json!({
        "delassus": [[2.440338045696, 1.521308658011], [1.521308658011, 1.009560290504]],
        "u": [-0.267174342835, -0.134202014333]
    });
    let all = desk.answer("law --json --law all --restitution 0.5 --friction 0.5 --problems -", &problem);
    for (law, u_t, u_n, ratio) in [
        ("frictionless", 0.03616963, 0.06710101, 0.711412702),
        ("whittaker", 0.0, 0.06710101, 1.587494687),
        ("newton", 0.034824903986, 0.067101007166, 0.737153339),
        ("poisson", 0.004896652708, 0.042363910848, 0.545077987),
        ("energetic", 0.006306876507, 0.043529526627, 0.553187985),
        ("chatterjee-ruina", 0.044578, 0.067101, 0.562430),
        ("brach", 0.022397582349, 0.067101007167, 1.0), // limited by T⁺ ≤ T⁻
        ("smith", 0.044315, 0.067101, 0.566774),
    ] {
        let digits = if ["chatterjee-ruina", "smith"].contains(&law) { 5e-7 } else { 5e-9 };
        let hit = all["outcomes"].as_array().unwrap().iter().find(|hit| hit["law"] == json!(law)).unwrap();
        let u_plus = numbers(&hit["u_plus"]);
        close(law, u_plus[0], u_t, digits);
        close(law, u_plus[1], u_n, digits);
        close(law, number(&hit["energy_ratio"]), ratio, digits);
        let gain: &[&str] = if ratio > 1.0 { &["energy-gain"] } else { &[] };
        assert_eq!(texts(&hit["flags"]), gain, "{law}");
    }
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

/// Painlevé's rod slides at u_n = 0 into a jam: every law with friction has two solutions, and the answer lists both.
#[test]
fn both_solutions_of_a_non_unique_problem_are_listed() {
    let desk = Desk::new();
    let b = -0.75 * 3.0_f64.sqrt();
    let problem = json!({"delassus": [[3.25, b], [b, 1.75]], "u": [-1.0, 0.0]});
    let all = desk.answer("law --json --law all --restitution 0 --friction 1.5 --problems -", &problem);
    assert_eq!(all["outcomes"].as_array().unwrap().len(), 8, "{all}");
    for hit in all["outcomes"].as_array().unwrap() {
        if hit["law"] == json!("frictionless") {
            assert!(hit.get("branches").is_none(), "a single solution is not listed");
            continue;
        }
        assert_eq!(hit["flags"], json!(["jam", "non-unique", "no-approach"]));
        let branches = hit["branches"].as_array().unwrap();
        assert_eq!(branches.len(), 2);
        for key in ["impulse", "u_plus", "mode", "energy_ratio"] {
            assert_eq!(branches[0][key], hit[key], "the first is the answer");
        }
        // The impulse that stops the slip is H⁻¹ (1, 0) = (7/16, 3√3/16). Smith's law cannot stick, and its impulse is larger.
        let impulse = numbers(&branches[1]["impulse"]);
        if hit["law"] == json!("smith") {
            assert!(impulse[0] > 0.44 && numbers(&branches[1]["u_plus"])[0] > 0.1);
        } else {
            close("P_t", impulse[0], 7.0 / 16.0, 1e-14);
            close("P_n", impulse[1], 3.0 * 3.0_f64.sqrt() / 16.0, 1e-14);
            close("T⁺/T⁻", number(&branches[1]["energy_ratio"]), 0.0, 1e-14);
        }
    }
    let ran = desk.feed("law --law energetic --restitution 0 --friction 1.5 --problems -", problem.to_string());
    done(&ran);
    assert!(ran.out.contains("  or also        stick        u⁺             0             0"), "{}", ran.out);
}

/// Locked joints keep their velocities, and T⁺ − T⁻ = ½ p·(u⁻ + u⁺) + work of the drives.
#[test]
fn work_of_the_drives_is_part_of_the_energy_balance() {
    let desk = Desk::new();
    let state = json!({"q": [0.3, -1.1, 0.7], "qd": [0.4, 0.9, -0.2]});
    let args = "impact planar3.urdf --json --tip tip --normal -1,0,0 --law energetic --restitution 0.4 --friction 0.3";
    let free = desk.answer(&format!("{args} --states -"), &state);
    assert!(free.get("drive_work").is_none() && free.get("drive_impulse").is_none());
    let names = desk.answer("dynamics planar3.urdf --json --tip tip --states -", &state)["joints"].clone();
    let second = names[1].as_str().unwrap();
    let impulse_of = |options: &str| {
        let hit = desk.answer(&format!("{args} {options} --states -"), &state);
        let [p, before, after] = ["impulse", "u_minus", "u_plus"].map(|key| vector(&hit[key]));
        let [t_before, t_after, work] = ["energy_before", "energy_after", "drive_work"].map(|key| number(&hit[key]));
        close(options, 0.5 * p.dot(&(before + after)) + work, t_after - t_before, 1e-12 * t_before);
        (p.norm(), hit)
    };
    let (locked, hit) = impulse_of(&format!("--locked {second}"));
    assert_eq!(hit["qd_plus"][1], json!(0.9), "a locked joint keeps its velocity");
    let stiff = impulse_of("--joint-stiffness 0,1e9,0 --contact-time 0.01").0;
    close("a stiff joint is nearly locked", stiff, locked, 1e-3 * locked);
    let soft = impulse_of("--joint-stiffness 0 --joint-damping 0,0,0 --contact-time 0.01").0;
    close("a joint without stiffness is free", soft, vector(&free["impulse"]).norm(), 1e-14 * soft);
    assert!(impulse_of("--joint-damping 50 --contact-time 0.01").0 != soft);
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
