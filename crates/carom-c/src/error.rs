//! Status codes, and the message of the last fault of each thread.

use carom_chain::ChainError;
use carom_impact::ImpactError;
use carom_sim::SimError;
use std::cell::{Cell, RefCell};
use std::ffi::{CStr, CString, c_char};

/// What a function returns. After any status but CAROM_OK, carom_error() tells what was wrong and what to do.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(non_camel_case_types)]
pub enum Status {
    /// Done.
    CAROM_OK = 0,
    /// An argument breaks the rules of the call: NULL, a wrong length, an index out of range, arrays that overlap.
    CAROM_INVALID_ARGUMENT = 1,
    /// A file, a name or a number is refused: a URDF or a scene that breaks a rule, an unknown link, a coefficient out of its
    /// range, a number that is not finite.
    CAROM_REFUSED_INPUT = 2,
    /// The arguments are sound, but the model has no answer for them: a singular normal direction, a mass matrix without an
    /// inverse, an overlap at the start, a motion that cannot be continued.
    CAROM_REFUSED_PHYSICS = 3,
    /// A defect of carom, which was caught. Free the handles of the call: their contents are not defined any more.
    CAROM_PANIC = 4,
}

/// Why a call is not done.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Its kind.
    pub(crate) status: Status,
    /// The value, the rule that it breaks, and what to do.
    pub(crate) message: String,
}

impl Fault {
    /// An argument that breaks the rules of the call.
    pub(crate) fn invalid(message: String) -> Self {
        Self { status: Status::CAROM_INVALID_ARGUMENT, message }
    }

    /// A file, a name or a number that is refused.
    pub(crate) fn input(message: String) -> Self {
        Self { status: Status::CAROM_REFUSED_INPUT, message }
    }

    /// Arguments for which the model has no answer.
    pub(crate) fn physics(message: String) -> Self {
        Self { status: Status::CAROM_REFUSED_PHYSICS, message }
    }
}

/// The status of an error of the crates.
trait Kind: std::fmt::Display {
    fn status(&self) -> Status;
}

impl Kind for ChainError {
    fn status(&self) -> Status {
        match self {
            Self::WrongLength { .. } => Status::CAROM_INVALID_ARGUMENT,
            Self::Massless { .. }
            | Self::NoInertia { .. }
            | Self::TooLarge { .. }
            | Self::NoLockedInertia
            | Self::Coupled { .. }
            | Self::FixedPoint { .. }
            | Self::NoVelocity { .. }
            | Self::NotReducible(_) => Status::CAROM_REFUSED_PHYSICS,
            _ => Status::CAROM_REFUSED_INPUT,
        }
    }
}

impl Kind for ImpactError {
    fn status(&self) -> Status {
        match self {
            Self::NotDifferentiable { .. }
            | Self::UsersLaw { .. }
            | Self::Outcome { .. }
            | Self::SingularNormal { .. }
            | Self::Wedged { .. }
            | Self::Endless { .. }
            | Self::Unfinished { .. } => Status::CAROM_REFUSED_PHYSICS,
            _ => Status::CAROM_REFUSED_INPUT,
        }
    }
}

impl Kind for SimError {
    fn status(&self) -> Status {
        match self {
            Self::Chain(error) => error.status(),
            Self::Impact(error) => error.status(),
            Self::Incomplete { .. }
            | Self::Setting { .. }
            | Self::Lengths { .. }
            | Self::Contact { .. }
            | Self::Named { .. }
            | Self::Scene { .. }
            | Self::Shape(_) => Status::CAROM_REFUSED_INPUT,
            _ => Status::CAROM_REFUSED_PHYSICS,
        }
    }
}

impl<E: Kind> From<E> for Fault {
    fn from(error: E) -> Self {
        Self { status: error.status(), message: error.to_string() }
    }
}

thread_local! {
    /// Whether the last call of this thread has a message. Without a destructor, so that a call that ends well allocates
    /// nothing, not even at its first use in a thread.
    static FAILED: Cell<bool> = const { Cell::new(false) };
    static MESSAGE: RefCell<CString> = RefCell::default();
}

/// Stores the message of this thread's call.
pub(crate) fn keep(function: &str, fault: &Fault) {
    let text = crate::border::c_text(&format!("{function}: {}", fault.message));
    MESSAGE.with_borrow_mut(|message| *message = text);
    FAILED.set(true);
}

/// The call of this thread has ended well.
pub(crate) fn forget() {
    FAILED.set(false);
}

/// The message of this thread's last call; empty if it has ended well.
fn message() -> *const c_char {
    if FAILED.get() { MESSAGE.with_borrow(|message| message.as_ptr()) } else { c"".as_ptr() }
}

/// The message as a text.
#[cfg(test)]
pub(crate) fn last() -> String {
    if FAILED.get() { MESSAGE.with_borrow(|message| message.to_string_lossy().into_owned()) } else { String::new() }
}

/// What was wrong in the last call of this thread: the function, the value, the rule that it breaks, and what to do; an empty text
/// if the call has ended well. UTF-8, valid until the next call of this thread. Never NULL.
#[unsafe(no_mangle)]
pub extern "C" fn carom_error() -> *const c_char {
    message()
}

/// The version of the library, such as "0.1.0". Never NULL, valid for ever.
#[unsafe(no_mangle)]
pub extern "C" fn carom_version() -> *const c_char {
    const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => panic!("a version has no zero byte"),
    };
    VERSION.as_ptr()
}
