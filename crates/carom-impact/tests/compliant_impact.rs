//! Impacts through compliant contacts, integrated from first touch to the end: against closed forms, against the rigid
//! laws that are their limits, and against numbers of Newton's cradle.

use std::f64::consts::PI;

use crate::common::{Case, all_close, any_case, any_spatial, balls, close, pendulum, row_of_balls};
use carom_impact::{
    Bristle, CompliantOutcome, Damping, Energetic, HuntCrossley, ImpactError, ImpactProblem, KelvinVoigt, Law,
    NormalForce, Poisson, SmoothedCoulomb, TangentialForce, WaltonBraun, compliant_impact, restitution_obtained,
};
use nalgebra::{DMatrix, DVector, Vector2, dmatrix, dvector, matrix, vector};

/// Relative error of integrated impacts; kinks within a step increase it.
const EXACT: f64 = 3e-8;

const NO: TangentialForce = TangentialForce::Frictionless;

fn hunt_crossley(stiffness: f64, exponent: f64, e: f64) -> NormalForce {
    NormalForce::HuntCrossley(HuntCrossley::new(stiffness, exponent, e).unwrap())
}

fn kelvin_voigt(stiffness: f64, e: f64) -> NormalForce {
    NormalForce::KelvinVoigt(KelvinVoigt::new(stiffness, e).unwrap())
}

fn pulling(stiffness: f64, e: f64) -> NormalForce {
    NormalForce::KelvinVoigt(KelvinVoigt { pulls: true, ..KelvinVoigt::new(stiffness, e).unwrap() })
}

fn walton_braun(stiffness: f64, e: f64) -> NormalForce {
    NormalForce::WaltonBraun(WaltonBraun::new(stiffness, e).unwrap())
}

fn smoothed(mu: f64, slip_speed: f64) -> TangentialForce {
    TangentialForce::Smoothed(SmoothedCoulomb::new(mu, slip_speed).unwrap())
}

/// A ball of mass m against a wall at v0.
fn ball(law: NormalForce, mass: f64, v0: f64) -> CompliantOutcome {
    compliant_impact(&dmatrix![1.0 / mass], &dvector![-v0], &[(law, NO)]).unwrap()
}

/// The rebound is e for every mass, stiffness and speed; the penetration is the closed form; the energy balance holds.
#[test]
fn every_normal_force_rebounds_with_its_coefficient() {
    for (mass, k, v0) in [(1.0, 1.0, 1.0), (0.01, 1e9, 3.0), (300.0, 1e5, 0.02), (2.0, 1e12, 1e-3)] {
        for e in [0.05, 0.35, 0.8, 1.0] {
            let mut laws = vec![kelvin_voigt(k, e), pulling(k, e), walton_braun(k, e)];
            laws.extend([1.0, 1.5, 2.5].map(|n| hunt_crossley(k, n, e)));
            for law in laws {
                let hit = ball(law, mass, v0);
                let what = format!("{law:?} {mass} kg {v0} m/s");
                close(&what, hit.u_plus[0] / v0, e, EXACT);
                let depth = law.greatest_penetration(v0, mass);
                close(&what, hit.contacts[0].deepest / depth, 1.0, EXACT);
                let energy = 0.5 * mass * v0 * v0;
                close(&what, hit.energy_change / energy, e * e - 1.0, EXACT);
                close(&what, hit.work() / energy, hit.energy_change / energy, EXACT);
                if !matches!(law, NormalForce::KelvinVoigt(KelvinVoigt { pulls: true, .. })) {
                    close(&what, hit.contacts[0].energetic().unwrap(), e, EXACT);
                    close(&what, hit.contacts[0].absorbed / energy, 1.0, EXACT);
                }
            }
        }
    }
}

/// The rebound obtained with a published damping is that of the closed equation.
#[test]
fn integrated_rebounds_are_those_of_the_closed_equation() {
    for formula in Damping::ALL {
        for e in [0.2, 0.5, 0.9] {
            let law = HuntCrossley { formula, ..HuntCrossley::new(1e6, 1.5, e).unwrap() };
            let hit = ball(NormalForce::HuntCrossley(law), 0.7, 0.3);
            let expected = restitution_obtained(formula.number(e).unwrap());
            close(formula.name(), hit.u_plus[0] / 0.3, expected, EXACT);
        }
    }
}

/// Half a period of a spring, (1 + e)/2 of it after Walton & Braun, Hertz's 2.9433 d/v0, and the two ends of a damped
/// spring. Hertz: 2 ∫ dx/√(1 − x^(5/2)) from 0 to 1 = 2 √π Γ(7/5)/Γ(9/10).
#[test]
fn durations_and_peak_forces_are_the_closed_forms() {
    let (mass, k, v0): (f64, f64, f64) = (0.3, 2e6, 0.7);
    let period = (mass / k).sqrt();
    let spring = ball(hunt_crossley(k, 1.0, 1.0), mass, v0);
    close("spring", spring.duration / period, PI, EXACT);
    close("its force", spring.contacts[0].peak_force / (v0 * (mass * k).sqrt()), 1.0, EXACT);
    let e = 0.6;
    close("Walton & Braun", ball(walton_braun(k, e), mass, v0).duration / period, PI * (1.0 + e) / 2.0, 1e-7);
    let hertz = ball(hunt_crossley(k, 1.5, 1.0), mass, v0);
    let depth = (1.25 * mass * v0 * v0 / k).powf(0.4);
    close("Hertz", hertz.duration * v0 / depth, 2.943275, 1e-6);
    close("his depth", hertz.contacts[0].deepest / depth, 1.0, EXACT);
    close("his force", hertz.contacts[0].peak_force / (k * depth.powf(1.5)), 1.0, EXACT);
    for e in [0.3, 0.8] {
        let clipped = KelvinVoigt::new(k, e).unwrap();
        let z = clipped.damping_ratio();
        let phase = ball(NormalForce::KelvinVoigt(clipped), mass, v0).duration / period * (1.0 - z * z).sqrt();
        close("to F = 0", phase, 2.0 * z.acos(), 1e-7);
        let pulling = KelvinVoigt { pulls: true, ..clipped };
        let z = pulling.damping_ratio();
        let phase = ball(NormalForce::KelvinVoigt(pulling), mass, v0).duration / period * (1.0 - z * z).sqrt();
        close("to d = 0", phase, PI, 1e-7);
        let jump = pulling.damping(mass) * v0;
        let peak = ball(NormalForce::KelvinVoigt(pulling), mass, v0).contacts[0].peak_force;
        assert!(peak >= jump * (1.0 - 1e-9), "the jump at first touch is included: {peak} {jump}");
    }
}

/// Walton & Braun's spring with friction of decreasing smoothing tends to Stronge's impact, with an error of first
/// order in the smoothing, and to no other law's.
#[test]
fn walton_and_brauns_impact_tends_to_stronges() {
    let problem = pendulum();
    let rigid = Energetic { restitution: 0.5, friction: 0.5 }.resolve(&problem).unwrap();
    let speed = problem.u_minus().norm();
    let mut errors = Vec::new();
    for share in [1e-3, 1e-4, 1e-5] {
        let hit = problem.compliant(walton_braun(1e6, 0.5), smoothed(0.5, share * speed)).unwrap();
        errors.push((vector![hit.u_plus[0], hit.u_plus[1]] - rigid.u_plus).norm() / speed);
        close("energetic", hit.contacts[0].energetic().unwrap(), 0.5, EXACT);
        let off = hit.work() - hit.energy_change;
        assert!(off.abs() < 1e-9 * rigid.energy_before, "{off:e}");
    }
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log10();
        close("order in the smoothing", order, 1.0, 0.1);
    }
    assert!(errors[2] < 2e-5, "{errors:?}");
    let poisson = Poisson { restitution: 0.5, friction: 0.5 }.resolve(&problem).unwrap();
    assert!((poisson.u_plus - rigid.u_plus).norm() > 1e-3 * speed, "the two laws differ here");
}

/// The same by explicit time steps with Coulomb's friction, written here from the force alone: they tend to Stronge's
/// impact at first order in the step, and so does their extrapolation.
#[test]
fn explicit_steps_tend_to_stronges_impact_at_first_order() {
    let problem = pendulum();
    let (h, mu) = (problem.delassus(), 0.5);
    let force = walton_braun(1.0, 0.5);
    let integrate = |dt: f64| {
        let (mut u, mut d, mut deepest) = (*problem.u_minus(), 0.0_f64, 0.0_f64);
        loop {
            deepest = deepest.max(d);
            let f = force.force(d, 0.0, 0.0, deepest);
            if d < deepest && f == 0.0 {
                return u;
            }
            let dp = f * dt;
            // friction that stops the slip within the step, if it is in the cone
            let stop = -(u.x + h[(0, 1)] * dp) / h[(0, 0)];
            d -= u.y * dt;
            u += h * Vector2::new(stop.clamp(-mu * dp, mu * dp), dp);
        }
    };
    let rigid = Energetic { restitution: 0.5, friction: 0.5 }.resolve(&problem).unwrap().u_plus;
    let answers = [1e-3, 2.5e-4, 6.25e-5].map(integrate);
    let errors = answers.map(|u| (u - rigid).norm());
    for pair in errors.windows(2) {
        close("order", (pair[0] / pair[1]).log(4.0), 1.0, 0.1);
    }
    let extrapolated = (answers[2] * 4.0 - answers[1]) / 3.0;
    assert!((extrapolated - rigid).norm() < 0.2 * errors[2], "{extrapolated} {rigid} {errors:?}");
    // by the integration of the crate it is the same impact
    let hit = problem.compliant(walton_braun(1.0, 0.5), smoothed(0.5, 1e-7)).unwrap();
    assert!((vector![hit.u_plus[0], hit.u_plus[1]] - extrapolated).norm() < 0.2 * errors[2]);
}

/// Random impacts in the plane and in space: passive, in the cone, with a closed energy balance, and near Stronge's.
#[test]
fn random_impacts_are_passive_and_near_stronges() {
    fn look<const D: usize>(case: &Case<D>) {
        let (e, mu) = (case.restitution.max(0.05), case.friction.min(3.0));
        let hit = case.problem().compliant(walton_braun(1e4, e), smoothed(mu, 1e-3)).unwrap();
        let rigid = Energetic { restitution: e, friction: mu }.resolve(&case.problem()).unwrap();
        let (p_t, p_n, energy) = (hit.impulse.rows(0, D - 1).norm(), hit.impulse[D - 1], rigid.energy_before);
        assert!(p_t <= mu * p_n * (1.0 + 1e-9), "{case:?}: {p_t} {p_n}");
        assert!(hit.energy_change <= 1e-9 * energy && hit.contacts[0].friction_work <= 0.0, "{case:?}: {hit:?}");
        assert!((hit.work() - hit.energy_change).abs() < 1e-8 * energy, "{case:?}: {hit:?}");
        // includes jams; the distance is that of the smoothing
        let off = (hit.u_plus - DVector::from_column_slice(rigid.u_plus.as_slice())).norm();
        assert!(off < 20.0 * 1e-3, "{case:?}: off by {off}");
    }
    let mut rng = fastrand::Rng::with_seed(5);
    for _ in 0..60 {
        look(&any_case(&mut rng, 0.3));
        look(&any_spatial(&mut rng, 0.3));
    }
}

/// A sphere has its tangent and normal uncoupled: with a bristle the tangential motion is an oscillation of its own,
/// passive and within the cone, and a soft bristle reverses the slip, which no law with a rigid tangent does.
#[test]
fn soft_bristle_reverses_the_slip() {
    // solid sphere: H = diag(7/2, 1)
    let problem = ImpactProblem::new(matrix![3.5, 0.0; 0.0, 1.0], vector![0.2, -1.0]).unwrap();
    let k = 1e6;
    let bristle = |share: f64, c: f64| TangentialForce::Bristle(Bristle::new(2.0, share * k, c).unwrap());
    // as many half periods along the tangent as along the normal if its stiffness is 2/7 of the normal one: slip
    // reversed
    let hit = problem.compliant(walton_braun(k, 1.0), bristle(2.0 / 7.0, 1e-3)).unwrap();
    close("normal", hit.u_plus[1], 1.0, EXACT);
    close("slip", hit.u_plus[0], -0.2, 1e-3);
    assert!((hit.work() - hit.energy_change).abs() < 1e-9);
    // twice the frequency: the slip is the initial one
    let hit = problem.compliant(walton_braun(k, 1.0), bristle(8.0 / 7.0, 1e-3)).unwrap();
    close("slip", hit.u_plus[0], 0.2, 1e-3);
    // strongly damped it sticks, as with Coulomb's friction: P_t = -2/7 u_t
    let hit = problem.compliant(walton_braun(k, 1.0), bristle(1e3, 1e5)).unwrap();
    close("slip", hit.u_plus[0], 0.0, 1e-3);
    close("impulse", hit.impulse[0], -0.2 * 2.0 / 7.0, 1e-3);
    // slip throughout: Coulomb's friction
    let slow = TangentialForce::Bristle(Bristle::new(0.1, 1e9, 1e3).unwrap());
    let fast = ImpactProblem::new(*problem.delassus(), vector![5.0, -1.0]).unwrap();
    let hit = fast.compliant(walton_braun(k, 0.5), slow).unwrap();
    close("slip", hit.u_plus[0], 5.0 - 3.5 * 0.1 * 1.5, 1e-6);
    close("cone", hit.impulse[0] / hit.impulse[1], -0.1, 1e-6);
}

/// Balls of 1 kg in a row, the first at 1 m/s, the others touching at rest.
fn cradle(laws: &[NormalForce]) -> (Vec<f64>, CompliantOutcome) {
    let (delassus, u) = row_of_balls(laws.len());
    let contacts: Vec<_> = laws.iter().map(|&law| (law, NO)).collect();
    let hit = compliant_impact(&delassus, &u, &contacts).unwrap();
    (balls(&hit.impulse), hit)
}

/// Springs that are equal, and not: the velocities depend on the exponent and on the ratio of the stiffnesses, not on
/// the stiffness. Numbers computed independently of this crate; Hertz's three balls agree with the literature's
/// .9945/.0764/−.0710.
#[test]
fn newtons_cradle_depends_on_the_ratio_of_stiffnesses() {
    let hertz = |k: f64| hunt_crossley(k, 1.5, 1.0);
    let spring = hunt_crossley(1e5, 1.0, 1.0);
    let cases: [(Vec<NormalForce>, Vec<f64>, f64); 5] = [
        (vec![spring; 2], vec![-0.130262, 0.150230, 0.980032], 1e-6),
        (vec![hertz(1e9); 2], vec![-0.070952, 0.076403, 0.994549], 1e-6),
        (vec![hertz(1e9), hertz(1e8)], vec![-0.006184, 0.006222, 0.999962], 1e-6),
        (vec![hertz(1e3), hertz(1e4)], vec![-0.325713, 0.575813, 0.749900], 1e-6),
        (vec![hertz(1e6); 4], vec![-0.07109, -0.03027, -0.01446, 0.12704, 0.98878], 1e-5),
    ];
    for (laws, expected, within) in cases {
        let (balls, hit) = cradle(&laws);
        all_close("balls", &balls, expected, 0.6 * within);
        close("momentum", balls.iter().sum(), 1.0, 1e-12);
        close("energy", balls.iter().map(|v| v * v).sum(), 1.0, EXACT);
        assert!(hit.energy_change.abs() < 1e-8);
        assert!(hit.contacts.iter().all(|contact| contact.peak_force > 0.0 && contact.deepest > 0.0));
    }
    let (soft, _) = cradle(&[hertz(1.0); 2]);
    let (hard, _) = cradle(&[hertz(1e12); 2]);
    assert!(soft.iter().zip(&hard).all(|(a, b)| (a - b).abs() < 1e-9), "{soft:?} {hard:?}");
}

/// Balls with dissipative contacts: momentum is conserved, and e → 1 tends to the elastic cradle.
#[test]
fn dissipative_cradle_conserves_momentum() {
    for e in [0.3, 0.9, 0.999] {
        for law in [walton_braun(1e6, e), hunt_crossley(1e6, 1.0, e), kelvin_voigt(1e6, e)] {
            let (balls, hit) = cradle(&[law; 3]);
            close("momentum", balls.iter().sum(), 1.0, 1e-12);
            assert!(hit.energy_change < 0.0 && hit.contacts.iter().all(|it| it.returned < it.absorbed), "{hit:?}");
            // no contact approaches
            assert!(balls.windows(2).all(|pair| pair[0] <= pair[1] + 1e-9), "{law:?} {balls:?}");
        }
    }
    let spring = hunt_crossley(1e6, 1.0, 1.0);
    let (elastic, _) = cradle(&[spring; 2]);
    let (nearly, _) = cradle(&[walton_braun(1e6, 0.99999); 2]);
    assert!(elastic.iter().zip(&nearly).all(|(a, b)| (a - b).abs() < 1e-4), "{elastic:?} {nearly:?}");
}

/// Two contacts that close again after separation: a light ball between two heavy ones.
#[test]
fn separated_contact_closes_again() {
    // masses 1, 0.01, 1: H_ii = 1/m_i + 1/m_(i+1)
    let h = dmatrix![101.0, -100.0; -100.0, 101.0];
    let law = hunt_crossley(1e6, 1.5, 1.0);
    // both contacts touch at the start without force
    let hit = compliant_impact(&h, &dvector![-1.0, 0.0], &[(law, NO); 2]).unwrap();
    let (first, light, last) = (1.0 - hit.impulse[0], 100.0 * (hit.impulse[0] - hit.impulse[1]), hit.impulse[1]);
    close("energy", first * first + 0.01 * light * light + last * last, 1.0, EXACT);
    assert!(first <= light && light <= last, "{first} {light} {last}");
    // two equal heavy balls exchange their velocities through the light one, except for its own momentum
    assert!(last > 0.95, "{last}");
    let one = hit.contacts[0];
    assert!(one.deepest > 0.0 && hit.steps > 100, "{hit:?}");
}

/// The middle one of three balls of 1 kg leaves the last one at v, is struck by the first one, and strikes the last one
/// after the first contact has ended: two impacts of two balls, the first with a relative velocity of v + w.
#[test]
fn contact_that_closes_again_is_an_impact_of_its_own() {
    let (v, w, k) = (1.0, 0.25, 1e6_f64);
    let h = dmatrix![2.0, -1.0; -1.0, 2.0];
    let laws = [
        (hunt_crossley(k, 1.0, 1.0), 1.0),
        (hunt_crossley(k, 1.5, 1.0), 1.0),
        (hunt_crossley(k, 1.5, 0.9), 0.9),
        (walton_braun(k, 0.9), 0.9),
    ];
    for (law, e) in laws {
        let hit = compliant_impact(&h, &dvector![-v - w, v], &[(law, NO); 2]).unwrap();
        let what = format!("{law:?}");
        let first = (1.0 + e) * (v + w) / 2.0;
        let meets = first - v; // velocity at which the middle ball strikes the last one, which rests
        let second = (1.0 + e) * meets / 2.0;
        close(&what, hit.impulse[0], first, EXACT);
        close(&what, hit.impulse[1], second, EXACT);
        for (contact, speed) in hit.contacts.iter().zip([v + w, meets]) {
            close(&what, contact.deepest / law.greatest_penetration(speed, 0.5), 1.0, EXACT);
            close(&what, contact.absorbed, 0.25 * speed * speed, EXACT);
            close(&what, contact.energetic().unwrap(), e, EXACT);
        }
    }
    // With springs: two half periods, and the time in which the middle ball crosses the gap that has opened.
    let hit = compliant_impact(&h, &dvector![-v - w, v], &[(hunt_crossley(k, 1.0, 1.0), NO); 2]).unwrap();
    let half = PI / (2.0 * k).sqrt();
    let gap = (v - w) / 2.0 * half;
    close("duration", hit.duration / (2.0 * half + gap / w), 1.0, EXACT);
}

/// A ball of 1 kg strikes a wall, rebounds into one of 3 kg that retreats slowly, and strikes the wall again: at the wall
/// two single impacts, the second with an unbent bristle and the slip that the first one left.
#[test]
fn bristle_is_unbent_where_a_contact_closes_again() {
    let (fast, retreat) = (1.0, 0.1);
    let again = (fast - 3.0 * retreat) / 2.0; // elastic impact of the two balls at fast - retreat
    let spring = hunt_crossley(1e6, 1.0, 1.0);
    let bristle = TangentialForce::Bristle(Bristle::new(0.5, 3e5, 10.0).unwrap());
    let wall = matrix![3.5, 0.0; 0.0, 1.0];
    let single = |slip: f64, speed: f64| {
        let hit = ImpactProblem::new(wall, vector![slip, -speed]).unwrap().compliant(spring, bristle).unwrap();
        (hit.impulse[0], hit.u_plus[0])
    };
    let (first, left) = single(0.3, fast);
    let (second, end) = single(left, again);
    // rows: tangent and normal between the balls, then at the wall; spin couples nothing between the contacts
    let h = dmatrix![
        7.0, 0.0, 0.0, 0.0;
        0.0, 4.0 / 3.0, 0.0, -1.0;
        0.0, 0.0, 3.5, 0.0;
        0.0, -1.0, 0.0, 1.0
    ];
    let hit =
        compliant_impact(&h, &dvector![0.0, fast + retreat, 0.3, -fast], &[(spring, NO), (spring, bristle)]).unwrap();
    close("between the balls", hit.impulse[1], fast + again, EXACT);
    close("normal impulse of the wall", hit.impulse[3], 2.0 * (fast + again), EXACT);
    close("friction", hit.impulse[2], first + second, EXACT);
    close("slip", hit.u_plus[2], end, EXACT);
}

#[test]
fn invalid_compliant_impacts_are_refused() {
    let law = [(walton_braun(1.0, 0.5), NO)];
    let refused = |h: DMatrix<f64>, u: DVector<f64>| compliant_impact(&h, &u, &law).unwrap_err().to_string();
    assert_eq!(
        refused(DMatrix::identity(4, 4), DVector::zeros(4)),
        "delassus has 4 rows for 1 compliant contacts: each has one (its normal), two (in the plane) or three (in \
         space), tangents first, normal last"
    );
    assert!(refused(DMatrix::identity(2, 2), DVector::zeros(3)).starts_with("u_minus has 3 rows"));
    assert!(refused(DMatrix::zeros(1, 2), DVector::zeros(1)).starts_with("delassus is 1 x 2"));
    assert!(refused(dmatrix![-1.0], dvector![-1.0]).contains("not positive"));
    assert!(refused(dmatrix![f64::NAN], dvector![-1.0]).starts_with("delassus[0][0] is NaN"));
    assert!(refused(dmatrix![1.0], dvector![f64::INFINITY]).starts_with("u_minus[0] is inf"));
    assert!(refused(dmatrix![1.0, 0.0; 0.0, 0.0], dvector![0.0, -1.0]).contains("the normal direction is singular"));
    // no contacts at all, and separating contacts
    let none = compliant_impact(&DMatrix::zeros(0, 0), &DVector::zeros(0), &[]).unwrap();
    assert_eq!((none.impulse.len(), none.duration), (0, 0.0));
    let parting = compliant_impact(&dmatrix![1.0], &dvector![1.0], &law).unwrap();
    assert_eq!((parting.u_plus[0], parting.energy_change, parting.contacts[0].energetic()), (1.0, 0.0, None));
    // numbers at the ends of their range
    let extreme = |h, v: f64, k| compliant_impact(&dmatrix![h], &dvector![-v], &[(walton_braun(k, 0.5), NO)]);
    for (h, v, k) in [(1e-300, 1e-10, 1e300), (1e200, 1e100, 1e-200)] {
        close("rebound", extreme(h, v, k).unwrap().u_plus[0] / v, 0.5, EXACT);
    }
    // Its energy, 5e-401 J, underflows: no tolerance is left for the integration.
    let underflow = extreme(1.0, 1e-200, 1.0);
    assert!(matches!(underflow, Err(ImpactError::Unfinished { steps: 0, .. })), "{underflow:?}");
}
