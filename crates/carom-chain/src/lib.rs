//! From a URDF to kinematics and dynamics of a chain: **recursive builders of the mass matrix, the Jacobian and the
//! Delassus matrix**, in the plane or in space, for any real scalar.
//!
//! The way of the data: [`urdf`] reads and checks → [`Chain`] (immutable) → optional exact reductions
//! ([`Chain::lock`], [`Chain::prune`], [`Chain::to_planar`]) → [`Workspace::update`] at a configuration q →
//! [`Kinematics`]: poses, Jacobians, M, bias, energies; [`Articulation`]: forward dynamics and H in time O(n).
//!
//! **Why this shape.** The model never changes, states are plain slices, and everything that depends on q lives behind
//! a view that borrows the workspace: a stale value is a compile error, and chains are shared between threads without
//! locks. Nothing here knows of impacts.
//!
//! **Conventions.** SI units and radians. q and qd follow the joints in the order of the file, a floating base first.
//! A floating joint has q = (x, y, z, qx, qy, qz, qw) and qd = linear, then angular velocity of the child in child
//! axes; a planar joint has q = (x, y, angle) and qd = q̇. Exported six-vectors put the angular part first.
//! `gravity` is the acceleration of free fall in world axes, (0, 0, −9.81) m/s² say.

pub mod algebra;
mod articulated;
mod assemble;
mod base_parameters;
mod chain;
mod contact_inertia;
mod dynamics;
mod error;
mod generate;
mod moves;
mod planar_row;
mod planarize;
mod probe;
mod reduce;
pub mod sine;
mod state;
mod steps;
mod turned;
pub mod urdf;
mod workspace;

pub use algebra::{Planar, Spatial};
pub use articulated::Articulation;
pub use chain::{Body, Chain, Coordinates, Frame, FrameId, JointInfo, LinkInfo, Point};
pub use contact_inertia::ContactInertia;
pub use error::ChainError;
pub use generate::{uniform_chain, uniform_chain_urdf};
pub use planar_row::PlanarRow;
pub use planarize::{PlanarChain, Plane};
pub use probe::{Finish, Found, Probe, Reading};
pub use reduce::Reduced;
pub use state::OutsideLimit;
pub use turned::{Angle, Turned};
pub use workspace::{Kinematics, Workspace};
