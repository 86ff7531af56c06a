//! The tests of all crates together, and of the repository. A file is a module; `cargo test MODULE::` runs those of one.

mod bodies;
mod compliant;
mod drives;
mod energy_balance;
mod faces;
mod links;
mod loop_contacts;
mod loop_joints;
mod loops;
mod loops_in_scenes;
mod many_contacts;
mod mechanisms;
mod paper;
mod passing_bodies;
mod pinocchio;
mod plan;
mod planar2_event;
mod rooms;
mod scenes;
mod sensitivity;
mod several_contacts;
mod simulation;
mod whole_motions;
