//! Properties that every law must have, over random impacts in the plane and in space: cone, balance, realised coefficient,
//! energy gains, symmetries, and other scalars.

use crate::common::{Case, FOLLOWING, any_case, any_spatial, close, resolve, rough};
use carom_impact::{
    AnyLaw, Coefficients, Flags, Frictionless, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, Mode, Phase,
};
use nalgebra::{Matrix2, Matrix3, Rotation3, SMatrix, Vector3, matrix, vector};

/// Matrices of condition up to 400: rounding in H P is amplified by no more than that.
const FLAT: f64 = 0.05;

/// Rounding allowed, relative to the terms that make up the number: 64 ε (a path has some twenty operations with an
/// error of ε/2 each) times the amplification by H, at most 400.
const TIGHT: f64 = 64.0 * 400.0 * f64::EPSILON;

/// Sum of the energies exchanged: the scale of rounding in their differences.
fn passed<const D: usize>(hit: &ImpactOutcome<f64, D>) -> f64 {
    hit.energy_before + 0.5 * hit.impulse.abs().dot(&(hit.u_minus.abs() + hit.u_plus.abs()))
}

/// End of the slip, the mode behind it, and whether friction jams.
type Class = (Option<(Phase, Mode)>, bool);

/// Rounding allowed.
struct Within<const D: usize> {
    jump: fn(&Case<D>, &ImpactOutcome<f64, D>) -> f64,
    works: f64,
    energies: f64,
    newton: f64,
    energetic: f64,
}

/// The properties of every law, one by one; returns how often each class occurs under the laws that follow the slip.
fn properties<const D: usize>(cases: impl Iterator<Item = Case<D>>, within: &Within<D>) -> Vec<(Class, usize)> {
    let (mut gains, mut classes) = ([0; LAW_NAMES.len()], Vec::<(Class, usize)>::new());
    for case in cases {
        let hits = LAW_NAMES.map(|law| case.resolve(law));
        for ((hit, law), gains) in hits.iter().zip(LAW_NAMES).zip(&mut gains) {
            let told = |what: &str| format!("{what} {law} {case:?} {hit:?}");
            let (p_t, p_n) = (hit.impulse.rows(0, D - 1).norm(), hit.impulse[D - 1]);
            assert!(p_n > 0.0 && hit.u_plus[D - 1] >= 0.0, "{}", told("it pushes, and separates"));
            // Both sides are sums of the same terms: a few ε of μ P_n, and where the law finds
            // P_t from the velocity (stick), of the velocity over A too.
            let slack = TIGHT * (case.friction * p_n + p_n);
            assert!(p_t <= case.friction * p_n + slack, "{}", told("in the cone"));
            let off = (hit.u_minus + case.delassus * hit.impulse - hit.u_plus).amax();
            assert!(off <= (within.jump)(&case, hit), "{}", told("u⁺ = u⁻ + H P"));
            let passed = passed(hit);
            close(&told("W_n + W_t"), hit.normal_work + hit.friction_work, hit.energy_change, within.works * passed);
            let change = hit.energy_after - hit.energy_before;
            close(&told("T⁺ - T⁻"), change, hit.energy_change, within.energies * passed);
            assert!(hit.energy_ratio() == hit.energy_after / hit.energy_before, "{}", told("T⁺/T⁻"));
            let gained = hit.energy_change > 64.0 * f64::EPSILON * passed;
            assert!(hit.flags.contains(Flags::ENERGY_GAIN) == gained, "{}", told("a gain is flagged"));
            *gains += usize::from(gained);
            if FOLLOWING.contains(&law) {
                assert!(hit.friction_work <= 0.0, "{}", told("friction does no positive work"));
                let class = (hit.slip_end.map(|end| (end, hit.mode)), hit.flags.contains(Flags::JAM));
                match classes.iter_mut().find(|(known, _)| *known == class) {
                    Some((_, count)) => *count += 1,
                    None => classes.push((class, 1)),
                }
            }
        }
        let (e, of) = (case.restitution, |law: &str| &hits[LAW_NAMES.iter().position(|name| *name == law).unwrap()]);
        close("Newton's e", of("newton").newton.unwrap(), e, within.newton);
        close("Poisson's e", of("poisson").poisson.unwrap(), e, within.newton);
        // A root of works: where slip stops just before the end, what is left of the work to
        // return is a difference, so the work is good to ε and the root to ε/e.
        let realised = of("energetic").energetic.unwrap();
        close("energetic e²", realised * realised, e * e, within.energetic);
        close("energetic e", realised, e, within.energetic);
    }
    for (law, gains) in LAW_NAMES.into_iter().zip(gains) {
        assert_eq!(gains > 0, ["whittaker", "newton"].contains(&law), "{law} gained energy {gains} times");
    }
    classes
}

#[test]
fn laws_keep_their_properties_in_100_000_impacts_in_the_plane() {
    let mut rng = fastrand::Rng::with_seed(20_260_101);
    let jump = |case: &Case<2>, hit: &ImpactOutcome<f64, 2>| {
        64.0 * f64::EPSILON * (hit.u_minus.amax() + case.delassus.amax() * hit.impulse.amax())
    };
    let cases = (0..100_000).map(|_| any_case(&mut rng, FLAT)).inspect(|case| {
        let problem = case.problem();
        assert!(problem.mu_jam().is_none_or(|jam| jam >= problem.mu_stick()), "{case:?}");
        let [newton, poisson, energetic] = FOLLOWING.map(|law| case.resolve(law));
        if newton.slip_end.is_none() {
            assert_eq!((newton.u_plus, newton.impulse), (poisson.u_plus, poisson.impulse), "{case:?}");
            assert_eq!((newton.u_plus, newton.impulse), (energetic.u_plus, energetic.impulse), "{case:?}");
        }
        let hit = case.resolve("whittaker");
        for coefficient in [hit.newton, hit.poisson, hit.energetic] {
            close("Whittaker's e", coefficient.unwrap(), case.restitution, 1e-14);
        }
    });
    let within = Within { jump, works: TIGHT, energies: TIGHT, newton: 1e-14, energetic: 1e-14 };
    let classes = properties(cases, &within);
    let end = |phase, mode| Some((phase, mode));
    for class in [
        (None, false),
        (end(Phase::Restitution, Mode::Stick), false),
        (end(Phase::Restitution, Mode::ReverseSlip), false),
        (end(Phase::Compression, Mode::Stick), false),
        (end(Phase::Compression, Mode::ReverseSlip), false),
        (end(Phase::Compression, Mode::Stick), true),
    ] {
        assert!(classes.iter().any(|(found, count)| *found == class && *count > 300), "{class:?}: {classes:?}");
    }
    assert_eq!(classes.len(), 6, "there is no other class: {classes:?}");
}

#[test]
fn laws_keep_their_properties_in_10_000_impacts_in_space() {
    let mut rng = fastrand::Rng::with_seed(43);
    let jump = |case: &Case<3>, hit: &ImpactOutcome<f64, 3>| {
        1e-13 * (1.0 + case.friction).min(10.0) * (1.0 + hit.impulse.amax())
    };
    let within = Within { jump, works: 1e-12, energies: 1e-11, newton: 1e-13, energetic: 1e-12 };
    let classes = properties((0..10_000).map(|_| any_spatial(&mut rng, FLAT)), &within);
    let count = |of: &dyn Fn(&Class) -> bool| -> usize {
        classes.iter().filter(|(class, _)| of(class)).map(|(_, count)| count).sum()
    };
    let ends = [
        count(&|(end, _)| end.is_none()),
        count(&|(end, _)| *end == Some((Phase::Compression, Mode::Stick))),
        count(&|(end, _)| *end == Some((Phase::Restitution, Mode::Stick))),
        count(&|(end, _)| end.is_some_and(|(_, mode)| mode != Mode::Stick)),
        count(&|(_, jams)| *jams),
    ];
    assert!(ends.iter().all(|&n| n > 100), "{ends:?}");
}

/// Not proved for Poisson's law in space.
#[test]
fn poisson_never_gains_energy_in_200_000_impacts_in_space() {
    let mut rng = fastrand::Rng::with_seed(48);
    let (mut stopped, mut jammed) = (0, 0);
    for _ in 0..200_000 {
        let case = any_spatial(&mut rng, FLAT);
        let hit = case.resolve("poisson");
        assert!(!hit.flags.contains(Flags::ENERGY_GAIN), "{case:?} {hit:?}");
        stopped += usize::from(hit.slip_end.is_some());
        jammed += usize::from(hit.flags.contains(Flags::JAM));
    }
    // The cases in which energy could be gained occur: slip stops, friction jams.
    assert!(stopped > 20_000 && jammed > 2_000, "{stopped} {jammed}");
}

fn smooth<const D: usize>(cases: impl Iterator<Item = Case<D>>) {
    for case in cases.map(|case| Case { friction: 0.0, ..case }) {
        let smooth = Frictionless { restitution: case.restitution }.resolve(&case.problem()).unwrap();
        for law in LAW_NAMES {
            let hit = case.resolve(law);
            let off = (hit.u_plus - smooth.u_plus).amax();
            assert!(off <= TIGHT * smooth.u_plus.amax().max(1.0), "{law} {case:?} {hit:?}");
            close(law, hit.impulse[D - 1], smooth.impulse[D - 1], TIGHT * smooth.impulse[D - 1]);
            assert!(hit.impulse.rows(0, D - 1).amax() == 0.0 && hit.friction_work == 0.0, "{law} {case:?} {hit:?}");
            assert_eq!((hit.law, hit.mode, hit.flags), (law, smooth.mode, smooth.flags), "{case:?}");
        }
    }
}

/// Without friction neither the law nor the direction of slip matters, for any coupling: in closed form, in space.
#[test]
fn without_friction_all_laws_agree() {
    let mut rng = fastrand::Rng::with_seed(20_260_101);
    smooth((0..10_000).map(|_| any_case(&mut rng, FLAT)));
    smooth((0..1_000).map(|_| any_spatial(&mut rng, FLAT)));
    let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    let uncoupled = [(0, 1), (0, 2), (1, 2)].map(|(i, j)| {
        let mut h = h;
        (h[(i, j)], h[(j, i)]) = (0.0, 0.0);
        h
    });
    let u = vector![0.6, -0.2, -1.0];
    smooth([h].into_iter().chain(uncoupled).map(|delassus| Case { delassus, u, restitution: 0.6, friction: 0.0 }));
    let hit = resolve("frictionless", h, u, [0.6, 0.0]);
    let p_n = 1.6 / 1.2;
    close("u⁺", (hit.u_plus - vector![0.6 + 0.5 * p_n, -0.2 - 0.4 * p_n, 0.6]).norm(), 0.0, 1e-15);
    close("loss", hit.energy_change, -0.5 * (1.0 - 0.36) / 1.2, 1e-15);
    let energy = |u: Vector3<f64>| 0.5 * u.dot(&(h.try_inverse().unwrap() * u));
    close("ratio", hit.energy_ratio(), energy(hit.u_plus) / energy(u), 1e-15);
}

/// The numbers of an outcome with speeds and masses changed by `faster` and `1/lighter` are in proportion to the other's.
fn scales<const D: usize>(case: &Case<D>, [faster, lighter]: [f64; 2], within: f64) {
    let scaled = Case { delassus: case.delassus * lighter, u: case.u * faster, ..*case };
    for law in LAW_NAMES {
        let (one, other) = (case.resolve(law), scaled.resolve(law));
        let (p, energy) = (one.impulse.norm(), faster * faster / lighter);
        close(law, (one.u_plus - other.u_plus / faster).norm(), 0.0, within * one.u_plus.norm().max(1.0));
        close(law, (one.impulse - other.impulse * (lighter / faster)).norm(), 0.0, within * p);
        let [change, work] = [other.energy_change, other.normal_work].map(|of| of / energy);
        close(law, change, one.energy_change, within * passed(&one));
        close(law, work, one.normal_work, within * passed(&one));
        assert_eq!((one.mode, one.slip_end, one.flags), (other.mode, other.slip_end, other.flags), "{law} {case:?}");
    }
}

/// Powers of two scale without rounding, so in the plane the laws scale with them to the last bit; in space the steps along
/// the path round.
#[test]
fn doubling_speeds_or_masses_scales_every_number() {
    let mut rng = fastrand::Rng::with_seed(42);
    for _ in 0..1_000 {
        let by = [rng.i32(-40..20), rng.i32(-20..=20)].map(|power| 2.0_f64.powi(power));
        scales(&any_case(&mut rng, 1e-3), by, 0.0);
        scales(&any_spatial(&mut rng, 0.1), by, 1e-11);
    }
}

fn turns<const D: usize>(case: &Case<D>, turn: &SMatrix<f64, D, D>, within: f64) {
    let delassus = turn * case.delassus * turn.transpose();
    let turned = Case { delassus: (delassus + delassus.transpose()) * 0.5, u: turn * case.u, ..*case };
    for law in LAW_NAMES {
        let (one, other) = (case.resolve(law), turned.resolve(law));
        let off = (turn * one.u_plus - other.u_plus).norm() / one.u_plus.norm().max(1.0);
        assert!(off <= within, "{law} {off:e} {case:?}");
        let (off, size) = ((turn * one.impulse - other.impulse).norm(), one.impulse.norm().max(1.0));
        assert!(D == 3 || off <= within, "{law} {off:e} {case:?}");
        close(law, one.energy_change, other.energy_change, within * size);
        assert!(D == 3 || one.flags == other.flags, "{law} {case:?}");
    }
}

/// Turned or mirrored tangents turn or mirror tangential components and change nothing else: exactly in the plane; in space
/// but for the rounding of H, amplified by its condition number and by the fast turning of slow slip.
#[test]
fn turning_or_mirroring_the_tangents_turns_or_mirrors_the_outcome() {
    let mut rng = fastrand::Rng::with_seed(41);
    for _ in 0..2_000 {
        turns(&any_case(&mut rng, 1e-3), &matrix![-1.0, 0.0; 0.0, 1.0], 0.0);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU * rng.f64());
        turns(&any_spatial(&mut rng, 0.1), &turn.into_inner(), 1e-10);
    }
}

/// The outcomes for friction 1e6 and 1e9 nearly agree.
#[test]
fn outcome_converges_for_large_friction() {
    let mut rng = fastrand::Rng::with_seed(1860);
    for _ in 0..256 {
        let case = any_case(&mut rng, FLAT);
        for law in LAW_NAMES {
            let [strong, stronger] = [1e6, 1e9].map(|friction| Case { friction, ..case }.resolve(law).u_plus);
            // The energetic end is a root of the work: 1e-6 in the work may be 1e-3 in the velocity.
            assert!((strong - stronger).norm() < 1e-2 * (1.0 + strong.norm()), "{law} {case:?}");
        }
    }
}

/// Impulses are proportional to the velocities: at speeds whose squares overflow an outcome is that of the same impact at
/// 1 m/s times the speed, or it is refused; it is never NaN.
#[test]
fn outcomes_at_speeds_whose_works_overflow_are_proportional_or_refused() {
    let mut rng = fastrand::Rng::with_seed(77);
    let (mut refused, mut proportional) = (0, 0);
    for _ in 0..2000 {
        let case = any_case(&mut rng, FLAT);
        for law in LAW_NAMES {
            let hit = case.resolve(law);
            for speed in [1e150, 1e153, 1e155, 1e200] {
                match (Case { u: case.u * speed, ..case }).resolved(law) {
                    Err(why) => {
                        assert!(speed > 1e150, "{law} {case:?}: {why}");
                        refused += 1;
                    }
                    Ok(outcome) => {
                        proportional += 1;
                        let miss = (outcome.impulse / speed - hit.impulse).amax();
                        assert!(miss <= 1e-9 * hit.impulse.amax(), "{law} at {speed} m/s: {outcome:?} {hit:?}");
                    }
                }
            }
        }
    }
    // Squares overflow at the two greater speeds of the four.
    assert!(refused > 0 && proportional > refused / 2, "{refused} refused, {proportional} proportional");
}

/// The distance between the velocities in single and in double precision.
fn single<const D: usize>(case: &Case<D>, law: &str) -> f64 {
    let problem = ImpactProblem::new(case.delassus.map(|x| x as f32), case.u.map(|x| x as f32)).unwrap();
    let (restitution, friction) = (case.restitution as f32, case.friction as f32);
    let law32 = AnyLaw::named(law, Coefficients { restitution, friction, tangential_restitution: 0.0 }).unwrap();
    (law32.resolve(&problem).unwrap().u_plus.map(f64::from) - case.resolve(law).u_plus).norm()
}

#[test]
fn single_precision_agrees_with_double() {
    let mut rng = fastrand::Rng::with_seed(5);
    for _ in 0..10_000 {
        let case = any_case(&mut rng, 0.3);
        // Near a jam dv_n/dp = C - μ s B is a small difference with a large rounding error.
        let near_jam = (case.delassus[(1, 1)] - case.friction * case.delassus[(0, 1)].abs()).abs() < 1e-2;
        let within = if near_jam { 1e-2 } else { 1e-4 };
        for law in LAW_NAMES {
            let off = single(&case, law) / case.resolve(law).u_plus.norm().max(1.0);
            assert!(off <= within, "{law} off {off:e} in {case:?}");
        }
    }
    let mut worse = 0;
    for _ in 0..1_000 {
        let case = any_spatial(&mut rng, 0.3);
        let off = single(&case, "energetic");
        assert!(off < 1e-2, "{off} {case:?}");
        worse += usize::from(off > 1e-5);
    }
    assert!(worse < 40, "{worse}");
}

fn lift(x: nalgebra::Vector2<f64>) -> Vector3<f64> {
    vector![x[0], 0.0, x[1]]
}

fn lifted(h: &Matrix2<f64>, across: f64) -> Matrix3<f64> {
    matrix![h[(0, 0)], 0.0, h[(0, 1)]; 0.0, across, 0.0; h[(0, 1)], 0.0, h[(1, 1)]]
}

/// A contact in space whose slip stays in a plane has the outcome of the planar problem, rotated about the normal.
#[test]
fn rotated_planar_problem_has_the_rotated_outcome() {
    let mut rng = fastrand::Rng::with_seed(3);
    for i in 0..10_000 {
        let mut case = any_case(&mut rng, 0.1);
        if i % 10 == 0 {
            case.u[0] = 0.0;
        }
        let across = if i % 3 == 0 { 0.0 } else { rng.f64() }; // a planar robot has none
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU * rng.f64());
        let Case { restitution, friction, .. } = case;
        let delassus = turn * lifted(&case.delassus, across) * turn.inverse();
        let turned = Case { delassus, u: turn * lift(case.u), restitution, friction };
        for law in LAW_NAMES {
            let (plane, space) = (case.resolve(law), turned.resolve(law));
            // Turning H costs a few ε, amplified by its condition (100).
            let size = 1e-12 * plane.u_plus.norm().max(1.0);
            close(law, (space.u_plus - turn * lift(plane.u_plus)).norm(), 0.0, size);
            // Smith's law turns a rounded slip across the plane into friction, μ P_n/|v_t| times it.
            let stiff = if law == "smith" { 1.0 + case.friction } else { 1.0 };
            let within = 1e-12 * stiff * plane.impulse.norm();
            close(law, (space.impulse - turn * lift(plane.impulse)).norm(), 0.0, within);
            close(law, space.energy_change, plane.energy_change, size * plane.impulse.norm());
            close(law, space.energy_ratio(), plane.energy_ratio(), 1e-11 * plane.energy_ratio().max(1.0));
            assert_eq!(space.mode, plane.mode, "{law} {case:?}");
        }
        // Along an axis nothing is rounded: the outcomes are identical bit by bit.
        let aligned =
            Case { delassus: lifted(case.problem().delassus(), across), u: lift(case.u), restitution, friction };
        for law in ["newton", "poisson", "energetic", "whittaker"] {
            let (plane, space) = (case.resolve(law), aligned.resolve(law));
            let expected = (lift(plane.u_plus), lift(plane.impulse), plane.normal_work, plane.flags);
            assert_eq!((space.u_plus, space.impulse, space.normal_work, space.flags), expected, "{law} {case:?}");
        }
    }
}

/// The direction of a slip that is rounding of the approach is not used.
#[test]
fn rounding_in_the_slip_does_not_choose_the_plane() {
    let h = matrix![2.0, 0.0, 0.5; 0.0, 1.5, 0.0; 0.5, 0.0, 1.2];
    let [clean, noisy] = [vector![0.0, 0.0, -1.0], vector![-1e-17, 3e-17, -1.0]].map(|u| {
        AnyLaw::named("energetic", rough(0.6, 0.1)).unwrap().resolve(&ImpactProblem::new(h, u).unwrap()).unwrap()
    });
    close("u+", (clean.u_plus - noisy.u_plus).norm(), 0.0, 1e-15);
    assert_eq!(noisy.mode, Mode::Slip);
}

/// Spheres and ellipsoids: without inertial coupling (`H_tn = 0`) slip stops where it would cross zero.
#[test]
fn balanced_bodies_in_space_have_their_closed_forms() {
    // A solid sphere, m = R = 1: slip stays in its plane. With friction 0.1 it slips, with 0.5 it sticks.
    let sphere = Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]);
    for law in LAW_NAMES.into_iter().filter(|law| *law != "frictionless") {
        for direction in [vector![1.0, 0.0], vector![0.6, -0.8], vector![-0.28, 0.96]] {
            let u = vector![direction.x, direction.y, -1.0];
            let slips = resolve(law, sphere, u, [0.8, 0.1]);
            let expected = vector![0.37 * direction.x, 0.37 * direction.y, 0.8];
            close(law, (slips.u_plus - expected).norm(), 0.0, 1e-15);
            if law != "smith" {
                let sticks = resolve(law, sphere, u, [0.8, 0.5]);
                close(law, (sticks.u_plus - vector![0.0, 0.0, 0.8]).norm(), 0.0, 1e-15);
                close(law, sticks.impulse.xy().norm(), 2.0 / 7.0, 1e-15);
                assert_eq!((slips.mode, sticks.mode), (Mode::Slip, Mode::Stick), "{law}");
            }
        }
        // Dropped vertically it has no slip direction, and none is needed.
        let straight = resolve(law, sphere, vector![0.0, 0.0, -1.0], [0.8, 0.5]);
        assert_eq!((straight.u_plus, straight.mode), (vector![0.0, 0.0, 0.8], Mode::Stick), "{law}");
        assert_eq!(straight.flags, Flags::NONE, "{law}");
    }
    // An ellipsoid struck on its axis: balanced, but the tangents differ, and slip turns towards the lighter one.
    let (ellipsoid, u) = (Matrix3::from_diagonal(&vector![4.0, 2.0, 1.0]), vector![1.0, 1.0, -1.0]);
    for law in FOLLOWING {
        let hit = resolve(law, ellipsoid, u, [0.5, 0.1]);
        // dv_x/dv_y = 2 v_x/v_y along the flow: v_x/v_y² does not change.
        close(law, hit.u_plus.x, hit.u_plus.y * hit.u_plus.y, 1e-15);
        close(law, hit.u_plus.z, 0.5, 1e-15);
        let stuck = resolve(law, ellipsoid, u, [0.5, 2.0]);
        assert_eq!((stuck.u_plus.x, stuck.u_plus.y, stuck.mode), (0.0, 0.0, Mode::Stick));
        close(law, (stuck.impulse - vector![-0.25, -0.5, 1.5]).norm(), 0.0, 1e-14);
    }
}

/// Numbers near the ends of the range: a finite outcome, or a refusal because a number overflows on the way
/// (`NotFinite`) or an inverse mass along the normal is lost in rounding (`Wedged`). An impulse that loses its digits, because it
/// underflows or friction is 1e308, is refused by the check of outcomes (`Outcome`). Without friction nothing overflows. With
/// a friction of 1e308 the rates of slip overflow, and an impulse may round to 0.
#[test]
fn numbers_near_overflow_are_answered_or_refused() {
    use carom_impact::ImpactError as Why;
    let (mut refusals, mut lost) = ([0; LAW_NAMES.len()], 0);
    for friction in [1e-300, 1e150, 1e308] {
        for (lighter, faster) in
            [(1.0, 1.0), (1e-150, 1.0), (1e150, 1e-3), (1.0, 1e-150), (1e-100, 1e100), (1e300, 1e-10)]
        {
            for (u, restitution) in [(vector![0.6, -0.2, -1.0], 0.5), (vector![1e-12, 0.3, -1.0], 1.0)] {
                let case = Case { delassus: crate::common::TURNING * lighter, u: u * faster, restitution, friction };
                for (law, refused) in LAW_NAMES.into_iter().zip(&mut refusals) {
                    match case.resolved(law) {
                        Ok(hit) => {
                            let finite = hit.impulse.iter().chain(hit.u_plus.iter()).all(|x| x.is_finite());
                            assert!(finite && (hit.impulse.z > 0.0 || friction == 1e308), "{law} {case:?} {hit:?}");
                        }
                        Err(Why::NotFinite { .. } | Why::Wedged { .. }) => *refused += 1,
                        Err(Why::Outcome { .. }) if lighter == 1e300 || friction == 1e308 => lost += 1,
                        Err(why) => panic!("{law} {case:?}: {why}"),
                    }
                }
            }
        }
    }
    assert!(refusals[0] == 0 && refusals.iter().all(|&n| n <= 14) && lost <= 9, "{refusals:?} {lost}");
}
