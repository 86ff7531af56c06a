//! Implementations for special chains of quantities that a general implementation computes too, but slower. Each file states its
//! measured gain and the test that compares it with the general implementation. The unrolled passes of two and three hinges are
//! with the pass, in `delassus/unrolled.rs`.

pub(crate) mod planar_row;
pub mod sine;
