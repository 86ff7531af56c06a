//! The table as Markdown and as a picture.

use super::{Cell, METHODS, Row, Verdict};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::fmt::Write;

/// A figure in the fewest characters that tell its size.
fn short(figure: f64) -> String {
    if figure == 0.0 { "0".to_owned() } else { format!("{figure:.0e}") }
}

fn cell_of<'a>(row: &'a Row, method: &str) -> Option<&'a Cell> {
    row.cells.iter().find(|cell| cell.method == method)
}

/// A table of all scenes and methods, and below it what each scene is, and why cells are what they are.
pub fn markdown(rows: &[Row]) -> String {
    let mut text = "# Where methods fail\n\n".to_owned();
    let _ = writeln!(text, "| scene | {} |", METHODS.join(" | "));
    let _ = writeln!(text, "| --- |{}", " --- |".repeat(METHODS.len()));
    for row in rows {
        let _ = write!(text, "| {} |", row.scene);
        for method in METHODS {
            let shown = match cell_of(row, method) {
                None => String::new(),
                Some(Cell { verdict: Verdict::Exact, .. }) => "exact".to_owned(),
                Some(Cell { verdict: Verdict::Within, figure, .. }) => short(figure.unwrap_or(f64::NAN)),
                Some(Cell { verdict: Verdict::Degrades, figure, .. }) => {
                    format!("*degrades, {}*", short(figure.unwrap_or(f64::NAN)))
                }
                Some(Cell { verdict: Verdict::Refused, .. }) => "refused".to_owned(),
                Some(Cell { verdict: Verdict::Fails, .. }) => "**fails**".to_owned(),
                Some(Cell { verdict: Verdict::Defect, .. }) => "**DEFECT**".to_owned(),
            };
            let _ = write!(text, " {shown} |");
        }
        text.push('\n');
    }
    text.push_str(
        "\nexact: off by at most 1e-12 · a figure: within tolerance · *degrades*: beyond it · refused: with an error · \
         **fails**: as theory says · empty: does not apply\n",
    );
    for row in rows {
        let _ = write!(
            text,
            "\n## {}\n\n{}. Figure: {}; tolerance {:e}.\n\n",
            row.scene, row.story, row.measures, row.tolerance
        );
        for cell in &row.cells {
            let figure = cell.figure.map_or_else(String::new, |figure| format!(" {figure:.3e}"));
            let note = if cell.note.is_empty() { String::new() } else { format!(" ({})", cell.note) };
            let _ = writeln!(text, "- {}: {}{figure}{note}", cell.method, cell.verdict.name());
        }
    }
    text
}

const LEFT: i32 = 230;
const TOP: i32 = 130;
const WIDE: i32 = 62;
const HIGH: i32 = 24;

fn colour(verdict: Verdict) -> RGBColor {
    match verdict {
        Verdict::Exact => RGBColor(26, 150, 65),
        Verdict::Within => RGBColor(166, 217, 106),
        Verdict::Degrades => RGBColor(254, 224, 139),
        Verdict::Refused => RGBColor(171, 185, 201),
        Verdict::Fails => RGBColor(253, 141, 60),
        Verdict::Defect => RGBColor(200, 0, 0),
    }
}

/// The table as SVG, coloured by verdict, each cell with its figure.
pub fn svg(rows: &[Row]) -> String {
    let mut text = String::new();
    let size = ((LEFT + WIDE * METHODS.len() as i32 + 20) as u32, (TOP + HIGH * rows.len() as i32 + 60) as u32);
    let drawn = draw(&SVGBackend::with_string(&mut text, size).into_drawing_area(), rows);
    // Text is all that is written to: there is nothing that could fail.
    debug_assert!(drawn.is_ok(), "{drawn:?}");
    text
}

type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw<'a>(area: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>, rows: &[Row]) -> Drawn<'a> {
    area.fill(&WHITE)?;
    let font = |size: i32| ("sans-serif", size).into_font();
    let right = font(13).color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
    let upward = font(13).transform(FontTransform::Rotate270).color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    let inside = font(11).color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
    for (column, method) in METHODS.iter().enumerate() {
        let x = LEFT + WIDE * column as i32 + WIDE / 2;
        area.draw(&Text::new(*method, (x, TOP - 8), upward.clone()))?;
    }
    for (k, row) in rows.iter().enumerate() {
        let y = TOP + HIGH * k as i32;
        area.draw(&Text::new(row.scene, (LEFT - 8, y + HIGH / 2), right.clone()))?;
        for (column, method) in METHODS.iter().enumerate() {
            let x = LEFT + WIDE * column as i32;
            let frame = [(x + 1, y + 1), (x + WIDE - 1, y + HIGH - 1)];
            let Some(cell) = cell_of(row, method) else {
                area.draw(&Rectangle::new(frame, RGBColor(246, 246, 246).filled()))?;
                continue;
            };
            area.draw(&Rectangle::new(frame, colour(cell.verdict).filled()))?;
            let shown = match (cell.verdict, cell.figure) {
                (Verdict::Exact, _) => "exact".to_owned(),
                (Verdict::Refused, _) => "refused".to_owned(),
                (Verdict::Fails, _) => "fails".to_owned(),
                (_, Some(figure)) => short(figure),
                (_, None) => "defect".to_owned(),
            };
            area.draw(&Text::new(shown, (x + WIDE / 2, y + HIGH / 2), inside.clone()))?;
        }
    }
    let (mut x, y) = (LEFT, TOP + HIGH * rows.len() as i32 + 24);
    let left = font(13).color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    for verdict in Verdict::ALL.into_iter().filter(|verdict| *verdict != Verdict::Defect) {
        area.draw(&Rectangle::new([(x, y), (x + 18, y + 14)], colour(verdict).filled()))?;
        area.draw(&Text::new(verdict.name(), (x + 24, y + 7), left.clone()))?;
        x += 50 + 8 * verdict.name().len() as i32;
    }
    area.present()
}
