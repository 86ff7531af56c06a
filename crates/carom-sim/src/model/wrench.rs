//! Forces and torques on links from outside.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | f, t | 3 | force and torque about the point, world axes |
//! | a | 3 | a unit vector perpendicular to t |
//!
//! The torque acts as a couple: the force t × a at the point displaced by a, and its opposite at the point itself, because
//! a × (t × a) = t (a·a) − a (a·t) = t. So joint forces need the Jacobians of points only; and in the plane, where a and
//! t × a are projected, the moment about the normal of the plane stays n·(a × (t × a)) = n·t.

use crate::error::{SimError, require};
use crate::state::{Profile, Space, View};
use carom_chain::{Chain, FrameId};
use nalgebra::Vector3;
use serde::Deserialize;

/// A force and a torque that act on a link from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Wrench {
    /// The link.
    pub link: String,
    /// The point at which the force acts and to which the torque refers, in the axes of the link, m.
    pub point: Vector3<f64>,
    /// The axes of the numbers in `load`.
    pub axes: WrenchAxes,
    /// Force and torque over time.
    pub load: Load,
}

/// The axes in which a [`Wrench`] is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WrenchAxes {
    /// World axes: the direction stays while the link turns.
    #[default]
    World,
    /// The axes of the link: the direction turns with it.
    Body,
}

/// Force and torque over time.
#[derive(Debug, Clone, PartialEq)]
pub enum Load {
    /// The same at all times.
    Constant {
        /// N.
        force: Vector3<f64>,
        /// N m.
        torque: Vector3<f64>,
    },
    /// Force (N), then torque (N m): linear between the rows, zero before the first and after the last row. The integration
    /// stops and starts again at the time of every row.
    Table(Profile<6>),
}

impl Load {
    /// Force and torque at a time.
    fn at(&self, time: f64) -> [Vector3<f64>; 2] {
        match self {
            Self::Constant { force, torque } => [*force, *torque],
            Self::Table(profile) => {
                let times = profile.times();
                if !(times[0]..times[times.len() - 1]).contains(&time) {
                    return [Vector3::zeros(); 2];
                }
                let [fx, fy, fz, tx, ty, tz] = profile.at(time);
                [Vector3::new(fx, fy, fz), Vector3::new(tx, ty, tz)]
            }
        }
    }
}

impl Wrench {
    /// # Errors
    /// [`SimError`]: an unknown link, numbers that are not finite.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), SimError> {
        chain.frame(&self.link)?;
        let load = match &self.load {
            Load::Constant { force, torque } => [*force, *torque],
            Load::Table(_) => Default::default(),
        };
        let numbers = self.point.iter().chain(load.iter().flat_map(|vector| vector.iter()));
        numbers.into_iter().try_for_each(|&x| require(x.is_finite(), "number of a wrench", x, "it must be finite"))
    }

    /// Whether it does not depend on time after `time`.
    pub(crate) fn is_steady(&self, time: f64) -> bool {
        self.next_kink(time).is_none()
    }

    /// Whether it is a table that is zero from 0 s to `end`.
    pub(crate) fn is_idle(&self, end: f64) -> bool {
        let Load::Table(profile) = &self.load else { return false };
        profile.times().windows(2).all(|pair| {
            let (from, until) = (pair[0].max(0.0), pair[1].min(end));
            // What is linear and zero at two times is zero between the rows.
            let zero = |share: &f64| self.load.at(from + share * (until - from)) == [Vector3::zeros(); 2];
            from >= until || [0.25, 0.5].iter().all(zero)
        })
    }

    /// The next time at which it jumps or its rate changes.
    pub(crate) fn next_kink(&self, time: f64) -> Option<f64> {
        match &self.load {
            Load::Constant { .. } => None,
            Load::Table(profile) => profile.next_kink(time),
        }
    }

    /// Adds its joint forces to `tau`.
    pub(crate) fn push<A: Space>(
        &self,
        frame: FrameId,
        view: &View<A>,
        time: f64,
        tau: &mut [f64],
    ) -> Result<(), SimError> {
        let pose = view.pose(frame);
        let [mut force, mut torque] = self.load.at(time);
        if self.axes == WrenchAxes::Body {
            (force, torque) = (pose.rotation * force, pose.rotation * torque);
        }
        let place = pose.point(self.point);
        view.add_row(view.point(frame, place), force, tau)?;
        if torque != Vector3::zeros() {
            let axis = Vector3::ith(torque.iamin(), 1.0);
            let arm = (axis - torque * (torque.dot(&axis) / torque.norm_squared())).normalize();
            let pull = torque.cross(&arm);
            view.add_row(view.point(frame, place + arm), pull, tau)?;
            view.add_row(view.point(frame, place), -pull, tau)?;
        }
        Ok(())
    }
}
