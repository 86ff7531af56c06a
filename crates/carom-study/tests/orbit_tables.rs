//! Tables of orbits whose rows are functions of their number: cycles and basins.

use crate::orbits::{STEP, biped, close, problem, rolling, walk, wheel};
use crate::shaken_table::{fold_and_flip, shaken};
use carom_study::orbit::Problem;
use carom_study::{NumberedRows, RowFile, Written};
use std::f64::consts::PI;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The bytes of rows that are written with so many threads.
fn written(
    write: impl Fn(&RowFile, &AtomicBool) -> Written + Sync,
    path: &Path,
    rows: Range<u64>,
    threads: usize,
) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let file = RowFile { path: path.to_owned(), rows, resume: false };
    assert_eq!(pool.install(|| write(&file, &AtomicBool::new(false))), Written::Whole);
    std::fs::read(path).unwrap()
}

/// A row of cycles is that of the iteration of the map, whatever the number of threads, the part and the interruption: also one within the
/// cycles of a value.
#[test]
fn rows_of_cycles_are_functions_of_their_number() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let problem = shaken(0.5, 1.2, 1.5, 1).unwrap();
    let cycles = problem.cycles(7, 5, 300).unwrap();
    let write = |file: &RowFile, stop: &AtomicBool| cycles.write(file, &|_| (), stop).unwrap();
    let whole = written(write, &file("whole.csv"), 0..cycles.rows(), 1);
    let text = String::from_utf8(whole.clone()).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 2100);
    let number = |text: &str| text.parse::<f64>().unwrap();
    for place in [0, 299, 300, 1000] {
        let (value, cycle) = (place / 300, place % 300);
        let parameter = 1.2 + 0.3 * value as f64 / 6.0;
        close("parameter", number(rows[place][0]), parameter, 1e-15);
        assert_eq!(number(rows[place][1]), 5.0 + cycle as f64);
        let start = carom_study::orbit::State { q: problem.scene.q.clone(), qd: problem.scene.qd.clone() };
        let state = problem.cycle(number(rows[place][0]), start).unwrap().nth(5 + cycle).unwrap().unwrap();
        assert_eq!((number(rows[place][2]), number(rows[place][3])), (state.q[0], state.qd[0]), "row {place}");
    }
    assert!(whole == written(write, &file("threads.csv"), 0..cycles.rows(), 3), "threads");
    let mut joined = Vec::new();
    for part in 1..=3 {
        let text = written(write, &file("part.csv"), cycles.shard(part, 3).unwrap(), 2);
        let header = text.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        joined.extend_from_slice(if part == 1 { &text } else { &text[header..] });
    }
    assert!(whole == joined, "parts");
    for ending in ["csv", "parquet"] {
        let whole = written(write, &file(&format!("whole.{ending}")), 0..cycles.rows(), 2);
        let mut again = RowFile { path: file(&format!("again.{ending}")), rows: 0..cycles.rows(), resume: false };
        let (stop, done) = (AtomicBool::new(false), AtomicU64::new(0));
        let count = |rows: u64| {
            stop.fetch_or(done.fetch_add(rows, Ordering::Relaxed) + rows > 1200, Ordering::Relaxed);
        };
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let left = one.install(|| cycles.write(&again, &count, &stop)).unwrap();
        let Written::Interrupted { rows, .. } = left else { panic!("{left:?}") };
        assert!(rows > 0 && rows % 300 != 0, "{rows} rows: within the cycles of a value");
        again.resume = true;
        let other = problem.cycles(7, 6, 300).unwrap().write(&again, &|_| (), &AtomicBool::new(false)).unwrap_err();
        assert!(other.to_string().contains("the number of values or of cycles has changed since"), "{other}");
        assert_eq!(write(&again, &AtomicBool::new(false)), Written::Whole);
        assert!(std::fs::read(&again.path).unwrap() == whole, "{ending}");
    }
}

/// After a cycle that does not return the rows have no state, and the reason as a word.
#[test]
fn cycles_that_do_not_return_have_rows_with_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    // At a slope of 0.3 degrees the walker stops.
    let scene = walk(9.81, 0.3_f64.to_radians(), [-0.271, 1.09, 0.377]);
    let problem = problem(&biped(10.0, 5.0, 0.5), &scene, STEP).unwrap();
    let cycles = problem.cycles(1, 0, 40).unwrap();
    let path = folder.path().join("cycles.csv");
    cycles
        .write(&RowFile { path: path.clone(), rows: 0..40, resume: false }, &|_| (), &AtomicBool::new(false))
        .unwrap();
    let text = std::fs::read_to_string(path).unwrap();
    let outcomes: Vec<&str> = text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap()).collect();
    let (failures, first) = cycles.failures();
    let (_, error) = first.unwrap();
    assert_eq!((outcomes.len(), failures, outcomes[39]), (40, 1, error.name()), "{error}");
    let words = &cycles.columns().last().unwrap().words;
    assert!(words[1..].iter().any(|word| word == outcomes[39]), "{words:?}");
    let returned = outcomes.iter().take_while(|outcome| **outcome == "returned").count();
    assert!(outcomes[returned..].iter().all(|outcome| *outcome == outcomes[39]));
    assert!(text.lines().last().unwrap().contains("NaN"));
}

/// Closed form: a rimless wheel passes its next spoke if ω² exceeds 2 g (1 − cos(α − γ))/(1 + J) just after an impact; a step adds
/// 4 g sin α sin γ/(1 + J) to ω², and the impact multiplies it by a factor. So each start rolls on to the one cycle, or falls back.
#[test]
fn a_start_of_a_rimless_wheel_rolls_on_exactly_if_its_energy_lifts_it_over_each_spoke() {
    let (alpha, inertia, g) = (PI / 8.0, 0.02, 9.81);
    let urdf = wheel(inertia);
    let scene = rolling(alpha, [alpha.cos(), alpha.sin(), 1.0], [1.0, -9.81]);
    // The stance spoke passes the normal of the slope.
    let keys = format!(
        r#"
section.rising = "pitch - {alpha}"
orbit = {{ modulo = ["x"], relabel = {{ pitch = "pitch - {}" }}, tolerance = 1e-9 }}
vary = {{ parameter = "slope", from = 0.02, to = 0.1, set = {{ "run.gravity[0]" = "{g}*sin(slope)", "run.gravity[2]" = "-{g}*cos(slope)" }} }}
[basin]
x = {{ what = "rate", from = 0.25, to = 1.55, points = 12 }}
y = {{ what = "slope", from = 0.02, to = 0.1, points = 5 }}
set = {{ "robot.qd[0]" = "rate*{}", "robot.qd[1]" = "rate*{}", "robot.qd[2]" = "rate" }}"#,
        2.0 * alpha,
        alpha.cos(),
        alpha.sin()
    );
    let case = problem(&urdf, &scene, &keys).unwrap();
    let basin = case.basin().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let write = |file: &RowFile, stop: &AtomicBool| basin.write(file, &|_| (), stop).unwrap();
    let whole = written(write, &folder.path().join("basin.csv"), 0..60, 2);
    let factor = ((inertia + (2.0 * alpha).cos()) / (inertia + 1.0)).powi(2);
    let (mut rolls, mut falls) = (0, 0);
    for line in String::from_utf8(whole.clone()).unwrap().lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap();
        let (rate, slope) = (number(0), number(1));
        let needed = 2.0 * g * (1.0 - (alpha - slope).cos()) / (1.0 + inertia);
        let gained = 4.0 * g * alpha.sin() * slope.sin() / (1.0 + inertia);
        let (mut square, mut passes) = (rate * rate, true);
        for _ in 0..200 {
            passes &= square > needed;
            square = factor * (square + gained);
        }
        assert!((square / needed - 1.0).abs() > 1e-3, "no cell is at the boundary");
        if passes {
            rolls += 1;
            let after = square + 2.0 * g * ((alpha - slope).cos() - slope.cos()) / (1.0 + inertia);
            assert_eq!((cells[2], cells[4]), ("settled", "1"), "{line}");
            // qd of the pitch, rounded to 1e-3.
            close("rate of the cycle", number(10), after.sqrt(), 5.1e-4);
        } else {
            falls += 1;
            assert_ne!(cells[2], "settled", "{line}");
        }
    }
    assert!(rolls > 10 && falls > 10, "{rolls} roll, {falls} fall");
    let settled: u64 = basin.attractors().iter().map(|it| it.cells).sum();
    assert_eq!((settled, basin.outcomes()[0]), (rolls, ("settled", rolls)));
    // Rows are functions of their number.
    let part = written(write, &folder.path().join("part.csv"), basin.shard(2, 3).unwrap(), 1);
    let lines = |bytes: &[u8]| String::from_utf8_lossy(bytes).lines().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines(&part)[1..], lines(&whole)[21..41]);
    let svg = basin.picture(&|_| panic!("all cells are computed"), &AtomicBool::new(false)).unwrap().unwrap();
    assert!(svg.contains("A: period 1") && svg.contains("Basins of attraction"));
}

/// Closed form of the flip. Just below it the multiplier is near −1, and the motion approaches the orbit slowly and from both sides in turn:
/// its attractor has the period 1. Just above it has the period 2.
#[test]
fn attractors_below_and_above_a_flip_have_the_periods_one_and_two() {
    let e = 0.5;
    let [_, flip] = fold_and_flip(e);
    for (share, period) in [(0.99, 1), (1.01, 2)] {
        let case = shaken(e, share * flip, 2.0 * flip, 1).unwrap();
        let orbit = case.find().unwrap();
        assert!((orbit.multipliers[0].re + 1.0).abs() < 0.1, "{:?}", orbit.multipliers);
        let (z, v) = (orbit.start.q[0], orbit.start.qd[0]);
        let keys = format!(
            "scene = \"scene.toml\"\nsection.period = 0.1\n[basin]\ncycles = 1000\nx = {{ what = \"z\", from = {z}, to = {}, points = 3 }}\n\
             y = {{ what = \"qd z\", from = {v}, to = {}, points = 2 }}",
            z + 1e-3,
            v + 0.02
        );
        let problem = Problem::from_toml(&keys, &case.1.0).unwrap();
        let basin = problem.basin().unwrap();
        basin.picture(&|_| (), &AtomicBool::new(false)).unwrap();
        let disturbed: Vec<(usize, u64)> = basin.attractors().iter().map(|it| (it.period, it.cells)).collect();
        // Of the six starts one is the orbit itself, also where it is unstable.
        let expected = if period == 1 { vec![(1, 6)] } else { vec![(2, 5), (1, 1)] };
        assert_eq!(disturbed, expected, "at {share} of the flip");
    }
}
