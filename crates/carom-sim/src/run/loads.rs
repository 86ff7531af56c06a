//! The loads of a run on the joints, where they are asked for.

use super::run_state::Run;
use super::sampler::Told;
use super::trajectory::{EventLoads, Summary};
use crate::error::{SimError, require};
use crate::impact::{ImpactLoads, impact_loads};
use crate::model::Simulation;
use crate::motion::ContactState;
use crate::state::{ContactImpulse, EXACT, Space, View};
use carom_chain::algebra::z_onto;
use carom_chain::{FramePoint, Spatial};
use carom_impact::{ImpactProblem, least_norm};
use nalgebra::{DMatrix, DVector, Vector3};

impl Simulation {
    /// The normal impulses of these touches (N s, of joint limits N m s) in an impact from `qd_minus` to `qd_plus` at `q`: of a single contact
    /// that of its law; otherwise those with Jᵀ p = M (q̇⁺ − q̇⁻), where J has the normal of each touch and, with friction, two tangents; of several
    /// the shortest p.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an invalid state; [`SimError::Setting`] for several contacts of a mechanism with loops, whose impulses are not determined.
    pub fn normal_impulses(
        &self,
        touches: &[usize],
        q: &[f64],
        [qd_minus, qd_plus]: [&[f64]; 2],
        time: f64,
    ) -> Result<Vec<f64>, SimError> {
        let nv = self.chain.nv();
        let change: Vec<f64> = qd_plus.iter().zip(qd_minus).map(|(after, before)| after - before).collect();
        self.chain.check_state(q, &change)?;
        if let [touch] = *touches
            && let Some(impulse) = self.normal_impulse(touch, q, qd_minus, time)?
        {
            return Ok(vec![impulse]);
        }
        let loops = self.loops.len();
        require(
            loops == 0,
            "number of loops",
            loops as f64,
            "the impulses of several contacts and of limits of a mechanism with loops are not determined",
        )?;
        let mut workspace = self.chain.workspace();
        let mut view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, q)?;
        let momentum = view.kin.mass_matrix() * DVector::from_vec(change);
        let (mut rows, mut normals) = (Vec::new(), Vec::new());
        for touch in touches.iter().filter_map(|k| self.touches.get(*k)) {
            let at = touch.at(&view, q, time);
            normals.push(rows.len());
            let mut normal = vec![0.0; nv];
            touch.row_into(&at, &view, &mut normal)?;
            rows.push(DVector::from_vec(normal));
            if let Some(place) =
                at.surface.filter(|_| touch.contact.latch || touch.contact.law.coefficients.friction > 0.0)
            {
                let n = place.normal;
                let along = n.cross(&Vector3::ith(n.iamin(), 1.0)).normalize();
                for tangent in [along, n.cross(&along)] {
                    let mut row = vec![0.0; nv];
                    place.row_into(&view, tangent, &mut row)?;
                    rows.push(DVector::from_vec(row));
                }
            }
        }
        if rows.is_empty() {
            return Ok(Vec::new());
        }
        let p = least_norm(&DMatrix::from_columns(&rows), &momentum, EXACT);
        Ok(normals.into_iter().map(|k| p[k]).collect())
    }

    /// The normal impulse of one contact at these velocities before its impact, by its law. `None` for joint limits and latches.
    fn normal_impulse(&self, touch: usize, q: &[f64], qd: &[f64], time: f64) -> Result<Option<f64>, SimError> {
        let Some(one) = self.touches.get(touch).filter(|one| !one.contact.latch && one.limit_of().is_none()) else {
            return Ok(None);
        };
        let (mut workspace, couplings) = (self.chain.workspace(), self.couplings(&self.chain));
        let mut view = View::<Spatial<f64>>::closed_by(&self.chain, &mut workspace, q, &couplings)?;
        let Some(place) = one.at(&view, q, time).surface else { return Ok(None) };
        let u = one.u(&place, &view, qd, time)?;
        let Some((delassus, _)) = place.inertia(&mut view)? else { return Ok(None) };
        let axes = z_onto(place.normal);
        let problem = ImpactProblem::from_gram(axes.transpose() * delassus * axes, axes.transpose() * u)?;
        Ok(Some(problem.resolve(&*one.contact.law)?.impulse.z))
    }
}

impl<A: Space> Run<'_, '_, A> {
    /// These contacts, with the forces of the motors at a state if loads are asked for.
    pub fn told(&mut self, contacts: Vec<ContactState>, y: &[f64]) -> Result<Told, SimError> {
        Ok(Told { contacts, motors: self.motor_forces(self.time, y)? })
    }

    /// The forces of the motors at a state; none if loads are not asked for.
    pub fn motor_forces(&mut self, time: f64, y: &[f64]) -> Result<Vec<f64>, SimError> {
        if self.sampler.sampling.loads { self.motion.motor_forces(time, y) } else { Ok(Vec::new()) }
    }

    /// The loads of an impact that has led from `before` to the present state; `motors_minus`: [`Self::motor_forces`] just before.
    pub fn loads(
        &mut self,
        before: &[f64],
        impulses: &[ContactImpulse],
        motors_minus: Vec<f64>,
    ) -> Result<Option<Box<EventLoads>>, SimError> {
        if !self.sampler.sampling.loads {
            return Ok(None);
        }
        let y = self.y.clone();
        let motors_plus = self.motor_forces(self.time, &y)?;
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
