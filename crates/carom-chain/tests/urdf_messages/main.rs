//! Every message of the URDF reader, quoted whole next to a file that provokes it, and what a good file reads as.

mod as_written;
mod document;
mod files;
mod texts;
mod values;
