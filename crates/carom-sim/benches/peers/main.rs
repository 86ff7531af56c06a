//! carom's program for `benches/peers/kernels`: one sample of every kernel on one robot. The driver runs it in turn with the
//! programs of the other libraries: `peers CASES ROBOT SECONDS LABEL` (cargo's `--bench` is ignored; without arguments the
//! program does nothing).
//!
//! Each line is `LABEL KERNEL NANOSECONDS NUMBER…`. With zero seconds nothing is timed, and the numbers are the results at all
//! states: q̇⁺ and the x and y entries of H, M times the third column of the state, τ, q̈; for a batch all its columns.

mod closed_form;

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, Point};
use carom_impact::Frictionless;
use carom_sim::{FrictionlessJump, Impacts, Outcomes, States};
use closed_form::TwoLinks;
use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use std::hint::black_box;
use std::time::Instant;

const RESTITUTION: f64 = 0.35;
/// Configurations of a batch.
const MANY: usize = 1024;
/// Number of configurations whose results are printed.
const SHOWN: usize = 64;
/// Time between two readings of the clock, s: a reading costs some 50 ns.
const BETWEEN_LOOKS: f64 = 5e-5;
/// Least number of intervals between two readings in a sample.
const FEWEST: usize = 15;
/// Largest number of joints for the checked strike and its derivative: the strike detects singular directions, and the
/// derivative evaluates the chain once for eight joints, which is not meant for loops with larger chains.
const STRIKES_UP_TO: usize = 29;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|it| it != "--bench").collect();
    let [cases, robot, seconds, label] = &args[..] else { return };
    let clock = Clock { label: label.clone(), seconds: seconds.parse().expect("SECONDS is a number") };
    let text = std::fs::read_to_string(cases).expect("CASES is a file");
    // The line after the name of a robot contains its numbers.
    let mut lines = text.lines().skip_while(|line| line.split_whitespace().next() != Some(robot));
    let mut words = lines.next().expect("no such robot in CASES").split_whitespace().skip(1);
    let urdf = words.next().expect("a robot's file");
    let (n, states) = (count(words.next()), count(words.next()));
    let mut numbers = lines.next().expect("the states").split_whitespace().map(|it| it.parse().expect("a number"));
    let mut next = || -> Vec<f64> { numbers.by_ref().take(n).collect() };
    let states: Vec<State> = (0..states).map(|_| State { q: next(), qd: next(), input: next() }).collect();

    let chain = Chain::from_urdf_file(urdf).expect("a robot");
    let tip = chain.frame("tip").expect("a frame tip");
    // A planar chain is computed in its plane, as in a simulation.
    match chain.to_planar() {
        Ok(flat) => {
            let point = flat.point(tip, Vector3::zeros());
            let normal = Vector2::new(-1.0, 0.0);
            one_at_a_time(&clock, &flat.chain, point, normal, Vector2::new(0.0, -9.81), &states);
            let columns = Columns::new(&states);
            batches(&clock, &flat.chain, point, normal, &columns);
            if let Some(links) = TwoLinks::new(&flat.chain, point) {
                by_hand(&clock, &links, normal, &columns);
            }
        }
        Err(_) => {
            let point = chain.point(tip, Vector3::zeros());
            let normal = Vector3::new(-1.0, 0.0, 0.0);
            one_at_a_time(&clock, &chain, point, normal, Vector3::new(0.0, -9.81, 0.0), &states);
            batches(&clock, &chain, point, normal, &Columns::new(&states));
        }
    }
    if n <= STRIKES_UP_TO {
        strikes(&clock, &chain, &states);
    }
}

fn count(word: Option<&str>) -> usize {
    word.and_then(|it| it.parse().ok()).expect("a number of joints, and of states")
}

struct State {
    q: Vec<f64>,
    qd: Vec<f64>,
    /// q̈ for the inverse dynamics, τ for the forward dynamics.
    input: Vec<f64>,
}

struct Clock {
    label: String,
    seconds: f64,
}

impl Clock {
    /// Runs `work`, which reads the state of the given number and prints its result if requested. The time is the median over
    /// the intervals between two readings of the clock, so that an interrupted interval has no effect. `parts` is the number
    /// of impacts in one call.
    fn time(
        &self,
        label: &str,
        kernel: &str,
        states: usize,
        parts: usize,
        mut work: impl FnMut(usize, Option<&mut Vec<f64>>),
    ) {
        if self.seconds <= 0.0 {
            let mut shown = Vec::new();
            (0..states).for_each(|k| work(k, Some(&mut shown)));
            let numbers: Vec<String> = shown.iter().map(|x| format!("{x:e}")).collect();
            println!("{label} {kernel} 0 {}", numbers.join(" "));
            return;
        }
        let mut k = 0;
        let mut stretch = |calls: u32| {
            let begin = Instant::now();
            for _ in 0..calls {
                work(k, None);
                k = if k + 1 < states { k + 1 } else { 0 };
            }
            begin.elapsed().as_secs_f64()
        };
        stretch(16); // warm
        let calls = (BETWEEN_LOOKS * 16.0 / stretch(16)).clamp(1.0, 1e6) as u32;
        let (mut stretches, begin) = (Vec::new(), Instant::now());
        while stretches.len() < FEWEST || begin.elapsed().as_secs_f64() < self.seconds {
            stretches.push(stretch(calls));
        }
        stretches.sort_by(f64::total_cmp);
        println!("{label} {kernel} {}", stretches[stretches.len() / 2] * 1e9 / (f64::from(calls) * parts as f64));
    }

    fn own(&self, kernel: &str, states: usize, work: impl FnMut(usize, Option<&mut Vec<f64>>)) {
        self.time(&self.label, kernel, states, 1, work);
    }
}

fn one_at_a_time<A: Algebra<Scalar = f64>>(
    clock: &Clock,
    chain: &Chain<A>,
    tip: Point<A>,
    normal: A::Vector,
    gravity: A::Vector,
    states: &[State],
) {
    let n = chain.nv();
    let fused = FrictionlessJump::new(chain, tip).unwrap();
    let mut jump = fused.jump();
    clock.own("chain", states.len(), |k, shown| {
        let state = black_box(&states[k]);
        fused.jump_into(&state.q, &state.qd, normal, RESTITUTION, black_box(&mut jump)).unwrap();
        if let Some(shown) = shown {
            let h = |i: usize, j| A::linear_part(jump.response().delassus[i], j);
            shown.extend(&jump.qd_plus);
            shown.extend([h(0, 0), h(1, 0), h(1, 1)]);
        }
    });
    let mut workspace = chain.workspace();
    let mut m = DMatrix::zeros(n, n);
    clock.own("mass", states.len(), |k, shown| {
        let state = black_box(&states[k]);
        workspace.update(chain, &state.q).unwrap().mass_matrix_into(black_box(&mut m));
        if let Some(shown) = shown {
            shown.extend((&m * DVector::from_column_slice(&state.input)).iter());
        }
    });
    let mut out = vec![0.0; n];
    clock.own("inverse", states.len(), |k, shown| {
        let state = black_box(&states[k]);
        let mut kin = workspace.update(chain, &state.q).unwrap();
        kin.inverse_dynamics_into(&state.qd, &state.input, gravity, black_box(&mut out)).unwrap();
        if let Some(shown) = shown {
            shown.extend(&out);
        }
    });
    clock.own("forward", states.len(), |k, shown| {
        let state = black_box(&states[k]);
        let mut kin = workspace.update(chain, &state.q).unwrap();
        let mut articulated = kin.articulate().unwrap();
        articulated.forward_dynamics_into(&state.qd, &state.input, gravity, black_box(&mut out)).unwrap();
        if let Some(shown) = shown {
            shown.extend(&out);
        }
    });
}

/// The states as columns, shifted a little at each repetition.
struct Columns {
    q: Vec<Vec<f64>>,
    qd: Vec<Vec<f64>>,
}

impl Columns {
    fn new(states: &[State]) -> Self {
        let many = |of: fn(&State) -> &Vec<f64>| {
            let entry = |row: usize, k: usize| of(&states[k % states.len()])[row] + 1e-3 * (k / states.len()) as f64;
            (0..states[0].q.len()).map(|row| (0..MANY).map(|k| entry(row, k)).collect()).collect()
        };
        Self { q: many(|it| &it.q), qd: many(|it| &it.qd) }
    }

    /// One sample of a batch by `many`: the jump alone, and the jump with all other results.
    fn run(&self, clock: &Clock, label: &str, linear: usize, mut many: impl FnMut(States, &mut Outcomes)) {
        let n = self.q.len();
        let (q, qd): (Vec<&[f64]>, Vec<&[f64]>) =
            (self.q.iter().map(Vec::as_slice).collect(), self.qd.iter().map(Vec::as_slice).collect());
        for (kernel, all) in [("batch", false), ("batch-all", true)] {
            // qd⁺, the impulse, H, J, M.
            let rows = [n, 1, linear * linear, linear * n, n * n];
            let mut out: Vec<Vec<Vec<f64>>> = rows
                .iter()
                .enumerate()
                .map(|(i, &it)| vec![vec![0.0; MANY]; if i < 2 || all { it } else { 0 }])
                .collect();
            let mut columns: Vec<Vec<&mut [f64]>> =
                out.iter_mut().map(|them| them.iter_mut().map(Vec::as_mut_slice).collect()).collect();
            clock.time(label, kernel, 1, MANY, |_, shown| {
                let [qd_plus, impulse, delassus, jacobian, mass_matrix] = &mut columns[..] else { return };
                let mut outcomes = Outcomes { qd_plus, impulse, delassus, jacobian, mass_matrix };
                many(black_box(States { q: &q, qd: &qd }), black_box(&mut outcomes));
                if let Some(shown) = shown {
                    shown.extend(columns.iter().flatten().flat_map(|column| &column[..SHOWN]));
                }
            });
        }
    }
}

fn batches<A: Algebra<Scalar = f64>>(
    clock: &Clock,
    chain: &Chain<A>,
    tip: Point<A>,
    normal: A::Vector,
    columns: &Columns,
) {
    let fused = FrictionlessJump::new(chain, tip).unwrap();
    columns.run(clock, &clock.label, A::LINEAR, |states, outcomes| {
        fused.many(states, normal, RESTITUTION, outcomes).unwrap();
    });
}

fn by_hand(clock: &Clock, links: &TwoLinks, normal: Vector2<f64>, columns: &Columns) {
    columns.run(clock, "closed-form", 2, |states, outcomes| links.many(states, normal, RESTITUTION, outcomes));
}

/// The checked interface in space, without and with all derivatives of q̇⁺ with respect to q, q̇⁻, e and μ.
fn strikes(clock: &Clock, chain: &Chain, states: &[State]) {
    let law = Frictionless { restitution: RESTITUTION };
    let tip = chain.frame("tip").unwrap();
    fn strike<'a>(chain: &'a Chain, state: &'a State, tip: carom_chain::FrameId) -> carom_sim::Strike<'a> {
        chain.impact(&state.q, &state.qd).at(tip).normal([-1.0, 0.0, 0.0])
    }
    clock.own("strike", states.len(), |k, shown| {
        let hit = black_box(strike(chain, black_box(&states[k]), tip).resolve(&law).unwrap());
        if let Some(shown) = shown {
            shown.extend(hit.qd_plus.iter());
        }
    });
    clock.own("derivative", states.len(), |k, shown| {
        let found = black_box(strike(chain, black_box(&states[k]), tip).derivative(&law).unwrap());
        if let Some(shown) = shown {
            shown.extend(found.hit.qd_plus.iter());
        }
    });
}
