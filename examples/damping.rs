//! Compliant impacts: the restitution that the published damping formulas of a Hunt–Crossley contact give, and Newton's
//! cradle with rigid and with compliant contacts.
//!
//! `cargo run --example damping`

use carom::impact::{
    Accuracy, Constraint, Damping, HuntCrossley, ImpactError, NormalForce, Order, SeveralProblem, TangentialForce,
    compliant_impact, restitution_obtained,
};
use carom::nalgebra::{DVector, dmatrix, dvector};

const ASKED: [f64; 6] = [0.2, 0.35, 0.5, 0.7, 0.8, 0.9];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("F = k dⁿ (1 + a w): restitution obtained, the same for every mass, stiffness, exponent and speed\n");
    print!("{:20}", "requested e");
    ASKED.iter().for_each(|e| print!("{e:7.3}"));
    println!();
    for formula in Damping::ALL {
        print!("{:20}", formula.name());
        for e in ASKED {
            print!("{:7.3}", formula.number(e).map_or(f64::NAN, restitution_obtained));
        }
        println!();
    }

    println!("\nNewton's cradle: three balls of 1 kg, the first at 1 m/s, e = 1; velocities after the impact, m/s\n");
    let (delassus, before) = (dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0]);
    let elastic = Constraint::Stop { restitution: 1.0 };
    let rigid = SeveralProblem::new(delassus.clone(), before.clone(), vec![elastic; 2])?;
    show("rigid, simultaneous (Moreau)", &rigid.simultaneous(&Accuracy::default(), None)?.impulse);
    let one_by_one = rigid.sequential(&Order::MostApproaching, &Accuracy::default());
    show("rigid, sequential", &one_by_one?.impulse);
    for (what, exponent, [first, second]) in [
        ("linear springs", 1.0, [1e6, 1e6]),
        ("Hertz", 1.5, [1e9, 1e9]),
        ("Hertz, first contact ten times stiffer", 1.5, [1e10, 1e9]),
        ("Hertz, second contact ten times stiffer", 1.5, [1e9, 1e10]),
    ] {
        let law = |stiffness| Ok(NormalForce::HuntCrossley(HuntCrossley::new(stiffness, exponent, 1.0)?));
        let contacts = [first, second].map(law).into_iter().collect::<Result<Vec<_>, ImpactError>>()?;
        let contacts: Vec<_> = contacts.into_iter().map(|law| (law, TangentialForce::Frictionless)).collect();
        show(what, &compliant_impact(&delassus, &before, &contacts)?.impulse);
    }
    Ok(())
}

/// Prints the velocities of the balls after the impulses between them.
fn show(what: &str, impulse: &DVector<f64>) {
    let balls = [1.0 - impulse[0], impulse[0] - impulse[1], impulse[1]];
    println!("{what:44}{:10.6}{:10.6}{:10.6}", balls[0], balls[1], balls[2]);
}
