//! The table as Markdown and as a picture.

use super::method::{Cell, METHODS, Row, Verdict};
use carom_study::drawing::{Area, Drawn, sure_picture};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::fmt::Write;

/// A figure above rounding, with two significant digits.
fn short(figure: f64) -> String {
    format!("{figure:.1e}")
}

/// The least and the largest figure allowed; of a predicted value, that and the relative error allowed.
pub fn interval([least, most]: [f64; 2]) -> String {
    let (middle, half) = (0.5 * (least + most), 0.5 * (most - least));
    if least == 0.0 {
        format!("≤ {}", plain(most))
    } else if half < 0.05 * middle {
        format!("{} (1 ± {:.0e})", four(middle), half / middle)
    } else {
        format!("{} … {}", plain(least), plain(most))
    }
}

fn plain(x: f64) -> String {
    format!("{x:e}")
}

/// With four significant digits.
fn four(x: f64) -> String {
    if (1e-3..1e3).contains(&x.abs()) {
        format!("{x:.digits$}", digits = (3.0 - x.abs().log10().floor()) as usize)
    } else {
        format!("{x:.3e}")
    }
}

fn cell_of<'a>(row: &'a Row, method: &str) -> Option<&'a Cell> {
    row.cells.iter().find(|cell| cell.method == method)
}

/// The figure as it is printed: never a digit that is rounding.
fn figure(cell: &Cell) -> String {
    match (cell.verdict, cell.figure, cell.bound) {
        (Verdict::Exact, ..) => "exact".to_owned(),
        (Verdict::Within, _, Some([_, most])) => format!("≤ {}", plain(most)),
        (Verdict::Refused, ..) => "refused".to_owned(),
        (Verdict::Degrades, Some(figure), _) => short(figure),
        (_, Some(figure), _) => four(figure),
        (_, None, _) => "–".to_owned(),
    }
}

/// The table in Markdown: all scenes and methods, and below it for every cell verdict, figure, bound and reason.
///
/// Figures that are rounding are printed as `exact` or by their bound, so that the text is the same on every machine.
pub fn markdown(rows: &[Row]) -> String {
    let mut text = "# Where methods fail\n\n\
                    Made by `carom stress --out docs`; a test compares it with a fresh run. Every cell has the verdict that theory \
                    predicts and a bound on its figure; what does not meet them is a defect.\n\n"
        .to_owned();
    let _ = writeln!(text, "| scene | {} |", METHODS.join(" | "));
    let _ = writeln!(text, "| --- |{}", " --- |".repeat(METHODS.len()));
    for row in rows {
        let _ = write!(text, "| {} |", row.scene);
        for method in METHODS {
            let shown = cell_of(row, method).map_or_else(String::new, |cell| match cell.verdict {
                Verdict::Exact | Verdict::Within | Verdict::Refused => figure(cell),
                Verdict::Degrades => format!("*degrades, {}*", cell.figure.map_or_else(String::new, short)),
                Verdict::Fails => "**fails**".to_owned(),
                Verdict::Defect => "**DEFECT**".to_owned(),
            });
            let _ = write!(text, " {shown} |");
        }
        text.push('\n');
    }
    text.push_str(
        "\nexact: the figure is at most 1e-12 · ≤ a number: within tolerance, the number bounds the figure · *degrades*: an error of \
         approximation of the predicted size · refused: an error, as predicted · **fails**: wrong by the predicted amount · empty: \
         does not apply\n",
    );
    for row in rows {
        let _ = write!(
            text,
            "\n## {}\n\n{}. Figure: {}; tolerance {:e}.\n\n| method | verdict | figure | bound | reason |\n\
             | --- | --- | --- | --- | --- |\n",
            row.scene,
            row.story,
            row.measures.replace('|', "\\|"),
            row.tolerance
        );
        let line = |cell: &Cell| {
            let shown = if cell.verdict == Verdict::Refused { "–".to_owned() } else { figure(cell) };
            let bound = cell.bound.map_or_else(|| "–".to_owned(), interval);
            format!("{} | {shown} | {bound} | {} |", cell.verdict.name(), reason(cell).replace('|', "\\|"))
        };
        // Methods that have the same line share it.
        let mut lines: Vec<(String, Vec<&str>)> = Vec::new();
        for cell in &row.cells {
            let own = line(cell);
            match lines.iter_mut().find(|(line, _)| *line == own) {
                Some((_, methods)) => methods.push(cell.method),
                None => lines.push((own, vec![cell.method])),
            }
        }
        for (line, methods) in lines {
            let _ = writeln!(text, "| {} | {line}", methods.join(", "));
        }
    }
    text
}

fn reason(cell: &Cell) -> String {
    match (cell.verdict, cell.note.is_empty()) {
        (Verdict::Defect, _) => cell.note.clone(),
        (_, true) => cell.reason.to_owned(),
        (_, false) => format!("{} ({})", cell.reason, cell.note),
    }
}

const LEFT: i32 = 230;
const TOP: i32 = 130;
const WIDE: i32 = 62;
const HIGH: i32 = 24;
/// Least width, that of the legend.
const LEGEND: i32 = 960;

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

/// The methods that stand side by side: laws of one contact, laws of several contacts, ways to simulate.
const BLOCKS: [std::ops::Range<usize>; 3] = [0..8, 8..12, 12..15];

/// A block of the picture: its methods, its rows, and the upper left corner of its names.
struct Block<'a> {
    methods: &'static [&'static str],
    rows: Vec<&'a Row>,
    corner: (i32, i32),
}

impl Block<'_> {
    fn size(&self) -> (i32, i32) {
        (LEFT + WIDE * self.methods.len() as i32, TOP + HIGH * self.rows.len() as i32)
    }
}

/// The blocks with the scenes that apply to their methods: laws of one and of several contacts below each other, simulations beside
/// them. Nearly all cells of the whole table would be empty.
fn blocks(rows: &[Row]) -> Vec<Block<'_>> {
    let mut blocks: Vec<Block> = Vec::new();
    for (k, range) in BLOCKS.into_iter().enumerate() {
        let methods = &METHODS[range];
        let own: Vec<&Row> =
            rows.iter().filter(|row| methods.iter().any(|method| cell_of(row, method).is_some())).collect();
        let before: Vec<(i32, i32)> = blocks.iter().map(Block::size).collect();
        let corner = match k {
            2 => (before.iter().map(|size| size.0).max().unwrap_or(0) + 20, 0),
            _ => (0, before.iter().map(|size| size.1).sum::<i32>()),
        };
        blocks.push(Block { methods, rows: own, corner });
    }
    blocks.retain(|block| !block.rows.is_empty());
    blocks
}

/// The table as SVG, coloured by verdict, each cell with its figure or bound.
pub fn svg(rows: &[Row]) -> String {
    let blocks = blocks(rows);
    let end = |of: fn((i32, i32)) -> i32| {
        blocks.iter().map(|block| of(block.corner) + of(block.size())).max().unwrap_or_default()
    };
    // The legend below the blocks needs the width of the largest of them.
    let size = ((end(|at| at.0) + 20).max(LEGEND) as u32, (end(|at| at.1) + 60) as u32);
    sure_picture(size, |area| draw(area, &blocks, end(|at| at.1)))
}

fn draw(area: &Area, blocks: &[Block], bottom: i32) -> Drawn {
    let font = |size: i32| ("sans-serif", size).into_font();
    let right = font(13).color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
    let upward = font(13).transform(FontTransform::Rotate270).color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    let inside = font(11).color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
    for block in blocks {
        let (left, top) = (block.corner.0 + LEFT, block.corner.1 + TOP);
        for (column, method) in block.methods.iter().enumerate() {
            let x = left + WIDE * column as i32 + WIDE / 2;
            area.draw(&Text::new(*method, (x, top - 8), upward.clone()))?;
        }
        for (k, row) in block.rows.iter().enumerate() {
            let y = top + HIGH * k as i32;
            area.draw(&Text::new(row.scene, (left - 8, y + HIGH / 2), right.clone()))?;
            for (column, method) in block.methods.iter().enumerate() {
                let x = left + WIDE * column as i32;
                let frame = [(x + 1, y + 1), (x + WIDE - 1, y + HIGH - 1)];
                let Some(cell) = cell_of(row, method) else {
                    area.draw(&Rectangle::new(frame, RGBColor(246, 246, 246).filled()))?;
                    continue;
                };
                area.draw(&Rectangle::new(frame, colour(cell.verdict).filled()))?;
                let shown = match cell.verdict {
                    Verdict::Exact | Verdict::Within | Verdict::Refused => figure(cell),
                    Verdict::Fails => "fails".to_owned(),
                    Verdict::Degrades => cell.figure.map_or_else(String::new, short),
                    Verdict::Defect => "DEFECT".to_owned(),
                };
                area.draw(&Text::new(shown, (x + WIDE / 2, y + HIGH / 2), inside.clone()))?;
            }
        }
    }
    let (mut x, y) = (20, bottom + 24);
    let left = font(13).color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    for verdict in Verdict::ALL {
        area.draw(&Rectangle::new([(x, y), (x + 18, y + 14)], colour(verdict).filled()))?;
        area.draw(&Text::new(verdict.name(), (x + 24, y + 7), left.clone()))?;
        x += 50 + 8 * verdict.name().len() as i32;
    }
    Ok(())
}
