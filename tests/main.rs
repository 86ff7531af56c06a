//! The tests of all crates together, and of the repository. A file is a module; `cargo test MODULE::` runs those of one.

mod pinocchio;
mod rooms;
