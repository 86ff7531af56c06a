//! `carom impact` with derivatives and ranges: the additional keys.

use crate::command_line::desk::*;
use carom_impact::Energetic;
use carom_sim::Impacts;
use serde_json::json;

const IMPACT: &str = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law energetic";

/// The tests of the library compare them with differences.
#[test]
fn derivatives_are_those_of_the_library() {
    let desk = Desk::new();
    let (q, qd) = ([0.78, -1.57], [-0.15, 0.6]);
    let state = json!({"q": q, "qd": qd});
    let found = desk.answer(&format!("{IMPACT} --restitution 0.35 --friction 0.2 --derivatives --states -"), &state);
    let by = &found["derivatives"];
    let arm = carom_testing::files::robot("planar2");
    let strike = arm.impact(&q, &qd).at(arm.frame("tip").unwrap()).normal([-1.0, 0.0, 0.0]);
    let expected = strike.derivative(&Energetic { restitution: 0.35, friction: 0.2 }).unwrap();
    for (key, expected) in [("q", expected.q), ("qd", expected.qd)] {
        assert!((matrix(&by[key]) - expected).amax() < 1e-14, "{key}");
    }
    for (key, expected) in [("restitution", expected.restitution), ("friction", expected.friction)] {
        assert!((vector(&by[key]) - expected).amax() < 1e-14, "{key}");
    }
    assert_eq!(found["mode_margin"]["edge"], "stops-at-turn");
    // Another order of the joints permutes rows and columns.
    let turned = json!({"q": [q[1], q[0]], "qd": [qd[1], qd[0]]});
    let args = format!("{IMPACT} --joints elbow,shoulder --restitution 0.35 --friction 0.2 --derivatives --states -");
    let other = matrix(&desk.answer(&args, &turned)["derivatives"]["q"]);
    assert_eq!(other[(0, 1)], matrix(&by["q"])[(1, 0)]);
    // Without the options these keys are missing.
    let plain = desk.answer(&format!("{IMPACT} --restitution 0.35 --friction 0.2 --states -"), &state);
    assert!(["derivatives", "mode_margin", "band"].iter().all(|key| plain.get(key).is_none()));
}

/// Slip that stops in another phase is a boundary beyond which the mode has the same name.
#[test]
fn a_boundary_within_a_mode_names_the_same_mode_beyond_it() {
    let desk = Desk::new();
    let state = json!({"q": [0.78, -1.57], "qd": [-0.15, 0.6]}).to_string();
    let said = |mu: &str| {
        let args =
            format!("{IMPACT} --restitution 0.35 --friction {mu} --derivatives --states -").replace("--json ", "");
        desk.feed(&args, &state).out
    };
    let reverse = said("0.2");
    assert!(reverse.contains("energetic        reverse-slip"), "{reverse}");
    assert!(reverse.contains("nearest boundary stops-at-turn, margin "), "{reverse}");
    assert!(reverse.contains("; beyond it still reverse-slip\n"), "{reverse}");
    // Without friction the only boundary is that of the approach; beyond it there is no impact.
    let smooth = said("0");
    assert!(
        smooth.contains("nearest boundary no-approach, margin ") && smooth.contains("; beyond it open\n"),
        "{smooth}"
    );
}

#[test]
fn ranges_give_bounds_and_state_whether_they_are_exact() {
    let desk = Desk::new();
    let state = json!({"q": [0.78, -1.57], "qd": [-0.15, 0.6]});
    let args = format!("{IMPACT} --restitution 0.35 --friction 0.2 --restitution-range 0.3:0.4");
    let found = desk.answer(&format!("{args} --states -"), &state);
    let band = &found["band"];
    assert_eq!((&band["exact"], &band["friction"]), (&json!(true), &json!([0.2, 0.2])));
    for (k, v) in vector(&found["qd_plus"]).iter().enumerate() {
        let bounds = vector(&band["qd_plus"][k]);
        assert!(bounds[0] < *v && *v < bounds[1]);
    }
    let sampled = desk.answer(&format!("{args} --friction-range 0.1:0.3 --states -"), &state);
    assert_eq!(sampled["band"]["exact"], false);
    for (range, code, words) in [
        ("0.4:0.3", 2, "the lower number comes first"),
        ("0.3", 2, "two are needed"),
        ("0.3:1.2", 1, "--restitution-range 0.3:1.2: a coefficient of restitution lies between 0 and 1"),
    ] {
        let ran = desk
            .feed(&format!("{IMPACT} --restitution 0.35 --restitution-range {range} --states -"), state.to_string());
        assert_eq!((ran.code, ran.out.as_str()), (Some(code), ""), "{}", ran.err);
        assert!(ran.err.contains(words), "{}", ran.err);
    }
}
