//! The rate of the state of a motion, and the witness functions whose zeros end its contact mode.

use super::flow::Flow;
use super::leap::LEAST;
use super::witness::Witness;
use crate::contact::Placed;
use crate::error::SimError;
use crate::model::Simulation;
use crate::motion::{ConstraintForces, ContactState, Dry, DryJoint, Gaps, Hold, Lasting, Motion};
use crate::state::{Space, View};
use carom_contact::Met;
use std::ops::Range;

/// The kinds of witness functions; those of lasting contacts have their index into the list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Watch {
    /// The gap of a touch closes.
    Gap(usize),
    /// The gap of a pair of bodies closes, of which no part touches (index of the group).
    Pair(usize),
    /// The gap of one of the other parts of a pair of bodies closes (index of the group).
    Rest(usize),
    /// The contact point reaches the border of a face or the end of an edge.
    Leaves(usize),
    /// The normal force becomes negative.
    NormalForce(usize),
    /// The slip velocity becomes zero.
    SlipStops(usize),
    /// A slip that turns ends soon: see `motion/ending.rs`.
    SlipEnds,
    /// Slip from rest is so fast that its direction follows from it.
    SlipGrows(usize),
    /// The contact force leaves the friction cone.
    Cone(usize),
    /// A compliant contact opens.
    Depth(usize),
    /// A compliant contact changes from loading to unloading.
    Turns(usize),
    /// A compliant contact that was unloaded, and loaded again, becomes deeper than before.
    Deepens(usize),
    /// A joint with dry friction comes to rest (index into `dry`).
    JointStops(usize),
    /// The load of a joint exceeds its dry friction (index into `dry`).
    JointBreaksLoose(usize),
    /// No admissible forces of redundant constraints are left. It replaces `NormalForce`, `Cone` and `JointBreaksLoose` where the forces
    /// by the convention are not admissible, but others are.
    Admissible,
    /// The loops come near a pose at which the mechanism could branch.
    Branches,
}

/// A force counts as inside its friction cone if its distance from the border is above this share of the normal force.
const INSIDE: f64 = 1e-9;
/// Parts whose gap is at most this many times the least overlap may have caused it.
const FEW: f64 = 100.0;
/// Share of the slowest slip by which velocities are moved for difference quotients.
const FINE: f64 = 1e-3;

/// A motion with the witness functions of its present contact mode.
pub(crate) struct Watched<'m, 'a, A: Space> {
    motion: &'m mut Motion<'a, A>,
    pub watches: Vec<Watch>,
    /// The latest time before the next jump of forces or surfaces: what the leg sees at its end is the limit from before.
    latest: f64,
    known: Option<Known>,
    /// The groups of bodies that touch at some of their parts.
    touching: Vec<usize>,
}

/// The forces at the latest state at which they were computed. Integrator and witness functions ask for those of the same state.
struct Known {
    time: f64,
    y: Vec<f64>,
    held: ConstraintForces,
    /// Whether they contain those on joints that are locked.
    on_joints: bool,
}

impl<'m, 'a, A: Space> Watched<'m, 'a, A> {
    /// For the present mode from this time to the next `kink`.
    pub fn new(motion: &'m mut Motion<'a, A>, (time, kink): (f64, f64), y: &[f64]) -> Result<Self, SimError> {
        let sim = motion.sim;
        let watched = motion.gaps.to_watch(&motion.lasting);
        let mut watches: Vec<Watch> = watched.single.into_iter().map(Watch::Gap).collect();
        watches.extend(watched.groups.into_iter().map(Watch::Pair));
        watches.extend(watched.rests.into_iter().map(Watch::Rest));
        let first = watches.len();
        for (i, own) in motion.lasting.iter().enumerate() {
            let rule = &sim.touches[own.touch].contact;
            if sim.touches[own.touch].ends() {
                watches.push(Watch::Leaves(i));
            }
            match own.hold {
                Hold::Latched => {}
                Hold::Slides { .. } => {
                    watches.push(Watch::NormalForce(i));
                    if rule.law.friction() > 0.0 && sim.touches[own.touch].link().is_some() {
                        watches.push(Watch::SlipStops(i));
                    }
                }
                Hold::Starts { .. } => {
                    watches.extend([Watch::NormalForce(i), Watch::SlipStops(i), Watch::SlipGrows(i)]);
                }
                Hold::Sticks => watches.extend([Watch::NormalForce(i), Watch::Cone(i)]),
                Hold::Presses { deepest, .. } => {
                    watches.push(Watch::Depth(i));
                    if rule.compliance.is_some_and(|it| it.turns()) {
                        watches.push(if deepest.is_finite() { Watch::Deepens(i) } else { Watch::Turns(i) });
                    }
                }
            }
        }
        watches.extend(motion.dry.iter().enumerate().map(|(k, joint)| match joint.state {
            Dry::Holds => Watch::JointBreaksLoose(k),
            Dry::Brakes(_) => Watch::JointStops(k),
        }));
        if motion.may_turn() {
            watches.push(Watch::SlipEnds);
        }
        (motion.redundant, motion.margin_forces) = (false, None);
        let mut known = None;
        if motion.lasting.iter().any(Lasting::is_rigid) {
            let held = motion.in_mode(time, y)?;
            let loads =
                |watch: &Watch| matches!(watch, Watch::NormalForce(_) | Watch::Cone(_) | Watch::JointBreaksLoose(_));
            // On the border the convention decides nothing: the mode has been chosen there, perhaps with other forces.
            let alone = motion.assembled.constraints.rows.len() == 1;
            let admissible = watches[first..].iter().filter(|watch| loads(watch)).all(|watch| match watch {
                Watch::NormalForce(i) if alone => held.contacts[*i].normal_force >= 0.0,
                Watch::NormalForce(i) => held.contacts[*i].normal_force > 0.0,
                Watch::Cone(i) => {
                    let mu = sim.touches[motion.lasting[*i].touch].contact.law.friction();
                    held.contacts[*i].cone(mu) >= INSIDE * held.contacts[*i].normal_force
                }
                Watch::JointBreaksLoose(k) => held.joints[*k].abs() <= (1.0 - INSIDE) * motion.dry[*k].friction,
                _ => true,
            });
            if !admissible {
                watches.retain(|watch| !loads(watch));
                watches.push(Watch::Admissible);
            }
            known = Some(Known { time, y: y.to_vec(), held, on_joints: true });
        }
        if !motion.couplings.is_empty() {
            watches.push(Watch::Branches);
        }
        let touching = motion.gaps.touching(&motion.lasting);
        Ok(Self { motion, watches, latest: kink.next_down(), known, touching })
    }

    /// Computes the accelerations at a state, unless they are known; `on_joints`: with the forces on joints that are locked.
    fn know(&mut self, (time, y): (f64, &[f64]), on_joints: bool) -> Result<(), SimError> {
        let same = |known: &Known| known.time == time && known.y == y && (known.on_joints || !on_joints);
        if self.known.as_ref().is_some_and(same) {
            return Ok(());
        }
        let mut memory = self.known.take().map_or_else(Vec::new, |known| known.y);
        let held = if on_joints { self.motion.in_mode(time, y)? } else { self.motion.accelerations(time, y)? };
        memory.clear();
        memory.extend_from_slice(y);
        let on_joints = on_joints || self.motion.assembled.locked.is_empty();
        self.known = Some(Known { time, y: memory, held, on_joints });
        Ok(())
    }

    /// Passes the values of these witness functions to `see`.
    fn look(&mut self, which: Range<usize>, time: f64, y: &[f64], see: impl FnMut(Witness)) -> Result<(), SimError> {
        let time = time.min(self.latest);
        let needs_forces = self.watches[which.clone()].iter().any(|watch| watch.needs_forces());
        if needs_forces {
            self.know((time, y), true)?;
        }
        let held = self.known.as_ref().filter(|_| needs_forces).map(|known| &known.held);
        look(self.motion, &self.watches[which], (time, y), held, see)
    }
}

impl Watch {
    /// Whether it depends on constraint forces, not only on positions and velocities.
    pub fn needs_forces(self) -> bool {
        let joint = matches!(self, Self::JointBreaksLoose(_) | Self::JointStops(_));
        joint || matches!(self, Self::NormalForce(_) | Self::Cone(_) | Self::SlipEnds)
    }
}

impl<A: Space> Flow for Watched<'_, '_, A> {
    fn rate(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let time = time.min(self.latest);
        let free = self.motion.moves_freely();
        if !free {
            self.know((time, y), false)?;
        }
        let held = self.known.as_ref().filter(|_| !free).map(|known| &known.held);
        self.motion.rate(time, y, held, out)
    }

    fn steps(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (nq, nv) = (self.motion.sim.chain.nq(), self.motion.sim.chain.nv());
        let usual = f64::EPSILON.sqrt();
        for (step, x) in out.iter_mut().zip(y) {
            *step = usual * x.abs().max(1.0);
        }
        // The energies have no effect on the motion.
        out[nq + nv..nq + nv + 2].fill(0.0);
        // The rate depends on the direction of slip: below the size of the slip it is linear.
        let slip = self.motion.slowest_slip(time.min(self.latest), y)?.max(self.motion.noise());
        out[nq..nq + nv].iter_mut().for_each(|step| *step = step.min(FINE * slip));
        Ok(())
    }

    fn witnesses(&mut self, time: f64, y: &[f64], out: &mut Vec<Witness>) -> Result<(), SimError> {
        out.clear();
        self.look(0..self.watches.len(), time, y, |witness| out.push(witness))?;
        passing(self.motion, &self.watches, (time.min(self.latest), y), out)
    }

    fn witness(&mut self, k: usize, time: f64, y: &[f64]) -> Result<Witness, SimError> {
        let mut found = Witness::default();
        self.look(k..k + 1, time, y, |witness| found = witness)?;
        Ok(found)
    }

    fn touches(&self) -> bool {
        !self.touching.is_empty()
    }

    fn separated(&mut self, time: f64, y: &[f64]) -> Result<[f64; 2], SimError> {
        let (motion, time) = (&mut *self.motion, time.min(self.latest));
        let slack = motion.overlaps();
        let (q, qd) = motion.split(y);
        let view = View::new(motion.model, &mut motion.workspace, q)?;
        let (mut least, mut turning) = (f64::INFINITY, 0.0_f64);
        for &group in &self.touching {
            let [gap, turns] = motion.gaps.separated(group, &motion.lasting, &view, (qd, time), -slack)?;
            (least, turning) = (least.min(slack + gap), turning.max(turns));
        }
        Ok([least, turning])
    }

    fn closed_last(&mut self, time: f64, y: &[f64]) -> Result<Option<usize>, SimError> {
        let slack = self.motion.overlaps();
        let mut found = Vec::new();
        self.look(0..self.watches.len(), time, y, |witness| found.push(witness))?;
        let of_parts = |watch: &Watch| match watch {
            Watch::Gap(touch) => self.motion.sim.touches[*touch].is_part(),
            _ => false,
        };
        let closed =
            |witness: &Witness| witness.value.abs() <= FEW * slack && witness.rate.is_some_and(|rate| rate < 0.0);
        let parts =
            self.watches.iter().zip(&found).enumerate().filter(|(_, (watch, gap))| of_parts(watch) && closed(gap));
        Ok(parts.min_by(|a, b| a.1.1.value.abs().total_cmp(&b.1.1.value.abs())).map(|(k, _)| k))
    }

    fn contacts(&mut self, time: f64, y: &[f64]) -> Result<Vec<ContactState>, SimError> {
        self.known = None; // the scratch memory of the motion is that of other states afterwards
        self.motion.contact_states(time.min(self.latest), y)
    }

    fn close(&mut self, y: &mut [f64]) -> Result<(), SimError> {
        if !self.motion.couplings.is_empty() {
            self.motion.sim.normalise(y);
            self.motion.close_loops(y)?;
        }
        Ok(())
    }

    fn settle(&mut self, time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let time = time.min(self.latest);
        self.known = None; // directions of slip may change
        let motion = &mut *self.motion;
        let changed = motion.sim.normalise(y);
        let moved = motion.settle(time, y)?;
        motion.follow_slip(time, y)?;
        Ok(moved || changed)
    }
}

/// Passes the values of witness functions at a state to `see`. `held`: its accelerations, if one of them needs forces.
pub(crate) fn look<A: Space>(
    motion: &mut Motion<A>,
    watches: &[Watch],
    (time, y): (f64, &[f64]),
    held: Option<&ConstraintForces>,
    mut see: impl FnMut(Witness),
) -> Result<(), SimError> {
    let slip_left = match held {
        Some(held) if watches.contains(&Watch::SlipEnds) => motion.least_slip_left(&held.qdd, (time, y))?,
        _ => 0.0,
    };
    let admissible = if watches.contains(&Watch::Admissible) { motion.margin(time, y)? } else { 0.0 };
    let (noise, starts) = (motion.noise(), motion.starts());
    let (q, qd) = motion.split(y);
    let regular = if watches.contains(&Watch::Branches) { motion.regularity(q)? - LEAST } else { 0.0 };
    let now = Now { regular, lasting: &motion.lasting, dry: &motion.dry, held, admissible, slip_left, noise, starts };
    let view = View::new(motion.model, &mut motion.workspace, q)?;
    let mut last = None;
    for watch in watches {
        see(watch.at((motion.sim, &motion.gaps), &now, &view, (q, qd), time, &mut last)?);
    }
    Ok(())
}

/// How the bodies of each watched gap move past each other at a state; `None` for other witnesses and for contacts of parts.
fn passing<A: Space>(
    motion: &mut Motion<A>,
    watches: &[Watch],
    (time, y): (f64, &[f64]),
    out: &mut [Witness],
) -> Result<(), SimError> {
    let of_bodies = |watch: &Watch| match *watch {
        Watch::Gap(touch) => motion.sim.touches[touch].is_whole().then_some(touch),
        Watch::Pair(group) | Watch::Rest(group) => Some(motion.gaps.first(group)),
        _ => None,
    };
    if watches.iter().all(|watch| of_bodies(watch).is_none()) {
        return Ok(());
    }
    let (q, qd) = motion.split(y);
    let view = View::new(motion.model, &mut motion.workspace, q)?;
    for (touch, witness) in watches.iter().map(of_bodies).zip(out) {
        if let Some(touch) = touch {
            witness.passing = motion.gaps.passing(touch, &view, qd, time)?;
        }
    }
    Ok(())
}

/// The inputs of the witness functions beside the state: see [`Motion`].
struct Now<'a> {
    /// Computed if it is watched.
    regular: f64,
    lasting: &'a [Lasting],
    dry: &'a [DryJoint],
    /// Computed if a witness needs constraint forces.
    held: Option<&'a ConstraintForces>,
    /// Computed if it is watched.
    admissible: f64,
    /// Computed if it is watched.
    slip_left: f64,
    /// Error of velocities.
    noise: f64,
    /// Slip up to which it begins.
    starts: f64,
}

impl Watch {
    /// The value of the witness at a state.
    fn at<A: Space>(
        self,
        (sim, gaps): (&Simulation, &Gaps<A>),
        now: &Now,
        view: &View<A>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
        last: &mut Option<(usize, Placed)>,
    ) -> Result<Witness, SimError> {
        let look = |touch: usize| gaps.look(touch, view, (q, qd), time);
        Ok(match (self, now.held) {
            (Self::Rest(group), _) => {
                let (gap, rate) = gaps.rest(group, now.lasting, view, qd, time)?;
                Witness::gap(gap, rate)
            }
            (Self::Gap(touch), _) => {
                let (gap, rate) = gaps.own(touch, view, (q, qd), time, last)?;
                Witness::gap(gap, rate)
            }
            (Self::Pair(group), _) => {
                let (gap, rate) = gaps.of_group(group, view, (q, qd), time)?;
                Witness::gap(gap, rate)
            }
            (Self::Leaves(i), _) => {
                let at = sim.touches[now.lasting[i].touch].at(view, q, time);
                Witness::velocity(at.margin, Met::OUTSIDE)
            }
            (Self::Depth(i), _) => {
                let (gap, rate) = look(now.lasting[i].touch)?;
                Witness::gap(-gap, -rate)
            }
            (Self::Turns(i), _) => {
                // Where several contacts turn at one time, the others have a rate of rounding at the start of the next leg: they fire by
                // the band.
                let (_, rate) = look(now.lasting[i].touch)?;
                Witness::velocity(-rate, now.noise)
            }
            (Self::Deepens(i), _) => {
                let (gap, rate) = look(now.lasting[i].touch)?;
                let Hold::Presses { deepest, .. } = now.lasting[i].hold else { return Ok(Witness::default()) };
                Witness::gap(deepest + gap, rate)
            }
            (Self::SlipStops(i), _) => {
                let touch = &sim.touches[now.lasting[i].touch];
                let (Hold::Slides { toward } | Hold::Starts { toward }) = now.lasting[i].hold else {
                    return Ok(Witness::default());
                };
                let place = touch.at(view, q, time).surface;
                let u = place.map_or(Ok(nalgebra::Vector3::zeros()), |place| touch.u(&place, view, qd, time))?;
                Witness::velocity(u.dot(&toward), now.noise)
            }
            (Self::SlipGrows(i), _) => {
                let touch = &sim.touches[now.lasting[i].touch];
                let slip = touch.slip(&touch.at(view, q, time), view, qd, time)?;
                Witness::bound(now.starts - slip.unwrap_or_default())
            }
            (Self::JointStops(k), Some(held)) => {
                let DryJoint { v, state, .. } = now.dry[k];
                let Dry::Brakes(direction) = state else { return Ok(Witness::default()) };
                // With its rate the time is exact: near a dead point of a loop a velocity that is almost zero is not one that can be stopped.
                let rate = Some(held.qdd[v] * direction);
                Witness { rate, ..Witness::velocity(qd[v] * direction, now.noise) }
            }
            (Self::SlipEnds, _) => Witness::bound(now.slip_left),
            (Self::Branches, _) => Witness::bound(now.regular),
            (Self::Admissible, _) => Witness::margin(now.admissible),
            (Self::NormalForce(i), Some(held)) => Witness::margin(held.contacts[i].normal_force),
            (Self::Cone(i), Some(held)) => {
                let mu = sim.touches[now.lasting[i].touch].contact.law.friction();
                Witness::margin(held.contacts[i].cone(mu))
            }
            (Self::JointBreaksLoose(k), Some(held)) => Witness::margin(now.dry[k].friction - held.joints[k].abs()),
            (_, None) => unreachable!("constraint forces are computed for these witnesses"),
        })
    }
}
