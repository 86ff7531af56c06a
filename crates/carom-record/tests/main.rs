//! The tests of carom-record. A file is a module; `cargo test MODULE::` runs those of one.

mod diagrams;
mod maps;
mod scenes;
