//! A census of impacts at points that few joints move: doors, pendulums, arms of two joints, SCARA arms, turned at random in space.
//! What no joint moves is refused, and every outcome satisfies the equations of an impact.

use carom_chain::{Chain, FramePoint};
use carom_impact::{Coefficients, Flags, ImpactError, LAW_NAMES, law_by_name};
use carom_sim::{ChainImpact, Impacts, JointModel, SimError};
use carom_testing::build::{O, Part, chain};
use nalgebra::{DVector, Vector3};

type Rng = fastrand::Rng;

fn unit(rng: &mut Rng) -> f64 {
    2.0 * rng.f64() - 1.0
}

fn vector(rng: &mut Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| unit(rng))
}

fn direction(rng: &mut Rng) -> Vector3<f64> {
    loop {
        if let Some(n) = vector(rng).try_normalize(0.1) {
            return n;
        }
    }
}

/// A row of joints, each with its type and axis, the first turned at random in the world; the links are l0, l1, …
fn robot(rng: &mut Rng, joints: &[(&'static str, Vector3<f64>)]) -> Chain {
    let part = |(k, (kind, axis)): (usize, &(&'static str, Vector3<f64>))| {
        let parent = k.checked_sub(1).map_or("base".into(), |p| format!("l{p}"));
        // The joints of an arm are parallel to the one before, as their axes are given.
        let turned = if k == 0 { (vector(rng) * 3.0).into() } else { O };
        let (place, com) = (vector(rng), vector(rng) * 0.5);
        let (mass, inertia) = (0.2 + rng.f64(), 0.01 + 0.1 * rng.f64());
        let part = Part::new(&format!("l{k}"), &parent, kind, (*axis).into(), place.into());
        part.turned(turned).com(com.into()).weighing(mass, [inertia; 3])
    };
    chain(&joints.iter().enumerate().map(part).collect::<Vec<_>>())
}

/// A robot, a point of its last link, and whether that lies on the axis of the only joint.
fn draw(rng: &mut Rng) -> (Chain, Vector3<f64>, bool) {
    let axis = if rng.bool() { Vector3::z() } else { direction(rng) };
    let other = if rng.bool() { axis } else { direction(rng) };
    // The origin of a link is on the axis of its joint.
    let on_axis = axis * (4.0 * unit(rng));
    match rng.usize(0..6) {
        0 | 1 => (robot(rng, &[("continuous", axis)]), on_axis, true),
        2 => (robot(rng, &[("continuous", axis)]), vector(rng), false),
        3 => (
            robot(rng, &[("continuous", other), ("continuous", axis)]),
            if rng.bool() { on_axis } else { vector(rng) },
            false,
        ),
        4 => (robot(rng, &[("continuous", other), ("prismatic", axis)]), vector(rng), false),
        _ => {
            let joints = [("continuous", axis), ("continuous", axis), ("prismatic", axis)];
            let last = if rng.bool() { 3 } else { 2 };
            (robot(rng, &joints[..last]), if rng.bool() { on_axis } else { vector(rng) }, false)
        }
    }
}

/// A normal: any, or one within rounding of a direction in which one joint does not move the point.
fn normal(rng: &mut Rng, jacobian: &nalgebra::DMatrix<f64>) -> Vector3<f64> {
    let n = direction(rng);
    let column = jacobian.column(rng.usize(0..jacobian.ncols())).into_owned();
    let column = Vector3::from_column_slice(column.as_slice());
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

#[derive(Default, Debug)]
struct Counts {
    resolved: usize,
    singular: usize,
    wedged: usize,
    failed: usize,
}

fn census(seed: u64, robots: usize) -> Counts {
    let mut rng = Rng::with_seed(seed);
    let mut counts = Counts::default();
    for _ in 0..robots {
        let (chain, offset, on_axis) = draw(&mut rng);
        let q: Vec<f64> = (0..chain.nq()).map(|_| 3.0 * unit(&mut rng)).collect();
        let qd: Vec<f64> = (0..chain.nv()).map(|_| unit(&mut rng)).collect();
        let frame = chain.frame(&format!("l{}", chain.nv() - 1)).unwrap();
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(&chain, &q).unwrap();
        let (jacobian, mass) = (kin.point_jacobian(chain.point(frame, offset)), kin.mass_matrix());
        let normal = normal(&mut rng, &jacobian);
        let coefficients = Coefficients {
            restitution: [0.0, 0.5, 1.0][rng.usize(0..3)],
            tangential_restitution: unit(&mut rng),
            friction: [0.0, 0.3, 1.0, 3.0][rng.usize(0..4)],
        };
        for name in LAW_NAMES {
            let law = law_by_name::<3>(name, coefficients).unwrap();
            let strike = chain.impact(&q, &qd).at(FramePoint::new(frame, offset)).normal(normal);
            let case =
                || format!("{name} {coefficients:?}\nq {q:?} qd {qd:?} offset {offset:?} normal {normal:?}\n{chain:?}");
            match strike.resolve(&*law) {
                Err(SimError::SingularNormal { .. }) => counts.singular += 1,
                _ if on_axis => panic!("a point on the axis is moved: {}", case()),
                Err(SimError::Impact(ImpactError::Wedged { .. })) => counts.wedged += 1,
                // Refused by a check: rare, and never a number.
                Err(SimError::Impact(ImpactError::Outcome { .. }) | SimError::Unbalanced { .. }) => counts.failed += 1,
                Err(why) => panic!("{why}: {}", case()),
                Ok(hit) => {
                    counts.resolved += 1;
                    if let Err(why) = satisfies(&hit, (&jacobian, &mass), &qd, &normal, &coefficients) {
                        panic!("{why}: {hit:?}\n{}", case());
                    }
                }
            }
        }
    }
    counts
}

/// The equations of an impact with J and M, to 1e-9 and to 1024 ε of the terms that cancel.
fn satisfies(
    hit: &ChainImpact,
    (jacobian, mass): (&nalgebra::DMatrix<f64>, &nalgebra::DMatrix<f64>),
    qd: &[f64],
    normal: &Vector3<f64>,
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
        return if hit.impulse == Vector3::zeros() { Ok(()) } else { Err("an impulse without approach".into()) };
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

#[test]
fn points_that_few_joints_move_are_refused_or_struck_by_the_equations_of_an_impact() {
    let counts = census(1, 1500);
    assert!(counts.resolved > 2000 && counts.singular > 3000 && counts.wedged > 50, "{counts:?}");
    assert_eq!(counts.failed, 0, "{counts:?}");
}

#[test]
#[ignore = "some minutes; run with --ignored after changes of laws or of the rank of H"]
fn a_large_census_of_points_that_few_joints_move() {
    let (mut resolved, mut failed) = (0, 0);
    for seed in 2..102 {
        let counts = census(seed, 2000);
        println!("{seed}: {counts:?}");
        (resolved, failed) = (resolved + counts.resolved, failed + counts.failed);
    }
    // Paths of the impulse near a wedge whose rounding the checks do not admit.
    assert!(failed * 10_000 < resolved, "{failed} refused by a check, {resolved} resolved");
}

/// A hinge does not move the points of its axis, wherever they are along it and wherever its joint is.
#[test]
fn a_blow_on_the_axis_of_a_hinge_is_refused_under_every_law_and_joint_model() {
    let mut rng = Rng::with_seed(7);
    for reach in [1e-3, 1.0, 1e3] {
        for _ in 0..40 {
            let axis = direction(&mut rng);
            let chain = robot(&mut rng, &[("continuous", axis)]);
            let (q, qd) = ([3.0 * unit(&mut rng)], [1.0]);
            let point = FramePoint::new(chain.frame("l0").unwrap(), axis * (reach * unit(&mut rng)));
            let heavy = JointModel::Impedance { stiffness: &[1e3], damping: &[1.0], contact_time: 1e-3 };
            for (name, joints) in LAW_NAMES.into_iter().flat_map(|name| [(name, JointModel::Free), (name, heavy)]) {
                let law =
                    law_by_name::<3>(name, Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() });
                let strike = chain.impact(&q, &qd).at(point).normal(direction(&mut rng)).joints(joints);
                let refusal = strike.resolve(&*law.unwrap()).map(|hit| hit.impulse);
                assert!(matches!(refusal, Err(SimError::SingularNormal { .. })), "{name} {reach}: {refusal:?}");
            }
        }
    }
}

/// The same far from the origin of the joint: offsets of a kilometre cancel, and with them twelve digits of the lever.
#[test]
fn a_lever_that_is_rounding_of_lengths_that_cancel_moves_nothing() {
    let mut rng = Rng::with_seed(8);
    for _ in 0..40 {
        let (axis, other, far) = (direction(&mut rng), direction(&mut rng), vector(&mut rng) * 1e3);
        let link = |name: &str, parent: &str, axis: Vector3<f64>| {
            Part::hinge(name, parent, axis.into()).com([0.1, 0.2, 0.3]).weighing(1.0, [0.1; 3])
        };
        // The second joint does not move its own axis; locked, it leaves the first, on whose axis the point is but for rounding.
        let chain = chain(&[link("one", "base", axis), link("two", "one", other).at(far.into())]);
        let point = FramePoint::new(chain.frame("two").unwrap(), axis * 0.3 - far);
        let (q, qd) = ([2.0 * unit(&mut rng), 0.0], [1.0, 0.0]);
        let law = law_by_name::<3>("frictionless", Coefficients::default()).unwrap();
        let strike = chain.impact(&q, &qd).at(point).normal(direction(&mut rng)).joints(JointModel::Locked(&["jtwo"]));
        let refusal = strike.resolve(&*law).map(|hit| hit.impulse);
        assert!(matches!(refusal, Err(SimError::Locked { .. })), "{refusal:?}");
    }
}
