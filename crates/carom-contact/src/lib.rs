//! Shapes on links and in the surroundings: **signed gap, normal, witness points, gap rate, contact point**.
//!
//! The way of the data: the collision elements of a [`Chain`](carom_chain::Chain) → [`link_shapes`] (sizes checked, meshes
//! read) → [`reachable_pairs`] with the [`Obstacle`]s, once → [`gap`] at every pose → [`contact_point`], whose Jacobian is
//! the contact's.
//!
//! **Why this shape.** Events are found as zeros of gaps, so a gap must be right to rounding on both sides of zero, and a
//! normal too. Closed forms give that where they are short. The rest goes through one search over convex bodies that
//! says how good its answer is. parry finds convex hulls and triangles; none of its types is seen outside `parry.rs`.
//!
//! **Conventions.** SI units, world axes. The normal is a unit vector from the environment to the robot; gap > 0 is open,
//! gap < 0 overlaps; approach means a negative gap rate.
//!
//! **Limits.** A link's mesh counts as its convex hull: exact against a half-space, filled elsewhere. An obstacle's mesh
//! counts as it is. Obstacles stand still.
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
mod mesh;
mod obstacle;
mod parry;
mod polish;
mod reach;
mod shape;
mod solid;

pub use error::{ContactError, MeshFault};
pub use gap::{Gap, gap, gap_between, gap_points};
pub use hull::Hull;
pub use mesh::Mesh;
pub use obstacle::{Obstacle, Surface};
pub use reach::{LeftOut, Pair, Reachable, reachable_pairs};
pub use shape::{LinkShape, contact_point, gap_rate, link_shapes};
pub use solid::{Corner, Solid};
