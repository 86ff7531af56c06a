//! The C API of carom. Its documentation is the header, `include/carom.h`, which is generated from this crate, and the page "Use carom
//! from C and C++" of the book.
//!
//! `border.rs` alone reads and writes through pointers: its macro `call!` gives the extern functions of the other files references
//! and slices. A test (`tests/header.rs`) compares the header with what cbindgen makes of these files.

// The contract of all functions is at the head of the header.
#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]
// The comments are those of the header: brackets are those of C and of directives for cbindgen.
#![allow(rustdoc::broken_intra_doc_links)]

#[macro_use]
mod border;

mod chain;
mod dynamics;
mod error;
mod hit;
mod law;
mod scene;
mod session;
mod strike;

pub use chain::*;
pub use dynamics::*;
pub use error::*;
pub use hit::*;
pub use law::*;
pub use scene::*;
pub use session::*;
pub use strike::*;

// What several threads may use at the same time, and what may move to another thread: the rules of the header.
const _: () = {
    const fn shared<T: Send + Sync>() {}
    const fn moved<T: Send>() {}
    shared::<Chain>();
    shared::<Law>();
    shared::<Scene>();
    moved::<Dynamics>();
    moved::<Strike>();
    moved::<Session>();
};
