//! The findings as sentences.

use super::{Entry, Findings, MeasuredRow, Range};

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

fn angle(entry: &Entry) -> String {
    let x = entry.angle_deg;
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
    pub fn verdict(&self, row: &MeasuredRow) -> Vec<String> {
        let mut said = Vec::new();
        let few = self.points.iter().map(|p| p.cot).fold(Vec::new(), |mut all: Vec<f64>, cot| {
            if !all.contains(&cot) {
                all.push(cot);
            }
            all
        });
        if self.consistent() {
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
            for (entry, _) in row.entries.iter().zip(&self.points).filter(|(_, point)| point.range.is_none()) {
                said.push(format!(
                    "at {}° energy_root {} is below newton {} by more than their rounding: no H gives E < e",
                    angle(entry),
                    entry.energy_root.value,
                    entry.newton.value
                ));
            }
            said.push("no symmetric positive definite H gives these values within their rounding".into());
            let nearest = match self.fit.h_and_d {
                Some((h, d)) => format!("the best fit, h = {} and D = {},", digits(h), digits(d)),
                None => "the best fit (h and D unbounded)".into(),
            };
            said.push(format!("{nearest} needs {} times the rounding errors allowed", digits(self.fit.factor)));
            for change in &self.changes {
                let entry = &row.entries[change.entry];
                let ranges = change.to.iter().map(|r| format!("{} … {}", digits(r.least), digits(r.most)));
                said.push(format!(
                    "consistent if {} at {}° were {}",
                    change.column.name(),
                    angle(entry),
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
            Some(if seen.agree() {
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
