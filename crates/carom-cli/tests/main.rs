//! The tests of carom-cli. A file is a module; `cargo test MODULE::` runs those of one.

mod book;
mod command_line;
mod fit;
mod map;
mod reference;
