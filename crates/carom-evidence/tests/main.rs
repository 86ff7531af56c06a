//! The tests of carom-evidence that see it from outside: a file is a module. The others in this folder are unit tests, which see results
//! from inside.

mod mutated_inputs;
