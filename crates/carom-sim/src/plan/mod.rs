//! The plan of a scene: the reduced simulation, and the list of what is modelled and what is left out.
//!
//! Exact reductions change the results by rounding only:
//!
//! - **Plane**: a chain whose joints all move in parallel planes is computed in the plane
//!   ([`Chain::to_planar`](carom_chain::Chain::to_planar)); corners that differ only in the direction perpendicular to the
//!   plane are merged.
//! - **Joints** are never left out: the motion of a branch that no contact can reach is a result, too.
//! - **Pairs** of a link and a surface that are out of reach at every configuration are removed
//!   ([`carom_contact::out_of_reach`]).
//! - **Friction** that is zero: a contact has one row instead of three, and no friction cone.
//!
//! Effects that are not exactly zero are left out only within the user's tolerance ([`Simulation::neglect`]) and with a
//! bound. The bound holds for each impact, not for a whole run.

mod numbers;

use crate::contact::Touch;
use crate::error::SimError;
use crate::model::{Drive, Integrator, Simulation};
use crate::scene::Scene;
use crate::state::{EQUAL, EXACT, beyond};
use carom_chain::PlanarChain;
use carom_chain::urdf::JointType;
use carom_impact::LawInfo;
use nalgebra::Vector3;
use numbers::{bound_at_start, depth_at_start, fastest_rate, merged, without_motor};
use serde::Serialize;

/// The reduced simulation of a scene, and the list of its reductions, which serde writes.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// The reduced simulation.
    #[serde(skip)]
    pub simulation: Simulation,
    /// Configuration at the start, of all joints.
    #[serde(skip)]
    pub q: Vec<f64>,
    /// Joint velocities at the start, of all joints.
    #[serde(skip)]
    pub qd: Vec<f64>,
    /// The chain of the simulation in the plane, if it moves parallel to one. The run is in it unless
    /// [`Simulation::planar`] is `false`.
    #[serde(skip)]
    pub flat: Option<PlanarChain>,
    /// What is modelled, and how.
    pub kept: Vec<Decision>,
    /// What is left out exactly.
    pub left_out: Vec<Decision>,
    /// What is left out with a bound on the error.
    pub bounded: Vec<Bounded>,
}

/// One decision of a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// The subject: `space`, `joints`, `contacts`, `law`, `friction`, `gravity`, `integrator` …
    pub what: &'static str,
    /// What was decided.
    pub choice: String,
    /// The reason.
    pub why: String,
}

/// An effect that is left out with a bound on the error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bounded {
    /// `friction`, `tilt` or `compliance`.
    pub what: &'static str,
    /// What is done instead.
    pub choice: String,
    /// The bound, in the unit that `of` names.
    pub bound: f64,
    /// The quantity that is bounded, with its unit.
    pub of: String,
}

/// If the stability of the explicit integrator needs more steps than this, the implicit one is used.
const STIFF: f64 = 1e5;
/// Dormand–Prince 8(5,3) is stable up to about this product of step and rate.
const STABLE: f64 = 6.0;

impl Scene {
    /// Analyses the scene: returns the reduced simulation with the reasons for each reduction.
    ///
    /// # Errors
    /// [`SimError`]: an invalid mesh, or a singular mass matrix at the start.
    pub fn plan(&self) -> Result<Plan, SimError> {
        if let Some(accuracy) = self.accuracy {
            let why = "simulate and plan choose a tolerance that meets it, other commands and functions do not: give tolerance".into();
            return Err(SimError::Accuracy { accuracy, why });
        }
        self.simulation.check(&self.q, &self.qd, self.duration, self.sample)?;
        let mut plan = Plan {
            simulation: self.simulation.clone(),
            q: self.q.clone(),
            qd: self.qd.clone(),
            flat: None,
            kept: Vec::new(),
            left_out: Vec::new(),
            bounded: Vec::new(),
        };
        if self.full {
            plan.keep("model", "everything, in space", "model = \"full\"");
        }
        plan.flat = plan.simulation.flat();
        plan.space(self.full);
        plan.loops();
        plan.contacts(self);
        plan.compliance();
        plan.by_speed();
        plan.friction()?;
        plan.gravity();
        plan.drive();
        plan.integrator(self.duration)?;
        Ok(plan)
    }
}

impl Plan {
    /// Tells why it has its tolerance.
    pub(crate) fn because(mut self, accuracy: f64, error: f64) -> Self {
        let why = format!("[run] accuracy = {accuracy:e}: the estimated error is {error:.1e}");
        self.keep("accuracy", format!("tolerance {:.2e}", self.simulation.tolerance), why);
        self
    }

    fn keep(&mut self, what: &'static str, choice: impl Into<String>, why: impl Into<String>) {
        self.kept.push(Decision { what, choice: choice.into(), why: why.into() });
    }

    fn leave_out(&mut self, what: &'static str, choice: impl Into<String>, why: impl Into<String>) {
        self.left_out.push(Decision { what, choice: choice.into(), why: why.into() });
    }

    fn bound(&mut self, what: &'static str, choice: String, (bound, of): (f64, &str)) {
        self.bounded.push(Bounded { what, choice, bound, of: of.to_owned() });
    }

    /// The planar chain, if the simulation runs in the plane.
    pub(crate) fn in_plane(&self) -> Option<&PlanarChain> {
        self.flat.as_ref().filter(|_| self.simulation.planar)
    }

    /// Plane or space.
    fn space(&mut self, full: bool) {
        let chain = &self.simulation.chain;
        let joints = chain.nv();
        let welded = chain.joints().iter().filter(|joint| joint.kind == JointType::Fixed).count();
        match self.in_plane() {
            Some(flat) => {
                let [x, y, z] = flat.plane.normal.into();
                let choice = format!("the plane with the normal ({}, {}, {})", tidy(x), tidy(y), tidy(z));
                let before = self.simulation.touches.len();
                let (tilt, touches) = (flat.tilt, merged(&self.simulation.touches, flat));
                let merged = before - touches.len();
                self.simulation.touches = touches;
                let reach: f64 = beyond(&self.simulation.chain, |_| 0.0).iter().sum();
                self.keep("space", choice, format!("all {joints} moving joints move parallel to it"));
                self.leave_out(
                    "space",
                    "motion perpendicular to the plane",
                    "no joint allows it; joint constraint forces balance the loads in that direction",
                );
                if merged > 0 {
                    let choice = format!("{merged} corners with the same projection as another");
                    self.leave_out("corners", choice, "they differ from it only perpendicular to the plane");
                }
                if tilt > EQUAL {
                    let bound = 2.0 * tilt * reach;
                    let choice = format!("joint axes turned by up to {} rad to be parallel", tidy(tilt));
                    let of = "displacement of any point, m: 2 × tilt × sum of the reaches of the joints";
                    self.bound("tilt", choice, (bound, of));
                }
            }
            None if full => {}
            None => {
                let why = chain.to_planar().err().map_or_else(String::new, |why| why.to_string());
                self.keep("space", format!("space, {joints} velocities"), why);
            }
        }
        if welded > 0 {
            self.leave_out("joints", format!("{welded} fixed joints"), "the links that they connect are one body");
        }
    }

    /// The loops of the mechanism.
    fn loops(&mut self) {
        let joints = self.simulation.loops.iter().map(|own| format!("{} ({})", own.name, own.joint.name()));
        let joints: Vec<String> = joints.collect();
        if !joints.is_empty() {
            let why = "bilateral constraints of motion and impacts, part of the inverse inertia";
            self.keep("loops", joints.join("; "), why);
        }
    }

    /// Which contacts are possible, and how several at once are computed.
    fn contacts(&mut self, scene: &Scene) {
        let touches = &self.simulation.touches;
        let (limits, pairs): (Vec<&Touch>, Vec<&Touch>) = touches.iter().partition(|touch| touch.limit_of().is_some());
        let closed = pairs.iter().filter(|touch| !touch.is_whole()).count();
        let search = pairs.len() - closed;
        // The contacts of parts stand behind their pair.
        let pairs: Vec<&Touch> = pairs.into_iter().filter(|touch| !touch.is_part()).collect();
        let count = pairs.len();
        let faces = pairs.iter().any(|touch| !touch.is_covered());
        let several = touches.len() > 1 || faces;
        let step = self.simulation.contact_step;
        let choice = if count == 0 { "none".to_owned() } else { listed(&pairs) };
        let none = touches.is_empty();
        let condition = |touch: &&Touch| {
            let formula = touch.closes_while.as_ref()?.formula();
            Some((touch.name.clone(), format!("closes only while {formula} > 0 (closes_while)")))
        };
        let conditional: Vec<_> = pairs.iter().filter_map(condition).collect();
        let why = format!("{closed} gaps in closed form, {search} by a distance query; {} joint limits", limits.len());
        self.keep("contacts", choice, why);
        for (touch, why) in conditional {
            self.keep("contacts", touch, why);
        }
        if self.simulation.stepping {
            let law = self.simulation.several.name();
            let choice = format!("time steps of {step} s throughout; law {law}");
            self.keep("several", choice, "method = \"steps\"");
        } else if several {
            let law = self.simulation.several.name();
            // The words of `StepReason::Face`.
            let also = if faces { "where a face lies on a mesh, or a rim on a round body, and " } else { "" };
            let choice = format!(
                "event-driven; law {law}; time steps of at most {step} s only {also}where events cannot follow the motion"
            );
            self.keep("several", choice, "several contacts are possible at the same time");
        } else if !none {
            self.keep("several", "event-driven, one contact at a time", "only one contact point is possible");
        }
        for (pair, why) in &scene.out_of_reach {
            self.leave_out("pair", pair.clone(), why.to_string());
        }
        if count == 0 && !scene.surfaces.is_empty() {
            self.keep("surface", "no contact with a surface", "no link with a collision shape can reach one");
        }
    }

    /// The compliant contacts, those with the same compliance together.
    fn compliance(&mut self) {
        let touches = &self.simulation.touches;
        let kinds = kinds(touches, |touch| touch.contact.compliance);
        let others = touches.iter().filter(|touch| !touch.is_part()).count();
        let others = others - kinds.iter().map(|(_, same)| same.len()).sum::<usize>();
        let rest = if others > 0 { "; the other contacts and stops are rigid" } else { "" };
        let lines: Vec<_> = kinds.iter().map(|(own, same)| format!("{}: {own}", listed(same))).collect();
        for choice in lines {
            self.keep(
                "compliance",
                choice,
                format!("forces instead of impulses, implicitly integrated where stiff{rest}"),
            );
        }
    }

    /// Coefficients of restitution that depend on the approach speed.
    fn by_speed(&mut self) {
        let kinds = kinds(&self.simulation.touches, |touch| touch.contact.law.by_speed.clone());
        let lines: Vec<_> = kinds.iter().map(|(by, same)| format!("{}: {by}", listed(same))).collect();
        for choice in lines {
            self.keep("restitution", choice, "each contact by its own approach speed v, also in impacts of several");
        }
    }

    /// Impact law and friction.
    fn friction(&mut self) -> Result<(), SimError> {
        let neglect = self.simulation.neglect;
        let touches = self.simulation.touches.iter();
        let surfaces: Vec<&Touch> = touches.filter(|touch| touch.link().is_some()).collect();
        let Some(first) = surfaces.first() else { return Ok(()) };
        let uniform = surfaces.iter().all(|touch| touch.contact == first.contact);
        let law = &first.contact.law;
        let (e, mu) = (law.restitution(), law.friction());
        let used = LawInfo::named(law.name()).is_some_and(|law| law.has("tangential_restitution"));
        let tangential = match law.coefficients.tangential_restitution {
            value if used && value != 0.0 => format!(", tangential restitution {value}"),
            _ => String::new(),
        };
        let choice = if uniform {
            let e = if law.by_speed.is_some() { "by approach speed".into() } else { e.to_string() };
            format!("{}, restitution {e}{tangential}, friction {mu}", law.name())
        } else {
            "one for each pair".to_owned()
        };
        let users = surfaces.iter().map(|touch| &touch.contact.law).filter(|law| law.is_users());
        let mut users: Vec<&str> = users.map(|law| law.name()).collect();
        users.sort_unstable();
        users.dedup();
        let compliant = surfaces.iter().any(|touch| touch.contact.compliance.is_some());
        let known = surfaces.iter().map(|touch| &touch.contact.law).filter(|law| !law.is_users());
        let largest = known.map(|law| law.friction()).fold(0.0, f64::max);
        let bound = match neglect {
            Some(share) if largest > 0.0 => {
                bound_at_start(&self.simulation, &self.q, &self.qd, [largest, e])?.map(|bound| (bound, share))
            }
            _ => None,
        };
        let users = users.join(", ");
        let why = if uniform { "the same for all contacts" } else { "set by [[contact.pair]] or a surface" };
        self.keep("law", choice, why);
        if !users.is_empty() {
            let choice = format!("{users}: impacts of one contact, without any approximation");
            let why =
                "a user's law; several, lasting and compliant contacts have the restitution and friction given with it";
            self.keep("law", choice, why);
        } else if largest == 0.0 {
            let why = "friction is 0 everywhere: every law then gives the normal impulse −(1+e) uₙ/(nᵀHn)";
            self.leave_out("friction", "tangential impulses and forces", why);
        }
        if let Some((bound, share)) = bound {
            let choice = format!(
                "left out of every impact whose bound is below {share}; the run reports their number and the largest bound"
            );
            let of = "change of the contact point's velocity by friction, relative to its velocity before, at the start pose";
            self.bound("friction", choice, (bound, of));
        }
        if let Some(share) = neglect.filter(|_| compliant) {
            let choice =
                format!("treated as rigid at every impact with a penetration below {share} of the length of the scene");
            let of =
                "largest penetration, m, at the start pose and velocity; the run reports the largest of all impacts";
            let depth = depth_at_start(&self.simulation, &self.q, &self.qd)?;
            self.bound("compliance", choice, (depth, of));
        }
        Ok(())
    }

    fn gravity(&mut self) {
        let gravity = self.simulation.gravity;
        if gravity == Vector3::zeros() {
            self.keep("gravity", "none", "set by the scene: nothing falls");
            return;
        }
        let square = self.in_plane().is_some_and(|flat| flat.plane.project(gravity).norm() == 0.0);
        let [x, y, z] = gravity.into();
        if square {
            self.leave_out(
                "gravity",
                format!("({x}, {y}, {z}) m/s²"),
                "it acts perpendicular to the plane: joint constraint forces balance it",
            );
        } else {
            self.keep("gravity", format!("({x}, {y}, {z}) m/s²"), "acceleration of free fall");
        }
    }

    /// What drives the joints, and what does not.
    fn drive(&mut self) {
        let sim = &self.simulation;
        let off = sim.drives().flat_map(Drive::each_robot).all(|(_, drive)| matches!(drive, Drive::Off));
        let first = sim.drive.description();
        let choice = match &sim.after_impact {
            Some(after) => format!("{first}, {} from the first impact on", after.description()),
            None => first,
        };
        let free = without_motor(&sim.chain);
        let (springs, wrenches) = (sim.springs.len(), sim.wrenches.len());
        let limited = sim.effort_limits;
        if !off && (!free.is_empty() || limited) {
            let limits =
                if limited { "forces stay within the effort limits of the URDF" } else { "without effort limits" };
            let base = if free.is_empty() {
                String::new()
            } else {
                format!("; nothing drives {}: only contacts hold it against gravity", free.join(", "))
            };
            self.keep("drive", choice, format!("{limits}{base}"));
        }
        if springs > 0 {
            self.keep("springs", format!("{springs} passive springs of joints"), "set by the scene");
        }
        if wrenches > 0 {
            self.keep("forces", format!("{wrenches} forces from outside"), "set by the scene");
        }
    }

    /// Estimates the stiffness and chooses the integrator.
    fn integrator(&mut self, duration: f64) -> Result<(), SimError> {
        let rate = fastest_rate(&self.simulation, &self.q)?;
        let steps = rate * duration / STABLE;
        let tolerance = self.simulation.tolerance;
        if steps > STIFF {
            self.simulation.integrator = Integrator::Radau;
            let why = format!(
                "controller and damping are stiff ({rate:.3e} 1/s): an explicit method would need {steps:.0} steps"
            );
            self.keep("integrator", format!("Radau IIA, order 5, tolerance {tolerance}"), why);
        } else {
            let why = if rate > 0.0 {
                format!("not stiff: rates of controller and damping up to {rate:.3e} 1/s")
            } else {
                "not stiff: no controller gains, no damping".to_owned()
            };
            self.keep("integrator", format!("Dormand–Prince, orders 8 and 5, tolerance {tolerance}"), why);
        }
        Ok(())
    }
}

/// The values that touches have, each with its touches; a shape that is divided counts once.
fn kinds<T: PartialEq>(touches: &[Touch], value: impl Fn(&Touch) -> Option<T>) -> Vec<(T, Vec<&Touch>)> {
    let mut kinds: Vec<(T, Vec<&Touch>)> = Vec::new();
    for touch in touches.iter().filter(|touch| !touch.is_part()) {
        let Some(own) = value(touch) else { continue };
        match kinds.iter_mut().find(|(known, _)| *known == own) {
            Some((_, same)) => same.push(touch),
            None => kinds.push((own, vec![touch])),
        }
    }
    kinds
}

/// The names of touches, the first ones of many.
fn listed(touches: &[&Touch]) -> String {
    let names: Vec<&str> = touches.iter().take(8).map(|touch| touch.name.as_str()).collect();
    let more = if touches.len() > 8 { format!(" and {} more", touches.len() - 8) } else { String::new() };
    format!("{}{more}", names.join("; "))
}

/// Formats a number without the rounding errors of a rotation: with nine digits after the point where it has no more.
fn tidy(x: f64) -> String {
    let rounded = format!("{x:.9}").parse().unwrap_or(x);
    let shown = if (rounded - x).abs() < EXACT { rounded + 0.0 } else { x };
    format!("{shown}")
}
