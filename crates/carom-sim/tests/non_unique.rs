//! Motions that the laws leave open are flagged, those that are unique are not.

use crate::census::{LIMIT, energy, random};
use carom_chain::Chain;
use carom_impact::Flags;
use carom_sim::{ContactState, EventKind, NonUnique, Sampling, Seen, Simulation, StepReason, Trajectory};
use carom_testing::build::{O, ball, floating_box, in_plane, shape};
use carom_testing::scenes::{G, among_planes, newton};
use nalgebra::{Matrix4, Vector3};

const MU: f64 = 0.3;
/// Half the edges of the box, m, and its mass, kg.
const HALF: [f64; 3] = [0.2, 0.15, 0.1];
const MASS: f64 = 2.0;

fn a_box() -> Chain {
    floating_box(HALF.map(|half| 2.0 * half), MASS)
}

/// A chain among half-spaces, each with a point and a normal.
fn simulation(chain: Chain, planes: &[[Vector3<f64>; 2]], friction: f64) -> Simulation {
    among_planes(chain, planes, &newton(0.0, friction))
}

const FLOOR: [Vector3<f64>; 2] = [Vector3::new(0.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 1.0)];

fn on_floor(friction: f64) -> Simulation {
    simulation(a_box(), &[FLOOR], friction)
}

fn lying() -> [f64; 7] {
    [0.0, 0.0, HALF[2], 0.0, 0.0, 0.0, 1.0]
}

/// The reasons of a run, and the contacts at its samples.
fn seen(sim: &Simulation, q: &[f64], qd: &[f64], duration: f64) -> (Vec<(f64, NonUnique, usize)>, Vec<ContactState>) {
    let (mut reasons, mut told) = (Vec::new(), Vec::new());
    let sampling = Sampling { every: Some(duration / 16.0), ..Sampling::default() };
    sim.stream(q, qd, duration, sampling, &mut |seen| match seen {
        Seen::Contacts(_, states) => told.extend_from_slice(states),
        Seen::Event(event) => {
            if let EventKind::NonUnique { reason, touches } = &event.kind {
                reasons.push((event.time, *reason, touches.len()));
            }
        }
        _ => {}
    })
    .unwrap();
    (reasons, told)
}

fn flagged(told: &[ContactState]) -> usize {
    told.iter().filter(|state| state.flags.contains(Flags::NON_UNIQUE)).count()
}

/// A box that slides straight on four corners of the same friction: forces are not determined, the motion is. At rest it is as well.
#[test]
fn a_box_that_slides_straight_on_four_corners_has_a_unique_motion() {
    let sim = on_floor(MU);
    for v in [[0.7, 0.0], [0.3, -0.4], [0.0, 0.0]] {
        let (reasons, told) = seen(&sim, &lying(), &[v[0], v[1], 0.0, 0.0, 0.0, 0.0], 0.1);
        assert!(reasons.is_empty() && flagged(&told) == 0, "{v:?}: {reasons:?}");
        assert!(told.len() >= 4 * 16);
    }
    // To its stop and beyond.
    let (reasons, told) = seen(&sim, &lying(), &[0.6, 0.0, 0.0, 0.0, 0.0, 0.0], 0.5);
    assert!(reasons.is_empty() && flagged(&told) == 0, "{reasons:?}");
}

/// With another friction of one corner the accelerations depend on the loads. By the convention these are affine in the position of the
/// corner; another split satisfies the balance of forces along z and of moments about x and y, too, and gives other accelerations.
/// Where the corners of each side have one coefficient, friction depends on the sums of their loads only, which are determined.
#[test]
fn a_box_on_corners_with_different_friction_is_flagged_and_follows_the_convention() {
    let mut sim = on_floor(MU);
    // The corners in the order of the touches, from the states that are told.
    let (_, told) = seen(&sim, &lying(), &[1e-3, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    let corners: Vec<(usize, Vector3<f64>)> = told[..4].iter().map(|state| (state.touch, state.point)).collect();
    for (touch, point) in &corners {
        sim.touches[*touch].contact = newton(0.0, if point.y > 0.0 { 0.2 } else { 0.5 });
    }
    let (reasons, told) = seen(&sim, &lying(), &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    assert!(reasons.is_empty(), "{reasons:?}");
    assert_eq!(told[..4].iter().filter(|state| state.flags.contains(Flags::NON_UNIQUE)).count(), 0);
    let mus = [0.5, 0.2, 0.2, 0.2];
    for ((touch, _), mu) in corners.iter().zip(&mus) {
        sim.touches[*touch].contact = newton(0.0, *mu);
    }
    let (v, duration) = (1.0, 1e-4);
    let qd = [v, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (reasons, told) = seen(&sim, &lying(), &qd, duration);
    assert_eq!(reasons, [(0.0, NonUnique::Distribution, 4)]);
    assert_eq!((told.len(), flagged(&told)), (4 * 17, 4 * 17));
    let run = sim.run(&lying(), &qd, duration).unwrap();
    assert!((run.summary.statistics.non_unique_time - duration).abs() < 1e-12);

    // Loads a + b x + c y: Σ λ = m g, Σ λ y = 0, Σ λ (x + μ h) = 0 with friction −μ λ along x at the height −h.
    let h = HALF[2];
    let row = |k: usize, i: usize| [1.0, corners[i].1.y, corners[i].1.x - mus[i] * h][k];
    let moments =
        |k: usize, basis: usize| (0..4).map(|i| [1.0, corners[i].1.x, corners[i].1.y][basis] * row(k, i)).sum::<f64>();
    let matrix = nalgebra::Matrix3::from_fn(moments);
    let abc = matrix.lu().solve(&Vector3::new(MASS * G, 0.0, 0.0)).unwrap();
    let loads: Vec<f64> = corners.iter().map(|(_, p)| abc.dot(&Vector3::new(1.0, p.x, p.y))).collect();
    for (state, load) in told[..4].iter().zip(&loads) {
        assert!((state.normal_force - load).abs() < 1e-9 * load, "{} for {load}", state.normal_force);
    }
    let turn = |loads: &[f64]| -> f64 {
        let inertia = MASS * (HALF[0] * HALF[0] + HALF[1] * HALF[1]) / 3.0;
        (0..4).map(|i| corners[i].1.y * mus[i] * loads[i]).sum::<f64>() / inertia
    };
    let spin = run.summary.last.qd[5];
    // Second order in the time.
    assert!((spin / (turn(&loads) * duration) - 1.0).abs() < 1e-3, "{spin} for {}", turn(&loads) * duration);
    // Another admissible split: the null vector of the three balances.
    let balance = Matrix4::from_fn(|i, j| if i < 3 { row(i, j) } else { 0.0 });
    let null = balance.svd(false, true).v_t.unwrap().row(3).transpose();
    assert!((balance * null).norm() < 1e-12 * MASS * G);
    let other: Vec<f64> = (0..4).map(|i| loads[i] + null[i]).collect();
    assert!(other.iter().all(|load| *load > 0.0));
    let change = turn(&other) - turn(&loads);
    assert!(change.abs() > 1e-3 * turn(&loads).abs(), "the acceleration depends on the split: {change}");
}

/// A box that spins on four corners: friction acts in four directions.
#[test]
fn a_box_that_spins_on_four_corners_is_flagged_and_on_three_is_not() {
    let mut sim = on_floor(MU);
    let qd = [0.5, 0.0, 0.0, 0.0, 0.0, 3.0];
    let (reasons, told) = seen(&sim, &lying(), &qd, 0.02);
    assert_eq!(reasons, [(0.0, NonUnique::Distribution, 4)]);
    assert_eq!(flagged(&told), told.len());
    // Three corners below the centre are independent.
    let (_, told) = seen(&sim, &lying(), &qd, 1e-6);
    let mut keep: Vec<usize> = told[..4].iter().map(|state| state.touch).collect();
    keep.remove(0);
    let touches = std::mem::take(&mut sim.touches);
    sim.touches = touches.into_iter().enumerate().filter(|(k, _)| keep.contains(k)).map(|(_, touch)| touch).collect();
    let (reasons, told) = seen(&sim, &lying(), &qd, 1e-3);
    assert!(reasons.is_empty() && flagged(&told) == 0, "{reasons:?}");
}

/// An unloaded block between two rough walls may fall, or be held by any squeeze; between smooth ones it falls. With a floor it rests,
/// whatever the squeeze.
#[test]
fn an_unloaded_wedge_is_flagged() {
    let x = HALF[0];
    let walls = [[Vector3::new(-x, 0.0, 0.0), Vector3::x()], [Vector3::new(x, 0.0, 0.0), -Vector3::x()]];
    let (reasons, _) = seen(&simulation(a_box(), &walls, 0.5), &lying(), &[0.0; 6], 0.01);
    assert_eq!(reasons.first(), Some(&(0.0, NonUnique::Modes, 8)), "{reasons:?}");
    // Sliding down.
    let down = [0.0, 0.0, -0.3, 0.0, 0.0, 0.0];
    let (reasons, _) = seen(&simulation(a_box(), &walls, 0.5), &lying(), &down, 0.01);
    assert!(matches!(reasons.first(), Some((0.0, NonUnique::Modes, 8))), "{reasons:?}");
    for qd in [[0.0; 6], down] {
        let (reasons, _) = seen(&simulation(a_box(), &walls, 0.0), &lying(), &qd, 0.01);
        assert!(reasons.is_empty(), "{reasons:?}");
    }
    let (reasons, _) = seen(&simulation(a_box(), &[walls[0], FLOOR], 0.5), &lying(), &[0.0; 6], 0.01);
    assert!(reasons.is_empty(), "a wall and a floor: {reasons:?}");
}

/// Painlevé's rod, 1 m long, sliding on its lower end: K = (1 + 3 cos² φ − 3 μ sin φ cos φ)/m < 0. Where the end accelerates upwards
/// without a force, −g + ω² l sin φ > 0, it may lift off or be pushed. Where friction is small enough for K > 0 it lifts off.
#[test]
fn painleves_indeterminate_rod_is_flagged() {
    let l = 0.5;
    let rod = || in_plane(1.0, 0.0833333333333333, &shape(&ball(1e-9), [0.5, 0.0, 0.0], O));
    let phi = 2.0_f64.atan();
    let (sin, cos) = phi.sin_cos();
    let q = [0.0, l * sin + 1e-9, phi];
    for (mu, spin, open) in [(2.0, 8.0_f64, true), (0.5, 8.0, false), (2.0, 0.0, false)] {
        let qd = [3.0 + spin * l * sin, spin * l * cos, spin];
        let k = 1.0 + 3.0 * cos * cos - 3.0 * mu * sin * cos;
        let lifts = -G + spin * spin * l * sin > 0.0;
        assert_eq!(open, k < 0.0 && lifts);
        let (reasons, _) = seen(&simulation(rod(), &[FLOOR], mu), &q, &qd, 1e-3);
        let expected = if open { vec![(0.0, NonUnique::Modes, 1)] } else { Vec::new() };
        assert_eq!(reasons, expected, "μ {mu}, ω {spin}");
    }
}

/// The velocities after a box has landed flat on four corners depend on the split of impulses if it spins, not if it slides straight.
#[test]
fn an_impact_on_four_corners_is_flagged_where_the_velocities_depend_on_the_split() {
    let sim = on_floor(MU);
    let several = |run: &Trajectory| -> Vec<Flags> {
        let flags = |event: &carom_sim::Event| match event.kind {
            EventKind::Several { flags, .. } => Some(flags),
            _ => None,
        };
        run.events.iter().filter_map(flags).collect()
    };
    let q = [0.0, 0.0, HALF[2] + 1e-6, 0.0, 0.0, 0.0, 1.0];
    for (spin, open) in [(0.0, false), (6.0, true)] {
        let run = sim.run(&q, &[2.0, 0.0, -0.5, 0.0, 0.0, spin], 1e-3).unwrap();
        let found = several(&run);
        assert_eq!(found.len(), 1, "{:?}", run.events);
        assert_eq!(found[0].contains(Flags::NON_UNIQUE), open, "spin {spin}: {:?}", found[0]);
    }
}

/// In time steps as well.
#[test]
fn time_steps_are_flagged_by_the_same_criterion() {
    let sim = Simulation { stepping: true, ..on_floor(MU) };
    for (spin, open) in [(0.0, false), (3.0, true)] {
        let (_, told) = seen(&sim, &lying(), &[0.5, 0.0, 0.0, 0.0, 0.0, spin], 0.02);
        assert!(!told.is_empty());
        let all = if open { told.len() } else { 0 };
        assert_eq!(flagged(&told), all, "spin {spin}");
    }
}

/// A robot whose sliding contacts come near a jam: without time steps, and with energies that balance.
#[test]
fn slips_near_a_jam_need_no_time_steps() {
    let case = random::scene(96).as_is();
    let answer =
        energy::balanced("near a jam", &case, None, LIMIT).unwrap_or_else(|verdict| panic!("{}", verdict.note));
    assert!(!answer.reasons.contains(&StepReason::NoMode), "{:?}", answer.reasons);
    assert_eq!(answer.statistics().contact_steps, 0);
}
