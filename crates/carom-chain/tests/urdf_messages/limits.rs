//! Limits of the size of files and of messages, undeclared prefixes, and rounding of moments.

use crate::urdf_messages::texts::*;
use carom_chain::input::{LONGEST_NAME, MOST_MIB};
use carom_chain::urdf::{self, LoadOptions};
use carom_chain::{Chain, uniform_chain};

const LONG: usize = 300_000;

/// Every text of a user that a message repeats, at 300 000 characters.
#[test]
fn messages_about_long_texts_are_short_and_keep_the_rule() {
    let long = "x".repeat(LONG);
    for (text, rule) in [
        (
            robot(&format!("<link name='{long}'/>")),
            "has 300000 characters, at most 1000 are allowed: give a shorter text",
        ),
        (format!("<robot name='{long}'><link name='a'/></robot>"), "at most 1000 are allowed"),
        (moving(&long, "1 1 1 0"), "is not a number; write numbers with a decimal point, separated by spaces"),
        (moving(&"1 ".repeat(LONG), "1 1 1 0"), "contains 300000 numbers, 1 is needed"),
        (joint(&long, "").replace("<axis xyz=\"1 0 0\"/>", ""), "use revolute, continuous, prismatic"),
        (joint("continuous", &format!("<mimic joint='{long}'/>")), "at most 1000 are allowed"),
        (shape(&format!("<mesh filename='{long}'/>")), "at most 1000 are allowed"),
        (format!("<{long}/>"), "the outermost element of a URDF is <robot>: give a URDF file"),
        (format!("<robot><{long}></robot>"), "is not well-formed"),
        (format!("<robot><{long}:a {long}:b='1' {long}:b='2'/></robot>"), "is not well-formed"),
    ] {
        let message = read(&text).unwrap_err().to_string();
        assert!(message.contains(rule) && message.len() < 1500, "{} {message:.3000}", message.len());
    }
    for inside in [
        format!("<{long}/>"),
        format!("<axis xyz='1 0 0' {long}='1'/>"),
        format!("<axis xyz='1 0 0'/><origin xyz='{}'/>", "1 ".repeat(LONG)),
        format!("<axis xyz='1 0 0'/><{long}:a/>"),
    ] {
        let report = read(&joint("continuous", &inside)).unwrap().report;
        let said = [report.warnings, report.unused].concat();
        assert!(!said.is_empty() && said.iter().all(|text| text.len() < 1500), "{said:.3000?}");
    }
    let chain = Chain::from_urdf_str(&joint("continuous", ""), &LoadOptions::default()).unwrap();
    for error in [chain.frame(&long).unwrap_err(), chain.joint(&long).unwrap_err()] {
        assert!(error.to_string().len() < 400, "{error:.3000}");
    }
    let name = "y".repeat(LONGEST_NAME);
    assert_eq!(
        read(&robot(&format!("<link name='{name}'/>"))).unwrap().links[0].name,
        name,
        "a name of the greatest length"
    );
}

/// The parser compares each attribute with all before it: 200 000 of them took minutes.
#[test]
fn elements_with_many_attributes_are_refused_at_once() {
    let many = |count: usize| {
        let attributes: String = (0..count).map(|k| format!(" a{k}='1'")).collect();
        robot(&format!("\n<link name='a'{attributes}/>"))
    };
    assert_eq!(read(&many(99)).unwrap().links.len(), 1);
    refused_texts(&[(
        many(200_000),
        "<string>:2: XML: an element has more than 100 attributes, the limit: remove those that are not used",
    )]);
}

#[test]
fn files_above_the_limit_are_refused_before_they_are_parsed() {
    let folder = std::env::temp_dir().join(format!("carom-urdf-large-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("large.urdf");
    let most = (MOST_MIB as usize) << 20;
    let read = |length: usize| {
        let text = robot("<link name='a'/>");
        std::fs::write(&file, format!("{text}{}", " ".repeat(length - text.len()))).unwrap();
        urdf::read_file(&file, &LoadOptions::default()).map_err(|e| e.to_string())
    };
    assert!(read(most).is_ok());
    let name = file.display();
    assert_eq!(read(most + 1).unwrap_err(), format!("{name}: cannot be read: it is larger than 16 MiB, the limit"));
    let error = urdf::read_file(&folder, &LoadOptions::default()).unwrap_err().to_string();
    assert_eq!(error, format!("{}: cannot be read: it is a folder: give the path of a file", folder.display()));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn uniform_chains_have_at_most_ten_thousand_links() {
    for links in [10_001, 1_000_000_000] {
        let error = uniform_chain(links, 1.0, 1.0).unwrap_err().to_string();
        let rule = "at most 10000 are allowed, whose mass matrix has 800 MB: give fewer";
        assert_eq!(error, format!("number of links is {links}: {rule}"));
    }
}

/// As in the published URDF of the Fetch robot.
#[test]
fn undeclared_prefixes_are_warnings() {
    let text = "<?xml version='1.0'?>\n<!-- <robot> -->\n<robot\n name='r'><link name='a'/>
        <gazebo><sensor:camera name='c'><b x:y='1'/></sensor:camera></gazebo></robot>";
    let said = |prefix: &str, line: usize| {
        format!(
            "XML (line {line}): the prefix '{prefix}' is not declared; read as declared: add xmlns:{prefix}=\"…\" to the outermost element"
        )
    };
    strictly_refused_texts(&[(text.into(), &[&said("sensor", 5), &said("x", 5)])]);
    assert_eq!(read(text).unwrap().report.unused, ["<gazebo> (line 5) is not used"]);
    // Positions are those of the file.
    let odd = joint("continuous", "<axis xyz='0 0 2'/>").replace("</robot>", "<p:q/></robot>");
    let warnings = read(&odd).unwrap().report.warnings;
    assert_eq!(warnings, [said("p", 1), "joint 'j' <axis> (line 1): has length 2, normalised to 1".into()]);
    // A rotor counts, whatever the declaration of the prefix says.
    let rotor = "<transmission><joint name='j'/><actuator><drake:rotor_inertia value='0.5'/></actuator></transmission>";
    let robot = read(&joint("continuous", "").replace("</robot>", &format!("{rotor}</robot>"))).unwrap();
    assert_eq!((robot.joints[0].rotor_inertia, robot.report.warnings), (0.5, vec![said("drake", 1)]));
}

/// A link of 1.26 kg that is 0.5 m away from the origin of its joint: a moment about its centre of mass is a difference of moments of
/// m L² = 0.3 kg m², whose rounding is 64 ε times that.
#[test]
fn negative_moments_are_rounding_relative_to_the_mass_and_the_reach_of_the_robot() {
    let link = |moments: &str| moving("1.26", moments).replace("<mass", "<origin xyz='0.3 0 -0.4'/><mass");
    strictly_refused_texts(&[
        (
            link("-2.5e-18 -2.5e-18 1e-18 0"),
            &[
                "link 'b' <inertial> (line 1): principal moments -2.5e-18, -2.5e-18 and 1e-18 kg m²: a negative one is accepted as rounding and read as 0",
            ],
        ),
        (
            link("1e-3 1e-3 -4e-15 0"),
            &[
                "link 'b' <inertial> (line 1): principal moments -4e-15, 0.001 and 0.001 kg m²: a negative one is accepted as rounding and read as 0",
            ],
        ),
    ]);
    let used = read(&link("-2.5e-18 -2.5e-18 1e-18 0")).unwrap().links[1].inertial.unwrap().inertia_at_com;
    assert_eq!(used, nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0, 0.0, 1e-18)));
    let message = read(&link("1e-12 1e-12 -5e-15 0")).unwrap_err().to_string();
    assert!(message.contains("principal moments -5e-15, 1e-12 and 1e-12 kg m²: none may be negative"), "{message}");
}
