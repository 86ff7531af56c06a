//! Error against time of motions with several lasting contacts, as a table in Markdown.
//!
//! `cargo run --release -p carom-sim --example lasting -- [SCENE.toml …]` runs each scene (by default those of the
//! repository with lasting contacts of several points, or of an arm that presses on a table) at tolerances from 1e-4 to 1e-11, and
//! compares the state at the end with that at 1e-12. The Zeno time follows from the tolerance. The time is the least of
//! five runs, without reading and planning the scene.

use carom_sim::{Moment, Plan, Sampling, Scene, Simulation, Summary};
use std::path::Path;
use std::time::Instant;

type Answer<T> = Result<T, Box<dyn std::error::Error>>;

const RUNS: usize = 5;
const DIGITS: [i32; 8] = [4, 5, 6, 7, 8, 9, 10, 11];
const EXACT: f64 = 1e-12;

fn main() -> Answer<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let named: Vec<String> = std::env::args().skip(1).collect();
    let mut scenes = Vec::new();
    for path in &named {
        scenes.push((path.clone(), Scene::from_file(path)?));
    }
    if named.is_empty() {
        for name in ["box", "table", "quadruped", "pressed"] {
            let path = format!("scenes/{name}.toml");
            scenes.push((path.clone(), Scene::from_file(root.join(&path))?));
        }
    }
    println!("| scene | tolerance | error of q at the end | time | evaluations | steps | events | time steps |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (name, scene) in scenes {
        let plan = scene.plan()?;
        let (exact, _) = run(&plan, scene.duration, EXACT, 1)?;
        for digits in DIGITS {
            let (found, time) = run(&plan, scene.duration, 10_f64.powi(-digits), RUNS)?;
            let (cost, error) = (found.statistics, distance(&found.last, &exact.last));
            println!(
                "| {name} | 1e-{digits} | {error:.1e} | {:.1} ms | {} | {} + {} rejected | {} | {} |",
                time * 1e3,
                cost.evaluations,
                cost.steps,
                cost.rejections,
                found.events,
                cost.contact_steps,
            );
        }
    }
    Ok(())
}

/// A run at a tolerance, and its least duration in s.
fn run(plan: &Plan, duration: f64, tolerance: f64, runs: usize) -> Answer<(Summary, f64)> {
    let zeno_time = Simulation::zeno_time_for(tolerance);
    let sim = Simulation { tolerance, zeno_time, ..plan.simulation.clone() };
    let mut least = f64::INFINITY;
    let mut last = None;
    for _ in 0..runs {
        let start = Instant::now();
        last = Some(sim.stream(&plan.q, &plan.qd, duration, Sampling::default(), &mut |_| {})?);
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok((last.ok_or("no run")?, least))
}

fn distance(a: &Moment, b: &Moment) -> f64 {
    a.q.iter().zip(&b.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
