//! The numbers of a simulation by which a run can be differentiated.

use super::gains::motors;
use super::simulation::Simulation;
use crate::contact::ContactLaw;
use carom_impact::Coefficients;
use std::fmt;
use std::sync::Arc;

/// A number of a simulation by which a run is differentiated: a coefficient, a gain, a torque, or any other change of a
/// simulation that leaves its chain and its possible contacts as they are.
#[derive(Clone)]
pub struct Parameter {
    name: String,
    scale: f64,
    change: Arc<Change>,
}

type Change = dyn Fn(&mut Simulation, f64) + Send + Sync;

impl Parameter {
    /// The parameter whose increase by δ is `change(simulation, δ)`. `scale`: its size, from which the differences are made.
    ///
    /// ```
    /// # use carom_sim::Parameter;
    /// let gravity = Parameter::new("gravity", 10.0, |simulation, delta| simulation.gravity.z -= delta);
    /// assert_eq!(gravity.name(), "gravity");
    /// ```
    pub fn new(
        name: impl Into<String>,
        scale: f64,
        change: impl Fn(&mut Simulation, f64) + Send + Sync + 'static,
    ) -> Self {
        Self { name: name.into(), scale, change: Arc::new(change) }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its size.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    /// The simulation with the parameter increased by `delta`.
    pub fn apply(&self, simulation: &Simulation, delta: f64) -> Simulation {
        let mut changed = simulation.clone();
        (self.change)(&mut changed, delta);
        changed
    }

    /// The coefficient of restitution of all contacts together that are under a law of `carom-impact` and have one between 0
    /// and 1, both excluded.
    pub fn restitution() -> Self {
        Self::new("restitution", 1.0, |simulation, delta| {
            coefficients(simulation, |own| {
                if own.restitution > 0.0 && own.restitution < 1.0 {
                    own.restitution += delta;
                }
            });
        })
    }

    /// The coefficient of friction of all contacts together that are under a law of `carom-impact` and have friction.
    pub fn friction() -> Self {
        Self::new("friction", 1.0, |simulation, delta| {
            coefficients(simulation, |own| {
                if own.friction > 0.0 {
                    own.friction += delta;
                }
            });
        })
    }

    /// The parameters of a simulation: `restitution` and `friction` where there are contacts with them, and of the drive `kp`,
    /// `kd`, `target` (PD control) or `torque` (constant) of each joint with one coordinate, as `kp elbow`.
    pub fn all(simulation: &Simulation) -> Vec<Self> {
        let own = simulation.touches.iter().filter(|touch| touch.link().is_some()).map(|touch| &touch.contact.law);
        let own: Vec<&ContactLaw> = own.filter(|law| !law.is_users()).collect();
        let mut all = Vec::new();
        if own.iter().any(|law| law.restitution() > 0.0 && law.restitution() < 1.0) {
            all.push(Self::restitution());
        }
        if own.iter().any(|law| law.friction() > 0.0) {
            all.push(Self::friction());
        }
        for motor in motors(&simulation.chain) {
            let joint =
                simulation.chain.joint_of_velocity(motor.v).map_or_else(String::new, |joint| joint.name.clone());
            let nv = simulation.chain.nv();
            for (name, size) in simulation.drive.clone().parameters(&motor, nv) {
                let change = move |simulation: &mut Simulation, delta: f64| {
                    let own = simulation.drive.parameters(&motor, nv).into_iter();
                    own.filter(|(other, _)| *other == name).for_each(|(_, number)| *number += delta);
                };
                all.push(Self::new(format!("{name} {joint}"), size.abs().max(1.0), change));
            }
        }
        all
    }
}

/// Changes the coefficients of all contacts of links under laws of `carom-impact`.
fn coefficients(simulation: &mut Simulation, change: impl Fn(&mut Coefficients)) {
    for touch in simulation.touches.iter_mut().filter(|touch| touch.link().is_some()) {
        let mut own = touch.contact.law.coefficients;
        change(&mut own);
        let known = !touch.contact.law.is_users();
        let changed = ContactLaw::named(touch.contact.law.name(), own).filter(|_| known);
        if let Some(changed) = changed {
            touch.contact.law = changed;
        }
    }
}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Parameter").field("name", &self.name).field("scale", &self.scale).finish_non_exhaustive()
    }
}
