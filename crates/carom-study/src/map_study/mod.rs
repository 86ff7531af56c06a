//! Impact maps from study files.
//!
//! A study is a TOML file that names a robot, a set of poses, the impact conditions and the quantities wanted. Its impact map
//! is the table of one impact for each combination of pose and condition.
//!
//! ```toml
//! [robot]
//! urdf = "../robots/planar2.urdf"          # relative to the study file
//!
//! [joints]                                  # grid of joint positions
//! shoulder = { from = -90, to = 90, count = 181, unit = "deg" }
//! elbow = { from = -170, to = 170, count = 341, unit = "deg" }
//!
//! [impact]
//! normal = [-1, 0, 0]                       # world frame, from the environment to the robot
//! along = [0, -1, 0]
//! approach_deg = 45
//! speed = 0.2                               # m/s
//! law = "energetic"
//! restitution = 0.35
//! friction = 0.2
//!
//! [map]
//! quantities = ["tangential_jump", "impulse"]
//! ```
//!
//! The book has all keys, quantities and classes: its page "Study files", `book/src/reference-study.md`. In this order the columns are the
//! axes that vary, the configuration where poses come from inverse kinematics, `class`, and the quantities; its page "Output files",
//! `book/src/reference-output.md`, lists them.
//!
//! A row is a function of its number alone: [`Study::evaluator`] computes any row at any time, so shards, threads and interruptions do not
//! change a digit.

mod advise;
mod arm;
mod axis;
mod boundary;
mod file;
mod picture;
mod pointing;
mod quantity;
mod reach;
mod read;
mod strike;
mod surface;

pub use advise::{Advice, Advised};
pub use axis::Axis;
pub(crate) use picture::MOST_DRAWN;
pub use picture::Values;
pub use quantity::CLASSES;

use crate::numbered::{Block, NumberedRows};
use crate::{Column, STUDY_KEY};
use arm::{Engine, Worker};
use carom_chain::Chain;
use carom_chain::input::{MESSAGE, shortened};
use nalgebra::Vector3;
use std::path::PathBuf;

/// Error in a study file, or of the robot that it names.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The study file breaks a rule, or the request does not fit the study.
    #[error("{file}: {}", shortened(rule, MESSAGE))]
    File {
        /// The study file.
        file: String,
        /// Key, value, the rule that is broken, and what to do.
        rule: String,
    },
    /// The robot's URDF is invalid; the message names the file.
    #[error(transparent)]
    Robot(carom_chain::ChainError),
}

/// A study with its robot loaded and all of its keys checked.
pub struct Study {
    file: String,
    text: String,
    urdf: String,
    wish: Option<advise::Wish>,
    chain: Chain,
    engine: Box<dyn Engine>,
    rows: u64,
    columns: Vec<Column>,
    /// The files that were read: the study file and the robot's URDF.
    pub files: Vec<PathBuf>,
    /// Warnings: joint positions of the study that lie beyond the joint's limits.
    pub warnings: Vec<String>,
}

impl Study {
    /// The text of the study file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// All axes, also those with one value; the last varies fastest from row to row.
    pub fn axes(&self) -> &[Axis] {
        self.engine.axes()
    }

    /// Unit of a column; empty for words, dimensionless numbers and unknown names.
    #[doc(hidden)]
    pub fn unit(&self, column: &str) -> &'static str {
        let axis = self.axes().iter().find(|axis| axis.name == column);
        let column = || self.columns.iter().find(|it| it.name == column);
        axis.map_or_else(|| column().map_or("", |it| it.unit), |axis| axis.unit)
    }

    /// The robot's kinematic chain.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// A new evaluator of rows. Each thread needs its own.
    pub fn evaluator(&self) -> Evaluator<'_> {
        Evaluator { worker: self.engine.worker() }
    }
}

impl NumberedRows for Study {
    /// The columns of a row: axes that vary, the configuration if poses come from inverse kinematics, `class`, quantities.
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn rows(&self) -> u64 {
        self.rows
    }

    fn text(&self) -> (&'static str, &str) {
        (STUDY_KEY, &self.text)
    }

    fn sources(&self) -> Vec<(String, String)> {
        vec![("the study file".into(), self.text.clone()), ("the robot's file".into(), self.urdf.clone())]
    }

    fn compute(&self, block: Block) -> usize {
        block.each(|| self.evaluator(), |evaluator, index, row| evaluator.row(index, row))
    }
}

/// Computes rows of a study in memory of its own.
pub struct Evaluator<'a> {
    worker: Box<dyn Worker + 'a>,
}

impl Evaluator<'_> {
    /// Computes row `index` (below [`Study::rows`]) into `out`: a number for each of [`Study::columns`]. In a column of words
    /// the number is the index of the word in [`Column::words`].
    ///
    /// # Panics
    /// If the length of `out` is not the number of columns.
    pub fn row(&mut self, index: u64, out: &mut [f64]) {
        self.worker.row(index, out);
    }

    /// Configuration of a row, rad or m; `None` for the classes `unreachable` and `outside-limits`, or if the dynamics cannot
    /// be computed there.
    pub fn pose(&mut self, index: u64) -> Option<Vec<f64>> {
        self.worker.pose(index)
    }

    /// Position of the contact point at configuration `q`, world frame, m; `None` if `q` has the wrong length or is not finite.
    pub fn tip(&mut self, q: &[f64]) -> Option<Vector3<f64>> {
        self.worker.tip(q)
    }
}
