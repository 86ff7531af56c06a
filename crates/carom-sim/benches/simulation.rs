//! Run times with and without the reductions of the plan, and run time against accuracy, as two tables in Markdown:
//! `cargo bench -p carom-sim --bench simulation`.
//!
//! Ratios of run times are measured in one process, with both runs in turn, and the median of the ratios is printed, so that
//! other load on the machine affects both alike.

use carom_sim::{Integrator, Moment, Sampling, Scene, Simulation, Summary};
use carom_testing::build::{arm_with_hand, two_arms};
use carom_testing::files::path;
use std::path::Path;
use std::time::{Duration, Instant};

type Answer<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Answer<()> {
    let folder = std::env::temp_dir().join(format!("carom-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let answer = ratios(&folder).and_then(|()| work_against_error());
    std::fs::remove_dir_all(&folder)?;
    answer
}

/// A whole run without samples and segments.
fn run(sim: &Simulation, q: &[f64], qd: &[f64], duration: f64) -> Answer<(Summary, Duration)> {
    let start = Instant::now();
    let summary = sim.stream(q, qd, duration, Sampling::default(), &mut |_| {})?;
    Ok((summary, start.elapsed()))
}

// ---------------------------------------------------------------------------------------------------------------------
// Planned against full
// ---------------------------------------------------------------------------------------------------------------------

fn ratios(folder: &Path) -> Answer<()> {
    let planar2 = std::fs::read_to_string(path("scenes/planar2.toml"))?;
    let planar2 = planar2.replace("../robots", &path("robots").display().to_string());
    std::fs::write(folder.join("arms.urdf"), two_arms())?;
    std::fs::write(folder.join("hand.urdf"), arm_with_hand())?;
    println!("| scene | planned | `model = \"full\"` | full / planned | velocities, touches: planned, full |");
    println!("| --- | --- | --- | --- | --- |");
    for (name, text) in
        [("planar2.toml", planar2.as_str()), ("two arms, one at the wall", ARMS), ("box for a hand", PALM)]
    {
        let [planned, full] = ["auto", "full"].map(|model| -> Answer<_> {
            let path = folder.join("scene.toml");
            std::fs::write(&path, text.replace("[run]", &format!("[run]\nmodel = \"{model}\"")))?;
            let scene = Scene::from_file(&path)?;
            Ok((scene.plan()?, scene.duration))
        });
        let ((planned, duration), (full, _)) = (planned?, full?);
        let (mut times, mut shares) = ([Vec::new(), Vec::new()], Vec::new());
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(4) {
            let (_, less) = run(&planned.simulation, &planned.q, &planned.qd, duration)?;
            let (_, all) = run(&full.simulation, &full.q, &full.qd, duration)?;
            times[0].push(less.as_secs_f64() * 1e3);
            times[1].push(all.as_secs_f64() * 1e3);
            shares.push(all.as_secs_f64() / less.as_secs_f64());
        }
        let size = |sim: &Simulation| format!("{}, {}", sim.chain.nv(), sim.touches.len());
        println!(
            "| {name} | {:.3} ms | {:.3} ms | {:.2} | {}; {} |",
            median(&mut times[0]),
            median(&mut times[1]),
            median(&mut shares),
            size(&planned.simulation),
            size(&full.simulation)
        );
    }
    Ok(())
}

fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

const ARMS: &str = r#"
[robot]
urdf = "arms.urdf"
q = [0.3, 0.4, 0.9, -1.2]
qd = [1, 0, -0.5, 0.2]
[[surface]]
shape = { halfspace = { point = [0.75, 0, 0], normal = [-1, 0, 0] } }
[contact]
law = "poisson"
restitution = 0.6
friction = 0.1
[run]
duration = 1.0
gravity = [0, -9.81, 0]
"#;

const PALM: &str = r#"
[robot]
urdf = "hand.urdf"
q = [0.5, -0.7]
qd = [-0.6, 0.3]
[[surface]]
shape = { halfspace = { point = [0, -0.1, 0], normal = [0, 1, 0] } }
[contact]
law = "newton"
restitution = 0.6
[run]
duration = 1.2
"#;

// ---------------------------------------------------------------------------------------------------------------------
// Work against error
// ---------------------------------------------------------------------------------------------------------------------

/// The paper's arm from 20 mm before the wall to 0.4 s later, through one impact, under gravity. There is no limit on the
/// step, so that only the tolerance determines it.
fn work_against_error() -> Answer<()> {
    let scene = Scene::from_file(path("scenes/planar2.toml"))?;
    let plan = scene.plan()?;
    let mut sim = Simulation { max_step: 1.0, gravity: [0.0, -9.81, 0.0].into(), ..plan.simulation };
    sim.touches.retain(|touch| touch.link() == Some("tip"));
    let (q, qd, duration) = ([0.85, -1.65], [-0.3, 1.5], 0.4);
    let at = |integrator, tolerance| run(&Simulation { integrator, tolerance, ..sim.clone() }, &q, &qd, duration);
    let (exact, _) = at(Integrator::DormandPrince, 1e-13)?;
    println!("\nThe evaluations of Radau do not include those of its Jacobians.");
    println!("\n| integrator | tolerance | error of q, q̇ at the end | evaluations | steps | rejected | time |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (name, integrator) in [("Dormand–Prince 8(5,3)", Integrator::DormandPrince), ("Radau IIA 5", Integrator::Radau)]
    {
        for digits in 4..=12 {
            let tolerance = 10_f64.powi(-digits);
            let mut times = Vec::new();
            let mut last = exact.clone();
            for _ in 0..9 {
                let (summary, time) = at(integrator, tolerance)?;
                times.push(time.as_secs_f64() * 1e6);
                last = summary;
            }
            assert_eq!((last.events, exact.events), (1, 1), "one impact");
            let (cost, error) = (last.statistics, distance(&last.last, &exact.last));
            println!(
                "| {name} | 1e-{digits} | {error:.1e} | {} | {} | {} | {:.0} µs |",
                cost.evaluations,
                cost.steps,
                cost.rejections,
                median(&mut times)
            );
        }
    }
    Ok(())
}

fn distance(a: &Moment, b: &Moment) -> f64 {
    let pairs = a.q.iter().zip(&b.q).chain(a.qd.iter().zip(&b.qd));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
