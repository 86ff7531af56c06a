//! Pictures as SVG.

use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;

/// A part of a picture.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// What drawing returns.
pub(crate) type Drawn = Result<(), Box<dyn Error>>;

/// A picture of this size, drawn on white.
pub(crate) fn picture(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> Result<String, Box<dyn Error>> {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
    root.fill(&WHITE)?;
    draw(&root)?;
    root.present()?;
    drop(root);
    Ok(text)
}

/// The same where nothing can fail but writing, which into a string does not.
pub(crate) fn sure_picture(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> String {
    let drawn = picture(size, draw);
    debug_assert!(drawn.is_ok(), "{drawn:?}");
    drawn.unwrap_or_default()
}
