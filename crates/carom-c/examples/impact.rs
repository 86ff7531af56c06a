//! The impact of `impact.c` by the Rust library, with the same lines. Usage: impact ROBOT.urdf

#![expect(clippy::approx_constant, reason = "the digits of the tutorial")]

use carom_sim::Impacts;

fn print(name: &str, numbers: &[f64]) {
    print!("{name}");
    numbers.iter().for_each(|x| print!(" {:?}", x + 0.0)); // without the sign of a zero
    println!();
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let urdf = std::env::args().nth(1).ok_or("usage: impact ROBOT.urdf")?;
    let arm = carom_chain::Chain::from_urdf_file(urdf)?;
    let law = carom_impact::Energetic { restitution: 0.35, friction: 0.2 };
    let strike = arm.impact(&[0.7854, -1.5708], &[-0.15, 0.6]).at(arm.frame("tip")?).normal([-1.0, 0.0, 0.0]);
    let hit = strike.resolve(&law)?;
    print("qd_plus", &hit.qd_plus);
    print("impulse", hit.impulse.as_slice());
    print("u_minus", hit.u_minus.as_slice());
    print("u_plus", hit.u_plus.as_slice());
    print("energy_before", &[hit.energy_before]);
    print("energy_after", &[hit.energy_after]);
    print("normal_work", &[hit.contact.normal_work]);
    print("friction_work", &[hit.contact.friction_work]);
    Ok(())
}
