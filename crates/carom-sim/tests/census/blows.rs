//! Blows at points that few joints move: doors, pendulums, arms of two joints, SCARA arms, anywhere in space. Every law of a blow refuses what
//! no joint moves, and satisfies the equations of an impact otherwise.

use super::build::*;
use super::{Verdict, compare};
use carom_chain::{Chain, FramePoint};
use carom_impact::{Coefficients, Flags, ImpactError, law_by_name};
use carom_sim::{ChainImpact, Impacts, SimError};
use carom_testing::build::chain;
use fastrand::Rng;
use nalgebra::{DMatrix, DVector};

pub fn vector(rng: &mut Rng) -> V {
    V::from_fn(|_, _| within(rng, -1.0, 1.0))
}

/// A row of joints, each with its type and axis, the first anywhere in the world; the links are l0, l1, …
pub fn robot(rng: &mut Rng, joints: &[(&'static str, V)]) -> (Chain, f64) {
    let place = Place::random(rng);
    let mut parts = vec![place.mount()];
    // What the joints before the last could move its origin by, for each radian.
    let mut lever = 0.0;
    for (k, (kind, axis)) in joints.iter().enumerate() {
        // The joints of an arm are parallel to the one before, as their axes are given.
        let (parent, at) = match k.checked_sub(1) {
            None => ("mount".into(), O),
            Some(before) => (format!("l{before}"), vector(rng).into()),
        };
        lever += V::from(at).norm();
        parts.push(Part::new(&format!("l{k}"), &parent, kind, (*axis).into(), at).random(rng, 1.0));
    }
    (chain(&parts), lever)
}

struct Blow {
    chain: Chain,
    group: &'static str,
    /// The point on the last link.
    offset: V,
    /// Whether the point lies on the axis of the only joint.
    on_axis: bool,
    /// What the joints could move the point by, for each radian.
    lever: f64,
}

fn draw(rng: &mut Rng) -> Blow {
    let axis = if rng.bool() { V::z() } else { direction(rng) };
    let other = if rng.bool() { axis } else { direction(rng) };
    // The origin of a link is on the axis of its joint.
    let along = axis * within(rng, -4.0, 4.0);
    let (group, joints, on_axis) = match rng.usize(0..6) {
        0 | 1 => ("on the axis of the only hinge", vec![("continuous", axis)], true),
        2 => ("one hinge", vec![("continuous", axis)], false),
        3 => ("two hinges", vec![("continuous", other), ("continuous", axis)], rng.bool()),
        4 => ("a hinge and a slider", vec![("continuous", other), ("prismatic", axis)], false),
        _ => {
            let joints = vec![("continuous", axis), ("continuous", axis), ("prismatic", axis)];
            if rng.bool() {
                ("SCARA", joints, rng.bool())
            } else {
                ("parallel hinges", joints[..2].to_vec(), rng.bool())
            }
        }
    };
    let offset = if on_axis { along } else { vector(rng) };
    let (chain, lever) = robot(rng, &joints);
    Blow { group, offset, on_axis: on_axis && joints.len() == 1, lever: lever + offset.norm(), chain }
}

/// A normal: any, or one within rounding of a direction in which one joint does not move the point.
fn normal(rng: &mut Rng, jacobian: &DMatrix<f64>) -> V {
    let n = direction(rng);
    let column = V::from_column_slice(jacobian.column(rng.usize(0..jacobian.ncols())).into_owned().as_slice());
    match rng.usize(0..4) {
        0 => column.cross(&n).try_normalize(0.0).unwrap_or(n),
        // So flat that H_nn is a small share of H.
        1 => match (column.cross(&n).try_normalize(0.0), column.try_normalize(0.0)) {
            (Some(across), Some(along)) => (across + along * 10f64.powf(-12.0 * rng.f64())).normalize(),
            _ => n,
        },
        _ => n,
    }
}

/// One blow under all laws: right if one of them has an answer, or if none may have one.
pub fn judge(seed: u64) -> Verdict {
    let rng = &mut Rng::with_seed(seed);
    let Blow { chain, group, offset, on_axis, lever } = draw(rng);
    let [q, qd] = [3.0, 1.0].map(|size| (0..chain.nv()).map(|_| within(rng, -size, size)).collect::<Vec<_>>());
    let frame = chain.frame(&format!("l{}", chain.nv() - 1)).expect("the last link");
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(&chain, &q).expect("a pose");
    let (jacobian, mass) = (kin.point_jacobian(chain.point(frame, offset)), kin.mass_matrix());
    let normal = normal(rng, &jacobian);
    let coefficients = Coefficients {
        restitution: one_of(rng, &[0.0, 0.5, 1.0]),
        tangential_restitution: within(rng, -1.0, 1.0),
        friction: one_of(rng, &[0.0, 0.3, 1.0, 3.0]),
    };
    // 64 ε of the lever is 1.4e-14: a hinge does not move what is below it.
    let immobile = jacobian.tr_mul(&normal).amax() <= 1e-14 * lever;
    let (mut resolved, mut wedged) = (0, 0);
    for name in LAWS {
        let law = law_by_name::<3>(name, coefficients).expect("a law of this name");
        let strike = || chain.impact(&q, &qd).at(FramePoint::new(frame, offset)).normal(normal).resolve(&*law);
        let case = |what: &dyn std::fmt::Debug| {
            format!("{name}: {what:?}, {coefficients:?}, q {q:?}, qd {qd:?}, offset {offset:?}, normal {normal:?}")
        };
        let hit = match std::panic::catch_unwind(std::panic::AssertUnwindSafe(strike)) {
            Err(_) => return Verdict::bad(group, "panic", case(&"")),
            Ok(Err(SimError::SingularNormal { .. })) => continue,
            Ok(found) if on_axis => return Verdict::bad(group, "a point on the axis is moved", case(&found)),
            Ok(Err(SimError::Impact(ImpactError::Wedged { .. }))) => {
                wedged += 1;
                continue;
            }
            // Rare: paths of the impulse near a wedge whose rounding the checks do not admit.
            Ok(Err(why @ (SimError::Impact(ImpactError::Outcome { .. }) | SimError::Unbalanced { .. }))) => {
                return Verdict::bad(group, "refused by a check", case(&why));
            }
            Ok(Err(why)) => return Verdict::bad(group, "refused for another reason", case(&why)),
            Ok(Ok(hit)) => hit,
        };
        if immobile && compare(&hit.qd_plus, &qd) > 1e-9 {
            return Verdict::bad(group, "a blow that no joint moves has an impulse", case(&hit));
        }
        if let Err(why) = satisfies(&hit, (&jacobian, &mass), &qd, &normal, &coefficients) {
            return Verdict::bad(group, "an equation is not satisfied", format!("{why}: {}", case(&hit)));
        }
        resolved += 1;
    }
    let class = match (resolved, wedged) {
        (0, 0) if on_axis => return Verdict::right(group, "refused, since nothing moves", String::new()),
        (0, 0) => "refused as immobile",
        (0, _) => "wedged",
        (_, 0) => return Verdict::right(group, "satisfied", String::new()),
        _ => return Verdict::right(group, "satisfied, or wedged", String::new()),
    };
    Verdict::open(group, class, String::new())
}

/// The equations of an impact with J and M, to 1e-9 and to 1024 ε of the terms that cancel.
fn satisfies(
    hit: &ChainImpact,
    (jacobian, mass): (&DMatrix<f64>, &DMatrix<f64>),
    qd: &[f64],
    normal: &V,
    coefficients: &Coefficients,
) -> Result<(), String> {
    const ROUNDED: f64 = 1024.0 * f64::EPSILON;
    let (before, after) = (DVector::from_column_slice(qd), DVector::from_column_slice(&hit.qd_plus));
    let push = DVector::from_column_slice(hit.impulse.as_slice());
    let response = mass.clone().cholesky().unwrap().solve(&jacobian.transpose());
    let rates = before.abs() + response.abs() * push.abs();
    let speeds = jacobian.abs() * &rates;
    let miss = (jacobian * &after - DVector::from_column_slice(hit.u_plus.as_slice())).amax();
    // Each component in contact axes has this rounding; in world axes the largest may be √3 times as large.
    let rounding = 3.0_f64.sqrt() * ROUNDED * speeds.amax();
    if miss > 1e-9 * hit.u_minus.amax() + rounding {
        return Err(format!("u⁺ is not J q̇⁺, by {miss:e}"));
    }
    let energy = |v: &DVector<f64>| 0.5 * v.dot(&(mass * v));
    let (change, works) = (energy(&after) - energy(&before), hit.contact.normal_work + hit.contact.friction_work);
    let terms = rates.dot(&(mass.abs() * &rates));
    if (change - works).abs() > 1e-9 * energy(&before) + (ROUNDED * terms).min(1e-3 * energy(&before)) {
        return Err(format!("T⁺ − T⁻ is {change:e}, works {works:e}"));
    }
    let p_n = hit.impulse.dot(normal);
    let p_t = (hit.impulse - normal * p_n).norm();
    let u_n = hit.u_plus.dot(normal);
    // A law with Newton's coefficient may gain, which it says.
    let gains = change > 1e-9 * energy(&before) + ROUNDED * terms;
    if gains && !hit.flags.contains(Flags::ENERGY_GAIN) {
        return Err(format!("gains {change:e} J without a flag"));
    }
    if hit.flags.contains(Flags::NO_APPROACH) {
        return if hit.impulse == V::zeros() { Ok(()) } else { Err("an impulse without approach".into()) };
    }
    if u_n < -1e-12 * hit.u_minus.amax() - ROUNDED * speeds.amax() {
        return Err(format!("it still approaches with {u_n:e}"));
    }
    // Without friction the impulse is (1 + e) |u_n| / H_nn. Where friction wedges almost it is greater without bound, where H is singular
    // and a law takes it for regular by the inverse of rounding.
    let row = jacobian.tr_mul(normal);
    let mobility = row.dot(&mass.clone().cholesky().unwrap().solve(&row));
    let smooth = 2.0 * row.dot(&before).abs() / mobility;
    if p_n > 1e6 * smooth && !hit.flags.contains(Flags::ENERGY_GAIN) {
        return Err(format!("{p_n:e} N s, without friction {smooth:e}"));
    }
    // Coulomb's cone, to the rounding of the normal impulse, which is a velocity over H_nn.
    let allowed = 1e-9 * (p_t + p_n.abs()) + ROUNDED * row.abs().dot(&rates) / mobility;
    if p_t > coefficients.friction * p_n + allowed * (1.0 + coefficients.friction) {
        return Err(format!("{p_t:e} N s along the surface beside {p_n:e}"));
    }
    Ok(())
}
