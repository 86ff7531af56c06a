//! Kinematics and dynamics of a kinematic chain that is read from a URDF: **recursive algorithms for the mass matrix, the
//! Jacobian and the Delassus matrix**, in the plane or in space, for any real scalar.
//!
//! Order of use: [`urdf`] reads and checks the file → [`Chain`], the immutable model → optional exact reductions
//! ([`Chain::lock`], [`Chain::prune`], [`Chain::to_planar`]) → [`Workspace::update`] at a configuration q →
//! [`Kinematics`]: poses, Jacobians, M, bias force, energies; [`Articulation`]: forward dynamics and H in time O(n).
//!
//! **Design.** The model is immutable and states are plain slices. Every quantity that depends on q is read through a view
//! that borrows the workspace: reading a value of an earlier configuration is a compile error, and threads share a chain
//! without locks. This crate has no contact or impact model.
//!
//! **Conventions.** SI units and radians. q and qd list the joints in the order of the file, an added floating base first.
//! A floating joint has q = (x, y, z, qx, qy, qz, qw), and its qd is the linear, then the angular velocity of the child in
//! child axes; a planar joint has q = (x, y, angle) and qd = q̇. Six-vectors have the angular part first wherever they are
//! exported as one array. `gravity` is the acceleration of free fall in world axes, m/s², for example (0, 0, −9.81).

mod aba;
mod about;
pub mod algebra;
mod assemble;
mod body;
mod chain;
mod contact_inertia;
mod crba;
mod delassus;
mod derivative;
mod energy;
mod error;
mod generate;
#[doc(hidden)]
pub mod input;
mod join;
mod kinematics;
mod planarize;
mod prepare;
mod reduce;
mod rnea;
mod rounding;
mod scratch;
mod solve;
mod specialised;
mod state;
mod tool;
pub mod urdf;
mod wrench;

pub use about::{Coordinates, JointInfo, Member};
pub use algebra::{Planar, Spatial};
pub use body::{Frame, FrameId, FramePoint, Point};
pub use chain::Chain;
pub use contact_inertia::ContactInertia;
pub use delassus::PointResponse;
pub use error::ChainError;
pub use generate::uniform_chain;
pub use join::Placed;
pub use kinematics::{Kinematics, Workspace};
pub use planarize::{PlanarChain, Plane};
pub use reduce::Reduced;
pub use tool::ToolMotion;
pub use wrench::JointWrench;

// Hidden: what only the other crates of carom and its tests use.
#[doc(hidden)]
pub use {
    aba::Articulation,
    about::JointCoordinate,
    body::Body,
    delassus::{ContactPoint, Keep, Kept, ResponseMemory, Rows, Visit},
    generate::uniform_chain_urdf,
    kinematics::Drifts,
    prepare::{Angle, HingeAngles},
    specialised::{planar_row::PlanarRow, sine},
};
