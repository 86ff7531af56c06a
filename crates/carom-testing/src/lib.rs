//! Bodies, robots, scenes and folders of the tests of carom. It is not published, and no library depends on it.
//!
//! | module | what |
//! | --- | --- |
//! | [`build`] | robots from parts, as URDF or as chains |
//! | [`files`] | robots and scenes of the repository, folders of a test |
//! | `mechanisms` | linkages with closed loops (feature `sim`) |
//! | [`numeric`] | methods of integration |
//! | [`tables`] | tables of cases as text |
//! | `scenes` | surfaces, laws and simulations (feature `sim`) |

pub mod build;
pub mod files;
#[cfg(feature = "sim")]
pub mod mechanisms;
pub mod numeric;
#[cfg(feature = "sim")]
pub mod scenes;
pub mod tables;
