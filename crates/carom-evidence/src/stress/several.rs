//! Several contacts at one time, given by their Delassus matrix and velocities.

use super::method::{COMPLIANT, Found, GLOCKER_PFEIFFER, Judged, LIU_ZHAO_BROGLIATO, MOREAU, runge_kutta, said};
use super::single::worse;
use carom_impact::{
    Accuracy, Constraint, HuntCrossley, NormalForce, Order, SeveralProblem, Stiffnesses, TangentialForce,
    compliant_impact,
};
use nalgebra::{DMatrix, DVector, Vector2, dmatrix, dvector};
use std::ops::Range;

/// What the three laws have in common.
struct Answer {
    impulse: DVector<f64>,
    u_plus: DVector<f64>,
    /// Impulses of compression and expansion, under Glocker & Pfeiffer's law.
    phases: Option<[DVector<f64>; 2]>,
    /// Whether the method says that it solved the problem.
    solved: bool,
    energy_change: f64,
    sub_impacts: usize,
}

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-12, max_iterations: 5_000 };
/// A residual above this, relative to the largest velocity, is no solution.
const UNSOLVED: f64 = 1e-10;
/// Largest error of a solution in the scenes' own measures: some times the tolerance at which the iteration stops.
pub const SOLVED: f64 = 1e-10;

fn resolve(method: &str, problem: &SeveralProblem) -> Result<Answer, String> {
    let answer = |hit: carom_impact::SeveralOutcome, phases| Answer {
        impulse: hit.impulse,
        u_plus: hit.u_plus,
        phases,
        solved: hit.residual <= UNSOLVED,
        energy_change: hit.energy_change,
        sub_impacts: 0,
    };
    Ok(match method {
        MOREAU => answer(problem.simultaneous(&ACCURACY, None).map_err(said)?, None),
        GLOCKER_PFEIFFER => {
            let hit = problem.poisson(&ACCURACY);
            answer(hit.total, Some([hit.compression, hit.expansion]))
        }
        _ => {
            let hit = problem.sequential(&Order::MostApproaching, &ACCURACY).map_err(said)?;
            Answer { solved: hit.is_solved(&ACCURACY), sub_impacts: hit.iterations, ..answer(hit, None) }
        }
    })
}

fn problem(h: DMatrix<f64>, u: DVector<f64>, constraints: Vec<Constraint>) -> Result<SeveralProblem, String> {
    SeveralProblem::new(h, u, constraints).map_err(said)
}

/// The constraints of a problem, each with its rows; the last one of them is the normal.
fn blocks(problem: &SeveralProblem) -> impl Iterator<Item = (Range<usize>, &Constraint)> {
    let mut next = 0;
    problem.constraints().iter().map(move |constraint| {
        let first = next;
        next += constraint.rows();
        (first..next, constraint)
    })
}

fn coefficients(constraint: &Constraint) -> (f64, f64) {
    match *constraint {
        Constraint::Contact { restitution, friction } => (restitution, friction),
        Constraint::Stop { restitution } => (restitution, 0.0),
        Constraint::Dry { .. } | Constraint::Held => (0.0, 0.0),
    }
}

/// By how much impulses violate Moreau's law with the normal targets −e u_n⁻ of `e`, relative to the largest velocity `speed`:
/// 0 ≤ p_n − floor ⟂ u_n⁺ + e min(u_n⁻, 0) ≥ 0, |p_t| ≤ μ p_n, and p_t = −μ p_n u_t⁺/|u_t⁺| where there is slip.
fn law_violation(
    problem: &SeveralProblem,
    (impulse, floor): (&DVector<f64>, &DVector<f64>),
    (before, after): (&DVector<f64>, &DVector<f64>),
    e_of: impl Fn(f64) -> f64,
    speed: f64,
) -> f64 {
    let mut worst = 0.0;
    for (rows, constraint) in blocks(problem) {
        let (row, n) = (rows.start, rows.end - 1);
        let (e, mu) = coefficients(constraint);
        let h = problem.delassus()[(n, n)];
        let target = after[n] + e_of(e) * before[n].min(0.0);
        worst = worse(worst, (h * (impulse[n] - floor[n])).min(target).abs() / speed);
        if rows.len() == 3 {
            let (p, u) = (impulse.fixed_rows::<2>(row).into_owned(), after.fixed_rows::<2>(row).into_owned());
            let outside = (p.norm() - mu * impulse[n]).max(0.0) * h / speed;
            let against = (p * u.norm() + u * (mu * impulse[n])).norm() * h / (speed * speed);
            worst = worse(worst, worse(outside, against));
        }
    }
    worst
}

/// The definition of a law on an answer: see [`law_violation`]. Glocker & Pfeiffer's has it twice: with e = 0 in compression, and
/// in expansion with e λ_c as the least impulse. Of a sequence, what is true after any number of sub-impacts.
fn violation(method: &str, problem: &SeveralProblem, hit: &Answer) -> f64 {
    let (h, u) = (problem.delassus(), problem.u_minus());
    let speed = u.amax();
    let moved = (u + h * &hit.impulse - &hit.u_plus).amax() / speed;
    let balance = (0.5 * hit.impulse.dot(&(u + &hit.u_plus)) - hit.energy_change).abs()
        / (speed * hit.impulse.amax()).max(f64::MIN_POSITIVE);
    let none = DVector::zeros(u.len());
    let law = match (&hit.phases, method) {
        (Some([compression, expansion]), _) => {
            let between = u + h * compression;
            let mut floor = none.clone();
            for (rows, constraint) in blocks(problem) {
                let n = rows.end - 1;
                floor[n] = coefficients(constraint).0 * compression[n];
            }
            let first = law_violation(problem, (compression, &none), (u, &between), |_| 0.0, speed);
            let second = law_violation(problem, (expansion, &floor), (&between, &hit.u_plus), |_| 0.0, speed);
            let sum = (compression + expansion - &hit.impulse).amax() / hit.impulse.amax().max(f64::MIN_POSITIVE);
            [first, second, sum].into_iter().fold(0.0, worse)
        }
        (None, MOREAU) => law_violation(problem, (&hit.impulse, &none), (u, &hit.u_plus), |e| e, speed),
        (None, _) => {
            let mut worst = 0.0;
            for (rows, constraint) in blocks(problem) {
                let n = rows.end - 1;
                let (_, mu) = coefficients(constraint);
                let tangential = hit.impulse.rows(rows.start, rows.len() - 1).norm();
                worst = worse(worst, (-hit.u_plus[n]).max(0.0) / speed);
                worst = worse(worst, (tangential - mu * hit.impulse[n]).max(0.0) * h[(n, n)] / speed);
                // One sub-impact is the law of one contact.
                if hit.sub_impacts == 1 && hit.impulse[n] > 0.0 {
                    worst = worse(worst, one_contact(problem, hit, rows, *constraint));
                }
            }
            worst
        }
    };
    [moved, balance, law].into_iter().fold(0.0, worse)
}

/// Moreau's law for the only contact that has an impulse.
fn one_contact(problem: &SeveralProblem, hit: &Answer, rows: Range<usize>, constraint: Constraint) -> f64 {
    let part = |v: &DVector<f64>| v.rows(rows.start, rows.len()).into_owned();
    let h = problem.delassus().view((rows.start, rows.start), (rows.len(), rows.len())).into_owned();
    let Ok(one) = SeveralProblem::new(h, part(problem.u_minus()), vec![constraint]) else { return f64::NAN };
    let none = DVector::zeros(rows.len());
    let speed = problem.u_minus().amax();
    law_violation(&one, (&part(&hit.impulse), &none), (one.u_minus(), &part(&hit.u_plus)), |e| e, speed)
}

/// Newton's law for one stop after another, the one that approaches fastest, the first of equals; `None` if it does not end.
fn sequence(h: &DMatrix<f64>, u: &DVector<f64>, e: &[f64]) -> Option<DVector<f64>> {
    let (mut u, enough) = (u.clone(), ACCURACY.tolerance * u.amax());
    for _ in 0..=ACCURACY.max_iterations {
        let mut next = 0;
        for k in 1..u.len() {
            if u[k] < u[next] {
                next = k;
            }
        }
        if u[next] >= -enough {
            return Some(u);
        }
        let impulse = -(1.0 + e[next]) * u[next] / h[(next, next)];
        u += h.column(next) * impulse;
    }
    None
}

/// Moreau's law for stops by trying every set of contacts that push: the velocities and the energy change, `None` if no set is
/// admissible. Where H is singular a set whose own H is regular is enough.
fn enumerated(h: &DMatrix<f64>, u: &DVector<f64>, e: &[f64]) -> Option<(DVector<f64>, f64)> {
    let speed = u.amax();
    for set in 0..1_u32 << u.len() {
        let pushing: Vec<usize> = (0..u.len()).filter(|k| set >> k & 1 == 1).collect();
        let own = h.select_rows(&pushing).select_columns(&pushing);
        let wanted = DVector::from_iterator(pushing.len(), pushing.iter().map(|&k| -e[k] * u[k].min(0.0) - u[k]));
        let part = if set == 0 { Some(wanted.clone()) } else { own.clone().lu().solve(&wanted) };
        let Some(part) = part else { continue };
        // An inverse without digits is that of a singular matrix.
        let error = (own * &part - &wanted).iter().fold(0.0, |most, error| worse(most, error.abs()));
        if error.is_nan() || error > 1e-9 * speed || part.iter().any(|p| *p < 0.0) {
            continue;
        }
        let mut p = DVector::zeros(u.len());
        pushing.iter().zip(part.iter()).for_each(|(&k, part)| p[k] = *part);
        let after = u + h * &p;
        if (0..u.len()).all(|k| after[k] + e[k] * u[k].min(0.0) >= -1e-9 * speed) {
            let change = 0.5 * p.dot(&(u + &after));
            return Some((after, change));
        }
    }
    None
}

const FLAT: [f64; 2] = [0.40625, 0.265625];

/// Struck one after another with e = 0.5, the left end first, the ends' velocities are (0.5, −1.75), (−0.8125, 0.875),
/// (0.40625, 0.265625) m/s; the right end first gives the mirror image.
pub fn rod(method: &str) -> Judged {
    let ends = vec![Constraint::Stop { restitution: 0.5 }; 2];
    let rod = problem(dmatrix![4.0, -2.0; -2.0, 4.0], dvector![-1.0, -1.0], ends)?;
    if method == LIU_ZHAO_BROGLIATO {
        let hit = rod.energetic(&Stiffnesses::default(), &ACCURACY).map_err(said)?.total;
        return Ok(Found::figure((hit.u_plus - dvector![0.5, 0.5]).amax()).must("residual", hit.residual, SOLVED));
    }
    let hit = resolve(method, &rod)?;
    let found = Found::figure((&hit.u_plus - dvector![0.5, 0.5]).amax()).must(
        "violation of the law's definition",
        violation(method, &rod, &hit),
        SOLVED,
    );
    if matches!(method, MOREAU | GLOCKER_PFEIFFER) {
        return Ok(found);
    }
    let orders = rod.all_orders(24, &ACCURACY);
    let apart = (FLAT[0] - FLAT[1]) * 2.0_f64.sqrt();
    Ok(found
        .must("error of u⁺", (hit.u_plus - DVector::from_column_slice(&FLAT)).amax(), super::method::EXACT)
        .must("error of the distance of the two outcomes", (orders.spread - apart).abs(), super::method::EXACT)
        .must_be("two outcomes over the orders", orders.outcomes.len() == 2))
}

/// Of the sequence from the rebound as flat.
pub fn rod_error(_: &str) -> Result<f64, String> {
    Ok(0.5 - FLAT[1])
}

/// A rod in the plane on three points: H and the velocities.
fn three_points() -> (DMatrix<f64>, DVector<f64>) {
    let rows = DMatrix::from_fn(3, 2, |i, j| if j == 0 { 1.0 } else { [-0.5, 0.0, 0.5][i] });
    let response = DMatrix::from_diagonal(&dvector![1.0, 12.0]);
    (&rows * response * rows.transpose(), &rows * dvector![-1.0, 0.6])
}

/// All points rebound with e times their approach: that is a motion of the rod, and the only solution.
pub fn redundant(method: &str) -> Judged {
    let (h, u) = three_points();
    let rod = problem(h, u.clone(), vec![Constraint::Stop { restitution: 0.5 }; 3])?;
    let hit = resolve(method, &rod)?;
    let found = Found::figure((&hit.u_plus + &u * 0.5).amax() / u.amax());
    if matches!(method, MOREAU | GLOCKER_PFEIFFER) {
        return Ok(found);
    }
    Ok(found.must_be("several outcomes over the orders", rod.all_orders(24, &ACCURACY).outcomes.len() > 1))
}

pub fn redundant_error(_: &str) -> Result<f64, String> {
    let (h, u) = three_points();
    let after = sequence(&h, &u, &[0.5; 3]).ok_or("the sequence does not end")?;
    Ok((after + &u * 0.5).amax() / u.amax())
}

/// Random problems with `rows` rows per constraint; `constraint` makes one.
fn random(
    count: usize,
    rows: usize,
    constraint: impl Fn(&mut fastrand::Rng, f64) -> Constraint,
) -> Result<Vec<SeveralProblem>, String> {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut one = || {
        let contacts = rng.usize(2..=4);
        let (m, freedoms) = (contacts * rows, rng.usize(2..=8));
        let mut number = || 2.0 * rng.f64() - 1.0;
        let j = DMatrix::from_fn(m, freedoms, |_, _| number());
        let v = DVector::from_fn(freedoms, |_, _| number());
        let common = rng.f64();
        let constraints = (0..contacts).map(|_| constraint(&mut rng, common)).collect();
        // Velocities that some motion has; not all of the contacts approach.
        problem(&j * j.transpose(), &j * v, constraints)
    };
    (0..count).map(|_| one()).collect()
}

fn smooth_problems() -> Result<Vec<SeveralProblem>, String> {
    random(2000, 1, |rng, _| Constraint::Stop { restitution: rng.f64() })
}

/// Energy gained beyond rounding, beside the energy of velocities u.
fn gains(change: f64, u: &DVector<f64>) -> bool {
    change > 1e-9 * u.norm_squared()
}

pub fn different_restitutions(method: &str) -> Judged {
    let (mut wrong, mut other) = (0.0, 0.0);
    let (mut gaining, mut unsolved, mut missed) = (0_usize, 0_usize, 0_usize);
    let problems = smooth_problems()?;
    for problem in &problems {
        let hit = resolve(method, problem)?;
        let u = problem.u_minus();
        let e: Vec<f64> = problem.constraints().iter().map(|one| coefficients(one).0).collect();
        let expected = match method {
            MOREAU => enumerated(problem.delassus(), u, &e).map(|(after, _)| after),
            GLOCKER_PFEIFFER => Some(hit.u_plus.clone()),
            _ => sequence(problem.delassus(), u, &e),
        };
        unsolved += usize::from(!hit.solved);
        // What the method solved must be the solution, and what it did not solve must have none.
        missed += usize::from(hit.solved != expected.is_some());
        if let (true, Some(expected)) = (hit.solved, expected) {
            other = worse(other, (&hit.u_plus - expected).amax() / u.amax());
            wrong = worse(wrong, violation(method, problem, &hit));
            gaining += usize::from(gains(hit.energy_change, u));
        }
    }
    let count = problems.len() as f64;
    let found = match method {
        MOREAU => Found::figure(gaining as f64 / count),
        GLOCKER_PFEIFFER => Found::figure(wrong).must("impacts that gain energy", gaining as f64, 0.0),
        _ => Found::figure(unsolved as f64 / count).must("impacts that gain energy", gaining as f64, 0.0),
    };
    Ok(found
        .must("problems with a solution that is not found, or found where there is none", missed as f64, 0.0)
        .must("violation of the law's definition", wrong, SOLVED)
        .must("difference from an independent solution", other, 1e-8))
}

/// Of Moreau's law the share of the problems whose solution, found by enumeration, gains energy; of a sequence the share that does
/// not end within 2000 sub-impacts.
pub fn different_restitutions_share(method: &str) -> Result<f64, String> {
    let problems = smooth_problems()?;
    let counts = |problem: &&SeveralProblem| {
        let e: Vec<f64> = problem.constraints().iter().map(|one| coefficients(one).0).collect();
        let (h, u) = (problem.delassus(), problem.u_minus());
        match method {
            MOREAU => enumerated(h, u, &e).is_some_and(|(_, change)| gains(change, u)),
            _ => sequence(h, u, &e).is_none(),
        }
    };
    Ok(problems.iter().filter(counts).count() as f64 / problems.len() as f64)
}

pub fn rough(method: &str) -> Judged {
    let common = |rng: &mut fastrand::Rng, restitution: f64| Constraint::Contact { restitution, friction: rng.f64() };
    let problems = random(100, 3, common)?;
    let (mut wrong, mut gaining, mut unsolved, mut regular) = (0.0, 0_usize, 0_usize, 0_usize);
    for problem in &problems {
        let hit = resolve(method, problem)?;
        unsolved += usize::from(!hit.solved);
        regular += usize::from(!hit.solved && problem.delassus().clone().cholesky().is_some());
        if hit.solved {
            wrong = worse(wrong, violation(method, problem, &hit));
            gaining += usize::from(gains(hit.energy_change, problem.u_minus()));
        }
    }
    let count = problems.len() as f64;
    // Where H is singular, as in most of these problems, friction may wedge what Moreau's restitution drives apart: no answer.
    let most = if method == MOREAU { 0.3 } else { 0.0 };
    let found = if method == GLOCKER_PFEIFFER {
        Found::figure(wrong).must("impacts that gain energy", gaining as f64, 0.0)
    } else {
        Found::figure(gaining as f64 / count).must("violation of the law's definition", wrong, SOLVED)
    };
    Ok(found.must("share of problems not solved", unsolved as f64 / count, most).must(
        "problems with regular H not solved",
        regular as f64,
        0.0,
    ))
}

/// Points of a rigid raft, 5 by 10, with friction: 150 rows, 6 freedoms.
pub fn raft(method: &str) -> Judged {
    let points: Vec<[f64; 2]> = (0..50).map(|k| [f64::from(k % 5) - 2.0, f64::from(k / 5) - 4.5]).collect();
    let mut rows = DMatrix::zeros(150, 6);
    for (k, [x, y]) in points.into_iter().enumerate() {
        // v + ω × r, r = (x, y, −0.2): tangents, then the normal.
        let r = nalgebra::Vector3::new(x, y, -0.2);
        for axis in 0..3 {
            let n = nalgebra::Vector3::ith(axis, 1.0);
            rows.fixed_view_mut::<1, 3>(3 * k + axis, 0).copy_from(&n.transpose());
            rows.fixed_view_mut::<1, 3>(3 * k + axis, 3).copy_from(&r.cross(&n).transpose());
        }
    }
    let weights = DMatrix::from_diagonal(&dvector![1.0, 1.0, 1.0, 0.12, 0.5, 0.1]);
    let u = &rows * dvector![0.4, -0.2, -1.0, 0.05, -0.08, 0.1];
    let contacts = vec![Constraint::Contact { restitution: 0.0, friction: 0.3 }; 50];
    let raft = problem(&rows * weights * rows.transpose(), u, contacts)?;
    let hit = resolve(method, &raft)?;
    let found = Found::figure(violation(method, &raft, &hit)).must_be("solved", hit.solved);
    Ok(found.must_be("energy lost", hit.energy_change < 0.0))
}

/// v⁺ is the nearest to v⁻ of all velocities that part from both walls: along the wall uphill of the motion.
pub fn groove(method: &str) -> Judged {
    let mut error = 0.0;
    for k in 1..=8 {
        let (s, c) = 10_f64.powi(-k).sin_cos();
        let rows = dmatrix![s, c; -s, c];
        let v = dvector![0.3, -1.0];
        let walls = vec![Constraint::Stop { restitution: 0.0 }; 2];
        let groove = problem(&rows * rows.transpose(), &rows * v, walls)?;
        let hit = resolve(method, &groove)?;
        // From the two gap rates back to the velocity: v = (u₁ − u₂)/2s, (u₁ + u₂)/2c.
        let up = Vector2::new(c, s);
        let along = (0.3 * c - s).max(0.0);
        let expected = &rows * dvector![up.x * along, up.y * along];
        error = worse(error, (hit.u_plus - expected).amax());
    }
    Ok(Found::figure(error))
}

/// Three balls of 1 kg, the first with 1 m/s, elastic contacts after Hertz (F = k d^1.5), the first `ratio` times as stiff as the
/// second: the velocities after, by the classical fourth-order method of Runge and Kutta.
fn elastic_cradle(ratio: f64) -> [f64; 3] {
    let force = |x: f64| x.max(0.0).powf(1.5);
    let rate = |y: [f64; 6]| {
        let (first, second) = (ratio * force(y[0] - y[1]), force(y[1] - y[2]));
        [y[3], y[4], y[5], -first, first - second, second]
    };
    let step = 5e-4;
    let mut y = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    loop {
        y = runge_kutta(y, step, rate);
        if y[0] < y[1] && y[1] < y[2] && y[3] <= y[4] && y[4] <= y[5] {
            return [y[3], y[4], y[5]];
        }
    }
}

/// Of the stiffness of the first contact to that of the second.
const RATIOS: [f64; 3] = [1.0, 10.0, 0.1];

fn farthest(from: impl Fn(f64) -> Result<[f64; 3], String>) -> Result<f64, String> {
    RATIOS.into_iter().try_fold(0.0, |most, ratio| {
        let (one, elastic) = (from(ratio)?, elastic_cradle(ratio));
        Ok(one.into_iter().zip(elastic).fold(most, |most, (one, elastic)| worse(most, (one - elastic).abs())))
    })
}

/// What a rigid law makes of three equal balls with e = 1: all contacts at once, or one after another.
fn rigid_cradle(method: &str) -> [f64; 3] {
    if matches!(method, MOREAU | GLOCKER_PFEIFFER) { [-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0] } else { [0.0, 0.0, 1.0] }
}

pub fn cradle_error(method: &str) -> Result<f64, String> {
    farthest(|_| Ok(rigid_cradle(method)))
}

/// A rigid law does not depend on the stiffnesses, of which the outcome depends.
pub fn cradle(method: &str) -> Judged {
    if method == COMPLIANT {
        let elastic = |ratio: f64| {
            let hertz = |stiffness| HuntCrossley::new(stiffness, 1.5, 1.0).map(NormalForce::HuntCrossley);
            let contacts = [ratio, 1.0].map(|k| hertz(1e9 * k).map(|force| (force, TangentialForce::Frictionless)));
            let contacts = contacts.into_iter().collect::<Result<Vec<_>, _>>().map_err(said)?;
            let hit = compliant_impact(&dmatrix![2.0, -1.0; -1.0, 2.0], &dvector![-1.0, 0.0], &contacts);
            let p = hit.map_err(said)?.impulse;
            Ok([1.0 - p[0], p[0] - p[1], p[1]])
        };
        return Ok(Found::figure(farthest(elastic)?));
    }
    let between = vec![Constraint::Stop { restitution: 1.0 }; 2];
    let cradle = problem(dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0], between)?;
    if method == LIU_ZHAO_BROGLIATO {
        let elastic = |ratio: f64| {
            let ratios = &[ratio, 1.0];
            let p = cradle.energetic(&Stiffnesses { exponent: 1.5, ratios }, &ACCURACY).map_err(said)?.total.impulse;
            Ok([1.0 - p[0], p[0] - p[1], p[1]])
        };
        return Ok(Found::figure(farthest(elastic)?));
    }
    let gaps = resolve(method, &cradle)?.u_plus;
    // Momentum 1, and the two differences.
    let first = (1.0 - 2.0 * gaps[0] - gaps[1]) / 3.0;
    let after = [first, first + gaps[0], first + gaps[0] + gaps[1]];
    let off = after.iter().zip(rigid_cradle(method)).fold(0.0, |most, (one, other)| worse(most, (one - other).abs()));
    let [a, b, c] = rigid_cradle(method);
    let how = format!("({a:.3}, {b:.3}, {c:.3}) m/s whatever the stiffnesses");
    Ok(Found::figure(farthest(|_| Ok(after))?)
        .must("error of the law's own solution", off, super::method::EXACT)
        .noting(how))
}
