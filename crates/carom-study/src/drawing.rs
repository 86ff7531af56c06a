//! Pictures as SVG.

use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;

/// A part of a picture.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// What drawing returns.
pub type Drawn = Result<(), Box<dyn Error>>;

/// A picture of this size, drawn on white.
pub fn picture(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> Result<String, Box<dyn Error>> {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
    root.fill(&WHITE)?;
    draw(&root)?;
    root.present()?;
    drop(root);
    Ok(text)
}

/// The same where nothing can fail but writing, which into a string does not.
pub fn sure_picture(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> String {
    let drawn = picture(size, draw);
    debug_assert!(drawn.is_ok(), "{drawn:?}");
    drawn.unwrap_or_default()
}

/// A colour by its shares of red, green and blue.
pub fn rgb([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// The least 1, 2 or 5 times a power of ten that is not below this.
pub fn round_step(least: f64) -> f64 {
    let power = 10.0_f64.powf(least.max(f64::MIN_POSITIVE).log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|x| x * power);
    steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}
