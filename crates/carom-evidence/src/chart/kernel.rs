//! The first impact alone, in closed form: computing time and error of the velocity jump without simulation.

use super::{Absent, Chart, Run};
use carom_chain::algebra::Algebra;
use carom_chain::{Chain, ChainError, FrameId, Planar, Spatial};
use carom_sim::{EventKind, Moment, Scene, SimError, Trajectory};
use nalgebra::{RealField, Vector2, convert};
use std::hint::black_box;
use std::time::Instant;

/// Number of impacts in a batch, and number of batches. The fastest batch counts, as all of them do the same work.
const BATCH: u32 = 200;
const BATCHES: usize = 25;

impl Chart {
    /// Adds the velocity jump of the first impact, computed from its state in the plane and in space, in double and single
    /// precision.
    pub(super) fn closed_form(&mut self, scene: &Scene, run: &Trajectory) -> Result<(), SimError> {
        let sim = &scene.simulation;
        let Some(event) = run.events.iter().find(|event| super::is_impact(event)) else { return Ok(()) };
        let EventKind::Impact { touch, .. } = event.kind else { return Ok(()) };
        let hit = &sim.touches[touch];
        let name = "closed form of the impact alone";
        let mut refuse = |reason: &str| {
            self.absent.push(Absent { method: name.to_owned(), reason: reason.to_owned() });
            Ok(())
        };
        if hit.contact.law.friction() > 0.0 {
            return refuse("the kernel is frictionless, but the contact has friction");
        }
        if hit.contact.law.known().is_none() {
            return refuse("the kernel has Newton's restitution, but the contact has a user's own law");
        }
        let moment = Moment { time: event.time, q: event.q.clone(), qd: event.qd_minus.clone() };
        let place = sim.touching_point(touch, &moment)?;
        let frame = hit.link().and_then(|link| sim.chain.frame(link).ok());
        let (Some([point, normal]), Some(frame), None) = (place, frame, hit.other_link()) else {
            return refuse("the kernel needs a contact between a link and a surface");
        };
        let e = hit.contact.law.restitution();
        let mut results: Vec<(&str, f64, Timed)> = Vec::new();
        let (q, qd) = (&moment.q, &moment.qd);
        if let Some(flat) = sim.in_plane() {
            let (point, normal) = (flat.plane.project(point), flat.plane.project(normal));
            let offset = in_frame(&flat.chain, q, frame, point)?;
            let exact = kernel::<Planar<f64>>(&flat.chain, frame, (offset, normal), e, (q, qd))?;
            let single = |v: Vector2<f64>| v.map(|x| x as f32);
            let rough = kernel::<Planar<f32>>(
                &flat.chain.cast(),
                frame,
                (single(offset), single(normal)),
                e as f32,
                (&narrowed(q), &narrowed(qd)),
            )?;
            results.extend([("in the plane", 64.0, exact), ("in the plane", 32.0, rough)]);
        }
        let offset = in_frame(&sim.chain, q, frame, point)?;
        let exact = kernel::<Spatial<f64>>(&sim.chain, frame, (offset, normal), e, (q, qd))?;
        let single = |v: nalgebra::Vector3<f64>| v.map(|x| x as f32);
        let rough = kernel::<Spatial<f32>>(
            &sim.chain.cast(),
            frame,
            (single(offset), single(normal)),
            e as f32,
            (&narrowed(q), &narrowed(qd)),
        )?;
        results.extend([("in space", 64.0, exact), ("in space", 32.0, rough)]);
        // coarse before fine, as in the other methods
        results.sort_by(|a, b| a.1.total_cmp(&b.1));
        for space in ["in the plane", "in space"] {
            for (_, bits, (wall_time, qd)) in results.iter().filter(|it| it.0 == space) {
                let after_impact = self.reference.after_impact(qd);
                self.runs.push(Run {
                    method: format!("{name}, {space}"),
                    law: "any, without friction".to_owned(),
                    knob: "bits".to_owned(),
                    value: *bits,
                    wall_time: *wall_time,
                    after_impact,
                    at_end: None,
                    estimated_at_end: None,
                });
            }
        }
        Ok(())
    }
}

fn narrowed(numbers: &[f64]) -> Vec<f32> {
    numbers.iter().map(|x| *x as f32).collect()
}

/// A world point in the axes of a frame.
fn in_frame<A: Algebra<Scalar = f64>>(
    chain: &Chain<A>,
    q: &[f64],
    frame: FrameId,
    point: A::Vector,
) -> Result<A::Vector, ChainError> {
    let mut workspace = chain.workspace();
    Ok(workspace.update(chain, q)?.pose(frame).inverse().point(point))
}

/// Time, s, and the joint velocities after the impact.
type Timed = (f64, Vec<f64>);

/// Time of one impact, from q and q̇⁻ to q̇⁺, and q̇⁺.
fn kernel<A: Algebra>(
    chain: &Chain<A>,
    frame: FrameId,
    (offset, normal): (A::Vector, A::Vector),
    restitution: A::Scalar,
    (q, qd): (&[A::Scalar], &[A::Scalar]),
) -> Result<Timed, ChainError>
where
    A::Scalar: Into<f64> + RealField,
{
    let mut workspace = chain.workspace();
    let point = chain.point(frame, offset);
    let mut qd_plus = qd.to_vec();
    let mut fastest = f64::INFINITY;
    for _ in 0..BATCHES {
        let start = Instant::now();
        for _ in 0..BATCH {
            let mut kin = workspace.update(chain, black_box(q))?;
            let response = kin.contact(point, normal, &[])?;
            let approach = A::dot(normal, response.velocity(qd));
            let impulse =
                A::times(normal, -(convert::<f64, A::Scalar>(1.0) + restitution) * approach / response.mobility);
            for ((after, before), x) in qd_plus.iter_mut().zip(qd).zip(response.response) {
                *after = *before + A::dot(*x, impulse);
            }
            black_box(&qd_plus);
        }
        fastest = fastest.min(start.elapsed().as_secs_f64() / f64::from(BATCH));
    }
    Ok((fastest, qd_plus.into_iter().map(Into::into).collect()))
}
