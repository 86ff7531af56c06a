//! Tests whether measured restitution coefficients and energy ratios are consistent with frictionless rigid impacts in one
//! pose. This is the inverse problem of eqs. (10) to (16) of the paper.
//!
//! | symbol | meaning | here |
//! | --- | --- | --- |
//! | α | angle between the tip's velocity before the impact and the surface | `Entry::angle_deg` |
//! | e | Newton's coefficient of restitution, eq. (11) | `Entry::newton` |
//! | E | √(T⁺/T⁻), eq. (16); a ratio of kinetic energies, not Stronge's coefficient | `Entry::energy_root` |
//! | h | tᵀHn / nᵀHn, with n into the surface and t along the approach | `Branch::h` |
//! | D | det H / (nᵀHn)² > 0 | `Branch::d` |
//! | Y | √((1−e²)/(1−E²) − 1) | `Point::y` |
//!
//! With v⁻ = V (cos α, sin α) in (t, n) and `T = ½ vᵀH⁻¹v`, a frictionless impact with Newton's coefficient gives
//!
//! ```text
//! T⁺/T⁻ = 1 − (1−e²) / (1 + (cot α − h)²/D)      so that      Y = |cot α − h| / √D
//! ```
//!
//! As a function of cot α, Y is V-shaped with slopes ±1/√D and its minimum, 0, at cot α = h. The parameters h and D depend on
//! the pose only, not on angle or speed. Each (h, D) with D > 0 belongs to a symmetric positive definite H (nᵀHn = 1,
//! tᵀHn = h, tᵀHt = D + h²). So a row of measurements is consistent with frictionless impacts if and only if one such
//! V-shaped function passes through all its intervals of Y.
//!
//! In (a, b) = (1/√D, h/√D) each interval is a pair of strips `|a cot α − b| ∈ [Y₁, Y₂]`, one for each side of the minimum.
//! For n angles there are n + 1 assignments of the angles to the two sides, the `Branch`es. The admissible set of each is
//! a convex polygon, computed by clipping, which is exact up to rounding of `f64`.
//!
//! The same h and e determine the tangential velocity after the impact, `v_t⁺ = V (cos α − h (1+e) sin α)`, eq. (15).

mod measured;
mod range;
mod region;
mod v_plot;
mod words;

pub(crate) use measured::measured_from;
pub use measured::{MeasuredRow, read_measured};
pub use v_plot::v_plot;
pub use words::{print, short};

use crate::paper::Tangential;
use measured::{Entry, Rounded};
use nalgebra::Vector3;
use range::{Pose, Range};
use region::Region;
use serde::Serialize;

/// One measurement in the coordinates (cot α, Y).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Point {
    #[serde(flatten)]
    pub entry: Entry,
    /// Y of the printed values; `None` if they have E < e, or E = 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<f64>,
    /// Y of all values that round to the printed ones; `None` if all of them have E < e, which no H gives.
    #[serde(rename = "y_range", skip_serializing_if = "Option::is_none")]
    pub range: Option<Range>,
    /// The tangential velocity after the impact by all compatible (h, D), or by [`Findings::fit`] if there are none; `None` if
    /// neither exists.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub implied: Option<Implied>,
}

/// The admissible (h, D) of one assignment of the angles to the two sides of h.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Branch {
    /// Number of the row's angles with cot α < h.
    pub below: usize,
    /// Range of h compatible with the rounding.
    pub h: Range,
    /// Range of D compatible with the rounding.
    pub d: Range,
}

/// The (h, D) that needs the least rounding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Fit {
    /// The least factor on the rounding errors (half units of the last digit) with which the row is consistent; at most 1 for
    /// a consistent row.
    pub factor: f64,
    /// h and D at this factor; `None` if they have no bound there.
    #[serde(flatten)]
    pub at: Option<Pose>,
}

/// Tangential velocity after one measured impact by eq. (15).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Implied {
    /// v_t⁺/V. An outer bound: the ranges of h and e are treated as independent.
    #[serde(rename = "tangential_per_speed")]
    pub velocity: Range,
    /// All changes of the tangential velocity that are compatible with this range.
    pub changes: Vec<Tangential>,
}

/// A measured quantity of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Column {
    /// e.
    Newton,
    /// E.
    EnergyRoot,
}

carom_study::words! { Column { Newton "newton", EnergyRoot "energy_root" } }

/// A single value whose change alone makes the row consistent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Change {
    /// Index of the measurement in the row, and its angle.
    #[serde(skip)]
    pub entry: usize,
    pub angle_deg: f64,
    /// Column of the value, and the value.
    pub column: Column,
    pub from: f64,
    /// The values that make the row consistent, with all others within their rounding.
    pub to: Vec<Range>,
}

/// Consistency of the energies with the observed directions of the tangential velocity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Directions {
    /// Whether one H gives both within the rounding.
    pub agree: bool,
    /// Range of h by the directions alone; `None` if they contradict one another.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub h: Option<Range>,
    /// As [`Fit::factor`], for energies and directions together; `None` if the directions contradict one another, or if no
    /// factor makes both consistent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub factor: Option<f64>,
}

/// Results of the consistency test of one row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Findings {
    /// Name of the pose.
    pub(crate) row: String,
    /// Whether a symmetric positive definite H gives the row within its rounding.
    pub(crate) consistent: bool,
    /// The measurements, in the order of the row.
    pub(crate) points: Vec<Point>,
    /// The (h, D) compatible with the rounding; empty if no symmetric positive definite H gives the row.
    pub(crate) branches: Vec<Branch>,
    /// The (h, D) that needs the least rounding.
    pub(crate) fit: Fit,
    /// For an inconsistent row: the single values whose change alone makes it consistent.
    pub(crate) changes: Vec<Change>,
    /// Consistency with the observed directions of the tangential velocity; `None` if none were observed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) directions: Option<Directions>,
    /// The verdict, one clause for each finding.
    pub(crate) verdict: Vec<String>,
}

/// Solves the inverse problem for one row.
pub fn consistency(row: &MeasuredRow) -> Findings {
    let regions = regions(row, 1.0, &[], &[]);
    let branch = |(below, r): &(usize, Region)| Branch { below: *below, h: r.h(), d: r.d() };
    let branches: Vec<Branch> = regions.iter().map(branch).collect();
    let (factor, nearest) = least_factor(row, &[]);
    let fit = Fit { factor, at: nearest.and_then(|region| region.middle()) };
    let spans: Vec<Range> = match fit.at {
        _ if !branches.is_empty() => branches.iter().map(|b| b.h).collect(),
        Some(Pose { h, .. }) => vec![Range { least: h, most: h }],
        None => Vec::new(),
    };
    let consistent = !branches.is_empty();
    let implied = |entry: &Entry| (!spans.is_empty()).then(|| implied(entry, &spans, consistent));
    let mut found = Findings {
        row: row.name.clone(),
        consistent,
        points: row.entries.iter().map(|entry| Point::of(entry, implied(entry))).collect(),
        branches,
        fit,
        changes: if consistent { Vec::new() } else { changes(row) },
        directions: directions(row),
        verdict: Vec::new(),
    };
    found.verdict = found.clauses();
    found
}

impl Point {
    fn of(entry: &Entry, implied: Option<Implied>) -> Self {
        let exact = |x: f64| Range { least: x, most: x };
        let y = y_range(exact(entry.newton.value), exact(entry.energy_root.value));
        let y = y.filter(|y| y.least == y.most && y.most.is_finite()).map(|y| y.least);
        Self { entry: entry.clone(), y, range: y_range(entry.newton.range(1.0), entry.energy_root.range(1.0)), implied }
    }
}

/// Range of Y for ranges of e and E. Y increases with E and decreases with e.
fn y_range(e: Range, root: Range) -> Option<Range> {
    let y = |e: f64, root: f64| ((root - e) * (root + e) / ((1.0 - root) * (1.0 + root))).sqrt();
    (root.most >= e.least).then(|| Range {
        least: if root.least <= e.most { 0.0 } else { y(e.most, root.least) },
        most: if root.most >= 1.0 { f64::INFINITY } else { y(e.least, root.most) },
    })
}

/// The regions of (a, b) compatible with the row, with the rounding errors multiplied by `factor`, without the entries
/// `without`, and with further conditions `form` · (a, b, w) ≥ 0; each with the number of cotangents below h.
fn regions(row: &MeasuredRow, factor: f64, without: &[usize], more: &[Vector3<f64>]) -> Vec<(usize, Region)> {
    let base = more.iter().fold(Region::all(), |region, form| region.clip(*form));
    let mut strips = Vec::new();
    for (k, entry) in row.entries.iter().enumerate().filter(|(k, _)| !without.contains(k)) {
        let Some(y) = y_range(entry.newton.range(factor), entry.energy_root.range(factor)) else {
            return Vec::new();
        };
        strips.push((row.entries[k].cot, y));
    }
    strips.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut found = Vec::new();
    for below in 0..=strips.len() {
        if below > 0 && strips.get(below).is_some_and(|next| next.0 == strips[below - 1].0) {
            continue; // equal angles are on the same side
        }
        let mut region = base.clone();
        for (k, (cot, y)) in strips.iter().enumerate() {
            region = region.strip(*cot, if k < below { -1.0 } else { 1.0 }, *y);
            if !region.holds_some() {
                break;
            }
        }
        if region.holds_some() {
            found.push((below, region));
        }
    }
    found
}

/// The least factor on the rounding errors with which the row is consistent, by bisection (the regions are nested), and a
/// region at this factor. `None` if there is no such factor.
fn least_factor(row: &MeasuredRow, more: &[Vector3<f64>]) -> (f64, Option<Region>) {
    let halves = || row.entries.iter().flat_map(|e| [e.newton.half_unit, e.energy_root.half_unit]);
    let finest = halves().fold(f64::INFINITY, f64::min);
    let first = |factor: f64| regions(row, factor, &[], more).into_iter().next().map(|(_, region)| region);
    // from the resolution of f64 to ranges that cover 0 to 1
    let (mut low, mut high) = (Rounded::FINEST / finest, 1.0 / finest);
    let Some(mut region) = first(high) else { return (f64::INFINITY, None) };
    if let Some(sharp) = first(low) {
        return (low, Some(sharp));
    }
    while high / low > 1.0 + 1e-9 {
        let middle = (low * high).sqrt();
        match first(middle) {
            Some(found) => (high, region) = (middle, found),
            None => low = middle,
        }
    }
    (high, Some(region))
}

fn implied(entry: &Entry, spans: &[Range], rounded: bool) -> Implied {
    let (cot, sin) = (entry.cot, entry.angle_deg.to_radians().sin());
    let e =
        if rounded { entry.newton.range(1.0) } else { Range { least: entry.newton.value, most: entry.newton.value } };
    let corners = |span: &Range| {
        [
            span.least * (1.0 + e.least),
            span.least * (1.0 + e.most),
            span.most * (1.0 + e.least),
            span.most * (1.0 + e.most),
        ]
    };
    let velocity = Range::over(spans.iter().flat_map(corners).map(|jump| sin * (cot - jump)));
    let before = sin * cot;
    let mut changes = Vec::new();
    for kind in [Tangential::Grows, Tangential::Shrinks, Tangential::Reverses] {
        // v_t⁺/v_t⁻: above 1, between 0 and 1, below 0
        let can = spans.iter().any(|span| {
            let after = Range::over(corners(span).into_iter().map(|jump| sin * (cot - jump) * before.signum()));
            match kind {
                Tangential::Grows => after.most > before.abs(),
                Tangential::Shrinks => after.most >= 0.0 && after.least <= before.abs(),
                _ => after.least < 0.0,
            }
        });
        if cot != 0.0 && can {
            changes.push(kind);
        }
    }
    if cot == 0.0 {
        changes.push(Tangential::Appears);
    }
    Implied { velocity, changes }
}

/// For each value: the values with which it alone would make the row consistent.
fn changes(row: &MeasuredRow) -> Vec<Change> {
    let mut found = Vec::new();
    for (k, entry) in row.entries.iter().enumerate() {
        let others = regions(row, 1.0, &[k], &[]);
        let ys: Vec<Range> = others.iter().map(|(_, region)| region.y(entry.cot)).collect();
        let (e, root) = (entry.newton.range(1.0), entry.energy_root.range(1.0));
        // E² = 1 − (1−e²)/(1+Y²) and e² = 1 − (1−E²)(1+Y²)
        let lost = |x: f64| (1.0 - x) * (1.0 + x);
        let to_root = |e: f64, y: f64| (1.0 - lost(e) / (1.0 + y * y)).sqrt();
        let to_newton = |root: f64, y: f64| 1.0 - lost(root) * (1.0 + y * y);
        let roots = ys.iter().map(|y| Range { least: to_root(e.least, y.least), most: to_root(e.most, y.most) });
        let newtons = ys.iter().filter_map(|y| {
            let most = to_newton(root.most, y.least);
            let least = if root.least < 1.0 { to_newton(root.least, y.most) } else { most };
            (most >= 0.0).then(|| Range { least: least.max(0.0).sqrt(), most: most.sqrt() })
        });
        let (newton, energy_root) = (entry.newton.value, entry.energy_root.value);
        for (column, from, to) in
            [(Column::Newton, newton, merged(newtons)), (Column::EnergyRoot, energy_root, merged(roots))]
        {
            if !to.is_empty() {
                found.push(Change { entry: k, angle_deg: entry.angle_deg, column, from, to });
            }
        }
    }
    found
}

/// The ranges in ascending order, with overlapping ones merged.
fn merged(ranges: impl Iterator<Item = Range>) -> Vec<Range> {
    let mut all: Vec<Range> = ranges.collect();
    all.sort_by(|a, b| a.least.total_cmp(&b.least));
    let mut kept: Vec<Range> = Vec::new();
    for range in all {
        match kept.last_mut() {
            Some(last) if range.least <= last.most => last.most = last.most.max(range.most),
            _ => kept.push(range),
        }
    }
    kept
}

/// The observed directions of the tangential velocity as conditions on (a, b), for the most permissive e.
fn directions(row: &MeasuredRow) -> Option<Directions> {
    let mut forms = Vec::new();
    for entry in &row.entries {
        let Some(seen) = entry.seen else { continue };
        let (cot, e) = (entry.cot, entry.newton.range(1.0));
        // along the tangential approach: h(1+e)/|cot α| must lie in `seen.jump()`
        let b = Vector3::y() * cot.signum();
        let a = Vector3::x() * cot.abs();
        let reach = seen.jump();
        if reach.least == 0.0 {
            forms.push(b);
        } else if reach.least == 1.0 {
            forms.push(b * (1.0 + e.most) - a);
        }
        if reach.most == 0.0 {
            forms.push(-b);
        } else if reach.most == 1.0 {
            forms.push(a - b * (1.0 + e.least));
        }
    }
    if forms.is_empty() {
        return None;
    }
    let region = forms.iter().fold(Region::all(), |region, form| region.clip(*form));
    let h = region.holds_some().then(|| region.h());
    let factor = h.and_then(|_| {
        let (factor, region) = least_factor(row, &forms);
        region.map(|_| factor)
    });
    Some(Directions { agree: factor.is_some_and(|factor| factor <= 1.0), h, factor })
}

#[cfg(test)]
#[path = "../../tests/consistency.rs"]
mod tests;
