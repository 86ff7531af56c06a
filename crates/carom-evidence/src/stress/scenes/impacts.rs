//! Single impacts, and impacts of chains.

use crate::stress::method::Bound::{Between, Near};
use crate::stress::method::{Expected, Judged, Scene};
use crate::stress::single::{PLANAR, SPATIAL};
use crate::stress::{chains, single};

const LAWS: &[&str] = &carom_impact::LAW_NAMES;
/// Newton's restitution beside Coulomb's friction: may gain energy.
const MAY_GAIN: &[&str] = &["whittaker", "newton"];
const NEVER_GAIN: &[&str] = &["frictionless", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
const FRICTIONLESS: &[&str] = &["frictionless"];
const ROUGH: &[&str] = &["whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
const VIOLATION: &str = "largest relative violation of the law's definition, cone, unilaterality and energy balance";
const NO_GAIN: &str =
    "each of these laws has a proof that it never gains energy; the rest is its definition, to rounding";
const CENSUS: &str = "each of these laws has a proof (Poisson's in space: a census) that it never gains energy; the rest is its \
                      definition, to rounding over the least share of the normal work, and in space to the integration of the path";

const fn links(name: &'static str, expected: &'static [Expected], judge: fn(&str) -> Judged) -> Scene {
    Scene {
        name,
        story: "the tip of a uniform chain of so many hinged rods is hit, e = 0.5, μ = 0.3; M, C q̇, J and H in closed form",
        measures: "largest violation of the law's definition with that H, of M Δq̇ = JᵀP, of J q̇⁺ = u⁺ and of the energies",
        tolerance: 1e-9,
        expected,
        judge,
    }
}

/// In the order of the table.
pub(super) const SCENES: &[Scene] = &[
    Scene {
        name: "energy paradox",
        story: "Kane & Levinson's double pendulum strikes the floor, e from 0 to 1, μ from 0 to 1.2",
        measures: "largest relative violation of the law's definition, cone, unilaterality and energy balance; of whittaker and \
                   newton the largest T⁺/T⁻",
        tolerance: 1e-9,
        expected: &[
            Expected::exact(NEVER_GAIN, NO_GAIN),
            Expected::fails(
                MAY_GAIN,
                Near(single::kane_gain, 1e-9),
                "Kane & Levinson (1985): once slip has stopped u⁺ = (0, e |u_n|), and at e = 1 \
                 T⁺/T⁻ = A u_n²/(A u_n² − 2 B u_t u_n + C u_t²)",
            ),
        ],
        judge: single::kane_levinson,
    },
    Scene {
        name: "random census",
        story: "20 000 random planar impacts, e and μ random",
        measures: "largest relative violation of the law's definition, cone, unilaterality and energy balance; of whittaker and \
                   newton the share of impacts that gain energy",
        tolerance: 1e-9,
        expected: &[
            Expected::within(NEVER_GAIN, PLANAR, CENSUS),
            Expected::fails(
                MAY_GAIN,
                Between(0.01, 0.05),
                "the law allows it; another census of 60 000 planar impacts found 2.5 % (whittaker) and 1.9 % (newton)",
            ),
        ],
        judge: single::census,
    },
    Scene {
        name: "census in space",
        story: "2 000 random impacts in space, where slip turns",
        measures: "largest relative violation of the law's definition, cone, unilaterality and energy balance; of whittaker and \
                   newton the share of impacts that gain energy",
        tolerance: 1e-9,
        expected: &[
            Expected::within(NEVER_GAIN, SPATIAL, CENSUS),
            Expected::fails(
                MAY_GAIN,
                Between(0.005, 0.04),
                "the law allows it; another census of 700 impacts in space found 1.9 % (newton)",
            ),
        ],
        judge: single::census_in_space,
    },
    Scene {
        name: "jam",
        story: "the same pendulum, sliding into a jam: μ = 0.8 above C/B, e = 0.5",
        measures: VIOLATION,
        tolerance: 1e-9,
        expected: &[Expected::exact(
            LAWS,
            "the planar impact path is a polygon, and the algebraic laws are closed forms: only rounding",
        )],
        judge: single::jam,
    },
    Scene {
        name: "impact without collision",
        story: "Painlevé's rod at 60°, μ = 1.5, slides along the floor: the approach velocity tends to 0, e = 0.5",
        measures: "normal impulse left when the approach velocity is 1e-12 m/s, N s",
        tolerance: 1e-9,
        expected: &[
            Expected::exact(FRICTIONLESS, "continuous: P_n = (1 + e) |u_n|/C = 8.6e-13 N s"),
            Expected::fails(
                ROUGH,
                Near(single::impulse_without_collision, 1e-9),
                "Painlevé's jam, μ |B| > C: sliding on and a finite impulse both satisfy the law at u_n = 0, and the limit of the map is \
                 the impulse, in closed form",
            ),
        ],
        judge: single::without_collision,
    },
    Scene {
        name: "grazing",
        story: "slip of 1 m/s, approach from 1 down to 1e-12 m/s, e = 0.5, μ = 0.3",
        measures: "relative error of the impulse against its closed form",
        tolerance: 1e-9,
        expected: &[Expected::exact(
            LAWS,
            "slip keeps its direction, so all laws agree: P_n = (1 + e) |u_n|/(C − μB), P_t = −μ P_n; only rounding",
        )],
        judge: single::grazing,
    },
    Scene {
        name: "e = 0 and e = 1",
        story: "2 000 random frictionless impacts with e exactly 0 or 1",
        measures: "relative error of rebound and energy",
        tolerance: 1e-9,
        expected: &[Expected::exact(
            LAWS,
            "without friction all coefficients are the same: u_n⁺ = e |u_n|, loss (1 − e²) u_n²/2C; only rounding",
        )],
        judge: single::extreme_restitution,
    },
    Scene {
        name: "slip about to stop",
        story: "500 random impacts in space with a slip of 1e-12 m/s, against the same without slip",
        measures: "relative change of u⁺",
        tolerance: 1e-8,
        expected: &[
            Expected::within(
                &["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "smith"],
                1e-8,
                "continuous: 1e-12 m/s of slip beside at least 1e-3 m/s of approach, times the condition of H, about 10",
            ),
            Expected::fails(
                &["brach"],
                Near(single::brach_jump, 1e-6),
                "it pushes along the first slip, which has no direction at rest: the jump follows from r = −sign(B) min(μ, |B|/A) in both \
                 directions",
            ),
        ],
        judge: single::slip_at_rest,
    },
    Scene {
        name: "singular pose",
        story: "a stretched two-link arm hit along itself, elbow from 0.1 down to 1e-12 rad",
        measures: "relative error of the joint velocities against their closed form",
        tolerance: 1e-9,
        expected: &[Expected::exact(
            LAWS,
            "the direction of M⁻¹Jᵀn does not depend on the angle, only its size does: only rounding",
        )],
        judge: chains::singular_pose,
    },
    Scene {
        name: "stretched exactly",
        story: "the same arm with its elbow at 0: no joint moves the tip along the normal",
        measures: "–",
        tolerance: 1e-9,
        expected: &[Expected::refused(
            LAWS,
            "singular direction, H_nn = 0: the impulse of any rigid law would be infinite",
        )],
        judge: chains::stretched,
    },
    Scene {
        name: "mass ratio 1e6",
        story: "six sliders in a row, masses of 1e-6, 1, 1e-6, … kg and the other way round, e = 0.5",
        measures: "relative error of the joint velocities against their closed form",
        tolerance: 1e-9,
        expected: &[Expected::exact(
            LAWS,
            "only the last joint changes its velocity: the recursion subtracts nothing, so the condition of M, 1e7, does not enter",
        )],
        judge: chains::mass_ratio,
    },
    links("2 links", &[Expected::exact(LAWS, "rounding times the condition of M, about 30")], |method| {
        chains::long(method, 2)
    }),
    links(
        "30 links",
        &[Expected::within(
            LAWS,
            1e-10,
            "rounding times the condition of M, about 1e4, in the reference's Cholesky factor",
        )],
        |method| chains::long(method, 30),
    ),
    links(
        "1000 links",
        &[Expected::within(
            LAWS,
            1e-9,
            "rounding times the condition of M, about 1e7, in the reference's Cholesky factor",
        )],
        |method| chains::long(method, 1000),
    ),
    Scene {
        name: "branched trees",
        story: "twenty planar and twenty spatial trees of eight bodies, hinges and sliders, are hit at a body; e and μ random",
        measures: "largest violation of the law's definition, of M Δq̇ = JᵀP, of J q̇⁺ = u⁺ and of the energies, with \
                   M = Σ m J_vᵀJ_v + J_ωᵀ I J_ω",
        tolerance: 1e-9,
        expected: &[Expected::within(
            LAWS,
            SPATIAL,
            "rounding times the condition of M, about 1e3, over the least share of the normal work, and the integration of the path",
        )],
        judge: chains::branches,
    },
];
