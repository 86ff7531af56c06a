//! Shared by the tests: random problems, and comparisons whose messages contain the numbers.

use carom_impact::{
    Accuracy, AnyLaw, Coefficients, Constraint, ImpactError, ImpactOutcome, ImpactProblem, Law, SeveralOutcome,
    SeveralProblem,
};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Rotation3, SMatrix, SVector, Vector2, Vector3, matrix};

/// The laws that follow the slip.
pub const FOLLOWING: [&str; 3] = ["newton", "poisson", "energetic"];

/// The Delassus matrix of a contact in space whose slip turns.
pub const TURNING: Matrix3<f64> = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];

/// Rounding of numbers of size one.
pub const EXACT: f64 = 1e-12;

/// One impact with its coefficients.
#[derive(Debug, Clone, Copy)]
pub struct Case<const D: usize> {
    pub delassus: SMatrix<f64, D, D>,
    pub u: SVector<f64, D>,
    pub restitution: f64,
    pub friction: f64,
}

impl<const D: usize> Case<D> {
    pub fn problem(&self) -> ImpactProblem<f64, D> {
        ImpactProblem::new(self.delassus, self.u).unwrap()
    }

    pub fn coefficients(&self) -> Coefficients {
        rough(self.restitution, self.friction)
    }

    pub fn law(&self, name: &str) -> AnyLaw {
        AnyLaw::named(name, self.coefficients()).unwrap()
    }

    pub fn resolved(&self, law: &str) -> Result<ImpactOutcome<f64, D>, ImpactError> {
        self.law(law).resolve(&self.problem())
    }

    #[track_caller]
    pub fn resolve(&self, law: &str) -> ImpactOutcome<f64, D> {
        self.resolved(law).unwrap_or_else(|why| panic!("{law} {self:?}: {why}"))
    }
}

/// The outcome of a law, by its name.
#[track_caller]
pub fn resolve<const D: usize>(
    law: &str,
    delassus: SMatrix<f64, D, D>,
    u: SVector<f64, D>,
    [restitution, friction]: [f64; 2],
) -> ImpactOutcome<f64, D> {
    Case { delassus, u, restitution, friction }.resolve(law)
}

/// A random planar impact: `H = G Gᵀ` with condition number up to about `1/flat²`, a speed of 1 in any approaching
/// direction, e in [0, 1] with both ends drawn, friction from 0 to beyond any jam.
pub fn any_case(rng: &mut fastrand::Rng, flat: f64) -> Case<2> {
    let (turn, length) = (std::f64::consts::TAU * rng.f64(), flat + (1.0 - flat) * rng.f64());
    let axes = Matrix2::new(turn.cos(), -turn.sin(), turn.sin(), turn.cos());
    let delassus = axes * Matrix2::new(1.0, 0.0, 0.0, length * length) * axes.transpose();
    let angle = std::f64::consts::PI * rng.f64();
    let restitution = match rng.u8(0..10) {
        0 => 0.0,
        1 => 1.0,
        _ => rng.f64(),
    };
    let friction = match rng.u8(0..4) {
        0 => 0.0_f64.max(wide(rng)),
        1 => 10.0_f64.powf(3.0 * wide(rng)),
        _ => 2.0 * rng.f64(),
    };
    Case { delassus, u: Vector2::new(angle.cos(), -angle.sin()), restitution, friction }
}

/// A random impact in space, as [`any_case`]: axes turned at random, square roots of the eigenvalues from `flat` to 1.
pub fn any_spatial(rng: &mut fastrand::Rng, flat: f64) -> Case<3> {
    let Case { restitution, friction, .. } = any_case(rng, flat);
    let mut turn = || std::f64::consts::TAU * rng.f64();
    let axes = Rotation3::from_euler_angles(turn(), turn(), turn());
    let mut length = || flat + (1.0 - flat) * rng.f64();
    let lengths = Vector3::new(1.0, length(), length());
    let delassus = axes * Matrix3::from_diagonal(&lengths.component_mul(&lengths)) * axes.inverse();
    let delassus = (delassus + delassus.transpose()) * 0.5;
    // Uniform on the half sphere.
    let (height, angle) = (rng.f64(), std::f64::consts::TAU * rng.f64());
    let flat = (1.0 - height * height).sqrt();
    Case { delassus, u: Vector3::new(flat * angle.cos(), flat * angle.sin(), -height), restitution, friction }
}

/// Uniform from -1 to 1.
pub fn wide(rng: &mut fastrand::Rng) -> f64 {
    2.0 * rng.f64() - 1.0
}

/// Asserts `|x - expected| <= within`, with the numbers in the message.
#[track_caller]
pub fn close(what: &str, x: f64, expected: f64, within: f64) {
    assert!((x - expected).abs() <= within, "{what}: {x:e} instead of {expected:e}, off by {:e}", x - expected);
}

/// Asserts that each number is within `within` of the expected one.
#[track_caller]
pub fn all_close<'a>(
    what: &str,
    found: impl IntoIterator<Item = &'a f64>,
    expected: impl IntoIterator<Item = f64>,
    within: f64,
) {
    let (found, expected): (Vec<_>, Vec<_>) = (found.into_iter().copied().collect(), expected.into_iter().collect());
    let near = found.iter().zip(&expected).all(|(x, y)| (x - y).abs() <= within);
    assert!(near && found.len() == expected.len(), "{what}: {found:?} instead of {expected:?}");
}

/// Coefficients of restitution and friction.
pub fn rough(restitution: f64, friction: f64) -> Coefficients {
    Coefficients { restitution, friction, ..Coefficients::default() }
}

/// Kane and Levinson's double pendulum (`kane_levinson.rs`).
pub fn pendulum() -> ImpactProblem<f64, 2> {
    let (a, b, coupling) = (20.0_f64.to_radians(), 30.0_f64.to_radians(), 0.5 * 10.0_f64.to_radians().cos());
    let m = matrix![4.0 / 3.0, coupling; coupling, 1.0 / 3.0];
    let j: Matrix2<f64> = matrix![a.cos(), b.cos(); a.sin(), b.sin()];
    ImpactProblem::new(j * m.try_inverse().unwrap() * j.transpose(), j * Vector2::new(-0.1, -0.2)).unwrap()
}

/// A law of a user.
pub struct Foreign;

impl Law<f64, 2> for Foreign {
    fn name(&self) -> &'static str {
        "foreign"
    }
    fn resolve(&self, problem: &ImpactProblem<f64, 2>) -> Result<ImpactOutcome<f64, 2>, ImpactError> {
        AnyLaw::named("energetic", rough(0.5, 0.5)).unwrap().resolve(problem)
    }
}

pub fn contact(restitution: f64, friction: f64) -> Constraint {
    Constraint::Contact { restitution, friction }
}

pub fn stop(restitution: f64) -> Constraint {
    Constraint::Stop { restitution }
}

pub fn problem(h: DMatrix<f64>, u: DVector<f64>, constraints: Vec<Constraint>) -> SeveralProblem {
    SeveralProblem::new(h, u, constraints).unwrap()
}

/// Moreau's law.
pub fn moreau(problem: &SeveralProblem) -> SeveralOutcome {
    problem.simultaneous(&Accuracy::default(), None).unwrap()
}

/// The outcome of Moreau's law for a problem.
pub fn solve(h: DMatrix<f64>, u: DVector<f64>, constraints: Vec<Constraint>) -> SeveralOutcome {
    moreau(&problem(h, u, constraints))
}

/// A random motion of a random mechanism, `J Jᵀ` and `J v`.
pub fn gram(rng: &mut fastrand::Rng, rows: usize, freedoms: usize) -> (DMatrix<f64>, DVector<f64>) {
    let j = DMatrix::from_fn(rows, freedoms, |_, _| wide(rng));
    let v = DVector::from_fn(freedoms, |_, _| wide(rng));
    (&j * j.transpose(), &j * v)
}

/// [`gram`] with the rows of these constraints and this many freedoms more.
pub fn any_motion(rng: &mut fastrand::Rng, constraints: Vec<Constraint>, freedoms: usize) -> SeveralProblem {
    let rows: usize = constraints.iter().map(Constraint::rows).sum();
    let (h, u) = gram(rng, rows, rows + freedoms);
    problem(h, u, constraints)
}

/// Newton's cradle: H and u⁻ of the contacts of balls of 1 kg in a row, of which the first has 1 m/s.
pub fn row_of_balls(contacts: usize) -> (DMatrix<f64>, DVector<f64>) {
    let h = DMatrix::from_fn(contacts, contacts, |i, j| [2.0, -1.0, 0.0][i.abs_diff(j).min(2)]);
    (h, DVector::from_fn(contacts, |i, _| if i == 0 { -1.0 } else { 0.0 }))
}

/// Velocities of the balls of [`row_of_balls`] after the impact.
pub fn balls(impulse: &DVector<f64>) -> Vec<f64> {
    let p = |i: usize| impulse.get(i).copied().unwrap_or(0.0);
    (0..=impulse.len()).map(|i| if i == 0 { 1.0 - p(0) } else { p(i - 1) - p(i) }).collect()
}

/// A rod of unit mass that falls flat on both its ends at this speed.
pub fn flat_rod(e: f64, speed: f64) -> SeveralProblem {
    problem(DMatrix::from_row_slice(2, 2, &[4.0, -2.0, -2.0, 4.0]), DVector::from_element(2, -speed), vec![stop(e); 2])
}
