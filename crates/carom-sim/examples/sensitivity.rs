//! Time of all derivatives of a run of a scene, and of the gradient of one number of its final state by the adjoint, beside the time of the
//! run itself; the shortest of several.
//!
//! `cargo run --release -p carom-sim --example sensitivity -- strike7 [DURATION [KEY …]]`, with keys such as `robot.mass.link2` for
//! further parameters

use carom_sim::{Parameter, Sampling, Scene};
use std::time::{Duration, Instant};

/// Time for measuring.
const LONGEST: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().ok_or("usage: sensitivity SCENE [DURATION]")?;
    let scene = Scene::from_file(format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR")))?;
    let duration = arguments.next().map_or(Ok(scene.duration), |text| text.parse())?;
    let plan = scene.plan()?;
    let mut parameters = Parameter::all(&plan.simulation);
    for key in arguments {
        parameters.push(scene.parameter(&key)?);
    }
    let found = plan.sensitivity(duration, &parameters)?;
    let run = best(|| plan.stream(duration, Sampling::default(), &mut |_| {}).map(|_| ()))?;
    let all = best(|| plan.sensitivity(duration, &parameters).map(|_| ()))?;
    let mut weights = vec![0.0; 2 * plan.simulation.chain.nv()];
    weights[0] = 1.0;
    let gradient = match found.broken {
        None => best(|| plan.linear_run(duration, &parameters)?.vjp(&weights, &[]).map(|_| ()))?,
        Some(_) => f64::NAN,
    };
    println!(
        "{name}, {duration} s: {} columns, {} events, run {:.3} ms, all derivatives {:.1} runs, one gradient {:.1} runs, {:.2} ms",
        found.names.len(),
        found.events.len(),
        run * 1e3,
        all / run,
        gradient / run,
        gradient * 1e3
    );
    if let Some(broken) = found.broken {
        println!("the derivatives end at {} s: {}", broken.time, broken.reason);
    }
    Ok(())
}

fn best<E>(mut work: impl FnMut() -> Result<(), E>) -> Result<f64, E> {
    let begin = Instant::now();
    let mut best = f64::INFINITY;
    while begin.elapsed() < LONGEST {
        let start = Instant::now();
        work()?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}
