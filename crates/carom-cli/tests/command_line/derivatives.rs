//! `carom impact` with derivatives and ranges: the additional keys.

use crate::command_line::desk::*;
use nalgebra::DVector;
use serde_json::json;

const IMPACT: &str = "impact planar2.urdf --json --tip tip --normal -1,0,0 --law energetic";

#[test]
fn derivatives_agree_with_central_differences_of_answers() {
    let desk = Desk::new();
    let (q, qd) = ([0.78, -1.57], [-0.15, 0.6]);
    let state = |q: [f64; 2], qd: [f64; 2]| json!({"q": q, "qd": qd});
    let plus = |q, qd, e: f64, mu: f64| {
        let args = format!("{IMPACT} --restitution {e} --friction {mu} --states -");
        vector(&desk.answer(&args, &state(q, qd))["qd_plus"])
    };
    let found =
        desk.answer(&format!("{IMPACT} --restitution 0.35 --friction 0.2 --derivatives --states -"), &state(q, qd));
    let by = &found["derivatives"];
    let step = 1e-5;
    let agrees = |what: &str, column: DVector<f64>, ahead: DVector<f64>, behind: DVector<f64>| {
        let off = (column - (ahead - behind) / (2.0 * step)).norm();
        assert!(off < 1e-7, "{what}: {off:e}");
    };
    for k in 0..2 {
        let moved = |x: [f64; 2], by: f64| if k == 0 { [x[0] + by, x[1]] } else { [x[0], x[1] + by] };
        let column = |key: &str| matrix(&by[key]).column(k).into_owned();
        agrees("q", column("q"), plus(moved(q, step), qd, 0.35, 0.2), plus(moved(q, -step), qd, 0.35, 0.2));
        agrees("qd", column("qd"), plus(q, moved(qd, step), 0.35, 0.2), plus(q, moved(qd, -step), 0.35, 0.2));
    }
    agrees("e", vector(&by["restitution"]), plus(q, qd, 0.35 + step, 0.2), plus(q, qd, 0.35 - step, 0.2));
    agrees("μ", vector(&by["friction"]), plus(q, qd, 0.35, 0.2 + step), plus(q, qd, 0.35, 0.2 - step));
    assert_eq!(found["mode_margin"]["edge"], "stops-at-turn");
    // Another order of the joints permutes rows and columns.
    let turned = json!({"q": [q[1], q[0]], "qd": [qd[1], qd[0]]});
    let args = format!("{IMPACT} --joints elbow,shoulder --restitution 0.35 --friction 0.2 --derivatives --states -");
    let other = matrix(&desk.answer(&args, &turned)["derivatives"]["q"]);
    assert_eq!(other[(0, 1)], matrix(&by["q"])[(1, 0)]);
    // Without the options these keys are missing.
    let plain = desk.answer(&format!("{IMPACT} --restitution 0.35 --friction 0.2 --states -"), &state(q, qd));
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
