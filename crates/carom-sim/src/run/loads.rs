//! The loads of a run on the joints, where they are asked for.

use super::run_state::Run;
use super::sampler::Told;
use super::trajectory::{EventLoads, Summary};
use crate::error::SimError;
use crate::impact::{ImpactLoads, impact_loads};
use crate::model::Simulation;
use crate::motion::ContactState;
use crate::state::{ContactImpulse, Space};
use carom_chain::FramePoint;
use nalgebra::Vector3;

impl<A: Space> Run<'_, '_, A> {
    /// These contacts, with the forces of the motors at a state if loads are asked for.
    pub fn told(&mut self, contacts: Vec<ContactState>, y: &[f64]) -> Result<Told, SimError> {
        Ok(Told { contacts, motors: self.motor_forces(y)?.unwrap_or_default() })
    }

    /// The forces of the motors at a state; `None` if loads are not asked for.
    pub fn motor_forces(&mut self, y: &[f64]) -> Result<Option<Vec<f64>>, SimError> {
        let asked = self.sampler.sampling.loads;
        asked.then(|| self.motion.motor_forces(self.time, y)).transpose()
    }

    /// The loads of an impact that has led from `before` to the present state; `motors_minus`: [`Self::motor_forces`] just before.
    pub fn loads(
        &mut self,
        before: &[f64],
        impulses: &[ContactImpulse],
        motors_minus: Option<Vec<f64>>,
    ) -> Result<Option<Box<EventLoads>>, SimError> {
        let Some(motors_minus) = motors_minus else { return Ok(None) };
        let y = self.y.clone();
        let motors_plus = self.motor_forces(&y)?.unwrap_or_default();
        let sim = self.motion.sim;
        let ((q, after), (_, before)) = (sim.split(&y), sim.split(before));
        let change: Vec<f64> = after.iter().zip(before).map(|(after, before)| after - before).collect();
        let loads = impact_loads(&sim.chain, q, &change, &on_links(sim, q, impulses)?)?;
        // Those through the joints of a loop depend on how they are divided between its two sides.
        let through = if sim.loops.is_empty() { loads.through } else { Vec::new() };
        let impact = ImpactLoads { through, ..loads };
        Ok(Some(Box::new(EventLoads { impact, motors_minus, motors_plus })))
    }
}

impl Summary {
    /// What a run of this simulation has no loads of, one sentence each.
    pub fn missing_loads(&self, sim: &Simulation) -> Vec<String> {
        let loops: Vec<&str> = sim.loops.iter().map(|it| it.name.as_str()).collect();
        let looped = (!loops.is_empty()).then(|| {
            let names = loops.join(", ");
            format!("loads: the impulses through joints are not determined, because loops carry a part ({names})")
        });
        let steps = self.statistics.contact_steps;
        let text = format!("loads: {steps} time steps have none, because their impacts are no events");
        looped.into_iter().chain((steps > 0).then_some(text)).collect()
    }
}

/// Contact impulses as impulses on points of links: between two links of the robot both get one.
fn on_links(
    sim: &Simulation,
    q: &[f64],
    impulses: &[ContactImpulse],
) -> Result<Vec<(FramePoint, Vector3<f64>)>, SimError> {
    let mut workspace = sim.chain.workspace();
    let kin = workspace.update(&sim.chain, q)?;
    let mut all = Vec::new();
    for ContactImpulse { touch, point, impulse } in impulses {
        let touch = &sim.touches[*touch];
        for (link, impulse) in [(touch.link(), *impulse), (touch.other_link(), -impulse)] {
            if let Some(link) = link {
                let frame = sim.chain.frame(link)?;
                let pose = kin.pose(frame);
                all.push((FramePoint::new(frame, pose.rotation.tr_mul(&(point - pose.translation))), impulse));
            }
        }
    }
    Ok(all)
}
