//! The scenes: what each is, what its figure measures, and what theory predicts of each method, with the reason.

use super::Bound::{Between, Near};
use super::single::{PLANAR, SPATIAL};
use super::{
    COMPLIANT, EVENTS, Expected, GLOCKER_PFEIFFER, MOREAU, SEQUENTIAL, STEPS, Scene, chains, lasting, motion, several,
    single,
};

const LAWS: &[&str] = &carom_impact::LAW_NAMES;
/// Newton's restitution beside Coulomb's friction: may gain energy.
const MAY_GAIN: &[&str] = &["whittaker", "newton"];
const NEVER_GAIN: &[&str] = &["frictionless", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
const FRICTIONLESS: &[&str] = &["frictionless"];
const ROUGH: &[&str] = &["whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
const TOGETHER: &[&str] = &[MOREAU, GLOCKER_PFEIFFER];

const NO_GAIN: &str =
    "each of these laws has a proof that it never gains energy; the rest is its definition, to rounding";
const CENSUS: &str = "each of these laws has a proof (Poisson's in space: a census) that it never gains energy; the rest is its \
                      definition, to rounding over the least share of the normal work, and in space to the integration of the path";

const VIOLATION: &str = "largest relative violation of the law's definition, cone, unilaterality and energy balance";

/// A time step's error of the height: between a third of h and ten h (m/s times s).
const fn step_error(step: f64) -> super::Bound {
    Between(0.3 * step, 10.0 * step)
}

const STEP_ERROR: &str = "Moreau–Jean is of order 1: each impact is late or early by a share of h, at 0.9 to 4.4 m/s, and the \
                          delays of up to ten impacts add";

const fn time_step(name: &'static str, expected: &'static [Expected], judge: fn(&str) -> super::Judged) -> Scene {
    Scene {
        name,
        story: "a ball dropped from 1 m bounces with e = 0.8 for 3 s, simulated with this time step h",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
        expected,
        judge,
    }
}

const fn links(name: &'static str, expected: &'static [Expected], judge: fn(&str) -> super::Judged) -> Scene {
    Scene {
        name,
        story: "the tip of a uniform chain of so many hinged rods is hit, e = 0.5, μ = 0.3; M, C q̇, J and H in closed form",
        measures: "largest violation of the law's definition with that H, of M Δq̇ = JᵀP, of J q̇⁺ = u⁺ and of the energies",
        tolerance: 1e-9,
        expected,
        judge,
    }
}

const STIFF: &[Expected] = &[Expected::within(
    &[COMPLIANT],
    1e-10,
    "the damping rebounds exactly for every mass, stiffness and speed: what remains is the integration, of tolerance 1e-12 per \
     step and about 80 steps",
)];

const fn stiff(name: &'static str, judge: fn(&str) -> super::Judged) -> Scene {
    Scene {
        name,
        story: "a ball of 1 kg lands with 1 m/s on a compliant contact with e = 0.5",
        measures: "relative error of e",
        tolerance: 1e-6,
        expected: STIFF,
        judge,
    }
}

/// The scenes, in the order of the table.
pub const SCENES: &[Scene] = &[
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
            Expected::within(&[COMPLIANT], 1e-6, "the same equations, by another integrator"),
        ],
        judge: several::cradle,
    },
    Scene {
        name: "rocking block",
        story: "a block rocks from corner to corner: ω⁺/ω⁻ = 1 − 1.5 sin²α (Housner)",
        measures: "error of the ratio",
        tolerance: 1e-9,
        expected: &[Expected::exact(
            &[MOREAU, GLOCKER_PFEIFFER, SEQUENTIAL],
            "with e = 0 and enough friction the old corner lifts off: Housner's closed form, only rounding",
        )],
        judge: several::rocking_block,
    },
    Scene {
        name: "Zeno",
        story: "a ball bounces with e = 0.8 through its first four arcs, and with e = 0.5 to rest",
        measures: "error of the height, m",
        tolerance: 1e-6,
        expected: &[
            Expected::exact(
                &[EVENTS],
                "the arcs are parabolas and the sum of the times of flight is geometric: only rounding",
            ),
            Expected::degrades(
                &[STEPS],
                Between(5e-4, 5e-2),
                "each of four impacts is late or early by a share of h = 1 ms, and its velocity off by up to (1 + e) g h: together up to \
                 23 h at 2.3 m/s; no fewer than an eighth of a step at 4.4 m/s",
            ),
            Expected::degrades(
                &[COMPLIANT],
                Near(motion::compliant_zeno, 1e-3),
                "a contact of finite stiffness (1e7 N/m^1.5) lasts milliseconds, and the flights after it are late: the figure is that of \
                 an independent integration",
            ),
        ],
        judge: motion::zeno,
    },
    Scene {
        name: "false Zeno",
        story: "a pendulum hits a wall at its lowest point, e = 0.5: the bounces never accumulate",
        measures: "relative error of the velocity after six impacts",
        tolerance: 1e-4,
        expected: &[
            Expected::within(
                &[EVENTS],
                1e-9,
                "integration with tolerance 1e-12, its error doubled by each of six impacts",
            ),
            Expected::within(
                &[STEPS],
                3e-5,
                "an impact within h of the lowest point has cos(ωh) of the velocity: six times ½ (ωh)² = 4.9e-6",
            ),
            Expected::degrades(
                &[COMPLIANT],
                Near(motion::compliant_false_zeno, 1e-2),
                "gravity acts while the contact lasts: the figure is that of an independent integration",
            ),
        ],
        judge: motion::false_zeno,
    },
    Scene {
        name: "grazing in flight",
        story: "a ball thrown at a ceiling that it would miss, or overlap, by 1e-3 down to 1e-12 m",
        measures: "largest miss decided wrongly, m",
        tolerance: 1e-9,
        expected: &[
            Expected::exact(
                &[EVENTS],
                "the least gap is found by its derivative's root: every miss down to 1e-12 m is decided rightly",
            ),
            Expected::degrades(
                &[STEPS],
                Between(1e-8, 1.23e-6),
                "between steps of 1 ms the apex is missed by up to g h²/8 = 1.2e-6 m",
            ),
            Expected::within(
                &[COMPLIANT],
                1e-9,
                "an overlap D changes the velocity by (3π/8) k D² √(2/g), which moves the ball by less than the scene's 1e-10 m \
                 only for D ≤ 1e-9 m",
            ),
        ],
        judge: motion::grazing_flight,
    },
    Scene {
        name: "10 000 bounces",
        story: "a ball bounces with e = 1, ten thousand times (time stepping, h = 1e-4 s: for as long)",
        measures: "relative error of the energy",
        tolerance: 1e-6,
        expected: &[
            Expected::within(&[EVENTS], 1e-8, "10 000 impacts with an error of at most the tolerance, 1e-12, each"),
            Expected::degrades(
                &[STEPS],
                Between(1e-5, 6.3e-3),
                "an overlap that is put back lifts the ball by at most v h/2, that is v h/2H = 1.6e-3 of its energy, until a flight is a \
                 whole number of steps: few times",
            ),
            Expected::within(
                &[COMPLIANT],
                1e-7,
                "no damping at e = 1: 10 000 contacts of about 100 steps, tolerance 1e-12 each, as a random walk",
            ),
        ],
        judge: motion::ten_thousand_bounces,
    },
    Scene {
        name: "block on a slope",
        story: "a point mass rests on a slope below the friction angle for 2 s (compliant: e = 0.01)",
        measures: "distance crept, m",
        tolerance: 1e-6,
        expected: &[
            Expected::exact(&[EVENTS, STEPS], "tan θ = 0.2 is below μ = 0.3: the block sticks"),
            Expected::fails(
                &[COMPLIANT],
                Near(motion::creep, 1e-3),
                "friction smoothed over v_s = 1e-3 m/s can't stick: it creeps with v_s artanh(tan θ/μ), reached within 1 ms",
            ),
        ],
        judge: motion::slope,
    },
    Scene {
        name: "the same on bristles",
        story: "the same slope, with friction that deflects before it slips (1e7 N/m, 1e3 N s/m)",
        measures: "distance crept, m",
        tolerance: 1e-6,
        expected: &[Expected::within(
            &[COMPLIANT],
            4e-7,
            "the bristle bends by m g sin θ/k = 1.9e-7 m, at most twice that in its first swing, and stands; within 1 % of an independent \
             integration",
        )],
        judge: motion::slope_on_a_bristle,
    },
    Scene {
        name: "Painlevé's rod",
        story: "the rod of 60° and μ = 1.5 slides into its jam, e = 0 (compliant: e = 0.01, from an overlap of 1e-8 m)",
        measures: "largest overlap, m",
        tolerance: 1e-6,
        expected: &[
            Expected::within(
                &[EVENTS],
                1e-9,
                "rigid sliding has no acceleration in the jam, μ |B| > C: an impact without collision stops it, with no overlap",
            ),
            Expected::degrades(&[STEPS], Between(1.01e-6, 2e-5), "overlaps up to 2 g h² = 2e-5 m are left, h = 1 ms"),
            Expected::degrades(
                &[COMPLIANT],
                Between(1.01e-6, 1.7e-3),
                "the overlap takes up at most the energy of sliding, ½ m v²: (2.5 · 0.5 J/k)^0.4 = 1.7e-3 m",
            ),
        ],
        judge: motion::painleve,
    },
    Scene {
        name: "sliding to rest on four corners",
        story: "a block slides at 1 m/s on its four corners, μ = 0.3, and stops",
        measures: "error of the distance, m",
        tolerance: 1e-6,
        expected: &[
            Expected::within(
                &[EVENTS],
                1e-11,
                "v²/(2 μ g): integration with tolerance 1e-12 up to the stop of all corners at once",
            ),
            Expected::within(
                &[STEPS],
                5e-7,
                "a step that is centred in time is exact for a constant force; in the last one, of h = 1 ms, μ g h²/8 = 3.7e-7 m are lost \
                 at most",
            ),
        ],
        judge: lasting::stop,
    },
    Scene {
        name: "loads of four corners",
        story: "a block sticks on a slope below the friction angle: more contact forces than freedoms",
        measures: "error of the corners' loads and of their friction together, share of the weight",
        tolerance: 1e-9,
        expected: &[Expected::exact(
            &[EVENTS],
            "forces of equal springs are affine in the corner's position: m g cos θ/4 (1 ± tan θ · height/length), only rounding",
        )],
        judge: lasting::loads,
    },
    Scene {
        name: "between two walls",
        story: "a block falls between two rough walls, μ = 0.5, that it touches with eight corners without pressing",
        measures: "relative error of the height fallen",
        tolerance: 1e-9,
        expected: &[Expected::exact(&[EVENTS], "corners without load have no friction: free fall, only rounding")],
        judge: lasting::walls,
    },
    Scene {
        name: "chatter on four corners",
        story: "a block lands flat with e = 0.5 and bounces to rest on its four corners",
        measures: "error of the time at which it rests, s",
        tolerance: 1e-6,
        expected: &[Expected::within(
            &[EVENTS],
            1e-9,
            "the sum of the times of flight is geometric, √(2h/g) (1 + e)/(1 − e); the integration has a tolerance of 1e-12",
        )],
        judge: lasting::chatter,
    },
    stiff("stiffness 1e4 N/m^1.5", |_| motion::stiffness(1e4)),
    stiff("stiffness 1e7 N/m^1.5", |_| motion::stiffness(1e7)),
    stiff("stiffness 1e10 N/m^1.5", |_| motion::stiffness(1e10)),
    time_step("time step 1e-5 s", &[Expected::degrades(&[STEPS], step_error(1e-5), STEP_ERROR)], |_| {
        motion::time_step(1e-5)
    }),
    time_step("time step 1e-4 s", &[Expected::degrades(&[STEPS], step_error(1e-4), STEP_ERROR)], |_| {
        motion::time_step(1e-4)
    }),
    time_step("time step 1e-3 s", &[Expected::degrades(&[STEPS], step_error(1e-3), STEP_ERROR)], |_| {
        motion::time_step(1e-3)
    }),
    time_step("time step 1e-2 s", &[Expected::degrades(&[STEPS], step_error(1e-2), STEP_ERROR)], |_| {
        motion::time_step(1e-2)
    }),
    time_step("time step 1e-1 s", &[Expected::degrades(&[STEPS], step_error(1e-1), STEP_ERROR)], |_| {
        motion::time_step(1e-1)
    }),
    Scene {
        name: "quaternions",
        story: "a free body turns for 10⁶ time steps",
        measures: "error of the attitude, rad, and of the quaternion's norm",
        tolerance: 1e-9,
        expected: &[Expected::within(
            &[STEPS],
            1e-9,
            "each step is an exact rotation with at most four roundings of 1.1e-16: 4.4e-10 if all had one sign",
        )],
        judge: |_| motion::quaternions(),
    },
];
