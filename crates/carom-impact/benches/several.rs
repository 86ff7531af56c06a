//! Time and residual of Moreau's law with several rough contacts: `cargo bench -p carom-impact --bench several`.
//!
//! Each row is `PROBLEMS` random problems with e = 0 and one coefficient of friction: the median and the 99th percentile
//! of the time of one call over the problems, the largest residual, and the median number of iterations. A *body* is a
//! box of which every contact touches the same floor or a ground with slopes (rank of H: 6); a *chain* has more degrees
//! of freedom than rows (H regular). A *warm* start is the solution before the velocity changed by a hundredth.

use carom_impact::{Accuracy, Constraint, SeveralProblem};
use nalgebra::{DMatrix, DVector, Vector3};
use std::hint::black_box;
use std::time::{Duration, Instant};

const PROBLEMS: usize = 100;
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-10, max_iterations: 1000 };
/// The time of a problem is that of its fastest repetition; they take this long.
const LEAST: Duration = Duration::from_millis(2);

fn wide(rng: &mut fastrand::Rng) -> f64 {
    2.0 * rng.f64() - 1.0
}

fn vector(rng: &mut fastrand::Rng, n: usize) -> DVector<f64> {
    DVector::from_fn(n, |_, _| wide(rng))
}

/// A box of 1 kg on points of its lower face; the normals are vertical but for random slopes of up to `slope`. J, and
/// the velocity: falling.
fn body(rng: &mut fastrand::Rng, contacts: usize, slope: f64) -> (DMatrix<f64>, DVector<f64>) {
    let half = Vector3::from_fn(|_, _| 0.2 + rng.f64());
    let mut j = DMatrix::zeros(3 * contacts, 6);
    for k in 0..contacts {
        let point = Vector3::new(half.x * wide(rng), half.y * wide(rng), -half.z);
        let normal = Vector3::new(slope * wide(rng), slope * wide(rng), 1.0).normalize();
        let tangent = normal.cross(&Vector3::x()).normalize();
        for (axis, direction) in [tangent, normal.cross(&tangent), normal].into_iter().enumerate() {
            j.fixed_view_mut::<1, 3>(3 * k + axis, 0).copy_from(&direction.transpose());
            j.fixed_view_mut::<1, 3>(3 * k + axis, 3).copy_from(&point.cross(&direction).transpose());
        }
    }
    // J M^-1/2 in place of J, so that H = J Jᵀ.
    let square = half.component_mul(&half);
    let inertia = (Vector3::repeat(square.sum()) - square) / 3.0;
    let mut v = vector(rng, 6);
    v[2] = -v[2].abs();
    for axis in 0..3 {
        j.column_mut(3 + axis).scale_mut(1.0 / inertia[axis].sqrt());
        v[3 + axis] *= inertia[axis].sqrt();
    }
    (j, v)
}

/// Contacts of a chain of hinges: each one moves with a random stretch of the joints.
fn chain(rng: &mut fastrand::Rng, contacts: usize) -> (DMatrix<f64>, DVector<f64>) {
    let freedoms = 3 * contacts + 6;
    let mut j = DMatrix::zeros(3 * contacts, freedoms);
    for k in 0..contacts {
        let first = rng.usize(0..freedoms - 6);
        for i in 3 * k..3 * k + 3 {
            for joint in first..freedoms {
                j[(i, joint)] = wide(rng);
            }
            // So that H is regular wherever the stretch begins.
            j[(i, i)] += 1.0;
        }
    }
    (j, vector(rng, freedoms))
}

fn row(what: &str, friction: f64, warm: bool, draw: impl Fn(&mut fastrand::Rng) -> (DMatrix<f64>, DVector<f64>)) {
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut times, mut iterations, mut worst) = (Vec::new(), Vec::new(), 0.0_f64);
    for _ in 0..PROBLEMS {
        let (j, v) = draw(&mut rng);
        let contact = Constraint::Contact { restitution: 0.0, friction };
        let problem = |v: &DVector<f64>| {
            SeveralProblem::new(&j * j.transpose(), &j * v, vec![contact; j.nrows() / 3]).expect("a valid problem")
        };
        let before = warm.then(|| problem(&v).simultaneous(&ACCURACY, None).expect("no start").impulse);
        let problem = problem(&(&v + vector(&mut rng, v.len()) * 0.01));
        let solve = || black_box(&problem).simultaneous(&ACCURACY, before.as_ref()).expect("a start of the right size");
        let found = solve();
        let (start, mut fastest) = (Instant::now(), Duration::MAX);
        while fastest == Duration::MAX || start.elapsed() < LEAST {
            let begun = Instant::now();
            black_box(solve());
            fastest = fastest.min(begun.elapsed());
        }
        times.push(fastest.as_secs_f64() * 1e6);
        iterations.push(found.iterations);
        worst = worst.max(found.residual);
    }
    times.sort_by(f64::total_cmp);
    iterations.sort_unstable();
    let (half, most) = (PROBLEMS / 2, PROBLEMS * 99 / 100);
    let start = if warm { "warm" } else { "cold" };
    println!(
        "{what:<24} {friction:>4} {start:>5} {:>11.1} {:>11.1} {worst:>10.1e} {:>10}",
        times[half], times[most], iterations[half]
    );
}

fn main() {
    println!(
        "{:<24} {:>4} {:>5} {:>11} {:>11} {:>10} {:>10}",
        "contacts", "μ", "start", "median µs", "99 % µs", "residual", "iterations"
    );
    for warm in [false, true] {
        for contacts in [4, 10, 50] {
            for friction in [0.2, 1.0] {
                row(&format!("{contacts} of a body, floor"), friction, warm, |rng| body(rng, contacts, 0.0));
                row(&format!("{contacts} of a body, slopes"), friction, warm, |rng| body(rng, contacts, 0.3));
                row(&format!("{contacts} of a chain"), friction, warm, |rng| chain(rng, contacts));
            }
        }
    }
}
