//! What a cycle of an orbit costs, and what Newton's method does: `cargo run --release -p carom-study --example orbit_cost -- studies/compass.toml`
use carom_study::orbit::Problem;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("give a problem file")?;
    let problem = Problem::from_file(file)?;
    let begin = Instant::now();
    let orbit = problem.find()?;
    println!("orbit: {:.1} ms, {} steps", 1e3 * begin.elapsed().as_secs_f64(), orbit.iterations);
    let value = problem.range().map_or(0.0, |[from, _]| from);
    let begin = Instant::now();
    let count = 2000;
    let last = problem.cycle(value, orbit.start.clone())?.nth(count - 1).ok_or("no cycle")??;
    let each = 1e6 * begin.elapsed().as_secs_f64() / count as f64;
    let far = last.qd.iter().zip(&orbit.start.qd).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("one cycle: {each:.0} us; after {count} cycles the velocities differ by {far:.1e}");
    Ok(())
}
