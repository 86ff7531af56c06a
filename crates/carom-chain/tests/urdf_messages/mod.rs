//! Every message of the URDF reader, next to a file that causes it, and the result for valid files.

mod document;
mod files;
mod limits;
mod loading;
mod rotors;
mod srdf;
mod texts;
mod units;
mod valid_files;
mod values;
