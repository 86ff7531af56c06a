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
        /// The error in it.
        fault: MeshFault,
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

/// An error in a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFault {
    /// The file cannot be read or is not in the format of its extension; or an index of a vertex is out of range.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The file was not found when the robot was loaded.
    #[error(
        "is not found; {0}. Correct the path, or name the folder of its package: --package-dir, in scenes package_dirs"
    )]
    Missing(String),
    /// The extension is not stl, dae or obj.
    #[error("has the file type '{0}', which is not supported: give an stl, dae or obj file")]
    UnknownKind(String),
    /// The mesh has no triangle of non-zero area.
    #[error("has no triangle of non-zero area ({0} triangles in the file): give a mesh with triangles, or a box")]
    NoTriangles(usize),
    /// A coordinate is NaN or infinite.
    #[error("has a vertex ({}, {}, {}) after scaling (vertex {index}, counted from 0): every coordinate must be finite", at[0], at[1], at[2])]
    NotFinite {
        /// Index of the vertex, from 0.
        index: usize,
        /// Its coordinates after scaling, m.
        at: [f64; 3],
    },
    /// A factor of the scale is zero or not finite.
    #[error("has the scale ({}, {}, {}): each factor must be finite and not zero", .0[0], .0[1], .0[2])]
    Scale([f64; 3]),
}
