//! Invalid robots, and robots with warnings.

use crate::command_line::desk::*;
use serde_json::json;

/// Of the document, of a number, of an inertia and of a name; the tests of carom-chain have all messages.
#[test]
fn invalid_robots_are_refused_by_every_command_with_the_same_message() {
    let desk = Desk::new();
    let cases = [
        (String::new(), "r.urdf:1: XML: is not well-formed: the document does not have a root node; correct the file"),
        (
            hinged(INERTIAL).replace("</joint>", "<origin xyz='0 1e999 0'/></joint>"),
            r#"r.urdf:1: joint 'j' <origin xyz>: "0 1e999 0" is wrong: '1e999' is not a finite number up to 1e100"#,
        ),
        (
            hinged(INERTIAL).replace(r#"ixy="0""#, r#"ixy="2""#),
            "r.urdf:1: link 'b' <inertia>: principal moments -1, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz, or raise them to the nearest possible ones: --repair (LoadOptions::repair)",
        ),
        (
            hinged(INERTIAL).replace(r#"<parent link="a"/>"#, "<parent link='upper'/>"),
            "r.urdf:1: joint 'j' <parent link>: no link is named 'upper': there are 'a' and 'b'",
        ),
    ];
    for (text, message) in cases {
        desk.write("r.urdf", text);
        for command in [
            "inspect r.urdf",
            "inspect r.urdf --json",
            "dynamics r.urdf --json --tip b --states -",
            "impact r.urdf --json --tip b --normal 0,0,1 --law all --restitution 0.5 --states -",
        ] {
            desk.refused(command, message);
        }
    }
}

#[test]
fn massless_moving_links_are_accepted_if_a_link_below_has_inertia() {
    let desk = Desk::new();
    let two = |offset: &str| {
        robot(&format!(
            r#"<link name="a"/><link name="b"/><link name="c">{INERTIAL}</link>
            <joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
            <joint name="k" type="continuous"><parent link="b"/><child link="c"/><origin xyz="{offset}"/><axis xyz="0 0 1"/></joint>"#
        ))
    };
    let args = "dynamics r.urdf --json --tip c --states -";
    desk.write("r.urdf", two("1 0 0"));
    let answer = desk.answer(args, &json!({"q": [0, 0], "qd": [0, 0]}));
    assert_eq!(answer["mass_matrix"], json!([[2.0, 1.0], [1.0, 1.0]]));
    // Both hinges have the same axis, so the acceleration of each is undetermined. M is served, a solution with it is not.
    desk.write("r.urdf", two("0 0 1"));
    let answer = desk.answer(args, &json!({"q": [0, 0], "qd": [0, 0]}));
    assert_eq!(answer["mass_matrix"], json!([[1.0, 1.0], [1.0, 1.0]]));
    assert!(answer["singular"].as_str().unwrap().starts_with("joint 'j' moves no inertia"), "{answer}");
    refused(
        desk.feed(args, r#"{"q":[0,0],"qd":[0,0],"tau":[1,0]}"#),
        "<stdin>:1: joint 'j' moves no inertia at this pose, so its acceleration is not determined: give the links below it mass and inertia, or lock it",
    );
}

/// The tests of carom-chain have the texts.
#[test]
fn options_for_missing_meshes_reach_the_reader_of_robots() {
    let desk = Desk::new();
    let collision = "<collision><geometry><mesh filename='package://parts/b.stl'/></geometry></collision>";
    desk.write("r.urdf", hinged(&format!("{INERTIAL}{collision}")));
    let missing = "link 'b' <collision> (line 1): mesh 'package://parts/b.stl' is not found";
    let warned = |args: &str| {
        let report = &desk.one(args);
        texts(&report["warnings"]).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let [warning] = &warned("inspect r.urdf --json")[..] else { panic!("one warning") };
    assert!(warning.starts_with(&format!("{missing}; there is no folder 'parts' in or above '.', ")), "{warning}");
    refused_with(
        &desk.run("inspect r.urdf --strict"),
        &missing.replace(" (line 1)", "").replace("link", "r.urdf:1: link"),
    );
    assert_eq!(warned("inspect r.urdf --json --no-meshes --strict"), [format!("{missing}, left out")]);
    let dynamics = |option: &str| {
        let ran = desk.feed(&format!("dynamics r.urdf --json --tip b --states - {option}"), r#"{"q":[0],"qd":[0]}"#);
        assert_eq!(ran.code, Some(0));
        ran.err
    };
    assert_eq!(dynamics(""), format!("warning: r.urdf: {warning}\n"));
    assert!(!dynamics("--no-meshes").contains("cannot be used in contacts"));

    desk.write("more/parts/b.stl", "");
    assert!(warned("inspect r.urdf --json --strict --package-dir none --package-dir more").is_empty());
    let found = || desk.command("inspect r.urdf --strict").env("AMENT_PREFIX_PATH", "prefix").output().unwrap();
    assert!(!found().status.success());
    desk.write("prefix/share/parts/b.stl", "");
    assert!(found().status.success());
}

/// Hinge `j` moves link `b` without mass; a slider `k` below it moves `c`, also without.
fn weightless() -> String {
    robot(
        "<link name='a'/><link name='b'/><link name='c'/>
        <joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>
        <joint name='k' type='prismatic'><parent link='b'/><child link='c'/><origin xyz='2 0 0'/>
        <axis xyz='1 0 0'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint>",
    )
}

#[test]
fn robots_without_mass_have_kinematics_on_the_command_line() {
    let desk = Desk::new();
    desk.write("r.urdf", weightless());
    let report = &desk.one("inspect r.urdf --json");
    assert_eq!((texts(&report["massless"]), &report["dof"]), (vec!["b", "c"], &json!(2)));
    let people = desk.run("inspect r.urdf");
    done(&people);
    assert!(people.out.contains("\nno dynamics, since these links move without mass: b, c\n"), "{}", people.out);
    let state = json!({"q": [0, 0.5], "qd": [0, 0]});
    let place = desk.answer("dynamics r.urdf --kinematics --json --tip c --states -", &state);
    let expected =
        json!({"joints": ["j", "k"], "position": [2.5, 0.0, 0.0], "jacobian": [[0.0, 1.0], [2.5, 0.0], [0.0, 0.0]]});
    assert_eq!(place, expected);
    let table = desk.feed("dynamics r.urdf --kinematics --tip c --states -", state.to_string());
    done(&table);
    assert!(table.out.contains("position           2.5000000"), "{}", table.out);
    // M, bias and energies need no solution with M: the mass of the other links gives them.
    let served = desk.answer("dynamics r.urdf --json --tip c --states -", &state);
    assert_eq!((&served["mass_matrix"], &served["bias"]), (&json!([[0.0, 0.0], [0.0, 0.0]]), &json!([0.0, 0.0])));
    assert!(served.get("delassus").is_none(), "{served}");
    assert!(served["singular"].as_str().unwrap().starts_with("'r' has no dynamics"), "{served}");
    let people = desk.feed("dynamics r.urdf --tip c --states -", state.to_string());
    assert!(people.out.contains("\nno Delassus matrix, since M is singular: 'r' has no dynamics"), "{}", people.out);
    // With mass on b only j moves inertia: m d² + I = 2 · 0.5² + 0.25.
    let inertial = "<link name='b'><inertial><origin xyz='0.5 0 0'/><mass value='2'/><inertia ixx='0.25' ixy='0' ixz='0' \
                    iyy='0.25' iyz='0' izz='0.25'/></inertial></link>";
    desk.write("half.urdf", weightless().replace("<link name='b'/>", inertial));
    let half = desk.answer("dynamics half.urdf --json --gravity 0,-9.81,0 --tip c --states -", &state);
    assert_eq!(half["mass_matrix"], json!([[0.75, 0.0], [0.0, 0.0]]));
    assert!((half["gravity_force"][0].as_f64().unwrap() - 9.81).abs() < 1e-12, "{half}");
    assert!(half["singular"].as_str().unwrap().contains("'c'") && half.get("delassus").is_none(), "{half}");
    let pushed = json!({"q": [0, 0.5], "qd": [0, 0], "tau": [1, 0]});
    refused(
        desk.feed("dynamics r.urdf --tip c --states -", pushed.to_string()),
        "<stdin>:1: 'r' has no dynamics, because nothing that these links carry has mass: 'b', 'c'. Give them an <inertial>, load the robot with --repair (LoadOptions::repair), which welds them to the links that carry them, or lock their joints",
    );
    let message = "r.urdf: 'r' has no dynamics, because nothing that these links carry has mass: 'b', 'c'. Give them an <inertial>, load the robot with --repair (LoadOptions::repair), which welds them to the links that carry them, or lock their joints";
    for args in [
        "impact r.urdf --tip c --normal 0,0,1 --law all --restitution 0.5 --states -",
        "fit --velocities - --robot r.urdf --tip c",
    ] {
        refused(desk.feed(args, state.to_string()), message);
    }
    desk.write("s.toml", "[robot]\nurdf = \"r.urdf\"\nq = [0, 0]\n[run]\nduration = 1\n");
    desk.refused("simulate s.toml", &message.replace("r.urdf: 'r'", "s.toml: 'r'"));
    // a partial robot is not an error of its own, and with nothing to weld it to stays what it is
    assert_eq!(texts(&desk.one("inspect r.urdf --repair --json")["massless"]), ["b", "c"]);
}

#[test]
fn repairs_are_listed_with_their_numbers() {
    let desk = Desk::new();
    let odd = INERTIAL.replace(r#"iyy="1""#, r#"iyy="-1.5""#);
    let more = "<link name='c'/><joint name='k' type='continuous'><parent link='b'/><child link='c'/><axis xyz='1 0 0'/></joint>";
    desk.write("r.urdf", hinged(&odd).replace("</robot>", &format!("{more}</robot>")));
    let report = &desk.one("inspect r.urdf --repair --json");
    assert_eq!(
        report["repairs"],
        json!([
            {"change": "inertia", "link": "b", "before": [-1.5, 1.0, 1.0], "after": [0.0, 1.0, 1.0]},
            {"change": "weld", "joint": "k", "link": "c", "parent": "b", "position": 0.0},
        ])
    );
    assert_eq!((&report["dof"], &report["massless"]), (&json!(1), &json!([])));
    let lines = [
        "repaired: link 'b': principal moments -1.5, 1, 1 kg m² are raised to 0, 1, 1\n",
        "repaired: joint 'k' is fixed at 0: link 'c' has no mass and is welded to link 'b'\n",
    ];
    let people = desk.run("inspect r.urdf --repair");
    done(&people);
    assert!(people.out.contains(&lines.concat()), "{}", people.out);
    let ran = desk.feed("dynamics r.urdf --repair --json --tip c --states -", r#"{"q":[0],"qd":[0]}"#);
    assert_eq!((ran.code, ran.err), (Some(0), lines.map(|line| format!("warning: r.urdf: {line}")).concat()));
}

/// The classic mistake: a hinge without an axis turns about x.
#[test]
fn robots_that_look_odd_load_with_warnings_and_strict_refuses_them() {
    let desk = Desk::new();
    let bent = hinged(INERTIAL).replace("continuous", "revolute").replace(
        "<axis xyz=\"1 0 0\"/>",
        "<origin xyz='0 0 1' rpy='0 90 0'/><limit lower='-170' upper='170' effort='1' velocity='1'/>",
    );
    desk.write("r.urdf", bent);
    let said = [
        "joint 'j' (line 1): a revolute joint without <axis> has the axis 1 0 0, as URDF says; give its <axis xyz>",
        "joint 'j' <origin rpy> (line 1): 90 is more than a turn: angles are in rad; 90° are 1.5708 rad",
        "joint 'j' <limit> (line 1): -170 … 170 is more than two turns: limits are in rad; -170° … 170° are -2.96706 … 2.96706 rad",
    ];
    assert_eq!(texts(&desk.one("inspect r.urdf --json")["warnings"]), said);
    let ran = desk.feed("dynamics r.urdf --json --tip b --states -", r#"{"q":[0],"qd":[0]}"#);
    assert_eq!((ran.code, ran.err), (Some(0), said.map(|it| format!("warning: r.urdf: {it}\n")).concat()));
    desk.refused("inspect r.urdf --strict",
        "r.urdf:1: joint 'j': a revolute joint without <axis> has the axis 1 0 0, as URDF says; give its <axis xyz> (the first of 3 warnings): correct it, or load the robot without --strict (LoadOptions::strict)",
    );
}

/// A pipe that nobody writes to would be waited for without end.
#[cfg(unix)]
#[test]
fn pipes_in_a_folder_of_robots_are_refused_without_being_opened() {
    let desk = Desk::new();
    std::fs::create_dir_all(desk.join("robots")).unwrap();
    desk.write("robots/a.urdf", hinged(INERTIAL));
    let made = std::process::Command::new("mkfifo").arg(desk.join("robots/b.urdf")).status().unwrap();
    assert!(made.success());
    let people = desk.run("inspect --all robots");
    done(&people);
    assert!(
        people.out.contains("\nrobots/b.urdf: refused: it is a folder, a pipe or a device: give a file\n"),
        "{}",
        people.out
    );
}

/// A hinge, a hinge at 1 m from it, and a slider along which a link of 1 kg moves away: at 1e19 m, m L² is 1e38 kg m², and 16 digits of
/// it have none for 1 kg m².
#[test]
fn positions_too_large_for_the_numbers_are_named_and_not_a_lack_of_inertia() {
    let desk = Desk::new();
    let limit = r#"<axis xyz="1 0 0"/><limit lower="-1e99" upper="1e99" effort="1" velocity="1"/>"#;
    let text = limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#)
        + &limb("c", "b", "continuous", r#"<axis xyz="0 0 1"/>"#)
        + &limb("d", "c", "prismatic", limit);
    desk.write("r.urdf", robot(&format!("<link name='a'/>{text}")));
    let far = |meters: &str| {
        format!(
            "joint 'continuous_b': at this pose links are {meters} m apart, so that its inertia is lost in the rounding of numbers of 16 digits: check the positions and their units (m, rad)"
        )
    };
    for (q, meters) in [("1e19", "1.0e19"), ("1e98", "1.0e98")] {
        let state = format!(r#"{{"q":[0,1,{q}],"qd":[1,1,1]}}"#);
        for args in [
            "dynamics r.urdf --tip d --states -",
            "impact r.urdf --tip d --normal=-1,0,0 --law newton --restitution 0.5 --states -",
        ] {
            refused(desk.feed(args, &state), &format!("<stdin>:1: {}", far(meters)));
        }
    }
    desk.write("s.toml", "[robot]\nurdf = \"r.urdf\"\nq = [0, 1, 1e19]\n[run]\nduration = 1\n");
    desk.refused("simulate s.toml", &format!("s.toml: {}", far("1.0e19")));
    let near = desk.answer("dynamics r.urdf --json --tip d --states -", &json!({"q": [0, 1, 1e5], "qd": [0, 0, 0]}));
    assert!(near["delassus"].is_array(), "{near}");
}

/// Each class of loading, in folders of its own.
#[test]
fn a_folder_of_robots_is_summarised_in_one_line_for_each_file() {
    let desk = Desk::new();
    for folder in ["robots/deep", "robots/none"] {
        std::fs::create_dir_all(desk.join(folder)).unwrap();
    }
    desk.write("robots/a.urdf", hinged(INERTIAL));
    desk.write(
        "robots/b.URDF",
        hinged(&INERTIAL.replace(r#"<mass value="1"/>"#, r#"<mass value="1.23456789"/>"#))
            .replace("<link name=\"a\"", "<link name=\"a\" x=\"1\""),
    );
    desk.write("robots/deep/c.urdf", weightless());
    desk.write("robots/deep/d.urdf", "<robot name='r'>");
    desk.write("robots/text.txt", "not a robot");
    let counts = json!({"counts": {"files": 4, "loads": 1, "warnings": 1, "partial": 1, "refused": 1}});
    let lines = desk.answers("inspect --all robots --json", "");
    assert_eq!(
        lines,
        [
            json!({"file": "robots/a.urdf", "status": "loads", "name": "r", "dof": 1, "mass": 1.0, "warnings": 0, "reason": null}),
            json!({"file": "robots/b.URDF", "status": "warnings", "name": "r", "dof": 1, "mass": 1.23456789, "warnings": 1,
                "reason": "<link x> (line 1) is not used: it is unknown"}),
            json!({"file": "robots/deep/c.urdf", "status": "partial", "name": "r", "dof": 2, "mass": 0.0, "warnings": 0,
                "reason": "no dynamics, since these links move without mass: b, c"}),
            json!({"file": "robots/deep/d.urdf", "status": "refused", "name": null, "dof": null, "mass": null, "warnings": 0,
                "reason": "1: XML: is not well-formed: the root node was opened but never closed; correct the file"}),
            counts,
        ]
    );
    let people = desk.run("inspect --all robots");
    done(&people);
    let lines: Vec<&str> = people.out.lines().collect();
    assert_eq!(lines[0], "robots/a.urdf: loads, 1 degrees of freedom, 1 kg");
    assert!(lines[1].starts_with("robots/b.URDF: loads with 1 warning, 1 degrees of freedom, 1.23457 kg: <link x>"));
    assert!(lines[2].starts_with("robots/deep/c.urdf: partial, 2 degrees of freedom, 0 kg: no dynamics"));
    assert!(lines[3].starts_with("robots/deep/d.urdf: refused: 1: XML: "));
    assert_eq!(lines[4..], ["4 files: 1 load, 1 with warnings, 1 partial, 1 refused"]);
    let strict = desk.answers("inspect --all robots --json --strict", "");
    assert_eq!(strict[4], json!({"counts": {"files": 4, "loads": 1, "warnings": 0, "partial": 1, "refused": 2}}));
    desk.refused("inspect --all robots/none", "--all robots/none: the folder contains no .urdf file");
    let missing = desk.run("inspect --all nowhere");
    assert_eq!(missing.code, Some(1));
    assert!(missing.err.starts_with("error: nowhere: cannot be read: "), "{}", missing.err);
    usage(desk.run("inspect"), "required");
    usage(desk.run("inspect planar2.urdf --all robots"), "cannot be used with");
}

#[test]
fn damping_and_friction_of_joints_are_shown_since_simulations_use_them() {
    let desk = Desk::new();
    let text = hinged(INERTIAL).replace("</joint>", "<dynamics damping='0.123456789' friction='2'/></joint>");
    desk.write("r.urdf", text);
    let report = &desk.one("inspect r.urdf --json");
    assert_eq!(report["joints"][0]["damping"], json!(0.123456789));
    assert_eq!((&report["joints"][0]["friction"], &report["warnings"]), (&json!(2.0), &json!([])));
    let people = desk.run("inspect r.urdf");
    done(&people);
    assert!(people.out.contains("a → b  damping 0.123457  friction 2\n"), "{}", people.out);
    let note = "damping and friction of the joints act in simulate; dynamics and impact leave them out\n";
    assert!(people.out.ends_with(note), "{}", people.out);
}

#[test]
fn unreadable_files_are_named() {
    let desk = Desk::new();
    std::fs::create_dir(desk.join("folder")).unwrap();
    desk.write("bytes", [0xff, 0xfe, 0x00]);
    for (args, start) in [
        ("inspect no.urdf", "error: no.urdf: cannot be read: "),
        ("inspect folder", "error: folder: cannot be read: "),
        ("inspect bytes", "error: bytes: cannot be read: "),
        ("dynamics planar2.urdf --tip tip --states no.jsonl", "error: no.jsonl: cannot be read: "),
        ("dynamics planar2.urdf --tip tip --states folder", "error: folder: cannot be read: "),
        ("dynamics planar2.urdf --tip tip --states bytes", "error: bytes"),
        ("law --law all --restitution 0.5 --problems no.jsonl", "error: no.jsonl: cannot be read: "),
    ] {
        let ran = desk.run(args);
        assert_eq!((ran.code, ran.out.as_str()), (Some(1), ""), "{args}");
        assert!(ran.err.starts_with(start) && ran.err.lines().count() == 1, "{args}: {}", ran.err);
    }
}

/// A locked joint needs no inertia behind it, nor does one with a damper; a joint that stays free does.
#[test]
fn massless_links_take_part_in_impacts_with_their_joints_held() {
    let desk = Desk::new();
    // Hinge j with m d² + I = 0.75, and behind it a slider k without mass.
    let inertial = "<link name='b'><inertial><origin xyz='0.5 0 0'/><mass value='2'/><inertia ixx='0.25' ixy='0' ixz='0' \
                    iyy='0.25' iyz='0' izz='0.25'/></inertial></link>";
    desk.write("half.urdf", weightless().replace("<link name='b'/>", inertial));
    let args = "impact half.urdf --json --tip c --normal 0,1,0 --law frictionless --restitution 0.5 --states -";
    let state = json!({"q": [0, 0.5], "qd": [-1, 0]});
    for held in ["--locked k", "--joint-damping 0,5 --contact-time 0.01"] {
        let hit = desk.answer(&format!("{args} {held}"), &state);
        // The hinge alone turns back, and takes p = (1 + e) I ω/l, with the lever l = 2.5 m.
        let found = [&hit["qd_plus"][0], &hit["qd_plus"][1], &hit["impulse"][1]].map(|x| x.as_f64().unwrap());
        assert!(found.iter().zip([0.5, 0.0, 1.5 * 0.75 / 2.5]).all(|(x, y)| (x - y).abs() < 1e-12), "{held}: {hit}");
    }
    let massless = "half.urdf: 'r' has no dynamics, because nothing that these links carry has mass: 'c'. Give them an <inertial>, load the robot with --repair (LoadOptions::repair), which welds them to the links that carry them, or lock their joints";
    for free in ["", "--locked j", "--joint-damping 5,0 --contact-time 0.01"] {
        refused(desk.feed(&format!("{args} {free}"), state.to_string()), massless);
    }
}
