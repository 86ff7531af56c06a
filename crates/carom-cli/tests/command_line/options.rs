//! Invalid options and unknown names.

use crate::command_line::desk::*;
use carom_testing::files::text;
use serde_json::json;

#[test]
fn coefficients_out_of_range_are_refused() {
    let desk = Desk::new();
    for (options, message) in [
        ("--restitution -0.1", "--restitution -0.1: a coefficient of restitution lies between 0 and 1"),
        ("--restitution 1.5", "--restitution 1.5: a coefficient of restitution lies between 0 and 1"),
        ("--restitution NaN", "--restitution NaN: a coefficient of restitution lies between 0 and 1"),
        ("--restitution inf", "--restitution inf: a coefficient of restitution lies between 0 and 1"),
        ("--restitution 1 --friction -0.2", "--friction -0.2: a coefficient of friction is finite and not negative"),
        ("--restitution 0 --friction nan", "--friction NaN: a coefficient of friction is finite and not negative"),
        ("--restitution 0 --friction inf", "--friction inf: a coefficient of friction is finite and not negative"),
    ] {
        for law in ["all", "frictionless", "energetic"] {
            let impact = format!("impact planar2.urdf --tip tip --normal -1,0,0 --law {law} {options} --states -");
            desk.refused(&impact, message);
            desk.refused(&format!("law --law {law} {options} --problems -"), message);
        }
    }
}

#[test]
fn options_of_tosses_are_checked_before_the_folder_is_read() {
    let desk = Desk::new();
    for (options, message) in [
        ("--restitution 2", "--restitution 2: a coefficient of restitution lies between 0 and 1"),
        ("--friction -1", "--friction -1: a coefficient of friction is finite and not negative"),
        (
            "--tangential-restitution 2",
            "--tangential-restitution 2: a coefficient of tangential restitution lies between -1 and 1",
        ),
        ("--tolerance 0", "--tolerance 0: it must be from 2.3e-16 to 0.1"),
        ("--contact-step -0.001", "--contact-step -0.001: it must be positive and finite"),
    ] {
        desk.refused(&format!("tosses nowhere {options}"), message);
    }
}

/// A ball without spin that strikes a rough floor obliquely: its tangential velocity after the impact depends on the
/// coefficient alone, and with it the position at the last sample.
#[test]
fn tosses_have_the_tangential_restitution_of_the_option() {
    let desk = Desk::new();
    let urdf = r#"<robot name="ball"><link name="ball"><inertial><mass value="1"/>
        <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial>
        <collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"#;
    let head = "toss,k,t,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz";
    let row = |k: u32, t: f64| format!("0,{k},{t},0,0,0.2,1,0,0,0,1,0,-1,0,0,0");
    desk.write("ball.urdf", urdf);
    desk.write("tosses.csv", format!("{head}\n{}\n{}\n", row(0, 0.0), row(1, 0.2)));
    let position = |options: &str| {
        let args = "tosses . --robot ball.urdf --law chatterjee-ruina --restitution 0.5 --friction 9 --json";
        number(&desk.one(&format!("{args} {options}"))["each"][0]["position"])
    };
    // Without the option it is 0, and −1 gives no friction.
    assert_eq!(position(""), position("--tangential-restitution 0"));
    let without = position("--tangential-restitution -1");
    assert!(without > position("") + 0.01 && position("") > position("--tangential-restitution 0.9") + 0.01);
}

/// Names from other software and papers give the answer of the names of the reference; answers have the names of the reference.
#[test]
fn aliases_of_options_and_laws_give_the_same_answers() {
    let desk = Desk::new();
    let state = json!({"q": UP_ELBOW, "qd": [0.1, 0.3]});
    let ours = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law energetic --restitution 0.5 --friction 0.2";
    let theirs = "impact planar2.urdf --json --frame tip --normal -1,0,0 --law stronge --e 0.5 --mu 0.2";
    let answer = desk.answer(&format!("{ours} --states -"), &state);
    assert_eq!(answer["law"], "energetic");
    assert_eq!(desk.answer(&format!("{theirs} --states -"), &state), answer);
    let help = desk.run("impact --help").out;
    for alias in ["[alias: --mu]", "[alias: --e]", "[alias: --frame]", "[alias: stronge]"] {
        assert!(help.contains(alias), "{alias} is not in the help");
    }

    let scene = text("scenes/planar2.toml");
    assert!(scene.contains("law = \"energetic\""), "the scene has another law");
    let run = |law: &str| {
        desk.write("own.toml", scene.replace("\"energetic\"", &format!("\"{law}\"")).replace("../robots/", ""));
        desk.one("simulate own.toml --json")
    };
    assert_eq!(run("stronge"), run("energetic"));

    let study = |law: &str| {
        desk.write(
            "study.toml",
            format!(
                "[robot]\nurdf = \"planar2.urdf\"\n[joints]\nshoulder = 0.7\nelbow = -1.5\n[impact]\nnormal = [-1, 0, 0]\n\
                 approach_deg = 45\nspeed = 0.2\nlaw = [\"newton\", \"{law}\"]\nrestitution = 0.3\nfriction = 0.2\n\
                 [map]\nquantities = [\"impulse\"]\n"
            ),
        );
        desk.run("map study.toml --out map.csv")
    };
    done(&study("stronge"));
    assert!(desk.read("map.csv").contains("energetic"), "the column has the names of the laws");
    let twice = study("stronge\", \"energetic");
    assert!(twice.err.contains("[impact] law holds \"energetic\" twice"), "{}", twice.err);
}

#[test]
fn quiet_leaves_out_warnings_and_keeps_errors() {
    let desk = Desk::new();
    let law = "law --json --law newton --restitution 0.5 --tangential-restitution 0.5 --problems -";
    let problem = json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [0.3, -1]}).to_string();
    let (told, quiet) = (desk.feed(law, &problem), desk.feed(&format!("{law} --quiet"), &problem));
    assert!(told.err.starts_with("warning: "), "{}", told.err);
    assert_eq!((quiet.err.as_str(), &quiet.out), ("", &told.out));
    assert_eq!(desk.feed(&format!("--quiet {law}"), &problem).err, "", "the option stands before the command too");
    refused(desk.feed(&format!("{law} --quiet"), "oops"), "<stdin>:1: expected value at column 1");
}

/// The script of bash is one that bash reads, and it completes commands and options by their names.
#[test]
fn completions_of_every_shell_name_commands_and_options() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish"] {
        let ran = desk.run(&format!("completions {shell}"));
        done(&ran);
        for word in ["simulate", "consistency", "restitution", "chatterjee-ruina"] {
            assert!(ran.out.contains(word), "{shell}: {word}");
        }
        if shell == "bash" {
            desk.write("carom.bash", &ran.out);
            let complete = "COMP_WORDS=(carom simu); COMP_CWORD=1; _carom carom simu carom; echo \"${COMPREPLY[@]}\"";
            let script = format!(". ./carom.bash && {complete}");
            let bash = std::process::Command::new("bash").args(["-c", &script]).current_dir(&desk.0).output().unwrap();
            assert_eq!(String::from_utf8(bash.stdout).unwrap().trim(), "simulate");
        }
    }
}

#[test]
fn usage_errors_exit_with_2() {
    let desk = Desk::new();
    let impact = "impact planar2.urdf --tip tip --states - --restitution 0.5";
    let laws = "[possible values: frictionless, whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith";
    for (args, words) in [
        (String::new(), "Usage: carom [OPTIONS] <COMMAND>"),
        ("strike".into(), "unrecognized subcommand 'strike'"),
        ("inspect".into(), "<ROBOT.urdf>"),
        ("inspect planar2.urdf --jsn".into(), "unexpected argument '--jsn' found"),
        ("dynamics planar2.urdf --states - --kinematics".into(), "--tip <LINK>"),
        ("dynamics planar2.urdf --states - --point 0,0,1".into(), "--tip <LINK>"),
        (
            "dynamics planar2.urdf --tip tip --states - --gravity 0,0".into(),
            "invalid value '0,0' for '--gravity <X,Y,Z>': 2 numbers, three are needed: x,y,z",
        ),
        (format!("{impact} --normal -1,0,0 --law hertz"), "invalid value 'hertz' for '--law <LAW>'"),
        (format!("{impact} --normal -1,0,0 --law hertz"), laws),
        (format!("{impact} --law all"), "--normal <X,Y,Z>"),
        (
            format!("{impact} --law all --normal 1,0"),
            "invalid value '1,0' for '--normal <X,Y,Z>': 2 numbers, three are needed: x,y,z",
        ),
        (
            format!("{impact} --law all --normal 1,0,0,0"),
            "invalid value '1,0,0,0' for '--normal <X,Y,Z>': 4 numbers, three are needed: x,y,z",
        ),
        (
            format!("{impact} --law all --normal 1,x,0"),
            "invalid value '1,x,0' for '--normal <X,Y,Z>': invalid float literal: write three numbers, like 0,0,-9.81",
        ),
        ("law --law all --problems - --restitution half".into(), "invalid value 'half' for '--restitution <E>'"),
        ("law --law all --problems -".into(), "--restitution <E>"),
    ] {
        usage(desk.run(&args), words);
    }
}

#[test]
fn unknown_tips_and_joints_are_refused_with_the_existing_names() {
    let desk = Desk::new();
    let with = |options: &str| desk.run(&format!("dynamics planar2.urdf --json --states - {options}"));
    refused(
        with("--tip tool"),
        "planar2.urdf: --tip: no link is named 'tool'; there are 'base', 'link1', 'elbow_stator', 'link2' and 'tip'",
    );
    refused(
        with("--tip tpi"),
        "planar2.urdf: --tip: no link is named 'tpi'; there are 'base', 'link1', 'elbow_stator', 'link2' and 'tip'",
    );
    refused(with("--tip Tip"), "planar2.urdf: --tip: no link is named 'Tip'; did you mean 'tip'?");
    for (joints, why) in [
        ("shoulder,elbo", "no joint is named 'elbo'; did you mean 'elbow'?"),
        ("elbow", "joint 'shoulder' is not in the list: name every moving joint"),
        ("elbow,shoulder,elbow", "joint 'elbow' is named twice"),
        ("elbow,probe,shoulder", "joint 'probe' is fixed: leave it out"),
    ] {
        refused(with(&format!("--tip tip --joints {joints}")), &format!("planar2.urdf: --joints: {why}"));
    }
    let follow = r#"<axis xyz="0 0 1"/><mimic joint="continuous_b" multiplier="-2" offset="0.5"/>"#;
    let text = limb("b", "a", "continuous", r#"<axis xyz="0 0 1"/>"#) + &limb("c", "b", "continuous", follow);
    desk.write("r.urdf", robot(&(r#"<link name="a"/>"#.to_owned() + &text)));
    desk.refused(
        "dynamics r.urdf --tip c --joints continuous_b,continuous_c --states -",
        "r.urdf: --joints: joint 'continuous_c' mimics 'continuous_b' and has no coordinate of its own: leave it out",
    );
}

#[test]
fn zero_normals_and_singular_directions_are_refused() {
    let desk = Desk::new();
    let strike = |tip: &str, normal: &str, q: &str| {
        let args = format!(
            "impact planar2.urdf --json --tip {tip} --normal {normal} --law all --restitution 0.5 --friction 0.3 --states -"
        );
        desk.feed(&args, format!(r#"{{"q":{q},"qd":[1,0]}}"#))
    };
    let zero = strike("tip", "0,0,0", "[0,0]");
    assert_eq!((zero.code, zero.out.as_str()), (Some(1), ""));
    let words = "direction [0.0, 0.0, 0.0] has length 0: a direction needs a finite, non-zero length\n";
    assert_eq!(zero.err, format!("error: --normal: {words}"));
    // A straight arm struck along its axis, and a planar arm struck across its plane.
    for (normal, unit, q) in [("-1,0,0", "[-1.0, 0.0, 0.0]", "[0,0]"), ("0,0,2", "[0.0, 0.0, 1.0]", "[0.3,1]")] {
        refused(
            strike("tip", normal, q),
            &format!(
                "<stdin>:1: at this pose no joint moves 'tip' along the normal {unit} (singular direction): the load would pass into the structure, and the impulse of any rigid law would be infinite; change the pose or the normal"
            ),
        );
    }
    refused(
        strike("base", "-1,0,0", "[0,0]"),
        "planar2.urdf: --tip: link 'base' is fixed to the world: no impact can move it, choose a link that a joint moves",
    );
}

#[test]
fn dynamics_without_a_tip_leaves_out_what_belongs_to_a_point() {
    let desk = Desk::new();
    let state = json!({"q": [0.3, -1.2], "qd": [0.5, 1], "tau": [1, 0.5]});
    let with = |options: &str| desk.answer(&format!("dynamics planar2.urdf --json --states - {options}"), &state);
    let (plain, mut at_tip) = (with(""), with("--tip tip"));
    let lost = ["jacobian", "delassus"].map(|key| at_tip.as_object_mut().unwrap().remove(key));
    assert!(lost.iter().all(Option::is_some));
    assert_eq!(plain, at_tip);
    let said = desk.feed("dynamics planar2.urdf --states -", state.to_string()).out;
    assert!(said.contains("mass matrix") && !said.contains("Jacobian") && !said.contains("Delassus"), "{said}");
}

#[test]
fn dynamics_gives_zero_jacobian_and_delassus_at_the_base() {
    let desk = Desk::new();
    let state = json!({"q": UP_ELBOW, "qd": [1, 2]});
    let answer = desk.answer("dynamics planar2.urdf --json --tip base --point 1,2,3 --states -", &state);
    assert_eq!(answer["jacobian"], json!([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]));
    assert_eq!(answer["delassus"], json!([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]));
}

#[test]
fn invalid_joint_models_are_refused() {
    let desk = Desk::new();
    // Refused for every state, here without any.
    let with = |options: &str| {
        let args = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law energetic --restitution 0.5";
        desk.run(&format!("{args} --states - {options}"))
    };
    for (options, message) in cases(
        r"
        --locked all
            planar2.urdf: --locked: with its joints locked nothing moves 'tip' along the normal [-1.0, 0.0, 0.0]: the inverse inertia there is zero, and the impulse of any rigid law would be infinite; leave a joint free that moves it, let the base float (the robot is then one rigid body), or give the joints a finite stiffness and a contact time
        --locked elbo
            planar2.urdf: --locked: no joint is named 'elbo'; did you mean 'elbow'?
        --locked probe
            planar2.urdf: --locked: joint 'probe' has no coordinate of its own to lock (it is fixed, or follows another joint)
        --joint-stiffness 1,2,3 --contact-time 0.01
            --joint-stiffness: 3 numbers: give one, or 2 in the order of qd (shoulder, elbow)
        --locked elbow,all
            planar2.urdf: --locked: 'all' locks every joint but a floating base: give it alone, or give names without it
        --locked elbow,shoulder,elbow
            planar2.urdf: --locked: joint 'elbow' is named twice
        --joint-stiffness -5 --contact-time 0.01
            --joint-stiffness -5: stiffness and damping of a drive are finite and 0 or more
        --joint-damping 1,NaN --contact-time 0.01
            --joint-damping NaN: stiffness and damping of a drive are finite and 0 or more
        --joint-stiffness 5 --contact-time 0
            --contact-time: the contact time is 0: it must be finite and above 0 s
        --joint-stiffness 1e300 --contact-time 1e10
            --contact-time: the inertia Δt (K Δt + D) is inf: it must be finite; lock the joint instead
        --contact-time 0.01
            --contact-time is the duration of the contact with the joint drives: give --joint-stiffness or --joint-damping too
    ",
    ) {
        refused(with(options), message);
    }
    for (options, words) in [
        ("--joint-stiffness 5", "--contact-time <S>"),
        ("--locked elbow --joint-stiffness 5 --contact-time 0.1", "cannot be used with"),
        ("--joint-damping x --contact-time 0.1", "invalid value 'x' for '--joint-damping"),
    ] {
        usage(with(options), words);
    }
}

#[test]
fn inertias_of_one_rotor_are_given_once() {
    let desk = Desk::new();
    let twice = "--rotor-inertia elbow=0.1 --rotor-inertia shoulder=0.1 --rotor-inertia elbow=0.2";
    let message = "--rotor-inertia: joint 'elbow' is named twice";
    let state = json!({"q": UP_ELBOW, "qd": [1, 2]}).to_string();
    refused(desk.feed(&format!("dynamics planar2.urdf {twice} --states -"), state), message);
    desk.refused(&format!("inspect planar2.urdf {twice}"), message);
}

/// Where every state gives the joint velocities, nothing is left for the motion to choose.
#[test]
fn a_motion_that_no_state_needs_is_a_warning() {
    let desk = Desk::new();
    let args = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law newton --restitution 0.5 --states -";
    let (own, tip) = (r#"{"q":[0.7,-1.5],"qd":[-0.5,-1]}"#, r#"{"q":[0.7,-1.5],"tip_velocity":[1,0,0]}"#);
    let warning =
        "warning: --motion has no effect: it chooses qd where a state gives tip_velocity, and every state gives qd\n";
    for (options, lines, said) in [
        ("--motion least-norm", own.to_owned(), warning),
        ("--motion least-norm", format!("{own}\n{tip}"), ""),
        ("--motion least-norm", String::new(), ""),
        ("", own.to_owned(), ""),
    ] {
        let ran = desk.feed(&format!("{args} {options}"), &lines);
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), said), "{options} {lines}");
    }
}
