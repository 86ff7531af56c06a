//! The experiment of Pagilla & Yu (2004) from a URDF: two elbows, four angles, three speeds, Table I's Newton
//! coefficients. Prints the velocities of the tip and a check of the paper's claims, and writes `planar2.rrd`.
//!
//! `cargo run --example planar2`, then `rerun planar2.rrd`

use carom::chain::Chain;
use carom_evidence::paper::{self, Run};
use std::fmt::Write;

#[cfg(feature = "rerun")]
#[path = "planar2/recording.rs"]
mod recording;

const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arm = Chain::from_urdf_file(URDF)?;
    let runs = paper::experiment(&arm)?;

    println!(
        "Tip of {} against a wall, frictionless, Newton's e of Table I (a stand-in arm, see robots/).",
        arm.name()
    );
    println!("v_t is the velocity down the wall, v_n the velocity away from it, T the kinetic energy.\n");
    println!(" elbow  speed  angle     e      v_t-      v_t+      v_n+   T lost  T+/T-  tangential");
    println!("          m/s    deg              m/s       m/s       m/s       mJ         velocity");
    for run in &runs {
        println!("{}", line(run));
    }

    println!("\nWhat the paper says, and what this model says:");
    for claim in paper::claims(&arm, &runs)? {
        println!("  {} {}\n      {}", if claim.holds { "yes" } else { "NO " }, claim.statement, claim.evidence);
    }
    record(&arm, &runs)
}

fn line(run: &Run) -> String {
    let ((before, after), (_, rebound)) = (run.tangential(), run.normal());
    format!(
        "{:>6} {:>6.1} {:>6.0} {:>5.2} {:>9.5} {:>9.5} {:>9.5} {:>8.3} {:>6.4}  {}",
        run.elbow.name(),
        run.speed,
        run.angle_deg,
        run.restitution,
        before,
        after,
        rebound,
        run.hit.energy_loss() * 1e3,
        run.hit.energy_ratio(),
        run.tangential_change().name()
    )
}

#[cfg(feature = "rerun")]
fn record(arm: &Chain, runs: &[Run]) -> Result<(), Box<dyn std::error::Error>> {
    let path = std::path::Path::new("planar2.rrd");
    recording::record(arm, runs, &table(runs), path)?;
    println!("\nRecorded to {}: open it with `rerun {}`.", path.display(), path.display());
    Ok(())
}

#[cfg(not(feature = "rerun"))]
fn record(_: &Chain, runs: &[Run]) -> Result<(), Box<dyn std::error::Error>> {
    println!("\nBuilt without the feature `rerun`: no recording. As Markdown, the table is\n\n{}", table(runs));
    Ok(())
}

fn table(runs: &[Run]) -> String {
    let mut text = String::from(
        "The views show the tip at a wall with 45° and 0.2 m/s, and the impact at 0.6 s. The table lists all runs.\n\n\
         **Map** of the tangential velocity: red, it reverses; blue, it decreases; yellow, it increases.\n\n\
         **Arrows:** blue, velocity before; red, after; orange, impulse.\n\n\
         | elbow | m/s | angle | e | v_t⁻ | v_t⁺ | v_n⁺ | lost mJ | |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for run in runs {
        let ((before, after), (_, rebound)) = (run.tangential(), run.normal());
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {before:.4} | {after:.4} | {rebound:.4} | {:.2} | {} |",
            run.elbow.name(),
            run.speed,
            run.angle_deg,
            run.restitution,
            run.hit.energy_loss() * 1e3,
            run.tangential_change().name()
        ); // writing to a String can't fail
    }
    text
}
