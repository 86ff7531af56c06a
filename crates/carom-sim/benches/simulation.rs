//! Run times with and without the reductions of the plan, and run time against accuracy, as two tables in Markdown:
//! `cargo bench -p carom-sim --bench simulation`.
//!
//! Ratios of run times are measured in one process, with both runs in turn, and the median of the ratios is printed, so that
//! other load on the machine affects both alike.

use carom_sim::{Integrator, Moment, Sampling, Scene, Simulation, Summary};
use std::path::{Path, PathBuf};
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
    let planar2 = std::fs::read_to_string(root("scenes/planar2.toml"))?;
    let planar2 = planar2.replace("../robots", &root("robots").display().to_string());
    std::fs::write(folder.join("arms.urdf"), two_arms())?;
    std::fs::write(folder.join("hand.urdf"), HAND)?;
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

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// Two arms of two links on one base; the right one has a ball at its end.
fn two_arms() -> String {
    let arm = |side: &str, at: f64| {
        let link = |k: u8, collision: &str| {
            format!(
                r#"<link name="{side}{k}"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
                <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>{collision}</link>"#
            )
        };
        let joint = |k: u8, parent: &str, at: f64| {
            format!(
                r#"<joint name="{side}_joint{k}" type="continuous"><parent link="{parent}"/><child link="{side}{k}"/>
                <origin xyz="{at} 0 0"/><axis xyz="0 0 1"/></joint>"#
            )
        };
        let ball = r#"<collision><origin xyz="0.3 0 0"/><geometry><sphere radius="0.02"/></geometry></collision>"#;
        let ball = if side == "right" { ball } else { "" };
        [link(1, ""), link(2, ball), joint(1, "base", at), joint(2, &format!("{side}1"), 0.3)].concat()
    };
    format!(r#"<robot name="two arms"><link name="base"/>{}{}</robot>"#, arm("left", -1.0), arm("right", 0.2))
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

const HAND: &str = r#"<robot name="hand"><link name="base"/>
    <link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="2"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
    <link name="hand"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
      <collision><origin xyz="0.1 0 0"/><geometry><box size="0.2 0.1 0.06"/></geometry></collision></link>
    <joint name="shoulder" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
    <joint name="wrist" type="continuous"><parent link="arm"/><child link="hand"/><origin xyz="0.6 0 0"/>
      <axis xyz="0 0 1"/></joint></robot>"#;

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
    let scene = Scene::from_file(root("scenes/planar2.toml"))?;
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
