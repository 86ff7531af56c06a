//! The tests of carom-study. A file is a module; `cargo test MODULE::` runs those of one.

mod aims;
mod diagrams;
mod fit;
mod map_pictures;
mod map_study;
mod orbit_atlas;
mod orbit_tables;
mod orbits;
mod part;
mod reference;
mod shaken_table;
mod table;
