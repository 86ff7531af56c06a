//! Gaps of touches, their rates and rows, at one state.

use super::pair::{APART, Pair};
use super::touch::{Touch, TouchKind};
use crate::error::SimError;
use crate::state::{Felt, Space, View};
use carom_chain::algebra::{Pose, z_onto};
use carom_chain::{FrameId, Point, Rows, Spatial};
use carom_contact::{Gap, Met};
use nalgebra::{DVector, MatrixXx3, Vector3};

/// A touch at one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct At<A: Space> {
    pub gap: f64,
    /// How far the contact point is inside the faces and edges that touch, m: see [`Met::margin`].
    pub margin: f64,
    /// Contact point on the robot, and unit normal from the environment to the robot, world; `None` for joint limits.
    pub surface: Option<Place<A>>,
}

impl<A: Space> At<A> {
    /// Whether the parts face each other: otherwise the gap means nothing.
    pub fn counts(&self) -> bool {
        self.margin >= -Met::OUTSIDE
    }
}

/// Contact point and normal of a touch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place<A: Space> {
    pub point: Point<A>,
    /// The contact point of the second link of a pair.
    pub against: Option<Point<A>>,
    pub position: Vector3<f64>,
    pub normal: Vector3<f64>,
}

impl<A: Space> Place<A> {
    /// Adds nᵀJ to `row`, without entries that are rounding.
    pub fn row_into(&self, view: &View<A>, n: Vector3<f64>, row: &mut [f64]) -> Result<(), SimError> {
        view.add_row(self.point, n, row)?;
        if let Some(other) = self.against {
            view.add_row(other, -n, row)?;
        }
        view.kin.clear_rounding(self.position.norm(), n.norm(), row);
        Ok(())
    }

    /// J qd, m/s.
    pub fn velocity(&self, view: &View<A>, qd: &[f64]) -> Result<Vector3<f64>, SimError> {
        let own = view.velocity(self.point, qd)?;
        Ok(match self.against {
            Some(other) => own - view.velocity(other, qd)?,
            None => own,
        })
    }

    /// Delassus matrix and response; `None` if no joint moves the contact point along the normal.
    pub fn inertia(&self, view: &mut View<A>) -> Result<Option<Felt>, SimError> {
        let axes = z_onto(self.normal);
        let mut rows = Rows::new(view.kin.chain().nv());
        for axis in axes.column_iter() {
            self.row_into(view, axis.into(), rows.add())?;
        }
        if is_zero(rows.row(2)) {
            return Ok(None);
        }
        if self.against.is_none() && view.couplings.is_empty() {
            return view.inertia(self.point, self.normal);
        }
        let mut responses = Rows::default();
        view.respond(&rows, &mut responses)?;
        let columns = [0, 1, 2].map(|k| DVector::from_column_slice(responses.row(k)));
        let response = MatrixXx3::from_columns(&columns);
        // H = Xᵀ M X: what loops leave of H may be small beside J M⁻¹ Jᵀ, and so far below its rounding.
        let delassus = response.tr_mul(&(view.kin.mass_matrix() * &response)).fixed_view::<3, 3>(0, 0).into_owned();
        Ok((delassus.m33 > 0.0).then(|| (axes * delassus * axes.transpose(), response * axes.transpose())))
    }
}

/// Whether no joint moves along a row.
fn is_zero(row: &[f64]) -> bool {
    row.iter().all(|entry| *entry == 0.0)
}

/// A ball and a half-space with precomputed constants: g = n·x + h − r − n·s for the centre x. The contact point is the one
/// below the centre; ω × its arm has no component along n, so ġ = n·(ẋ − ṡ).
#[derive(Debug, Clone, Copy)]
pub(crate) struct BallOnPlane<A: Space> {
    /// The centre.
    centre: Point<A>,
    /// n in the algebra of the chain.
    normal: A::Vector,
    /// h: the constant part of the height of the centre over the plane.
    height: f64,
    /// r: stored apart from h, so that it is not rounded with h.
    radius: f64,
}

impl Touch {
    /// Displacement, velocity and acceleration of the surface.
    pub(crate) fn shift(&self, time: f64) -> [Vector3<f64>; 3] {
        self.motion.as_ref().map_or([Vector3::zeros(); 3], |motion| motion.shift(time))
    }

    /// Velocity of the material of the surface at a contact point.
    pub(crate) fn surface_velocity<A: Space>(&self, place: &Place<A>, time: f64) -> Vector3<f64> {
        let moving = self.motion.as_ref();
        moving.map_or_else(Vector3::zeros, |motion| motion.velocity(time, place.position, place.normal))
    }

    /// The touch with a surface whose motion is continued smoothly near a time; `None` if its motion has no table.
    pub(crate) fn near(&self, time: f64) -> Option<Self> {
        let motion = self.motion.as_ref()?.near(time)?;
        Some(Self { motion: Some(motion), ..self.clone() })
    }

    /// The pose of a link frame relative to the displaced surface.
    fn seen<A: Space>(&self, view: &View<A>, frame: FrameId, shift: Vector3<f64>) -> Pose<Spatial<f64>> {
        let mut pose = view.pose(frame);
        pose.translation -= shift;
        pose
    }

    /// Gap, contact point and normal at a state.
    pub(crate) fn at<A: Space>(&self, view: &View<A>, q: &[f64], time: f64) -> At<A> {
        let [shift, ..] = self.shift(time);
        match &self.kind {
            TouchKind::Ball { shape, centre, radius, point, normal } => {
                let centre = self.seen(view, shape.frame(), shift).point(*centre);
                let height = normal.dot(&(centre - point));
                let position = centre - normal * *radius + shift;
                let place =
                    Place { point: view.point(shape.frame(), position), against: None, position, normal: *normal };
                At { gap: height - radius, margin: f64::INFINITY, surface: Some(place) }
            }
            TouchKind::Pair { pair, part } => match part {
                Some(part) => {
                    let met = pair.met(*part, view, shift);
                    At { margin: met.margin, ..place(pair, view, met.gap) }
                }
                None => place(pair, view, pair.nearest(view, shift)),
            },
            TouchKind::Limit { q: at, bound, slope, .. } => {
                At { gap: slope * (q[*at] - bound), margin: f64::INFINITY, surface: None }
            }
        }
    }

    /// The precomputed constants for [`Touch::look`]; `None` for other pairs than a ball and a half-space.
    pub(crate) fn ball_on_plane<A: Space>(&self, model: &A::Model) -> Option<BallOnPlane<A>> {
        let TouchKind::Ball { shape, centre, radius, point, normal } = &self.kind else { return None };
        let (centre, beside) = A::material_point(model, shape.frame(), *centre);
        let height = normal.dot(&(beside - point));
        Some(BallOnPlane { centre, normal: A::project(model, *normal), height, radius: *radius })
    }

    /// g and ġ; [`APART`] where the parts do not face each other.
    pub(crate) fn look<A: Space>(
        &self,
        ball: Option<&BallOnPlane<A>>,
        view: &View<A>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
    ) -> Result<(f64, f64), SimError> {
        match (ball, &self.kind) {
            (Some(ball), TouchKind::Ball { normal, .. }) => {
                let [shift, velocity, _] = self.shift(time);
                let height = A::dot(ball.normal, view.kin.position(ball.centre)) + ball.height;
                let gap = height - ball.radius - normal.dot(&shift);
                let rate = A::dot(ball.normal, view.kin.point_velocity(ball.centre, qd)?) - normal.dot(&velocity);
                Ok((gap, rate))
            }
            _ => {
                let at = self.at(view, q, time);
                if !at.counts() {
                    return Ok(APART);
                }
                Ok((at.gap, self.rate(&at, view, qd, time)?))
            }
        }
    }

    /// All points of the pair with gaps of at most `within`; for the nearest points of bodies that can touch at several points
    /// also their corners.
    pub(crate) fn points<A: Space>(&self, view: &View<A>, q: &[f64], time: f64, within: f64) -> Vec<At<A>> {
        let mut points = match &self.kind {
            TouchKind::Pair { pair, part: None } => {
                let [shift, ..] = self.shift(time);
                pair.points(view, shift).into_iter().map(|found| place(pair, view, found)).collect()
            }
            _ => vec![self.at(view, q, time)],
        };
        points.retain(|at| at.gap <= within && at.counts());
        points
    }

    /// ġ.
    pub(crate) fn rate<A: Space>(&self, at: &At<A>, view: &View<A>, qd: &[f64], time: f64) -> Result<f64, SimError> {
        match at.surface {
            Some(place) => Ok(place.normal.dot(&self.u(&place, view, qd, time)?)),
            None => Ok(self.stops().map_or(0.0, |(v, slope)| slope * qd[v])),
        }
    }

    /// u.
    pub(crate) fn u<A: Space>(
        &self,
        place: &Place<A>,
        view: &View<A>,
        qd: &[f64],
        time: f64,
    ) -> Result<Vector3<f64>, SimError> {
        Ok(place.velocity(view, qd)? - self.surface_velocity(place, time))
    }

    /// Adds the row j to `row`.
    pub(crate) fn row_into<A: Space>(&self, at: &At<A>, view: &View<A>, row: &mut [f64]) -> Result<(), SimError> {
        match at.surface {
            Some(place) => place.row_into(view, place.normal, row)?,
            None => self.stops().into_iter().for_each(|(v, slope)| row[v] += slope),
        }
        Ok(())
    }

    /// Whether some joint moves it along its normal. Otherwise no force of the contact changes the motion, and its gap does not change to
    /// first order: it has no row. A latch holds along the surface, too.
    pub(crate) fn moves<A: Space>(&self, at: &At<A>, view: &mut View<A>) -> Result<bool, SimError> {
        if self.contact.latch {
            return Ok(true);
        }
        let (mut row, mut response) = (Rows::new(view.kin.chain().nv()), Rows::default());
        self.row_into(at, view, row.add())?;
        if is_zero(row.row(0)) || view.couplings.is_empty() {
            return Ok(!is_zero(row.row(0)));
        }
        view.respond(&row, &mut response)?;
        Ok(row.dot(0, response.row(0)) > 0.0)
    }

    /// Whether its contact point can leave the faces and edges that touch.
    pub(crate) fn ends(&self) -> bool {
        matches!(&self.kind, TouchKind::Pair { pair, part: Some(part) } if pair.ends(*part))
    }

    /// (g̈, u̇) at q̈ = 0 in closed form; `None` for pairs that need finite differences. `drifts`: the accelerations of both
    /// contact points as material points.
    ///
    /// The contact points of parts move on their bodies by α and β: u̇ is the difference of the accelerations of the material
    /// points plus ω × α − ω′ × β, and g̈ = n·u̇ + ṅ·u.
    ///
    /// For a ball on a plane with centre c, g̈ = n·(c̈ − s̈). The contact point stays below the centre, so u̇ is without the
    /// term ω × (ω × r) of the material point, r = −n radius.
    pub(crate) fn drift<A: Space>(
        &self,
        at: &At<A>,
        view: &View<A>,
        drifts: [Vector3<f64>; 2],
        qd: &[f64],
        time: f64,
    ) -> Result<Option<(f64, Vector3<f64>)>, SimError> {
        let Some(place) = at.surface else { return Ok(Some((0.0, Vector3::zeros()))) };
        match &self.kind {
            TouchKind::Ball { shape, radius, normal, .. } => {
                let turning = view.angular_velocity(shape.frame(), qd)?;
                let arm = -normal * *radius;
                let mut u = drifts[0] - turning.cross(&turning.cross(&arm));
                if let Some(motion) = &self.motion {
                    let rate = view.velocity(place.point, qd)? - turning.cross(&arm);
                    u -= motion.acceleration(time, (place.position, rate), *normal);
                }
                Ok(Some((normal.dot(&u), u)))
            }
            TouchKind::Pair { pair, part: Some(part) } => {
                let [shift, speed, acceleration] = self.shift(time);
                let turning = pair.turning(view, qd)?;
                let own_velocity = place.velocity(view, qd)?;
                // Relative to the shape of the surface, which a belt does not move.
                let u = own_velocity - speed;
                let Some(slide) = pair.slide(*part, view, shift, turning, u) else {
                    return Ok(Some((0.0, Vector3::zeros())));
                };
                let own = drifts[0] + turning[0].cross(&slide.on_robot);
                let other = match place.against {
                    Some(_) => drifts[1] + turning[1].cross(&slide.on_environment),
                    None => acceleration,
                };
                let gap_drift = place.normal.dot(&(own - other)) + slide.normal_rate.dot(&u);
                let material = self.motion.as_ref().map_or(other, |motion| {
                    let rate = own_velocity + slide.on_robot;
                    motion.acceleration(time, (place.position, rate), place.normal)
                });
                Ok(Some((gap_drift, own - material)))
            }
            _ => Ok(None),
        }
    }
}

/// The contact at given points of a pair.
fn place<A: Space>(pair: &Pair, view: &View<A>, found: Gap) -> At<A> {
    let against = pair.other().map(|other| view.point(other.frame(), found.on_environment));
    let (point, normal) = (view.point(pair.shape.frame(), found.on_robot), found.normal);
    let place = Place { point, against, position: found.on_robot, normal };
    At { gap: found.distance, margin: f64::INFINITY, surface: Some(place) }
}
