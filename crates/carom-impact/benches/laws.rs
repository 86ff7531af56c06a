//! Time per impact under each law: `cargo bench -p carom-impact`.
//!
//! `BATCH` random problems are drawn once, and each sample resolves all of them, so that branches are not predictable;
//! the items per second are impacts per second.

use carom_impact::{
    Accuracy, AnyLaw, Coefficients, Constraint, ImpactOutcome, ImpactProblem, LAW_NAMES, SeveralProblem, law_by_name,
};
use divan::{Bencher, black_box, counter::ItemsCount};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, SVector, Vector3, matrix, vector};

const BATCH: usize = 1000;
const RESTITUTION: f64 = 0.5;
const FRICTION: f64 = 0.4;

fn main() {
    divan::main();
}

fn planar() -> Vec<(Matrix2<f64>, SVector<f64, 2>)> {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut drawn = || 2.0 * rng.f64() - 1.0;
    (0..BATCH)
        .map(|_| {
            let g = Matrix2::from_fn(|_, _| drawn());
            (g * g.transpose() + Matrix2::identity() * 0.05, vector![drawn(), -1.0])
        })
        .collect()
}

fn spatial() -> Vec<(Matrix3<f64>, SVector<f64, 3>)> {
    let lift = |(h, u): (Matrix2<f64>, SVector<f64, 2>)| {
        (matrix![h[(0, 0)], 0.0, h[(0, 1)]; 0.0, 1.0, 0.0; h[(0, 1)], 0.0, h[(1, 1)]], vector![u[0], 0.0, u[1]])
    };
    planar().into_iter().map(lift).collect()
}

/// Random matrices in space: slip turns.
fn turning() -> Vec<(Matrix3<f64>, SVector<f64, 3>)> {
    let mut rng = fastrand::Rng::with_seed(2);
    let mut drawn = || 2.0 * rng.f64() - 1.0;
    (0..BATCH)
        .map(|_| {
            let g = Matrix3::from_fn(|_, _| drawn());
            (g * g.transpose() + Matrix3::identity() * 0.05, vector![drawn(), drawn(), -1.0])
        })
        .collect()
}

fn measure<const D: usize>(
    bencher: Bencher,
    drawn: Vec<(SMatrix<f64, D, D>, SVector<f64, D>)>,
    resolve: impl Fn(&ImpactProblem<f64, D>) -> ImpactOutcome<f64, D> + Sync,
) {
    let problems: Vec<_> = drawn.into_iter().map(|(h, u)| ImpactProblem::new(h, u).unwrap()).collect();
    bencher.counter(ItemsCount::new(BATCH)).bench(|| {
        for problem in &problems {
            black_box(resolve(black_box(problem)));
        }
    });
}

/// The checks of `ImpactProblem::new`, without a law.
#[divan::bench(consts = [2, 3])]
fn checks<const D: usize>(bencher: Bencher) {
    match D {
        2 => entry(bencher, planar()),
        _ => entry(bencher, spatial()),
    }
}

fn entry<const D: usize>(bencher: Bencher, drawn: Vec<(SMatrix<f64, D, D>, SVector<f64, D>)>) {
    bencher.counter(ItemsCount::new(BATCH)).bench(|| {
        for (h, u) in &drawn {
            let _ = black_box(ImpactProblem::new(*black_box(h), *u));
        }
    });
}

fn law<const D: usize>(name: &str) -> impl Fn(&ImpactProblem<f64, D>) -> ImpactOutcome<f64, D> + Sync {
    let coefficients = Coefficients { restitution: RESTITUTION, friction: FRICTION, ..Coefficients::default() };
    let law = law_by_name::<D>(name, coefficients).unwrap();
    move |problem| law.resolve(problem).unwrap()
}

#[divan::bench(args = LAW_NAMES)]
fn in_the_plane(bencher: Bencher, name: &str) {
    measure(bencher, planar(), law(name));
}

/// Planar problems in space.
#[divan::bench(args = LAW_NAMES)]
fn in_space_slip_keeps_to_a_plane(bencher: Bencher, name: &str) {
    measure(bencher, spatial(), law(name));
}

#[divan::bench(args = LAW_NAMES)]
fn in_space_slip_turns(bencher: Bencher, name: &str) {
    measure(bencher, turning(), law(name));
}

/// Outcomes with their derivatives with respect to H, u⁻, e and μ.
fn differentiate<const D: usize>(bencher: Bencher, drawn: Vec<(SMatrix<f64, D, D>, SVector<f64, D>)>, name: &str) {
    let coefficients = Coefficients { restitution: RESTITUTION, friction: FRICTION, ..Coefficients::default() };
    let law = AnyLaw::named(name, coefficients).unwrap();
    measure(bencher, drawn, |problem| problem.differentiate(&law).unwrap().outcome);
}

#[divan::bench(args = LAW_NAMES)]
fn derivatives_in_the_plane(bencher: Bencher, name: &str) {
    differentiate(bencher, planar(), name);
}

#[divan::bench(args = LAW_NAMES)]
fn derivatives_in_space_slip_keeps_to_a_plane(bencher: Bencher, name: &str) {
    differentiate(bencher, spatial(), name);
}

#[divan::bench(args = LAW_NAMES, sample_count = 5)]
fn derivatives_in_space_slip_turns(bencher: Bencher, name: &str) {
    differentiate(bencher, turning(), name);
}

/// A body with six degrees of freedom and this number of contacts with friction strikes the floor at an angle.
#[divan::bench(args = [2, 4, 10, 50])]
fn several_contacts(bencher: Bencher, count: usize) {
    let mut j = DMatrix::zeros(3 * count, 6);
    for k in 0..count {
        let (x, y) = ((k % 5) as f64 - 2.0, (k / 5) as f64 - (count / 5) as f64 / 2.0);
        for axis in 0..3 {
            let direction = Vector3::ith(axis, 1.0);
            j.fixed_view_mut::<1, 3>(3 * k + axis, 0).copy_from(&direction.transpose());
            j.fixed_view_mut::<1, 3>(3 * k + axis, 3).copy_from(&vector![x, y, -0.2].cross(&direction).transpose());
        }
    }
    let weights = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0, 1.0, 0.12, 0.5, 0.1]));
    let u = &j * DVector::from_vec(vec![0.4, -0.2, -1.0, 0.05, -0.08, 0.1]);
    let contact = Constraint::Contact { restitution: 0.0, friction: FRICTION };
    let problem = SeveralProblem::new(&j * weights * j.transpose(), u, vec![contact; count]).unwrap();
    bencher.bench(|| black_box(&problem).simultaneous(&Accuracy::default(), None).unwrap());
}

/// A cube at rest on its four lower corners, one time step of 1 ms: twelve rows, six degrees of freedom; without and
/// with a warm start.
#[divan::bench(args = [false, true])]
fn box_on_four_corners(bencher: Bencher, warm: bool) {
    let mut j = DMatrix::zeros(12, 6);
    for (k, (x, y)) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].into_iter().enumerate() {
        for axis in 0..3 {
            let direction = Vector3::ith(axis, 1.0);
            j.fixed_view_mut::<1, 3>(3 * k + axis, 0).copy_from(&direction.transpose());
            j.fixed_view_mut::<1, 3>(3 * k + axis, 3).copy_from(&vector![x, y, -0.5].cross(&direction).transpose());
        }
    }
    let inverse_mass = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0, 1.0, 6.0, 6.0, 6.0]));
    let falls = DVector::from_vec(vec![1e-3, 0.0, -9.81e-3, 0.0, 0.0, 0.0]);
    let corner = Constraint::Contact { restitution: RESTITUTION, friction: FRICTION };
    let problem = SeveralProblem::new(&j * inverse_mass * j.transpose(), DVector::zeros(12), vec![corner; 4])
        .unwrap()
        .with_free_velocity(j * falls)
        .unwrap();
    let accuracy = Accuracy::default();
    let guess = warm.then(|| problem.simultaneous(&accuracy, None).unwrap().impulse);
    bencher.bench(|| black_box(&problem).simultaneous(&accuracy, guess.as_ref()).unwrap());
}
