//! The rows of closed contacts and of joints that dry friction holds, at one state.

use super::lasting::{Dry, DryJoint, Hold, Lasting};
use crate::contact::{At, Touch};
use crate::error::SimError;
use crate::state::{Space, View};
use carom_chain::Rows;
use carom_chain::algebra::z_onto;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::ops::Range;

/// Constraints at one state: R q̈ + drift = 0, with forces along the rows F.
#[derive(Debug, Clone, Default)]
pub(crate) struct Constraints {
    /// R.
    pub rows: Rows,
    /// F: differs from R where a contact slides with friction.
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
    /// The contact as it was assembled.
    pub own: Lasting,
    pub rows: Range<usize>,
    /// World direction of the force of each row, the last that of the normal (n − μ d if it slides); `None` for a joint limit.
    pub directions: Option<Matrix3<f64>>,
    /// Unit normal and contact point, world.
    pub normal: Vector3<f64>,
    pub position: Vector3<f64>,
    /// J q̇, m/s.
    pub velocity: Vector3<f64>,
    /// Velocity of the surface at the contact point, m/s.
    pub surface: Vector3<f64>,
    /// u̇ at q̈ = 0.
    pub drift: Vector3<f64>,
}

impl Contact {
    /// The force on the robot, world, N, of the forces along the rows; zero for a joint limit.
    pub fn force(&self, lambda: &[f64]) -> Vector3<f64> {
        self.directions.map_or_else(Vector3::zeros, |directions| along(&directions, &lambda[self.rows.clone()]))
    }

    /// The vector in the tangent plane, world, with these components along the first two rows; zero for a joint limit.
    pub fn tangential(&self, along: &[f64]) -> Vector3<f64> {
        let Some(directions) = &self.directions else { return Vector3::zeros() };
        along.iter().take(2).enumerate().map(|(k, x)| directions.column(k) * *x).sum()
    }
}

/// The vector with these components along the last columns: three of a contact with tangents, one of the normal alone.
pub(crate) fn along(directions: &Matrix3<f64>, components: &[f64]) -> Vector3<f64> {
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
        self.forces.clear();
        self.skewed.clear();
        self.drifts.clear();
        self.contacts.clear();
        self.starts.clear();
        self.tangents.clear();
        self.joints.clear();
    }

    /// The rows of a rigid contact; none for the limit of a joint that is `locked`. `drift`: (g̈, u̇) at q̈ = 0. Slip below `noise` has
    /// the direction that it began with.
    pub fn add<A: Space>(
        &mut self,
        (own, touch): (&Lasting, &Touch),
        (at, view): (&At<A>, &View<A>),
        (qd, time): (&[f64], f64),
        drift: (f64, Vector3<f64>),
        (noise, locked): (f64, bool),
    ) -> Result<(), SimError> {
        let first = self.rows.len();
        let (gap_drift, u_drift) = drift;
        let Some(place) = at.surface else {
            // A joint that is locked has no row.
            if !locked {
                touch.row_into(at, view, self.rows.add())?;
                self.forces.add().copy_from_slice(self.rows.row(first));
                self.drifts.push(gap_drift);
            }
            let zero = Vector3::zeros();
            self.contacts.push(Contact {
                own: *own,
                rows: first..self.rows.len(),
                directions: None,
                normal: zero,
                position: zero,
                velocity: zero,
                surface: zero,
                drift: zero,
            });
            return Ok(());
        };
        let normal = place.normal;
        let velocity = place.velocity(view, qd)?;
        let surface = touch.surface_velocity(&place, time);
        let u = velocity - surface;
        let mut directions = z_onto(normal);
        if let Hold::Slides { toward } = own.hold {
            let mu = touch.contact.law.friction();
            place.row_into(view, normal, self.rows.add())?;
            if mu > 0.0 {
                let d = lasting_direction(u, normal, toward, noise);
                directions.set_column(2, &(normal - d * mu));
                place.row_into(view, directions.column(2).into(), self.forces.add())?;
                self.skewed.push(first);
            } else {
                self.forces.add().copy_from_slice(self.rows.row(first));
            }
            self.drifts.push(gap_drift);
        } else if let Hold::Starts { toward } = own.hold {
            let friction = touch.contact.law.friction();
            place.row_into(view, normal, self.rows.add())?;
            self.forces.add().copy_from_slice(self.rows.row(first));
            self.drifts.push(gap_drift);
            for axis in 0..2 {
                place.row_into(view, directions.column(axis).into(), self.tangents.add())?;
            }
            let along = |x: &Vector3<f64>| (directions.transpose() * x).xy();
            let (row, contact, axes) = (first, self.contacts.len(), directions);
            let (drift, toward) = (along(&u_drift), along(&toward).normalize());
            self.starts.push(Start { contact, row, friction, axes, along: toward, drift });
            self.skewed.push(first);
        } else {
            for axis in directions.column_iter() {
                place.row_into(view, axis.into(), self.rows.add())?;
                self.forces.add().copy_from_slice(self.rows.row(self.rows.len() - 1));
                self.drifts.push(axis.dot(&u_drift));
            }
            // The curvature of gap and surface.
            if let Some(last) = self.drifts.last_mut() {
                *last = gap_drift;
            }
        }
        let rows = first..self.rows.len();
        let (directions, position) = (Some(directions), place.position);
        self.contacts.push(Contact {
            own: *own,
            rows,
            directions,
            normal,
            position,
            velocity,
            surface,
            drift: u_drift,
        });
        Ok(())
    }

    /// R q̇ less the velocities of the surfaces: what the constraints make zero.
    pub fn excess(&self, qd: &[f64]) -> Vec<f64> {
        let mut excess: Vec<f64> = (0..self.rows.len()).map(|i| self.rows.dot(i, qd)).collect();
        for contact in &self.contacts {
            let Some(directions) = &contact.directions else { continue };
            let own = &mut excess[contact.rows.clone()];
            let last = own.len() - 1;
            own[last] -= contact.normal.dot(&contact.surface);
            for (k, excess) in own[..last].iter_mut().enumerate() {
                *excess -= directions.column(k).dot(&contact.surface);
            }
        }
        excess
    }

    /// The rows of the joints that dry friction holds.
    pub fn hold(&mut self, dry: &[DryJoint]) {
        for (k, joint) in dry.iter().enumerate().filter(|(_, joint)| joint.state == Dry::Holds) {
            for rows in [&mut self.rows, &mut self.forces] {
                rows.add()[joint.v] = 1.0;
            }
            self.drifts.push(0.0);
            self.joints.push(k);
        }
    }
}
