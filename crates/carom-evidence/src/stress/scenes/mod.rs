//! The scenes: what each is, what its figure measures, and what theory predicts of each method, with the reason.

mod impacts;
mod motion;
mod several;

use super::method::Scene;
use std::sync::LazyLock;

/// The scenes, in the order of the table.
pub static SCENES: LazyLock<Vec<Scene>> = LazyLock::new(|| [impacts::SCENES, several::SCENES, motion::SCENES].concat());
