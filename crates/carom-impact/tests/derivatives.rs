//! Derivatives of the laws, mode boundaries, and the derivatives on both sides of a boundary.

use crate::common::{Case, FOLLOWING, Foreign, TURNING, any_case, any_spatial, close, pendulum, resolve, rough, wide};
use carom_impact::{
    AnyLaw, Coefficients, Direction, Energetic, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, Mode,
};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3, matrix, vector};
use num_dual::Dual64;

/// A problem with its law, and a direction in which both move.
#[derive(Debug, Clone, Copy)]
struct Moving<const D: usize> {
    delassus: SMatrix<f64, D, D>,
    u: SVector<f64, D>,
    law: AnyLaw,
    along: Direction<D>,
}

impl<const D: usize> Moving<D> {
    fn new(case: &Case<D>, law: &str, along: Direction<D>) -> Self {
        Self { delassus: case.delassus, u: case.u, law: case.law(law), along }
    }

    fn problem(&self, x: f64) -> Result<ImpactProblem<f64, D>, ImpactError> {
        ImpactProblem::new(self.delassus + self.along.delassus * x, self.u + self.along.u_minus * x)
    }

    fn law(&self, x: f64) -> AnyLaw {
        let c = self.law.coefficients();
        let (restitution, friction) =
            (c.restitution + self.along.restitution * x, c.friction + self.along.friction * x);
        self.law.with(Coefficients { restitution, friction, ..c })
    }

    fn at(&self, x: f64) -> ImpactOutcome<f64, D> {
        self.law(x).resolve(&self.problem(x).unwrap()).unwrap()
    }

    /// The law in dual numbers along the direction.
    fn dual(&self) -> ImpactOutcome<Dual64, D> {
        let (c, along) = (self.law.coefficients(), &self.along);
        let problem = ImpactProblem::new(
            self.delassus.zip_map(&along.delassus, Dual64::new),
            self.u.zip_map(&along.u_minus, Dual64::new),
        );
        let restitution = Dual64::new(c.restitution, along.restitution);
        let friction = Dual64::new(c.friction, along.friction);
        let tangential_restitution = Dual64::from_re(c.tangential_restitution);
        let law = self.law.with(Coefficients { restitution, friction, tangential_restitution });
        law.resolve(&problem.unwrap()).unwrap()
    }
}

fn direction<const D: usize>(rng: &mut fastrand::Rng) -> Direction<D> {
    let mut drawn = || rng.f64() - 0.5;
    let g = SMatrix::<f64, D, D>::from_fn(|_, _| drawn());
    Direction {
        delassus: (g + g.transpose()) * 0.5,
        u_minus: SVector::from_fn(|_, _| drawn()),
        restitution: drawn(),
        friction: drawn(),
    }
}

/// Away from kinks derivative, dual numbers and central difference agree. Returns how many were compared.
fn agrees<const D: usize>(case: &Moving<D>) -> usize {
    let step = 1e-5;
    let safe = |x: f64| {
        let c = case.law(x).coefficients();
        case.problem(x).is_ok_and(|p| p.approach_speed() > 0.05)
            && (0.0..=1.0).contains(&c.restitution)
            && c.friction >= 0.0
    };
    if !safe(step) || !safe(-step) {
        return 0;
    }
    let derivative = case.problem(0.0).unwrap().differentiate(&case.law).unwrap();
    let (here, ahead, behind) = (case.at(0.0), case.at(step), case.at(-step));
    // Where slip turns, the path is followed in dual numbers, whose quotients are rounded differently.
    let apart = (derivative.outcome.impulse - here.impulse).norm();
    assert!(apart <= 1e-13 * here.impulse.norm(), "{} P off by {apart:e}: {case:?}", here.law);
    let dual = case.dual();
    let (value, slope) = (dual.u_plus.map(|x| x.re), dual.u_plus.map(|x| x.eps));
    // Fused multiply-add in f64 only: the last bits may differ.
    close(here.law, (value - here.u_plus).norm(), 0.0, 1e-11 * here.u_plus.norm().max(1.0));
    assert!(dual.energy_change.eps.is_finite() && dual.newton.unwrap().eps.is_finite(), "{} {case:?}", here.law);
    let (forward, backward) = (ahead.impulse - here.impulse, here.impulse - behind.impulse);
    if (forward - backward).norm() > 1e-7 * (1.0 + here.impulse.norm()) {
        return 0; // a boundary, or a large curvature
    }
    let size = 1.0 + (forward / step).norm() + here.impulse.norm();
    let off = (derivative.impulse(&case.along) - (forward + backward) / (2.0 * step)).norm() / size;
    assert!(off < 3e-5, "{} P off by {off:e}: {case:?}", here.law);
    let moved = (ahead.u_plus - behind.u_plus) / (2.0 * step);
    let off = (derivative.u_plus(&case.along) - moved).norm() / (size + moved.norm());
    assert!(off < 3e-5, "{} u⁺ off by {off:e}: {case:?}", here.law);
    let off = (slope - moved).norm() / (size + moved.norm());
    assert!(off < 3e-5, "{} u⁺ in dual numbers off by {off:e}: {case:?}", here.law);
    1
}

#[test]
fn derivatives_and_dual_numbers_agree_with_central_differences() {
    let mut rng = fastrand::Rng::with_seed(71);
    let mut compared = [0; 2];
    for k in 0..2_000 {
        let flat = any_case(&mut rng, 0.3);
        let spatial = any_spatial(&mut rng, 0.3);
        for law in LAW_NAMES {
            compared[0] += agrees(&Moving::new(&flat, law, direction(&mut rng)));
            if k % 4 == 0 {
                compared[1] += agrees(&Moving::new(&spatial, law, direction(&mut rng)));
            }
        }
    }
    // The others are near a boundary, or leave the range of a coefficient.
    assert!(compared[0] > 10_400 && compared[1] > 2_500, "{compared:?}");
}

/// The derivative with respect to e exists at e = 0 too, where the square root of the work has none.
#[test]
fn dual_derivative_at_zero_restitution_is_finite() {
    let along = Direction { restitution: 1.0, ..Direction::default() };
    let case = Case { delassus: matrix![2.5, -1.5; -1.5, 2.5], u: vector![0.1, -1.0], restitution: 0.0, friction: 0.7 };
    for law in LAW_NAMES {
        let hit = Moving::new(&case, law, along).dual();
        assert!(hit.u_plus[1].eps > 0.5 && hit.u_plus[1].eps < 1.5, "{law} {}", hit.u_plus[1].eps);
        assert!(hit.normal_work.eps.is_finite() && hit.energetic.unwrap().eps.is_finite(), "{law}");
    }
}

/// A law that follows the slip has no scale of speed, of mass or of direction in the tangent plane: doubling u doubles P,
/// doubling H halves it, and turning the tangents turns it. Along these three directions the derivative is P, -P and P
/// turned, whatever the slip does.
#[test]
fn derivatives_along_the_symmetries_of_the_flow_are_exact() {
    let mut rng = fastrand::Rng::with_seed(74);
    let (mut worst, mut stopped, mut slipping) = (0.0_f64, 0, 0);
    for k in 0..600 {
        let case = any_spatial(&mut rng, 0.2);
        let (h, u, mu) = (case.delassus, case.u, case.friction.clamp(0.05, 3.0));
        let problem = ImpactProblem::new(h, u).unwrap();
        let law = AnyLaw::named(FOLLOWING[k % 3], rough(case.restitution, mu)).unwrap();
        let derivative = problem.differentiate(&law).unwrap();
        let p = derivative.outcome.impulse;
        let spin = matrix![0.0, -1.0, 0.0; 1.0, 0.0, 0.0; 0.0, 0.0, 0.0];
        let faster = Direction { u_minus: u, ..Direction::default() };
        let lighter = Direction { delassus: h, ..Direction::default() };
        let turned = Direction { delassus: spin * h - h * spin, u_minus: spin * u, ..Direction::default() };
        // The terms that cancel have the size of the largest derivatives.
        let size = p.norm() + derivative.velocity.norm() * u.norm();
        for (along, expected) in [(faster, p), (lighter, -p), (turned, spin * p)] {
            worst = worst.max((derivative.impulse(&along) - expected).norm() / size);
        }
        stopped += usize::from(derivative.outcome.slip_stop.is_some());
        slipping += usize::from(derivative.outcome.slip_stop.is_none());
    }
    // Slip turns by many times its last direction as it stops: H of condition 25 leaves 1e-11.
    assert!(worst < 1e-10 && stopped > 100 && slipping > 100, "{worst:e} {stopped} {slipping}");
}

/// In dual numbers too the works of the two phases add up to the energy change, and their ratio is e².
#[test]
fn derivatives_of_the_works_of_turning_slip_balance() {
    let mut rng = fastrand::Rng::with_seed(75);
    for _ in 0..600 {
        let case = any_spatial(&mut rng, 0.2);
        let (restitution, friction) = (case.restitution.clamp(0.1, 0.9), case.friction.clamp(0.05, 3.0));
        let along = direction::<3>(&mut rng);
        let hit = Moving::new(&Case { restitution, friction, ..case }, "energetic", along).dual();
        let works = (hit.normal_work + hit.friction_work).eps;
        let size = hit.normal_work.eps.abs() + hit.friction_work.eps.abs() + hit.impulse.map(|p| p.eps).norm();
        close("works", works, hit.energy_change.eps, 1e-11 * (1.0 + size));
        close("e", hit.energetic.unwrap().eps, along.restitution, 1e-9 * (1.0 + size));
    }
}

/// A slip of 1e-6 m/s that turns and grows a millionfold: ∂P/∂u_y by central differences of Taylor's method with 56 digits. At
/// the same τ a change of the initial slip lengthens all of the path, and the derivative was a difference of such terms, with
/// an error of 1e-9.
#[test]
fn derivatives_by_a_slow_slip_that_turns_have_their_reference_values() {
    let cases = [
        (
            [0.584691838013472, -0.36457430330099955, 0.14450957316902138],
            [0.6245080679045445, -0.3357250759820072, 0.40258016934314866],
            vector![3.8084823558692213e-7, -4.902777417483047e-7, -0.7394976907679374],
            Energetic { restitution: 0.7800790040193862, friction: 0.2649383528064084 },
            vector![-0.4113814387713874, -0.2527603700159167, -0.09505982107845078],
        ),
        (
            [1.433953004210584, 0.0627209399254477, -0.016142038412966686],
            [0.552037061194113, 0.5569257017050451, 0.675684431582572],
            vector![-4.944406056978511e-7, -9.700710435765503e-8, -0.5770141424962164],
            Energetic { restitution: 0.014523930031154486, friction: 0.31205723524502965 },
            vector![0.001180013330896492, -0.5574286190274115, 0.4644207945908871],
        ),
    ];
    for ([a, b, c], [d, e, f], u, law, expected) in cases {
        let problem = ImpactProblem::new(matrix![a, b, c; b, d, e; c, e, f], u).unwrap();
        let found = problem.differentiate(&law).unwrap().velocity.column(1).into_owned();
        assert!((found - expected).amax() < 1e-12, "{found} {expected}");
    }
}

/// Slip that stays in a plane is resolved in closed form; its derivative in a direction out of the plane agrees with
/// differences of the turning slip next to it.
#[test]
fn derivatives_out_of_the_plane_of_slip_agree_with_differences() {
    let mut rng = fastrand::Rng::with_seed(72);
    let mut compared = [0; 3];
    for k in 0..900 {
        let case = any_case(&mut rng, 0.3);
        let (h, u) = (case.delassus, case.u);
        let across = 0.2 + rng.f64();
        let delassus = matrix![h[(0, 0)], 0.0, h[(0, 1)]; 0.0, across, 0.0; h[(0, 1)], 0.0, h[(1, 1)]];
        let at_rest = k % 3 == 1;
        let ball = k % 3 == 2;
        let delassus = if ball { Matrix3::from_diagonal(&Vector3::new(3.5, 3.5, 1.0)) } else { delassus };
        let u = Vector3::new(if at_rest { 0.0 } else { u[0] }, 0.0, u[1]);
        // Without slip the impact is smooth if μ is larger than μ_stick.
        let friction = if at_rest { 1.5 * h[(0, 1)].abs() / h[(0, 0)] + 0.1 } else { case.friction };
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3 * f64::from(k)).into_inner();
        let (delassus, u) = (turn * delassus * turn.transpose(), turn * u);
        let name = ["newton", "poisson", "energetic", "whittaker"][k as usize % 4];
        let law = AnyLaw::named(name, rough(case.restitution, friction)).unwrap();
        let hit = law.resolve(&ImpactProblem::new(delassus, u).unwrap()).unwrap();
        let (a, b) = if ball { (3.5, 0.0) } else { (h[(0, 0)], h[(0, 1)] * case.u[0].signum()) };
        let decays = friction * if ball { 3.5 } else { across } / (b - friction * a).abs();
        if hit.slip_stop.is_some() && decays < 0.75 {
            continue; // a change of 1e-5 is then not small
        }
        compared[k as usize % 3] += agrees(&Moving { delassus, u, law, along: direction(&mut rng) });
    }
    assert!(compared.iter().all(|&n| n > 120), "{compared:?}");
}

/// At μ = 0 and at e = 0 the derivative is that from the right.
#[test]
fn derivatives_at_zero_coefficients_are_those_from_the_right() {
    let problem = ImpactProblem::new(TURNING, vector![0.6, -0.2, -1.0]).unwrap();
    let frictionless = problem.differentiate(&AnyLaw::named("frictionless", rough(0.6, 0.0)).unwrap()).unwrap();
    for name in LAW_NAMES.into_iter().filter(|name| *name != "frictionless") {
        let law = |mu| AnyLaw::named(name, rough(0.6, mu)).unwrap();
        let derivative = problem.differentiate(&law(0.0)).unwrap();
        let ahead = |mu: f64| (law(mu).resolve(&problem).unwrap().impulse - derivative.outcome.impulse) / mu;
        let difference = ahead(1e-5) * 2.0 - ahead(2e-5);
        close(name, (derivative.friction - difference).norm(), 0.0, 1e-7);
        // Friction changes the impulse.
        assert!(derivative.friction.norm() > 0.1, "{name}");
        assert_eq!(derivative.velocity, frictionless.velocity, "{name}");
    }
    // The one-sided difference of second order, where slip turns during the whole impact.
    let mut rng = fastrand::Rng::with_seed(11);
    let (mut turned, step) = (0, 1e-5);
    for _ in 0..400 {
        let factor = Matrix3::from_fn(|_, _| wide(&mut rng));
        let h = factor * factor.transpose() + Matrix3::identity() * 0.3;
        let u = vector![wide(&mut rng), wide(&mut rng), -0.2 - rng.f64()];
        let friction = 0.1 + 0.5 * rng.f64();
        for name in ["newton", "poisson"] {
            let outcome = resolve(name, h, u, [0.0, friction]);
            if outcome.mode == Mode::Stick || outcome.slip_end.is_some() {
                continue;
            }
            let law = AnyLaw::named(name, rough(0.0, friction)).unwrap();
            let found = ImpactProblem::new(h, u).unwrap().differentiate(&law).unwrap().restitution;
            let [p0, p1, p2] = [0.0, 1.0, 2.0].map(|k| resolve(name, h, u, [k * step, friction]).impulse);
            let difference = (p1 * 4.0 - p0 * 3.0 - p2) / (2.0 * step);
            // Truncation of the order step², rounding ε/step.
            assert!((found - difference).amax() < 1e-7 * (1.0 + difference.amax()), "{name} {found} {difference}");
            turned += 1;
        }
    }
    assert!(turned > 300, "{turned}");
}

#[test]
fn problem_of_a_gram_matrix_is_that_of_the_checked_one() {
    let factor = matrix![1.0, 0.3, -0.2; 0.1, 0.8, 0.4; -0.5, 0.2, 1.1];
    let (h, u) = (factor * factor.transpose(), vector![0.2, -0.4, -1.0]);
    assert_eq!(ImpactProblem::from_gram(h, u), ImpactProblem::new(h, u));
    for (row, column) in [(0, 0), (1, 2), (2, 1)] {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut broken = h;
            broken[(row, column)] = bad;
            assert!(matches!(ImpactProblem::from_gram(broken, u), Err(ImpactError::NotFinite { .. })));
        }
    }
    assert!(matches!(ImpactProblem::from_gram(h, vector![0.0, f64::NAN, -1.0]), Err(ImpactError::NotFinite { .. })));
}

/// dv⁺/de at e = μ = 0.5, from 30-digit arithmetic, by the derivative and by dual numbers.
#[test]
fn sensitivities_of_the_double_pendulum_have_their_reference_values() {
    let (delassus, u) = (*pendulum().delassus(), *pendulum().u_minus());
    let along = Direction { restitution: 1.0, ..Direction::default() };
    for (law, expected) in FOLLOWING.into_iter().zip([
        vector![0.16236472, 0.13420201],
        vector![0.02282974, 0.01886985],
        vector![0.03519218, 0.02908798],
    ]) {
        let case = Moving::new(&Case { delassus, u, restitution: 0.5, friction: 0.5 }, law, along);
        let found = case.problem(0.0).unwrap().differentiate(&case.law).unwrap().u_plus(&along);
        close(law, (found - expected).amax(), 0.0, 6e-9); // the digits given
        close(law, (case.dual().u_plus.map(|v| v.eps) - expected).amax(), 0.0, 5e-9);
    }
}

/// Moves along the direction until the mode changes: there the nearest boundary has margin 0 and the mode on the other
/// side.
fn crosses<const D: usize>(case: &Moving<D>, tally: &mut std::collections::BTreeMap<&'static str, usize>) {
    let class = |x: f64| {
        let problem = case.problem(x).ok()?;
        let c = case.law(x).coefficients();
        let valid = (0.01..=0.99).contains(&c.restitution) && c.friction >= 0.01 && problem.approach_speed() > 0.01;
        let outcome = case.law(x).resolve(&problem).ok()?;
        valid.then_some((outcome.mode, outcome.slip_end))
    };
    let start = class(0.0);
    let Some(mut far) = (1..40).map(|k| 0.02 * f64::from(k)).find(|&x| class(x) != start) else { return };
    let mut near = far - 0.02;
    if class(near) != start || class(near).is_none() || class(far).is_none() {
        return;
    }
    for _ in 0..60 {
        let middle = 0.5 * (near + far);
        match class(middle) {
            None => return,
            found if found == start => near = middle,
            _ => far = middle,
        }
    }
    let (before, after) = (case.at(near), case.at(far));
    let boundaries = case.problem(near).unwrap().boundaries(&case.law(near)).unwrap();
    let nearest = boundaries[0];
    assert!(nearest.margin < 1e-7, "{boundaries:?} {:?} {:?} {case:?}", before.mode, after.mode);
    assert_eq!(nearest.beyond, after.mode, "{nearest:?} {case:?}");
    let back = case.problem(far).unwrap().boundaries(&case.law(far)).unwrap()[0];
    assert_eq!((back.edge, back.beyond), (nearest.edge, before.mode), "{case:?}");
    *tally.entry(nearest.edge.name()).or_default() += 1;

    // The impulse is continuous there (but for Whittaker's, which may have three solutions), its derivative need not
    // be.
    let jump = (before.impulse - after.impulse).norm();
    assert!(jump < 1e-6 * before.impulse.norm(), "{jump:e} {case:?}");
    let middle = Moving {
        delassus: *case.problem(near).unwrap().delassus(),
        u: *case.problem(near).unwrap().u_minus(),
        law: case.law(near),
        along: case.along,
    };
    let sides = middle.problem(0.0).unwrap().one_sided(&middle.law, &middle.along).unwrap();
    for (side, sign) in [(sides.behind, -1.0), (sides.ahead, 1.0)] {
        let Some(side) = side else { continue };
        // A second-order difference to one side only.
        let step = 2e-4 * sign;
        let [here, one, two] = [0.0, 1.0, 2.0].map(|k| middle.at(k * step).impulse);
        let half = [0.0, 0.5, 1.0].map(|k| middle.at(k * step).impulse);
        let coarse = (one * 4.0 - two - here * 3.0) / (2.0 * step);
        let fine = (half[1] * 4.0 - half[2] - half[0] * 3.0) / step;
        let curved = (coarse - fine).norm();
        if curved > 1e-4 * fine.norm() {
            continue; // another boundary, or much curvature
        }
        let off = (side.impulse - fine).norm();
        assert!(off < 1e-5 * (1.0 + fine.norm()) + 2.0 * curved, "{sign} {off:e} of {:e} {middle:?}", fine.norm());
        *tally.entry(if sign > 0.0 { "ahead" } else { "behind" }).or_default() += 1;
    }
    *tally.entry(if sides.is_kink() { "kink" } else { "smooth" }).or_default() += 1;
}

#[test]
fn mode_changes_have_zero_margin_and_two_one_sided_derivatives() {
    let mut rng = fastrand::Rng::with_seed(73);
    let mut tally = std::collections::BTreeMap::new();
    for k in 0..4_000 {
        let case = any_case(&mut rng, 0.3);
        crosses(&Moving::new(&case, FOLLOWING[k % 3], direction(&mut rng)), &mut tally);
    }
    for edge in ["no-slip", "stops-at-turn", "stops-at-end", "just-holds"] {
        assert!(tally.get(edge).is_some_and(|&n| n > 10), "{edge}: {tally:?}");
    }
    assert!(tally["kink"] > 100 && tally["ahead"] > 150 && tally["behind"] > 150, "{tally:?}");
}

#[test]
fn user_defined_law_is_refused_by_name() {
    let problem = ImpactProblem::new(matrix![2.0, 0.5; 0.5, 1.0], vector![1.0, -1.0]).unwrap();
    let message = problem.differentiate(&Foreign).unwrap_err().to_string();
    assert!(message.starts_with("foreign has no derivative") && message.contains("energetic"), "{message}");
    let nothing = problem.one_sided(&Energetic { restitution: 0.5, friction: 0.5 }, &Direction::default());
    assert!(nothing.unwrap_err().to_string().contains("the size of the direction is 0"));
}
