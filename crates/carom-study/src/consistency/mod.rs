//! Are measured restitutions and energies consistent with one frictionless rigid impact? The inverse of eqs. (10) to (16).
//!
//! | symbol | meaning | here |
//! | --- | --- | --- |
//! | α | angle between the tip's path and the surface | [`Entry::angle_deg`] |
//! | e | Newton's coefficient, eq. (11) | [`Entry::newton`] |
//! | E | √(T⁺/T⁻), eq. (16); a ratio of kinetic energies, not Stronge's coefficient | [`Entry::energy_root`] |
//! | h | tᵀHn / nᵀHn, with n into the surface and t along the approach | [`Branch::h`] |
//! | D | det H / (nᵀHn)² > 0 | [`Branch::d`] |
//! | Y | √((1−e²)/(1−E²) − 1) | [`Point::y`] |
//!
//! With v⁻ = V (cos α, sin α) in (t, n) and `T = ½ vᵀH⁻¹v`, the frictionless impact with Newton's coefficient leaves
//!
//! ```text
//! T⁺/T⁻ = 1 − (1−e²) / (1 + (cot α − h)²/D)      so that      Y = |cot α − h| / √D
//! ```
//!
//! Over cot α, Y is a V of slopes ±1/√D with its foot at h: two numbers of the pose for all angles, whatever the speed.
//! Every (h, D) with D > 0 is that of some symmetric positive definite H (nᵀHn = 1, tᵀHn = h, tᵀHt = D + h²), so a row
//! of measurements comes from a frictionless impact if and only if a V passes through all its intervals of Y.
//!
//! In (a, b) = (1/√D, h/√D) each interval is a pair of strips `|a cot α − b| ∈ [Y₁, Y₂]`, and which of the two is told by
//! the side of the foot on which the angle lies: n angles have n + 1 such choices, the [`Branch`]es, each a convex polygon.
//! Clipping them is exact up to rounding of `f64`; nothing is searched or sampled.
//!
//! The same (h, e) fixes the tangential velocity after, `v_t⁺ = V (cos α − h (1+e) sin α)`, eq. (15).

mod measured;
mod region;
mod v_plot;
mod words;

pub use measured::{Entry, MeasuredError, MeasuredRow, Rounded, Seen, measured_from, read_measured};
pub use v_plot::v_plot;

use crate::paper::Tangential;
use nalgebra::Vector3;
use region::Region;

/// What lies between two numbers; infinite where nothing bounds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The lower end.
    pub least: f64,
    /// The upper end.
    pub most: f64,
}

impl Range {
    fn over(numbers: impl Iterator<Item = f64>) -> Self {
        let none = Self { least: f64::INFINITY, most: f64::NEG_INFINITY };
        numbers.fold(none, |r, x| Self { least: r.least.min(x), most: r.most.max(x) })
    }

    /// Whether it holds the number.
    pub fn holds(&self, x: f64) -> bool {
        (self.least..=self.most).contains(&x)
    }
}

/// One measurement, as a point of the V.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// cot α.
    pub cot: f64,
    /// Y of the printed digits; `None` where they have E < e, or E = 1.
    pub y: Option<f64>,
    /// Y of everything that rounds to the printed digits; `None` where all of it has E < e, which no H gives.
    pub range: Option<Range>,
}

/// (h, D) on one choice of sides: so many angles have their cot α below h.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Branch {
    /// How many of the row's angles have cot α < h.
    pub below: usize,
    /// All h that are compatible with the rounding.
    pub h: Range,
    /// All D that are.
    pub d: Range,
}

/// The V that needs the least rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// By how much the printed half units would have to be multiplied for this V to pass through: at most 1 if the row is
    /// consistent.
    pub factor: f64,
    /// (h, D); `None` if the V that is sought has no foot: h and D without bound.
    pub h_and_d: Option<(f64, f64)>,
}

/// What a V implies for the tangential velocity of one measurement, eq. (15).
#[derive(Debug, Clone, PartialEq)]
pub struct Implied {
    /// v_t⁺/V. An outer bound: h and e are taken as if independent within their ranges.
    pub velocity: Range,
    /// All that it may do; one if the rounding leaves no choice.
    pub changes: Vec<Tangential>,
}

/// A number of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Column {
    /// e.
    Newton,
    /// E.
    EnergyRoot,
}

impl Column {
    /// Its name in the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Newton => "newton",
            Self::EnergyRoot => "energy_root",
        }
    }

    /// Its number in a measurement.
    pub fn of(self, entry: &Entry) -> Rounded {
        match self {
            Self::Newton => entry.newton,
            Self::EnergyRoot => entry.energy_root,
        }
    }
}

/// One number whose change alone would make the row consistent.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Index of its measurement in the row.
    pub entry: usize,
    /// Which number.
    pub column: Column,
    /// The values that would do, all others staying within their rounding.
    pub to: Vec<Range>,
}

/// Whether energies and observed directions of the tangential velocity are those of one H.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Directions {
    /// h by the directions alone; `None` if they contradict one another.
    pub h: Option<Range>,
    /// As [`Fit::factor`] for energies and directions together; `None` where the directions contradict one another.
    pub factor: Option<f64>,
}

impl Directions {
    /// Whether one H gives both.
    pub fn agree(&self) -> bool {
        self.factor.is_some_and(|factor| factor <= 1.0)
    }
}

/// What the arithmetic says of one row.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// The measurements as points of the V, in the row's order.
    pub points: Vec<Point>,
    /// (h, D) compatible with the rounding; empty if no symmetric positive definite H gives the row.
    pub branches: Vec<Branch>,
    /// The V that needs the least rounding.
    pub fit: Fit,
    /// The tangential velocities of all compatible (h, D), or of the fit where there are none; in the row's order, empty if
    /// there is no V at all.
    pub implied: Vec<Implied>,
    /// The single numbers whose change would make an inconsistent row consistent.
    pub changes: Vec<Change>,
    /// What was seen of the tangential velocities, if anything.
    pub directions: Option<Directions>,
}

impl Findings {
    /// Whether some H gives the row within its rounding.
    pub fn consistent(&self) -> bool {
        !self.branches.is_empty()
    }
}

/// Solves the inverse problem for one row.
pub fn consistency(row: &MeasuredRow) -> Findings {
    let points: Vec<Point> = row.entries.iter().map(Point::of).collect();
    let regions = regions(row, 1.0, &[], &[]);
    let branch = |(below, r): &(usize, Region)| Branch { below: *below, h: r.h(), d: r.d() };
    let branches: Vec<Branch> = regions.iter().map(branch).collect();
    let (factor, nearest) = least_factor(row, &[]);
    let fit = Fit { factor, h_and_d: nearest.and_then(|region| region.middle()) };
    let spans: Vec<Range> = match fit.h_and_d {
        _ if !branches.is_empty() => branches.iter().map(|b| b.h).collect(),
        Some((h, _)) => vec![Range { least: h, most: h }],
        None => Vec::new(),
    };
    let implied = if spans.is_empty() {
        Vec::new()
    } else {
        row.entries.iter().map(|entry| implied(entry, &spans, !branches.is_empty())).collect()
    };
    let changes = if branches.is_empty() { changes(row) } else { Vec::new() };
    Findings { points, branches, fit, implied, changes, directions: directions(row) }
}

impl Point {
    fn of(entry: &Entry) -> Self {
        let exact = |x: f64| Range { least: x, most: x };
        let y = y_range(exact(entry.newton.value), exact(entry.energy_root.value));
        let range = y_range(entry.newton.range(1.0), entry.energy_root.range(1.0));
        Self { cot: entry.cot(), y: y.filter(|y| y.least == y.most && y.most.is_finite()).map(|y| y.least), range }
    }
}

/// Y of ranges of e and E; it grows with E and falls with e.
fn y_range(e: Range, root: Range) -> Option<Range> {
    let y = |e: f64, root: f64| ((root - e) * (root + e) / ((1.0 - root) * (1.0 + root))).sqrt();
    (root.most >= e.least).then(|| Range {
        least: if root.least <= e.most { 0.0 } else { y(e.most, root.least) },
        most: if root.most >= 1.0 { f64::INFINITY } else { y(e.least, root.most) },
    })
}

/// The regions of (a, b) compatible with the row, roundings multiplied by `factor`, without the entry `without`, and with
/// further conditions `form` · (a, b, w) ≥ 0; each with the number of cotangents below h.
fn regions(row: &MeasuredRow, factor: f64, without: &[usize], more: &[Vector3<f64>]) -> Vec<(usize, Region)> {
    let base = more.iter().fold(Region::all(), |region, form| region.clip(*form));
    let mut strips = Vec::new();
    for (k, entry) in row.entries.iter().enumerate().filter(|(k, _)| !without.contains(k)) {
        let Some(y) = y_range(entry.newton.range(factor), entry.energy_root.range(factor)) else {
            return Vec::new();
        };
        strips.push((row.entries[k].cot(), y));
    }
    strips.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut found = Vec::new();
    for below in 0..=strips.len() {
        if below > 0 && strips.get(below).is_some_and(|next| next.0 == strips[below - 1].0) {
            continue; // one angle is on one side
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

/// The least multiple of the rounding with which the row is consistent, by bisection (the regions are nested), and a region
/// of it. `None` where no rounding helps.
fn least_factor(row: &MeasuredRow, more: &[Vector3<f64>]) -> (f64, Option<Region>) {
    let halves = || row.entries.iter().flat_map(|e| [e.newton.half_unit, e.energy_root.half_unit]);
    let finest = halves().fold(f64::INFINITY, f64::min);
    let first = |factor: f64| regions(row, factor, &[], more).into_iter().next().map(|(_, region)| region);
    // from where f64 still tells the ends of the ranges apart, to where they are all of 0 to 1
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
    let (cot, sin) = (entry.cot(), entry.angle_deg.to_radians().sin());
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

/// Each number alone: the values with which the row would be consistent.
fn changes(row: &MeasuredRow) -> Vec<Change> {
    let mut found = Vec::new();
    for (k, entry) in row.entries.iter().enumerate() {
        let others = regions(row, 1.0, &[k], &[]);
        let ys: Vec<Range> = others.iter().map(|(_, region)| region.y(entry.cot())).collect();
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
        for (column, to) in [(Column::Newton, merged(newtons)), (Column::EnergyRoot, merged(roots))] {
            if !to.is_empty() {
                found.push(Change { entry: k, column, to });
            }
        }
    }
    found
}

/// Ranges in order, those that meet as one.
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

/// What was seen of the tangential velocity, as conditions on (a, b), at the most permissive e.
fn directions(row: &MeasuredRow) -> Option<Directions> {
    let mut forms = Vec::new();
    for entry in &row.entries {
        let Some(seen) = entry.seen else { continue };
        let (cot, e) = (entry.cot(), entry.newton.range(1.0));
        // in the direction of the approach: h(1+e)/|cot α| in `seen`
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
    Some(Directions { h, factor })
}
