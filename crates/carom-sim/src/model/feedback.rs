//! Feedback along a motion, with gains over time.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | τ_r | nv | joint forces over time |
//! | K | nv×2nv | gains |
//! | r, ṙ | nq, nv | reference |
//! | h, s, x | 1 | length of an interval of the reference, share of it that has passed, share after its end (before its begin: negative) |
//! | δ, d | nv | displacement from the begin of the interval, and that of its end |

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, Part, State};
use super::gains::{Motor, motors};
use super::torques::TorqueTable;
use crate::error::{SimError, require};
use crate::state::{Space, next_of};
use carom_chain::{Chain, ChainError, Coordinates, JointInfo};
use nalgebra::{DMatrix, DVector};

/// Feedback of the whole state along a motion with impacts: `τ = τ_r + K (r − q, ṙ − q̇)` at the joints with one coordinate, where `r − q` is
/// the displacement from q to r.
///
/// The reference is divided by its impacts. The motion is compared with the part after as many impacts as it had, and each part goes on
/// beyond both its ends with constant acceleration (a part of one row with its velocity), so that a motion that strikes early or late is compared with the right part
/// (reference spreading: M. Rijnen, A. Saccon, H. Nijmeijer, *On optimal trajectory tracking for mechanical systems with unilateral
/// constraints*, 2015). Between its rows the reference is a cubic polynomial of the displacement with the velocities of the rows, and the gains are
/// linear. [`Plan::feedback`](crate::Plan::feedback) finds gains.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback {
    /// τ_r; `None`: zero.
    pub forces: Option<TorqueTable>,
    /// Ordered by the number of impacts, then by time.
    pub rows: Vec<FeedbackRow>,
}

/// The reference and the gains at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct FeedbackRow {
    /// Time, s.
    pub time: f64,
    /// Number of impacts before it, of all contacts and joint limits; an impact of several contacts has one of each of them.
    pub impacts: usize,
    /// Configuration and velocity.
    pub q: Vec<f64>,
    /// See `q`.
    pub qd: Vec<f64>,
    /// A row for each number of qd, of which those of floating and planar joints are not used; columns: displacement and velocity, 2 nv.
    /// N m/rad, N m s/rad, ….
    pub gains: DMatrix<f64>,
}

impl Feedback {
    /// The names of the columns of its table, after the time: `impacts`, `q.JOINT`, `qd.JOINT`, `gain.MOTOR.q.JOINT`, `gain.MOTOR.qd.JOINT`; of
    /// joints with several coordinates with their numbers, `q.base.0`. `MOTOR`: the joints with one coordinate.
    pub fn columns(chain: &Chain) -> Vec<String> {
        let displaced = coordinate_names(chain, "q", false);
        let [q, qd] = [coordinate_names(chain, "q", true), coordinate_names(chain, "qd", false)];
        let by: Vec<String> = displaced.into_iter().chain(qd.iter().cloned()).collect();
        let name =
            |motor: &Motor| chain.joint_of_velocity(motor.v).map_or_else(String::new, |joint| joint.name.clone());
        let gains = motors(chain).into_iter().flat_map(|motor| {
            let motor = name(&motor);
            by.iter().map(move |column| format!("gain.{motor}.{column}")).collect::<Vec<_>>()
        });
        std::iter::once("impacts".to_owned()).chain(q).chain(qd).chain(gains).collect()
    }

    /// The rows of its table, each with the time.
    pub fn table(&self, chain: &Chain) -> Vec<Vec<f64>> {
        let row = |own: &FeedbackRow| {
            let gains =
                motors(chain).into_iter().flat_map(|motor| own.gains.row(motor.v).iter().copied().collect::<Vec<_>>());
            let state = own.q.iter().chain(&own.qd).copied();
            [own.time, own.impacts as f64].into_iter().chain(state).chain(gains).collect()
        };
        self.rows.iter().map(row).collect()
    }

    /// The feedback of such a table: its times, and its other numbers.
    pub(crate) fn of_table(
        chain: &Chain,
        forces: Option<TorqueTable>,
        (times, rows): (Vec<f64>, Vec<Vec<f64>>),
    ) -> Self {
        let (nq, nv) = (chain.nq(), chain.nv());
        let row = |(time, numbers): (f64, Vec<f64>)| {
            let (state, by) = numbers.split_at(1 + nq + nv);
            let mut gains = DMatrix::zeros(nv, 2 * nv);
            motors(chain).iter().zip(by.chunks(2 * nv)).for_each(|(motor, by)| {
                gains.row_mut(motor.v).iter_mut().zip(by).for_each(|(gain, by)| *gain = *by);
            });
            let (q, qd) = (state[1..=nq].to_vec(), state[1 + nq..].to_vec());
            FeedbackRow { time, impacts: state[0] as usize, q, qd, gains }
        };
        Self { forces, rows: times.into_iter().zip(rows).map(row).collect() }
    }

    /// Whether it does not depend on time explicitly: each part has one state, at rest, and the same gains throughout.
    pub(crate) fn is_steady(&self) -> bool {
        let same = |pair: &[FeedbackRow]| {
            let [a, b] = pair else { return true };
            a.impacts != b.impacts || (&a.q, &a.gains) == (&b.q, &b.gains)
        };
        let rests = self.rows.iter().all(|row| row.qd.iter().all(|v| *v == 0.0));
        rests && self.rows.windows(2).all(same) && self.forces.as_ref().is_none_or(TorqueTable::is_steady)
    }

    /// The rows of the part after so many impacts.
    fn part(&self, impacts: usize) -> &[FeedbackRow] {
        let rows = &self.rows;
        let until = rows.partition_point(|row| row.impacts <= impacts.max(rows[0].impacts));
        let own = rows[until - 1].impacts;
        &rows[rows.partition_point(|row| row.impacts < own)..until]
    }

    /// The deviation (r − q, ṙ − q̇) after so many impacts, and the gains.
    fn at(
        &self,
        chain: &Chain,
        (time, impacts): (f64, usize),
        (q, qd): State,
    ) -> Result<(DVector<f64>, DMatrix<f64>), ChainError> {
        let part = self.part(impacts);
        let end = part.partition_point(|row| row.time <= time).min(part.len() - 1).max(1);
        let a = &part[end - 1];
        let b = part.get(end).unwrap_or(a);
        let h = if part.len() == 1 { 1.0 } else { b.time - a.time };
        let d = DVector::from_vec(chain.difference(&a.q, &b.q)?);
        let [u, v] = [a, b].map(|row| DVector::from_column_slice(&row.qd) * h);
        let s = (time - a.time) / h;
        let (from, moved, rate) = if part.len() == 1 {
            (a, &u * s, u)
        } else if s < 0.0 {
            let bend = &d * 6.0 - &u * 4.0 - &v * 2.0;
            (a, &u * s + &bend * (s * s / 2.0), u + bend * s)
        } else if s <= 1.0 {
            let moved = &d * (s * s * (3.0 - 2.0 * s)) + &u * (s * (1.0 - s).powi(2)) - &v * (s * s * (1.0 - s));
            let rate = d * (6.0 * s * (1.0 - s)) + u * ((1.0 - s) * (1.0 - 3.0 * s)) + v * (s * (3.0 * s - 2.0));
            (a, moved, rate)
        } else {
            let (x, bend) = (s - 1.0, &u * 2.0 + &v * 4.0 - &d * 6.0);
            (b, &v * x + &bend * (x * x / 2.0), v + bend * x)
        };
        let r = chain.integrate(&from.q, moved.as_slice(), 1.0)?;
        let displacement = chain.difference(q, &r)?;
        let slower = rate.iter().zip(qd).map(|(rate, qd)| rate / h - qd);
        let share = s.clamp(0.0, 1.0);
        let gains = &a.gains * (1.0 - share) + &b.gains * share;
        Ok((DVector::from_vec(displacement.into_iter().chain(slower).collect()), gains))
    }
}

/// `head.JOINT`, or `head.JOINT.K` of a joint with several coordinates: of q (`positions`) or qd.
pub fn coordinate_names(chain: &Chain, head: &str, positions: bool) -> Vec<String> {
    let of = |joint: &JointInfo| {
        let count = match &joint.coordinates {
            Coordinates::Own { q, v } => {
                if positions {
                    q.len()
                } else {
                    v.len()
                }
            }
            _ => 0,
        };
        let name =
            |k: usize| if count == 1 { format!("{head}.{}", joint.name) } else { format!("{head}.{}.{k}", joint.name) };
        (0..count).map(name).collect::<Vec<_>>()
    };
    chain.joints().iter().flat_map(of).collect()
}

impl ControlLaw for Feedback {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        self.forces.as_mut().map_or_else(Vec::new, TorqueTable::parts)
    }

    fn check(&self, robot: &Driven) -> Result<(), SimError> {
        let (nq, nv) = (robot.chain.nq(), robot.chain.nv());
        let count = self.rows.len();
        require(count > 0, "number of rows of the feedback", count as f64, "it must have a row")?;
        if let Some(forces) = &self.forces {
            forces.check(robot)?;
        }
        for row in &self.rows {
            let FeedbackRow { time, q, qd, gains, .. } = row;
            robot.chain.check_state(q, qd)?;
            let rule = "a row needs nq and nv numbers, and nv times 2 nv gains";
            let fits = q.len() == nq && qd.len() == nv && gains.shape() == (nv, 2 * nv);
            require(fits, "row of the feedback at the time", *time, rule)?;
            let finite = time.is_finite() && gains.iter().all(|gain| gain.is_finite());
            require(finite, "row of the feedback at the time", *time, "its numbers must be finite")?;
        }
        let order = "rows must ascend by the number of impacts, and of the same number by time";
        for pair in self.rows.windows(2) {
            let key = |row: &FeedbackRow| (row.impacts, row.time);
            require(key(&pair[0]) < key(&pair[1]), "time of the feedback", pair[1].time, order)?;
        }
        Ok(())
    }

    fn next_kink(&self, time: f64) -> Option<f64> {
        // Of all parts: which one counts is not known here.
        let rows = self.rows.chunk_by(|a, b| a.impacts == b.impacts).filter_map(|part| {
            let next = part.partition_point(|row| row.time <= time);
            part.get(next).map(|row| row.time)
        });
        let forces = self.forces.as_ref().and_then(|own| next_of(&own.times, time));
        rows.chain(forces).reduce(f64::min)
    }

    fn drive<A: Space>(&self, asked: &Asked, body: Body<A>, state: State, add: Add) -> Result<(), SimError> {
        if let Some(forces) = &self.forces {
            forces.drive::<A>(asked, body, state, add)?;
        }
        let (deviation, gains) = self.at(asked.chain, (asked.time, asked.impacts.iter().sum()), state)?;
        let forces = gains * deviation;
        asked.motors.iter().for_each(|&Motor { v, .. }| add(v, forces[v]));
        Ok(())
    }

    fn gains(&self, v: usize) -> (f64, f64) {
        let most = |column: usize| self.rows.iter().map(|row| row.gains[(v, column)]).fold(0.0, f64::max);
        (most(v), most(self.rows[0].qd.len() + v))
    }
}
