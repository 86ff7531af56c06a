//! Impact maps from a study file: what varies, and what is wanted, written in TOML.
//!
//! ```toml
//! [robot]
//! urdf = "../robots/planar2.urdf"          # relative to the study file
//!
//! [joints]                                  # where the arm is: a grid of joint positions …
//! shoulder = { from = -90, to = 90, count = 181, unit = "deg" }
//! elbow = { from = -170, to = 170, count = 341, unit = "deg" }
//!
//! [impact]
//! normal = [-1, 0, 0]                       # world, from the environment to the robot
//! along = [0, -1, 0]
//! approach_deg = 45
//! speed = 0.2
//! law = "energetic"
//! restitution = 0.35
//! friction = 0.2
//!
//! [map]
//! quantities = ["tangential_jump", "impulse"]
//! ```
//!
//! | table | keys, with what they are without being given |
//! | --- | --- |
//! | `[robot]` | `urdf`, `tip = "tip"`, `point = [0, 0, 0]` (from the tip's origin, in its axes), `limits = true`: poses outside the joints' limits are rows without numbers |
//! | `[joints]` | every moving joint, rad or m |
//! | `[tip]` | instead of `[joints]`: the tip's world `x`, `y`, `z`, m (those left out are free); for two links in the plane `elbow = "both"`, `"up"` or `"down"`; for other arms `seeds = [[q …], …]` from which poses are sought, one row each |
//! | `[impact]` | `normal` (one, or a list) or `normal_deg` (in the plane's axes); `along`: the direction that the tangential quantities count along (in the plane it may be left out: then the normal turned by +90°); `approach_deg`: angle between the tip's path and the surface, 90 straight on, above 90 against `along`; `speed` m/s; `law` (one, or a list); `restitution`, `friction = 0`, `tangential_restitution` |
//! | `[map]` | `quantities`, see below |
//! | `[advise]` | `minimise` or `maximise` (a quantity), `class = […]`, `at_most = { quantity = x }`, `at_least`, `best = 5` |
//!
//! Numbers may be a number, a list, or `{ from, to, count }` with both ends included. The joint velocities before the impact
//! are those of least kinetic energy that move the tip as asked.
//!
//! | quantity | meaning |
//! | --- | --- |
//! | `class` | always there: what became of the row (below) |
//! | `tangential_jump`, `tangential_after`, `tangential_ratio` | along the surface: u_t⁺ − u_t⁻, u_t⁺ (m/s), u_t⁺/u_t⁻ |
//! | `normal_after` | u_n⁺, m/s |
//! | `impulse`, `normal_impulse`, `tangential_impulse` | its size and its parts on the robot, N s |
//! | `effective_mass`, `locked_mass` | 1/(nᵀHn) of the free chain, and with its joints locked, kg |
//! | `coupling` | h = −H_tn/H_nn: without friction the tangential jump is −(1+e) h times the approach speed |
//! | `energy_loss`, `energy_ratio` | T⁻ − T⁺, J, and T⁺/T⁻ of the whole chain |
//! | `joint_jump` | greatest \|Δqd\|, rad/s or m/s |
//! | `limit_share`, `limit_joint` | greatest \|Δqd\| as a share of the URDF's velocity limit, and whose it is |
//! | `impact_ellipse` | semi-axes of the impulses with \|Δqd\| = 1 (Walker 1994): `.long`, `.short`, `.angle_deg` of the long one in the plane; `.long`, `.middle`, `.short` in space |
//! | `mode`, `flags` | as the law says |
//! | `mode_margin`, `mode_edge`, `mode_beyond` | how near the nearest boundary of the mode is, from 0 on it to 1; which one, and the mode beyond: [`carom_impact::Boundary`], as `carom impact --derivatives` says |
//! | `boundary_friction`, `boundary_restitution`, `boundary_approach_deg` | by how much μ, e or the approach angle (degrees) alone would have to change until the mode is another: signed, the nearest of both sides; NaN if it never is (μ up to 81). Found by asking the law in steps of a 128th of the range (of μ: of the friction angle) and bisection; costs some hundred impacts each |
//! | `position` | the tip in the world, m |
//! | `qd_minus`, `qd_plus` | joint velocities, a column for each joint |
//!
//! | class | the row |
//! | --- | --- |
//! | `unreachable`, `outside-limits` | has no pose, or one that the joints' limits forbid |
//! | `singular` | has a pose in which no joint motion moves the tip so, or along the normal |
//! | `refused`, `no-impact` | the law has no answer; the tip does not approach |
//! | `stick`, `starts` | the tip ends without slip; begins to slip out of a straight approach |
//! | `shrinks`, `keeps`, `grows`, `reverses` | tangential velocity |
//!
//! A row without numbers holds NaN. A row is a function of its number alone: [`Study::evaluator`] gives any row at any time,
//! so shards, threads and interruptions change no digit.
//!
//! I. D. Walker, *Impact configurations and measures for kinematically redundant and multiple armed robot systems*, IEEE
//! Trans. Robotics and Automation 10 (1994) 670.

mod advise;
mod arm;
mod axis;
mod boundary;
mod file;
mod picture;
mod quantity;
mod reach;
mod read;
mod strike;
mod surface;
mod write;

pub use advise::{Advice, Advised};
pub use axis::Axis;
pub use picture::Values;
pub use quantity::CLASSES;
pub use write::{MapFile, Written};

use crate::{Column, TableError};
use arm::{Engine, Worker};
use carom_chain::Chain;
use nalgebra::Vector3;
use std::io;
use std::ops::Range;
use std::path::PathBuf;

/// What is wrong with a study, or with what it writes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The study file breaks a rule.
    #[error("{file}: {rule}")]
    File {
        /// The file.
        file: String,
        /// Key, value, rule, and what to do.
        rule: String,
    },
    /// The robot's file, which names itself.
    #[error(transparent)]
    Robot(carom_chain::ChainError),
    /// The map can't be written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// What an interrupted run left can't be gone on with.
    #[error("{}: the interrupted run can't be resumed: {reason}", file.display())]
    Resume {
        /// The file that was looked at.
        file: PathBuf,
        /// Why not, and what to do.
        reason: String,
    },
    /// A file beside the map can't be written or read.
    #[error("{}: {reason}", file.display())]
    Beside {
        /// The file.
        file: PathBuf,
        /// What the system said.
        reason: io::Error,
    },
}

/// A study, with everything it names loaded.
pub struct Study {
    file: String,
    text: String,
    urdf: String,
    wish: Option<advise::Wish>,
    chain: Chain,
    engine: Box<dyn Engine>,
    rows: u64,
    columns: Vec<Column>,
    /// Every file that was read: the study's own, the robot's.
    pub files: Vec<PathBuf>,
    /// What looks odd.
    pub warnings: Vec<String>,
}

impl Study {
    /// How many rows the whole map has.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The rows of part `part` of `parts` (counted from 1): the parts lie end to end and differ by a row at most.
    /// `None` unless `1 ≤ part ≤ parts`.
    pub fn shard(&self, part: u64, parts: u64) -> Option<Range<u64>> {
        if part == 0 || part > parts {
            return None;
        }
        let until = |part: u64| (u128::from(self.rows) * u128::from(part) / u128::from(parts)) as u64;
        Some(until(part - 1)..until(part))
    }

    /// The columns of a row: axes that vary, the pose where it was sought, `class`, quantities.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Everything that may vary; the last varies fastest from row to row.
    pub fn axes(&self) -> &[Axis] {
        self.engine.axes()
    }

    /// Unit of a column of numbers.
    pub fn unit(&self, column: &str) -> &'static str {
        let axis = self.axes().iter().find(|axis| axis.name == column);
        axis.map_or_else(|| quantity::unit_of(column), |axis| axis.unit)
    }

    /// The robot.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Something to compute rows with, one for each thread.
    pub fn evaluator(&self) -> Evaluator<'_> {
        Evaluator { worker: self.engine.worker() }
    }
}

/// Computes rows of a study.
pub struct Evaluator<'a> {
    worker: Box<dyn Worker + 'a>,
}

impl Evaluator<'_> {
    /// Row `index`, below [`Study::rows`]: a number for each of [`Study::columns`]; in a column of words the word's place.
    ///
    /// # Panics
    /// If `out` is not as long as the columns are many.
    pub fn row(&mut self, index: u64, out: &mut [f64]) {
        self.worker.row(index, out);
    }

    /// The configuration of a row, if there is one.
    pub fn pose(&mut self, index: u64) -> Option<Vec<f64>> {
        self.worker.pose(index)
    }

    /// Where the tip is at a configuration, world, m.
    pub fn tip(&mut self, q: &[f64]) -> Option<Vector3<f64>> {
        self.worker.tip(q)
    }
}
