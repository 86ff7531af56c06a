//! The flow for planar problems, for which the laws use the closed form instead.

use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3, matrix, vector};

use super::gauss::{NODES, WEIGHTS};
use super::turn::{Quantity, Turn};
use super::{Line, Return, State, follow};
use crate::contact::Contact;
use crate::routh::{End, Ending, walk};
use crate::{ImpactError, ImpactProblem};

/// `H = G Gᵀ` of condition up to 100, any approach, any friction.
fn drawn(rng: &mut fastrand::Rng) -> (Matrix2<f64>, Vector2<f64>, f64, f64) {
    let g = Matrix2::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
    let angle = std::f64::consts::PI * rng.f64();
    let h = g * g.transpose() + Matrix2::identity() * 0.02;
    (h, vector![angle.cos(), -angle.sin()], rng.f64(), 0.01 + 2.5 * rng.f64())
}

fn in_space(h: &Matrix2<f64>, u: &Vector2<f64>, across: f64, angle: f64) -> (ImpactProblem<f64, 3>, Rotation3<f64>) {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
    let lifted = matrix![h[(0, 0)], 0.0, h[(0, 1)]; 0.0, across, 0.0; h[(0, 1)], 0.0, h[(1, 1)]];
    let problem = ImpactProblem::new(turn * lifted * turn.inverse(), turn * vector![u[0], 0.0, u[1]]).unwrap();
    (problem, turn)
}

#[test]
fn flow_agrees_with_the_closed_form_on_planar_problems() {
    let mut rng = fastrand::Rng::with_seed(31);
    let mut worst = 0.0_f64;
    for i in 0..5_000 {
        let (h, mut u, e, mu) = drawn(&mut rng);
        let e = match i % 8 {
            0 => 0.0,
            1 => 1.0,
            _ => e,
        };
        if i % 7 == 0 {
            u[0] = 0.0;
        }
        let across = 0.1 + rng.f64();
        let plane = ImpactProblem::new(h, u).unwrap();
        let angle = if i % 2 == 0 { 0.0 } else { std::f64::consts::TAU * rng.f64() };
        for ending in [Ending::Velocity, Ending::Impulse, Ending::Work] {
            let table = walk(&plane, e, mu, ending).unwrap();
            let (problem, turn) = in_space(&h, &u, across, angle);
            let found = follow(&problem, e, mu, ending).unwrap();
            let u_plus = turn * vector![table.v_t, 0.0, table.v_n];
            let impulse = turn * vector![table.p_t, 0.0, table.p_n];
            let off = ((found.u_plus - u_plus).norm() / u_plus.norm().max(1.0))
                .max((found.impulse - impulse).norm() / impulse.norm());
            let account = &table.account;
            let works = (found.account.normal_work - account.normal_work)
                .abs()
                .max((found.account.friction_work - account.friction_work).abs());
            assert!(
                off < 1e-12 && works < 1e-12 * impulse.norm().max(1.0),
                "{off:e} {works:e} {i} {h:?} {u:?} {e} {mu} {ending:?}"
            );
            assert_eq!(found.account.mode, account.mode, "{i}");
            worst = worst.max(off);
        }
    }
    println!("worst {worst:e}");
}

/// A planar arm has no mobility across its plane; sticking or not, the outcome is that of the closed form.
#[test]
fn flow_agrees_with_the_closed_form_without_mobility_across_the_plane() {
    let mut rng = fastrand::Rng::with_seed(32);
    for _ in 0..2_000 {
        let (h, u, e, mu) = drawn(&mut rng);
        let (problem, turn) = in_space(&h, &u, 0.0, 0.3);
        for ending in [Ending::Velocity, Ending::Impulse, Ending::Work] {
            let table = walk(&ImpactProblem::new(h, u).unwrap(), e, mu, ending).unwrap();
            let found = follow(&problem, e, mu, ending).unwrap();
            let u_plus = turn * vector![table.v_t, 0.0, table.v_n];
            assert!((found.u_plus - u_plus).norm() < 1e-12 * u_plus.norm().max(1.0), "{h:?} {u:?} {e} {mu} {ending:?}");
        }
    }
}

/// A single-joint arm on which friction acts stays or wedges, as in the plane.
#[test]
fn flow_of_a_single_joint_stays_or_wedges() {
    let j = vector![0.3, 0.7];
    let h = j * j.transpose();
    for ending in [Ending::Velocity, Ending::Impulse, Ending::Work] {
        let (problem, _) = in_space(&h, &-j, 0.0, 1.1);
        let found = follow(&problem, 0.5, 4.0, ending).unwrap();
        assert!(found.u_plus.norm() < 1e-15 && found.impulse.amax().is_finite());
        let (carried, _) = in_space(&h, &vector![0.5, -0.7], 0.0, 1.1);
        assert!(matches!(follow(&carried, 0.5, 4.0, ending), Err(ImpactError::Wedged { .. })));
    }
}

/// Stronge's coefficient where friction jams during restitution: v_n falls, and restitution ends where the work returned
/// since its begin is e² times the work absorbed, or v_n is zero before.
#[test]
fn restitution_that_jams_ends_at_e_squared_of_the_work_or_at_zero_velocity() {
    let heading = vector![1.0, 0.0];
    let line = Line { heading, slip_rate: 0.5, normal_rate: -1.0, friction_rate: heading * -0.8, locked: false };
    let returned = 0.2;
    let state =
        State { p: 0.3, p_t: Vector2::zeros(), heading, r: 1.0, v_n: 1.0, normal_work: returned, friction_work: 0.0 };
    // At most v_n²/2 = 0.5 more is returned before v_n = 0.
    for k in 0..=100 {
        let target = returned + 0.01 * f64::from(k);
        let end = End { ending: Ending::Work, e: target.sqrt(), v_n_minus: -2.0, pc: 1.0, work: -1.0 };
        match line.returns(&state, &end) {
            Return::Ends(x) => {
                assert!(target < 0.7 + 1e-12, "{target}");
                let step = line.at(&state, x);
                assert!((returned + step.normal_work - target).abs() < 1e-14 && step.v_n >= -1e-7, "{target}");
            }
            Return::Falls(x) => {
                assert!(target > 0.7 - 1e-12, "{target}");
                assert_eq!(line.at(&state, x).v_n, 0.0);
            }
            Return::Not => panic!("slip does not stop here"),
        }
    }
}

/// Impulses and works of a step are integrals of the slip along it, here by Gauss's rule, and the slip at its end is
/// `v_t(0) + A p_t + h p`. The rule is exact for the degree of the series; the rest is rounding and the truncation of r v.
#[test]
fn impulses_and_works_of_a_step_are_integrals_of_the_slip() {
    let mut rng = fastrand::Rng::with_seed(41);
    for _ in 0..2_000 {
        let g = Matrix3::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
        let h = g * g.transpose() + Matrix3::identity() * 0.05;
        let (angle, mu) = (std::f64::consts::TAU * rng.f64(), 0.05 + 1.5 * rng.f64());
        let (tangents, coupling) = (h.fixed_view::<2, 2>(0, 0).into_owned(), vector![h[(0, 2)], h[(1, 2)]]);
        let (heading, r, v_n) = (vector![angle.cos(), angle.sin()], 10.0_f64.powf(2.0 - 4.0 * rng.f64()), -rng.f64());
        let scale = coupling.norm() + mu * tangents.norm();
        let contact = Contact { tangents, coupling, normal: h[(2, 2)], slip: heading * r, v_n };
        let mut turn = Turn::new(&contact, mu, scale);
        turn.begin(heading, r, v_n);
        let t = turn.end() * rng.f64();
        let whole = turn.sums(t);
        let (mut p, mut p_t, mut works, mut passed) = (0.0, Vector2::zeros(), Vector2::zeros(), 0.0);
        for (x, weight) in NODES.into_iter().zip(WEIGHTS) {
            let (at, dp) = (turn.sums(t * x), weight * t / scale);
            let v_n = turn.quantity(Quantity::Velocity, t * x).0;
            p += at.r * dp;
            p_t -= at.heading * (mu * at.r * dp);
            works += vector![v_n, -mu * at.r] * (at.r * dp);
            passed += (v_n.abs() + mu * at.r) * at.r * dp;
        }
        let slip = heading * r + tangents * p_t + coupling * p;
        assert!((whole.p - p).abs() < 1e-14 * p && (whole.p_t - p_t).norm() < 1e-14 * mu * p, "{t} {h} {mu} {r}");
        let off = (whole.normal_work - works.x).abs().max((whole.friction_work - works.y).abs());
        assert!(off < 1e-13 * passed, "{off:e} {passed:e} {t} {h} {mu} {r} {v_n}");
        assert!((whole.heading * whole.r - slip).norm() < 1e-14 * (r + scale * p), "{t} {h} {mu} {r}");
    }
}
