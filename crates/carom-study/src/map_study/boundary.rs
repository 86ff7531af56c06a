//! Distance of a row to the nearest change of its mode, in friction, restitution or approach angle.
//!
//! [`carom_impact::Boundary`] gives a normalised distance to a boundary. Here one parameter is changed with all others held,
//! and the law is evaluated for its mode: in steps outwards in both directions, then by bisection to rounding between two
//! steps with different modes. The method uses no formulas of a law, so it is the same for every law in the plane and in
//! space. An interval of another mode that is shorter than a step can be missed.

use carom_impact::{Edge, Mode};

/// Number of steps over the range of a parameter.
const STEPS: i32 = 128;

/// The parameter that is changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Along {
    /// Coefficient of friction, from 0 to about 81 (the friction angle one step below 90°).
    Friction,
    /// Coefficient of restitution, 0 to 1.
    Restitution,
    /// Approach angle, degrees, 0 to 180.
    Approach,
}

impl Along {
    /// Greatest value, on the scale of the steps.
    const fn end(self) -> f64 {
        match self {
            Self::Friction => 90.0 * (STEPS - 1) as f64 / STEPS as f64,
            Self::Restitution => 1.0,
            Self::Approach => 180.0,
        }
    }

    const fn step(self) -> f64 {
        match self {
            Self::Friction => 90.0 / STEPS as f64,
            Self::Restitution => 1.0 / STEPS as f64,
            Self::Approach => 180.0 / STEPS as f64,
        }
    }

    /// Value on the scale of the steps: for friction the friction angle, degrees.
    fn scaled(self, x: f64) -> f64 {
        if self == Self::Friction { x.atan().to_degrees() } else { x }
    }

    fn value(self, scaled: f64) -> f64 {
        if self == Self::Friction { scaled.to_radians().tan() } else { scaled }
    }
}

/// The signed distance from `at` to the nearest value at which `mode` is not `own`; NaN if there is none.
pub(super) fn nearest_change(along: Along, at: f64, own: Mode, mode: impl Fn(f64) -> Option<Mode>) -> f64 {
    let differs = |x: f64| mode(x) != Some(own);
    let begin = along.scaled(at);
    // the last value on either side with mode `own`; `None` beyond the end of the range
    let mut sides = [(1.0, Some(at)), (-1.0, Some(at))];
    for k in 1..=STEPS {
        let mut found: Option<f64> = None;
        for (sign, last) in &mut sides {
            let Some(near) = *last else { continue };
            let to = begin + *sign * along.step() * f64::from(k);
            let ended = !(0.0..=along.end()).contains(&to);
            let far = along.value(to.clamp(0.0, along.end()));
            // `at` lies beyond the end of the range
            if (far - near) * *sign <= 0.0 {
                *last = None;
                continue;
            }
            if differs(far) {
                let change = bisect(at, near, far, &differs) - at;
                if found.is_none_or(|other| change.abs() < other.abs()) {
                    found = Some(change);
                }
            }
            *last = (!ended).then_some(far);
        }
        if let Some(change) = found {
            return change;
        }
    }
    f64::NAN
}

/// The last value, between `near` (where `differs` is false) and `far` (where it is true), at which `differs` is false; to
/// rounding relative to `at` or to the distance from it.
fn bisect(at: f64, mut near: f64, mut far: f64, differs: &impl Fn(f64) -> bool) -> f64 {
    let enough = f64::EPSILON * at.abs().max((far - at).abs());
    loop {
        let middle = near + (far - near) / 2.0;
        if (far - near).abs() <= enough || middle == near || middle == far {
            return near;
        }
        if differs(middle) {
            far = middle;
        } else {
            near = middle;
        }
    }
}

/// Names of the edges between modes, in the order of their codes.
pub(super) const EDGES: [Edge; 8] = [
    Edge::NoApproach,
    Edge::NoSlip,
    Edge::StopsAtTurn,
    Edge::StopsAtEnd,
    Edge::JustHolds,
    Edge::Jams,
    Edge::OnCone,
    Edge::Clipped,
];

pub(super) fn edge_code(edge: Edge) -> f64 {
    EDGES.iter().position(|known| *known == edge).map_or(f64::NAN, |k| k as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_of_two_mode_changes_is_found_to_rounding() {
        let between =
            |low: f64, high: f64| move |x: f64| Some(if (low..high).contains(&x) { Mode::Slip } else { Mode::Stick });
        for (low, at, high, expected) in [(0.2, 0.3, 0.9, -0.1), (0.2, 0.8, 0.9, 0.1), (-1.0, 0.3, 0.31, 0.01)] {
            for along in [Along::Friction, Along::Restitution, Along::Approach] {
                let found = nearest_change(along, at, Mode::Slip, between(low, high));
                assert!((found - expected).abs() < 1e-15, "{along:?} at {at}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn distance_is_nan_if_the_mode_never_changes() {
        for (along, at) in
            [(Along::Friction, 0.0), (Along::Friction, 300.0), (Along::Restitution, 1.0), (Along::Approach, 0.0)]
        {
            assert!(nearest_change(along, at, Mode::Slip, |_| Some(Mode::Slip)).is_nan(), "{along:?} at {at}");
        }
    }

    /// The tolerance of the bisection is relative to the starting value, so a change at 0 needs no more evaluations.
    #[test]
    fn a_change_at_zero_needs_no_more_evaluations_than_another() {
        let asked = std::cell::Cell::new(0);
        let mode = |x: f64| {
            asked.set(asked.get() + 1);
            (x > 0.0).then_some(Mode::Slip)
        };
        let found = nearest_change(Along::Approach, 45.0, Mode::Slip, mode);
        assert!((found + 45.0).abs() < 1e-13 && asked.get() < 150, "{found} after {}", asked.get());
    }

    /// An error of the law counts as a change of mode, also at the end of the range.
    #[test]
    fn an_error_of_the_law_counts_as_a_mode_change() {
        let found = nearest_change(Along::Restitution, 0.75, Mode::Slip, |x| (x < 1.0).then_some(Mode::Slip));
        assert!((found - 0.25).abs() < 1e-15);
    }
}
