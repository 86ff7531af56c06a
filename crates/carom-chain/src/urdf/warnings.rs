//! Collects the warnings for [`LoadReport`].

use super::robot::{LoadReport, Repair};
use super::source::Source;
use crate::error::ChainError;
use crate::input::{MESSAGE, shortened, shown};
use roxmltree::Node;
use std::collections::BTreeMap;

/// Warnings so far.
#[derive(Default)]
pub(super) struct Warnings {
    odd: Vec<Odd>,
    /// What occurs often and is told once: elements and attributes that are unknown, missing or not used.
    counted: BTreeMap<String, Counted>,
    /// Notes that `strict` does not refuse.
    notes: Vec<String>,
    /// The changes of `repair`.
    pub repairs: Vec<Repair>,
}

/// A warning about one element.
struct Odd {
    element: String,
    line: u32,
    text: String,
}

struct Counted {
    times: usize,
    /// Line of the first.
    line: u32,
    text: String,
    /// Whether `strict` refuses it.
    strict: bool,
}

impl Warnings {
    /// Adds a warning about an element.
    pub fn odd(&mut self, source: &Source, node: Node, text: &str) {
        self.odd_at(source.describe(node, None), source.line(node), text);
    }

    /// Adds a warning about an attribute.
    pub fn odd_attribute(&mut self, source: &Source, node: Node, attribute: &str, text: &str) {
        self.odd_at(source.describe(node, Some(attribute)), source.line(node), text);
    }

    /// Adds a warning about what is named by `element`.
    pub fn odd_at(&mut self, element: String, line: u32, text: &str) {
        self.odd.push(Odd { element, line, text: shortened(text, MESSAGE).into() });
    }

    /// Adds a note about an element, which `strict` does not refuse.
    pub fn note(&mut self, source: &Source, node: Node, text: &str) {
        self.note_text(format!("{} (line {}): {text}", source.describe(node, None), source.line(node)));
    }

    /// Adds a note about another file, which `strict` does not refuse.
    pub fn note_text(&mut self, text: String) {
        self.notes.push(shortened(&text, MESSAGE).into());
    }

    /// Counts one more element or attribute of this kind that is not used.
    pub fn unused(&mut self, source: &Source, node: Node, kind: String) {
        self.count(source, node, kind, " is not used".into(), false);
    }

    /// Counts one more element or attribute of this kind that is not one of URDF.
    pub fn unknown(&mut self, source: &Source, node: Node, kind: String) {
        self.count(source, node, kind, " is not used: it is unknown".into(), true);
    }

    /// Counts one more element of this kind in which something is missing, and says what is used for it.
    pub fn assumed(&mut self, source: &Source, node: Node, kind: String, value: &str) {
        self.count(source, node, kind, format!(": read as {value}"), true);
    }

    fn count(&mut self, source: &Source, node: Node, kind: String, text: String, strict: bool) {
        let kind = shown(&kind).into_owned();
        let first = || Counted { times: 0, line: source.line(node), text, strict };
        self.counted.entry(kind).or_insert_with(first).times += 1;
    }

    /// The report: in each list one sentence per element in the order found, then one per kind.
    ///
    /// # Errors
    /// With `strict`, the first warning in the file.
    pub fn report(self, file: &str, strict: bool) -> Result<LoadReport, ChainError> {
        let (mut refused, mut count) = (None::<Odd>, 0);
        let mut report = LoadReport { unused: self.notes, repairs: self.repairs, ..Default::default() };
        let mut warn = |odd: Odd, sentence: String| {
            report.warnings.push(sentence);
            count += 1;
            if refused.as_ref().is_none_or(|first| odd.line < first.line) {
                refused = Some(odd);
            }
        };
        for odd in self.odd {
            let sentence = format!("{} (line {}): {}", odd.element, odd.line, odd.text);
            warn(odd, sentence);
        }
        for (kind, Counted { times, line, text, strict }) in self.counted {
            let sentence = match times {
                1 => format!("{kind} (line {line}){text}"),
                _ => format!("{kind} ({times} times, first on line {line}){text}"),
            };
            if strict {
                let text = text.trim_start_matches([':', ' ']).into();
                warn(Odd { element: kind, line, text }, sentence);
            } else {
                report.unused.push(sentence);
            }
        }
        match refused {
            Some(Odd { element, line, text }) if strict => {
                let more = if count > 1 { format!(" (the first of {count} warnings)") } else { String::new() };
                let rule =
                    format!("{text}{more}: correct it, or load the robot without --strict (LoadOptions::strict)");
                Err(ChainError::Urdf { file: file.into(), line, element, rule })
            }
            _ => Ok(report),
        }
    }
}
