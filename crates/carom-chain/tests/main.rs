//! The tests of carom-chain. A file is a module; `cargo test MODULE::` runs those of one.

mod axes;
mod closed_forms;
mod common;
mod delassus;
mod derivative;
mod joined;
mod no_allocation;
mod planar_row;
mod rotors;
mod scalars;
mod segments;
mod sine;
mod tool;
mod two_routes;
mod urdf_messages;
mod wrenches;
