//! Reads measured coefficients from a CSV file.

use super::range::Range;
use crate::EvidenceError;
use serde::Serialize;
use std::path::Path;

/// Greatest number of measurements of a row.
const MOST: usize = 200;
const COLUMNS: [&str; 5] = ["row", "angle_deg", "newton", "energy_root", "tangential"];

/// A rounded number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Rounded {
    /// The printed value.
    pub value: f64,
    /// Greatest rounding error: half a unit of the last printed digit, or the rounding given.
    pub half_unit: f64,
}

impl Rounded {
    /// Least `half_unit`; smaller errors are below the resolution of the `f64` arithmetic.
    pub const FINEST: f64 = 1e-12;

    /// The values that round to this one, with `half_unit` multiplied by `factor`; clamped to 0 to 1.
    pub(super) fn range(&self, factor: f64) -> Range {
        let half = self.half_unit * factor;
        Range { least: (self.value - half).max(0.0), most: (self.value + half).min(1.0) }
    }

    /// Parses a number; `half_unit` is half a unit of its last digit.
    fn from_digits(text: &str) -> Option<Self> {
        let value: f64 = text.parse().ok()?;
        let (digits, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
        let decimals = digits.split_once('.').map_or(0, |(_, after)| after.len());
        let exponent: i32 = exponent.parse().unwrap_or_default();
        let unit = 10_f64.powi(exponent.saturating_sub(i32::try_from(decimals).unwrap_or(i32::MAX)));
        Some(Self { value, half_unit: (0.5 * unit).max(Self::FINEST) })
    }
}

/// Observed change of the tangential velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seen {
    /// Greater after the impact, in the same direction.
    Grows,
    /// Smaller after the impact, in the same direction.
    Shrinks,
    /// In the opposite direction after the impact.
    Reverses,
    /// `Shrinks` or `Reverses`.
    ShrinksOrReverses,
    /// `Grows` or `Shrinks`: the same direction after the impact.
    GrowsOrShrinks,
}

carom_study::words! {
    Seen {
        Grows "grows",
        Shrinks "shrinks",
        Reverses "reverses",
        ShrinksOrReverses "shrinks or reverses",
        GrowsOrShrinks "grows or shrinks"
    }
}

impl Seen {
    /// Range of the jump h (1+e)/cot α; v_t⁺/v_t⁻ = 1 − jump.
    pub(super) fn jump(self) -> Range {
        let (least, most) = match self {
            Self::Grows => (f64::NEG_INFINITY, 0.0),
            Self::Shrinks => (0.0, 1.0),
            Self::Reverses => (1.0, f64::INFINITY),
            Self::ShrinksOrReverses => (0.0, f64::INFINITY),
            Self::GrowsOrShrinks => (f64::NEG_INFINITY, 1.0),
        };
        Range { least, most }
    }
}

/// One measured impact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Entry {
    /// Angle between the tip's velocity before the impact and the surface, degrees, between 0 and 180 (exclusive); 90 is a
    /// normal impact.
    pub angle_deg: f64,
    /// cot α, exactly 0 at 90°.
    pub cot: f64,
    /// Newton's coefficient of restitution e, between 0 and 1.
    pub newton: Rounded,
    /// E = √(T⁺/T⁻), between 0 and 1.
    pub energy_root: Rounded,
    /// Observed change of the tangential velocity, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seen: Option<Seen>,
}

/// cot α, exactly 0 at 90°.
pub(super) fn cot(angle_deg: f64) -> f64 {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    if angle_deg == 90.0 { 0.0 } else { cos / sin }
}

/// The measurements of one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredRow {
    /// Name of the pose.
    pub(crate) name: String,
    /// The measurements, in the order of the file.
    pub(crate) entries: Vec<Entry>,
}

/// Reads measurements from a CSV file with a header and these columns, in any order:
///
/// | column | meaning |
/// | --- | --- |
/// | `row` | name of the pose; lines with the same name form one row |
/// | `angle_deg` | α, degrees |
/// | `newton` | e |
/// | `energy_root` | E = √(T⁺/T⁻) |
/// | `tangential` | optional, may be empty: `grows`, `shrinks`, `reverses`, `shrinks or reverses`, `grows or shrinks` |
///
/// Lines that begin with `#` are comments. The rounding error of a number is half a unit of its last printed digit (so `0.30`
/// differs from `0.3`), or `rounding` if that is given, from 1e-12 to 1.
///
/// # Errors
/// [`EvidenceError`] with file, line, row, column, value and rule.
pub fn read_measured(path: &Path, rounding: Option<f64>) -> Result<Vec<MeasuredRow>, EvidenceError> {
    let text = std::fs::read_to_string(path);
    let text = text.map_err(|reason| EvidenceError::of_file(path, format!("cannot be read: {reason}")))?;
    measured_from(&text, path, rounding)
}

/// As [`read_measured`], from text; `path` is the file name in messages.
///
/// # Errors
/// As [`read_measured`].
pub(crate) fn measured_from(text: &str, path: &Path, rounding: Option<f64>) -> Result<Vec<MeasuredRow>, EvidenceError> {
    let shape = |rule: String| EvidenceError::of_file(path, rule);
    if let Some(rounding) = rounding
        && !(Rounded::FINEST..=1.0).contains(&rounding)
    {
        return Err(shape(format!(
            "the rounding is {rounding}: it must lie between {:e} (the resolution of the arithmetic) and 1",
            Rounded::FINEST
        )));
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader = csv::ReaderBuilder::new();
    let mut reader = reader.comment(Some(b'#')).flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().map_err(|e| shape(e.to_string()))?.clone();
    let place = columns(&header).map_err(shape)?;
    let mut rows: Vec<MeasuredRow> = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|e| shape(e.to_string()))? {
        // the end of the record, as its start is counted from before the comments above it
        let end = usize::try_from(reader.position().byte()).unwrap_or(usize::MAX).min(text.len());
        let line = || 1 + text.as_bytes()[..end].trim_ascii_end().iter().filter(|byte| **byte == b'\n').count() as u64;
        if record.len() != header.len() {
            return Err(shape(format!(
                "line {} has {} values for {} columns: use a decimal point, and quote values that contain a comma",
                line(),
                record.len(),
                header.len()
            )));
        }
        let cell = |column: usize| place[column].and_then(|k| record.get(k)).unwrap_or_default();
        let name = cell(0).to_owned();
        let refuse = |column: usize, rule: &str| {
            let (value, column) = (cell(column), COLUMNS[column]);
            shape(format!("line {}, row '{name}', column '{column}': '{value}': {rule}", line()))
        };
        if name.is_empty() {
            return Err(refuse(0, "it is empty: give the name of the pose"));
        }
        let number = |column: usize| -> Result<Rounded, EvidenceError> {
            let found = Rounded::from_digits(cell(column)).ok_or_else(|| refuse(column, "it is not a number"))?;
            if !found.value.is_finite() {
                return Err(refuse(column, "it must be finite"));
            }
            let half_unit = rounding.unwrap_or(found.half_unit);
            Ok(Rounded { half_unit, ..found })
        };
        let angle = number(1)?.value;
        if !(0.0 < angle && angle < 180.0) {
            return Err(refuse(1, "the impact angle must be above 0 and below 180 degrees; 90 is a normal impact"));
        }
        let newton = number(2)?;
        if !(0.0..=1.0).contains(&newton.value) {
            return Err(refuse(2, "a coefficient of restitution lies between 0 and 1"));
        }
        let energy_root = number(3)?;
        if !(0.0..=1.0).contains(&energy_root.value) {
            let rule = "the square root of T+/T- must lie between 0 and 1: a frictionless impact gains no energy";
            return Err(refuse(3, rule));
        }
        let seen = match cell(4) {
            "" => None,
            word => Some(Seen::ALL.into_iter().find(|seen| seen.name() == word).ok_or_else(|| {
                let known = Seen::ALL.map(|seen| format!("'{}'", seen.name())).join(", ");
                refuse(4, &format!("leave it empty, or give one of {known}"))
            })?),
        };
        let entry = Entry { angle_deg: angle, cot: cot(angle), newton, energy_root, seen };
        if seen.is_some() && entry.cot == 0.0 {
            return Err(refuse(4, "a normal impact has no tangential velocity before it: leave the cell empty"));
        }
        let row = match rows.iter_mut().position(|row| row.name == name) {
            Some(k) => &mut rows[k],
            None => {
                rows.push(MeasuredRow { name: name.clone(), entries: Vec::new() });
                let last = rows.len() - 1;
                &mut rows[last]
            }
        };
        row.entries.push(entry);
        if row.entries.len() > MOST {
            return Err(refuse(0, &format!("the row has more than {MOST} measurements: split it into several rows")));
        }
    }
    if rows.is_empty() {
        return Err(shape("it has no measurements: write one line for each below the header".into()));
    }
    Ok(rows)
}

/// Position of each of [`COLUMNS`] in the header.
fn columns(header: &csv::StringRecord) -> Result<[Option<usize>; 5], String> {
    let known = COLUMNS.join(", ");
    let mut place = [None; 5];
    for (k, name) in header.iter().enumerate() {
        let Some(column) = COLUMNS.iter().position(|column| *column == name) else {
            return Err(format!("unknown column '{name}': the columns are {known}"));
        };
        if place[column].replace(k).is_some() {
            return Err(format!("column '{name}' occurs twice: keep one"));
        }
    }
    match COLUMNS[..4].iter().zip(place).find(|(_, place)| place.is_none()) {
        Some((missing, _)) => {
            Err(format!("column '{missing}' is missing: the columns are {known} (the last is optional)"))
        }
        None => Ok(place),
    }
}
