//! The `carom` command from outside: what it takes, what it answers, what it refuses and in which words.

mod contract;
mod derivatives;
mod desk;
mod files;
mod numbers;
mod options;
mod paper;
mod people;
mod refused_input;
mod refused_robots;
mod rough_handling;
mod scenes;
mod simulate;
mod studies;
