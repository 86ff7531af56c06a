//! Inertia of rotors that `<transmission>` gives, against the same chain with the inertia given by number.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;

/// Two hinges, a slider that follows the first, and these transmissions, each on a line of its own from line 2 on.
fn robot(transmissions: &[&str]) -> String {
    let link = |name: &str| {
        let inertia = "<inertia ixx='0.1' iyy='0.2' izz='0.2' ixy='0' ixz='0' iyz='0'/>";
        format!("<link name='{name}'><inertial><mass value='1'/><origin xyz='0.5 0 0'/>{inertia}</inertial></link>")
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, more: &str| {
        let ends = format!("<parent link='{parent}'/><child link='{child}'/><origin xyz='1 0 0'/>");
        format!("<joint name='{name}' type='{kind}'>{ends}{more}</joint>")
    };
    let about_y = "<axis xyz='0 1 0'/>";
    let parts = [
        link("base") + &link("a") + &link("b") + &link("c") + &link("d"),
        joint("j", "continuous", "base", "a", about_y),
        joint("k", "continuous", "a", "b", about_y),
        joint("l", "continuous", "b", "c", "<axis xyz='0 1 0'/><mimic joint='j'/>"),
        joint("m", "fixed", "c", "d", ""),
    ];
    format!(
        "<robot name='r' xmlns:drake='http://drake.mit.edu'>{}\n{}</robot>",
        parts.concat(),
        transmissions.join("\n")
    )
}

fn transmission(joint: &str, actuator: &str) -> String {
    let kind = "<type>transmission_interface/SimpleTransmission</type>";
    format!(
        "<transmission name='t'>{kind}<joint name='{joint}'/><actuator name='m'>{actuator}</actuator></transmission>"
    )
}

fn load(transmissions: &[&str], options: &LoadOptions) -> Result<Chain, String> {
    Chain::from_urdf_str(&robot(transmissions), options).map_err(|error| error.to_string())
}

/// N² I: Featherstone (2008), section 9.6. A gear ratio may be negative (the motor turns the other way) and is 1 if it is not
/// given; a table of inertias replaces that of the file.
#[test]
fn transmissions_give_the_same_chain_as_reflected_inertias() {
    let geared = transmission("j", "<drake:rotor_inertia value='2e-6'/><drake:gear_ratio value='-100'/>");
    let direct = transmission("k", "<mechanicalReduction>7</mechanicalReduction><drake:rotor_inertia value=' 3e-3 '/>");
    let found = load(&[&geared, &direct], &LoadOptions { strict: true, ..Default::default() }).unwrap();
    let bare = load(&[], &LoadOptions::default()).unwrap();
    let expected = bare.with_rotor_inertia("j", 1e4 * 2e-6).unwrap().with_rotor_inertia("k", 3e-3).unwrap();
    assert_eq!(found.rotor_inertias(), expected.rotor_inertias());
    let mass_matrix = |chain: &Chain| chain.workspace().update(chain, &[0.3, -0.8]).unwrap().mass_matrix();
    assert_eq!(mass_matrix(&found), mass_matrix(&expected));
    assert!((mass_matrix(&found)[(0, 0)] - mass_matrix(&bare)[(0, 0)] - 0.02).abs() < 1e-14);
    assert_eq!((found.report().unused.as_slice(), found.report().warnings.as_slice()), (&[][..], &[][..]));

    let table = LoadOptions { rotor_inertia: [("j".into(), 0.5), ("k".into(), 0.0)].into(), ..Default::default() };
    assert_eq!(load(&[&geared, &direct], &table).unwrap().rotor_inertias(), [0.5, 0.0]);
}

#[test]
fn transmissions_that_no_joint_can_have_are_warnings_and_wrong_numbers_errors() {
    let rotor = "<drake:rotor_inertia value='1'/>";
    let two = "<transmission><joint name='j'/><joint name='k'/><actuator><drake:rotor_inertia value='1'/></actuator></transmission>";
    let own = |kind: &str| format!("a rotor belongs to a joint with one coordinate of its own, and {kind}; not used");
    for (text, warning) in [
        (two.into(), "does not drive exactly one joint; its rotors are not used".into()),
        (transmission("jj", rotor), "no joint is named 'jj': did you mean 'j'?; its rotors are not used".into()),
        (transmission("l", rotor), own("'l' is mimic")),
        (transmission("m", rotor), own("'m' is fixed")),
    ] {
        let chain = load(&[&text], &LoadOptions::default()).unwrap();
        assert_eq!(chain.report().warnings, [format!("robot 'r' <transmission> (line 2): {warning}")]);
        assert_eq!(chain.rotor_inertias(), [0.0, 0.0]);
    }
    // What has no inertia is not used, as before.
    let of_ros = transmission("j", "<mechanicalReduction>50</mechanicalReduction><drake:gear_ratio value='50'/>");
    let chain = load(&[&of_ros], &LoadOptions::default()).unwrap();
    assert_eq!(chain.report().unused, ["<transmission> (line 2) is not used"]);

    let positive = "it must be a finite number that is not negative, kg m² or kg";
    for (actuator, message) in [
        ("<drake:rotor_inertia value='-1'/>", format!("<rotor_inertia value>: \"-1\" is wrong: {positive}")),
        ("<drake:rotor_inertia value='nan'/>", format!("<rotor_inertia value>: \"nan\" is wrong: {positive}")),
        ("<drake:rotor_inertia/>", "<rotor_inertia>: the attribute value is missing: add it".into()),
        (
            "<drake:rotor_inertia value='1'/><drake:gear_ratio value='1:50'/>",
            "<gear_ratio value>: \"1:50\" is wrong: it must be a finite number".into(),
        ),
    ] {
        let error = load(&[&transmission("j", actuator)], &LoadOptions::default()).unwrap_err();
        assert_eq!(error, format!("<string>:2: robot 'r' {message}"));
    }
}
