//! The touches of one pair of bodies as a group: while none of them lasts, the gap of the two bodies stands for all of them.

use super::lasting::Lasting;
use crate::contact::{APART, BallOnPlane, Pair, Touch, TouchKind};
use crate::error::SimError;
use crate::model::Simulation;
use crate::state::{Space, View};
use std::sync::Arc;

/// The touches of a pair that is divided into contacts of parts.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    pub pair: Arc<Pair>,
    /// Contacts of parts.
    pub parts: Vec<usize>,
    /// The nearest points of the bodies.
    pub whole: Option<usize>,
}

/// Pairs with a gap above this are open, m: their contacts are not examined one by one.
const NEAR: f64 = 1e-3;
/// Gaps of parts up to this above that of the bodies are the same contact, m.
const SAME: f64 = 1e-9;

impl Group {
    /// The groups of these touches.
    pub fn all(touches: &[Touch]) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for (k, touch) in touches.iter().enumerate() {
            let TouchKind::Pair { pair, part } = &touch.kind else { continue };
            let known = groups.iter().rposition(|group| Arc::ptr_eq(&group.pair, pair));
            let known = known.unwrap_or_else(|| {
                groups.push(Self { pair: pair.clone(), parts: Vec::new(), whole: None });
                groups.len() - 1
            });
            match part {
                Some(_) => groups[known].parts.push(k),
                None => groups[known].whole = Some(k),
            }
        }
        groups.retain(|group| !group.parts.is_empty());
        groups
    }

    /// All touches of the pair.
    pub fn touches(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().copied().chain(self.whole)
    }
}

/// The gaps of all touches of a simulation.
pub(crate) struct Gaps<'a, A: Space> {
    sim: &'a Simulation,
    /// Precomputed constants of each touch.
    balls: Vec<Option<BallOnPlane<A>>>,
    groups: Vec<Group>,
    /// The group of each touch.
    group_of: Vec<Option<usize>>,
}

/// A gap and its rate.
type Look = Result<(f64, f64), SimError>;

impl<'a, A: Space> Gaps<'a, A> {
    pub fn new(sim: &'a Simulation, model: &A::Model) -> Self {
        let groups = Group::all(&sim.touches);
        let mut group_of = vec![None; sim.touches.len()];
        for (g, group) in groups.iter().enumerate() {
            group.touches().for_each(|k| group_of[k] = Some(g));
        }
        let balls = sim.touches.iter().map(|touch| touch.ball_on_plane(model)).collect();
        Self { sim, balls, groups, group_of }
    }

    /// Whether a touch of the group lasts.
    fn lasts(&self, group: usize, lasting: &[Lasting]) -> bool {
        lasting.iter().any(|own| self.group_of[own.touch] == Some(group))
    }

    /// Whether another touch of the same pair of bodies lasts.
    pub fn is_beside(&self, touch: usize, lasting: &[Lasting]) -> bool {
        self.group_of[touch].is_some_and(|group| self.lasts(group, lasting))
    }

    /// The touches whose gaps are watched one by one while these contacts last, and the groups that are watched as a whole.
    pub fn watched(&self, lasting: &[Lasting]) -> (Vec<usize>, Vec<usize>) {
        let (joined, single): (Vec<usize>, Vec<usize>) =
            (0..self.groups.len()).partition(|&group| self.lasts(group, lasting));
        let alone = |k: &usize| match self.group_of[*k] {
            None => true,
            Some(group) if !joined.contains(&group) => false,
            Some(group) => self.groups[group].whole != Some(*k) || !self.groups[group].pair.is_complete(),
        };
        let open = |k: &usize| !lasting.iter().any(|own| own.touch == *k);
        ((0..self.sim.touches.len()).filter(open).filter(alone).collect(), single)
    }

    /// All touches of a group.
    pub fn touches_of(&self, group: usize) -> impl Iterator<Item = usize> {
        self.groups[group].touches()
    }

    /// Gap and gap rate of a touch.
    pub fn look(&self, touch: usize, view: &View<A>, state: (&[f64], &[f64]), time: f64) -> Look {
        self.sim.touches[touch].look(self.balls[touch].as_ref(), view, state, time)
    }

    /// Gap and gap rate of a touch; the nearest points of bodies are apart where a contact of their parts is as near.
    pub fn own(&self, touch: usize, view: &View<A>, state: (&[f64], &[f64]), time: f64) -> Look {
        let found = self.look(touch, view, state, time)?;
        if let Some(group) = self.group_of[touch].map(|group| &self.groups[group])
            && group.whole == Some(touch)
        {
            for &part in &group.parts {
                if self.look(part, view, state, time)?.0 <= found.0 + SAME {
                    return Ok((APART, 0.0));
                }
            }
        }
        Ok(found)
    }

    /// Gap and gap rate of a group.
    pub fn of_group(&self, group: usize, view: &View<A>, (q, qd): (&[f64], &[f64]), time: f64) -> Look {
        let Group { pair, parts, whole } = &self.groups[group];
        let touch = &self.sim.touches[whole.unwrap_or(parts[0])];
        if let Some(far) = pair.clearance(view, touch.shift(time), qd)? {
            return Ok(far);
        }
        match whole {
            Some(whole) => self.look(*whole, view, (q, qd), time),
            // A list of touches from which the nearest points were removed.
            None => {
                let mut least = (APART, 0.0);
                for &part in parts {
                    let found = self.look(part, view, (q, qd), time)?;
                    least = if found.0 < least.0 { found } else { least };
                }
                Ok(least)
            }
        }
    }

    /// Gaps and gap rates of all touches. Those of bodies that are apart by more than [`NEAR`], and of parts that do not face
    /// each other, are [`APART`].
    pub fn all(
        &self,
        lasting: &[Lasting],
        view: &View<A>,
        state: (&[f64], &[f64]),
        time: f64,
    ) -> Result<Vec<(f64, f64)>, SimError> {
        let mut gaps = vec![(APART, 0.0); self.sim.touches.len()];
        for (k, gap) in gaps.iter_mut().enumerate().filter(|(k, _)| self.group_of[*k].is_none()) {
            *gap = self.look(k, view, state, time)?;
        }
        for (g, group) in self.groups.iter().enumerate() {
            if !self.lasts(g, lasting) && self.of_group(g, view, state, time)?.0 > NEAR {
                continue;
            }
            for k in group.touches() {
                gaps[k] = self.own(k, view, state, time)?;
            }
        }
        Ok(gaps)
    }

    /// The touches that can be closed, for time steps: not those of bodies that are far apart, and the nearest points of bodies
    /// only where no contact of their parts is as near.
    pub fn near(&self, view: &View<A>, state: (&[f64], &[f64]), time: f64) -> Result<Vec<usize>, SimError> {
        let mut near: Vec<usize> = (0..self.sim.touches.len()).filter(|k| self.group_of[*k].is_none()).collect();
        for (g, group) in self.groups.iter().enumerate() {
            if self.of_group(g, view, state, time)?.0 > NEAR {
                continue;
            }
            near.extend(&group.parts);
            if let Some(whole) = group.whole
                && self.own(whole, view, state, time)?.0 != APART
            {
                near.push(whole);
            }
        }
        Ok(near)
    }
}
