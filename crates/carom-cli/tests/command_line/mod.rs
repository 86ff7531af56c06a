//! Tests of the `carom` command as a process: input, output, refusals with their messages.

mod aims;
mod contract;
mod derivatives;
pub mod desk;
mod files;
mod numbers;
mod options;
mod orbits;
mod paper;
mod people;
mod refused_input;
mod refused_robots;
mod rough_handling;
mod runs;
mod scenes;
mod simulate;
mod studies;
