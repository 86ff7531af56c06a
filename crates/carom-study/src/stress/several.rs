//! Several contacts at one time, on plain numbers.

use super::single::worse;
use super::{Found, GLOCKER_PFEIFFER, Judged, MOREAU};
use carom_impact::{Accuracy, Constraint, Flags, Order, SeveralProblem};
use nalgebra::{DMatrix, DVector, Vector2, dmatrix, dvector};

/// What the three laws have in common.
struct Answer {
    u_plus: DVector<f64>,
    residual: f64,
    gains: bool,
    energy_change: f64,
}

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-12, max_iterations: 2_000 };

fn resolve(method: &str, problem: &SeveralProblem) -> Result<Answer, String> {
    Ok(match method {
        MOREAU => {
            let hit = problem.simultaneous(&ACCURACY, None).map_err(|e| e.to_string())?;
            let gains = hit.flags.contains(Flags::ENERGY_GAIN);
            Answer { u_plus: hit.u_plus, residual: hit.residual, gains, energy_change: hit.energy_change }
        }
        GLOCKER_PFEIFFER => {
            let hit = problem.poisson(&ACCURACY).total;
            let gains = hit.flags.contains(Flags::ENERGY_GAIN);
            Answer { u_plus: hit.u_plus, residual: hit.residual, gains, energy_change: hit.energy_change }
        }
        _ => {
            let hit = problem.sequential(&Order::MostApproaching, &ACCURACY).map_err(|e| e.to_string())?;
            let gains = hit.flags.contains(Flags::ENERGY_GAIN);
            Answer { u_plus: hit.u_plus, residual: hit.residual, gains, energy_change: hit.energy_change }
        }
    })
}

fn problem(h: DMatrix<f64>, u: DVector<f64>, constraints: Vec<Constraint>) -> Result<SeveralProblem, String> {
    SeveralProblem::new(h, u, constraints).map_err(|e| e.to_string())
}

/// What the order of sub-impacts leaves open.
fn orders(problem: &SeveralProblem) -> Option<String> {
    let set = problem.all_orders(24, &ACCURACY);
    let count = set.outcomes.len();
    (count > 1).then(|| format!("not unique: {count} outcomes over the orders, {:.3} m/s apart", set.spread))
}

pub fn rod(method: &str) -> Judged {
    let ends = vec![Constraint::Stop { restitution: 0.5 }; 2];
    let rod = problem(dmatrix![4.0, -2.0; -2.0, 4.0], dvector![-1.0, -1.0], ends)?;
    let hit = resolve(method, &rod)?;
    let found = Found::figure((hit.u_plus - dvector![0.5, 0.5]).amax());
    Ok(if matches!(method, MOREAU | GLOCKER_PFEIFFER) { found } else { found.failing(orders(&rod)) })
}

/// All points rebound with e of their approach: that is a motion of the rod, and the only solution.
pub fn redundant(method: &str) -> Judged {
    let rows = DMatrix::from_fn(3, 2, |i, j| if j == 0 { 1.0 } else { [-0.5, 0.0, 0.5][i] });
    let response = DMatrix::from_diagonal(&dvector![1.0, 12.0]);
    let u = &rows * dvector![-1.0, 0.6];
    let points = vec![Constraint::Stop { restitution: 0.5 }; 3];
    let rod = problem(&rows * response * rows.transpose(), u.clone(), points)?;
    let hit = resolve(method, &rod)?;
    let found = Found::figure((&hit.u_plus + &u * 0.5).amax() / u.amax());
    Ok(if matches!(method, MOREAU | GLOCKER_PFEIFFER) { found } else { found.failing(orders(&rod)) })
}

struct Census {
    residual: f64,
    gains: usize,
    most: f64,
    unsolved: usize,
}

/// `count` random problems of `rows` rows per constraint; `constraint` makes one.
fn census(
    method: &str,
    count: usize,
    rows: usize,
    constraint: impl Fn(&mut fastrand::Rng, f64) -> Constraint,
) -> Result<Census, String> {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut census = Census { residual: 0.0, gains: 0, most: 0.0, unsolved: 0 };
    for _ in 0..count {
        let contacts = rng.usize(2..=4);
        let (m, freedoms) = (contacts * rows, rng.usize(2..=8));
        let mut number = || 2.0 * rng.f64() - 1.0;
        let j = DMatrix::from_fn(m, freedoms, |_, _| number());
        let v = DVector::from_fn(freedoms, |_, _| number());
        // Velocities that some motion has; not all of the contacts approach.
        let u = &j * v;
        let common = rng.f64();
        let constraints = (0..contacts).map(|_| constraint(&mut rng, common)).collect();
        let problem = problem(&j * j.transpose(), u.clone(), constraints)?;
        let hit = resolve(method, &problem)?;
        // The energy that these contacts can touch is at most that of u.
        if hit.gains {
            census.gains += 1;
            census.most = census.most.max(hit.energy_change / (0.5 * u.norm_squared()));
        }
        census.unsolved += usize::from(hit.residual.is_nan() || hit.residual > 1e-10);
        census.residual = worse(census.residual, hit.residual);
    }
    Ok(census)
}

impl Census {
    /// `may` says whether theory lets this law gain here.
    fn found(self, may: bool, count: usize) -> Found {
        let Self { residual, gains, most, unsolved } = self;
        let unsolved = if unsolved > 0 { format!("{unsolved} of {count} not solved to 1e-10") } else { String::new() };
        let found = Found::figure(residual).noting(unsolved);
        match gains {
            0 => found,
            _ if may => found.failing(Some(format!("energy gained in {gains} of {count}"))),
            _ => Found::figure(f64::INFINITY).noting(format!("energy gained in {gains} of {count}, {most} of ½u²;")),
        }
    }
}

pub fn different_restitutions(method: &str) -> Judged {
    let own = |rng: &mut fastrand::Rng, _: f64| Constraint::Stop { restitution: rng.f64() };
    Ok(census(method, 2000, 1, own)?.found(method == MOREAU, 2000))
}

pub fn rough(method: &str) -> Judged {
    let common = |rng: &mut fastrand::Rng, restitution: f64| Constraint::Contact { restitution, friction: rng.f64() };
    Ok(census(method, 100, 3, common)?.found(method != GLOCKER_PFEIFFER, 100))
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
    Ok(Found::figure(resolve(method, &raft)?.residual))
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

/// Velocities of three balls of 1 kg after the first struck at 1 m/s, contacts after Hertz (F = k d^1.5), stiffnesses as 1 : 1
/// and 10 : 1. Rigid laws don't know the stiffnesses; the wave through the balls does.
pub fn cradle(method: &str) -> Judged {
    let between = vec![Constraint::Stop { restitution: 1.0 }; 2];
    let cradle = problem(dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0], between)?;
    let gaps = resolve(method, &cradle)?.u_plus;
    // Momentum 1, and the two differences.
    let first = (1.0 - 2.0 * gaps[0] - gaps[1]) / 3.0;
    let after = [first, first + gaps[0], first + gaps[0] + gaps[1]];
    let mut error = 0.0;
    for ratio in [1.0, 10.0, 0.1] {
        let elastic = super::motion::elastic_cradle(ratio)?;
        for (rigid, soft) in after.iter().zip(elastic) {
            error = worse(error, (rigid - soft).abs());
        }
    }
    let [a, b, c] = after;
    let how = format!("gives ({a:.3}, {b:.3}, {c:.3}) whatever the stiffnesses, of which the outcome depends");
    Ok(Found::figure(error).failing((error > 1e-9).then_some(how)))
}

/// J. M. Housner, Bull. Seism. Soc. Am. 53 (1963) 403. The block turns about its left corner when the right one strikes.
pub fn rocking_block(method: &str) -> Judged {
    let mut error = 0.0;
    for alpha in [0.1_f64, 0.2, 0.3] {
        let (b, h) = (alpha.sin(), alpha.cos());
        // Unit mass, half diagonal 1, inertia 1/3; (v_x, v_z, ω about y): a point (x, z) moves with (v_x + ωz, v_z − ωx).
        let mut rows = DMatrix::zeros(6, 3);
        for (k, x) in [-b, b].into_iter().enumerate() {
            rows.set_row(3 * k, &nalgebra::RowVector3::new(1.0, 0.0, -h));
            rows.set_row(3 * k + 2, &nalgebra::RowVector3::new(0.0, 1.0, -x));
        }
        let inverse = DMatrix::from_diagonal(&dvector![1.0, 1.0, 3.0]);
        let v = dvector![h, -b, 1.0];
        let corners = vec![Constraint::Contact { restitution: 0.0, friction: 5.0 }; 2];
        let block = problem(&rows * inverse * rows.transpose(), &rows * v, corners)?;
        let hit = resolve(method, &block)?;
        // Between the corners' heights lies ω: (u_z,left − u_z,right)/2b.
        let ratio = (hit.u_plus[2] - hit.u_plus[5]) / (2.0 * b);
        error = worse(error, (ratio - (1.0 - 1.5 * b * b)).abs());
    }
    Ok(Found::figure(error))
}
