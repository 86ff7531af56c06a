//! Sequences of single impacts: closed forms, orders, sets of outcomes, and the energy balance.

use crate::common::{EXACT, all_close, any_motion, close, contact, flat_rod, gram, problem, row_of_balls, stop};
use carom_impact::{Accuracy, Constraint, Flags, Order, SeveralOutcome, SeveralProblem};
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

fn run(problem: &SeveralProblem, order: Order) -> SeveralOutcome {
    problem.sequential(&order, &Accuracy::default()).unwrap()
}

fn energy_ratio(problem: &SeveralProblem, energy_change: f64) -> f64 {
    let u = problem.u_minus();
    let before = 0.5 * u.dot(&(problem.delassus().clone().try_inverse().unwrap() * u));
    (before + energy_change) / before
}

#[test]
fn rod_end_that_strikes_first_rebounds_faster() {
    for (e, first, second, ratio, tiny) in
        [(0.5, 0.40625, 0.265625, 0.114502, EXACT), (0.8, 0.728, 0.701, 0.510571, EXACT), (1.0, 1.0, 1.0, 1.0, EXACT)]
    {
        let rod = flat_rod(e, 1.0);
        let left = run(&rod, Order::Cycle(vec![0, 1]));
        let right = run(&rod, Order::Cycle(vec![1, 0]));
        assert!(left.is_solved(&Accuracy::default()) && right.is_solved(&Accuracy::default()));
        close("first", left.u_plus[0], first, tiny);
        close("second", left.u_plus[1], second, tiny);
        all_close("mirrored", &right.u_plus, [left.u_plus[1], left.u_plus[0]], EXACT);
        close("energy", energy_ratio(&rod, left.energy_change), ratio, 5e-7);
        let set = rod.all_orders(10, &Accuracy::default());
        assert_eq!((set.tried, set.complete, set.unfinished), (2, true, 0));
        close("spread", set.spread, 2.0_f64.sqrt() * (left.u_plus[0] - left.u_plus[1]).abs(), EXACT);
        assert_eq!(set.outcomes.len(), if e < 1.0 { 2 } else { 1 });
        for i in 0..2 {
            close("lower", set.lower[i], left.u_plus.min(), EXACT);
            close("upper", set.upper[i], left.u_plus.max(), EXACT);
        }
    }
}

/// Both ends of a rod approach at the same velocity: the order is open, also where they differ by rounding. Equal approaches of bodies that
/// do not act on each other leave nothing open.
#[test]
fn an_order_that_equal_approaches_leave_open_is_flagged() {
    let flagged = |h: DMatrix<f64>, u: DVector<f64>| {
        let found = run(&problem(h, u, vec![stop(0.5); 2]), Order::MostApproaching);
        (found.flags.contains(Flags::NON_UNIQUE), found.u_plus)
    };
    let rod = dmatrix![4.0, -2.0; -2.0, 4.0];
    let (first, second) =
        (flagged(rod.clone(), dvector![-1.0, -1.0]), flagged(rod.clone(), dvector![-1.0, -1.0 - 1e-13]));
    assert!(first.0 && second.0 && (first.1 - second.1).amax() < 1e-12);
    assert!(!flagged(rod, dvector![-1.0, -1.0 - 1e-6]).0);
    assert!(!flagged(dmatrix![4.0, 0.0; 0.0, 4.0], dvector![-1.0, -1.0]).0);
}

/// The k-th sub-impact leaves an approach of 1.5·2¹⁻ᵏ at the other end: the 42nd is the first to leave less than 1e-12.
#[test]
fn rod_without_restitution_needs_42_sub_impacts() {
    let hit = run(&flat_rod(0.0, 1.0), Order::Cycle(vec![0, 1]));
    assert!(hit.is_solved(&Accuracy::default()) && hit.iterations == 42);
    close("rest", hit.u_plus.amax(), 0.0, 1e-12);
    let few = Accuracy { max_iterations: 10, ..Accuracy::default() };
    let hit = flat_rod(0.0, 1.0).sequential(&Order::MostApproaching, &few).unwrap();
    assert_eq!((hit.iterations, hit.is_solved(&few)), (10, false));
    close("what is left", hit.residual, 1.5 * 0.5_f64.powi(9), EXACT);
}

#[test]
fn last_ball_of_newtons_cradle_leaves_alone() {
    for n in [3, 5, 8] {
        let (h, u) = row_of_balls(n - 1);
        let cradle = problem(h, u, vec![stop(1.0); n - 1]);
        for order in
            [Order::MostApproaching, Order::Cycle((0..n - 1).collect()), Order::Cycle((0..n - 1).rev().collect())]
        {
            let hit = run(&cradle, order);
            assert_eq!((hit.iterations, hit.is_solved(&Accuracy::default())), (n - 1, true));
            for i in 0..n - 1 {
                close("every contact transmits the whole impulse", hit.impulse[i], 1.0, EXACT);
            }
        }
        let set = cradle.all_orders(200, &Accuracy::default());
        assert_eq!((set.outcomes.len(), set.spread, set.complete), (1, 0.0, n < 8));
        assert_eq!(set.tried, [2, 24, 200][[3, 5, 8].iter().position(|&m| m == n).unwrap()]);
    }
}

/// Of all velocities after which no contact approaches, Moreau's is the nearest to those before in the metric of
/// kinetic energy; a sequence is at least as far.
#[test]
fn without_restitution_moreaus_law_changes_velocities_least() {
    let mut rng = fastrand::Rng::with_seed(81);
    for _ in 0..200 {
        let n = rng.usize(2..5);
        let problem = any_motion(&mut rng, vec![stop(0.0); n], 2);
        let moreau = problem.simultaneous(&Accuracy::default(), None).unwrap();
        let accuracy = Accuracy { tolerance: 1e-12, max_iterations: 100_000 };
        let hit = problem.sequential(&Order::MostApproaching, &accuracy).unwrap();
        assert!(hit.is_solved(&accuracy), "{hit:?}");
        let way = |p: &DVector<f64>| p.dot(&(problem.delassus() * p)).sqrt();
        assert!(way(&hit.impulse) >= way(&moreau.impulse) - 1e-9 && hit.energy_change <= EXACT);
    }
}

/// Held constraints are satisfied throughout; dry friction uses its bound.
#[test]
fn dry_joints_use_their_bound_and_held_ones_stay() {
    let h = dmatrix![2.0, 0.5, 0.3; 0.5, 1.0, 0.2; 0.3, 0.2, 1.5];
    let constraints = |bound| vec![Constraint::Dry { bound }, Constraint::Held, stop(0.5)];
    for bound in [0.0, 0.1, 10.0] {
        let one = problem(h.clone(), dvector![1.0, 1.0, -1.0], constraints(bound));
        for order in [Order::MostApproaching, Order::Cycle(vec![2, 0]), Order::Cycle(vec![0, 1, 2])] {
            let hit = run(&one, order);
            assert!(hit.is_solved(&Accuracy::default()), "{hit:?}");
            close("held", hit.u_plus[1], 0.0, EXACT);
            assert!(hit.impulse[0].abs() <= bound && hit.u_plus[2] >= -EXACT && hit.energy_change < 0.0);
            let at_rest = hit.u_plus[0].abs() <= EXACT;
            assert!(at_rest || hit.impulse[0] == -bound * hit.u_plus[0].signum(), "{bound}: {hit:?}");
            assert_eq!(at_rest, bound == 10.0);
        }
    }
    // A stop whose inverse mass is zero while the other constraint is held.
    let locked = problem(dmatrix![1.0, 1.0; 1.0, 1.0], dvector![-1.0, -1.0], vec![Constraint::Held, stop(0.5)]);
    let hit = run(&locked, Order::MostApproaching);
    close("at rest", hit.u_plus.amax(), 0.0, EXACT);
    assert_eq!(hit.iterations, 0);
}

/// A bead between two walls that approach each other: with e = 1 the sequence does not end.
#[test]
fn sequence_between_two_walls_is_reported_as_unfinished() {
    let gripped = problem(dmatrix![1.0, -1.0; -1.0, 1.0], dvector![-1.0, 0.5], vec![stop(1.0); 2]);
    for order in [Order::MostApproaching, Order::Cycle(vec![1, 0])] {
        let hit = run(&gripped, order);
        assert_eq!((hit.iterations, hit.is_solved(&Accuracy::default())), (Accuracy::default().max_iterations, false));
        assert!(hit.residual > 0.1 && hit.impulse.iter().all(|p| p.is_finite()));
    }
    assert_eq!(gripped.all_orders(10, &Accuracy::default()).unfinished, 2);
    // No inverse mass: no unbounded impulse, no endless loop.
    let fixed = problem(dmatrix![0.0], dvector![-1.0], vec![stop(1.0)]);
    let hit = run(&fixed, Order::Cycle(vec![0]));
    assert_eq!((hit.iterations, hit.is_solved(&Accuracy::default()), hit.residual), (0, false, 1.0));
    assert!(!hit.flags.contains(Flags::NO_APPROACH), "the contact approaches");
}

#[test]
fn conditions_hold_in_4000_random_sequences() {
    let mut rng = fastrand::Rng::with_seed(82);
    let (mut gains, mut unfinished, mut most) = (0, 0, 0);
    for case in 0..4000 {
        let rough = case % 2 == 1;
        let constraints: Vec<_> = (0..rng.usize(2..=5))
            .map(|_| match rng.u8(0..6) {
                0 => Constraint::Dry { bound: rng.f64() },
                1 => Constraint::Held,
                2 => stop(rng.f64()),
                _ => contact(rng.f64(), if rough { rng.f64() } else { 0.0 }),
            })
            .collect();
        let one = any_motion(&mut rng, constraints.clone(), 1);
        let u = one.u_minus();
        let mut order: Vec<_> = (0..constraints.len()).collect();
        rng.shuffle(&mut order);
        let hit = run(&one, if rng.bool() { Order::Cycle(order) } else { Order::MostApproaching });
        unfinished += usize::from(!hit.is_solved(&Accuracy::default()));
        most = most.max(hit.iterations);
        let mut i = 0;
        for constraint in &constraints {
            let n = i + constraint.rows() - 1;
            let p = hit.impulse[n];
            match *constraint {
                Constraint::Contact { friction, .. } => {
                    assert!(p >= 0.0 && hit.impulse.rows(i, 2).norm() <= friction * p * (1.0 + EXACT));
                    assert!(!hit.is_solved(&Accuracy::default()) || hit.u_plus[n] >= -1e-11 * u.amax());
                }
                Constraint::Stop { .. } => assert!(p >= 0.0),
                Constraint::Dry { bound } => assert!(p.abs() <= bound),
                Constraint::Held => assert!(hit.u_plus[n].abs() <= 1e-9 * (1.0 + hit.impulse.amax()), "{hit:?}"),
            }
            i = n + 1;
        }
        let gain = hit.flags.contains(Flags::ENERGY_GAIN);
        assert!(rough || !gain, "energy gain without friction: {one:?} {hit:?}");
        gains += usize::from(gain);
    }
    // Measured: none unfinished, 5 gains.
    assert!(unfinished <= 4 && (1..=20).contains(&gains), "{unfinished} {gains}");
}

#[test]
fn sets_of_orders_are_reproducible() {
    let mut rng = fastrand::Rng::with_seed(83);
    let n = 7;
    let (h, u) = gram(&mut rng, n, n);
    let mut constraints = vec![stop(0.7); n];
    constraints[3] = Constraint::Held;
    let one = problem(h, u, constraints);
    let set = one.all_orders(50, &Accuracy::default());
    assert_eq!(set, one.all_orders(50, &Accuracy::default()));
    assert_eq!((set.tried, set.complete), (50, false));
    let all = one.all_orders(720, &Accuracy::default());
    assert_eq!((all.tried, all.complete), (720, true));
    assert!(all.spread >= set.spread && all.outcomes.len() > 1);
    for found in &all.outcomes {
        assert!(!found.order.contains(&3), "what is held has no turn");
        let again = run(&one, Order::Cycle(found.order.clone()));
        assert_eq!(again, found.outcome);
        for i in 0..n {
            assert!((all.lower[i]..=all.upper[i]).contains(&again.u_plus[i]));
        }
    }
    // Without constraints there is one order, the empty one; a limit of none tries one.
    let none = problem(DMatrix::zeros(0, 0), DVector::zeros(0), vec![]).all_orders(0, &Accuracy::default());
    assert_eq!((none.tried, none.complete, none.outcomes.len(), none.spread), (1, true, 1, 0.0));
    assert_eq!(one.all_orders(0, &Accuracy::default()).tried, 1);
}

/// The set of outcomes does not depend on the unit of velocity.
#[test]
fn sets_of_orders_scale_with_the_velocities() {
    for scale in [1e-9, 1e-6, 1.0, 1e6, 1e9] {
        let rod = flat_rod(0.5, scale);
        let set = rod.all_orders(2, &Accuracy::default());
        assert_eq!((set.outcomes.len(), set.unfinished), (2, 0), "{scale}");
        for (found, [left, right]) in set.outcomes.iter().zip([[0.40625, 0.265625], [0.265625, 0.40625]]) {
            all_close("ends", &(&found.outcome.u_plus / scale), [left, right], EXACT);
        }
        close("spread", set.spread / scale, 0.140625 * 2.0_f64.sqrt(), EXACT);
    }
}

/// Bodies that rest in contact have no sub-impact, and with a tolerance of zero neither has a constraint that is
/// satisfied exactly.
#[test]
fn satisfied_constraints_have_no_sub_impact() {
    let exactly = Accuracy { tolerance: 0.0, ..Accuracy::default() };
    for order in [Order::Cycle(vec![0, 1]), Order::MostApproaching] {
        for accuracy in [Accuracy::default(), exactly] {
            let at_rest = flat_rod(0.5, 0.0);
            let hit = at_rest.sequential(&order, &accuracy).unwrap();
            assert_eq!((hit.iterations, hit.is_solved(&accuracy), hit.residual), (0, true, 0.0), "{order:?}");
            assert_eq!((hit.impulse, hit.u_plus), (DVector::zeros(2), DVector::zeros(2)));
        }
        // Newton's cradle, in exact numbers.
        let cradle = problem(dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0], vec![stop(1.0); 2]);
        let hit = cradle.sequential(&order, &exactly).unwrap();
        assert_eq!((hit.iterations, hit.is_solved(&exactly), hit.impulse), (2, true, dvector![1.0, 1.0]), "{order:?}");
    }
}

/// A contact that moves along one tangent only, and has no coupling between tangents and normal: where it sticks,
/// friction acts along that tangent, whatever its direction, `P_t = -v_t/A`.
#[test]
fn contact_with_one_tangent_of_motion_sticks_along_it() {
    for k in 0..100 {
        let angle = 0.1 + f64::from(k);
        let tangent = dvector![angle.cos(), angle.sin(), 0.0];
        let normal = dvector![0.0, 0.0, 1.0];
        let h = &tangent * tangent.transpose() * 3.5 + &normal * normal.transpose();
        let slip = 0.4 / 3.0;
        let one = problem(h, &tangent * slip - &normal, vec![contact(0.5, 0.7)]);
        for order in [Order::Cycle(vec![0]), Order::MostApproaching] {
            let hit = run(&one, order);
            assert!(hit.is_solved(&Accuracy::default()));
            let expected = &tangent * (-slip / 3.5) + &normal * 1.5;
            close("impulse", (&hit.impulse - expected).amax(), 0.0, 1e-14);
            close("slip", hit.u_plus.rows(0, 2).amax(), 0.0, 1e-14);
        }
        let hit = one.simultaneous(&Accuracy::default(), None).unwrap();
        close("Moreau", (hit.impulse - &tangent * (-slip / 3.5) - &normal * 1.5).amax(), 0.0, 1e-12);
    }
}

#[test]
fn invalid_orders_are_refused() {
    let three =
        problem(DMatrix::identity(3, 3), dvector![-1.0, 0.0, 0.0], vec![stop(0.0), Constraint::Held, stop(0.0)]);
    let refused = |order| three.sequential(&Order::Cycle(order), &Accuracy::default()).unwrap_err().to_string();
    assert_eq!(refused(vec![0, 3]), "the order contains constraint 3, but there are 3, counted from 0");
    assert_eq!(
        refused(vec![0, 1, 0]),
        "the order does not contain constraint 2: list every constraint that is not held"
    );
    assert!(run(&three, Order::Cycle(vec![2, 0, 2])).is_solved(&Accuracy::default()));
}
