//! Output for people: tables and help.

use crate::command_line::desk::*;
use serde_json::json;

#[test]
fn without_json_the_output_is_a_table() {
    let desk = Desk::new();
    let state = json!({"q": UP_ELBOW, "qd": [0.1, 0.3], "tau": [1, 2], "qdd": [3, 4]}).to_string();
    for (args, input, words) in [
        (
            "inspect planar2.urdf",
            "",
            &[
                "planar2: 2 degrees of freedom (nq 2, nv 2), 19.689 kg in 5 links",
                "moves in a plane, normal (0, 0, 1)",
                "elbow         revolute    link1 → link2         -3.1 … 3.1",
            ][..],
        ),
        (
            "inspect arm7.urdf",
            "",
            &["does not move in one plane: joint 'shoulder_pitch' leaves the plane", "wrist_roll"],
        ),
        (
            "dynamics planar2.urdf --tip tip --states -",
            &state,
            &[
                "shoulder         elbow",
                "mass matrix        3.4730000     0.1960000",
                "Jacobian",
                "Delassus",
                "bias",
                "gravity force",
                "qdd",
                "tau",
                "kinetic energy 0.0320650 J",
            ],
        ),
        (
            "impact planar2.urdf --tip tip --normal -1,0,0 --law all --restitution 0.35 --friction 0.2 --states -",
            &state,
            &[
                "u⁻     0.0954594     0.1590990             0 m/s, kinetic energy 0.0320650 J",
                "qd⁺ in the order shoulder, elbow",
                "frictionless     slip",
                "energetic",
                "N s",
                "friction work -0.0039826 J",
            ],
        ),
        (
            "law --law all --restitution 0.5 --friction 0.5 --problems -",
            r#"{"delassus":[[2.440338045696,1.521308658011],[1.521308658011,1.009560290504]],"u":[-0.267174342835,-0.134202014333]}"#,
            &["whittaker        stick", "T⁺/T⁻ 1.5874947  [energy-gain]", "poisson"],
        ),
    ] {
        let ran = desk.feed(args, input);
        done(&ran);
        for word in words {
            assert!(ran.out.contains(word), "{args}: {word:?} not in\n{}", ran.out);
        }
    }
}

#[test]
fn help_and_version_are_printed() {
    let desk = Desk::new();
    for (args, words) in [
        ("--help", "Usage: carom [OPTIONS] <COMMAND>"),
        ("help impact", "--normal <X,Y,Z>"),
        ("inspect --help", "<ROBOT.urdf|SCENE.toml>"),
        ("dynamics --help", "--joints"),
        ("impact --help", "from the environment to the robot"),
        ("law --help", "tangents first, normal last"),
        ("--version", "carom"),
    ] {
        let ran = desk.run(args);
        done(&ran);
        // Regardless of line breaks.
        let flowing = ran.out.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(flowing.contains(words), "{args}");
    }
}

/// The help of every command is printed on a page of the book: it must fit the page and say what the command computes, what it
/// reads and what it prints.
#[test]
fn every_help_fits_100_columns_and_describes_computation_input_output_and_options() {
    let desk = Desk::new();
    let help = |args: &str| {
        let ran = desk.run(args);
        done(&ran);
        for line in ran.out.lines() {
            assert!(line.chars().count() <= 100, "{args}: {} columns: {line}", line.chars().count());
        }
        ran.out
    };
    let overview = help("--help");
    let [used, tests] = ["Commands:\n", "Commands that test laws and methods:\n"].map(|title| {
        let listed = overview.split_once(title).unwrap().1.split("\n\n").next().unwrap();
        listed.lines().map(|line| line.split_whitespace().next().unwrap()).collect::<Vec<_>>()
    });
    assert_eq!((used.last(), used.len()), (Some(&"help"), 15), "14 commands and `help`: {used:?}");
    assert_eq!(tests, ["chart", "stress", "paper", "consistency"]);
    let commands = [used, tests].concat();
    for words in ["Exit status:", "  0  Done.", "  1  An input is refused.", "  2  Wrong command line."] {
        assert!(overview.contains(words), "{words}");
    }
    for command in commands.into_iter().filter(|command| *command != "help") {
        let page = help(&format!("{command} --help"));
        let (about, rest) = page.split_once("\nUsage: ").unwrap();
        assert!(about.contains("\nOutput"), "{command} does not describe its output:\n{about}");
        let reads = rest.contains("<FILE>") || rest.contains("\nArguments:");
        assert_eq!(about.contains("\nInput: "), reads, "{command}: what it reads is described, if it reads anything");
        let answers = command != "completions";
        assert_eq!(about.contains("JSON keys:"), answers, "{command} lists its JSON keys, if it has them");
        // Each option is followed by its description.
        let is_option = |line: &str| line.starts_with("      --") || (line.starts_with("  -") && line.contains(", --"));
        let lines: Vec<&str> = rest.split_once("\nOptions:\n").unwrap().1.lines().collect();
        let mut options = 0;
        for (k, line) in lines.iter().enumerate().filter(|(_, line)| is_option(line)) {
            let text = lines.get(k + 1).map_or("", |next| next.trim());
            assert!(text.len() >= 10, "{command}: no description below {line}");
            options += 1;
        }
        assert!(options > 0, "{command}: no options found");
        if let Some(laws) = rest.split_once("Possible values:\n") {
            let laws: Vec<&str> = laws.1.lines().take_while(|line| line.trim_start().starts_with("- ")).collect();
            assert!(laws.len() >= 8 || command == "fit", "{command}: {laws:?}");
            assert!(
                laws.iter().all(|line| line.split_once(": ").is_some_and(|(_, text)| text.trim().len() > 10)),
                "{laws:?}"
            );
        }
    }
}
