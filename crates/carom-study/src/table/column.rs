//! A column of a table: its name, and its unit or its words.

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name in the header.
    pub name: String,
    /// Empty for a column of numbers. In a column of words, the number k in a row stands for `words[k]`.
    pub words: Vec<String>,
    /// Unit of the numbers; empty for words and dimensionless numbers.
    pub unit: &'static str,
}

#[doc(hidden)]
impl Column {
    /// A column of numbers.
    pub fn number(name: impl Into<String>) -> Self {
        Self { name: name.into(), words: Vec::new(), unit: "" }
    }

    /// The same column with a unit.
    #[must_use]
    pub fn in_unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// A column of words; a row gives the index of its word in `words`.
    pub fn word<W: Into<String>>(name: impl Into<String>, words: impl IntoIterator<Item = W>) -> Self {
        Self { name: name.into(), words: words.into_iter().map(Into::into).collect(), unit: "" }
    }

    /// The word with index `value`; the empty text if there is no such word.
    pub fn spell(&self, value: f64) -> &str {
        self.place(value).map_or("", |k| &self.words[k])
    }

    /// The index of a word, if `value` is one.
    pub(super) fn place(&self, value: f64) -> Option<usize> {
        // excludes NaN and negative numbers, which `as` converts to 0
        (value >= 0.0 && (value as usize) < self.words.len()).then_some(value as usize)
    }

    /// Index of a word; NaN if it is not among the words.
    pub(super) fn code(&self, word: &str) -> f64 {
        self.words.iter().position(|w| w == word).map_or(f64::NAN, |k| k as f64)
    }
}
