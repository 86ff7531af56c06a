//! The result of one impact.

use crate::error::Status;
use carom_impact::{Flags, ImpactOutcome};
use carom_sim::ChainImpact;
use nalgebra::{SVector, Vector3};

/// How the contact moves along its surface at the end of an impact.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(non_camel_case_types)]
pub enum Mode {
    /// No impact took place: the contact does not approach.
    CAROM_OPEN = 0,
    /// No slip.
    CAROM_STICK = 1,
    /// Slip in the initial direction; in space, at most a right angle from it.
    CAROM_SLIP = 2,
    /// Slip opposite to the initial direction; in space, more than a right angle from it.
    CAROM_REVERSE_SLIP = 3,
}

impl From<carom_impact::Mode> for Mode {
    fn from(mode: carom_impact::Mode) -> Self {
        match mode {
            carom_impact::Mode::Open => Self::CAROM_OPEN,
            carom_impact::Mode::Stick => Self::CAROM_STICK,
            carom_impact::Mode::Slip => Self::CAROM_SLIP,
            carom_impact::Mode::ReverseSlip => Self::CAROM_REVERSE_SLIP,
        }
    }
}

/// Bit of carom_hit.flags: the law has increased the kinetic energy.
pub const CAROM_ENERGY_GAIN: u32 = 1;
/// Bit of carom_hit.flags: friction jams (Painlevé): the normal impulse drives the contact deeper at first.
pub const CAROM_JAM: u32 = 2;
/// Bit of carom_hit.flags: the outcome depends on a direction in which no impulse moves the contact.
pub const CAROM_SINGULAR: u32 = 4;
/// Bit of carom_hit.flags: the approach is so slow beside the slip that rounding shows in angles and ratios.
pub const CAROM_GRAZING: u32 = 8;
/// Bit of carom_hit.flags: more than one outcome satisfies the law.
pub const CAROM_NON_UNIQUE: u32 = 16;
/// Bit of carom_hit.flags: the contact does not approach; the impulse is zero.
pub const CAROM_NO_APPROACH: u32 = 32;

const FLAGS: [(Flags, u32); 6] = [
    (Flags::ENERGY_GAIN, CAROM_ENERGY_GAIN),
    (Flags::JAM, CAROM_JAM),
    (Flags::SINGULAR, CAROM_SINGULAR),
    (Flags::GRAZING, CAROM_GRAZING),
    (Flags::NON_UNIQUE, CAROM_NON_UNIQUE),
    (Flags::NO_APPROACH, CAROM_NO_APPROACH),
];

fn bits(flags: Flags) -> u32 {
    FLAGS.iter().filter(|(flag, _)| flags.contains(*flag)).map(|(_, bit)| bit).sum()
}

/// The result of one impact: what happens at the contact point. World axes, but for carom_law_resolve.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Impulse on the robot, N s.
    pub impulse: [f64; 3],
    /// Velocity of the contact point before, m/s.
    pub u_minus: [f64; 3],
    /// Velocity of the contact point after, m/s.
    pub u_plus: [f64; 3],
    /// Kinetic energy of the robot before, J.
    pub energy_before: f64,
    /// Kinetic energy of the robot after, J.
    pub energy_after: f64,
    /// Work of the normal impulse, J.
    pub normal_work: f64,
    /// Work of the tangential impulse, J.
    pub friction_work: f64,
    /// Work of the drives of locked joints, J; 0 with free joints.
    pub drive_work: f64,
    /// Contact mode at the end of the impact.
    pub mode: Mode,
    /// Notes: a sum of CAROM_ENERGY_GAIN, CAROM_JAM, CAROM_SINGULAR, CAROM_GRAZING, CAROM_NON_UNIQUE and CAROM_NO_APPROACH.
    pub flags: u32,
    /// Of carom_strike_many: CAROM_OK, or why this state has no result; its numbers are then NaN.
    pub status: Status,
}

impl Hit {
    pub(crate) fn of_chain(hit: &ChainImpact) -> Self {
        let ChainImpact {
            impulse, u_minus, u_plus, energy_before, energy_after, drive_work, mode, flags, contact, ..
        } = hit;
        Self {
            impulse: (*impulse).into(),
            u_minus: (*u_minus).into(),
            u_plus: (*u_plus).into(),
            energy_before: *energy_before,
            energy_after: *energy_after,
            normal_work: contact.normal_work,
            friction_work: contact.friction_work,
            drive_work: *drive_work,
            mode: (*mode).into(),
            flags: bits(*flags),
            status: Status::CAROM_OK,
        }
    }

    pub(crate) fn of_outcome<const D: usize>(hit: &ImpactOutcome<f64, D>) -> Self {
        let three = |x: &SVector<f64, D>| std::array::from_fn(|i| if i < D { x[i] } else { 0.0 });
        Self {
            impulse: three(&hit.impulse),
            u_minus: three(&hit.u_minus),
            u_plus: three(&hit.u_plus),
            energy_before: hit.energy_before,
            energy_after: hit.energy_after,
            normal_work: hit.normal_work,
            friction_work: hit.friction_work,
            drive_work: 0.0,
            mode: hit.mode.into(),
            flags: bits(hit.flags),
            status: Status::CAROM_OK,
        }
    }

    /// A state that has no result.
    pub(crate) fn refused(status: Status) -> Self {
        let (none, nan) = (Vector3::from_element(f64::NAN).into(), f64::NAN);
        Self {
            impulse: none,
            u_minus: none,
            u_plus: none,
            energy_before: nan,
            energy_after: nan,
            normal_work: nan,
            friction_work: nan,
            drive_work: nan,
            mode: Mode::CAROM_OPEN,
            flags: 0,
            status,
        }
    }
}
