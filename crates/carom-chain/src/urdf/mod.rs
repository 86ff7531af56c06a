//! stub
mod robot;
use crate::error::ChainError;
pub use robot::*;
use std::path::Path;
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadOptions {
    pub floating_base: bool,
}
pub fn read_file(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Robot, ChainError> {
    todo!()
}
pub fn read_str(
    text: &str,
    base: Option<&Path>,
    options: &LoadOptions,
) -> Result<Robot, ChainError> {
    todo!()
}
