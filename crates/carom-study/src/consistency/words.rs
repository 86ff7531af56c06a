//! The findings in words that stay with the arithmetic.

use super::{Entry, Findings, MeasuredRow, Range};

/// Four digits.
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
    /// `name` within it, in words.
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
    /// What the arithmetic says of the row, one sentence each.
    pub fn verdict(&self, row: &MeasuredRow) -> Vec<String> {
        let mut said = Vec::new();
        let few = self.points.iter().map(|p| p.cot).fold(Vec::new(), |mut all: Vec<f64>, cot| {
            if !all.contains(&cot) {
                all.push(cot);
            }
            all
        });
        if self.consistent() {
            said.push("some symmetric positive definite H gives these entries within their rounding".into());
            for branch in &self.branches {
                let sides = match (branch.below, self.points.len() - branch.below) {
                    (_, 0) => "all cot α below h".into(),
                    (0, _) => "all cot α above h".into(),
                    (below, above) => format!("{below} cot α below h, {above} above"),
                };
                said.push(format!("it has {}, {} ({sides})", branch.h.words("h"), branch.d.words("D")));
            }
            if few.len() <= 2 {
                said.push("a V passes through any two points: it takes three angles to contradict one another".into());
            } else {
                said.push(format!("{} of the rounding would be enough", digits(self.fit.factor)));
            }
        } else {
            for (entry, _) in row.entries.iter().zip(&self.points).filter(|(_, point)| point.range.is_none()) {
                said.push(format!(
                    "at {}° the energy_root {} is less than the newton {} beyond their rounding: no H gives E < e",
                    angle(entry),
                    entry.energy_root.value,
                    entry.newton.value
                ));
            }
            said.push(
                "no symmetric positive definite H gives these entries, whatever h and D, within the rounding".into(),
            );
            let nearest = match self.fit.h_and_d {
                Some((h, d)) => format!("the nearest V, h = {} and D = {}", digits(h), digits(d)),
                None => "the nearest V, which is flat (h and D without bound)".into(),
            };
            said.push(format!("{nearest}, would need {} times the rounding", digits(self.fit.factor)));
            for change in &self.changes {
                let entry = &row.entries[change.entry];
                let ranges = change.to.iter().map(|r| format!("{} … {}", digits(r.least), digits(r.most)));
                said.push(format!(
                    "changing {} at {}° to {} would do",
                    change.column.name(),
                    angle(entry),
                    ranges.collect::<Vec<_>>().join(" or ")
                ));
            }
            if self.changes.is_empty() {
                said.push("no change of a single entry would do".into());
            }
        }
        said.extend(self.directions.and_then(|seen| {
            let Some(h) = seen.h else {
                return Some("what was seen of the tangential velocity contradicts itself: no h gives it".to_owned());
            };
            let needs = format!("what was seen of the tangential velocity needs {}", h.words("h"));
            let factor = digits(seen.factor?);
            Some(if seen.agree() {
                format!("{needs}; an H gives it together with the energies, with {factor} of the rounding")
            } else {
                format!(
                    "{needs}; no H gives it together with the energies: that would need {factor} times the rounding"
                )
            })
        }));
        said
    }
}
