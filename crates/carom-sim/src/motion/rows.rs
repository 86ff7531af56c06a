//! The table of the rows of contacts, joint limits and joints with dry friction at one state: the only place that knows which rows each of
//! them has.
//!
//! | mode | rows for velocities and accelerations | force along |
//! |---|---|---|
//! | slides | normal | n, with friction n − μ d |
//! | begins to slide | normal; the tangents apart | n − μ d, with d from the accelerations: `starting.rs` |
//! | sticks, latched | two tangents and the normal | these rows |
//! | at a joint limit | that of the coordinate | this row |
//! | a joint that dry friction holds | that of the coordinate | this row |
//!
//! For gaps every contact has its normal row alone.

use super::active_set::{Dry, DryJoint, Hold, Lasting};
use crate::contact::{At, Place, Touch};
use crate::error::SimError;
use crate::model::Simulation;
use crate::state::{Basis, ContactImpulse, Space, View};
use carom_chain::Rows;
use carom_chain::algebra::z_onto;
use carom_impact::{Constraint, SeveralProblem};
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use std::ops::Range;

/// What the rows are for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Level {
    /// Gaps.
    Positions,
    /// Velocities and impulses.
    Velocities,
}

/// Constraints at one state: of velocities R q̇ = `surface`, of accelerations R q̈ + drift = 0, with forces along the rows F.
#[derive(Debug, Clone, Default)]
pub(crate) struct Constraints {
    /// R.
    pub rows: Rows,
    /// The velocity of the surface along each row.
    pub surface: Vec<f64>,
    /// F, for accelerations: differs from R where a contact slides with friction.
    pub forces: Rows,
    /// The rows that differ in F and R.
    pub skewed: Vec<usize>,
    pub drifts: Vec<f64>,
    pub contacts: Vec<Contact>,
    /// The contacts whose slip begins, and T: the rows of their slip, two of each.
    pub starts: Vec<Start>,
    pub tangents: Rows,
    /// Index into the list of dry joints, for each row after those of the contacts.
    pub joints: Vec<usize>,
}

/// A rigid contact among the constraints.
#[derive(Debug, Clone)]
pub(crate) struct Contact {
    /// The contact as it was added.
    pub own: Lasting,
    pub rows: Range<usize>,
    pub gap: f64,
    /// World direction of the force of each row, the last that of the normal (n − μ d if it slides); `None` for a joint limit.
    pub directions: Option<Matrix3<f64>>,
    /// Unit normal and contact point, world; zero for a joint limit.
    pub normal: Vector3<f64>,
    pub position: Vector3<f64>,
    /// Velocity of the surface at the contact point, m/s.
    pub surface: Vector3<f64>,
    /// J q̇, m/s, and u̇ at q̈ = 0, for accelerations.
    pub velocity: Vector3<f64>,
    pub drift: Vector3<f64>,
}

impl Contact {
    /// The force on the robot, world, N, of the forces along the rows; zero for a joint limit.
    pub fn force(&self, lambda: &[f64]) -> Vector3<f64> {
        self.directions.map_or_else(Vector3::zeros, |directions| along(&directions, &lambda[self.rows.clone()]))
    }

    /// The power of its force at the velocity that the contact leaves: that of the surface along its rows. The velocities at which an integrator
    /// evaluates a step differ from it by errors of low order, and would shorten the steps for the sake of this power.
    pub fn power(&self, force: &Vector3<f64>) -> f64 {
        match self.rows.len() {
            3 => force.dot(&self.surface),
            _ => force.dot(&(self.velocity - self.normal * self.normal.dot(&(self.velocity - self.surface)))),
        }
    }

    /// The vector in the tangent plane, world, with these components along the first two rows; zero for a joint limit.
    pub fn tangential(&self, along: &[f64]) -> Vector3<f64> {
        let Some(directions) = &self.directions else { return Vector3::zeros() };
        along.iter().take(2).enumerate().map(|(k, x)| directions.column(k) * *x).sum()
    }
}

/// The vector with these components along the last columns: three of a contact with tangents, one of the normal alone.
fn along(directions: &Matrix3<f64>, components: &[f64]) -> Vector3<f64> {
    let skip = 3 - components.len();
    components.iter().enumerate().map(|(k, x)| directions.column(k + skip) * *x).sum()
}

/// A contact whose slip begins, among the constraints.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    /// Index among the rigid contacts, and its row.
    pub contact: usize,
    pub row: usize,
    pub friction: f64,
    /// Contact axes, tangents first.
    pub axes: Matrix3<f64>,
    pub along: Vector2<f64>,
    /// u̇_t at q̈ = 0.
    pub drift: Vector2<f64>,
}

impl Start {
    /// The direction, world.
    pub fn toward(&self) -> Vector3<f64> {
        self.axes.column(0) * self.along.x + self.axes.column(1) * self.along.y
    }
}

/// Unit direction of the tangential part of u; `None` if this is below `least`.
pub(crate) fn direction_of_slip(u: Vector3<f64>, n: Vector3<f64>, least: f64) -> Option<Vector3<f64>> {
    (u - n * n.dot(&u)).try_normalize(least)
}

/// The direction against which friction acts at a slip velocity u: that of u. Where u is of the size of its error, it is that of u +
/// noise · toward, with a weight that vanishes for faster slip; `toward` is the direction at the end of the last step. Beyond a stop
/// (u · toward < 0), which only steps that are tried reach, it is continued smoothly by −u/|u|.
fn lasting_direction(u: Vector3<f64>, n: Vector3<f64>, toward: Vector3<f64>, noise: f64) -> Vector3<f64> {
    let u = u - n * n.dot(&u);
    let u = if u.dot(&toward) < 0.0 { -u } else { u };
    let ratio = u.norm_squared() / (noise * noise);
    if ratio > 800.0 {
        return u.normalize(); // the weight is below the least number
    }
    let weight = (-ratio).exp();
    let along = toward - n * n.dot(&toward);
    (u + along * (noise * weight)).try_normalize(0.0).unwrap_or(toward)
}

impl Constraints {
    pub fn new(nv: usize) -> Self {
        Self { rows: Rows::new(nv), forces: Rows::new(nv), tangents: Rows::new(nv), ..Self::default() }
    }

    pub fn clear(&mut self) {
        self.rows.clear();
        self.surface.clear();
        self.forces.clear();
        self.skewed.clear();
        self.drifts.clear();
        self.contacts.clear();
        self.starts.clear();
        self.tangents.clear();
        self.joints.clear();
    }

    /// The rows R of a rigid contact. `None` in place of a view: the limit of a joint that is locked, which has no row.
    pub fn add<A: Space>(
        &mut self,
        (own, touch): (&Lasting, &Touch),
        (at, view): (&At<A>, Option<&View<A>>),
        time: f64,
        level: Level,
    ) -> Result<&mut Contact, SimError> {
        let first = self.rows.len();
        let zero = Vector3::zeros();
        let (mut directions, mut normal, mut position, mut surface) = (None, zero, zero, zero);
        match (at.surface, view) {
            (Some(place), Some(view)) => {
                let axes = z_onto(place.normal);
                (directions, normal, position) = (Some(axes), place.normal, place.position);
                surface = touch.surface_velocity(&place, time);
                let sticks = matches!(own.hold, Hold::Sticks | Hold::Latched);
                let along = if sticks && matches!(level, Level::Velocities) { 0..3 } else { 2..3 };
                for axis in along {
                    place.row_into(view, axes.column(axis).into(), self.rows.add())?;
                    self.surface.push(axes.column(axis).dot(&surface));
                }
            }
            (None, Some(view)) => {
                touch.row_into(at, view, self.rows.add())?;
                self.surface.push(0.0);
            }
            (_, None) => {}
        }
        let (own, rows, gap) = (*own, first..self.rows.len(), at.gap);
        let (velocity, drift) = (zero, zero);
        self.contacts.push(Contact { own, rows, gap, directions, normal, position, surface, velocity, drift });
        let last = self.contacts.len() - 1;
        Ok(&mut self.contacts[last])
    }

    /// A rigid contact, for accelerations. `drift`: (g̈, u̇) at q̈ = 0. Slip below `noise` has the direction that it began with.
    pub fn add_accelerated<A: Space>(
        &mut self,
        (own, touch): (&Lasting, &Touch),
        (at, view): (&At<A>, &View<A>),
        (qd, time): (&[f64], f64),
        (gap_drift, u_drift): (f64, Vector3<f64>),
        (noise, locked): (f64, bool),
    ) -> Result<(), SimError> {
        let view_of_row = (at.surface.is_some() || !locked).then_some(view);
        let added = self.add((own, touch), (at, view_of_row), time, Level::Velocities)?;
        let rows = added.rows.clone();
        if let Some(place) = at.surface {
            (added.velocity, added.drift) = (place.velocity(view, qd)?, u_drift);
        }
        let (u, axes) = (added.velocity - added.surface, added.directions);
        for row in rows.clone() {
            self.forces.add().copy_from_slice(self.rows.row(row));
        }
        if let (Some(axes), 3) = (axes, rows.len()) {
            self.drifts.extend(axes.columns(0, 2).column_iter().map(|axis| axis.dot(&u_drift)));
        }
        // The normal: the curvature of gap and surface.
        self.drifts.resize(rows.end, gap_drift);
        let friction = touch.contact.law.friction();
        match (own.hold, at.surface, axes) {
            (Hold::Slides { toward }, Some(place), _) if friction > 0.0 => {
                let d = lasting_direction(u, place.normal, toward, noise);
                self.skew(&place, view, place.normal - d * friction)
            }
            (Hold::Starts { toward }, Some(place), Some(axes)) => {
                for axis in 0..2 {
                    place.row_into(view, axes.column(axis).into(), self.tangents.add())?;
                }
                let along = |x: &Vector3<f64>| (axes.transpose() * x).xy();
                let (row, contact) = (rows.start, self.contacts.len() - 1);
                let (drift, along) = (along(&u_drift), along(&toward).normalize());
                self.starts.push(Start { contact, row, friction, axes, along, drift });
                self.skewed.push(row);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The force of the last contact, which has one row, is along this direction.
    fn skew<A: Space>(&mut self, place: &Place<A>, view: &View<A>, direction: Vector3<f64>) -> Result<(), SimError> {
        let row = self.rows.len() - 1;
        self.skewed.push(row);
        if let Some(directions) = self.contacts.last_mut().and_then(|contact| contact.directions.as_mut()) {
            directions.set_column(2, &direction);
        }
        let Some(force) = self.forces.iter_mut().nth(row) else { return Ok(()) };
        force.fill(0.0);
        place.row_into(view, direction, force)
    }

    /// The rows of the joints that dry friction holds.
    pub fn hold(&mut self, dry: &[DryJoint]) {
        for (k, joint) in dry.iter().enumerate().filter(|(_, joint)| joint.state == Dry::Holds) {
            for rows in [&mut self.rows, &mut self.forces] {
                rows.add()[joint.v] = 1.0;
            }
            self.surface.push(0.0);
            self.drifts.push(0.0);
            self.joints.push(k);
        }
    }

    /// R q̇ less the velocities of the surfaces: what the constraints make zero.
    pub fn excess(&self, qd: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.rows.len(), |i, _| self.rows.dot(i, qd) - self.surface[i])
    }

    /// R M⁻¹Rᵀ, from the responses M⁻¹Rᵀ: both triangles from one product, exactly symmetric.
    pub fn gram(&self, responses: &Rows) -> DMatrix<f64> {
        let m = self.rows.len();
        DMatrix::from_fn(m, m, |i, j| self.rows.dot(i.min(j), responses.row(i.max(j))))
    }

    /// The problem of impulses along these rows: with the velocities before and those without impulses, relative to the surfaces.
    pub fn problem(
        &self,
        responses: &Rows,
        laws: Vec<Constraint>,
        [u_minus, u_free]: [&DVector<f64>; 2],
    ) -> Result<SeveralProblem, SimError> {
        let problem = SeveralProblem::from_gram(self.gram(responses), u_minus.clone(), laws)?;
        Ok(problem.with_free_velocity(u_free.clone())?)
    }

    /// The smallest change x of velocities, in the metric of M, with R x = `errors`: M⁻¹Rᵀ π on independent rows.
    pub fn least(&self, responses: &Rows, errors: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; responses.iter().next().map_or(0, <[f64]>::len)];
        for (row, force) in self.least_forces(responses, errors) {
            x.iter_mut().zip(responses.row(row)).for_each(|(x, response)| *x += force * response);
        }
        x
    }

    /// π of [`Self::least`]: the independent rows with their forces or impulses.
    pub fn least_forces(&self, responses: &Rows, errors: &[f64]) -> impl Iterator<Item = (usize, f64)> {
        let basis = Basis::of(&self.rows.times(responses));
        let wanted = DMatrix::from_fn(basis.rows.len(), 1, |i, _| errors[basis.rows[i]]);
        let forces = basis.solve(&wanted).unwrap_or_default();
        basis.rows.into_iter().enumerate().map(move |(i, row)| (row, forces.get(i).copied().unwrap_or(0.0)))
    }

    /// The laws of the rows in a complementarity problem: of forces and accelerations, or of impulses and velocities, over a time `span` (1
    /// for forces) in which the force of dry friction has a bound. `before`: the relative velocities before the impact, by row;
    /// `None`: without restitution.
    pub fn laws(
        &self,
        sim: &Simulation,
        dry: &[DryJoint],
        span: f64,
        before: Option<&DVector<f64>>,
    ) -> Vec<Constraint> {
        let mut laws = Vec::new();
        for contact in &self.contacts {
            let law = &sim.touches[contact.own.touch].contact.law;
            let restitution = before.map_or(0.0, |u| law.restitution_at(-u[contact.rows.end - 1]));
            match contact.own.hold {
                Hold::Latched => laws.extend(contact.rows.clone().map(|_| Constraint::Held)),
                _ if contact.rows.len() == 3 => {
                    laws.push(Constraint::Contact { restitution, friction: law.friction() })
                }
                _ => laws.push(Constraint::Stop { restitution }),
            }
        }
        laws.extend(self.joints.iter().map(|&k| Constraint::Dry { bound: dry[k].friction * span }));
        laws
    }

    /// The stiffness of each of these [laws](Self::laws) relative to the others.
    pub fn stiffnesses(&self, sim: &Simulation) -> Vec<f64> {
        let of = |contact: &Contact| {
            let laws = if contact.own.hold == Hold::Latched { contact.rows.len() } else { 1 };
            std::iter::repeat_n(sim.touches[contact.own.touch].contact.relative_stiffness, laws)
        };
        self.contacts.iter().flat_map(of).chain(self.joints.iter().map(|_| 1.0)).collect()
    }

    /// The contact impulses, world axes, of these impulses on the rows.
    pub fn impulses(&self, impulse: &[f64]) -> Vec<ContactImpulse> {
        let surfaces = self.contacts.iter().filter(|contact| contact.directions.is_some());
        let one = |it: &Contact| ContactImpulse { touch: it.own.touch, point: it.position, impulse: it.force(impulse) };
        surfaces.map(one).collect()
    }
}

/// Adds the velocities M⁻¹Fᵀp, or accelerations M⁻¹Fᵀλ, from the responses M⁻¹Fᵀ.
pub(crate) fn push(v: &mut [f64], responses: &Rows, p: &[f64]) {
    for (response, p) in responses.iter().zip(p) {
        v.iter_mut().zip(response).for_each(|(v, x)| *v += x * p);
    }
}
