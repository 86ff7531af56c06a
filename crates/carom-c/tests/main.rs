//! Tests of the C API: the extern functions are called as C calls them.

mod border;
mod chain;
mod header;
mod law;
mod own;
mod scene;
mod strike;
