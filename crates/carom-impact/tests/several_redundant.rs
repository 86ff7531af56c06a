//! Moreau's law with more rows than degrees of freedom: the thin factors of H against the whole matrix, and random
//! problems with all kinds of constraints.

use crate::common::{close, contact, moreau, problem, solve, wide};
use carom_impact::{Accuracy, Constraint};
use nalgebra::{DMatrix, DVector};

/// Two contacts on seven freedoms, with a coupling of tangents and normals small enough for one solution, and
/// the same contacts listed four times: H then has a quarter of full rank, and is used in factors. The velocities are
/// the same, and the impulses of the copies add up to those of the contact.
#[test]
fn contacts_listed_several_times_change_nothing() {
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut sticks, mut slips, mut opens) = (0, 0, 0);
    for _ in 0..500 {
        let j = DMatrix::from_fn(6, 7, |i, _| if i % 3 == 2 { wide(&mut rng) } else { 0.5 * wide(&mut rng) });
        // H of six rows is regular: any velocity is possible, and contacts stick where they slip slowly before.
        let slip = rng.f64().powi(3);
        let u = DVector::from_fn(6, |i, _| if i % 3 == 2 { wide(&mut rng) } else { slip * wide(&mut rng) });
        let constraints: Vec<_> = (0..2).map(|_| contact(rng.f64(), rng.f64())).collect();
        let once = solve(&j * j.transpose(), u.clone(), constraints.clone());
        let copies = DMatrix::from_fn(24, 7, |i, k| j[(i % 6, k)]);
        let many = solve(&copies * copies.transpose(), DVector::from_fn(24, |i, _| u[i % 6]), constraints.repeat(4));
        assert!(once.residual <= 1e-12 && many.residual <= 1e-12, "{once:?} {many:?}");
        for i in 0..6 {
            let sum: f64 = (0..4).map(|copy| many.impulse[6 * copy + i]).sum();
            // The residual over the least eigenvalue of H, which is above 1e-3 in nearly all.
            close("velocity", many.u_plus[i], once.u_plus[i], 1e-9);
            close("impulse", sum, once.impulse[i], 1e-7);
        }
        for k in 0..2 {
            match (once.impulse[3 * k + 2] > 0.0, once.u_plus.rows(3 * k, 2).norm() < 1e-9) {
                (false, _) => opens += 1,
                (true, true) => sticks += 1,
                (true, false) => slips += 1,
            }
        }
    }
    assert!(sticks > 50 && slips > 50 && opens > 50, "all are tested: {sticks} {slips} {opens}");
}

/// Held rows, dry friction and stops among rough contacts, on half as many freedoms as rows. With e = 0 a solution
/// always exists, and it is found from any start: none, or that of other velocities.
#[test]
fn inelastic_constraints_of_all_kinds_are_always_solved() {
    let mut unsolved = Vec::new();
    for seed in 0..8 {
        let mut rng = fastrand::Rng::with_seed(seed);
        for k in 0..500 {
            let constraints: Vec<_> = (0..rng.usize(1..=9))
                .map(|_| match rng.u8(0..10) {
                    0 => Constraint::Stop { restitution: 0.0 },
                    1 => Constraint::Dry { bound: rng.f64() },
                    2 => Constraint::Held,
                    3 => contact(0.0, 0.0),
                    _ => contact(0.0, 3.0 * rng.f64()),
                })
                .collect();
            let rows: usize = constraints.iter().map(Constraint::rows).sum();
            let j = DMatrix::from_fn(rows, rows.div_ceil(2), |_, _| wide(&mut rng));
            let v = DVector::from_fn(j.ncols(), |_, _| wide(&mut rng));
            let moving = |v: DVector<f64>| problem(&j * j.transpose(), &j * v, constraints.clone());
            let first = moreau(&moving(v.clone()));
            let near = moving(v.map(|v| v + 0.02 * wide(&mut rng)));
            let next = near.simultaneous(&Accuracy::default(), Some(&first.impulse)).unwrap();
            for hit in [&first, &next] {
                if hit.residual > 1e-10 {
                    unsolved.push((seed, k, hit.residual));
                }
                // Its work cannot be positive: each impulse opposes the velocity it leaves.
                assert!(hit.energy_change <= 1e-9, "{hit:?}");
            }
        }
    }
    assert!(unsolved.is_empty(), "{unsolved:?}");
}

/// The solution of a problem is returned as it is, without an iteration, and after a small change of the velocities it
/// has the modes of the next one: Newton's method converges at once, in half as many iterations as without it.
#[test]
fn warm_start_saves_iterations() {
    let mut rng = fastrand::Rng::with_seed(3);
    let (mut with, mut without) = (0, 0);
    for _ in 0..100 {
        let j = DMatrix::from_fn(15, 6, |_, _| wide(&mut rng));
        let v = DVector::from_fn(6, |_, _| wide(&mut rng));
        let solved = |v: &DVector<f64>, start: Option<&DVector<f64>>| {
            let problem = problem(&j * j.transpose(), &j * v, vec![contact(0.0, 0.5); 5]);
            problem.simultaneous(&Accuracy::default(), start).unwrap()
        };
        let cold = solved(&v, None);
        let warm = solved(&v, Some(&cold.impulse));
        assert_eq!(warm.iterations, 0, "{cold:?}");
        // Projected on the cones once more.
        close("impulse", (&warm.impulse - &cold.impulse).amax(), 0.0, 4.0 * f64::EPSILON * cold.impulse.amax());
        let near = v.map(|v| v + 1e-4 * wide(&mut rng));
        let (next, again) = (solved(&near, Some(&cold.impulse)), solved(&near, None));
        assert!(next.residual <= 1e-12 && again.residual <= 1e-12, "{next:?} {again:?}");
        (with, without) = (with + next.iterations, without + again.iterations);
    }
    assert!(2 * with <= without, "{with} {without}");
}
