//! The double pendulum of Kane and Levinson (*Dynamics*, 1985), its energy paradox, and its jam. Two uniform rods, m =
//! l = 1, pinned at the top, at 20° and 30° from the vertical, with angular velocities -0.1 and -0.2 rad/s; the tip
//! strikes a horizontal floor; e = μ = 0.5. Parameters are theirs; digits were computed independently of this crate,
//! those of the laws by Routh's method with 30 digits.

use crate::common::{FOLLOWING, close, pendulum, rough};
use carom_impact::{Energetic, Flags, ImpactOutcome, ImpactProblem, Law, Mode, Phase, law_by_name};
use nalgebra::vector;

const E: f64 = 0.5;
const MU: f64 = 0.5;

fn outcome(law: &str) -> ImpactOutcome<f64, 2> {
    law_by_name::<2>(law, rough(E, MU)).unwrap().resolve(&pendulum()).unwrap()
}

#[test]
fn problem_has_the_reference_digits() {
    let p = pendulum();
    close("A", p.delassus()[(0, 0)], 2.440338045696, 5e-13);
    close("B", p.delassus()[(0, 1)], 1.521308658011, 5e-13);
    close("C", p.delassus()[(1, 1)], 1.009560290504, 5e-13);
    close("v_t", p.u_minus()[0], -0.267174342835, 5e-13);
    close("v_n", p.u_minus()[1], -0.134202014333, 5e-13);
    close("approach", p.approach_speed(), 0.134202014333, 5e-13);
    close("T", p.kinetic_energy(p.u_minus()), 0.0231814108634554, 1e-15);
    close("mu_stick", p.mu_stick(), 0.623400787, 5e-10);
    close("mu_jam", p.mu_jam().unwrap(), 0.663613058, 5e-10);
}

#[test]
fn velocities_and_energies_have_the_reference_digits() {
    for (law, v_t, v_n, ratio, digits) in [
        ("frictionless", 0.03616963, 0.06710101, 0.711412702, 5e-9),
        ("whittaker", 0.0, 0.06710101, 1.587494687, 5e-9),
        ("newton", 0.034824903986, 0.067101007166, 0.737153338, 5e-13),
        ("poisson", 0.004896652708, 0.042363910848, 0.545077987, 5e-13),
        ("energetic", 0.006306876507, 0.043529526627, 0.553187985, 5e-13),
    ] {
        let hit = outcome(law);
        close(law, hit.u_plus[0], v_t, digits);
        close(law, hit.u_plus[1], v_n, digits);
        close(law, hit.energy_ratio(), ratio, 5e-10);
        close(law, hit.energy_before + hit.energy_change, hit.energy_after, 1e-16);
        assert_eq!(hit.law, law);
        // The energy paradox: with stick, and not without friction.
        assert_eq!(hit.flags.contains(Flags::ENERGY_GAIN), law == "whittaker");
        assert_eq!(hit.mode == Mode::Stick, law == "whittaker");
    }
}

#[test]
fn slip_stops_in_restitution_and_reverses() {
    for law in FOLLOWING {
        let hit = outcome(law);
        assert_eq!((hit.mode, hit.slip_end), (Mode::ReverseSlip, Some(Phase::Restitution)), "{law}");

        // The path follows from the outcome: P_n = (1 + e_P) pc, W_n = (1 - e_E²) Wc, and with s = -1 first and +1
        // then, P_t = μ p1 - μ (P_n - p1).
        let p_n = hit.impulse[1];
        let pc = p_n / (1.0 + hit.poisson.unwrap());
        let wc = hit.normal_work / (1.0 - hit.energetic.unwrap().powi(2));
        let p1 = 0.5 * (hit.impulse[0] / MU + p_n);
        close("pc", pc, 0.07581115467781747, 1e-15);
        close("Wc", wc, -0.005087004833320453, 1e-15);
        close("p1", p1, 0.0974563260904499, 1e-15);
    }
}

/// Friction beyond `mu_jam` with slip towards `sign B`: the normal velocity first becomes more negative, and the
/// contact separates faster than it approached while the energy decreases.
#[test]
fn jam_rebounds_faster_than_the_approach_but_loses_energy() {
    let problem = ImpactProblem::new(*pendulum().delassus(), vector![0.3, -0.134201]).unwrap();
    let friction = 0.8;
    assert!(friction > problem.mu_jam().unwrap());
    let mut faster = 0;
    for restitution in [0.0, 0.5, 0.9, 1.0] {
        let hit = Energetic { restitution, friction }.resolve(&problem).unwrap();
        assert_eq!(hit.flags, Flags::JAM);
        assert_eq!((hit.mode, hit.slip_end), (Mode::Stick, Some(Phase::Compression)));
        assert!(hit.energy_change < 0.0);
        faster += usize::from(hit.newton.unwrap() > 1.0);
    }
    // The first normal impulse lowers v_n: dv = H (-μ, 1) dp.
    let first = problem.delassus() * vector![-friction, 1.0];
    assert!(first[0] < 0.0 && first[1] < 0.0, "slip falls, approach grows: {first:?}");
    assert!(faster >= 2, "{faster} rebounds were faster than the approach");
}
