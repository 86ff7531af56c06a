//! What is odd or not used, on its way to [`Robot::warnings`](super::Robot::warnings).

use super::source::Source;
use roxmltree::Node;
use std::collections::BTreeMap;

/// Warnings so far.
#[derive(Default)]
pub(super) struct Warnings {
    odd: Vec<String>,
    /// Kinds of things that are not used: how often, and the line of the first.
    unused: BTreeMap<String, (usize, u32)>,
}

impl Warnings {
    /// An element looks odd.
    pub fn odd(&mut self, source: &Source, node: Node, text: &str) {
        self.odd.push(format!("{} (line {}): {text}", source.describe(node, None), source.line(node)));
    }

    /// One more thing of this kind is not used.
    pub fn unused(&mut self, source: &Source, node: Node, kind: String) {
        self.unused.entry(kind).or_insert_with(|| (0, source.line(node))).0 += 1;
    }

    /// One sentence on each odd element in the order found, then one on each kind of thing that is not used.
    pub fn sentences(self) -> Vec<String> {
        let unused = self.unused.into_iter().map(|(kind, (times, line))| match times {
            1 => format!("{kind} (line {line}) is not used"),
            _ => format!("{kind} ({times} times, first on line {line}) is not used"),
        });
        self.odd.into_iter().chain(unused).collect()
    }
}
