//! The numbers by which a plan decides: bounds, equal corners, and the fastest rate.

use crate::contact::{Moving, Touch, TouchKind, friction_bound};
use crate::error::SimError;
use crate::model::{Drive, Simulation, motors};
use crate::motion::Motion;
use crate::state::{EXACT, View};
use carom_chain::{Chain, Coordinates, JointInfo, PlanarChain, Spatial};
use nalgebra::DMatrix;

/// Largest penetration, m, of the compliant touch with the smallest gap, if it were hit at the start pose and velocity.
pub(super) fn depth_at_start(sim: &Simulation, q: &[f64], qd: &[f64]) -> Result<f64, SimError> {
    let mut motion = Motion::<Spatial<f64>>::new(sim, &sim.chain);
    let mut nearest: Option<(f64, f64)> = None;
    for (k, touch) in sim.touches.iter().enumerate() {
        let Some(compliance) = touch.contact.compliance else { continue };
        let (gap, rate, _) = motion.closing(k, q, qd, 0.0)?;
        if nearest.is_none_or(|(least, _)| gap < least) {
            let speed = (-rate).max(motion.scale.slowest());
            let mass = motion.effective_mass(k, q, 0.0)?;
            nearest =
                Some((gap, compliance.normal(touch.contact.law.restitution())?.greatest_penetration(speed, mass)));
        }
    }
    Ok(nearest.map_or(0.0, |(_, depth)| depth))
}

/// Friction bound of the touch with the smallest gap, if it were hit at the start pose and velocity.
pub(super) fn bound_at_start(
    sim: &Simulation,
    q: &[f64],
    qd: &[f64],
    [mu, e]: [f64; 2],
) -> Result<Option<f64>, SimError> {
    let mut workspace = sim.chain.workspace();
    let couplings = sim.couplings::<Spatial<f64>>(&sim.chain);
    let mut view = View::closed_by(&sim.chain, &mut workspace, q, &couplings)?;
    let near = sim.touches.iter().map(|touch| touch.at(&view, q, 0.0)).filter(|at| at.surface.is_some() && at.counts());
    let Some(place) = near.min_by(|a, b| a.gap.total_cmp(&b.gap)).and_then(|at| at.surface) else {
        return Ok(None);
    };
    let u = place.velocity(&view, qd)?;
    let approach = (-place.normal.dot(&u)).max(0.0);
    let speed = u.norm();
    let bound = place
        .inertia(&mut view)?
        .map_or(f64::INFINITY, |(delassus, _)| friction_bound(&delassus, &place.normal, approach, e, mu));
    Ok((speed > 0.0).then(|| bound / speed))
}

/// The floating and planar joints, which no motor drives.
pub(super) fn without_motor(chain: &Chain) -> Vec<&str> {
    let free = |joint: &&JointInfo| matches!(&joint.coordinates, Coordinates::Own { v, .. } if v.len() > 1);
    chain.joints().iter().filter(free).map(|joint| joint.name.as_str()).collect()
}

/// The touches without the corners that differ from another one only perpendicular to the plane.
pub(super) fn merged(touches: &[Touch], flat: &PlanarChain) -> Vec<Touch> {
    let normal = flat.plane.normal;
    let mut kept: Vec<Touch> = Vec::new();
    for touch in touches {
        let shadow = |touch: &Touch| match &touch.kind {
            TouchKind::Ball { shape, centre, radius, normal: n, .. } if n.dot(&normal).abs() < EXACT => {
                Some((shape.frame(), flat.point(shape.frame(), *centre).position, *radius, centre.norm()))
            }
            _ => None,
        };
        // Of compliant corners each has its own force.
        let own = shadow(touch).filter(|_| touch.contact.compliance.is_none());
        let twin = |other: &Touch| {
            let (Some(a), Some(b)) = (own, shadow(other)) else { return false };
            a.0 == b.0
                && (a.1 - b.1).norm() <= EXACT * a.3
                && a.2 == b.2
                && other.surface == touch.surface
                && !touch.motion.as_ref().is_some_and(Moving::turns)
                && other.contact == touch.contact
        };
        if !kept.iter().any(twin) {
            kept.push(touch.clone());
        }
    }
    kept
}

/// An estimate of the fastest rate of drive and damping, 1/s: for M ẍ + D ẋ + K x = 0 the larger of the largest eigenvalue
/// of M⁻¹D and the root of that of M⁻¹K.
pub(super) fn fastest_rate(simulation: &Simulation, q: &[f64]) -> Result<f64, SimError> {
    let chain = &simulation.chain;
    let tracked = simulation.drives().map(Drive::rate).fold(0.0, f64::max);
    let (mut stiffness, mut damping) = (vec![0.0; chain.nv()], simulation.damping());
    for motor in motors(chain) {
        let gains = simulation.drives().map(|drive| drive.law().gains(motor.v));
        let (p, d) = gains.fold((0.0, 0.0), |(p, d): (f64, f64), own| (p.max(own.0), d.max(own.1)));
        stiffness[motor.v] += p;
        damping[motor.v] += d;
    }
    for spring in simulation.springs_at() {
        stiffness[spring.v] += spring.stiffness;
        damping[spring.v] += spring.damping;
    }
    if stiffness.iter().chain(&damping).all(|x| *x == 0.0) {
        return Ok(tracked);
    }
    let mut workspace = chain.workspace();
    let mut mass = workspace.update(chain, q)?.mass_matrix();
    mass.fill_upper_triangle_with_lower_triangle();
    let largest = |diagonal: &[f64]| {
        let root = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(
            diagonal.len(),
            diagonal.iter().map(|d| d.sqrt()),
        ));
        let Some(inverse) = mass.clone().cholesky().map(|cholesky| cholesky.inverse()) else { return 0.0 };
        (&root * inverse * &root).symmetric_eigenvalues().max().max(0.0)
    };
    Ok(largest(&damping).max(largest(&stiffness).sqrt()).max(tracked))
}
