//! Problems of accelerations of lasting contacts, whose matrix is not symmetric where a contact slides.

use crate::common::{close, wide};
use carom_impact::{Accuracy, Constraint, SeveralProblem};
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

const STOP: Constraint = Constraint::Stop { restitution: 0.0 };

/// Contacts that slide fast along `d`: under Moreau's law with a tangential velocity so large that no impulse changes
/// its direction, and as stops whose forces act along n − μ d.
#[test]
fn sliding_contact_is_the_limit_of_fast_slip() {
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut presses, mut opens) = (0, 0);
    for _ in 0..300 {
        let (contacts, freedoms) = (rng.usize(1..=4), 13);
        let j =
            DMatrix::from_fn(
                3 * contacts,
                freedoms,
                |i, _| if i % 3 == 2 { wide(&mut rng) } else { 0.3 * wide(&mut rng) },
            );
        let free = DVector::from_fn(3 * contacts, |_, _| wide(&mut rng));
        let mu: Vec<f64> = (0..contacts).map(|_| rng.f64()).collect();
        let angles: Vec<f64> = (0..contacts).map(|_| std::f64::consts::TAU * rng.f64()).collect();
        // u_t is fast; impulses of size one change its direction by 1/fast.
        let fast = 1e7;
        let mut sliding = free.clone();
        let mut forces = DMatrix::zeros(contacts, freedoms);
        let normals = DMatrix::from_fn(contacts, freedoms, |k, i| j[(3 * k + 2, i)]);
        for k in 0..contacts {
            let d = dvector![angles[k].cos(), angles[k].sin()];
            sliding[3 * k] = fast * d[0];
            sliding[3 * k + 1] = fast * d[1];
            let along = j.rows(3 * k, 2).tr_mul(&d);
            forces.row_mut(k).copy_from(&(normals.row(k) - along.transpose() * mu[k]));
        }
        let rough = mu.iter().map(|&friction| Constraint::Contact { restitution: 0.0, friction }).collect();
        let limit = SeveralProblem::new(&j * j.transpose(), sliding, rough).unwrap();
        let limit = limit.simultaneous(&Accuracy { tolerance: 1e-15, ..Accuracy::default() }, None).unwrap();
        let free = DVector::from_fn(contacts, |k, _| free[3 * k + 2]);
        let slides =
            SeveralProblem::of_accelerations(&normals * forces.transpose(), free, vec![STOP; contacts]).unwrap();
        let slides = slides.simultaneous(&Accuracy::default(), None).unwrap();
        assert!(slides.residual <= 1e-12 && limit.residual <= 1e-15, "{slides:?} {limit:?}");
        for k in 0..contacts {
            // The direction of the slip, 1/fast, and the residual 1e-15 · fast, with condition numbers up to a hundred.
            let within = 1e-6 * (1.0 + slides.impulse.amax());
            close("force", slides.impulse[k], limit.impulse[3 * k + 2], within);
            close("acceleration", slides.u_plus[k], limit.u_plus[3 * k + 2], within);
            if slides.impulse[k] > 0.0 { presses += 1 } else { opens += 1 }
        }
    }
    assert!(presses > 100 && opens > 100, "both are tested: {presses} press, {opens} open");
}

/// A linear complementarity problem 0 ≤ p ⟂ a + A p ≥ 0 whose matrix is not symmetric has exactly one solution if all
/// principal minors of A are positive; by trying all sets of pressing contacts.
#[test]
fn sliding_contacts_press_where_the_complementarity_problem_says() {
    let mut rng = fastrand::Rng::with_seed(2);
    let mut asymmetric = 0;
    for _ in 0..500 {
        let n = rng.usize(1..=6);
        // A positive definite symmetric part has positive principal minors.
        let g = DMatrix::from_fn(n, n, |_, _| wide(&mut rng));
        let turn = DMatrix::from_fn(n, n, |_, _| wide(&mut rng));
        let a = &g * g.transpose() + DMatrix::identity(n, n) * 0.1 + (&turn - turn.transpose());
        asymmetric += usize::from((&a - a.transpose()).amax() > 0.1);
        let free = DVector::from_fn(n, |_, _| wide(&mut rng));
        let found = SeveralProblem::of_accelerations(a.clone(), free.clone(), vec![STOP; n])
            .unwrap()
            .simultaneous(&Accuracy::default(), None)
            .unwrap();
        assert!(found.residual <= 1e-12, "{found:?}");
        let solutions: Vec<DVector<f64>> = (0..1_usize << n)
            .filter_map(|set| {
                let pressing: Vec<usize> = (0..n).filter(|k| set >> k & 1 == 1).collect();
                let mut p = DVector::zeros(n);
                if !pressing.is_empty() {
                    let own = a.select_rows(&pressing).select_columns(&pressing);
                    let solved = own.lu().solve(&-free.select_rows(&pressing))?;
                    pressing.iter().zip(&solved).for_each(|(&k, value)| p[k] = *value);
                }
                let rate = &free + &a * &p;
                let open = (0..n).filter(|k| !pressing.contains(k));
                (p.min() >= 0.0 && open.into_iter().all(|k| rate[k] >= 0.0)).then_some(p)
            })
            .collect();
        assert_eq!(solutions.len(), 1);
        // Condition numbers up to a hundred.
        close("force", (&solutions[0] - &found.impulse).amax(), 0.0, 1e-10);
    }
    assert!(asymmetric > 300, "{asymmetric}");
}

/// Painlevé's inconsistent case: friction is so large that pressing increases the approach. No force is a solution; with
/// an acceleration that opens the contact there are two, of which the open one is found.
#[test]
fn inconsistent_painleve_case_has_a_residual_and_no_nan() {
    for (matrix, free, stops) in [
        (dmatrix![-0.4], dvector![-1.0], 1),
        (dmatrix![0.0], dvector![-1.0], 1),
        (dmatrix![-0.4, 0.3; -0.2, -0.1], dvector![-1.0, -0.5], 2),
        (dmatrix![1e-9, 0.0; 0.0, -1e9], dvector![-1.0, -1e3], 2),
    ] {
        let problem = SeveralProblem::of_accelerations(matrix, free, vec![STOP; stops]).unwrap();
        for start in [None, Some(DVector::from_element(stops, 1.0))] {
            let found = problem.simultaneous(&Accuracy::default(), start.as_ref()).unwrap();
            assert!(found.residual > 1e-6 && found.residual.is_finite(), "{found:?}");
            assert!(found.impulse.iter().chain(&found.u_plus).all(|x| x.is_finite()), "{found:?}");
        }
    }
    let opens = SeveralProblem::of_accelerations(dmatrix![-0.4], dvector![1.0], vec![STOP]).unwrap();
    let found = opens.simultaneous(&Accuracy::default(), None).unwrap();
    assert_eq!((found.impulse[0], found.residual), (0.0, 0.0));
}

#[test]
fn refused_problems_name_the_value() {
    let refused = |a, free| SeveralProblem::of_accelerations(a, free, vec![STOP; 2]).unwrap_err().to_string();
    let message = refused(DMatrix::identity(2, 3), dvector![0.0, 0.0]);
    assert!(message.starts_with("delassus is 2 x 3"), "{message}");
    let message = refused(dmatrix![1.0, 0.0; f64::NAN, 1.0], dvector![0.0, 0.0]);
    assert!(message.contains("is NaN: every"), "{message}");
    let message = refused(dmatrix![1.0, 0.0; 3.0, 1.0], dvector![0.0, f64::INFINITY]);
    assert!(message.starts_with("free[1] is inf: every"), "{message}");
}
