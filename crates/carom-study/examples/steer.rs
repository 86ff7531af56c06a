//! The force that steers one puck such that another one, which it strikes, comes to the origin: 960 controls, two for each of 480 pieces
//! of time, by the L-BFGS method with gradients of the whole run. The cost is |x₁(1 s)|² + 0.01 ∫ |u|² dt.
//!
//! Without the wall the least cost of any force is 0.3114168704, with the wall 0.3736363502: from the closed form of the strike and of the
//! linear forces before it. Pieces of constant force come as near as the strike comes to the border of two of them.
//!
//! `cargo run --release -p carom-study --example steer -- [wall]`

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use carom_sim::{Drive, Parameter, Plan, Sampling, Scene, Seen, TorqueTable};
use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

const PIECES: usize = 480;
const EFFORT: f64 = 0.01;
/// A decrease of the cost that does not count.
const SMALL: f64 = 1e-9;

/// A point, its cost and the gradient.
type Evaluated = (Vec<f64>, f64, Vec<f64>);

/// The problem in the variables √h u, in which the norm is that of the function u.
struct Steer {
    plan: Plan,
    duration: f64,
    /// Whether the force is linear between the middles of pieces, and its effort counts up to the strike only: a smooth problem.
    smooth: Cell<bool>,
    /// The last point, and its cost and gradient.
    last: RefCell<Option<Evaluated>>,
    evaluations: RefCell<usize>,
}

impl Steer {
    fn h(&self) -> f64 {
        self.duration / PIECES as f64
    }

    /// The plan with these forces: each piece is two rows of the table, at its begin and at its end.
    fn steered(&self, x: &[f64]) -> Plan {
        let mut plan = self.plan.clone();
        let (h, scale) = (self.h(), 1.0 / self.h().sqrt());
        let (times, forces) =
            self.rows().map(|(at, k)| (at * h, vec![scale * x[2 * k], scale * x[2 * k + 1], 0.0, 0.0])).unzip();
        plan.simulation.drive = Drive::Table(TorqueTable { times, forces });
        plan
    }

    /// The times of the rows of the table in pieces, and the piece whose force each has.
    fn rows(&self) -> impl Iterator<Item = (f64, usize)> {
        let smooth = self.smooth.get();
        let rows =
            move |k: usize| if smooth { vec![(k as f64 + 0.5, k)] } else { vec![(k as f64, k), (k as f64 + 1.0, k)] };
        (0..PIECES).flat_map(rows)
    }

    /// ∫ |u|² dt, and its derivatives by x and by the strike, which is after so many pieces.
    fn effort(&self, x: &[f64], strike: f64) -> (f64, Vec<f64>, f64) {
        if !self.smooth.get() {
            return (x.iter().map(|x| x * x).sum(), x.iter().map(|x| 2.0 * x).collect(), 0.0);
        }
        let (mut effort, mut by, mut by_strike) = (0.0, vec![0.0; x.len()], 0.0);
        for i in 0..x.len() {
            // From the middle of a piece to that of the next one, as far as the strike; the first half piece is constant.
            let (a, step) = (x[i], x.get(i + 2).map_or(0.0, |next| next - x[i]));
            let s = (strike - (i / 2) as f64 - 0.5).clamp(0.0, 1.0);
            effort += s * a * a + s * s * a * step + s * s * s * step * step / 3.0;
            let by_step = s * s * a + s * s * s * step * 2.0 / 3.0;
            by[i] += 2.0 * s * a + s * s * step - by_step;
            if let Some(next) = by.get_mut(i + 2) {
                *next += by_step;
            }
            if s > 0.0 && s < 1.0 {
                by_strike += (a + s * step).powi(2);
            }
            if i < 2 {
                effort += 0.5 * a * a;
                by[i] += a;
            }
        }
        (effort, by, by_strike)
    }

    /// The cost and its gradient.
    fn evaluate(&self, x: &[f64]) -> Result<(f64, Vec<f64>), Error> {
        if let Some((at, cost, gradient)) = &*self.last.borrow()
            && at == x
        {
            return Ok((*cost, gradient.clone()));
        }
        let plan = self.steered(x);
        // The rows of the steered puck: those of its x, then those of its y.
        let rows: Vec<Parameter> = Parameter::all(&plan.simulation);
        let rows: Vec<Parameter> = rows.into_iter().filter(|it| it.name().starts_with("torque steered/")).collect();
        let run = plan.linear_run(self.duration, &rows)?;
        let end = &run.last().q;
        let strike = run.events().next().map_or(PIECES as f64, |(time, _)| time / self.h());
        let (effort, by_effort, by_strike) = self.effort(x, strike);
        let cost = end[2] * end[2] + end[3] * end[3] + EFFORT * effort;
        let mut by_times = vec![0.0; run.events().count()];
        if let Some(first) = by_times.first_mut() {
            *first = EFFORT * by_strike / self.h();
        }
        let by = run.vjp(&[0.0, 0.0, 2.0 * end[2], 2.0 * end[3], 0.0, 0.0, 0.0, 0.0], &by_times)?;
        let mut gradient: Vec<f64> = by_effort.iter().map(|by| EFFORT * by).collect();
        let (count, scale) = (self.rows().count(), 1.0 / self.h().sqrt());
        for axis in [0, 1] {
            let own = &by[8 + axis * count..];
            self.rows().zip(own).for_each(|((_, k), by)| gradient[2 * k + axis] += scale * by);
        }
        *self.last.borrow_mut() = Some((x.to_vec(), cost, gradient.clone()));
        *self.evaluations.borrow_mut() += 1;
        Ok((cost, gradient))
    }

    /// The best point from a start, its cost, and the number of iterations.
    fn minimise(&self, start: Vec<f64>, most: u64) -> Result<(Vec<f64>, f64, u64), Error> {
        let solver = LBFGS::new(MoreThuenteLineSearch::new().with_c(1e-4, 0.1)?, 20)
            .with_tolerance_grad(1e-7)?
            .with_tolerance_cost(SMALL)?;
        let result = Executor::new(self, solver).configure(|state| state.param(start).max_iters(most)).run()?;
        let state = result.state();
        let best = state.get_best_param().ok_or_else(|| Error::msg("no point has a cost"))?;
        Ok((best.clone(), state.get_best_cost(), state.get_iter()))
    }

    /// Without force after the strike, and at the speed at which the strike is at the nearest border of two pieces.
    fn to_border(&self, x: &[f64]) -> Result<Vec<f64>, Error> {
        let mut strike = None;
        self.steered(x).stream(self.duration, Sampling::default(), &mut |seen| {
            if let Seen::Event(event) = seen {
                strike = strike.or(Some(event.time));
            }
        })?;
        let pieces = strike.ok_or_else(|| Error::msg("nothing is struck"))? / self.h();
        let speed = (pieces / pieces.round()).powi(2);
        let count = 2 * pieces.round() as usize;
        Ok((0..x.len()).map(|i| if i < count { speed * x[i] } else { 0.0 }).collect())
    }
}

impl CostFunction for &Steer {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Self::Param) -> Result<f64, Error> {
        Ok(self.evaluate(x)?.0)
    }
}

impl Gradient for &Steer {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Self::Param) -> Result<Self::Gradient, Error> {
        Ok(self.evaluate(x)?.1)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let wall = std::env::args().nth(1).is_some_and(|it| it == "wall");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/steer.toml");
    let mut text = std::fs::read_to_string(file)?;
    if wall {
        text = text.replace("q = [-1, -2]", "q = [0.25, -0.3]").replace("q = [-1, -1]", "q = [-0.5, 0.6]");
        text += "\n[[surface]]\nname = \"wall\"\nshape = { halfspace = { point = [0, 1, 0], normal = [0, -1, 0] } }\n";
    }
    let scene = Scene::from_toml(&text, concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes"))?;
    let (plan, duration) = (scene.plan()?, scene.duration);
    let steer =
        Steer { plan, duration, smooth: Cell::new(false), last: RefCell::new(None), evaluations: RefCell::new(0) };
    let first = if wall { [-4.0, 5.0] } else { [0.0, 3.0] };
    let x: Vec<f64> = (0..2 * PIECES).map(|i| first[i % 2] * steer.h().sqrt()).collect();
    ratios(&steer, &x)?;

    let least = if wall { 0.3736363502 } else { 0.3114168704 };
    // The cost has a kink where the strike is at the border of two pieces, and nearly all its minima are there: no gradient leads from one
    // to the next. The smooth problem beside it leads to the right one.
    let begin = Instant::now();
    steer.smooth.set(true);
    let (near, cost, first) = steer.minimise(x, 55)?;
    println!("linear between pieces, effort until the strike: cost {cost:.10} after {first} iterations");
    steer.smooth.set(false);
    steer.last.replace(None);
    let (_, cost, second) = steer.minimise(steer.to_border(&near)?, 60 - first)?;
    println!(
        "constant in pieces: cost {cost:.10}, {:.1e} above the least one of all forces; {} iterations, {} runs, {:.2} s",
        cost - least,
        first + second,
        steer.evaluations.borrow(),
        begin.elapsed().as_secs_f64()
    );
    Ok(())
}

/// The time of the cost and its gradient as multiples of that of the run.
fn ratios(steer: &Steer, x: &[f64]) -> Result<(), Box<dyn std::error::Error>> {
    let plan = steer.steered(x);
    let run = best(|| Ok(plan.stream(steer.duration, Sampling::default(), &mut |_| {}).map(|_| ())?))?;
    let gradient = best(|| {
        *steer.last.borrow_mut() = None;
        steer.evaluate(x).map(|_| ())
    })?;
    println!("a run {:.3} ms, cost and gradient by {} controls {:.1} runs", run * 1e3, x.len(), gradient / run);
    *steer.evaluations.borrow_mut() = 0;
    Ok(())
}

fn best(mut work: impl FnMut() -> Result<(), Error>) -> Result<f64, Error> {
    let (begin, mut best) = (Instant::now(), f64::INFINITY);
    while begin.elapsed() < Duration::from_secs(2) {
        let start = Instant::now();
        work()?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}
