//! Robustness: closed pipes, numbers of any size, malformed files.

use crate::command_line::desk::*;
use nalgebra::DMatrix;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};

#[test]
fn a_closed_output_pipe_is_no_error() {
    let desk = Desk::new();
    desk.write("s.jsonl", "{\"q\":[0,1],\"qd\":[1,0]}\n".repeat(5000));
    for args in [
        "dynamics planar2.urdf --json --tip tip --states s.jsonl",
        "dynamics planar2.urdf --tip tip --states s.jsonl",
        "impact planar2.urdf --json --tip tip --normal -1,0,0 --law all --restitution 0.5 --states s.jsonl",
    ] {
        let mut child = desk.command(args).spawn().unwrap();
        let mut first = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!((child.wait().unwrap().code(), said.as_str()), (Some(0), ""), "{args}");
        assert!(!first.is_empty());
    }
}

#[test]
fn a_closed_standard_error_causes_no_panic() {
    let desk = Desk::new();
    let mut child = desk.command("dynamics planar2.urdf --json --tip tip --states -").spawn().unwrap();
    drop(child.stderr.take());
    child.stdin.take().unwrap().write_all(br#"{"q":[9,0],"qd":[1,0]}"#).unwrap();
    let mut answer = String::new();
    child.stdout.take().unwrap().read_to_string(&mut answer).unwrap();
    assert_eq!((child.wait().unwrap().code(), answer.lines().count()), (Some(0), 1));

    let mut child = desk.command("dynamics planar2.urdf --json --tip tip --states -").spawn().unwrap();
    drop(child.stderr.take());
    child.stdin.take().unwrap().write_all(b"oops").unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
}

#[test]
fn inputs_of_any_size_are_answered_with_finite_numbers_or_refused() {
    let desk = Desk::new();
    let sizes = ["0", "1", "-1e16", "1e150", "-1e150", "1e300", "1e-300", "1.7976931348623157e308", "5e-324"];
    let mut next = 0;
    let mut any = || {
        next = (next * 5 + 3) % 97; // a fixed sequence of pseudo-random residues modulo a prime
        sizes[next % sizes.len()]
    };
    // Of each command: how many inputs were answered and how many refused.
    let mut counts = [[0; 2]; 3];
    let mut count = |command: usize, ran: &Ran, what: &str| {
        civil(ran, what);
        let answered = ran.code == Some(0);
        assert!(answered || ran.code == Some(1), "{what}: {ran:?}");
        assert_eq!(ran.out.lines().count(), usize::from(answered), "{what}: {ran:?}");
        counts[command][usize::from(!answered)] += 1;
    };
    for _ in 0..60 {
        let state = format!(r#"{{"q":[{},{}],"qd":[{},{}],"tau":[{},{}]}}"#, any(), any(), any(), any(), any(), any());
        let point = format!("{},{},{}", any(), any(), any());
        let args = format!("dynamics planar2.urdf --json --tip tip --point {point} --gravity 0,0,{} --states -", any());
        count(0, &desk.feed(&args, &state), &format!("{args} < {state}"));
        let state = format!(r#"{{"q":[{},{}],"qd":[{},{}]}}"#, any(), any(), any(), any());
        let friction = any().trim_start_matches('-');
        let args = format!(
            "impact planar2.urdf --json --tip tip --normal {},{},0 --law all --restitution 0.5 --friction {friction} --states -",
            any(),
            any()
        );
        count(1, &desk.feed(&args, &state), &format!("{args} < {state}"));
        let (a, c) = (any().trim_start_matches('-'), any().trim_start_matches('-'));
        let problem = format!(r#"{{"delassus":[[{a},0],[0,{c}]],"u":[{},{}]}}"#, any(), any());
        let args = format!("law --json --law all --restitution 0.5 --friction {friction} --problems -");
        count(2, &desk.feed(&args, &problem), &format!("{args} < {problem}"));
    }
    for [answered, refused] in counts {
        assert!(answered >= 5 && refused >= 5 && answered + refused == 60, "{counts:?}");
    }
}

#[test]
fn overflow_of_one_number_is_refused_and_never_null_in_the_json() {
    let desk = Desk::new();
    let too_large = "every number of an impact problem must be finite";
    let laws = ["whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
    let problem = r#"{"delassus":[[0,0],[0,1e308]],"u":[-1.7e308,-6e139]}"#;
    for law in laws.into_iter().chain(["all"]) {
        let args = format!("law --json --law {law} --restitution 0.1 --friction 0.1 --problems -");
        let ran = desk.feed(&args, problem);
        civil(&ran, law);
        assert_eq!((ran.code, ran.out.as_str()), (Some(1), ""), "{law}");
        assert!(ran.err.starts_with("error: <stdin>:1: ") && ran.err.contains(too_large), "{law}: {}", ran.err);
    }
    // The largest coefficient of friction: an outcome of finite numbers, or a refusal that gives this reason.
    let strike = "impact planar2.urdf --json --tip tip --normal -1,0,0 --restitution 0.7 --friction 1.7e308 --states -";
    for law in laws {
        let ran = desk.feed(&format!("{strike} --law {law}"), r#"{"q":[0.1,-0.2],"qd":[0,2.8]}"#);
        civil(&ran, law);
        if ran.code == Some(0) {
            let hit: Value = serde_json::from_str(&ran.out).unwrap();
            assert!(vector(&hit["impulse"]).norm() > 0.1 && number(&hit["u_minus"][0]) > 0.1, "an impact: {hit}");
        } else {
            assert!(ran.err.contains("friction") || ran.err.contains(too_large), "{law}: {}", ran.err);
        }
    }
}

/// Half of the energy is that of the normal velocity, of which e² = ¼ remains: T⁺/T⁻ = 0.625 at every scale. A kinetic energy
/// outside the range of f64 is refused.
#[test]
fn energy_ratio_is_exact_or_refused_at_extreme_scales() {
    let desk = Desk::new();
    let args = "law --json --law frictionless --restitution 0.5 --problems -";
    for problem in [
        r#"{"delassus":[[1,0],[0,1]],"u":[1,-1]}"#,
        r#"{"delassus":[[1e-200,0],[0,1e-200]],"u":[1,-1]}"#,
        r#"{"delassus":[[1,0],[0,1]],"u":[1e-150,-1e-150]}"#,
        r#"{"delassus":[[1,0],[0,1]],"u":[1e150,-1e150]}"#,
    ] {
        let answers = desk.answers(args, problem);
        assert_eq!(answers.len(), 1, "{problem}");
        close(problem, number(&answers[0]["energy_ratio"]), 0.625, 1e-15);
    }
    for (problem, energy) in [
        (r#"{"delassus":[[1e-308,0],[0,1e-308]],"u":[1,-1]}"#, "inf"),
        (r#"{"delassus":[[1,0],[0,1]],"u":[1e160,-1e160]}"#, "inf"),
        (r#"{"delassus":[[1,0],[0,1]],"u":[1e-200,-1e-200]}"#, "0"),
    ] {
        // Of the law where an energy overflows in it, else of the answer.
        let ran = desk.feed(args, problem);
        let told = format!("error: <stdin>:1: the kinetic energy is {energy}");
        assert!(ran.code == Some(1) && ran.out.is_empty() && ran.err.starts_with(&told), "{ran:?}");
    }
}

#[test]
fn control_characters_of_a_file_do_not_break_the_line_of_a_refusal() {
    let desk = Desk::new();
    for (text, message) in [
        (
            "<robot name='r'>\n<link name='a'/\n></robot>".to_owned(),
            "r.urdf:2: XML: is not well-formed: expected '>' not '\\n' at 2:16; correct the file",
        ),
        (
            robot("<link name='a&#10;b'/><link name='a&#10;b'/>"),
            "r.urdf:1: link 'a\\nb': the name is already used on line 1: names must be unique; rename one of the \
             two",
        ),
        (
            robot("<link name='a\u{1b}[31m'/>"),
            "r.urdf:1: XML: is not well-formed: a non-XML character '\\u{1b}' found at 1:30; correct the file",
        ),
    ] {
        desk.write("r.urdf", &text);
        desk.refused("inspect r.urdf --json", message);
    }
}

/// A terminal obeys no character of a name: C1 controls (U+009B begins an escape sequence), new lines, marks that turn the direction
/// of the text. They are printed as JSON writes them, and make no line of their own; JSON has the same names as ever.
#[test]
fn names_of_robots_and_scenes_are_printed_as_text() {
    let desk = Desk::new();
    let nasty = |name: &str| format!("{name}\u{9b}31m\n\t\u{202e}\u{2066}\u{200f}\u{61c}\u{2028}end\n");
    let shown = |name: &str| format!(r"{name}\u009b31m\n\t\u202e\u2066\u200f\u061c\u2028end\n");
    let write = |name: &dyn Fn(&str) -> String| {
        let entity = |c: char| if c.is_alphanumeric() { c.into() } else { format!("&#{};", u32::from(c)) };
        let [robot, link, joint] =
            ["robot", "link", "joint"].map(|it| name(it).chars().map(entity).collect::<String>());
        let ball = r#"<collision><geometry><sphere radius="0.1"/></geometry></collision>"#;
        let along =
            r#"<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="1"/><dynamics damping="0.1"/>"#;
        desk.write(
            "r.urdf",
            format!(
                r#"<robot name="{robot}"><link name="base"/><link name="{link}">{INERTIAL}{ball}</link>
                <joint name="{joint}" type="prismatic"><parent link="base"/><child link="{link}"/>{along}</joint></robot>"#
            ),
        );
        let surface = json!(name("surface")); // a text of JSON is one of TOML
        desk.write(
            "s.toml",
            format!(
                "[robot]\nurdf = \"r.urdf\"\nq = [0.15]\n[[surface]]\nname = {surface}\n\
                 shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
                 [contact]\nlaw = \"newton\"\nrestitution = 0.5\n[run]\nduration = 0.3\ngravity = [0, 0, -9.81]\n"
            ),
        );
    };
    desk.write("q.jsonl", "{\"q\":[0],\"qd\":[0]}\n");
    let commands = [
        "inspect r.urdf",
        "inspect s.toml",
        "plan s.toml",
        "simulate s.toml",
        "simulate s.toml --sensitivity",
        "dynamics r.urdf --tip base --kinematics --states q.jsonl",
    ];
    let printed = || commands.map(|args| desk.run(args));
    write(&str::to_owned);
    let ordinary = printed();
    write(&nasty);
    let obeyed = |c: char| c != '\n' && (c.is_control() || nasty("").contains(c) && !c.is_alphanumeric());
    for ((args, ran), plain) in commands.iter().zip(printed()).zip(ordinary) {
        assert_eq!((plain.code, ran.code), (Some(0), Some(0)), "{args}: {plain:?} {ran:?}");
        assert!(!ran.out.contains(obeyed) && !ran.err.contains(obeyed), "{args}: {ran:?}");
        assert_eq!(ran.out.lines().count(), plain.out.lines().count(), "{args}: {}", ran.out);
        assert!(["link", "joint", "surface"].iter().any(|name| ran.out.contains(&shown(name))), "{args}: {}", ran.out);
    }
    let ran = desk.run("inspect r.urdf --json");
    assert!(!ran.out.contains(obeyed), "{}", ran.out);
    let report: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!((&report["name"], &report["joints"][0]["name"]), (&json!(nasty("robot")), &json!(nasty("joint"))));
    let ran =
        desk.run("impact r.urdf --tip no\u{202e}\u{9b} --normal 0,0,1 --law newton --restitution 0.5 --states q.jsonl");
    assert!(ran.code == Some(1) && ran.err.contains(r"no\u202e\u009b") && !ran.err.contains(obeyed), "{ran:?}");
}

#[test]
fn random_and_malformed_files_are_refused_without_a_panic() {
    let desk = Desk::new();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut byte = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    let mut files: Vec<Vec<u8>> = (0..20).map(|_| (0..200).map(|_| byte()).collect()).collect();
    files.extend(
        (0..20).map(|_| (0..200).map(|_| b" \n<>/=\"'{}[],:.0123456789eE+-"[usize::from(byte()) % 29]).collect()),
    );
    files.push(b"[".repeat(100_000));
    files.push(br#"{"q":["#.repeat(50_000));
    files.push(b"<robot name='r'>".repeat(50_000));
    for bytes in files {
        desk.write("r.urdf", &bytes);
        let inspected = desk.run("inspect r.urdf");
        assert_eq!((inspected.code, inspected.err.lines().count()), (Some(1), 1), "{}", inspected.err);
        assert!(!bytes.iter().all(u8::is_ascii_whitespace), "an empty file would be valid input for the next commands");
        for args in [
            "dynamics planar2.urdf --json --tip tip --states r.urdf",
            "law --json --law all --restitution 0.5 --problems r.urdf",
        ] {
            let ran = desk.run(args);
            civil(&ran, args);
            assert_eq!((ran.code, ran.out.as_str()), (Some(1), ""), "{args}");
        }
    }
    // Deep nesting of unused elements does not overflow the stack.
    let deep = format!("<link name='a'/>{}{}", "<x>".repeat(50_000), "</x>".repeat(50_000));
    desk.write("r.urdf", robot(&deep));
    let report = &desk.one("inspect r.urdf --json");
    assert_eq!(texts(&report["warnings"]), ["<x> (line 1) is not used: it is unknown"]);
}

#[test]
fn names_may_hold_any_character_of_xml() {
    let desk = Desk::new();
    let arm = limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#)
        + &limb("c", "b", "continuous", r#"<axis xyz="0 0 1"/>"#);
    let (elbow, hand) = ("coude d'été \u{1f9be}", "Fußgelenk &\"<");
    let text = arm.replace("continuous_b", elbow).replace(r#""c""#, r#""Fußgelenk &amp;&quot;&lt;""#);
    desk.write("r.urdf", robot(&(r#"<link name="a"/>"#.to_owned() + &text)));
    let report = &desk.one("inspect r.urdf --json");
    assert_eq!((&report["joints"][0]["name"], &report["links"][2]), (&json!(elbow), &json!(hand)));
    let joints = format!("continuous_c,{elbow}");
    let args = ["dynamics", "r.urdf", "--json", "--tip", hand, "--joints", &joints, "--states", "-"];
    let ran = finish(desk.command_of(&args).spawn().unwrap(), br#"{"q":[0,0],"qd":[1,2]}"#);
    done(&ran);
    let answer: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(answer["joints"], json!(["continuous_c", elbow]));
}

#[test]
fn mimic_planar_and_floating_joints_work_anywhere_in_a_chain() {
    let desk = Desk::new();
    let text = [
        r#"<link name="a"/>"#.to_owned(),
        limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#),
        limb("c", "b", "planar", r#"<axis xyz="0 1 0"/>"#),
        limb("d", "c", "floating", ""),
        limb("e", "d", "prismatic", r#"<mimic joint="continuous_b" multiplier="-2" offset="0.1"/>"#),
    ];
    desk.write("r.urdf", robot(&text.concat()));
    let report = &desk.one("inspect r.urdf --json");
    assert_eq!((&report["nq"], &report["nv"]), (&json!(11), &json!(10)));
    assert_eq!(report["joints"][3]["mimic"], json!({"joint": "continuous_b", "multiplier": -2.0, "offset": 0.1}));

    let q = json!([0.4, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0, 0, 0.6, 0.8]);
    let qd = json!([1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
    let state = json!({"q": q, "qd": qd, "tau": qd, "qdd": qd});
    let answer = desk.answer("dynamics r.urdf --json --tip e --states -", &state);
    assert_eq!(answer["joints"], json!(["continuous_b", "planar_c", "floating_d"]));
    let [m, bias] = [matrix(&answer["mass_matrix"]), DMatrix::from_columns(&[vector(&answer["bias"])])];
    let scale = 1e-12 * bias.norm();
    assert!((&m * vector(&qd) + &bias - vector(&answer["tau"])).norm() < scale);
    assert!((&m * vector(&answer["qdd"]) + &bias - vector(&qd)).norm() < scale);

    let permuted = json!({
        "q": [0.5, 0.6, 0.7, 0, 0, 0.6, 0.8, 0.1, 0.2, 0.3, 0.4], "qd": [5, 6, 7, 8, 9, 10, 2, 3, 4, 1]
    });
    let args = "dynamics r.urdf --json --tip e --joints floating_d,planar_c,continuous_b --states -";
    let other = desk.answer(args, &permuted);
    assert_eq!(other["joints"], json!(["floating_d", "planar_c", "continuous_b"]));
    let order = [4, 5, 6, 7, 8, 9, 1, 2, 3, 0];
    assert_eq!(matrix(&other["mass_matrix"]), DMatrix::from_fn(10, 10, |i, j| m[(order[i], order[j])]));
    assert_eq!(numbers(&other["bias"]), order.map(|i| bias[i]));
}

#[test]
fn an_impact_on_a_chain_of_two_thousand_links_is_resolved() {
    let desk = Desk::new();
    let n = 2000;
    let axis = |i: usize| if i.is_multiple_of(2) { r#"<axis xyz="0 0 1"/>"# } else { r#"<axis xyz="0 1 0"/>"# };
    let limbs: String =
        (1..=n).map(|i| limb(&format!("l{i}"), &format!("l{}", i - 1), "continuous", axis(i))).collect();
    desk.write("r.urdf", robot(&format!(r#"<link name="l0"/>{limbs}"#)));
    assert_eq!(desk.one("inspect r.urdf --json")["dof"], json!(n));
    let q: Vec<f64> = (0..n).map(|i| 0.1 * (i as f64).sin()).collect();
    let qd: Vec<f64> = (0..n).map(|i| 0.1 * (i as f64).cos()).collect();
    let args = "impact r.urdf --json --tip l2000 --normal 0.2,1,0.3 --law frictionless --restitution 0.5 --states -";
    let state = json!({"q": q, "qd": qd});
    let ran = desk.feed(args, state.to_string());
    civil(&ran, args);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}
