//! The tests of carom-study. A file is a module; `cargo test MODULE::` runs those of one.

mod chart;
mod consistency;
mod diagrams;
mod fit;
mod map_pictures;
mod map_study;
mod mutated_inputs;
mod paper;
mod paper_figures;
mod part;
mod reference;
mod stiffness;
mod stress;
mod table;
