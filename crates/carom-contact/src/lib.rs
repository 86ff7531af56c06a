//! Gaps between the shapes of a robot's links and obstacles: **signed distance, contact normal, nearest points, gap rate,
//! contact point**.
//!
//! Order of use: the collision elements of a [`Chain`](carom_chain::Chain) → [`link_shapes`], which checks sizes and reads
//! meshes → [`out_of_reach`] of an [`Obstacle`] or not, once → [`gap`] at every pose → [`contact_point`], whose Jacobian is
//! the contact Jacobian.
//!
//! **Design.** Contact events are zeros of gaps, so a gap and its normal must be accurate to rounding on both sides of
//! zero. Simple pairs of shapes use closed forms; all others use one search over convex bodies that also computes a bound
//! of its error. parry is used for convex hulls and for finding triangles of meshes; its types do not occur in any
//! signature outside `parry.rs`.
//!
//! **Conventions.** SI units, world axes. The normal is a unit vector from the environment to the robot. The gap is > 0 for
//! separate bodies and < 0 for overlapping ones; a negative gap rate is an approach.
//!
//! **Limits.** A link's mesh is replaced by its convex hull, which is exact against a half-space and fills concavities
//! otherwise. An obstacle's mesh is used as it is. Obstacles do not move.
//!
//! ```
//! use carom_chain::Chain;
//! use carom_contact::{Obstacle, contact_point, gap, gap_rate, link_shapes};
//! use nalgebra::Vector3;
//!
//! let arm = Chain::from_urdf_str(r#"<robot name="arm">
//!   <link name="base"/>
//!   <link name="rod">
//!     <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
//!     <collision><origin xyz="1 0 0"/><geometry><sphere radius="0.1"/></geometry></collision>
//!   </link>
//!   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint>
//! </robot>"#, &Default::default())?;
//! let shapes = link_shapes(&arm)?;
//! let wall = Obstacle::half_space(Vector3::new(1.2, 0.0, 0.0), Vector3::new(-1.0, 0.0, 0.0))?;
//!
//! let mut workspace = arm.workspace();
//! let at_q = workspace.update(&arm, &[-0.5])?;
//! let open = gap(&shapes[0], &at_q.pose(shapes[0].frame()), &wall);
//! assert!((open.distance - (1.1 - 0.5_f64.cos())).abs() < 1e-15);
//! assert_eq!(open.normal, Vector3::new(-1.0, 0.0, 0.0));
//!
//! let rate = gap_rate(&at_q, &shapes[0], &open, &[2.0])?;
//! assert!((rate - 2.0 * (-0.5_f64).sin()).abs() < 1e-15);
//! let jacobian = at_q.point_jacobian(contact_point(&at_q, &shapes[0], &open));
//! assert_eq!(jacobian.shape(), (3, 1));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod closed_form;
mod convex;
mod error;
mod gap;
mod hull;
mod meeting;
mod mesh;
mod obstacle;
mod parry;
mod parts;
mod polish;
mod reach;
mod separation;
mod shape;
mod solid;

pub use error::ContactError;
pub use gap::{Gap, contact_point, gap, gap_between, gap_rate};
pub use mesh::Mesh;
pub use obstacle::Obstacle;
pub use reach::{LeftOut, out_of_reach};
pub use shape::{LinkShape, link_shapes};

// Hidden: what only carom-sim, studies and recordings use, such as the contacts of parts of two bodies.
#[doc(hidden)]
pub use {
    gap::gap_points,
    hull::Hull,
    meeting::{Meeting, Met, Placed, Slide},
    obstacle::Surface,
    parts::{Part, Parts},
    reach::apart,
    separation::Separation,
    shape::{found_shapes, shapes_of_link},
    solid::{Corner, Solid},
};
