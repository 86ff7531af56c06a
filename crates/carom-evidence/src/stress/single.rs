//! One contact, given by its Delassus matrix and velocity.

use super::definition::violation;
use super::method::{Found, Judged, law, said};
use carom_impact::{Flags, ImpactOutcome, ImpactProblem};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3, matrix, vector};

/// The larger number; NaN if one of the two is NaN.
pub fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// Kane & Levinson's pendulum (Kane & Levinson, *Dynamics*, 1985): two uniform rods of 1 m and 1 kg at 20° and 30° from the
/// vertical.
fn pendulum() -> Matrix2<f64> {
    let [a, b] = [20_f64, 30.0].map(f64::to_radians);
    let mass = matrix![4.0 / 3.0, 0.5 * (b - a).cos(); 0.5 * (b - a).cos(), 1.0 / 3.0];
    let jacobian = matrix![a.cos(), b.cos(); a.sin(), b.sin()];
    let inverse = mass.try_inverse().unwrap_or_else(|| unreachable!("a mass matrix has an inverse"));
    jacobian * inverse * jacobian.transpose()
}

const KANE: [f64; 2] = [-0.267174342835, -0.134202014333];

/// Laws that may gain energy: their restitution is a ratio of velocities, and they have Coulomb's friction.
fn may_gain(name: &str) -> bool {
    matches!(name, "whittaker" | "newton")
}

/// The worst of many impacts under one law.
#[derive(Default)]
struct Worst {
    count: usize,
    violation: f64,
    gains: usize,
    /// Largest T⁺/T⁻.
    ratio: f64,
}

impl Worst {
    fn add<const D: usize>(&mut self, h: &SMatrix<f64, D, D>, hit: &ImpactOutcome<f64, D>, e: f64, mu: f64) {
        self.count += 1;
        self.violation = worse(self.violation, violation(h, hit, e, mu));
        self.ratio = worse(self.ratio, hit.energy_ratio());
        // More than rounding, which is what the flag must say as well.
        let gains = hit.energy_after > hit.energy_before * (1.0 + 1e-9);
        self.gains += usize::from(gains);
        if gains != hit.flags.contains(Flags::ENERGY_GAIN) && (hit.energy_ratio() - 1.0).abs() > 1e-9 {
            self.violation = f64::NAN;
        }
    }

    /// Of a law that may gain: `gain` as the figure. Of the others: the violation, and no gain.
    fn found(self, law: &str, gain: impl Fn(&Self) -> f64, most: f64) -> Found {
        if may_gain(law) {
            Found::figure(gain(&self)).must("violation of the law's definition", self.violation, most)
        } else {
            Found::figure(self.violation).must("largest T⁺/T⁻", self.ratio, 1.0 + 1e-9)
        }
    }
}

pub fn kane_levinson(name: &str) -> Judged {
    let h = pendulum();
    let problem = ImpactProblem::new(h, KANE.into()).map_err(said)?;
    let mut worst = Worst::default();
    for i in 0..=20 {
        for k in 0..=30 {
            let (e, mu) = (f64::from(i) / 20.0, f64::from(k) / 25.0);
            let hit = law(name, e, mu).resolve(&problem).map_err(said)?;
            worst.add(&h, &hit, e, mu);
        }
    }
    Ok(worst.found(name, |worst| worst.ratio, super::method::EXACT))
}

/// T⁺/T⁻ of the pendulum if slip has stopped and e = 1, so that u⁺ = (0, −u_n⁻): no other u⁺ under these laws has more energy.
pub fn kane_gain(_: &str) -> Result<f64, String> {
    let (h, u) = (pendulum(), Vector2::from(KANE));
    let (a, b, c) = (h[(0, 0)], h[(0, 1)], h[(1, 1)]);
    Ok(a * u.y * u.y / (a * u.y * u.y - 2.0 * b * u.x * u.y + c * u.x * u.x))
}

/// A random H with eigenvalues between 0.2 and about 5, and a random approach.
fn random<const D: usize>(rng: &mut fastrand::Rng) -> Result<ImpactProblem<f64, D>, String> {
    let mut number = || 2.0 * rng.f64() - 1.0;
    let factor = SMatrix::<f64, D, D>::from_fn(|_, _| number());
    let mut u = SVector::<f64, D>::from_fn(|_, _| number());
    u[D - 1] = -u[D - 1].abs() - 1e-3;
    ImpactProblem::new(factor * factor.transpose() + SMatrix::identity() * 0.2, u).map_err(said)
}

/// Largest violation of a definition over the planar census: rounding, divided by the least share of the work that the
/// normal velocity, at least 1e-3 m/s, has in it.
pub const PLANAR: f64 = 1e-9;
/// In space it is the error of the numerical integration of the impulse path as well.
pub const SPATIAL: f64 = 1e-9;

pub fn census(name: &str) -> Judged {
    random_impacts::<2>(name, 20_000, PLANAR)
}

pub fn census_in_space(name: &str) -> Judged {
    random_impacts::<3>(name, 2_000, SPATIAL)
}

fn random_impacts<const D: usize>(name: &str, count: usize, most: f64) -> Judged {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut worst = Worst::default();
    for _ in 0..count {
        let problem = random::<D>(&mut rng)?;
        let (e, mu) = (rng.f64(), 2.0 * rng.f64());
        let hit = law(name, e, mu).resolve(&problem).map_err(said)?;
        worst.add(problem.delassus(), &hit, e, mu);
    }
    Ok(worst.found(name, |worst| worst.gains as f64 / worst.count as f64, most))
}

pub fn jam(name: &str) -> Judged {
    let h = pendulum();
    let problem = ImpactProblem::new(h, vector![0.3, -0.134201]).map_err(said)?;
    let hit = law(name, 0.5, 0.8).resolve(&problem).map_err(said)?;
    let flagged = hit.flags.contains(Flags::JAM) || !matches!(name, "whittaker" | "newton" | "poisson" | "energetic");
    let rebound = hit.u_plus[1] / 0.134201;
    let found = Found::figure(violation(&h, &hit, 0.5, 0.8)).must_be("flagged as jam", flagged);
    Ok(found.noting(format!("rebounds with {rebound:.2} of the approach velocity")))
}

/// A uniform rod of 1 m and 1 kg, its lower end at the lower left.
fn rod(degrees: f64) -> Matrix2<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    matrix![1.0 + 3.0 * s * s, -3.0 * s * c; -3.0 * s * c, 1.0 + 3.0 * c * c]
}

/// Of the rod that slides along the floor.
const JAMMED: (f64, f64) = (0.5, 1.5);

pub fn without_collision(name: &str) -> Judged {
    let (e, mu) = JAMMED;
    let law = law(name, e, mu);
    let at = |v: f64| ImpactProblem::new(rod(60.0), vector![-1.0, -v]).map_err(said);
    let limit = law.resolve(&at(1e-12)?).map_err(said)?.impulse[1];
    let found = Found::figure(limit);
    if name == "frictionless" {
        return Ok(found);
    }
    let branches = law.branches(&at(0.0)?).map_err(said)?;
    let flagged = branches.iter().all(|hit| hit.flags.contains(Flags::NON_UNIQUE));
    let impulses: Vec<f64> = branches.iter().map(|hit| hit.impulse[1]).collect();
    let both = impulses.len() == 2 && impulses[0] == 0.0 && (impulses[1] / limit - 1.0).abs() < 1e-9;
    Ok(found.must_be("both answers given at u_n = 0, and flagged non-unique", flagged && both))
}

/// Normal impulse of the impact without collision, u⁻ = (−1, 0). Stick leaves u⁺ = 0: P = H⁻¹(1, 0). Poisson's law returns e
/// times that, Stronge's e² of the work. Smith's law leaves a slip y with w = C/(μB) = −(1 − y²)/(1 + y²).
pub fn impulse_without_collision(name: &str) -> Result<f64, String> {
    let (h, (e, mu)) = (rod(60.0), JAMMED);
    let (a, b, c) = (h[(0, 0)], h[(0, 1)], h[(1, 1)]);
    let det = a * c - b * b;
    let stick = -b / det;
    Ok(match name {
        "poisson" => (1.0 + e) * stick,
        "energetic" => {
            let (stop, rate) = (1.0 / (b + mu * a), det / a);
            let deepest = (c + mu * b) * stop;
            let work = 0.5 * deepest * stop - 0.5 * deepest * deepest / rate;
            stop - deepest / rate + e * (-2.0 * work / rate).sqrt()
        }
        "smith" => {
            let w = c / (mu * -b);
            (1.0 + ((1.0 - w) / (1.0 + w)).sqrt()) / (a * c / -b + b)
        }
        _ => stick,
    })
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

/// The impacts of [`slip_at_rest`]: H, normal approach, direction of slip, e, μ.
struct AtRest {
    h: Matrix3<f64>,
    u: Vector3<f64>,
    slip: Vector3<f64>,
    e: f64,
    mu: f64,
}

fn at_rest() -> Result<Vec<AtRest>, String> {
    let mut rng = fastrand::Rng::with_seed(4);
    let mut one = || {
        let problem = random::<3>(&mut rng)?;
        let u = *problem.u_minus();
        let slip = vector![u[0], u[1], 0.0].normalize();
        Ok(AtRest { h: *problem.delassus(), u: vector![0.0, 0.0, u[2]], slip, e: rng.f64(), mu: rng.f64() })
    };
    (0..500).map(|_| one()).collect()
}

/// Slip of 1e-12 m/s against none.
pub fn slip_at_rest(name: &str) -> Judged {
    let (mut jump, mut wrong) = (0.0, 0.0);
    for AtRest { h, u, slip, e, mu } in at_rest()? {
        let resolve = |u| law(name, e, mu).resolve(&ImpactProblem::new(h, u).map_err(said)?).map_err(said);
        let (slides, rests) = (resolve(u + slip * 1e-12)?, resolve(u)?);
        jump = worse(jump, (slides.u_plus - rests.u_plus).norm() / u.norm());
        wrong = worse(wrong, worse(violation(&h, &slides, e, mu), violation(&h, &rests, e, mu)));
    }
    Ok(Found::figure(jump).must("violation of the law's definition", wrong, SPATIAL))
}

/// Brach's law at rest: P_t = r P_n t with r = −sign(B) min(μ, |B|/A) of the direction t. With slip, t is its direction;
/// without, that of H_tn. The largest change of u⁺ between the two.
pub fn brach_jump(_: &str) -> Result<f64, String> {
    let mut jump = 0.0;
    for AtRest { h, u, slip, e, mu } in at_rest()? {
        let after = |t: Vector3<f64>| {
            let (a, b, c) = ((h * t).dot(&t), (h * t).z, h[(2, 2)]);
            let ratio = -b.signum() * mu.min(b.abs() / a);
            u + h * (t * ratio + Vector3::z()) * (-(1.0 + e) * u.z / (c + ratio * b))
        };
        let coupling = vector![h[(0, 2)], h[(1, 2)], 0.0].normalize();
        jump = worse(jump, (after(slip) - after(coupling)).norm() / u.norm());
    }
    Ok(jump)
}
