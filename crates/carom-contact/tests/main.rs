//! The tests of carom-contact. A file is a module; `cargo test MODULE::` runs those of one.

mod against_parry;
mod chains;
mod common;
mod meetings;
mod meshes;
mod optimality;
mod shapes;
