//! The crates dynibo, featherstone and rapier in `kernels`: `carom-peers-crates HINGES CASES ROBOT SECONDS`. Prints lines in the
//! format of `crates/carom-sim/benches/peers`, labelled `dynibo`, `featherstone` and `rapier`.

mod dynibo_side;
mod featherstone_side;
mod rapier_side;

use std::hint::black_box;
use std::time::Instant;

/// Time between two readings of the clock, s; a reading takes about 50 ns.
const BETWEEN_LOOKS: f64 = 5e-5;
/// Smallest number of intervals between two readings in a sample.
const FEWEST: usize = 15;

/// A robot and its states, as in `c/common.h`, which reads the same file.
pub struct Case {
    /// File of the robot, from CASES.
    pub urdf: String,
    pub hinges: Vec<Hinge>,
    pub tip: (usize, [f64; 3]),
    pub states: Vec<State>,
}

pub struct Hinge {
    pub name: String,
    pub parent: Option<usize>,
    /// Rotation, by rows.
    pub turn: [[f64; 3]; 3],
    pub shift: [f64; 3],
    pub axis: [f64; 3],
    pub mass: f64,
    pub centre: [f64; 3],
    pub inertia: [[f64; 3]; 3],
}

pub struct State {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    /// q̈ for the inverse dynamics, τ for the forward dynamics.
    pub input: Vec<f64>,
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [hinges, cases, robot, seconds] = &args[..] else {
        panic!("usage: carom-peers-crates HINGES CASES ROBOT SECONDS")
    };
    let text = std::fs::read_to_string(hinges).expect("HINGES is a file");
    let cases = std::fs::read_to_string(cases).expect("CASES is a file");
    let case = Case::read(&text, &cases, robot);
    let seconds: f64 = seconds.parse().expect("SECONDS is a number");
    dynibo_side::run(&case, seconds);
    featherstone_side::run(&case, seconds);
    rapier_side::run(&case, seconds);
}

impl Case {
    fn read(text: &str, cases: &str, robot: &str) -> Self {
        let mut words = cases.lines().map(str::split_whitespace);
        let urdf = words.find_map(|mut it| if it.next() == Some(robot) { it.next() } else { None });
        let urdf = urdf.expect("no such robot in CASES").to_owned();
        let mut lines = text.lines().skip_while(|line| line.split_whitespace().next() != Some(robot));
        let numbers = |line: &str, skip: usize| -> Vec<f64> {
            line.split_whitespace().skip(skip).map(|it| it.parse().expect("a number")).collect()
        };
        let head = numbers(lines.next().expect("no such robot in HINGES"), 1);
        let [n, states, link] = [0, 1, 2].map(|i| head[i] as usize);
        let three = |x: &[f64]| [x[0], x[1], x[2]];
        let nine = |x: &[f64]| [three(x), three(&x[3..]), three(&x[6..])];
        let mut next = || lines.next().expect("a line");
        let hinge = |name: &str, x: Vec<f64>| Hinge {
            name: name.to_owned(),
            parent: (x[0] >= 0.0).then_some(x[0] as usize),
            turn: nine(&x[1..]),
            shift: three(&x[10..]),
            axis: three(&x[13..]),
            mass: x[16],
            centre: three(&x[17..]),
            inertia: nine(&x[20..]),
        };
        let hinges = (0..n)
            .map(|_| {
                let line = next();
                hinge(line.split_whitespace().next().expect("a name"), numbers(line, 1))
            })
            .collect();
        let mut state = || State { q: numbers(next(), 0), qd: numbers(next(), 0), input: numbers(next(), 0) };
        Self { urdf, hinges, tip: (link, three(&head[3..])), states: (0..states).map(|_| state()).collect() }
    }
}

/// Repeats `work`, which reads a state and stores its answer if asked to, for `seconds`, and prints the median time over
/// intervals of 50 µs. If `seconds` is zero, prints the answers at all states instead.
pub fn time(
    label: &str,
    kernel: &str,
    states: &[State],
    seconds: f64,
    mut work: impl FnMut(&State, Option<&mut Vec<f64>>),
) {
    if seconds <= 0.0 {
        let mut shown = Vec::new();
        states.iter().for_each(|state| work(state, Some(&mut shown)));
        let numbers: Vec<String> = shown.iter().map(|x| format!("{x:e}")).collect();
        println!("{label} {kernel} 0 {}", numbers.join(" "));
        return;
    }
    let mut k = 0;
    let mut stretch = |calls: u32| {
        let begin = Instant::now();
        for _ in 0..calls {
            work(black_box(&states[k]), None);
            k = if k + 1 < states.len() { k + 1 } else { 0 };
        }
        begin.elapsed().as_secs_f64()
    };
    stretch(16); // warm
    let calls = (BETWEEN_LOOKS * 16.0 / stretch(16)).clamp(1.0, 1e6) as u32;
    let (mut stretches, begin) = (Vec::new(), Instant::now());
    while stretches.len() < FEWEST || begin.elapsed().as_secs_f64() < seconds {
        stretches.push(stretch(calls));
    }
    stretches.sort_by(f64::total_cmp);
    println!("{label} {kernel} {}", stretches[stretches.len() / 2] * 1e9 / f64::from(calls));
}
