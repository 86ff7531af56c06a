//! Collects the warnings for [`Robot::warnings`](super::Robot::warnings).

use super::source::Source;
use roxmltree::Node;
use std::collections::BTreeMap;

/// Warnings so far.
#[derive(Default)]
pub(super) struct Warnings {
    odd: Vec<String>,
    /// Kinds of elements and attributes that are not used: number of them, and the line of the first.
    unused: BTreeMap<String, (usize, u32)>,
}

impl Warnings {
    /// Adds a warning about an element.
    pub fn odd(&mut self, source: &Source, node: Node, text: &str) {
        self.odd.push(format!("{} (line {}): {text}", source.describe(node, None), source.line(node)));
    }

    /// Counts one more element or attribute of this kind that is not used.
    pub fn unused(&mut self, source: &Source, node: Node, kind: String) {
        self.unused.entry(kind).or_insert_with(|| (0, source.line(node))).0 += 1;
    }

    /// All warnings: one sentence per element in the order found, then one per kind that is not used.
    pub fn sentences(self) -> Vec<String> {
        let unused = self.unused.into_iter().map(|(kind, (times, line))| match times {
            1 => format!("{kind} (line {line}) is not used"),
            _ => format!("{kind} ({times} times, first on line {line}) is not used"),
        });
        self.odd.into_iter().chain(unused).collect()
    }
}
