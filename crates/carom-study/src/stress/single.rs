//! One contact, on plain numbers.

use super::{Found, Judged, law, said};
use carom_impact::{Flags, ImpactOutcome, ImpactProblem};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, matrix, vector};

/// Kane & Levinson's pendulum (Kane & Levinson, *Dynamics*, 1985): two uniform rods of 1 m and 1 kg at 20° and 30° from the
/// vertical.
fn pendulum() -> Matrix2<f64> {
    let [a, b] = [20_f64, 30.0].map(f64::to_radians);
    let mass = matrix![4.0 / 3.0, 0.5 * (b - a).cos(); 0.5 * (b - a).cos(), 1.0 / 3.0];
    let jacobian = matrix![a.cos(), b.cos(); a.sin(), b.sin()];
    let inverse = mass.try_inverse().unwrap_or_else(|| unreachable!("a mass matrix has an inverse"));
    jacobian * inverse * jacobian.transpose()
}

/// Laws that theory lets gain energy: those whose restitution is a ratio of velocities beside Coulomb's friction.
fn may_gain(name: &str) -> bool {
    matches!(name, "whittaker" | "newton")
}

/// The worst of many impacts under one law.
struct Worst {
    violation: f64,
    gain: f64,
    at: String,
}

impl Worst {
    fn new() -> Self {
        Self { violation: 0.0, gain: 1.0, at: String::new() }
    }

    /// Violations of |P_t| ≤ μ P_n, P_n ≥ 0, u_n⁺ ≥ 0 and ½ P·(u⁻+u⁺) = T⁺ − T⁻, each relative.
    fn add<const D: usize>(&mut self, hit: &ImpactOutcome<f64, D>, mu: f64, at: impl Fn() -> String) {
        let n = D - 1;
        let tangential = hit.impulse.rows(0, n).norm();
        let size = hit.impulse.norm().max(f64::MIN_POSITIVE);
        let speed = hit.u_minus.norm().max(hit.u_plus.norm());
        let energy = hit.energy_before.max(hit.energy_after);
        let books = (hit.energy_after - hit.energy_before - hit.energy_change).abs() / energy;
        let outside = if hit.law == "frictionless" { 0.0 } else { (tangential - mu * hit.impulse[n]).max(0.0) / size };
        let pulls = (-hit.impulse[n]).max(0.0) / size;
        let approaches = (-hit.u_plus[n]).max(0.0) / speed;
        // max() passes NaN by.
        for violation in [books, outside, pulls, approaches] {
            self.violation = if violation.is_nan() { violation } else { self.violation.max(violation) };
        }
        if hit.energy_ratio() > self.gain {
            (self.gain, self.at) = (hit.energy_ratio(), at());
        }
    }

    fn found(self, law: &str) -> Found {
        let Self { violation, gain, at } = self;
        let found = Found::figure(violation);
        // What the flag calls a gain is beyond rounding.
        match gain > 1.0 + 1e-9 {
            true if may_gain(law) => found.failing(Some(format!("energy gained: T⁺/T⁻ = {gain:.3} at {at}"))),
            true => Found::figure(f64::INFINITY).noting(format!("energy gained: T⁺/T⁻ = {gain} at {at};")),
            false => found,
        }
    }
}

pub fn kane_levinson(name: &str) -> Judged {
    let problem = ImpactProblem::new(pendulum(), vector![-0.267174342835, -0.134202014333]).map_err(said)?;
    let mut worst = Worst::new();
    for i in 0..=20 {
        for k in 0..=30 {
            let (e, mu) = (f64::from(i) / 20.0, f64::from(k) / 25.0);
            let hit = law(name, e, mu).resolve(&problem).map_err(said)?;
            worst.add(&hit, mu, || format!("e = {e}, μ = {mu}"));
        }
    }
    Ok(worst.found(name))
}

/// A random H with eigenvalues between 0.2 and 5 or so, and a random approach.
fn random<const D: usize>(rng: &mut fastrand::Rng) -> Result<ImpactProblem<f64, D>, String> {
    let mut number = || 2.0 * rng.f64() - 1.0;
    let factor = SMatrix::<f64, D, D>::from_fn(|_, _| number());
    let mut u = SVector::<f64, D>::from_fn(|_, _| number());
    u[D - 1] = -u[D - 1].abs() - 1e-3;
    ImpactProblem::new(factor * factor.transpose() + SMatrix::identity() * 0.2, u).map_err(said)
}

pub fn census(name: &str) -> Judged {
    random_impacts::<2>(name, 20_000)
}

pub fn census_in_space(name: &str) -> Judged {
    random_impacts::<3>(name, 2_000)
}

fn random_impacts<const D: usize>(name: &str, count: usize) -> Judged {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut worst = Worst::new();
    let mut gains = 0;
    for k in 0..count {
        let problem = random::<D>(&mut rng)?;
        let (e, mu) = (rng.f64(), 2.0 * rng.f64());
        let hit = law(name, e, mu).resolve(&problem).map_err(said)?;
        gains += usize::from(hit.flags.contains(Flags::ENERGY_GAIN));
        worst.add(&hit, mu, || format!("problem {k} (e = {e:.2}, μ = {mu:.2})"));
    }
    let found = worst.found(name);
    let fails = found.fails.as_ref().map(|how| format!("{how}; {gains} of {count} gain"));
    Ok(found.failing(fails))
}

pub fn jam(name: &str) -> Judged {
    let problem = ImpactProblem::new(pendulum(), vector![0.3, -0.134201]).map_err(said)?;
    let hit = law(name, 0.5, 0.8).resolve(&problem).map_err(said)?;
    let mut worst = Worst::new();
    worst.add(&hit, 0.8, || "u⁻ = (0.3, -0.134)".to_owned());
    let rebound = hit.u_plus[1] / 0.134201;
    if matches!(name, "newton" | "poisson" | "energetic") && !hit.flags.contains(Flags::JAM) {
        return Ok(Found::figure(f64::INFINITY).noting("a jam that is not flagged;"));
    }
    Ok(worst.found(name).noting(format!("rebounds with {rebound:.2} of the approach")))
}

/// A uniform rod of 1 m and 1 kg, its lower end at the lower left.
fn rod(degrees: f64) -> Matrix2<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    matrix![1.0 + 3.0 * s * s, -3.0 * s * c; -3.0 * s * c, 1.0 + 3.0 * c * c]
}

pub fn without_collision(name: &str) -> Judged {
    let at = |v: f64| {
        let problem = ImpactProblem::new(rod(60.0), vector![-1.0, -v]).map_err(said)?;
        law(name, 0.5, 1.5).resolve(&problem).map_err(said)
    };
    let (limit, touching) = (at(1e-12)?, at(0.0)?);
    let left = limit.impulse[1];
    if left < 1e-9 {
        return Ok(Found::figure(left));
    }
    if !touching.flags.contains(Flags::NON_UNIQUE) {
        return Ok(Found::figure(f64::INFINITY).noting("a jump that is not flagged;"));
    }
    let how = format!("not unique at u_n = 0, and flagged so: slides on, or P_n = {left:.4} N s");
    Ok(Found::figure(left).failing(Some(how)))
}

/// With friction below B/A and slip that grows, P_n = (1+e)|u_n|/(C − μB) and P_t = −μ P_n for every law.
pub fn grazing(name: &str) -> Judged {
    let (h, e, mu) = (pendulum(), 0.5, 0.3);
    let mut error = 0.0_f64;
    for k in 0..=12 {
        let v = 10_f64.powi(-k);
        let problem = ImpactProblem::new(h, vector![1.0, -v]).map_err(said)?;
        let hit = law(name, e, mu).resolve(&problem).map_err(said)?;
        let mu = if name == "frictionless" { 0.0 } else { mu };
        let normal = (1.0 + e) * v / (h[(1, 1)] - mu * h[(0, 1)]);
        error = worse(error, (hit.impulse - Vector2::new(-mu * normal, normal)).norm() / normal);
    }
    Ok(Found::figure(error))
}

/// The larger, and NaN if one is.
pub fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

pub fn extreme_restitution(name: &str) -> Judged {
    let mut rng = fastrand::Rng::with_seed(2);
    let mut error = 0.0;
    for k in 0..2000 {
        let problem = random::<3>(&mut rng)?;
        let e = f64::from(k % 2);
        let hit = law(name, e, 0.0).resolve(&problem).map_err(said)?;
        let speed = problem.approach_speed();
        error = worse(error, (hit.u_plus[2] - e * speed).abs() / speed);
        let lost = (1.0 - e * e) * speed * speed / (2.0 * problem.delassus()[(2, 2)]);
        error = worse(error, (hit.energy_before - hit.energy_after - lost).abs() / hit.energy_before);
    }
    Ok(Found::figure(error))
}

/// All laws but Brach's are continuous where slip vanishes; his pushes along the first slip, which has no direction there.
pub fn slip_at_rest(name: &str) -> Judged {
    let mut rng = fastrand::Rng::with_seed(4);
    let mut error = 0.0;
    for _ in 0..500 {
        let problem = random::<3>(&mut rng)?;
        let (h, mut u) = (*problem.delassus(), *problem.u_minus());
        let slip = vector![u[0], u[1], 0.0].normalize() * 1e-12;
        let (e, mu) = (rng.f64(), rng.f64());
        u = vector![0.0, 0.0, u[2]];
        let resolve = |u| law(name, e, mu).resolve(&ImpactProblem::new(h, u).map_err(said)?).map_err(said);
        let moved = resolve(u + slip)?.u_plus - resolve(u)?.u_plus;
        error = worse(error, moved.norm() / u.norm());
    }
    let jumps = "jumps: it pushes along the first slip, which has no direction at rest".to_owned();
    Ok(Found::figure(error).failing((name == "brach" && error > 1e-9).then_some(jumps)))
}
