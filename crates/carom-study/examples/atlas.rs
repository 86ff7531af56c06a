//! An atlas of periodic orbits: which exist and which are stable under each impact law, and which of them gain energy in an impact.
//!
//! `cargo run --release -p carom-study --example atlas` reads `studies/compass.toml` and `studies/atlas/` and writes a table in Markdown.

use carom_impact::LAW_NAMES;
use carom_sim::Sampling;
use carom_study::orbit::{Orbit, OrbitError, Problem};
use std::error::Error;
use std::path::Path;

/// The laws of several contacts without exponents.
const SEVERAL: [&str; 4] = ["moreau", "poisson", "sequential", "energetic"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    println!("| orbit | law | period, s | largest multiplier | stability | energy gained in impacts, J |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let names = ["compass", "atlas/wheel", "atlas/ball", "atlas/rattle", "atlas/hammer2"];
    for name in names {
        let file = root.join(format!("studies/{name}.toml"));
        let text = std::fs::read_to_string(&file)?;
        let folder = file.parent().ok_or("a file has a folder")?;
        let own = Problem::from_file(&file)?.find()?;
        let several = own.events.iter().any(|event| event.what.starts_with("several"));
        let (key, laws): (&str, &[&str]) = if several { ("several", &SEVERAL) } else { ("law", &LAW_NAMES) };
        for law in laws {
            let problem = Problem::from_toml(&format!("with = {{ \"contact.{key}\" = \"{law}\" }}\n{text}"), folder);
            let row = problem.and_then(|problem| row(&problem));
            let name = name.trim_start_matches("atlas/");
            match row {
                Ok(row) => println!("| {name} | {law} | {row} |"),
                Err(error) => println!("| {name} | {law} | none: {error} | | | |"),
            }
        }
    }
    Ok(())
}

/// Of the orbit of a problem.
fn row(problem: &Problem) -> Result<String, OrbitError> {
    let orbit: Orbit = problem.find()?;
    let plan = problem.plan_of(&orbit)?;
    let run = plan.stream(orbit.period, Sampling::default(), &mut |_| {})?;
    let largest = orbit.multipliers.first().copied().unwrap_or_default();
    let size = if largest.im == 0.0 { format!("{:.6}", largest.re) } else { format!("{:.6} (pair)", largest.norm()) };
    let gained = run.statistics.energy_gained;
    Ok(format!("{:.9} | {size} | {} | {gained:.1e}", orbit.period, orbit.stability.name()))
}
