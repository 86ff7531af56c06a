//! The numbers of a simulation by which a run can be differentiated.

use super::control_law::Number;
use super::drive::Drive;
use super::gains::{Motor, motors};
use super::simulation::Simulation;
use crate::contact::{ContactLaw, Touch};
use crate::error::SimError;
use carom_impact::Coefficients;
use std::fmt;
use std::sync::Arc;

/// A number of a simulation by which a run is differentiated: a coefficient, a gain, a torque, or any other change of a
/// simulation that leaves its joints and its possible contacts as they are.
#[derive(Clone)]
pub struct Parameter {
    name: String,
    scale: f64,
    place: Place,
    change: Arc<Change>,
}

/// Where a parameter acts, of those whose derivatives have closed forms.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Place {
    /// A coefficient of the contacts under a law of `carom-impact`.
    Restitution,
    Friction,
    /// A number of the drive of a joint.
    Motor {
        number: Number,
        joint: Motor,
    },
    /// A point of a reference trajectory: it acts on the forces of the motors, which have no closed form by it.
    Reference,
    Anywhere,
}

type Change = dyn Fn(&mut Simulation, f64) -> Result<(), SimError> + Send + Sync;

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
        Self::try_new(name, scale, move |simulation, delta| {
            change(simulation, delta);
            Ok(())
        })
    }

    /// [`Parameter::new`] of a change that can fail.
    pub fn try_new(
        name: impl Into<String>,
        scale: f64,
        change: impl Fn(&mut Simulation, f64) -> Result<(), SimError> + Send + Sync + 'static,
    ) -> Self {
        Self { name: name.into(), scale, place: Place::Anywhere, change: Arc::new(change) }
    }

    /// The same parameter under another name.
    pub(crate) fn named(self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its size.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    /// Where it acts.
    pub(crate) fn place(&self) -> Place {
        self.place
    }

    /// Whether it is a coefficient of a touch.
    pub(crate) fn is_of(&self, touch: &Touch) -> bool {
        let own = match self.place {
            Place::Restitution => RESTITUTION,
            Place::Friction => FRICTION,
            Place::Motor { .. } | Place::Reference | Place::Anywhere => return false,
        };
        let law = &touch.contact.law;
        touch.link().is_some() && !law.is_users() && own(law, &mut law.coefficients.clone()).is_some()
    }

    /// The simulation with the parameter increased by `delta`.
    ///
    /// # Errors
    /// Those of the change.
    pub fn apply(&self, simulation: &Simulation, delta: f64) -> Result<Simulation, SimError> {
        let mut changed = simulation.clone();
        (self.change)(&mut changed, delta)?;
        Ok(changed)
    }

    /// The coefficient of restitution of all contacts together that are under a law of `carom-impact` and have one between 0
    /// and 1, both excluded, for all approach speeds.
    pub fn restitution() -> Self {
        Self::coefficient("restitution", (Place::Restitution, RESTITUTION))
    }

    /// The coefficient of friction of all contacts together that are under a law of `carom-impact` and have friction.
    pub fn friction() -> Self {
        Self::coefficient("friction", (Place::Friction, FRICTION))
    }

    fn coefficient(name: &str, (place, own): (Place, Coefficient)) -> Self {
        let change = move |simulation: &mut Simulation, delta| {
            for touch in simulation.touches.iter_mut().filter(|touch| touch.link().is_some()) {
                let law = &mut touch.contact.law;
                let mut changed = law.coefficients;
                if let Some(number) = own(law, &mut changed) {
                    *number += delta;
                    *law = law.with(changed).unwrap_or_else(|| law.clone());
                }
            }
        };
        Self { place, ..Self::new(name, 1.0, change) }
    }

    /// The parameters of a simulation: `restitution` and `friction` where there are contacts with them, and of the drive `kp`, `kd`,
    /// `target` (PD control) or `torque` (constant) of each joint with one coordinate, as `kp elbow`. Of a table of torques and of a
    /// reference trajectory each row is a parameter, as `torque elbow 3` and `reference elbow 3` for its third row.
    pub fn all(simulation: &Simulation) -> Vec<Self> {
        let own = simulation.touches.iter().filter(|touch| touch.link().is_some()).map(|touch| &touch.contact.law);
        let own: Vec<&ContactLaw> = own.filter(|law| !law.is_users()).collect();
        let has = |number: Coefficient| own.iter().any(|law| number(law, &mut law.coefficients.clone()).is_some());
        let mut all = Vec::new();
        all.extend(has(RESTITUTION).then(Self::restitution));
        all.extend(has(FRICTION).then(Self::friction));
        let (mut drive, nv) = (simulation.drive.clone(), simulation.chain.nv());
        let joints = motors(&simulation.chain);
        for motor in &joints {
            let joint =
                simulation.chain.joint_of_velocity(motor.v).map_or_else(String::new, |joint| joint.name.clone());
            all.extend(
                drive
                    .parameters(motor, nv)
                    .into_iter()
                    .map(|(number, size)| Self::of_motor(&joint, number, *size, (*motor, nv))),
            );
            if let Some((tracking, k)) = drive.tracking(motor, &joints) {
                let reference = &tracking.reference;
                let sizes = (0..reference.rows()).map(|row| (row, reference.position(k, row)));
                all.extend(sizes.map(|(row, size)| Self::of_reference(&joint, row, size, *motor)));
            }
        }
        all
    }

    fn of_motor(joint: &str, number: Number, size: f64, (motor, nv): (Motor, usize)) -> Self {
        let change = move |simulation: &mut Simulation, delta: f64| {
            let own = simulation.drive.parameters(&motor, nv).into_iter();
            own.filter(|(other, _)| *other == number).for_each(|(_, number)| *number += delta);
        };
        let Number { name, row } = number;
        let name = row.map_or_else(|| format!("{name} {joint}"), |row| format!("{name} {joint} {}", row + 1));
        let place = Place::Motor { number, joint: motor };
        Self { place, ..Self::new(name, size.abs().max(1.0), change) }
    }

    /// A force that is added to the table of torques at a joint, at all times.
    pub(crate) fn of_table(joint: Motor) -> Self {
        let change = move |simulation: &mut Simulation, delta: f64| {
            if let Drive::Table(own) = &mut simulation.drive {
                own.forces.iter_mut().for_each(|row| row[joint.v] += delta);
            }
        };
        let number = Number { name: "torque", row: None };
        Self { place: Place::Motor { number, joint }, ..Self::new("torque", 1.0, change) }
    }

    fn of_reference(joint: &str, row: usize, size: f64, motor: Motor) -> Self {
        let change = move |simulation: &mut Simulation, delta: f64| {
            if let Some((tracking, k)) = simulation.drive.tracking(&motor, &motors(&simulation.chain)) {
                tracking.reference.shift(k, row, delta);
            }
        };
        let place = Place::Reference;
        Self { place, ..Self::new(format!("reference {joint} {}", row + 1), size.abs().max(1.0), change) }
    }
}

/// A coefficient by which a run can be differentiated, where a contact has it.
type Coefficient = for<'a> fn(&ContactLaw, &'a mut Coefficients) -> Option<&'a mut f64>;
const RESTITUTION: Coefficient =
    |law, own| Some(&mut own.restitution).filter(|e| law.by_speed.is_none() && **e > 0.0 && **e < 1.0);
const FRICTION: Coefficient = |_, own| Some(&mut own.friction).filter(|mu| **mu > 0.0);

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Parameter").field("name", &self.name).field("scale", &self.scale).finish_non_exhaustive()
    }
}
