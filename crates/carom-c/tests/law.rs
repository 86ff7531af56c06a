//! Laws on plain numbers.

use crate::own::*;
use carom_c::*;
use carom_impact::{AnyLaw, Coefficients, ImpactProblem, LAW_NAMES, LAWS, Law as _};
use nalgebra::{SMatrix, SVector};
use std::ptr;

const H3: [f64; 9] = [2.0, 0.3, -0.5, 0.3, 1.7, 0.4, -0.5, 0.4, 1.1];
const H2: [f64; 4] = [2.0, -0.5, -0.5, 1.1];

fn solved(law: &Own<Law>, h: &[f64], u: &[f64]) -> (Status, Hit) {
    let mut hit = blank();
    // SAFETY: valid arguments.
    let status = unsafe { carom_law_resolve(law.at, h.as_ptr(), h.len(), u.as_ptr(), u.len(), &mut hit) };
    (status, hit)
}

fn same<const D: usize>(law: &Own<Law>, rust: &AnyLaw, h: &[f64], u: &[f64]) {
    let problem = ImpactProblem::<f64, D>::new(SMatrix::from_row_slice(h), SVector::from_column_slice(u)).unwrap();
    let (expected, (status, hit)) = (rust.resolve(&problem).unwrap(), solved(law, h, u));
    assert_eq!(status, Status::CAROM_OK, "{}", error());
    for (own, rust) in [(hit.impulse, expected.impulse), (hit.u_minus, expected.u_minus), (hit.u_plus, expected.u_plus)]
    {
        assert!(own.iter().enumerate().all(|(k, x)| *x == if k < D { rust[k] } else { 0.0 }), "{own:?} {rust}");
    }
    let works = (hit.normal_work, hit.friction_work, hit.energy_before, hit.energy_after);
    assert_eq!(works, (expected.normal_work, expected.friction_work, expected.energy_before, expected.energy_after));
    assert_eq!((hit.mode, hit.status, hit.drive_work), (expected.mode.into(), Status::CAROM_OK, 0.0));
}

#[test]
fn every_law_on_plain_numbers_equals_the_rust_law_bit_by_bit() {
    for info in LAWS {
        let has = |what: &str, value: f64| if info.has(what) { value } else { 0.0 };
        let (restitution, friction, tangential_restitution) =
            (0.4, has("friction", 0.3), has("tangential_restitution", 0.2));
        let name = c(info.name);
        let own = Own::new(carom_law_free, |at| {
            // SAFETY: valid arguments.
            unsafe { carom_law_create(name.as_ptr(), restitution, friction, tangential_restitution, at) }
        });
        let coefficients = Coefficients { restitution, friction, tangential_restitution };
        let rust = AnyLaw::named(info.name, coefficients).unwrap();
        for u in [[0.4, -0.2, -1.0], [2.0, 1.0, -0.1], [0.0, 0.0, -1.0], [0.5, 0.1, 0.7]] {
            same::<3>(&own, &rust, &H3, &u);
            same::<2>(&own, &rust, &H2, &[u[0], u[2]]);
        }
    }
}

#[test]
fn a_contact_that_does_not_approach_has_no_impulse_and_a_flag() {
    let (status, hit) = solved(&law("energetic", 0.5, 0.3), &H3, &[0.5, 0.1, 0.7]);
    assert_eq!((status, hit.mode, hit.flags), (Status::CAROM_OK, Mode::CAROM_OPEN, CAROM_NO_APPROACH));
    assert_eq!((hit.impulse, hit.u_plus), ([0.0; 3], [0.5, 0.1, 0.7]));
}

#[test]
fn the_bits_of_the_flags_are_those_of_the_rust_flags() {
    // A rod at 60° whose lower end slides on a floor as rough as 1.5 jams, and two outcomes satisfy the law.
    let h = [3.25, -1.299038105676658, -1.299038105676658, 1.75];
    let (_, hit) = solved(&law("energetic", 0.0, 1.5), &h, &[-1.0, 0.0]);
    assert_eq!(hit.flags & (CAROM_JAM | CAROM_NON_UNIQUE), CAROM_JAM | CAROM_NON_UNIQUE, "{}", hit.flags);
    let (_, hit) = solved(&law("newton", 1.0, 0.5), &[1.0, -0.6, -0.6, 1.0], &[0.8, -1.0]);
    let problem =
        ImpactProblem::new(SMatrix::<f64, 2, 2>::new(1.0, -0.6, -0.6, 1.0), SVector::from([0.8, -1.0])).unwrap();
    let rust = carom_impact::Newton { restitution: 1.0, friction: 0.5 }.resolve(&problem).unwrap();
    assert!(rust.flags.contains(carom_impact::Flags::ENERGY_GAIN) && hit.flags == CAROM_ENERGY_GAIN, "{}", rust.flags);
}

#[test]
fn laws_are_refused_by_name_range_and_missing_coefficient() {
    let refused = |name: &str, given: [f64; 3], message: &str| {
        let mut law = ptr::dangling_mut();
        // SAFETY: valid arguments.
        let status = unsafe { carom_law_create(c(name).as_ptr(), given[0], given[1], given[2], &mut law) };
        assert!(status == Status::CAROM_REFUSED_INPUT && law.is_null(), "{name}");
        assert_eq!(error(), format!("carom_law_create: {message}"));
    };
    let names = LAW_NAMES.join(", ");
    refused("hertz", [0.5, 0.2, 0.0], &format!("no law is named 'hertz': give one of {names}"));
    refused("newton", [1.5, 0.2, 0.0], "restitution 1.5 is outside [0, 1]: 0 is no rebound, 1 a full rebound");
    refused("frictionless", [0.5, 0.2, 0.0], "friction is 0.2: the law frictionless has no friction: give 0");
    let why = "tangential_restitution is 0.3: the law energetic has no tangential_restitution: give 0";
    refused("energetic", [0.5, 0.2, 0.3], why);
}

#[test]
fn sizes_of_plane_and_space_are_told_apart_and_others_refused() {
    let law = law("energetic", 0.5, 0.3);
    let (status, _) = solved(&law, &H3, &[0.5, -1.0]);
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    let needed = "9 and 3 are needed in space, 4 and 2 in the plane";
    assert_eq!(error(), format!("carom_law_resolve: delassus has 9 numbers and velocity 2: {needed}"));
    let (status, _) = solved(&law, &[1.0, 0.5, 0.2, 1.0], &[0.5, -1.0]);
    assert_eq!(status, Status::CAROM_REFUSED_INPUT, "{}", error());
    let (status, _) = solved(&law, &[1.0, 0.0, 0.0, 0.0], &[0.5, -1.0]);
    assert_eq!(status, Status::CAROM_REFUSED_PHYSICS, "{}", error());
    assert!(error().contains("the normal direction is singular"), "{}", error());
}
