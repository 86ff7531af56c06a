//! Impact laws, also without a robot.

use crate::error::{Fault, Status};
use crate::hit::Hit;
use carom_impact::{AnyLaw, Coefficients, ImpactProblem, LAW_NAMES, Law as _, LawInfo};
use nalgebra::{SMatrix, SVector};
use std::ffi::c_char;

/// An impact law with its coefficients; it does not change. Any number of threads may use one at the same time.
pub struct Law {
    pub(crate) law: AnyLaw,
}

impl Law {
    fn new(name: &str, coefficients: Coefficients) -> Result<Self, Fault> {
        let known = || LAW_NAMES.join(", ");
        let unknown = || Fault::input(format!("no law is named '{name}': give one of {}", known()));
        let info = LawInfo::named(name).ok_or_else(unknown)?;
        let law = AnyLaw::named(info.name, coefficients).ok_or_else(unknown)?;
        let Coefficients { restitution, tangential_restitution, friction } = coefficients;
        for (what, value) in
            [("restitution", restitution), ("tangential_restitution", tangential_restitution), ("friction", friction)]
        {
            if value != 0.0 && !info.has(what) {
                let rule = format!("the law {} has no {what}: give 0", info.name);
                return Err(Fault::input(format!("{what} is {value}: {rule}")));
            }
        }
        // The coefficients are checked by an impact.
        law.resolve(&ImpactProblem::new(SMatrix::<f64, 3, 3>::identity(), SVector::from([0.0, 0.0, -1.0]))?)?;
        Ok(Self { law })
    }

    fn resolve<const D: usize>(&self, h: &[f64], u: &[f64]) -> Result<Hit, Fault> {
        let problem = ImpactProblem::<f64, D>::new(SMatrix::from_row_slice(h), SVector::from_column_slice(u))?;
        Ok(Hit::of_outcome(&self.law.resolve(&problem)?))
    }
}

/// Makes a law by its name on the command line of carom: frictionless, whittaker, newton, poisson, energetic (Stronge), chatterjee-ruina,
/// brach or smith. `restitution`: 0 to 1. `friction`: Coulomb's coefficient, 0 or more; of brach the size of the impulse ratio.
/// `tangential_restitution`: -1 to 1, of chatterjee-ruina. Give 0 for a coefficient that the law does not have. The law is freed by
/// carom_law_free. Refused input: an unknown name, a coefficient out of its range or that the law does not have.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_law_create(
    name: *const c_char,
    restitution: f64,
    friction: f64,
    tangential_restitution: f64,
    law: *mut *mut Law,
) -> Status {
    call!(carom_law_create, |text name, created law| {
        law.give(Law::new(name, Coefficients { restitution, tangential_restitution, friction })?);
        Ok(())
    })
}

/// Frees a law; nothing for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_law_free(law: *mut Law) {
    free!(carom_law_free, free law);
}

/// The impact of one contact, without a robot: for the laws inside another simulator. `delassus` is the Delassus matrix H of the contact
/// (1/kg), row by row, symmetric and positive semidefinite; `velocity` the contact velocity u⁻ (m/s). Both are in contact axes: the
/// tangents first, then the normal, which points from the environment to the robot, so that an approach has a negative last
/// entry. In space H has 9 and u⁻ 3 numbers, in the plane 4 and 2.
///
/// `hit` is in contact axes, too: the velocity afterwards is u⁺ = u⁻ + H p for its impulse p; its energies are those that impulses at
/// the contact can change. In the plane the impulse and the velocities are {tangent, normal, 0}. Allocates nothing, but for a hodograph
/// that needs integration and for the message of a fault.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_law_resolve(
    law: *const Law,
    delassus: *const f64,
    delassus_length: usize,
    velocity: *const f64,
    velocity_length: usize,
    hit: *mut Hit,
) -> Status {
    call!(
        carom_law_resolve,
        |shared law, input delassus [delassus_length], input velocity [velocity_length], place hit| {
            hit.put(match (velocity.len(), delassus.len()) {
                (2, 4) => law.resolve::<2>(delassus, velocity)?,
                (3, 9) => law.resolve::<3>(delassus, velocity)?,
                (u, h) => {
                    let needed = "9 and 3 are needed in space, 4 and 2 in the plane";
                    return Err(Fault::invalid(format!("delassus has {h} numbers and velocity {u}: {needed}")));
                }
            });
            Ok(())
        }
    )
}
