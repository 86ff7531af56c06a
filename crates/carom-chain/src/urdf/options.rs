//! Options of the reader.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// Options of the reader.
///
/// ```
/// use carom_chain::{Chain, urdf::LoadOptions};
/// let options = LoadOptions { floating_base: true, strict: true, ..Default::default() };
/// let error = Chain::from_urdf_str("<robot name='r'><link name='a' colour='red'/></robot>", &options).unwrap_err();
/// assert!(error.to_string().contains("<link colour>: is not used: it is unknown"));
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoadOptions {
    /// Whether the root link moves freely, on a floating joint that is added. Otherwise the root link is fixed to the world.
    pub floating_base: bool,
    /// Treatment of missing collision meshes, and whether visual meshes are searched for.
    pub meshes: Meshes,
    /// Whether warnings ([`LoadReport::warnings`](super::LoadReport::warnings)) are errors.
    pub strict: bool,
    /// Whether the robot is changed as little as needed to compute its dynamics: links that move without mass are welded to the links that
    /// carry them, and principal moments of inertia are raised to the nearest ones that a body can have.
    /// [`LoadReport::repairs`](super::LoadReport::repairs) lists the changes.
    pub repair: bool,
    /// Folders in which packages (`package://NAME/…`) are searched for first. Each may be the package itself or contain it.
    pub package_dirs: Vec<PathBuf>,
    /// Reflected inertias of motors' rotors by joint name, kg m² or kg: see
    /// [`Chain::with_rotor_inertia`](crate::Chain::with_rotor_inertia). They replace those of the file
    /// ([`Joint::rotor_inertia`](super::Joint::rotor_inertia)).
    pub rotor_inertia: BTreeMap<String, f64>,
    /// Masses of links by name, kg, instead of those of the file. The rotational inertia of a link changes in proportion to its mass, and its
    /// centre of mass stays.
    pub mass: BTreeMap<String, f64>,
    /// Rotational inertias of links by name about their centres of mass, along the axes of the link, instead of those of the file:
    /// ixx, ixy, ixz, iyy, iyz, izz, kg m².
    pub inertia: BTreeMap<String, [f64; 6]>,
    /// An SRDF file beside the URDF. The pairs of links that it disables
    /// ([`Robot::disabled_pairs`](super::Robot::disabled_pairs)) make no contact.
    pub srdf: Option<PathBuf>,
}

/// Treatment of missing collision meshes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Meshes {
    /// A missing mesh is a warning, and an error where its shape is used, for instance in a contact.
    #[default]
    WhenUsed,
    /// A missing mesh is left out; [`LoadReport::unused`](super::LoadReport::unused) lists it. Visual meshes are left out,
    /// found or not.
    Ignored,
}
