//! Invalid states and problems are refused with their line.

use crate::command_line::desk::*;

#[test]
fn invalid_states_are_refused_with_their_line() {
    let desk = Desk::new();
    for (line, reason) in [
        (r#"{"q":[1e999,0],"qd":[0,0]}"#, "number out of range at column 11"),
        (r#"{"q":[NaN,0],"qd":[0,0]}"#, "expected value at column 7"),
        (r#"{"q":[null,0],"qd":[0,0]}"#, "invalid type: null, expected f64 at column 10"),
        (r#"{"q":[0],"qd":[0,0]}"#, "q has 1 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0,0],"qd":[0,0]}"#, "q has 3 numbers, 2 are needed (shoulder, elbow)"),
        // A state that is refused gives no warning of its limits.
        (r#"{"q":[9],"qd":[0,0]}"#, "q has 1 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0],"qd":[]}"#, "qd has 0 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0],"qd":[0,0],"tau":[0]}"#, "tau has 1 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0],"qd":[0,0],"qdd":[0,0,0]}"#, "qdd has 3 numbers, 2 are needed (shoulder, elbow)"),
        (r#"{"q":[0,0]}"#, "missing field `qd` at column 11"),
        (
            r#"{"q":[0,0],"qd":[0,0],"tua":[0,0]}"#,
            "unknown field `tua`, expected one of `q`, `qd`, `tau`, `qdd` at column 27",
        ),
        (r#"{"q":[0,0],"qd":[0,0]}{}"#, "trailing characters at column 23"),
        ("shoulder 0", "expected value at column 1"),
    ] {
        refused(desk.feed("dynamics planar2.urdf --json --tip tip --states -", line), &format!("<stdin>:1: {reason}"));
    }
    // `impact` checks the same lines in the same way.
    desk.write("s.jsonl", "\n{\"q\":[0,0,0],\"qd\":[0,0]}\n");
    desk.refused(
        "impact planar2.urdf --tip tip --normal -1,0,0 --law newton --restitution 0.5 --states s.jsonl",
        "s.jsonl:2: q has 3 numbers, 2 are needed (shoulder, elbow)",
    );
}

#[test]
fn invalid_problems_are_refused_with_their_line() {
    let desk = Desk::new();
    for (line, reason) in cases(
        r#"
        {"delassus":[[1,0],[0,1e999]],"u":[0,-1]}
            number out of range at column 27
        {"delassus":[[1,0],[0,1]],"u":[-1]}
            u has 1 numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed
        {"delassus":[[1,0],[0]],"u":[0,-1]}
            delassus has rows of 2, 1 numbers: u has 2, so 2 rows of 2 are needed
        {"delassus":[[1,0],[0,1]],"u":[0,0,-1]}
            delassus has rows of 2, 2 numbers: u has 3, so 3 rows of 3 are needed
        {"delassus":[[1,2],[2,1]],"u":[0,-1]}
            the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, its pivot at [0][0] is -3, below -0.0000000000004547473508864641 (rounding); no mass distribution has it, check the mass matrix and the order of the contact axes
        {"delassus":[[1,0],[0,0]],"u":[0,-1]}
            the normal direction is singular: H_nn = 0 1/kg is zero within rounding, relative to the trace 1 1/kg of the Delassus matrix, so the impulse would be infinite; leave the singular pose or model the compliance of the structure
        {"delassus":[[1,0],[0,1]],"v":[0,-1]}
            unknown field `v`, expected `delassus` or `u` at column 29
    "#,
    ) {
        refused(
            desk.feed("law --json --law all --restitution 0.5 --problems -", line),
            &format!("<stdin>:1: {reason}"),
        );
    }
}

#[test]
fn quaternions_that_are_not_unit_are_refused() {
    let desk = Desk::new();
    desk.write("r.urdf", robot(&format!(r#"<link name="a">{INERTIAL}</link>"#)));
    let args = "dynamics r.urdf --floating --json --tip a --states -";
    refused(
        desk.feed(args, r#"{"q":[0,0,0,0,0,0,2],"qd":[0,0,0,0,0,0]}"#),
        "<stdin>:1: joint 'root_joint': quaternion (qx qy qz qw) has norm 2, not 1: normalise it",
    );
    refused(
        desk.feed(args, r#"{"q":[0,0,0,0,0,1],"qd":[0,0,0,0,0,0]}"#),
        "<stdin>:1: q has 6 numbers, 7 are needed (root_joint; a floating joint has x y z qx qy qz qw)",
    );
}

#[test]
fn lines_before_a_refused_line_are_answered_and_blank_lines_are_counted() {
    let desk = Desk::new();
    let good = r#"{"q":[0,0],"qd":[1,0]}"#;
    desk.write("s.jsonl", format!("\n{good}\r\n   \n\n{good}\noops\n{good}\n"));
    let ran = desk.run("dynamics planar2.urdf --json --tip tip --states s.jsonl");
    assert_eq!(ran.code, Some(1));
    assert_eq!(ran.out.lines().count(), 2);
    assert_eq!(ran.err, "error: s.jsonl:6: expected value at column 1\n");
    let empty = desk.feed("dynamics planar2.urdf --json --tip tip --states -", "\n\n");
    done(&empty);
    assert_eq!(empty.out, "");
}

#[test]
fn positions_outside_limits_give_one_warning_for_each_joint() {
    let desk = Desk::new();
    let lines = "{\"q\":[0,0],\"qd\":[0,1]}\n{\"q\":[3.5,-4],\"qd\":[0,1]}\n{\"q\":[3.5,-4],\"qd\":[0,1]}\n";
    for args in [
        "dynamics planar2.urdf --json --tip tip --states -",
        "impact planar2.urdf --json --tip tip --normal 0,-1,0 --law all --restitution 0.5 --states -",
    ] {
        let ran = desk.feed(args, lines);
        assert_eq!((ran.code, ran.out.lines().count()), (Some(0), 3), "{args}");
        assert_eq!(
            ran.err,
            "warning: <stdin>:2: joint 'shoulder' is at 3.5 rad, above its limit 3.1 rad (said once for this joint)\n\
             warning: <stdin>:2: joint 'elbow' is at -4 rad, below its limit -3.1 rad (said once for this joint)\n"
        );
    }
}

#[test]
fn joints_with_similar_names_have_their_own_limit_warnings() {
    let desk = Desk::new();
    let limit = r#"<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>"#;
    let text = limb("b", "a", "revolute", limit) + &limb("c", "b", "revolute", limit);
    let text = text.replace("revolute_b", "left's 1").replace("revolute_c", "left's 2");
    desk.write("r.urdf", robot(&(r#"<link name="a"/>"#.to_owned() + &text)));
    let ran = desk.feed("dynamics r.urdf --json --tip c --states -", r#"{"q":[2,2],"qd":[0,0]}"#);
    assert_eq!(
        ran.err,
        "warning: <stdin>:1: joint 'left's 1' is at 2 rad, above its limit 1 rad (said once for this joint)\n\
         warning: <stdin>:1: joint 'left's 2' is at 2 rad, above its limit 1 rad (said once for this joint)\n"
    );
}

#[test]
fn a_byte_order_mark_before_the_first_line_is_read_over() {
    let desk = Desk::new();
    let line = "{\"q\":[0.1,0.2],\"qd\":[0,1]}\n";
    let args = "dynamics planar2.urdf --json --tip tip --states -";
    let plain = desk.feed(args, line);
    done(&plain);
    assert_eq!(desk.feed(args, format!("\u{feff}{line}")), plain);
    let later = desk.feed(args, format!("{line}\u{feff}{line}"));
    assert_eq!(later.err, "error: <stdin>:2: expected value at column 1\n", "within the text it is no mark");
}

/// Standard input without line ends, as of a device: it is read up to the limit only.
#[test]
fn a_line_without_end_is_refused_at_the_limit() {
    let desk = Desk::new();
    let line = vec![b' '; (16 << 20) + 1];
    refused(
        desk.feed("dynamics planar2.urdf --tip tip --states -", line),
        "<stdin>:1: the line is longer than 16 MiB, the limit: write one object on each line",
    );
}

/// Texts of 100 000 characters in each kind of input.
#[test]
fn messages_about_long_texts_are_short() {
    let desk = Desk::new();
    let long = "x".repeat(100_000);
    desk.write("q.toml", format!("[robot]\nurdf = \"planar2.urdf\"\nq = \"{long}\"\n[run]\nduration = 1\n"));
    desk.write("key.toml", format!("{long} = 1\n[robot]\nurdf = \"planar2.urdf\"\nq = [0, 0]\n[run]\nduration = 1\n"));
    desk.write(
        "tip.toml",
        format!("[robot]\nurdf = \"planar2.urdf\"\nq = [0, 0]\ntip = \"{long}\"\n[run]\nduration = 1\n"),
    );
    desk.write(
        "law.toml",
        format!("[robot]\nurdf = \"planar2.urdf\"\nq = [0, 0]\n[contact]\nlaw = \"{long}\"\n[run]\nduration = 1\n"),
    );
    desk.write("study.toml", format!("[robot]\nurdf = \"planar2.urdf\"\ntip = \"{long}\"\n"));
    desk.write("r.urdf", robot(&format!("<link name='{long}'/>")));
    let short = |ran: Ran, what: &str| {
        assert!(
            ran.code == Some(1) && ran.err.starts_with("error: ") && ran.err.len() < 10_000,
            "{what} {}",
            ran.err.len()
        );
    };
    for args in [
        "simulate q.toml",
        "simulate key.toml",
        "simulate tip.toml",
        "simulate law.toml",
        "map study.toml --out m.csv",
        "inspect r.urdf",
    ] {
        short(desk.run(args), args);
    }
    short(desk.run(&format!("dynamics planar2.urdf --tip {long} --states -")), "--tip");
    for line in [format!("{{\"{long}\":1}}"), format!("{{\"q\":\"{long}\"}}"), long.clone()] {
        short(desk.feed("dynamics planar2.urdf --tip tip --states -", line), "a line");
    }
}

#[test]
fn impacts_refuse_velocities_of_a_wrong_length_with_their_line() {
    let desk = Desk::new();
    for (options, line, reason) in [
        ("", r#"{"q":[0.3,0.4],"qd":[]}"#, "qd has 0 numbers, 2 are needed (shoulder, elbow)"),
        ("", r#"{"q":[0.3,0.4],"qd":[1]}"#, "qd has 1 numbers, 2 are needed (shoulder, elbow)"),
        (
            "--joints elbow,shoulder",
            r#"{"q":[0.3,0.4],"qd":[1,2,3]}"#,
            "qd has 3 numbers, 2 are needed (shoulder, elbow)",
        ),
        (
            "--floating",
            r#"{"q":[0,0,0,0,0,0,1,0.3,0.4],"qd":[1,2]}"#,
            "qd has 2 numbers, 8 are needed (root_joint, shoulder, elbow)",
        ),
    ] {
        let args = format!(
            "impact planar2.urdf {options} --tip tip --normal -1,0,0 --law newton --restitution 0.5 --states -"
        );
        refused(desk.feed(&args, line), &format!("<stdin>:1: {reason}"));
    }
}
