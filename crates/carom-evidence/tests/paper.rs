//! The two-link experiment: the documented numbers of the stand-in arm, and the claims of the paper.

use crate::paper::{self, Elbow, Tangential};
use carom_study::{Approach, self_motion, tangential_map};
use carom_testing::build::planar2_mass;
use carom_testing::files::robot as arm;
use nalgebra::{Vector2, Vector3};

#[test]
fn stand_in_has_its_documented_mass_matrix() {
    let chain = arm("planar2");
    for bend in [0.0_f64, 0.7, -1.9] {
        let m = chain.workspace().update(&chain, &[0.4, bend]).unwrap().mass_matrix();
        assert!((&m - planar2_mass(bend)).amax() < 1e-14, "{m}");
    }
}

/// H of the stand-in arm, and the coupling that follows from it; what its impacts do is in the data of the paper, whose digits the command
/// line tests.
#[test]
fn stand_in_has_its_documented_impact_numbers() {
    let chain = arm("planar2");
    for (elbow, h) in [(Elbow::Up, -0.887129), (Elbow::Down, 0.887129)] {
        for k in 0..4 {
            let run = paper::strike(&chain, elbow, paper::ANGLES_DEG[k], 0.2, elbow.newton()[k]).unwrap();
            assert!((run.coupling - h).abs() < 5e-7, "{}", run.coupling);
        }
    }
    let mut workspace = chain.workspace();
    let point = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let inertia = workspace.update(&chain, &Elbow::Up.pose()).unwrap().contact_inertia(point).unwrap();
    // (n, t) = (x, −y) here; H of the up-elbow pose.
    assert!((inertia.delassus[(0, 0)] - 0.547479).abs() < 5e-7);
    assert!((-inertia.delassus[(0, 1)] + 0.485684).abs() < 5e-7);
    assert!((inertia.effective_mass(&[1.0, 0.0, 0.0]).unwrap() - 1.8266).abs() < 5e-5);
}

/// Eq. (15) by hand: v_t⁺ = v_t⁻ − h (1+e) v_n, reversal iff h (1+e) > cot α, growth iff h < 0.
#[test]
fn tangential_jump_follows_eq_15() {
    let chain = arm("planar2");
    let runs = paper::experiment(&chain).unwrap();
    let count = |change| runs.iter().filter(|run| run.tangential_change() == change).count();
    let kinds = [Tangential::Reverses, Tangential::Grows, Tangential::Shrinks, Tangential::Appears];
    assert_eq!(kinds.map(count), [6, 9, 3, 6]);
    for run in &runs {
        let ((before, after), (approach, rebound)) = (run.tangential(), run.normal());
        let jump = run.coupling * (1.0 + run.restitution) * approach;
        assert!((after - (before + jump)).abs() < 1e-14);
        assert!((rebound + run.restitution * approach).abs() < 1e-15);
        let cot = run.angle_deg.to_radians().cos() / run.angle_deg.to_radians().sin();
        match run.tangential_change() {
            Tangential::Reverses => assert!(run.coupling * (1.0 + run.restitution) > cot),
            Tangential::Grows => assert!(run.coupling < 0.0),
            Tangential::Shrinks => assert!((0.0..=cot).contains(&(run.coupling * (1.0 + run.restitution)))),
            Tangential::Appears => assert_eq!(run.angle_deg, 90.0),
        }
    }
}

#[test]
fn all_claims_hold_except_the_energies_of_table_1() {
    let chain = arm("planar2");
    let runs = paper::experiment(&chain).unwrap();
    assert_eq!(runs.len(), 24);
    let claims = paper::claims(&chain, &runs).unwrap();
    let holds: Vec<bool> = claims.iter().map(|c| c.holds).collect();
    assert_eq!(holds, [true, true, true, true, true, false], "{claims:#?}");
}

#[test]
fn map_agrees_with_the_experiment_and_with_eq_15() {
    let chain = arm("planar2");
    let flat = chain.to_planar().unwrap();
    let tip = chain.frame("tip").unwrap();
    let approach = Approach { normal: -Vector2::x(), tangent: -Vector2::y(), restitution: 0.35 };
    let reach = 0.9 * 0.5_f64.sqrt();
    for elbow in Elbow::ALL {
        let targets = [[reach, 0.0], [0.2, 0.5], [2.0, 0.0]];
        let map = tangential_map(&flat, tip, [0.45, 0.45], approach, elbow.side(), targets).unwrap();
        assert_eq!(map.len(), 2, "the last target is out of reach");
        let run = paper::strike(&chain, elbow, 45.0, 0.2, 0.35).unwrap();
        let (before, after) = run.tangential();
        assert!((map[0].tangential_ratio - after / before).abs() < 1e-12);
        let point = chain.point(tip, Vector3::zeros());
        let h = chain.workspace().update(&chain, &map[1].q).unwrap().delassus(point).unwrap();
        // 1 + (1+e) H_tn/H_nn with t = −y and n = −x
        assert!((map[1].tangential_ratio - (1.0 + 1.35 * h[(0, 1)] / h[(0, 0)])).abs() < 1e-12);
        assert!((map[1].tip - Vector2::new(0.2, 0.5)).norm() < 1e-14);
    }
}

#[test]
fn self_motion_keeps_the_tip_position_and_changes_its_effective_mass() {
    let chain = arm("planar3");
    let tip = chain.frame("tip").unwrap();
    let (n, t) = (-Vector3::x(), -Vector3::y());
    let poses = self_motion(&chain, tip, [0.45, 0.45, 0.25], [0.6364, 0.0], n, t, 360).unwrap();
    // The wrist is within reach of the first two links for every direction of the third: 360 directions, two elbows.
    assert_eq!(poses.len(), 720);
    let point = chain.point(tip, Vector3::zeros());
    let mut ws = chain.workspace();
    for pose in &poses {
        let p = ws.update(&chain, &pose.q).unwrap().position(point);
        assert!((p - Vector3::new(0.6364, 0.0, 0.0)).norm() < 1e-14);
    }
    let masses: Vec<f64> = poses.iter().filter_map(|p| p.effective_mass).collect();
    assert_eq!(masses.len(), poses.len());
    let (least, most) = masses.iter().fold((f64::MAX, 0.0_f64), |(a, b), &m| (a.min(m), b.max(m)));
    assert!(least > 0.2 && most > 200.0 * least, "{least} to {most} kg");
    let wrong = self_motion(&chain, tip, [0.45, 0.45, 0.2], [0.6364, 0.0], n, t, 90).unwrap_err();
    assert!(wrong.to_string().ends_with("give the chain's lengths"), "{wrong}");
}
