//! Errors of shapes, meshes and obstacles.

use std::path::PathBuf;

/// Errors of this crate. Each message names the link or obstacle, the value, and the rule that it breaks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A mesh file cannot be used.
    #[error("{owner}: mesh '{}' {fault}", file.display())]
    Mesh {
        /// Owner of the mesh: `link 'palm'` or `obstacle`.
        owner: String,
        /// Path of the file.
        file: PathBuf,
        /// What is wrong with it, and what to do.
        fault: String,
    },
    /// A length, radius or side that is not positive and finite.
    #[error("{owner}: {what} is {value}: it must be positive and finite")]
    Size {
        /// Owner of the shape: `link 'palm'` or `obstacle`.
        owner: String,
        /// Name of the size: `radius`, `length`, `size x` …
        what: &'static str,
        /// Its value, m.
        value: f64,
    },
    /// A position or direction that is not finite, or a direction of zero length.
    #[error("{owner}: {what} is ({}, {}, {}): {rule}", value[0], value[1], value[2])]
    Vector {
        /// Owner of the vector: `obstacle`.
        owner: String,
        /// Name of the vector: `point`, `normal` …
        what: &'static str,
        /// Its value.
        value: [f64; 3],
        /// The rule that it breaks.
        rule: &'static str,
    },
}
