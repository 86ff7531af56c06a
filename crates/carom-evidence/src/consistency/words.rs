//! The findings as sentences.

use super::Findings;
use super::range::{Pose, Range};
use std::io::{self, Write};

/// A number with four significant digits.
pub(crate) fn digits(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{x:.3e}");
    }
    let before = size.log10().floor() as i32 + 1;
    format!("{x:.*}", usize::try_from(4 - before).unwrap_or(0))
}

fn angle(x: f64) -> String {
    if (1e-3..).contains(&x) { x.to_string() } else { format!("{x:e}") }
}

impl Range {
    /// The range of a quantity `name` as text.
    pub(crate) fn words(&self, name: &str) -> String {
        match (self.least.is_finite(), self.most.is_finite()) {
            (true, true) => format!("{name} from {} to {}", digits(self.least), digits(self.most)),
            (true, false) => format!("{name} ≥ {}", digits(self.least)),
            (false, true) => format!("{name} ≤ {}", digits(self.most)),
            (false, false) => format!("any {name}"),
        }
    }
}

impl Findings {
    /// The verdict on the row, one clause for each finding.
    pub(super) fn clauses(&self) -> Vec<String> {
        let mut said = Vec::new();
        let few = self.points.iter().map(|p| p.entry.cot).fold(Vec::new(), |mut all: Vec<f64>, cot| {
            if !all.contains(&cot) {
                all.push(cot);
            }
            all
        });
        if self.consistent {
            said.push("a symmetric positive definite H gives these values within their rounding".into());
            for branch in &self.branches {
                let sides = match (branch.below, self.points.len() - branch.below) {
                    (_, 0) => "all cot α below h".into(),
                    (0, _) => "all cot α above h".into(),
                    (below, above) => format!("{below} cot α below h, {above} above"),
                };
                said.push(format!("{}, {} ({sides})", branch.h.words("h"), branch.d.words("D")));
            }
            if few.len() <= 2 {
                said.push("two angles can always be fitted: the test needs at least three different angles".into());
            } else {
                said.push(format!("the rounding errors needed are {} times those allowed", digits(self.fit.factor)));
            }
        } else {
            for entry in self.points.iter().filter(|point| point.range.is_none()).map(|point| &point.entry) {
                said.push(format!(
                    "at {}° energy_root {} is below newton {} by more than their rounding: no H gives E < e",
                    angle(entry.angle_deg),
                    entry.energy_root.value,
                    entry.newton.value
                ));
            }
            said.push("no symmetric positive definite H gives these values within their rounding".into());
            let nearest = match self.fit.at {
                Some(Pose { h, d }) => format!("the best fit, h = {} and D = {},", digits(h), digits(d)),
                None => "the best fit (h and D unbounded)".into(),
            };
            said.push(format!("{nearest} needs {} times the rounding errors allowed", digits(self.fit.factor)));
            for change in &self.changes {
                let ranges = change.to.iter().map(|r| format!("{} … {}", digits(r.least), digits(r.most)));
                said.push(format!(
                    "consistent if {} at {}° were {}",
                    change.column.name(),
                    angle(change.angle_deg),
                    ranges.collect::<Vec<_>>().join(" or ")
                ));
            }
            if self.changes.is_empty() {
                said.push("no change of a single value makes the row consistent".into());
            }
        }
        said.extend(self.directions.and_then(|seen| {
            let Some(h) = seen.h else {
                return Some("the observed changes of tangential velocity contradict each other: no h gives all".to_owned());
            };
            let needs = format!("the observed changes of tangential velocity require {}", h.words("h"));
            let factor = digits(seen.factor?);
            Some(if seen.agree {
                format!("{needs}; together with the energies this is consistent, with {factor} times the rounding errors")
            } else {
                format!(
                    "{needs}; together with the energies this is inconsistent: it needs {factor} times the rounding errors"
                )
            })
        }));
        said
    }
}

/// Seven decimals from 1e-4 to 1e6, exponents outside.
#[doc(hidden)]
pub fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        size if (1e-4..1e6).contains(&size) => format!("{x:.7}"),
        _ => format!("{x:.6e}"),
    }
}

/// Prints the findings of all rows as text.
///
/// # Errors
/// Those of `out`.
pub fn print(rows: &[Findings], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "Y = √((1−e²)/(1−E²) − 1) of a frictionless impact is |cot α − h|/√D: a V over cot α.")?;
    for row in rows {
        writeln!(out)?;
        writeln!(out, "{}: {}", row.row, if row.consistent { "consistent" } else { "NOT consistent" })?;
        writeln!(
            out,
            "{:>8} {:>9} {:>7} {:>7} {:>9}   {:19}   tangential velocity: v_t⁺/V and its change",
            "angle", "cot α", "e", "E", "Y", "Y within rounding"
        )?;
        for point in &row.points {
            let entry = &point.entry;
            let number = |x: Option<f64>| x.map_or_else(|| "–".into(), |x| format!("{x:.5}"));
            let range = |Range { least, most }: &Range, no: &str| {
                let end = |x: &f64| if x.is_finite() { format!("{x:.4}") } else { no.to_owned() };
                if least == most && least.is_finite() {
                    end(least)
                } else {
                    format!("{} … {}", end(least), end(most))
                }
            };
            let y = point.range.as_ref().map_or_else(|| "none: E < e".into(), |y| range(y, "∞"));
            let implied = point.implied.as_ref().map_or_else(String::new, |implied| {
                let changes: Vec<&str> = implied.changes.iter().map(|change| change.name()).collect();
                format!("{:19} {}", range(&implied.velocity, "unbounded"), changes.join(" or "))
            });
            let seen = entry.seen.map_or_else(String::new, |seen| format!(" (seen: {})", seen.name()));
            writeln!(
                out,
                "{:>8} {:>9.5} {:>7} {:>7} {:>9}   {y:19}   {implied}{seen}",
                entry.angle_deg,
                entry.cot,
                entry.newton.value,
                entry.energy_root.value,
                number(point.y)
            )?;
        }
        if let (false, Some(Pose { h, d })) = (row.consistent, row.fit.at) {
            writeln!(out, "  (tangential velocities are those of the best fit: h = {}, D = {})", short(h), short(d))?;
        }
        for sentence in &row.verdict {
            writeln!(out, "  - {sentence}")?;
        }
    }
    writeln!(out)?;
    writeln!(
        out,
        "Tested is the table against eqs. (10) to (16) only: a rigid, frictionless impact with Newton's coefficient."
    )
}
