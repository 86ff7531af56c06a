//! The closed form of the planar laws against an event-driven integration: the velocity follows `du = H d dp`, events
//! are zeros of functions of the state found by bisection, and the motion after a stop of slip is found by trying which
//! slip persists.

use crate::common::{Case, FOLLOWING, any_case};
use carom_impact::{Mode, Phase};
use nalgebra::{Vector2, vector};

/// State along the impact; `work` is the normal work since compression began or ended.
#[derive(Debug, Clone, Copy)]
struct State {
    u: Vector2<f64>,
    impulse: Vector2<f64>,
    work: f64,
    since: f64,
}

/// Friction: slip with a sign, or the impulse ratio of stick.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Friction {
    Slip(f64),
    Hold(f64),
}

fn direction(friction: Friction, mu: f64) -> Vector2<f64> {
    match friction {
        Friction::Slip(s) => vector![-mu * s, 1.0],
        Friction::Hold(ratio) => vector![ratio, 1.0],
    }
}

/// Exact flow for `dp` under constant friction (Simpson's rule: exact here, since the work is quadratic in p).
fn flow(case: &Case<2>, state: &State, friction: Friction, dp: f64) -> State {
    let d = direction(friction, case.friction);
    let rate = case.delassus * d;
    let normal_speed = |x: f64| state.u[1] + rate[1] * x;
    let simpson = (normal_speed(0.0) + 4.0 * normal_speed(0.5 * dp) + normal_speed(dp)) / 6.0;
    State {
        u: state.u + rate * dp,
        impulse: state.impulse + d * dp,
        work: state.work + simpson * dp,
        since: state.since + dp,
    }
}

fn friction_at(case: &Case<2>, u_t: f64) -> Friction {
    if u_t != 0.0 {
        return Friction::Slip(u_t.signum());
    }
    for s in [1.0, -1.0] {
        let drift = (case.delassus * direction(Friction::Slip(s), case.friction))[0];
        if s * drift > 0.0 {
            return Friction::Slip(s);
        }
    }
    // The ratio for which the tangent does not move, by the secant of a linear function.
    let drift = |ratio: f64| (case.delassus * vector![ratio, 1.0])[0];
    Friction::Hold(-drift(0.0) / (drift(1.0) - drift(0.0)))
}

/// Least `dp > 0` at which `event` turns from negative to not negative, or infinity.
fn first_zero(event: impl Fn(f64) -> f64) -> f64 {
    let mut high = 1e-6;
    while event(high) < 0.0 {
        high *= 2.0;
        if high > 1e12 {
            return f64::INFINITY;
        }
    }
    let mut low = 0.0;
    for _ in 0..2000 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if event(middle) < 0.0 { low = middle } else { high = middle }
    }
    high
}

/// Integrates until `event` is zero, through any stop of slip, and tells whether slip has stopped.
fn run(case: &Case<2>, mut state: State, event: impl Fn(&State) -> f64) -> (State, bool) {
    let mut stopped = false;
    loop {
        let friction = friction_at(case, state.u[0]);
        let ends = first_zero(|dp| event(&flow(case, &state, friction, dp)));
        let stops = match friction {
            Friction::Slip(s) if s * state.u[0] > 0.0 => first_zero(|dp| -s * flow(case, &state, friction, dp).u[0]),
            _ => f64::INFINITY,
        };
        if ends <= stops {
            assert!(ends.is_finite(), "{case:?} never ends from {state:?}");
            let mut end = flow(case, &state, friction, ends);
            if let Friction::Hold(_) = friction {
                end.u[0] = 0.0;
            }
            return (end, stopped);
        }
        state = flow(case, &state, friction, stops);
        (state.u[0], stopped) = (0.0, true);
    }
}

/// The end, and the phase in which slip has stopped.
fn integrate(law: &str, case: &Case<2>) -> (State, Option<Phase>) {
    let e = case.restitution;
    let start = State { u: case.u, impulse: Vector2::zeros(), work: 0.0, since: 0.0 };
    let (peak, stopped) = run(case, start, |state| state.u[1]);
    let compression = stopped.then_some(Phase::Compression);
    if e == 0.0 {
        return (peak, compression);
    }
    let turned = State { u: vector![peak.u[0], 0.0], work: 0.0, since: 0.0, ..peak };
    let (end, stopped) = match law {
        "newton" => run(case, turned, |state| state.u[1] + e * case.u[1]),
        "poisson" => run(case, turned, |state| state.since - e * peak.impulse[1]),
        "energetic" => run(case, turned, |state| state.work + e * e * peak.work),
        _ => unreachable!(),
    };
    (end, compression.or(stopped.then_some(Phase::Restitution)))
}

#[test]
fn closed_form_agrees_with_event_driven_integration() {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut worst = 0.0_f64;
    for k in 0..10_000 {
        let mut case = any_case(&mut rng, 0.1);
        if k % 20 == 0 {
            // Slip that starts from rest keeps its direction, or the contact sticks.
            case.u = vector![0.0, -1.0];
        }
        for law in FOLLOWING {
            let hit = case.resolve(law);
            let (reference, slip_end) = integrate(law, &case);
            let speed = case.u.norm().max(hit.u_plus.norm());
            let off = ((hit.u_plus - reference.u).norm() / speed)
                .max((hit.impulse - reference.impulse).norm() / hit.impulse.norm());
            worst = worst.max(off);
            assert!(off <= 1e-12, "{law} off {off:e}\n{case:?}\n{hit:?}\n{reference:?}");
            let sticks = reference.u[0].abs() <= 1e-12 * speed;
            assert_eq!((hit.mode == Mode::Stick, hit.slip_end), (sticks, slip_end), "{law} {case:?} {hit:?}");
        }
    }
}
