//! Faster sources of what a general source computes too. Each file begins with what it gains and with the test that compares it
//! with the general source. The unrolled passes of two and three hinges are with the pass, in `delassus/unrolled.rs`.

pub(crate) mod planar_row;
pub mod sine;
