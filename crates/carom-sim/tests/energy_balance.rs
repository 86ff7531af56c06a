//! One impact of a chain, from the chain over contact and law back to the joints, compared with conservation laws and
//! closed forms.

use carom_chain::ChainError;
use carom_chain::uniform_chain;
use carom_impact::*;
use carom_impact::{Flags, Mode};
use carom_sim::SimError;
use carom_sim::*;
use carom_testing::files::robot;
use nalgebra::Vector3;

const ROBOTS: [&str; 3] = ["planar2", "planar3", "arm7"];

fn random(rng: &mut fastrand::Rng, n: usize, size: f64) -> Vec<f64> {
    (0..n).map(|_| (rng.f64() * 2.0 - 1.0) * size).collect()
}

/// ½ pᵀ(u⁻ + u⁺) = T⁺ − T⁻ to 1e-12 of the energy; the left side is computed from the impulse, the right side from the joint
/// velocities.
#[test]
fn work_of_the_impulse_is_the_change_of_kinetic_energy() {
    let mut rng = fastrand::Rng::with_seed(1);
    for name in ROBOTS {
        let chain = robot(name);
        let tip = chain.frame("tip").unwrap();
        let mut hits = 0;
        for _ in 0..500 {
            let (q, qd) = (random(&mut rng, chain.nv(), 1.5), random(&mut rng, chain.nv(), 2.0));
            let mut normal = [rng.f64() - 0.5, rng.f64() - 0.5, 0.0];
            if name == "arm7" {
                normal[2] = rng.f64() - 0.5;
            }
            for e in [0.0, 0.35, 1.0] {
                let hit =
                    chain.impact(&q, &qd).at(tip).normal(normal).resolve(&Frictionless { restitution: e }).unwrap();
                let work = 0.5 * hit.impulse.dot(&(hit.u_minus + hit.u_plus));
                let change = hit.energy_after - hit.energy_before;
                assert!((work - change).abs() <= 1e-12 * hit.energy_before, "{name}: {work} against {change}");
                assert!((hit.contact.energy_change - work).abs() <= 1e-12 * hit.energy_before);
                hits += usize::from(hit.mode != Mode::Open);
                // J qd⁺ = u⁺: the joint velocities after the impact give the contact velocity that the law returned.
                let mut ws = chain.workspace();
                let kin = ws.update(&chain, &q).unwrap();
                let u = kin.point_velocity(chain.point(tip, Vector3::zeros()), &hit.qd_plus).unwrap();
                let scale = hit.u_minus.norm().max(hit.u_plus.norm());
                assert!((u - hit.u_plus).norm() <= 1e-11 * scale, "{name}: {u} against {}", hit.u_plus);
            }
        }
        assert!(hits > 300, "{name}: only {hits} of 1500 approached");
    }
}

/// Kane & Levinson's double pendulum as a chain (relative joint angles) gives the published numbers.
#[test]
fn kane_levinson_numbers_from_a_chain() {
    let chain = uniform_chain(2, 2.0, 2.0).unwrap();
    let tip = chain.frame("tip").unwrap();
    // Absolute angles (20°, 30°) from the downward vertical, rates (−0.1, −0.2) rad/s.
    let (q, qd) = ([(-70_f64).to_radians(), 10_f64.to_radians()], [-0.1, -0.1]);
    let strike = |law: &dyn Law<f64, 3>| chain.impact(&q, &qd).at(tip).normal([0.0, 1.0, 0.0]).resolve(law).unwrap();
    let (restitution, friction) = (0.5, 0.5);
    let cases: [(&dyn Law<f64, 3>, f64, f64, f64); 4] = [
        (&Whittaker { restitution, friction }, 0.0, 0.06710101, 1.587494687),
        (&Newton { restitution, friction }, 0.034824903986, 0.067101007166, 0.737153338),
        (&Poisson { restitution, friction }, 0.004896652708, 0.042363910848, 0.545077987),
        (&Energetic { restitution, friction }, 0.006306876507, 0.043529526627, 0.553187985),
    ];
    for (law, t, n, ratio) in cases {
        let hit = strike(law);
        assert!((hit.u_plus.x - t).abs() < 1e-8 && (hit.u_plus.y - n).abs() < 1e-8, "{}: {}", law.name(), hit.u_plus);
        assert!((hit.energy_ratio() - ratio).abs() < 1e-8, "{}: {}", law.name(), hit.energy_ratio());
        assert_eq!(hit.flags.contains(Flags::ENERGY_GAIN), ratio > 1.0);
        // The chain has two degrees of freedom and both move the tip: its kinetic energy equals that of the contact.
        assert!((hit.energy_before - hit.contact.energy_before).abs() < 1e-14);
        assert!((hit.energy_after - hit.contact.energy_after).abs() < 1e-14);
    }
    // dv⁺/de = J dq̇⁺/de, from 30-digit arithmetic, and the velocities of the joints.
    let at = chain.impact(&q, &qd).at(tip).normal([0.0, 1.0, 0.0]);
    let found = at.clone().derivative(&Energetic { restitution, friction }).unwrap();
    let u = at.contact().unwrap().jacobian() * &found.restitution;
    assert!((u[0] - 0.03519218).abs() < 6e-9 && (u[1] - 0.02908798).abs() < 6e-9, "{u}");
    for (qd, first, sum) in [
        (strike(&Poisson { restitution, friction }).qd_plus, -0.197179706138, 0.219606684404),
        (found.hit.qd_plus, -0.198932335971, 0.223136785377),
    ] {
        assert!((qd[0] - first).abs() < 1e-11 && (qd[0] + qd[1] - sum).abs() < 1e-11, "{qd:?}");
    }
}

#[test]
fn incomplete_and_invalid_impacts_are_refused_with_the_reason() {
    let chain = robot("planar2");
    let tip = chain.frame("tip").unwrap();
    let law = Frictionless { restitution: 0.5 };
    let strike = || chain.impact(&[0.7, -1.5], &[0.0, 0.1]);
    let said = |e: SimError| e.to_string();
    assert_eq!(said(strike().at(tip).resolve(&law).unwrap_err()), "missing contact normal: call .normal([x, y, z])");
    assert!(
        said(strike().normal([1.0, 0.0, 0.0]).resolve(&law).unwrap_err())
            .starts_with("missing contact point: call .at(")
    );
    let nan = chain.impact(&[0.7, f64::NAN], &[0.0, 0.1]).at(tip).normal([1.0, 0.0, 0.0]).resolve(&law).unwrap_err();
    assert!(matches!(nan, SimError::Chain(ChainError::NotFinite { what: "q", index: 1, .. })));
}

/// The normal is normalised: its length does not change the result, from 1e-300 to 1e300.
#[test]
fn the_length_of_the_normal_does_not_matter() {
    let chain = robot("planar2");
    let tip = chain.frame("tip").unwrap();
    let strike = |normal: [f64; 3]| {
        let law = Frictionless { restitution: 0.4 };
        chain.impact(&[0.7, -1.5], &[-0.2, 0.9]).at(tip).normal(normal).resolve(&law).unwrap().qd_plus
    };
    let unit = strike([-0.6, -0.8, 0.0]);
    for size in [1e-300, 1e-9, 1e9, 1e300] {
        let scaled = strike([-0.6 * size, -0.8 * size, 0.0]);
        assert!(scaled.iter().zip(&unit).all(|(a, b)| (a - b).abs() <= 1e-13), "{size}: {scaled:?} {unit:?}");
    }
}
