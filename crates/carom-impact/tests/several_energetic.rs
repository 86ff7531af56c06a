//! The energetic law for several contacts: elastic contacts as its limit, its equations along the impulse of one contact,
//! works, invariances, closed forms.

use crate::common::{all_close, balls, close, contact, flat_rod, gram, problem, row_of_balls, stop, wide};
use carom_impact::{
    Accuracy, Constraint, Energetic, EnergeticOutcome, Flags, HuntCrossley, ImpactError, ImpactProblem, Law,
    NormalForce, Order, SeveralProblem, Stiffnesses, TangentialForce, WaltonBraun, compliant_impact,
};
use nalgebra::{DMatrix, DVector, dmatrix, dvector, matrix, vector};

/// Of the velocities: a hundred steps, each with an error below 1e-13, of which most is cancelled.
const ACCURATE: f64 = 1e-11;

fn energetic(problem: &SeveralProblem, exponent: f64, ratios: &[f64]) -> EnergeticOutcome {
    let hit = problem.energetic(&Stiffnesses { exponent, ratios }, &Accuracy::default()).unwrap();
    assert!(hit.total.residual <= 1e-11, "{hit:?}");
    hit
}

/// A problem that some motion has: rows of random directions in `freedoms` freedoms. With more contacts than freedoms they
/// are on one side of the body.
fn random(rng: &mut fastrand::Rng, contacts: usize, freedoms: usize) -> (DMatrix<f64>, DVector<f64>) {
    let one_side = |i| contacts > freedoms && i == 0;
    let j = DMatrix::from_fn(contacts, freedoms, |_, i| if one_side(i) { 1.0 } else { wide(rng) });
    let v = DVector::from_fn(freedoms, |_, _| wide(rng));
    (&j * j.transpose(), &j * v)
}

/// Published and computed with compliant contacts elsewhere; all digits that are known.
#[test]
fn elastic_cradles_disperse_as_elastic_contacts_do() {
    for (exponent, ratios, expected, within) in [
        (1.0, vec![], vec![-0.130262, 0.150230, 0.980032], 1e-6),
        (1.5, vec![], vec![-0.070952, 0.076403, 0.994549], 1e-6),
        (1.5, vec![10.0, 1.0], vec![-0.006184, 0.006222, 0.999962], 1e-6),
        (1.5, vec![0.1, 1.0], vec![-0.325713, 0.575813, 0.749900], 1e-6),
        (1.5, vec![], vec![-0.07109, -0.03027, -0.01446, 0.12704, 0.98878], 1e-5),
    ] {
        let (h, u) = row_of_balls(expected.len() - 1);
        let hit = energetic(&problem(h, u, vec![stop(1.0); expected.len() - 1]), exponent, &ratios);
        all_close("velocities", &balls(&hit.total.impulse), expected, within);
        close("kinetic energy", balls(&hit.total.impulse).iter().map(|v| v * v).sum(), 1.0, ACCURATE);
        close("momentum", balls(&hit.total.impulse).iter().sum(), 1.0, ACCURATE);
    }
}

/// The compliant impact is another formulation (time, forces in newtons) with another integrator, exact to about 1e-8.
#[test]
fn elastic_contacts_are_the_limit_of_compliant_ones() {
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut again, mut redundant) = (0, 0);
    for k in 0..45 {
        let (contacts, freedoms) = (rng.usize(2..=4), rng.usize(2..=5));
        let (h, u) = random(&mut rng, contacts, freedoms);
        let ratios: Vec<f64> = (0..contacts).map(|_| 10.0_f64.powf(wide(&mut rng))).collect();
        let exponent = [1.0, 1.5, 2.0][k % 3];
        let elastic = |k: &f64| {
            let normal = HuntCrossley::new(1e6 * k, exponent, 1.0).unwrap();
            (NormalForce::HuntCrossley(normal), TangentialForce::Frictionless)
        };
        let contacts: Vec<_> = ratios.iter().map(elastic).collect();
        let soft = compliant_impact(&h, &u, &contacts).unwrap();
        let hit = energetic(&problem(h, u.clone(), vec![stop(1.0); ratios.len()]), exponent, &ratios);
        let error = (&hit.total.u_plus - &soft.u_plus).amax() / u.amax();
        assert!(error < 1e-7, "{k}: {error:e} {hit:?} {soft:?}");
        again += usize::from(hit.compressions.iter().any(|times| *times > 1));
        redundant += usize::from(freedoms < ratios.len());
    }
    assert!(again > 2 && redundant > 5, "{again} with a second compression, {redundant} redundant");
}

/// Springs that unload along a steeper line (Walton & Braun) return e² of the work, where no contact is compressed again.
#[test]
fn inelastic_contacts_are_the_limit_of_springs_with_a_steeper_unloading() {
    let mut rng = fastrand::Rng::with_seed(2);
    let mut compared = 0;
    for _ in 0..60 {
        let contacts = rng.usize(1..=3);
        let (h, u) = random(&mut rng, contacts, 4);
        let e: Vec<f64> = (0..contacts).map(|_| 0.2 + 0.8 * rng.f64()).collect();
        let springs = |e: &f64| {
            let normal = NormalForce::WaltonBraun(WaltonBraun::new(1e6, *e).unwrap());
            (normal, TangentialForce::Frictionless)
        };
        let soft = compliant_impact(&h, &u, &e.iter().map(springs).collect::<Vec<_>>()).unwrap();
        let hit = energetic(&problem(h, u.clone(), e.iter().map(|e| stop(*e)).collect()), 1.0, &[]);
        if hit.compressions.iter().all(|times| *times <= 1) && hit.total.impulse.amax() > 0.0 {
            compared += 1;
            let error = (&hit.total.u_plus - &soft.u_plus).amax() / u.amax();
            assert!(error < 1e-7, "{error:e} {hit:?} {soft:?}");
        }
    }
    assert!(compared > 20, "{compared}");
}

/// The law as published: along the impulse of one contact, with the energies as state, started by their series. By the
/// classical method of Runge and Kutta.
#[test]
fn impulses_grow_in_the_ratios_that_stored_energies_give() {
    let (h, u) = (dmatrix![2.0, -0.6; -0.6, 1.5], dvector![-1.0, -0.4]);
    let (e, k, n) = ([0.7, 0.4], [1.0, 3.0], 1.5_f64);
    let hit = energetic(&problem(h.clone(), u.clone(), vec![stop(e[0]), stop(e[1])]), n, &k);
    // The first contact is primary; the second begins in the ratio k₂/k₁ (u₂/u₁)^η. Phase by phase, as both compress, the
    // second expands first and ends, then the first.
    let mut state = [0.0_f64; 4]; // P₁, P₂, E₁, E₂
    let start = 1e-7;
    let share = k[1] / k[0] * (u[1] / u[0]).powf(n);
    state[0] = start;
    state[1] = start * share;
    // dE/dP = -u: to the lowest order.
    state[2] = -u[0] * start;
    state[3] = -u[1] * start * share;
    let rate = |s: [f64; 4]| {
        let v = [0, 1].map(|i| u[i] + h[(i, 0)] * s[0] + h[(i, 1)] * s[1]);
        let ratio = (k[1] / k[0]).powf(1.0 / (n + 1.0)) * (s[3].max(0.0) / s[2].max(1e-300)).powf(n / (n + 1.0));
        let growth = [0, 1].map(|i| if v[i] < 0.0 { -v[i] } else { -v[i] / (e[i] * e[i]) });
        [1.0, ratio, growth[0], growth[1] * ratio]
    };
    let step = 2e-6;
    let add = |s: [f64; 4], r: [f64; 4], h: f64| std::array::from_fn(|i| s[i] + h * r[i]);
    while state[2] > 0.0 {
        let a = rate(state);
        let b = rate(add(state, a, step / 2.0));
        let c = rate(add(state, b, step / 2.0));
        let d = rate(add(state, c, step));
        state = std::array::from_fn(|i| state[i] + step / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    // The last step and the start are of the order of 1e-6.
    close("first impulse", hit.total.impulse[0], state[0], 1e-5);
    close("second impulse", hit.total.impulse[1], state[1], 1e-5);
    assert_eq!(hit.compressions, [1, 1]);
}

#[test]
fn one_contact_is_stronges_impact() {
    for e in [0.0, 1e-9, 1e-3, 0.3, 0.5, 0.9, 1.0] {
        for (exponent, stiffness) in [(1.0, 1.0), (1.5, 1e9), (3.0, 1e-9)] {
            let hit = energetic(&problem(dmatrix![2.5], dvector![-3.0], vec![stop(e)]), exponent, &[stiffness]);
            let one = ImpactProblem::new(matrix![1.0, 0.0; 0.0, 2.5], vector![0.0, -3.0]).unwrap();
            let stronge = Energetic { restitution: e, friction: 0.0 }.resolve(&one).unwrap();
            close("velocity", hit.total.u_plus[0], stronge.u_plus[1], 3.0 * ACCURATE);
            close("impulse", hit.total.impulse[0], stronge.impulse[1], ACCURATE);
            close("energy stored", hit.stored[0], 0.5 * 9.0 / 2.5, ACCURATE);
            assert_eq!(hit.compressions, [1]);
        }
    }
}

/// Contacts that don't act on one another are independent, however different their masses, speeds and stiffnesses.
#[test]
fn uncoupled_contacts_rebound_each_with_its_own_coefficient() {
    let h = DMatrix::from_diagonal(&dvector![1e-3, 1.0, 20.0, 1.0]);
    let e = [0.2, 0.9, 0.0, 0.5];
    let hit =
        energetic(&problem(h, dvector![-1.0, -5.0, -0.1, 0.3], e.map(stop).to_vec()), 1.5, &[1.0, 1e4, 1e-2, 1.0]);
    all_close("velocity", &hit.total.u_plus, [0.2, 4.5, 0.0, 0.3], 5.0 * ACCURATE);
}

#[test]
fn energy_lost_is_the_share_of_the_stored_energy_that_is_not_returned() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut again = 0;
    for k in 0..60 {
        let (contacts, freedoms) = (rng.usize(1..=5), rng.usize(1..=6));
        let (h, u) = gram(&mut rng, contacts, freedoms);
        // Without e = 1, with which contacts on both sides of a body need not end.
        let e: Vec<f64> = (0..contacts).map(|_| if rng.u8(0..5) == 0 { 0.0 } else { 0.7 * rng.f64() }).collect();
        let ratios: Vec<f64> = (0..contacts).map(|_| 10.0_f64.powf(wide(&mut rng))).collect();
        let exponent = [1.0, 1.5, 2.5][k % 3];
        let hit = energetic(&problem(h.clone(), u.clone(), e.iter().map(|e| stop(*e)).collect()), exponent, &ratios);
        let EnergeticOutcome { total, stored, .. } = &hit;
        let lost: f64 = stored.iter().zip(&e).map(|(stored, e)| (1.0 - e * e) * stored).sum();
        let change = 0.5 * total.impulse.dot(&(&u + &total.u_plus));
        close("energy change", change, -lost, 1e-11 * stored.sum().max(1e-300));
        close("energy change", total.energy_change, change, 1e-15);
        // What approaches at the end has less than 1e-11 of the velocities.
        assert!(total.impulse.min() >= 0.0 && total.u_plus.min() >= -1e-11 * u.amax() - 1e-15, "{hit:?}");
        assert!(stored.min() >= 0.0);
        assert!((&u + &h * &total.impulse - &total.u_plus).amax() < 1e-14);
        assert!(!total.flags.contains(Flags::ENERGY_GAIN));
        assert_eq!(total.flags.contains(Flags::NO_APPROACH), u.min() >= 0.0);
        again += usize::from(hit.compressions.iter().any(|times| *times > 1));
    }
    assert!(again > 10, "{again} with a second compression");
}

#[test]
fn order_of_the_contacts_and_units_do_not_matter() {
    let mut rng = fastrand::Rng::with_seed(4);
    for _ in 0..12 {
        let (h, u) = random(&mut rng, 4, 5);
        let e: Vec<f64> = (0..4).map(|_| rng.f64()).collect();
        let k: Vec<f64> = (0..4).map(|_| 10.0_f64.powf(wide(&mut rng))).collect();
        let constraints: Vec<_> = e.iter().map(|e| stop(*e)).collect();
        let hit = energetic(&problem(h.clone(), u.clone(), constraints.clone()), 1.5, &k);

        let order = [2, 0, 3, 1];
        let other = problem(
            h.select_rows(&order).select_columns(&order),
            u.select_rows(&order),
            order.iter().map(|&i| constraints[i]).collect(),
        );
        let turned = energetic(&other, 1.5, &order.map(|i| k[i]));
        let error = (hit.total.u_plus.select_rows(&order) - &turned.total.u_plus).amax();
        assert!(error < ACCURATE, "order: {error:e}");

        let harder: Vec<f64> = k.iter().map(|k| 3.7e8 * k).collect();
        let same = energetic(&problem(h.clone(), u.clone(), constraints.clone()), 1.5, &harder);
        assert!((&hit.total.u_plus - same.total.u_plus).amax() < ACCURATE, "stiffnesses");

        // Newton's equations have no preferred speed: all velocities are multiplied alike.
        let fast = energetic(&problem(&h * 7e-5, &u * 3e4, constraints), 1.5, &k);
        assert!((&hit.total.u_plus - fast.total.u_plus / 3e4).amax() < ACCURATE, "units");
    }
}

/// A rod that falls flat turns if its ends differ.
#[test]
fn flat_rod_turns_with_unequal_ends() {
    let rod = flat_rod(1.0, 1.0);
    let hit = energetic(&rod, 1.0, &[1.0, 4.0]);
    // Springs: δ'' = -H diag(k) δ with ω² = 10 ∓ √52, both forces at once until the first end separates.
    assert!(hit.total.u_plus[0] != hit.total.u_plus[1]);
    let springs = [1.0, 4.0].map(|k| {
        let normal = NormalForce::HuntCrossley(HuntCrossley::new(k, 1.0, 1.0).unwrap());
        (normal, TangentialForce::Frictionless)
    });
    let soft = compliant_impact(rod.delassus(), &dvector![-1.0, -1.0], &springs).unwrap();
    assert!((hit.total.u_plus - soft.u_plus).amax() < 1e-8);
}

/// A box of 1 kg falls on four corners of which three are enough: H has rank 3.
#[test]
fn box_on_four_corners_shares_the_impulse_by_stiffness() {
    let rows = dmatrix![1.0, 1.0, 1.0; 1.0, -1.0, 1.0; 1.0, -1.0, -1.0; 1.0, 1.0, -1.0];
    let h = &rows * DMatrix::from_diagonal(&dvector![1.0, 3.0, 3.0]) * rows.transpose();
    let flat = problem(h.clone(), -DVector::from_element(4, 1.0), vec![stop(0.6); 4]);
    let hit = energetic(&flat, 1.5, &[]);
    all_close("impulses", &hit.total.impulse, [0.4; 4], ACCURATE);
    all_close("velocities", &hit.total.u_plus, [0.6; 4], ACCURATE);
    // With diagonals of different stiffness it still falls flat: each corner's impulse is as its stiffness.
    let hit = energetic(&flat, 1.5, &[1.0, 3.0, 1.0, 3.0]);
    all_close("impulses", &hit.total.impulse, [0.2, 0.6, 0.2, 0.6], ACCURATE);
}

/// Forces in parallel at one point add up.
#[test]
fn contact_listed_twice_with_half_its_stiffness_is_one_contact() {
    let (h, u) = (dmatrix![2.0, -0.7; -0.7, 1.0], dvector![-1.0, -0.2]);
    let one = energetic(&problem(h.clone(), u.clone(), vec![stop(0.6), stop(0.9)]), 1.5, &[2.0, 1.0]);
    let twice = [0, 0, 1];
    let two = problem(
        h.select_rows(&twice).select_columns(&twice),
        u.select_rows(&twice),
        vec![stop(0.6), stop(0.6), stop(0.9)],
    );
    let two = energetic(&two, 1.5, &[1.0, 1.0, 1.0]);
    close("impulse", two.total.impulse[0] + two.total.impulse[1], one.total.impulse[0], ACCURATE);
    close("velocity", two.total.u_plus[2], one.total.u_plus[1], ACCURATE);
}

/// If the first contact is much stiffer, its impact is over before the second contact has a force.
#[test]
fn impacts_become_sequential_as_the_struck_contact_gets_stiffer() {
    let (h, u) = row_of_balls(2);
    for e in [1.0, 0.5] {
        let cradle = problem(h.clone(), u.clone(), vec![stop(e); 2]);
        let one_after_another = cradle.sequential(&Order::MostApproaching, &Accuracy::default()).unwrap();
        let error = |ratio: f64| {
            let hit = energetic(&cradle, 1.0, &[ratio, 1.0]);
            (hit.total.impulse - &one_after_another.impulse).amax()
        };
        // The duration of the first impact relative to that of the second is as √ratio.
        assert!(error(1e4) < 0.03 && error(1e6) < 0.003, "{:e} {:e}", error(1e4), error(1e6));
    }
}

/// With e = 0 a contact that has stopped approaching keeps nothing: two balls go on together, if nothing separates them.
#[test]
fn inelastic_contact_returns_no_work() {
    let (h, u) = row_of_balls(1);
    let hit = energetic(&problem(h, u, vec![stop(0.0)]), 1.5, &[]);
    assert!(balls(&hit.total.impulse).iter().all(|v| (v - 0.5).abs() < ACCURATE));
    let (h, u) = row_of_balls(2);
    let hit = energetic(&problem(h, u, vec![stop(0.0); 2]), 1.5, &[]);
    close("work stored", hit.stored.sum(), -hit.total.energy_change, ACCURATE);
    assert!(hit.total.u_plus.min() >= -ACCURATE);
    // e → 0 is a limit.
    let (h, u) = row_of_balls(2);
    let near = energetic(&problem(h, u, vec![stop(1e-4); 2]), 1.5, &[]);
    assert!((hit.total.u_plus - near.total.u_plus).amax() < 1e-3);
}

/// A ball between two walls: it passes to and fro, slower by e each time, and comes to rest.
#[test]
fn ball_between_two_walls_comes_to_rest_or_never_ends() {
    let between = |e: f64| problem(dmatrix![1.0, -1.0; -1.0, 1.0], dvector![-1.0, 1.0], vec![stop(e); 2]);
    let hit = energetic(&between(0.8), 1.5, &[]);
    assert!(hit.total.u_plus.amax() < ACCURATE);
    close("energy", hit.total.energy_change, -0.5, ACCURATE);
    assert!(hit.compressions.iter().all(|times| *times > 10));
    let endless = between(1.0).energetic(&Stiffnesses::default(), &Accuracy::default());
    assert!(matches!(endless, Err(ImpactError::Endless { .. })), "{endless:?}");
}

#[test]
fn held_constraint_is_part_of_the_inertia() {
    let h = dmatrix![2.0, 0.5, 0.3; 0.5, 1.0, -0.2; 0.3, -0.2, 1.5];
    let hit = energetic(
        &problem(h.clone(), dvector![-1.0, -0.3, 0.0], vec![stop(0.7), stop(0.4), Constraint::Held]),
        1.5,
        &[1.0, 2.0, 1.0],
    );
    close("held", hit.total.u_plus[2], 0.0, ACCURATE);
    let held = h.view((0, 2), (2, 1)).into_owned();
    let rest = h.view((0, 0), (2, 2)) - &held * held.transpose() / 1.5;
    let alone = energetic(&problem(rest, dvector![-1.0, -0.3], vec![stop(0.7), stop(0.4)]), 1.5, &[1.0, 2.0]);
    assert!((hit.total.u_plus.rows(0, 2) - alone.total.u_plus).amax() < ACCURATE);
}

#[test]
fn invalid_data_is_refused_with_its_reason() {
    let (h, u) = row_of_balls(2);
    let cradle = problem(h, u, vec![stop(1.0); 2]);
    let refused = |exponent: f64, ratios: &[f64]| {
        cradle.energetic(&Stiffnesses { exponent, ratios }, &Accuracy::default()).unwrap_err().to_string()
    };
    assert!(refused(0.5, &[]).starts_with("exponent is 0.5: "));
    assert!(refused(f64::NAN, &[]).starts_with("exponent is NaN: "));
    assert!(refused(1.5, &[1.0, -2.0]).starts_with("stiffness is -2: "));
    assert!(refused(1.5, &[1.0]).starts_with("1 stiffnesses for 2 constraints: "));
    let rough = problem(DMatrix::identity(3, 3), dvector![0.0, 0.0, -1.0], vec![contact(0.5, 0.2)]);
    let why = rough.energetic(&Stiffnesses::default(), &Accuracy::default()).unwrap_err().to_string();
    assert!(why.starts_with("constraint 0: friction 0.2 "), "{why}");
    let stuck = problem(dmatrix![1.0, 0.0; 0.0, 0.0], dvector![-1.0, -1.0], vec![stop(1.0); 2]);
    let why = stuck.energetic(&Stiffnesses::default(), &Accuracy::default()).unwrap_err();
    assert!(matches!(why, ImpactError::SingularNormal { .. }), "{why}");
}

#[test]
fn smooth_contact_in_space_has_its_normal_impulse_only() {
    let h = dmatrix![3.0, 0.2, 0.4; 0.2, 2.0, -0.3; 0.4, -0.3, 1.6];
    let hit = energetic(&problem(h, dvector![0.7, 0.1, -1.0], vec![contact(0.5, 0.0)]), 1.5, &[]).total;
    assert!((&hit.impulse - dvector![0.0, 0.0, 1.5 / 1.6]).amax() < ACCURATE);
    close("slip", hit.u_plus[0], 0.7 + 0.4 * 1.5 / 1.6, ACCURATE);
}

/// One contact, cradles of up to five balls, and random contacts.
#[test]
fn impacts_are_as_exact_as_the_tolerance_asks() {
    let mut rng = fastrand::Rng::with_seed(7);
    for tolerance in [1e-6, 1e-9, 1e-12] {
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        for k in 0..=20 {
            let e = f64::from(k) / 20.0;
            let mut cases = vec![(dmatrix![1.0], dvector![-0.1])];
            cases.extend((1..=4).map(row_of_balls));
            cases.push(random(&mut rng, 3, 4));
            for (h, u) in cases {
                let rows = vec![stop(e); u.len()];
                let hit = problem(h, u, rows).energetic(&Stiffnesses::default(), &accuracy).unwrap().total;
                assert!(hit.is_solved(&accuracy), "e = {e}, tolerance {tolerance}: {hit:?}");
            }
        }
    }
}
