//! What one impact costs under each law: `cargo bench -p carom-impact`.
//!
//! Problems are drawn once, and each sample resolves all of them, so that branches are taken as
//! they come; divide by `BATCH` or read the items per second.

use carom_impact::{
    Accuracy, Brach, ChatterjeeRuina, Constraint, Energetic, Frictionless, ImpactOutcome, ImpactProblem, Law, Newton,
    Poisson, SeveralProblem, Smith, Whittaker,
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

/// Any matrix: slip turns.
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

/// The checks on entry, without a law.
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

#[divan::bench]
fn frictionless_2(bencher: Bencher) {
    let law = Frictionless { restitution: RESTITUTION };
    measure(bencher, planar(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn frictionless_3(bencher: Bencher) {
    let law = Frictionless { restitution: RESTITUTION };
    measure(bencher, spatial(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn whittaker_2(bencher: Bencher) {
    let law = Whittaker { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, planar(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn newton_2(bencher: Bencher) {
    let law = Newton { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, planar(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn poisson_2(bencher: Bencher) {
    let law = Poisson { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, planar(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn energetic_2(bencher: Bencher) {
    let law = Energetic { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, planar(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn energetic_3_in_plane(bencher: Bencher) {
    let law = Energetic { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, spatial(), |problem| law.resolve(problem).unwrap());
}

/// A cube at rest on its four lower corners, one time step of 1 ms: twelve rows on six freedoms; cold and warm.
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

#[divan::bench]
fn whittaker_3(bencher: Bencher) {
    let law = Whittaker { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn newton_3(bencher: Bencher) {
    let law = Newton { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn poisson_3(bencher: Bencher) {
    let law = Poisson { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn energetic_3(bencher: Bencher) {
    let law = Energetic { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn chatterjee_ruina_3(bencher: Bencher) {
    let law = ChatterjeeRuina { restitution: RESTITUTION, tangential_restitution: 0.0, friction: FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn brach_3(bencher: Bencher) {
    let law = Brach { restitution: RESTITUTION, impulse_ratio: -FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}

#[divan::bench]
fn smith_3(bencher: Bencher) {
    let law = Smith { restitution: RESTITUTION, friction: FRICTION };
    measure(bencher, turning(), |problem| law.resolve(problem).unwrap());
}
