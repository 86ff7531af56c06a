//! An atlas of periodic orbits: which exist and which are stable under each impact law, and which of them gain energy in an impact.
//!
//! `cargo run --release -p carom-study --example atlas` reads `studies/compass.toml` and `studies/atlas/` and writes a table in Markdown.

use carom_impact::{Flags, LAW_NAMES};
use carom_sim::{Event, EventKind, Sampling, Seen, Simulation};
use carom_study::orbit::{Orbit, OrbitError, Problem};
use std::error::Error;
use std::path::Path;

/// The laws of several contacts without exponents.
const SEVERAL: [&str; 4] = ["moreau", "poisson", "sequential", "energetic"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    println!("| orbit | law | period, s | largest multiplier | stability | energy gained in impacts, J |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let names = [
        "compass",
        "atlas/wheel",
        "atlas/ball",
        "atlas/rattle",
        "atlas/hammer2",
        "atlas/hammer3",
        "atlas/hammer7",
        "atlas/hopper",
        "atlas/block",
        "atlas/kneed",
        "atlas/biped",
        "atlas/juggler",
    ];
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
    let mut gained = 0.0;
    // An impact that is the section is at the end of the period, up to rounding.
    plan.stream(orbit.period * (1.0 + 1e-9), Sampling::default(), &mut |seen| {
        if let Seen::Event(event) = seen {
            gained += gain(&plan.simulation, event);
        }
    })?;
    let largest = orbit.multipliers.first().copied().unwrap_or_default();
    let size = if largest.im == 0.0 { format!("{:.6}", largest.re) } else { format!("{:.6} (pair)", largest.norm()) };
    Ok(format!("{:.9} | {size} | {} | {gained:.1e}", orbit.period, orbit.stability.name()))
}

/// Energy that the law of an impact adds, J: the work of its impulses in the frame of the surface; of several contacts the change of the
/// kinetic energy, where the law says that it gains.
fn gain(simulation: &Simulation, event: &Event) -> f64 {
    match &event.kind {
        EventKind::Impact { hit, .. } => hit.contact.energy_change.max(0.0),
        EventKind::Several { flags, .. } if flags.contains(Flags::ENERGY_GAIN) => {
            let mut workspace = simulation.chain.workspace();
            let Ok(mut at) = workspace.update(&simulation.chain, &event.q) else { return f64::NAN };
            let mut energy = |qd: &[f64]| at.kinetic_energy(qd).unwrap_or(f64::NAN);
            energy(&event.qd_plus) - energy(&event.qd_minus)
        }
        _ => 0.0,
    }
}
