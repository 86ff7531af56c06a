//! Output of the commands: JSON lines, or tables for people; whole files.

use crate::error::{CliError, LineError, Refused};
use carom_chain::input::{MESSAGE, shortened};
pub use carom_evidence::consistency::short;
pub use carom_sim::to_json;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use serde_json::Value;
use std::borrow::Cow;
use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Write};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Writes one answer: as a line of JSON, or as text by `for_people`.
///
/// # Errors
/// A number of the answer is not finite, or the answer cannot be written.
pub fn answer<A: Serialize>(
    out: &mut dyn Write,
    answer: &A,
    json: bool,
    for_people: impl FnOnce(&A, &mut dyn Write) -> io::Result<()>,
) -> Result<(), Refused> {
    let text = to_json(answer).map_err(|e| LineError(e.to_string()))?;
    // serde_json writes null for numbers that are not finite; the answers of this function hold no other null.
    if text.contains("null") {
        let value = serde_json::to_value(answer).map_err(|e| LineError(e.to_string()))?;
        if let Some(key) = first_null("", &value) {
            let why = format!("{key} is not finite: the numbers of this line are too large, or too small, for f64");
            return Err(LineError(why).into());
        }
    }
    if json { writeln!(out, "{text}") } else { for_people(answer, out) }.map_err(Refused::Output)
}

/// Writes the one answer of a command, which is about this file.
///
/// # Errors
/// As [`answer`]; the message names the file.
pub fn answer_about<A: Serialize>(
    file: &Path,
    out: &mut dyn Write,
    whole: &A,
    json: bool,
    for_people: impl FnOnce(&A, &mut dyn Write) -> io::Result<()>,
) -> Result<(), CliError> {
    answer(out, whole, json, for_people).map_err(|refused| match refused {
        Refused::Output(e) => CliError::Output(e),
        Refused::Input(e) => CliError::Input(format!("{}: {e}", file.display())),
    })
}

fn first_null(key: &str, value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(key.to_owned()),
        Value::Array(all) => all.iter().find_map(|v| first_null(key, v)),
        Value::Object(all) => all.iter().find_map(|(k, v)| first_null(k, v)),
        _ => None,
    }
}

/// A progress bar on standard error, shown on a terminal only, until it is dropped.
pub struct Bar(ProgressBar);

impl Bar {
    /// Of so many steps, if their number is known.
    pub fn new(total: Option<u64>, template: &str) -> Self {
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// So many steps are done, of so many.
    pub fn tell(&self, done: usize, all: usize) {
        self.set_length(all as u64);
        self.set_position(done as u64);
    }
}

impl Deref for Bar {
    type Target = ProgressBar;

    fn deref(&self) -> &ProgressBar {
        &self.0
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Writes a file that is complete or not there.
pub fn write_whole(path: &Path, text: &str) -> Result<(), CliError> {
    carom_study::write_whole(path, text.as_bytes()).map_err(|e| CliError::unwritable(path, &e))
}

/// A table whose name is `-`: it is printed as CSV in place of the answer, when it is complete.
pub struct Printed(Option<(tempfile::TempDir, PathBuf)>);

impl Printed {
    /// Whether one of the tables is `-`.
    ///
    /// # Errors
    /// [`CliError::Input`] if two tables, or a table and the answer in JSON, would be mixed.
    pub fn of<'a>(tables: impl Iterator<Item = &'a Path>, json: bool) -> Result<Self, CliError> {
        let asked = tables.filter(|path| *path == Path::new("-")).count();
        if asked == 0 {
            return Ok(Self(None));
        }
        if asked > 1 || json {
            let other = if json { "the answer of --json" } else { "another table" };
            return Err(CliError::Input(format!("-: standard output has {other}: give the table the name of a file")));
        }
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("table.csv");
        Ok(Self(Some((folder, file))))
    }

    /// Whether a table is printed.
    pub fn is_asked(&self) -> bool {
        self.0.is_some()
    }

    /// Where a table is written: its own name, or that of the temporary file.
    pub fn place<'a>(&'a self, table: &'a Path) -> &'a Path {
        self.0.as_ref().map_or(table, |(_, file)| if table == Path::new("-") { file } else { table })
    }

    /// Keeps the temporary folder for an error that names a partial table in it.
    pub fn keep<R>(self, result: R) -> R {
        if let Some((folder, _)) = self.0 {
            let _ = folder.keep();
        }
        result
    }

    /// Prints the table that has been written.
    pub fn print(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let Some((_, file)) = &self.0 else { return Ok(()) };
        for line in BufReader::new(File::open(file)?).lines() {
            writeln!(out, "{}", line?)?;
        }
        Ok(())
    }
}

/// Makes a folder if it is missing.
pub fn make_folder(path: &Path) -> Result<(), CliError> {
    if path.is_dir() {
        return Ok(());
    }
    std::fs::create_dir(path).map_err(|e| CliError::unwritable(path, &e))
}

/// Whether a terminal would obey a character instead of showing it: control characters (escape sequences, new lines), marks that
/// turn the direction of the text, and the separators of lines and paragraphs.
fn commands(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A line as it is printed: what a terminal would obey, in names of robots and scenes above all, is written as in JSON.
pub fn plain(line: &str) -> Cow<'_, str> {
    if line.bytes().all(|byte| (b' '..=b'~').contains(&byte)) || !line.contains(commands) {
        return Cow::Borrowed(line);
    }
    let shown = |c: char| match c {
        '\n' => "\\n".into(),
        '\t' => "\\t".into(),
        '\r' => "\\r".into(),
        c if commands(c) => format!("\\u{:04x}", u32::from(c)), // none is beyond U+FFFF
        c => c.to_string(),
    };
    Cow::Owned(line.chars().map(shown).collect())
}

/// Standard output, with [`plain`] lines: `writeln!` writes one line, whatever its arguments hold; other writes are text with line
/// ends. JSON stays the same JSON.
pub struct PlainLines<W>(pub W);

impl<W: Write> Write for PlainLines<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(bytes);
        for line in text.split_inclusive('\n') {
            self.write_fmt(format_args!("{line}"))?;
        }
        Ok(bytes.len())
    }

    fn write_fmt(&mut self, line: fmt::Arguments<'_>) -> io::Result<()> {
        let line = line.to_string();
        let (line, end) = line.strip_suffix('\n').map_or((&*line, ""), |line| (line, "\n"));
        self.0.write_all(plain(line).as_bytes())?;
        self.0.write_all(end.as_bytes())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Whether warnings are left out (`--quiet`).
pub static QUIET: AtomicBool = AtomicBool::new(false);

/// Writes one line of bounded length to standard error, unless it is a warning and they are left out; errors of writing are ignored.
pub fn say(text: &str) {
    if QUIET.load(Ordering::Relaxed) && text.starts_with("warning: ") {
        return;
    }
    let _ = writeln!(io::stderr(), "{}", plain(&shortened(text, 2 * MESSAGE)));
}

/// Writes warnings about a file to standard error.
pub fn warn(file: &Path, warnings: impl IntoIterator<Item = impl fmt::Display>) {
    warnings.into_iter().for_each(|warning| say(&format!("warning: {}: {warning}", file.display())));
}

/// A vector as a row of a table.
pub fn row(numbers: &[f64]) -> String {
    let cells: Vec<String> = numbers.iter().map(|x| format!("{:>13}", short(*x))).collect();
    cells.join(" ")
}

/// Six significant digits at most, without trailing zeros.
pub fn brief(x: f64) -> String {
    let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    let size = rounded.abs();
    if size != 0.0 && !(1e-4..1e7).contains(&size) { format!("{rounded:e}") } else { format!("{}", rounded + 0.0) }
}
