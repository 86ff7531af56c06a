//! The tests of carom-impact. A file is a module; `cargo test MODULE::` runs those of one.

mod algebraic_cases;
mod algebraic_laws;
mod bands;
mod boundaries;
mod branches;
mod common;
mod compliant_forces;
mod compliant_impact;
mod derivatives;
mod event_by_event;
mod falling_rod;
mod hunt_crossley;
mod impulse_path;
mod invariants;
mod kane_levinson;
mod messages;
mod roots;
mod several;
mod several_accelerations;
mod several_energetic;
mod several_poisson;
mod several_redundant;
mod several_sequential;
mod singular;
mod small_steps;
mod space;
