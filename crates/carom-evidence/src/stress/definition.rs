//! What defines each law of one contact, checked on an outcome.
//!
//! Nothing here calls the implementation of a law. Each law has its defining equations (book, pages of the laws), and
//! [`violation`] is the largest relative error with which an outcome meets them, together with what holds for every law:
//! u⁺ = u⁻ + H P, P_n ≥ 0, u_n⁺ ≥ 0, |P_t| ≤ μ P_n, and T⁺ − T⁻ = ½ P·(u⁻ + u⁺).
//!
//! | law | its definition |
//! | --- | --- |
//! | frictionless | u_n⁺ = −e u_n⁻; P_t = 0 |
//! | whittaker | u_n⁺ = −e u_n⁻; P_t = −μ P_n u_t⁺/\|u_t⁺\| where u_t⁺ ≠ 0 |
//! | newton | P_t and u⁺ are those of the impulse path at P_n; u_n⁺ = −e u_n⁻ |
//! | poisson | the same path; P_n = (1 + e) p_c, p_c where compression ends |
//! | energetic (Stronge) | the same path; W_n = (1 − e²) W_c, W_c the normal work of compression |
//! | chatterjee-ruina | P = (1 + e) P_I + κ (P_II − P_I), κ = 1 or where the cone \|P_t\| = μ P_n is reached |
//! | brach | u_n⁺ = −e u_n⁻; P_t = r P_n t: the largest \|r\| ≤ μ that neither drives slip past rest nor gains energy |
//! | smith | u_n⁺ = −e u_n⁻; P_t = −μ P_n (\|v⁻\|v⁻ + \|v⁺\|v⁺)/(\|v⁻\|² + \|v⁺\|²) |
//!
//! The path is that of [`super::impulse_path`].

use super::impulse_path;
use super::single::worse;
use carom_impact::ImpactOutcome;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// An outcome, or a matrix, with two tangents: in the plane the second one is decoupled.
fn in_space<const D: usize>(u: &SVector<f64, D>) -> Vector3<f64> {
    Vector3::new(u[0], if D == 3 { u[1] } else { 0.0 }, u[D - 1])
}

fn matrix_in_space<const D: usize>(h: &SMatrix<f64, D, D>) -> Matrix3<f64> {
    let place = |i: usize| if i + 1 == D { 2 } else { i };
    let mut whole = Matrix3::identity();
    for i in 0..D {
        for j in 0..D {
            whole[(place(i), place(j))] = h[(i, j)];
        }
    }
    whole
}

/// The largest relative error of an outcome against its law's definition; NaN if it cannot be computed.
pub fn violation<const D: usize>(h: &SMatrix<f64, D, D>, hit: &ImpactOutcome<f64, D>, e: f64, mu: f64) -> f64 {
    let reported = Reported::of(hit);
    violation_of(hit.law, h, &[hit.u_minus, hit.u_plus, hit.impulse], &reported, e, mu)
}

/// Work and energies (J) that an outcome reports.
pub struct Reported {
    normal_work: f64,
    friction_work: f64,
    /// Before, after, change.
    energies: [f64; 3],
}

impl Reported {
    pub fn of<const D: usize>(hit: &ImpactOutcome<f64, D>) -> Self {
        Self {
            normal_work: hit.normal_work,
            friction_work: hit.friction_work,
            energies: [hit.energy_before, hit.energy_after, hit.energy_change],
        }
    }
}

/// The same of velocities before and after and an impulse, tangents first.
pub fn violation_of<const D: usize>(
    law: &str,
    h: &SMatrix<f64, D, D>,
    [before, after, impulse]: &[SVector<f64, D>; 3],
    reported: &Reported,
    e: f64,
    mu: f64,
) -> f64 {
    let case = Case {
        h: matrix_in_space(h),
        before: in_space(before),
        after: in_space(after),
        impulse: in_space(impulse),
        e,
        mu: if law == "frictionless" { 0.0 } else { mu },
    };
    let own = match law {
        "frictionless" => case.rebound(),
        "whittaker" => worse(case.rebound(), case.against(&case.after.xy())),
        "newton" | "poisson" | "energetic" => case.on_path(law, reported),
        "chatterjee-ruina" => worse(case.rebound(), case.chatterjee_ruina()),
        "brach" => worse(case.rebound(), case.brach()),
        "smith" => worse(case.rebound(), case.smith()),
        _ => f64::NAN,
    };
    [own, case.any_law(), case.energy(reported.energies)].into_iter().fold(0.0, worse)
}

/// One outcome, tangents first.
struct Case {
    h: Matrix3<f64>,
    before: Vector3<f64>,
    after: Vector3<f64>,
    impulse: Vector3<f64>,
    e: f64,
    mu: f64,
}

impl Case {
    fn speed(&self) -> f64 {
        self.before.norm().max(self.after.norm()).max(f64::MIN_POSITIVE)
    }

    fn size(&self) -> f64 {
        self.impulse.norm().max(f64::MIN_POSITIVE)
    }

    /// Conditions that all laws have in common, except the energy balance.
    fn any_law(&self) -> f64 {
        let outside = (self.impulse.xy().norm() - self.mu * self.impulse.z).max(0.0) / self.size();
        let pulls = (-self.impulse.z).max(0.0) / self.size();
        let approaches = (-self.after.z).max(0.0) / self.speed();
        let moved = (self.before + self.h * self.impulse - self.after).norm() / self.speed();
        [outside, pulls, approaches, moved].into_iter().fold(0.0, worse)
    }

    /// The energies reported, from H and the velocities.
    fn energy(&self, [before, after, change]: [f64; 3]) -> f64 {
        let Some(factor) = self.h.cholesky() else { return f64::NAN };
        let energy = |u: &Vector3<f64>| 0.5 * u.dot(&factor.solve(u));
        let (t_before, t_after) = (energy(&self.before), energy(&self.after));
        let size = t_before.max(t_after);
        [before - t_before, after - t_after, change - (t_after - t_before)]
            .into_iter()
            .fold(0.0, |most, error| worse(most, error.abs() / size))
    }

    /// u_n⁺ = −e u_n⁻.
    fn rebound(&self) -> f64 {
        (self.after.z + self.e * self.before.z).abs() / self.speed()
    }

    /// Relative residual of Coulomb friction P_t = −μ P_n s/|s|, weighted by |s|, for a slip velocity s.
    fn against(&self, slip: &Vector2<f64>) -> f64 {
        (slip.norm() * self.impulse.xy() + slip * (self.mu * self.impulse.z)).norm() / (self.speed() * self.size())
    }

    fn on_path(&self, law: &str, reported: &Reported) -> f64 {
        let Some(end) = impulse_path::follow(&self.h, &self.before, self.mu, self.impulse.z) else { return f64::NAN };
        let Some(compression) = end.compression else { return f64::NAN };
        let work = end.compression_work;
        let ends = match law {
            "newton" => self.rebound(),
            "poisson" => (self.impulse.z - (1.0 + self.e) * compression).abs() / self.impulse.z,
            _ => (end.normal_work - (1.0 - self.e * self.e) * work).abs() / -work,
        };
        let size = self.speed() * self.size();
        [
            ends,
            (end.u - self.after).norm() / self.speed(),
            (end.tangential - self.impulse.xy()).norm() / self.size(),
            (end.normal_work - reported.normal_work).abs() / size,
            (end.friction_work - reported.friction_work).abs() / size,
        ]
        .into_iter()
        .fold(0.0, worse)
    }

    /// Chatterjee & Ruina (1998) with a tangential restitution of 0.
    fn chatterjee_ruina(&self) -> f64 {
        let Some(inverse) = self.h.try_inverse() else { return f64::NAN };
        let smooth = Vector3::new(0.0, 0.0, -self.before.z / self.h[(2, 2)]);
        let rest = -(inverse * self.before) - smooth;
        let inside = |p: &Vector3<f64>| p.xy().norm() <= self.mu * p.z;
        let rebound = smooth * (1.0 + self.e);
        let share =
            if inside(&(rebound + rest)) { 1.0 } else { self.mu * rebound.z / (rest.xy().norm() - self.mu * rest.z) };
        (rebound + rest * share - self.impulse).norm() / self.size()
    }

    /// Brach (1989), the ratio asked for being μ towards rest.
    fn brach(&self) -> f64 {
        let slip = self.before.xy();
        let coupling = self.h.fixed_view::<2, 1>(0, 2).into_owned();
        let t = [slip, coupling].into_iter().find(|v| v.norm() > 0.0).map_or(slip, |v| v.normalize());
        let direction = Vector3::new(t.x, t.y, 0.0);
        let gain = -(1.0 + self.e) * self.before.z;
        let with = |ratio: f64| {
            let push = direction * ratio + Vector3::z();
            let impulse = push * (gain / (self.h * push).z);
            let after = self.before + self.h * impulse;
            (impulse, direction.dot(&after), 0.5 * impulse.dot(&(self.before + after)))
        };
        let (smooth, slides, _) = with(0.0);
        let ratio = direction.dot(&self.impulse) / self.impulse.z;
        let (impulse, along, change) = with(ratio);
        let energy = 0.5 * self.speed() * self.size();
        // The ratio is towards rest, and so are all from none up to it: no slip past rest, no gain.
        let mut wrong = (ratio * slides.signum()).max(0.0);
        for k in 0..=16 {
            let (_, along, change) = with(ratio * f64::from(k) / 16.0);
            wrong = worse(wrong, (-along * slides.signum()).max(0.0) / self.speed());
            wrong = worse(wrong, change.max(0.0) / energy);
        }
        // It is the largest such: friction, rest or energy limits it.
        let limits =
            [(self.mu - ratio.abs()).abs() * smooth.z / self.size(), along.abs() / self.speed(), change.abs() / energy];
        [wrong, limits.into_iter().fold(f64::INFINITY, f64::min), (impulse - self.impulse).norm() / self.size()]
            .into_iter()
            .fold(0.0, worse)
    }

    /// Smith (1991); without slip before and after any friction in the cone.
    fn smith(&self) -> f64 {
        let (before, after) = (self.before.xy(), self.after.xy());
        let squares = before.norm_squared() + after.norm_squared();
        if squares <= (1e-9 * self.speed()).powi(2) {
            return 0.0;
        }
        let mean = (before * before.norm() + after * after.norm()) / squares;
        (self.impulse.xy() + mean * (self.mu * self.impulse.z)).norm() / self.size()
    }
}
