//! The touches of one pair of bodies as a group: while none of them lasts, the gap of the two bodies stands for all of them.

use super::active_set::Lasting;
use crate::contact::{APART, BallOnPlane, FAR, Pair, Passing, Placed, Touch, TouchKind};
use crate::error::SimError;
use crate::model::Simulation;
use crate::state::{EQUAL, MANY, Space, View};
use carom_contact::Meeting;
use std::cell::Cell;
use std::sync::Arc;

/// The touches of a pair that is divided into contacts of parts.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    pub pair: Arc<Pair>,
    /// Contacts of parts.
    pub parts: Vec<usize>,
    meetings: Vec<Meeting>,
    /// The nearest points of the bodies.
    pub whole: Option<usize>,
}

impl Group {
    /// The groups of these touches.
    pub fn all(touches: &[Touch]) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for (k, touch) in touches.iter().enumerate() {
            let TouchKind::Pair { pair, part } = &touch.kind else { continue };
            let known = groups.iter().rposition(|group| Arc::ptr_eq(&group.pair, pair));
            let known = known.unwrap_or_else(|| {
                let (parts, meetings) = (Vec::new(), Vec::new());
                groups.push(Self { pair: pair.clone(), parts, meetings, whole: None });
                groups.len() - 1
            });
            match part {
                Some(meeting) => {
                    groups[known].parts.push(k);
                    groups[known].meetings.push(*meeting);
                }
                None => groups[known].whole = Some(k),
            }
        }
        groups.retain(|group| !group.parts.is_empty());
        groups
    }

    /// Whether its contacts are watched by the least gap of those that do not last: of many corners on a plane, some of which
    /// last, the others are watched together.
    fn is_hull_on_plane(&self) -> bool {
        self.parts.len() > MANY && self.pair.is_complete() && self.pair.is_on_plane()
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
    /// The group of each touch, and the touches without one.
    group_of: Vec<Option<usize>>,
    alone: Vec<usize>,
    /// The contact of parts of each group that was nearest when last examined.
    nearest: Vec<Cell<Option<usize>>>,
}

/// A touch with its gap and gap rate.
pub(crate) type Near = (usize, (f64, f64));

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
        let nearest = vec![Cell::new(None); groups.len()];
        let alone = (0..group_of.len()).filter(|&k| group_of[k].is_none()).collect();
        Self { sim, balls, groups, group_of, alone, nearest }
    }

    /// Whether a touch of the group lasts.
    fn lasts(&self, group: usize, lasting: &[Lasting]) -> bool {
        lasting.iter().any(|own| self.group_of[own.touch] == Some(group))
    }

    /// Whether another touch of the same pair of bodies lasts.
    pub fn is_beside(&self, touch: usize, lasting: &[Lasting]) -> bool {
        self.group_of[touch].is_some_and(|group| self.lasts(group, lasting))
    }

    /// What is watched while these contacts last: touches, and groups by their [gap](Self::of_group). Only of touches that may close at this
    /// state.
    pub fn to_watch(&self, lasting: &[Lasting], (state, pace): (&[f64], f64)) -> [Vec<usize>; 2] {
        let may_close = |k: usize| self.sim.touches[k].may_close(state, pace);
        let open = |k: &usize| may_close(*k) && !lasting.iter().any(|own| own.touch == *k);
        let mut single: Vec<usize> = self.alone.iter().copied().filter(open).collect();
        let mut groups = Vec::new();
        for (g, group) in self.groups.iter().enumerate() {
            if !self.lasts(g, lasting) || group.is_hull_on_plane() {
                groups.extend(may_close(group.parts[0]).then_some(g));
            } else {
                single.extend(group.parts.iter().filter(|k| open(k)));
                single.extend(group.whole.filter(|_| !group.pair.is_complete()).filter(open));
            }
        }
        [single, groups]
    }

    /// Whether a touch belongs to a group.
    pub fn is_of(&self, group: usize, touch: usize) -> bool {
        self.group_of[touch] == Some(group)
    }

    /// Gap and gap rate of a touch.
    pub fn look(&self, touch: usize, view: &View<A>, state: (&[f64], &[f64]), time: f64) -> Look {
        self.sim.touches[touch].look(self.balls[touch].as_ref(), view, state, time)
    }

    /// Both bodies of a group at a state.
    fn placed(&self, group: usize, view: &View<A>, qd: &[f64], time: f64) -> Result<Placed, SimError> {
        let group = &self.groups[group];
        group.pair.placed(view, self.sim.touches[group.parts[0]].shift(time), qd)
    }

    /// Gap and gap rate of a touch; the nearest points of bodies are apart where a contact of their parts is as near. `last`: the
    /// group of the touch before and its bodies, which touches of one group share.
    pub fn own(
        &self,
        touch: usize,
        view: &View<A>,
        state: (&[f64], &[f64]),
        time: f64,
        last: &mut Option<(usize, Placed)>,
    ) -> Look {
        let Some(group) = self.group_of[touch] else { return self.look(touch, view, state, time) };
        let placed = match last.take() {
            Some((known, placed)) if known == group => placed,
            _ => self.placed(group, view, state.1, time)?,
        };
        let found = match self.of_part(touch, &placed) {
            Some(found) => found,
            None => {
                let (least, part) = self.least(group, &placed, |_| true);
                let whole = match part {
                    Some(part) if self.is_nearest(part, &placed) => least,
                    _ => self.look(touch, view, state, time)?,
                };
                if least.0 <= whole.0 + EQUAL * self.groups[group].pair.size() { APART } else { whole }
            }
        };
        *last = Some((group, placed));
        Ok(found)
    }

    /// Gap and gap rate of a contact of parts; `None` for the nearest points of bodies.
    fn of_part(&self, touch: usize, placed: &Placed) -> Option<(f64, f64)> {
        match &self.sim.touches[touch].kind {
            TouchKind::Pair { pair, part: Some(part) } => Some(pair.look(*part, placed)),
            _ => None,
        }
    }

    /// The least gap of some contacts of parts of a group, with its rate, and the contact.
    fn least(&self, group: usize, placed: &Placed, wanted: impl Fn(usize) -> bool) -> ((f64, f64), Option<usize>) {
        let (mut least, mut nearest) = (APART, None);
        let Group { pair, parts, meetings, .. } = &self.groups[group];
        for (&part, meeting) in parts.iter().zip(meetings) {
            if is_above(pair, *meeting, placed, least.0) || !wanted(part) {
                continue;
            }
            let found = pair.look(*meeting, placed);
            if found.0 < least.0 {
                (least, nearest) = (found, Some(part));
            }
        }
        (least, nearest)
    }

    /// Whether the gap of a contact of parts is that of its bodies.
    fn is_nearest(&self, touch: usize, placed: &Placed) -> bool {
        match &self.sim.touches[touch].kind {
            TouchKind::Pair { pair, part: Some(part) } => pair.is_nearest(*part, placed),
            _ => false,
        }
    }

    /// The least gap, with its rate, of the contacts of a group that do not last.
    fn rest(&self, group: usize, lasting: &[Lasting], view: &View<A>, qd: &[f64], time: f64) -> Look {
        let placed = self.placed(group, view, qd, time)?;
        Ok(self.least(group, &placed, |part| !lasting.iter().any(|own| own.touch == part)).0)
    }

    /// How the bodies of a pair move past each other; `None` for other touches.
    pub fn passing(&self, touch: usize, view: &View<A>, qd: &[f64], time: f64) -> Result<Option<Passing>, SimError> {
        let touch = &self.sim.touches[touch];
        let TouchKind::Pair { pair, .. } = &touch.kind else { return Ok(None) };
        Ok(Some(pair.passing(&pair.placed(view, touch.shift(time), qd)?)))
    }

    /// The groups of bodies with faces, edges and rims, of which contacts last.
    pub fn touching(&self, lasting: &[Lasting]) -> Vec<usize> {
        let groups = 0..self.groups.len();
        groups.filter(|&g| self.lasts(g, lasting) && !self.groups[g].pair.is_on_plane()).collect()
    }

    /// The separation of the bodies of a group, m: the greatest along the normals of faces and of contacts of parts, or the first of
    /// them that is not below `enough`, mostly that along a contact that lasts; and the angular speed with which they turn relative to each
    /// other, rad/s.
    pub fn separated(
        &self,
        group: usize,
        lasting: &[Lasting],
        view: &View<A>,
        (qd, time): (&[f64], f64),
        enough: f64,
    ) -> Result<[f64; 2], SimError> {
        let placed = self.placed(group, view, qd, time)?;
        let Group { pair, parts, meetings, .. } = &self.groups[group];
        let lasts = |k: usize| lasting.iter().any(|own| own.touch == parts[k]);
        let (first, others): (Vec<usize>, Vec<usize>) = (0..parts.len()).partition(|&k| lasts(k));
        let along = |k: usize| pair.along(meetings[k], &placed).unwrap_or(f64::INFINITY);
        let mut most = first.into_iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        if most < enough {
            most = most.max(pair.separation(&placed).map_or(f64::NEG_INFINITY, |(gap, _)| gap));
        }
        for k in others {
            if most >= enough {
                break;
            }
            most = most.max(along(k));
        }
        Ok([most, pair.passing(&placed).turning()])
    }

    /// A touch of a group.
    pub fn first(&self, group: usize) -> usize {
        self.groups[group].parts[0]
    }

    /// Gap and gap rate of a group, or of those of its contacts that do not last; lower bounds where the bodies are far apart.
    pub fn of_group(
        &self,
        group: usize,
        lasting: &[Lasting],
        view: &View<A>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
    ) -> Look {
        if self.lasts(group, lasting) {
            return self.rest(group, lasting, view, qd, time);
        }
        let Group { pair, parts, whole, .. } = &self.groups[group];
        let touch = &self.sim.touches[whole.unwrap_or(parts[0])];
        if let Some(far) = pair.clearance(view, touch.shift(time), qd)? {
            return Ok(far);
        }
        let placed = self.placed(group, view, qd, time)?;
        // The lowest point over a plane.
        if pair.is_complete() && pair.is_on_plane() {
            return Ok(pair.separation(&placed).unwrap_or(APART));
        }
        // A contact whose gap is the separation of the bodies along its normal has the least gap: no other one is examined.
        let mut nearest = self.nearest[group].take().filter(|&part| self.is_nearest(part, &placed));
        let mut least = nearest.and_then(|part| self.of_part(part, &placed)).filter(|(gap, _)| gap.is_finite());
        if least.is_none() {
            let (found, part) = self.least(group, &placed, |_| true);
            nearest = part.filter(|&part| self.is_nearest(part, &placed));
            // Parts that overlap deeply do not count: another one may be apart.
            least = Some(found).filter(|_| whole.is_none() || nearest.is_some());
        }
        self.nearest[group].set(nearest);
        let (Some(whole), None) = (*whole, least) else { return Ok(least.unwrap_or(APART)) };
        match pair.separation(&placed) {
            Some(bound) if bound.0 > FAR * pair.size() => Ok(bound),
            _ => self.look(whole, view, (q, qd), time),
        }
    }

    /// Gaps and gap rates of all touches, in their order, without those of bodies and corners that are apart by more than
    /// a share [`FAR`] of the size of a body. Of parts that do not face each other they are [`APART`].
    pub fn all(
        &self,
        lasting: &[Lasting],
        view: &View<A>,
        state: (&[f64], &[f64]),
        time: f64,
    ) -> Result<Vec<Near>, SimError> {
        let mut gaps = Vec::new();
        for &k in &self.alone {
            gaps.push((k, self.look(k, view, state, time)?));
        }
        for (g, group) in self.groups.iter().enumerate() {
            let open = FAR * group.pair.size();
            if !self.lasts(g, lasting) && self.of_group(g, lasting, view, state, time)?.0 > open {
                continue;
            }
            let placed = self.placed(g, view, state.1, time)?;
            let parts = group.parts.iter().zip(&group.meetings);
            let near = parts.filter(|(_, meeting)| !is_above(&group.pair, **meeting, &placed, open));
            gaps.extend(near.map(|(&k, meeting)| (k, group.pair.look(*meeting, &placed))));
            // Bodies on a half-space touch it with their corners and rims only.
            if let Some(k) = group.whole.filter(|_| !(group.pair.is_complete() && group.pair.is_on_plane())) {
                gaps.push((k, self.own(k, view, state, time, &mut Some((g, placed)))?));
            }
        }
        gaps.sort_unstable_by_key(|(k, _)| *k);
        Ok(gaps)
    }

    /// The touches with gaps of at most `within`, for time steps: the nearest points of bodies only where no contact of their
    /// parts is as near.
    pub fn near(
        &self,
        view: &View<A>,
        state: (&[f64], &[f64]),
        time: f64,
        within: f64,
    ) -> Result<Vec<usize>, SimError> {
        let gaps = self.all(&[], view, state, time)?;
        Ok(gaps.into_iter().filter(|(_, (gap, _))| *gap <= within).map(|(k, _)| k).collect())
    }
}

/// Whether these parts are a corner over a half-space with a larger gap than this.
fn is_above(pair: &Pair, meeting: Meeting, placed: &Placed, gap: f64) -> bool {
    pair.height(meeting, placed).is_some_and(|height| height > gap)
}
