//! Impacts of several contacts at the same time.

use crate::stress::method::Bound::{Between, Near};
use crate::stress::method::{COMPLIANT, Expected, GLOCKER_PFEIFFER, LIU_ZHAO_BROGLIATO, MOREAU, SEQUENTIAL, Scene};
use crate::stress::{many, several};

const TOGETHER: &[&str] = &[MOREAU, GLOCKER_PFEIFFER];

/// In the order of the table.
pub(super) const SCENES: &[Scene] = &[
    Scene {
        name: "rod on two ends",
        story: "a rod falls flat on both ends, e = 0.5",
        measures: "difference from a rebound as flat, m/s",
        tolerance: 1e-9,
        expected: &[
            Expected::exact(TOGETHER, "symmetric: both ends rebound with 0.5 m/s"),
            Expected::fails(
                &[SEQUENTIAL],
                Near(several::rod_error, 1e-12),
                "the order decides: the left end first gives (0.40625, 0.265625) m/s, the right end first the mirror image",
            ),
            Expected::within(
                &[LIU_ZHAO_BROGLIATO],
                several::SOLVED,
                "both ends store and return the same work: 0.5 m/s, with the error of the integration",
            ),
        ],
        judge: several::rod,
    },
    Scene {
        name: "three contacts, two freedoms",
        story: "a rod in the plane on three points: impulses are not unique, velocities are, e = 0.5",
        measures: "relative error of the velocities",
        tolerance: 1e-9,
        expected: &[
            Expected::exact(
                TOGETHER,
                "e times the approach of every point is a motion of the rod, so it is the solution",
            ),
            Expected::fails(
                &[SEQUENTIAL],
                Near(several::redundant_error, 1e-9),
                "the order decides; the error is that of an independent sequence in the same order",
            ),
        ],
        judge: several::redundant,
    },
    Scene {
        name: "e differs per contact",
        story: "2 000 random smooth impacts at two to four places, each with its own e; each outcome against an independent solution",
        measures: "share of the problems that gain energy (moreau) or do not end within 2 000 sub-impacts (sequential); violation of \
                   the law's definition (glocker-pfeiffer)",
        tolerance: 1e-9,
        expected: &[
            Expected::fails(
                &[MOREAU],
                Near(several::different_restitutions_share, 1e-9),
                "a receding contact that is pushed back to rest adds ½ p u⁻; the share is that of the solutions found by trying every \
                 set of pushing contacts",
            ),
            Expected::within(
                &[GLOCKER_PFEIFFER],
                several::SOLVED,
                "without friction the law never gains energy, and the iteration stops at 1e-12",
            ),
            Expected::fails(
                &[SEQUENTIAL],
                Near(several::different_restitutions_share, 1e-9),
                "sub-impacts may be infinitely many, or more than 2 000: the share is that of an independent sequence",
            ),
        ],
        judge: several::different_restitutions,
    },
    Scene {
        name: "several rough contacts",
        story: "100 random impacts at two to four places with friction, one e for all",
        measures: "share of the problems that gain energy; of glocker-pfeiffer the violation of the law's definition",
        tolerance: 1e-9,
        expected: &[
            Expected::fails(
                &[MOREAU],
                Between(0.02, 0.15),
                "with e > 0 each contact has Whittaker's law, of which 1 to 3 % gain energy, and there are two to four",
            ),
            Expected::within(
                &[GLOCKER_PFEIFFER],
                several::SOLVED,
                "with one e for all the law never gains energy, and the iteration stops at 1e-12",
            ),
            Expected::fails(
                &[SEQUENTIAL],
                Between(0.002, 0.1),
                "with e > 0 each sub-impact has Whittaker's law, of which 1 to 3 % gain energy, and later ones lose it again",
            ),
        ],
        judge: several::rough,
    },
    Scene {
        name: "50 contacts",
        story: "a raft of 50 rough contacts that strike at once, e = 0",
        measures: "violation of the law's definition",
        tolerance: 1e-9,
        expected: &[
            Expected::within(
                TOGETHER,
                several::SOLVED,
                "with e = 0 both are Moreau's law, and the iteration stops at 1e-12",
            ),
            Expected::within(
                &[SEQUENTIAL],
                several::SOLVED,
                "a sequence stops when nothing approaches with more than 1e-12",
            ),
        ],
        judge: several::raft,
    },
    Scene {
        name: "nearly parallel contacts",
        story: "a particle in a groove whose walls are 0.1 down to 1e-8 rad from level, e = 0",
        measures: "error of the velocity against its closed form, m/s",
        tolerance: 1e-7,
        expected: &[Expected::within(
            &[MOREAU, GLOCKER_PFEIFFER, SEQUENTIAL],
            6e-9,
            "at 1e-8 rad, below √ε, the rows of H are equal in double precision: the walls' velocities, 2 · 0.3 · 1e-8 m/s apart, cannot be \
             distinguished",
        )],
        judge: several::groove,
    },
    Scene {
        name: "Newton's cradle",
        story: "three equal balls, e = 1, against elastic contacts after Hertz with stiffnesses as 1 : 1, 10 : 1 and 1 : 10",
        measures: "largest error of a ball's velocity, m/s",
        tolerance: 1e-6,
        expected: &[
            Expected::fails(
                &[MOREAU, GLOCKER_PFEIFFER, SEQUENTIAL],
                Near(several::cradle_error, 1e-6),
                "the outcome depends on the stiffnesses, which no rigid law has: the error is the distance of the law's closed form from \
                 an independent integration",
            ),
            Expected::within(
                &[LIU_ZHAO_BROGLIATO],
                1e-6,
                "the law contains the stiffnesses: with e = 1 it is the limit of elastic contacts",
            ),
            Expected::within(&[COMPLIANT], 1e-6, "the same equations, by another integrator"),
        ],
        judge: several::cradle,
    },
    Scene {
        name: "rocking block",
        story: "a block of tan α = 1/4 turns about one corner, and the other one strikes, e = 0, μ = 2",
        measures: "error of ω⁺/ω⁻",
        tolerance: 1e-9,
        expected: &[
            Expected::exact(
                &["whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"],
                "Housner's ratio 1 − 1.5 sin²α: the struck corner sticks, and the other one lifts off",
            ),
            Expected::fails(
                &["frictionless"],
                Near(many::smooth_ratio, 1e-9),
                "without friction the corner slips outwards: 1 − 2a²/(I/m + a²)",
            ),
            Expected::exact(TOGETHER, "the first corner lifts off, so it gets no impulse"),
            Expected::exact(&[SEQUENTIAL], "one sub-impact: the first corner lifts off"),
            Expected::refused(
                &[LIU_ZHAO_BROGLIATO],
                "the law has no friction, without which the corner does not stick",
            ),
        ],
        judge: many::rocking_impact,
    },
];
