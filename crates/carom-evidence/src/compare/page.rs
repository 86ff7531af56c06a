//! Tables of comparisons in Markdown.

use super::candidates::full;
use super::comparison::{Comparison, FittedCoefficient, Row};
use super::identify::Weakest;
use super::selection::Selected;
use super::statistics::Estimate;
use std::fmt::Write;

/// A number with three or four significant digits.
pub(super) fn short(x: f64) -> String {
    let size = x.abs();
    if size < 5e-6 {
        return "0".into(); // two laws that agree up to rounding
    }
    if size >= 1.0 {
        format!("{x:.3}")
    } else if size >= 0.01 {
        format!("{x:.4}")
    } else {
        format!("{x:.5}")
    }
}

/// The name of a row: its law, the law of several contacts if it is not the default, and its effects.
pub(super) fn name(row: &Row) -> String {
    full(&row.law, row.several, &row.effects)
}

fn pair(of: Estimate) -> String {
    format!("{} ± {}", short(of.mean), short(of.standard_error))
}

/// Range of a coefficient over the folds.
fn coefficients(row: &Row) -> String {
    let of = |fitted: &FittedCoefficient| {
        let (low, high) = fitted.values.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
        let symbol = fitted.symbol;
        let range = if format!("{low:.3}") == format!("{high:.3}") {
            format!("{low:.3}")
        } else {
            format!("{low:.3} … {high:.3}")
        };
        format!("{symbol} {range}")
    };
    row.coefficients.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// The page of a data set: a table for each of its comparisons.
pub fn markdown(comparisons: &[Comparison]) -> String {
    let mut page = String::new();
    let Some(first) = comparisons.first() else { return page };
    let _ = writeln!(page, "# {}\n", first.set);
    for one in comparisons {
        let folds = one.folds.iter().max().map_or(0, |last| last + 1);
        let _ = writeln!(page, "## {}\n", one.what);
        let _ = writeln!(
            page,
            "{} measurements, {} left out, {folds} folds. Error: {}. Every measurement is predicted by coefficients that were \
             fitted without its fold; coefficients are given as their range over the folds. ± is one standard error; \
             differences to the best are paired.\n",
            one.numbers.len(),
            one.left_out,
            one.measure
        );
        page.push_str(&table(one));
        page.push('\n');
    }
    page
}

/// The table of a comparison.
fn table(one: &Comparison) -> String {
    let mut page = String::new();
    let threshold = one.rows.iter().any(|row| row.below_threshold.is_some());
    let refused = one.rows.iter().any(|row| row.refused > 0);
    let effects = one.rows.iter().any(|row| row.to_simpler.is_some());
    let columns = [
        Some("law"),
        Some("coefficients"),
        Some("mean"),
        Some("median"),
        threshold.then_some("share below 0.5"),
        Some("difference to the best"),
        effects.then_some("difference by the last effect"),
        refused.then_some("refused"),
    ];
    let columns: Vec<&str> = columns.into_iter().flatten().collect();
    let mut line = |cells: &[String]| {
        let _ = writeln!(page, "| {} |", cells.join(" | "));
    };
    line(&columns.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    line(&columns.iter().map(|_| "---".to_owned()).collect::<Vec<_>>());
    for (k, row) in one.rows.iter().enumerate() {
        let estimate = row.error.estimate;
        let mut cells = vec![name(row), coefficients(row), pair(estimate), short(row.error.median)];
        if threshold {
            cells.push(row.below_threshold.map_or(String::new(), |share| format!("{share:.3}")));
        }
        cells.push(if k == 0 { "–".into() } else { pair(row.to_best) });
        if effects {
            cells.push(row.to_simpler.map_or(String::new(), pair));
        }
        if refused {
            cells.push(row.refused.to_string());
        }
        line(&cells);
    }
    for (name, spread) in [("best impulse at the point", one.bound), ("floor: noise of the start", one.floor)] {
        let Some(spread) = spread else { continue };
        let mut cells = vec![name.to_owned(), String::new(), pair(spread.estimate), short(spread.median)];
        cells.resize(columns.len(), String::new());
        line(&cells);
    }
    if let Some(Selected { models, error, to_constant, .. }) = &one.selected {
        let mut each: Vec<(&String, usize)> = Vec::new();
        for model in models {
            match each.iter_mut().find(|(other, _)| *other == model) {
                Some((_, count)) => *count += 1,
                None => each.push((model, 1)),
            }
        }
        let each: Vec<String> =
            each.iter().map(|(model, count)| format!("{model} ({count} of {})", models.len())).collect();
        let _ = writeln!(
            page,
            "\nSelected inside the training folds: {}. Mean {}, median {}; difference to the constant law selected in the \
             same way {}.",
            each.join(", "),
            pair(error.estimate),
            short(error.median),
            pair(*to_constant)
        );
    }
    if let Some(Weakest { model, direction, deviation, least_deviation }) = &one.weakest {
        let mut parts = direction.clone();
        parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        parts.retain(|(_, w)| w.abs() >= 0.2);
        let parts: Vec<String> = parts.iter().map(|(name, w)| format!("{w:+.2} {name}")).collect();
        let _ = writeln!(
            page,
            "\nLeast determined combination of the parameters of {model}, as shares of their ranges: {}; standard deviation \
             {} along it, {} along the best determined one.",
            parts.join(" "),
            short(*deviation),
            short(*least_deviation)
        );
    }
    page
}

/// One row for each comparison: its best law, the next one, and the bound or floor.
pub fn summary(comparisons: &[Comparison]) -> String {
    let mut page = String::from(
        "# Summary\n\n| set | compared | measurements | best law | mean | next law, paired difference | laws within two standard errors | bound or floor |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for one in comparisons {
        let Some(best) = one.rows.first() else { continue };
        let next = one.rows.get(1).map_or(String::new(), |row| format!("{}, {}", name(row), pair(row.to_best)));
        let level = one.rows.iter().filter(|row| row.to_best.mean <= 2.0 * row.to_best.standard_error).count();
        let limit = one.bound.or(one.floor).map_or(String::new(), |spread| short(spread.estimate.mean));
        let estimate = best.error.estimate;
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} ± {} | {next} | {level} of {} | {limit} |",
            one.set,
            one.what,
            one.numbers.len(),
            name(best),
            short(estimate.mean),
            short(estimate.standard_error),
            one.rows.len()
        );
    }
    page
}
