//! Projection of a state onto its constraints, in the metric of M: gaps and normal velocities of the lasting contacts, slip of
//! those that stick.

use super::active_set::{ActiveSet, Dry, DryJoint, Hold, Lasting};
use super::assembled::Assembled;
use super::held::Detail;
use super::rows::{Constraints, Level, direction_of_slip, push};
use super::smooth::{Motion, deflection};
use crate::contact::{Grip, Slack};
use crate::error::SimError;
use crate::state::{CLEAR, ContactImpulse, EXACT, GROWTH, ROUNDING, Space, View};
use carom_chain::Rows;
use carom_impact::least_norm;
use nalgebra::{DMatrix, DVector, Vector3};

/// A kink of the contact forces: where what it depends on has changed by so much.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kink {
    left: f64,
    at: Vector3<f64>,
}

impl Kink {
    fn zero(at: Vector3<f64>) -> Self {
        Self { left: at.norm(), at }
    }

    /// A kink, or one that is infinitely far away: the n-th kinks of two states are the same one, whether or not both states have it.
    fn or_none(found: Option<Self>) -> Self {
        found.unwrap_or(Self { left: f64::INFINITY, at: Vector3::zeros() })
    }

    /// How many changes like that from these to those lead to the nearest.
    pub fn nearest(here: &[Self], there: &[Self]) -> f64 {
        let steps = |(here, there): (&Self, &Self)| here.left / (there.at - here.at).norm();
        here.iter().zip(there).map(steps).fold(f64::INFINITY, f64::min)
    }
}

impl<A: Space> Motion<'_, A> {
    /// Projects a state onto the constraints of the present mode; returns whether it changed.
    pub fn settle(&mut self, time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let lasting = std::mem::take(&mut self.active.lasting);
        let changed = self.project((&lasting, &lasting), time, y);
        self.active.lasting = lasting;
        changed
    }

    /// Sets the gaps of the first contacts to zero, the normal velocities of the second, the slip of those of them that stick, and the
    /// velocities of joints held by dry friction. Returns whether the state changed.
    pub fn project(
        &mut self,
        (closed, lasting): (&[Lasting], &[Lasting]),
        time: f64,
        y: &mut [f64],
    ) -> Result<bool, SimError> {
        let (nq, nv) = (self.sim.chain.nq(), self.sim.chain.nv());
        let mut changed = self.close_loops(y)?;
        if !closed.iter().chain(lasting).any(Lasting::is_rigid)
            && !self.active.dry.iter().any(|joint| joint.state == Dry::Holds)
        {
            return Ok(changed);
        }
        // The velocities at the new configuration.
        for level in [Level::Positions, Level::Velocities] {
            let (q, qd) = (y[..nq].to_vec(), y[nq..nq + nv].to_vec());
            let Self { sim, model, workspace, couplings, active, scale, .. } = self;
            let mut view = View::closed_by(*model, workspace, &q, couplings)?;
            let (mut table, mut responses) = (Constraints::new(nv), Rows::new(nv));
            let contacts = if level == Level::Positions { closed } else { lasting };
            for own in contacts.iter().filter(|own| own.is_rigid()) {
                let touch = &sim.touches[own.touch];
                let at = touch.at(&view, &q, time);
                // Not parts that no longer face each other.
                if at.gap.is_finite() {
                    table.add((own, touch), (&at, Some(&view)), time, level)?;
                }
            }
            let errors = match level {
                Level::Positions => table.contacts.iter().map(|contact| contact.gap).collect(),
                Level::Velocities => {
                    table.hold(&active.dry);
                    table.excess(&qd).as_slice().to_vec()
                }
            };
            // A correction of the size of rounding would only disturb the integrator.
            let negligible = match level {
                Level::Positions => 0.1 * ROUNDING * scale.length,
                Level::Velocities => 0.1 * ROUNDING * scale.length * scale.pace,
            };
            if errors.iter().all(|error| error.abs() <= negligible) {
                continue;
            }
            changed = true;
            view.respond(&table.rows, &mut responses)?;
            let back = table.least(&responses, &errors);
            match level {
                Level::Positions => y[..nq].copy_from_slice(&sim.chain.integrate(&q, &back, -1.0)?),
                Level::Velocities => y[nq..nq + nv].iter_mut().zip(&back).for_each(|(v, x)| *v -= x),
            }
        }
        Ok(changed)
    }

    /// The impulses at the lasting contacts by which [`Self::settle`] has changed the velocities to those of this state.
    pub fn impulses_of(&mut self, change: &[f64], time: f64, y: &[f64]) -> Result<Vec<ContactImpulse>, SimError> {
        let (q, _) = self.split(y);
        let Self { sim, model, workspace, couplings, active, .. } = self;
        let mut view = View::closed_by(*model, workspace, q, couplings)?;
        let (mut table, mut responses) = (Constraints::new(change.len()), Rows::new(change.len()));
        for own in active.lasting.iter().filter(|own| own.is_rigid()) {
            let touch = &sim.touches[own.touch];
            table.add((own, touch), (&touch.at(&view, q, time), Some(&view)), time, Level::Velocities)?;
        }
        table.hold(&active.dry);
        view.respond(&table.rows, &mut responses)?;
        let changes: Vec<f64> = table.rows.iter().map(|row| row.iter().zip(change).map(|(r, v)| r * v).sum()).collect();
        let mut impulse = vec![0.0; table.rows.len()];
        table.least_forces(&responses, &changes).for_each(|(row, force)| impulse[row] = force);
        Ok(table.impulses(&impulse))
    }

    /// Sets the normal velocities of these contacts to zero, and keeps those at rest at rest, by impulses along the directions of
    /// their forces: n − μ d where they slide.
    ///
    /// The infinitely many impacts of an accumulation carry the normal impulse of a lasting contact of the same duration, less
    /// that of the normal velocity which they start with. This difference has its friction, too. Without it slip would be
    /// wrong by μ times that velocity: an error of first order in the Zeno time.
    pub fn shut(&mut self, entries: &[Lasting], time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let mut found = std::mem::take(&mut self.assembled);
        let done = self.assemble((time, y), entries, Detail::ROWS, &mut found).and_then(|()| {
            let nq = self.sim.chain.nq();
            let qd = &mut y[nq..nq + self.sim.chain.nv()];
            let excess = found.constraints.excess(qd);
            let equations = self.equations(time, &found)?;
            let impulses = equations.and_then(|it| it.solve(&-excess)).ok_or_else(|| self.jam(time, &found, 0))?;
            push(qd, &found.responses, impulses.as_slice());
            Ok(())
        });
        self.assembled = found;
        match done {
            // No impulse along n − μ d closes the gap.
            Err(SimError::Jam { .. }) => self.project((entries, entries), time, y).map(|_| ()),
            done => done,
        }
    }

    /// Passes the contacts with surfaces to `see`, with their unit normals and the velocities of their contact points relative to the surfaces.
    fn slips(
        &mut self,
        (time, y): (f64, &[f64]),
        mut see: impl FnMut(&mut Lasting, Vector3<f64>, Vector3<f64>),
    ) -> Result<(), SimError> {
        let (sim, (q, qd)) = (self.sim, self.split(y));
        let Self { active, workspace, model, couplings, .. } = self;
        let view = View::closed_by(*model, workspace, q, couplings)?;
        let slides = |own: &&mut Lasting| matches!(own.hold, Hold::Slides { .. } | Hold::Starts { .. });
        for own in active.lasting.iter_mut().filter(slides) {
            let touch = &sim.touches[own.touch];
            if let Some(place) = touch.at(&view, q, time).surface {
                see(own, place.normal, touch.u(&place, &view, qd, time)?);
            }
        }
        Ok(())
    }

    /// Updates the directions of slip, which turn in space; the guards of its stop use them.
    pub fn follow_slip(&mut self, time: f64, y: &[f64]) -> Result<(), SimError> {
        let noise = self.noise();
        self.slips((time, y), |own, n, u| {
            if let Hold::Slides { toward } = &mut own.hold {
                *toward = direction_of_slip(u, n, noise).unwrap_or(*toward);
            }
        })
    }

    /// Ends the start of slips that have jumped between these states: their direction is that of the slip which an impact gave them.
    pub fn end_starts(&mut self, time: f64, (before, now): (&[f64], &[f64])) -> Result<(), SimError> {
        let (rest, mut old) = (self.rest(), Vec::new());
        // The velocities before it, of the same contacts at the same configuration.
        let before = [self.split(now).0, &before[self.sim.chain.nq()..]].concat();
        self.slips((time, &before), |_, _, u| old.push(u))?;
        let mut old = old.into_iter();
        self.slips((time, now), |own, n, u| {
            let jump = old.next().map_or(0.0, |old| (u - old).norm());
            if let (Hold::Starts { .. }, Some(toward)) = (own.hold, direction_of_slip(u, n, rest))
                && jump > rest
            {
                own.hold = Hold::Slides { toward };
            }
        })
    }

    /// The slips of the contacts that slide and whose direction follows from it, m/s, world; `None` without friction.
    fn sliding(&mut self, time: f64, y: &[f64]) -> Result<Vec<Option<Vector3<f64>>>, SimError> {
        let (sim, mut found) = (self.sim, Vec::new());
        self.slips((time, y), |own, n, u| {
            if matches!(own.hold, Hold::Slides { .. }) {
                let rubs = sim.touches[own.touch].contact.law.friction() > 0.0;
                found.push(rubs.then(|| u - n * n.dot(&u)));
            }
        })?;
        Ok(found)
    }

    /// The slowest of these slips, m/s; infinite if there are none.
    pub fn slowest_slip(&mut self, time: f64, y: &[f64]) -> Result<f64, SimError> {
        Ok(self.sliding(time, y)?.iter().flatten().map(Vector3::norm).fold(f64::INFINITY, f64::min))
    }

    /// The kinks of the contact forces: zeros of the [slips](Self::sliding), m/s, of the depths and speeds of compliant contacts beyond those at
    /// which their normal forces have kinks, m or m/s, the limits of sliders of bristles, N, and slips within which smoothed friction changes, m/s.
    pub fn kinks(&mut self, time: f64, y: &[f64]) -> Result<Vec<Kink>, SimError> {
        let sliding = self.sliding(time, y)?.into_iter();
        let mut found: Vec<Kink> = sliding.map(|slip| Kink::or_none(slip.map(Kink::zero))).collect();
        for k in 0..self.active.lasting.len() {
            let own = self.active.lasting[k];
            if own.is_rigid() {
                continue;
            }
            let (gap, rate) = self.gap(own.touch, time, y)?;
            let slack = own.slack(&self.sim.touches[own.touch].contact, (gap, rate));
            let zero = |value: f64| Kink::zero(Vector3::x() * value);
            let grip = self.grip(k, (time, y))?;
            // While the slider of a bristle slips, the direction of its force changes as that of slip does.
            let bends = |at: fn(&Grip) -> Vector3<f64>| {
                grip.as_ref().map(|grip| Kink { left: 0.5 * grip.margin().abs(), at: at(grip) })
            };
            let slips = grip.filter(|grip| grip.slips().is_some()).map(|grip| Kink::zero(grip.force));
            let own = [Some(zero(gap)), slack.map(|slack| zero(slack.value())), self.smoothed(k, (time, y))?];
            found.extend(own.map(Kink::or_none));
            found.extend([bends(|it| it.force), bends(|it| Vector3::x() * it.limit), slips].map(Kink::or_none));
        }
        Ok(found)
    }

    /// The slip of a compliant contact with smoothed friction, which changes over its slip speed.
    fn smoothed(&mut self, index: usize, (time, y): (f64, &[f64])) -> Result<Option<Kink>, SimError> {
        let touch = &self.sim.touches[self.active.lasting[index].touch];
        let speed = touch.contact.compliance.and_then(|it| it.slip_speed());
        let Some(speed) = speed.filter(|_| touch.contact.law.friction() > 0.0) else { return Ok(None) };
        let (q, qd) = self.sim.split(y);
        let view = self.view(q)?;
        let Some(place) = touch.at(&view, q, time).surface else { return Ok(None) };
        let u = touch.u(&place, &view, qd, time)?;
        let at = u - place.normal * place.normal.dot(&u);
        Ok(Some(Kink { left: speed.hypot(at.norm()), at }))
    }

    /// Whether a compliant contact whose force has the slope of a root at its closing is less deep at the first, or at the last, of these states
    /// than at the other one, by more than [`GROWTH`].
    pub fn roots(&mut self, states: [(f64, &[f64]); 2]) -> Result<[bool; 2], SimError> {
        let mut found = [false; 2];
        for k in 0..self.active.lasting.len() {
            let touch = self.active.lasting[k].touch;
            if self.active.lasting[k].is_rigid()
                || !self.sim.touches[touch].contact.compliance.is_some_and(|it| it.is_curved())
            {
                continue;
            }
            let mut depths = [0.0; 2];
            for (depth, (time, y)) in depths.iter_mut().zip(states) {
                *depth = (-self.gap(touch, time, y)?.0).max(0.0);
            }
            found[0] |= GROWTH * depths[0] < depths[1];
            found[1] |= GROWTH * depths[1] < depths[0];
        }
        Ok(found)
    }

    /// Whether the normal force of a lasting contact that is not open has vanished; where rounding decides, whether it does so now. `None` where
    /// that cannot be: see [`Lasting::slack`].
    pub fn has_vanished(&mut self, index: usize, (time, y): (f64, &[f64])) -> Result<Option<bool>, SimError> {
        let own = self.active.lasting[index];
        if own.is_rigid() {
            return Ok(None);
        }
        let gap = self.gap(own.touch, time, y)?;
        let slack = own.slack(&self.sim.touches[own.touch].contact, gap);
        Ok(slack.map(|slack| match slack {
            Slack::Depth(left) if left.abs() <= self.scale.rounding() => gap.1 > 0.0,
            slack => slack.value() < 0.0,
        }))
    }

    /// The direction in which the slider of the bristle of a lasting contact slips, or none where it holds; where rounding decides, what it does
    /// next. `None` without a slider.
    pub fn slider(&mut self, index: usize, (time, y): (f64, &[f64])) -> Result<Option<Option<Vector3<f64>>>, SimError> {
        let Some(grip) = self.grip(index, (time, y))? else { return Ok(None) };
        if grip.margin().abs() > 2.0 * grip.rounding() {
            return Ok(Some(grip.slips()));
        }
        let held = self.accelerations(time, y)?;
        let mut rate = vec![0.0; y.len()];
        self.rate(time, y, Some(&held), &mut rate)?;
        let span = CLEAR / self.scale.pace;
        let mut next: Vec<f64> = y.iter().zip(&rate).map(|(y, rate)| y + rate * span).collect();
        self.sim.normalise(&mut next);
        let next = self.grip(index, (time + span, &next))?.filter(|next| next.margin() < grip.margin());
        Ok(Some(next.and_then(|next| next.force.try_normalize(0.0))))
    }

    /// What the slider of the bristle of a lasting contact carries: see [`Lasting::grip`].
    pub fn grip(&mut self, index: usize, (time, y): (f64, &[f64])) -> Result<Option<Grip>, SimError> {
        let (own, sim) = (self.active.lasting[index], self.sim);
        let (q, qd) = sim.split(y);
        let deflection = deflection(&self.bristles, &y[q.len() + qd.len() + 2..], own.touch);
        own.grip(&sim.touches[own.touch], deflection, (&self.view(q)?, q, qd, time))
    }

    /// The direction of slip that has begun follows from it from now on: of the i-th contact, whose guard has fired by the direction of the accelerations
    /// that were computed last, and of those whose start is half over. Contacts that begin to slide at one time are fast enough at one time, too, up
    /// to the error of the integration.
    pub fn started(&mut self, i: usize, time: f64, y: &[f64]) -> Result<(), SimError> {
        let first = self.active.lasting[i].touch;
        self.end_starts_if((time, y), |touch, share| touch == first || share >= 0.5)
    }

    /// The same of contacts whose start is over, as no guard tells where the choice of a mode leaves them slip.
    pub fn end_long_starts(&mut self, time: f64, y: &[f64]) -> Result<(), SimError> {
        if self.is_linear() { Ok(()) } else { self.end_starts_if((time, y), |_, share| share >= 1.0) }
    }

    /// `over`: of a touch, and how far the start of its slip is.
    fn end_starts_if(&mut self, (time, y): (f64, &[f64]), over: impl Fn(usize, f64) -> bool) -> Result<(), SimError> {
        let (starts, mut any) = (self.starts(), false);
        self.slips((time, y), |own, n, u| {
            if let Hold::Starts { toward } = own.hold
                && over(own.touch, starts.share(u - n * n.dot(&u), toward))
            {
                own.hold = Hold::Slides { toward };
                any = true;
            }
        })?;
        if any { self.follow_slip(time, y) } else { Ok(()) }
    }

    /// Takes out the components of slip across the directions of slip, of the contacts that slide, and stick or begin to slide in the mode
    /// `after`: by impulses of friction across these directions, with those of the constraints. Slip whose direction turns ends so.
    pub fn straighten(&mut self, after: &ActiveSet, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let lasting = std::mem::take(&mut self.active.lasting);
        let mut found = std::mem::take(&mut self.assembled);
        let assembled = self.assemble((time, y), &lasting, Detail::ROWS, &mut found);
        let (q, qd) = self.split(y);
        let (nq, nv, sim) = (q.len(), qd.len(), self.sim);
        let mut across = Rows::new(nv);
        let mut errors = vec![0.0; found.constraints.rows.len()];
        let mut view = self.view(q)?;
        let rests = |own: &&Lasting| {
            let same = |now: &Lasting| now.touch == own.touch && matches!(now.hold, Hold::Sticks | Hold::Starts { .. });
            after.lasting.iter().any(same)
        };
        for own in lasting.iter().filter(rests) {
            if let Hold::Slides { toward } = own.hold
                && let Some(place) = sim.touches[own.touch].at(&view, q, time).surface
            {
                let direction = place.normal.cross(&toward);
                place.row_into(&view, direction, across.add())?;
                errors.push(sim.touches[own.touch].u(&place, &view, qd, time)?.dot(&direction));
            }
        }
        let mut responses = Rows::new(nv);
        let responded = view.respond(&across, &mut responses);
        (self.active.lasting, self.assembled) = (lasting, found);
        assembled?;
        responded?;
        let Assembled { constraints, responses: held, .. } = &self.assembled;
        let rows: Vec<&[f64]> = constraints.rows.iter().chain(across.iter()).collect();
        let impulses: Vec<&[f64]> = held.iter().chain(responses.iter()).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let k = DMatrix::from_fn(rows.len(), rows.len(), |i, j| dot(rows[i], impulses[j]));
        if rows.is_empty() || k.iter().any(|entry| !entry.is_finite()) {
            return Ok(());
        }
        // Constraints may depend on each other: the solution of least squares.
        let found = least_norm(&k, &DVector::from_vec(errors), EXACT);
        for (impulse, response) in found.iter().zip(impulses) {
            y[nq..nq + nv].iter_mut().zip(response).for_each(|(v, x)| *v -= impulse * x);
        }
        Ok(())
    }

    /// Advances the present mode by `span` seconds in one step of the midpoint rule; the span is below the Zeno time.
    pub fn pass(&mut self, span: f64, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let first = self.accelerations(time, y)?.qdd;
        let mut middle = y.to_vec();
        self.advance(span / 2.0, &first, &mut middle)?;
        let qdd = self.accelerations(time + span / 2.0, &middle)?.qdd;
        self.advance(span, &qdd, y)?;
        self.settle(time + span, y).map(|_| ())
    }

    /// Whether a contact that slides, or a joint that brakes, moves against the direction in which it did: it came to rest before.
    pub fn moves_back(&mut self, time: f64, y: &[f64]) -> Result<bool, SimError> {
        let (_, qd) = self.split(y);
        let back = |joint: &DryJoint| matches!(joint.state, Dry::Brakes(direction) if qd[joint.v] * direction < 0.0);
        if self.active.dry.iter().any(back) {
            return Ok(true);
        }
        let mut found = false;
        self.slips((time, y), |own, _, u| {
            found |= matches!(own.hold, Hold::Slides { toward } if u.dot(&toward) < 0.0);
        })?;
        Ok(found)
    }

    /// Moves a state on by `span` seconds with constant accelerations.
    fn advance(&self, span: f64, qdd: &DVector<f64>, y: &mut [f64]) -> Result<(), SimError> {
        let (q, qd) = self.split(y);
        let (nq, nv) = (q.len(), qd.len());
        let mean: Vec<f64> = qd.iter().zip(qdd.iter()).map(|(v, a)| v + 0.5 * a * span).collect();
        let moved = self.sim.chain.integrate(q, &mean, span)?;
        y[..nq].copy_from_slice(&moved);
        y[nq..nq + nv].iter_mut().zip(qdd.iter()).for_each(|(v, a)| *v += a * span);
        Ok(())
    }
}
