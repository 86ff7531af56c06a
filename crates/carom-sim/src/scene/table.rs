//! Tables of numbers over time, by column name: CSV and Parquet files.

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use std::fs::File;
use std::path::Path;

/// A table with the column `time` and others.
#[derive(Debug)]
pub(crate) struct Columns {
    /// The names; empty if a CSV file begins with numbers.
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
    /// The line or row number of each row in the file.
    lines: Vec<usize>,
    /// What the numbers are called: `line` or `row`.
    unit: &'static str,
}

impl Columns {
    /// Reads a Parquet file by its ending `.parquet`, or else CSV.
    ///
    /// # Errors
    /// A message without the name of the file.
    pub fn read(path: &Path) -> Result<Self, String> {
        if path.is_dir() {
            return Err("it is a folder: give the path of a file".into());
        }
        let table = if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet")) {
            parquet(path)?
        } else {
            let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
            csv(text.trim_start_matches('\u{feff}'))?
        };
        let twin = |(k, name): (usize, &String)| table.names[..k].contains(name).then(|| name.clone());
        if let Some(name) = table.names.iter().enumerate().find_map(twin) {
            return Err(format!("column {name} occurs twice: remove one"));
        }
        Ok(table)
    }

    /// [`Self::read`] of a table whose columns have names, which are among these.
    pub fn named(path: &Path, wanted: &[String]) -> Result<Self, String> {
        let table = Self::read(path)?;
        let unnamed = || format!("the first line must name the columns: time, {}", wanted.join(", "));
        if table.has_names() { Ok(table) } else { Err(unnamed()) }
    }

    /// The times and the numbers of these columns, in this order. Columns of other names are refused. Those that are `optional` are zero where
    /// they are missing. A table without names has the time, then these columns. Times ascend; with the column `impacts` those of rows with the
    /// same number of it; two rows of one time are a jump. `what`: the meaning of the numbers, for messages.
    ///
    /// # Errors
    /// A message without the name of the file.
    pub fn pick(
        self,
        wanted: &[String],
        optional: impl Fn(&str) -> bool,
        what: &str,
    ) -> Result<(Vec<f64>, Vec<Vec<f64>>), String> {
        let Self { names, rows, lines, unit } = self;
        let known = || wanted.join(", ");
        let places: Vec<Option<usize>> = if names.is_empty() {
            (1..=wanted.len()).map(Some).collect()
        } else {
            if let Some(name) = names.iter().find(|name| *name != "time" && !wanted.contains(name)) {
                let near = wanted.iter().map(|other| (strsim::jaro_winkler(name, other), other));
                let near = near.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(likeness, _)| *likeness > 0.7);
                let hint = near.map_or_else(String::new, |(_, other)| format!(" (did you mean {other}?)"));
                return Err(format!(
                    "column {name} is not known: the columns are time, {}{hint}; remove it or correct its name",
                    known()
                ));
            }
            if !names.iter().any(|name| name == "time") {
                return Err("column time is missing: add it, in s".into());
            }
            if !wanted.iter().any(|name| names.contains(name)) {
                return Err(format!("it has no column beside time: add some of {}", known()));
            }
            let missing = wanted.iter().find(|name| !names.contains(name) && !optional(name));
            if let Some(name) = missing {
                return Err(format!("column {name} is missing: add it (the columns are time, {})", known()));
            }
            wanted.iter().map(|name| names.iter().position(|own| own == name)).collect()
        };
        let time = names.iter().position(|name| name == "time").unwrap_or(0);
        let part = wanted.iter().position(|name| name == "impacts");
        let is_one_part = |a: &[f64], b: &[f64]| part.is_none_or(|k| a[k] == b[k]);
        let (mut times, mut numbers): (Vec<f64>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for (row, line) in rows.into_iter().zip(lines) {
            let needed = if names.is_empty() { wanted.len() + 1 } else { names.len() };
            if row.len() != needed {
                let what = if names.is_empty() {
                    format!("the time and {} {what}s", wanted.len())
                } else {
                    "one for each name in the first line".to_owned()
                };
                return Err(format!("{unit} {line}: {} columns, but {needed} are needed: {what}", row.len()));
            }
            if row.iter().any(|x| !x.is_finite()) {
                return Err(format!("{unit} {line}: every cell must be a finite number, separated by commas"));
            }
            times.push(row[time]);
            numbers.push(places.iter().map(|place| place.map_or(0.0, |k| row[k])).collect());
            let ([.., before, now], [.., last, own]) = (times.as_slice(), numbers.as_slice()) else { continue };
            if now < before && is_one_part(last, own) {
                return Err(format!("{unit} {line}: time {now} is below that of the previous row: times must ascend"));
            }
            let ([.., first, _, _], [.., before, _, _]) = (times.as_slice(), numbers.as_slice()) else { continue };
            if first == now && is_one_part(before, own) {
                return Err(format!(
                    "{unit} {line}: time {now} is that of both previous rows: a jump has two, before and after it, remove one"
                ));
            }
        }
        if times.is_empty() {
            return Err(format!("it has no row of numbers: give the time and one {what} for each column"));
        }
        Ok((times, numbers))
    }

    /// Whether the columns have names.
    pub fn has_names(&self) -> bool {
        !self.names.is_empty()
    }
}

fn csv(text: &str) -> Result<Columns, String> {
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let mut table = Columns { names: Vec::new(), rows: Vec::new(), lines: Vec::new(), unit: "line" };
    let mut first = true;
    for record in reader.records() {
        let record = record.map_err(|e| e.to_string())?;
        let line = record.position().map_or(0, |place| place.line() as usize);
        let cells: Vec<Result<f64, _>> = record.iter().map(str::parse).collect();
        if first && cells.iter().all(Result::is_err) {
            table.names = record.iter().map(str::to_owned).collect();
        } else {
            table.rows.push(cells.into_iter().map(|cell| cell.unwrap_or(f64::NAN)).collect());
            table.lines.push(line);
        }
        first = false;
    }
    Ok(table)
}

fn parquet(path: &Path) -> Result<Columns, String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let reader = SerializedFileReader::new(file).map_err(|e| e.to_string())?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names = schema.columns().iter().map(|column| column.name().to_owned()).collect();
    let mut table = Columns { names, rows: Vec::new(), lines: Vec::new(), unit: "row" };
    for (k, row) in reader.get_row_iter(None).map_err(|e| e.to_string())?.enumerate() {
        let row = row.map_err(|e| e.to_string())?;
        let number = |field: &Field| match *field {
            Field::Double(x) => x,
            Field::Float(x) => f64::from(x),
            Field::Int(x) => f64::from(x),
            Field::Long(x) => x as f64,
            _ => f64::NAN,
        };
        table.rows.push(row.get_column_iter().map(|(_, field)| number(field)).collect());
        table.lines.push(k + 1);
    }
    Ok(table)
}
