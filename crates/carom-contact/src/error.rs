//! What can be wrong with shapes, meshes and obstacles.

use std::path::PathBuf;

/// Every way in which this crate refuses its input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A mesh file can't be used.
    #[error("{owner}: mesh '{}' {fault}", file.display())]
    Mesh {
        /// Whose mesh: `link 'palm'` or `obstacle`.
        owner: String,
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        fault: MeshFault,
    },
    /// A length, radius or size that no body has.
    #[error("{owner}: {what} is {value}: it must be positive and finite")]
    Size {
        /// Whose: `link 'palm'` or `obstacle`.
        owner: String,
        /// `radius`, `length`, `size x` …
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// A position or direction that is not finite, or a direction without length.
    #[error("{owner}: {what} is ({}, {}, {}): {rule}", value[0], value[1], value[2])]
    Vector {
        /// Whose.
        owner: String,
        /// `point`, `normal` …
        what: &'static str,
        /// The value.
        value: [f64; 3],
        /// What it must be.
        rule: &'static str,
    },
}

/// What is wrong with a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFault {
    /// The file can't be read, or is not what its name says.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The name ends in something else than stl, dae or obj.
    #[error("is of the kind '{0}': stl, dae and obj are read")]
    UnknownKind(String),
    /// Nothing to touch.
    #[error("has no triangle of non-zero area ({0} triangles in the file): give a mesh with triangles, or a box")]
    NoTriangles(usize),
    /// NaN or infinite.
    #[error("has a vertex ({}, {}, {}) after scaling (vertex {index}, counted from 0): every coordinate must be finite", at[0], at[1], at[2])]
    NotFinite {
        /// Which vertex.
        index: usize,
        /// Its coordinates, scaled.
        at: [f64; 3],
    },
    /// A scale that flattens the mesh or is no number.
    #[error("has the scale ({}, {}, {}): each factor must be finite and not zero", .0[0], .0[1], .0[2])]
    Scale([f64; 3]),
}
