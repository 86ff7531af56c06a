//! Motions: accumulations, slopes, jams, lasting contacts, stiff contacts, time steps.

use crate::stress::method::Bound::{Between, Near};
use crate::stress::method::{Bound, COMPLIANT, EVENTS, Expected, Judged, STEPS, Scene};
use crate::stress::{lasting, many, motion};

/// A time step's error of the height: between a third of h and ten h (m/s times s).
const fn step_error(step: f64) -> Bound {
    Between(0.3 * step, 10.0 * step)
}

const STEP_ERROR: &str = "Moreau–Jean is of order 1: each impact is late or early by a share of h, at 0.9 to 4.4 m/s, and the \
                          delays of up to ten impacts add";

const fn time_step(name: &'static str, expected: &'static [Expected], judge: fn(&str) -> Judged) -> Scene {
    Scene {
        name,
        story: "a ball dropped from 1 m bounces with e = 0.8 for 3 s, simulated with this time step h",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
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

const fn stiff(name: &'static str, judge: fn(&str) -> Judged) -> Scene {
    Scene {
        name,
        story: "a ball of 1 kg lands with 1 m/s on a compliant contact with e = 0.5",
        measures: "relative error of e",
        tolerance: 1e-6,
        expected: STIFF,
        judge,
    }
}

/// In the order of the table.
pub(super) const SCENES: &[Scene] = &[
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
    Scene {
        name: "chatter on two corners",
        story: "a block falls by 0.1 mm onto two edges at different heights, which bounce to rest one after the other, e = 0.5",
        measures: "error of the times at which the bounces of an edge end, s",
        tolerance: 1e-6,
        expected: &[Expected::within(
            &[EVENTS],
            1e-9,
            "the inertia decouples the edges: √(2h/g) (1 + e)/(1 − e) for each; the turn of 1e-4 rad couples them by 1e-8 of these times",
        )],
        judge: many::chatter_of_two,
    },
    Scene {
        name: "block on a gliding wedge",
        story: "a block slides on four corners down a wedge of 0.4 rad that glides on a smooth floor, μ = 0.2, for 0.3 s",
        measures: "largest error of the places of both, m",
        tolerance: 1e-6,
        expected: &[
            Expected::within(&[EVENTS], 1e-11, "constant accelerations: integration with tolerance 1e-12"),
            Expected::within(&[STEPS], 1e-8, "a step that is centred in time is exact for a constant force"),
        ],
        judge: many::wedge,
    },
    Scene {
        name: "stacked boxes",
        story: "two boxes, one on the other, slide at 1 m/s; the floor is rougher than the lower box, μ = 0.4 and 0.2",
        measures: "largest error of the distances, m",
        tolerance: 1e-6,
        expected: &[
            Expected::within(&[EVENTS], 1e-11, "v²/2a for each box, with tolerance 1e-12 up to its stop"),
            Expected::within(
                &[STEPS],
                1e-6,
                "in the step of the stop, of h = 1 ms, a h²/8 = 6.1e-7 m are lost at most",
            ),
        ],
        judge: many::stack,
    },
    Scene {
        name: "rolling to sliding",
        story: "two wheels on an axle, pulled by a force that grows, roll until their friction is exhausted, μ = 0.2, and slide",
        measures: "error of the distance, m, and of the rim's velocity, m/s",
        tolerance: 1e-6,
        expected: &[
            Expected::within(
                &[EVENTS],
                1e-9,
                "polynomials in time, joined where the friction of rolling reaches μ m g",
            ),
            Expected::degrades(&[STEPS], Between(1.01e-6, 5e-2), "Moreau–Jean is of order 1, h = 1 ms"),
            Expected::degrades(
                &[COMPLIANT],
                Between(1.01e-6, 1e-2),
                "friction smoothed over v_s = 1e-3 m/s: the rolling wheels creep at up to v_s artanh(f/μN)",
            ),
        ],
        judge: many::wheels,
    },
    Scene {
        name: "rocking to rest",
        story: "a block of tan α = 1/4 rocks on two corners from α/2 down to rest, e = 0 (compliant: e = 0.01), μ = 2",
        measures: "largest error of the angle up to the seventh impact, rad",
        tolerance: 1e-6,
        expected: &[
            Expected::within(&[EVENTS], 1e-9, "quadratures of the half swings, Housner's ratio at every impact"),
            Expected::degrades(
                &[STEPS],
                Between(1.01e-6, 1e-1),
                "Moreau–Jean is of order 1, h = 1 ms: each impact is late by a share of h",
            ),
            Expected::degrades(
                &[COMPLIANT],
                Between(1.01e-6, 1e-1),
                "the corners sink by (m g/k)^(2/3) = 1e-4 m, 1e-3 of the width, and e = 0.01 adds rebounds",
            ),
        ],
        judge: many::rocking_to_rest,
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
