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
//! # Keys
//!
//! Unknown keys are errors. Numbers are SI; angles of joints are rad unless their range has `unit = "deg"`; keys and columns
//! whose name ends in `_deg` are in degrees. *Values* stands for a number, a list of numbers, or an evenly spaced range
//! `{ from, to, count }` with both ends included (`count` ≥ 2). Each of the keys marked *values*, and each list of normals
//! or laws, is an axis of the map; an axis varies if it has more than one value. An arm is computed in the plane if all of its
//! joints move in one plane and every normal and `along` lie in it, otherwise in space.
//!
//! | key | type, unit | default | meaning |
//! | --- | --- | --- | --- |
//! | `[robot] urdf` | path | required | URDF of the robot, relative to the study file; fixed base, joints with one coordinate each |
//! | `[robot] tip` | link or frame name | `"tip"` | link that carries the contact point |
//! | `[robot] point` | `[x, y, z]`, m | `[0, 0, 0]` | contact point, in the axes of the tip's frame, from its origin |
//! | `[robot] limits` | boolean | `true` | whether position limits of the joints hold: poses beyond them have class `outside-limits` and no numbers |
//! | `[robot] strict` | boolean | `false` | refuses what is otherwise a warning about the URDF |
//! | `[robot] repair` | boolean | `false` | changes the robot as little as needed to compute its dynamics: see [`LoadOptions::repair`](carom_chain::urdf::LoadOptions::repair) |
//! | `[robot] package_dirs` | list of folders | `[]` | folders in which packages are searched for first, as in scenes; meshes are not read |
//! | `[robot] rotor_inertia` | table of numbers by joint name, kg m², kg | `{}` | reflected inertias of motors' rotors, N² I with the gear ratio N |
//! | `[joints] <joint>` | values, rad or m | required for every moving joint | positions; the poses are the grid of all combinations. Fixed and mimic joints are left out. A range may have `unit = "deg"` |
//! | `[tip] x`, `y`, `z` | values, m | unconstrained | instead of `[joints]`: world position of the contact point; at least one of the three. The poses are computed by inverse kinematics |
//! | `[tip] elbow` | `"both"`, `"up"`, `"down"` | `"both"` | two revolute links in a plane only: which of the two solutions; up is to the left of the line from the base to the tip |
//! | `[tip] seeds` | list of configurations | two: `q = 0.6` and `q = −0.6` for every revolute joint, clamped to its limits, and the middle of the range for a prismatic joint | all other arms: start configurations of the inverse kinematics; one pose for each seed. If a seed fails, 12 fixed start configurations are tried after it |
//! | `[tip] pointing` | `{ axis = [x, y, z], direction = [x, y, z] }` | the direction of the tip is free | an axis of the tip's link, in its axes, keeps this direction in the world; a rotation about the axis stays free. In the plane both lie in it |
//! | `[impact] normal` | `[x, y, z]`, or a list of them | required, or `normal_deg` | contact normal in the world frame, from the environment to the robot; normalised on reading |
//! | `[impact] normal_deg` | values, degrees | – | planar arms only, instead of `normal`: direction of the normal, counted from the first axis of the arm's plane towards the second |
//! | `[impact] along` | `[x, y, z]` | planar arms: the normal turned by +90° in the plane; in space required unless `approach_deg = 90` | direction of positive tangential velocity, in the world frame; its part perpendicular to the normal is used, normalised |
//! | `[impact] approach_deg` | values, degrees, 0 to 180 | required | angle α between the surface and the velocity of the tip before the impact: u_t⁻ = speed · cos α along `along`, u_n⁻ = −speed · sin α |
//! | `[impact] speed` | values, m/s, > 0 | required | speed of the contact point before the impact |
//! | `[impact] law` | law name, or a list of names | required | impact laws, see [`carom_impact::LAW_NAMES`] |
//! | `[impact] restitution` | values, 0 to 1 | required | coefficient of restitution, as the law defines it |
//! | `[impact] friction` | values, ≥ 0 | `0` | coefficient of friction |
//! | `[impact] tangential_restitution` | values, −1 to 1 | `0` | tangential coefficient of restitution; an error unless `chatterjee-ruina` is among the laws, the others do not use it |
//! | `[map] quantities` | list of names | required | columns to compute, from the table of quantities below |
//! | `[advise] minimise`, `maximise` | column name | one of the two is required | criterion of [`Study::advise`]: an axis that varies or a quantity, numbers only |
//! | `[advise] class` | list of classes | every class with numbers | admissible classes |
//! | `[advise] at_most`, `at_least` | `{ column = x, … }`, unit of the column | no bounds | bounds on columns of numbers |
//! | `[advise] best` | count ≥ 1 | `5` | how many rows are returned at most |
//!
//! # Rows
//!
//! The axes are nested in the order joints (or tip coordinates, then elbow or seed), normal, approach, speed, restitution,
//! tangential restitution, friction, law; the last varies fastest. A row is a function of its number alone:
//! [`Study::evaluator`] computes any row at any time, so shards, threads and interruptions do not change a digit.
//!
//! The joint velocities before the impact are those of least kinetic energy that give the contact point the velocity asked
//! for: q̇⁻ = M⁻¹Jᵀ H⁻¹ u⁻ with H = J M⁻¹ Jᵀ.
//!
//! # Columns
//!
//! In this order; joints are named as in the URDF, in the order of q.
//!
//! | columns | unit | meaning |
//! | --- | --- | --- |
//! | axes that vary: `q.<joint>`; `tip.x`, `tip.y`, `tip.z`, then `elbow` or `seed`; `normal.x`, `normal.y`, `normal.z` or `normal_deg`; `approach_deg`, `speed`, `restitution`, `tangential_restitution`, `friction`, `law` | of the key; the normal without unit | value of the axis; `normal.*` is the unit normal; `elbow` (`up`, `down`), `seed` (1, 2, …) and `law` are words |
//! | `q.<joint>` | rad or m | with `[tip]` only: the configuration that was found |
//! | `class` | word | result of the row, see the table of classes |
//! | the quantities, in the order of `[map] quantities` | see below | NaN, in columns of words the empty word, where the class has no numbers |
//!
//! Let u⁻ and u⁺ be the velocity of the contact point before and after the impact, p the impulse on the robot, n the contact
//! normal and t the direction `along`.
//!
//! | quantity | unit | meaning |
//! | --- | --- | --- |
//! | `mode` | word | contact mode at the end of the impact: `open`, `stick`, `slip`, `reverse-slip` |
//! | `flags` | word | flags of the law, joined by `+`: `energy-gain`, `jam`, `singular`, `grazing`, `non-unique`, `no-approach`; empty if there are none |
//! | `tangential_jump` | m/s | u_t⁺ − u_t⁻ |
//! | `tangential_ratio` | – | u_t⁺/u_t⁻; not finite at `approach_deg = 90` |
//! | `tangential_after` | m/s | u_t⁺ |
//! | `normal_after` | m/s | u_n⁺ |
//! | `impulse` | N s | ‖p‖ |
//! | `normal_impulse` | N s | p · n, ≥ 0 |
//! | `tangential_impulse` | N s | p · t |
//! | `effective_mass` | kg | 1/(nᵀHn) |
//! | `locked_mass` | kg | the same for the robot as one rigid body that nothing holds (joints locked, base released); NaN if its inertia is singular |
//! | `coupling` | – | h = −H_tn/H_nn; without friction u_t⁺ − u_t⁻ = (1+e) h u_n⁻ |
//! | `energy_loss` | J | T⁻ − T⁺, kinetic energy of the robot |
//! | `energy_ratio` | – | T⁺/T⁻ |
//! | `joint_jump` | rad/s or m/s | max \|Δq̇ᵢ\| over the entries of q̇ |
//! | `limit_share` | – | max \|Δq̇ᵢ\|/q̇ᵢ,max over the joints with a velocity limit in the URDF (mimic joints included); an error if no joint has one |
//! | `limit_joint` | word | the joint at which this maximum is attained |
//! | `impact_ellipse.long`, `.short`, `.angle_deg` | N s, N s, degrees | planar arms: semi-axes of the ellipse of impulses with ‖Δq̇‖ = 1, pᵀ(J M⁻² Jᵀ)p = 1 (Walker 1994), and the direction of the longer one from the first axis of the arm's plane, in (−90, 90] |
//! | `impact_ellipse.long`, `.middle`, `.short` | N s | arms in space: semi-axes of that ellipsoid |
//! | `mode_margin` | – | normalised distance to the nearest boundary of the mode, from 0 (on it) to 1: [`carom_impact::Boundary`], as printed by `carom impact --derivatives` |
//! | `mode_edge` | word | which boundary that is: `no-approach`, `no-slip`, `stops-at-turn`, `stops-at-end`, `just-holds`, `jams`, `on-cone`, `clipped` ([`carom_impact::Edge`]) |
//! | `mode_beyond` | word | the mode on the other side of it |
//! | `boundary_friction` | – | signed change of μ alone that changes the mode, the smaller of both directions; NaN if no μ from 0 to 81 does |
//! | `boundary_restitution` | – | the same for e, from 0 to 1 |
//! | `boundary_approach_deg` | degrees | the same for the approach angle, from 0° to 180° |
//! | `position.x`, `.y`, `.z` | m | contact point in the world frame |
//! | `qd_minus.<joint>`, `qd_plus.<joint>` | rad/s or m/s | joint velocities before and after |
//!
//! `boundary_*` are found by evaluating the law in steps of a 128th of the range (for μ: of the friction angle) and bisection,
//! at the cost of some hundred impacts each. An interval of another mode that is shorter than a step can be missed.
//!
//! | class | numbers | meaning |
//! | --- | --- | --- |
//! | `unreachable` | no | inverse kinematics found no pose |
//! | `outside-limits` | no | the pose violates a position limit of a joint |
//! | `singular` | no | no joint velocity gives the contact point the velocity asked for, or H_nn = 0 |
//! | `refused` | no | the law or the dynamics returned an error |
//! | `no-impact` | no | the contact point does not approach the surface |
//! | `stick` | yes | no tangential velocity after the impact (at most 1e-12 of the speed) |
//! | `starts` | yes | slip after an approach along the normal |
//! | `shrinks`, `keeps`, `grows` | yes | ‖u_t⁺‖ is smaller than, equal to (within 1e-9) or greater than ‖u_t⁻‖, without reversal |
//! | `reverses` | yes | u_t⁻ · u_t⁺ < 0 |
//!
//! # Reference
//!
//! I. D. Walker, *Impact configurations and measures for kinematically redundant and multiple armed robot systems*, IEEE
//! Trans. Robotics and Automation 10 (1994) 670.

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
mod write;

pub use advise::{Advice, Advised};
pub use axis::Axis;
pub use picture::Values;
pub use quantity::CLASSES;
pub use write::{MapFile, Written};

use crate::{Column, TableError};
use arm::{Engine, Worker};
use carom_chain::Chain;
use carom_chain::input::{MESSAGE, shortened};
use nalgebra::Vector3;
use std::io;
use std::ops::Range;
use std::path::PathBuf;

/// Error in a study file, or while reading or writing the files of a map.
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
    /// The map cannot be written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The map cannot be written to its end, as on a full disk; the rows before it are kept.
    #[error(
        "{error}; the first {rows} rows are kept in {}: mend this, then run it again with --resume (in Python resume=True)",
        partial.display()
    )]
    Incomplete {
        /// Why the map cannot be written.
        error: TableError,
        /// Number of rows in the partial table.
        rows: u64,
        /// The partial table.
        partial: PathBuf,
    },
    /// The partial map of an interrupted run cannot be resumed.
    #[error("{}: the interrupted run cannot be resumed: {reason}", file.display())]
    Resume {
        /// The partial table or its metadata file.
        file: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// The metadata file of a partial map cannot be written.
    #[error("{}: cannot be written: {reason}", file.display())]
    Beside {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        reason: io::Error,
    },
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
    /// Number of rows of the whole map.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Row numbers of part `part` of `parts`, counted from 1. The parts are consecutive, and their lengths differ by at most
    /// one row. `None` unless `1 ≤ part ≤ parts`.
    pub fn shard(&self, part: u64, parts: u64) -> Option<Range<u64>> {
        if part == 0 || part > parts {
            return None;
        }
        let until = |part: u64| (u128::from(self.rows) * u128::from(part) / u128::from(parts)) as u64;
        Some(until(part - 1)..until(part))
    }

    /// The text of the study file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The columns of a row: axes that vary, the configuration if poses come from inverse kinematics, `class`, quantities.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// All axes, also those with one value; the last varies fastest from row to row.
    pub fn axes(&self) -> &[Axis] {
        self.engine.axes()
    }

    /// Unit of a column; empty for words, dimensionless numbers and unknown names.
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
