//! carom's side of `benches/peers/kernels`: one sample of every kernel on the given robots, for a driver that runs it in turn
//! with the peers' programs: `peers CASES SECONDS LABEL` (cargo's own `--bench` is ignored; without arguments nothing is done).
//!
//! Each line is `LABEL KERNEL ROBOT NANOSECONDS NUMBER…`; the numbers are the answer, q̇⁺, the mass matrix's rows, τ or q̈.

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, Point};
use carom_sim::frictionless_jump_into;
use nalgebra::{DMatrix, Vector2, Vector3};
use std::hint::black_box;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|it| it != "--bench").collect();
    let [cases, seconds, label] = &args[..] else { return };
    let seconds: f64 = seconds.parse().expect("SECONDS is a number");
    let text = std::fs::read_to_string(cases).expect("CASES is a file");
    let mut words = text.split_whitespace();
    while let Some(name) = words.next() {
        let urdf = words.next().expect("a robot's file");
        let n: usize = words.next().and_then(|it| it.parse().ok()).expect("a number of joints");
        let chain = Chain::from_urdf_file(urdf).expect("a robot");
        let mut numbers =
            |count: usize| -> Vec<f64> { words.by_ref().take(count).map(|it| it.parse().expect("a number")).collect() };
        let state = State { q: numbers(n), qd: numbers(n), input: numbers(n) };
        let tip = chain.frame("tip").expect("a frame tip");
        let clock = Clock { label: label.clone(), robot: name.into(), seconds };
        // As a simulation does: a planar chain in its plane.
        match chain.to_planar() {
            Ok(flat) => {
                let point = flat.point(tip, Vector3::zeros());
                run(&clock, &flat.chain, point, Vector2::new(-1.0, 0.0), Vector2::new(0.0, -9.81), &state);
            }
            Err(_) => {
                let point = chain.point(tip, Vector3::zeros());
                run(&clock, &chain, point, Vector3::new(-1.0, 0.0, 0.0), Vector3::new(0.0, -9.81, 0.0), &state);
            }
        }
    }
}

struct State {
    q: Vec<f64>,
    qd: Vec<f64>,
    input: Vec<f64>,
}

struct Clock {
    label: String,
    robot: String,
    seconds: f64,
}

impl Clock {
    /// Calls `work` for about the sample's time and prints the mean; at least once, for its answer.
    fn time(&self, kernel: &str, mut work: impl FnMut(), answer: impl FnOnce() -> Vec<f64>) {
        let (mut calls, begin) = (0_u32, Instant::now());
        loop {
            for _ in 0..100 {
                work();
            }
            calls += 100;
            let passed = begin.elapsed().as_secs_f64();
            if passed >= self.seconds {
                // The answer is read only after the clock has stopped.
                let numbers: Vec<String> = answer().iter().map(|x| format!("{x:e}")).collect();
                let each = passed * 1e9 / f64::from(calls);
                println!("{} {kernel} {} {each} {}", self.label, self.robot, numbers.join(" "));
                return;
            }
        }
    }
}

fn run<A: Algebra<Scalar = f64>>(
    clock: &Clock,
    chain: &Chain<A>,
    tip: Point<A>,
    normal: A::Vector,
    gravity: A::Vector,
    state: &State,
) {
    use std::cell::RefCell;
    let n = chain.nv();
    let workspace = RefCell::new(chain.workspace());
    let (mut j, mut h) = (DMatrix::zeros(A::LINEAR, n), DMatrix::zeros(A::LINEAR, A::LINEAR));
    let (m, out) = (RefCell::new(DMatrix::zeros(n, n)), RefCell::new(vec![0.0; n]));
    let mut scratch = vec![0.0; n];
    let read = || out.borrow().clone();
    let chain_work = || {
        let mut ws = workspace.borrow_mut();
        let mut kin = ws.update(chain, black_box(&state.q)).unwrap();
        kin.point_jacobian_into(tip, &mut j);
        kin.mass_matrix_into(&mut m.borrow_mut());
        frictionless_jump_into(&mut kin, tip, normal, 0.35, &state.qd, &mut scratch, &mut out.borrow_mut()).unwrap();
        kin.articulate().unwrap().delassus_into(tip, &mut h);
    };
    clock.time("chain", chain_work, read);
    let mass = || {
        let mut ws = workspace.borrow_mut();
        ws.update(chain, black_box(&state.q)).unwrap().mass_matrix_into(&mut m.borrow_mut());
    };
    clock.time("mass", mass, || m.borrow().iter().copied().collect());
    let inverse = || {
        let mut ws = workspace.borrow_mut();
        let mut kin = ws.update(chain, black_box(&state.q)).unwrap();
        kin.inverse_dynamics_into(&state.qd, &state.input, gravity, &mut out.borrow_mut()).unwrap();
    };
    clock.time("inverse", inverse, read);
    let forward = || {
        let mut ws = workspace.borrow_mut();
        let mut kin = ws.update(chain, black_box(&state.q)).unwrap();
        let mut articulated = kin.articulate().unwrap();
        articulated.forward_dynamics_into(&state.qd, &state.input, gravity, &mut out.borrow_mut()).unwrap();
    };
    clock.time("forward", forward, read);
}
