//! The border to C: the only code that reads and writes through pointers of the caller.
//!
//! Each extern function is one [`call!`]: it names the kind of each argument, gets references and slices in place of pointers, and
//! returns a [`Fault`] or nothing. The border refuses null pointers, addresses that are not aligned, and arrays that overlap
//! what is written; it catches panics, and stores the message for `carom_error`.

use crate::error::{self, Fault, Status};
use carom_chain::Chain;
use carom_sim::PreparedStrike;
use std::any::Any;
use std::ffi::{CStr, CString, c_char};
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::Arc;

#[cfg(panic = "abort")]
compile_error!("carom-c turns panics into a status: build it in a profile with panic = \"unwind\"");

/// The body of an extern function: `call!(its_name, |kind argument, kind argument [its length], …| result)`, where the result is a
/// `Result<(), Fault>` and the call a [`Status`]. With `or VALUE` after the name the result has a value, in place of which the
/// caller gets this one after a fault.
///
/// | kind | pointer | in the body |
/// | --- | --- | --- |
/// | `shared` | const handle | `&T` |
/// | `exclusive` | handle | `&mut T` |
/// | `input` | `const double *` and its length | `&[f64]` |
/// | `three` | `const double [3]` | `Vector3<f64>` |
/// | `text` | `const char *`, UTF-8 | `&str` |
/// | `optional` | the same or null | `Option<&str>` |
/// | `output` | `double *` and its length | `&mut [f64]` |
/// | `place` | pointer to a value to be written | [`Place`] |
/// | `places` | array of values to be written, and its length | [`Place`] |
/// | `created` | pointer to a handle to be written; null until the body ends well | [`Place`] |
macro_rules! call {
    ($function:ident, |$($kind:ident $name:ident $([$length:ident])?),*| $body:expr) => {
        $crate::border::status(stringify!($function), |_arguments| {
            $(call!(@get _arguments, $kind $name $($length)?);)*
            $body
        })
    };
    ($function:ident or $other:expr, |$($kind:ident $name:ident $([$length:ident])?),*| $body:expr) => {
        $crate::border::guard(stringify!($function), |_arguments| {
            $(call!(@get _arguments, $kind $name $($length)?);)*
            $body
        })
        .unwrap_or($other)
    };
    (@get $arguments:ident, $kind:ident $name:ident $($length:ident)?) => {
        // SAFETY: an extern function is unsafe: its caller promises for each pointer what the header asks for. That is the
        // contract of the methods of `Arguments`.
        let $name = unsafe { $arguments.$kind(stringify!($name), $name $(, $length)?) }?;
    };
}

/// The body of a function that frees a handle or a text: `free!(its_name, how, argument)`.
macro_rules! free {
    ($function:ident, $how:ident $at:ident) => {{
        // SAFETY: an extern function is unsafe: its caller promises that the argument is null or was given by this library, and is
        // freed once.
        unsafe { $crate::border::$how(stringify!($function), $at) }
    }};
}

/// Calls the body of an extern function, and stores the message of its fault.
pub fn guard<R>(function: &'static str, body: impl FnOnce(&mut Arguments) -> Result<R, Fault>) -> Result<R, Status> {
    // A panic may leave a handle in a state that no code of ours expects: the header tells to free it.
    let done = catch_unwind(AssertUnwindSafe(|| body(&mut Arguments::default())));
    let fault = match done {
        Ok(Ok(result)) => {
            error::forget();
            return Ok(result);
        }
        Ok(Err(fault)) => fault,
        Err(panic) => Fault { status: Status::CAROM_PANIC, message: reason(panic.as_ref()) },
    };
    error::keep(function, &fault);
    Err(fault.status)
}

/// [`guard`] for functions that return a status.
pub fn status(function: &'static str, body: impl FnOnce(&mut Arguments) -> Result<(), Fault>) -> Status {
    guard(function, body).err().unwrap_or(Status::CAROM_OK)
}

fn reason(panic: &(dyn Any + Send)) -> String {
    let said = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("a defect of carom: {}; please report it", said.unwrap_or("no message"))
}

/// Most arrays and values of one call.
const MOST: usize = 8;

/// The memory that a call reads and writes, in which no writing may overlap anything else.
#[derive(Default)]
pub struct Arguments {
    memory: [Option<Memory>; MOST],
}

#[derive(Clone, Copy)]
struct Memory {
    name: &'static str,
    start: usize,
    end: usize,
    written: bool,
}

impl Arguments {
    fn check<T>(&mut self, name: &'static str, at: *const T, count: usize, written: bool) -> Result<(), Fault> {
        let invalid = |what: String| Err(Fault::invalid(format!("{name} {what}")));
        if at.is_null() {
            return invalid("is NULL".into());
        }
        if !at.is_aligned() {
            return invalid(format!("is not aligned to {} bytes", align_of::<T>()));
        }
        let start = at.addr();
        let bytes = count.checked_mul(size_of::<T>()).filter(|bytes| *bytes <= isize::MAX as usize);
        let Some(end) = bytes.and_then(|bytes| start.checked_add(bytes)) else {
            return invalid(format!("has {count} entries, more than any memory"));
        };
        let own = Memory { name, start, end, written };
        for slot in &mut self.memory {
            let Some(other) = slot else {
                *slot = Some(own);
                return Ok(());
            };
            if start < other.end && other.start < end && (written || other.written) {
                return invalid(format!("overlaps {}: give what is written a memory of its own", other.name));
            }
        }
        invalid("is one argument more than the border has room for".into())
    }

    /// # Safety
    /// `at` is null, or a handle of this library that is not freed and that no other thread changes during the call.
    pub unsafe fn shared<'a, T>(&mut self, name: &'static str, at: *const T) -> Result<&'a T, Fault> {
        self.check(name, at, 1, false)?;
        // SAFETY: not null, aligned; valid by the contract.
        Ok(unsafe { &*at })
    }

    /// # Safety
    /// `at` is null, or a handle of this library that is not freed and that no other thread uses during the call.
    pub unsafe fn exclusive<'a, T>(&mut self, name: &'static str, at: *mut T) -> Result<&'a mut T, Fault> {
        self.check(name, at, 1, true)?;
        // SAFETY: not null, aligned, no other argument of the call; valid by the contract.
        Ok(unsafe { &mut *at })
    }

    /// # Safety
    /// `at` is null, or readable for `length` numbers.
    pub unsafe fn input<'a>(&mut self, name: &'static str, at: *const f64, length: usize) -> Result<&'a [f64], Fault> {
        if length == 0 {
            return Ok(&[]);
        }
        self.check(name, at, length, false)?;
        // SAFETY: not null, aligned, at most isize::MAX bytes; readable by the contract.
        Ok(unsafe { std::slice::from_raw_parts(at, length) })
    }

    /// # Safety
    /// `at` is null, or readable for three numbers.
    pub unsafe fn three(&mut self, name: &'static str, at: *const f64) -> Result<nalgebra::Vector3<f64>, Fault> {
        // SAFETY: the same contract.
        Ok(nalgebra::Vector3::from_column_slice(unsafe { self.input(name, at, 3) }?))
    }

    /// # Safety
    /// `at` is null, or writable for `length` numbers. They may be uninitialised: the library does not read them, and every pattern
    /// of bits is a number.
    pub unsafe fn output<'a>(
        &mut self,
        name: &'static str,
        at: *mut f64,
        length: usize,
    ) -> Result<&'a mut [f64], Fault> {
        if length == 0 {
            return Ok(&mut []);
        }
        self.check(name, at, length, true)?;
        // SAFETY: not null, aligned, at most isize::MAX bytes, and no other argument of the call; writable by the contract.
        Ok(unsafe { std::slice::from_raw_parts_mut(at, length) })
    }

    /// # Safety
    /// `at` is null, or points to text that ends with a zero byte.
    pub unsafe fn text<'a>(&mut self, name: &'static str, at: *const c_char) -> Result<&'a str, Fault> {
        if at.is_null() {
            return Err(Fault::invalid(format!("{name} is NULL")));
        }
        // SAFETY: not null; ends with a zero byte by the contract.
        let text = unsafe { CStr::from_ptr(at) };
        text.to_str().map_err(|e| Fault::invalid(format!("{name} is not UTF-8: {e}")))
    }

    /// # Safety
    /// As [`Arguments::text`].
    pub unsafe fn optional<'a>(&mut self, name: &'static str, at: *const c_char) -> Result<Option<&'a str>, Fault> {
        if at.is_null() {
            return Ok(None);
        }
        // SAFETY: the same contract.
        unsafe { self.text(name, at) }.map(Some)
    }

    /// # Safety
    /// `at` is null, or writable for one value, which may be uninitialised.
    pub unsafe fn place<'a, T: Copy>(&mut self, name: &'static str, at: *mut T) -> Result<Place<'a, T>, Fault> {
        // SAFETY: the same contract.
        unsafe { self.places(name, at, 1) }
    }

    /// # Safety
    /// `at` is null, or writable for `length` values, which may be uninitialised.
    pub unsafe fn places<'a, T: Copy>(
        &mut self,
        name: &'static str,
        at: *mut T,
        length: usize,
    ) -> Result<Place<'a, T>, Fault> {
        if length > 0 {
            self.check(name, at, length, true)?;
        }
        Ok(Place { at, length, writes: PhantomData })
    }

    /// # Safety
    /// As [`Arguments::place`].
    pub unsafe fn created<'a, T>(&mut self, name: &'static str, at: *mut *mut T) -> Result<Place<'a, *mut T>, Fault> {
        // SAFETY: the same contract.
        let place = unsafe { self.place(name, at) }?;
        place.put(ptr::null_mut());
        Ok(place)
    }
}

/// Memory of the caller for values that are written only.
pub struct Place<'a, T> {
    at: *mut T,
    length: usize,
    writes: PhantomData<&'a mut T>,
}

impl<T: Copy> Place<'_, T> {
    /// Number of values.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Writes the first value.
    pub fn put(&self, value: T) {
        self.put_at(0, value);
    }

    /// Writes value number `k`.
    pub fn put_at(&self, k: usize, value: T) {
        assert!(k < self.length, "value {k} of {}", self.length);
        // SAFETY: `Arguments::places` has checked the memory, whose caller promises that it is writable; k is inside.
        unsafe { self.at.add(k).write(value) }
    }
}

impl<T> Place<'_, *mut T> {
    /// Gives the caller a new handle, which it frees by [`free`].
    pub fn give(&self, value: T) {
        self.put(Box::into_raw(Box::new(value)));
    }
}

impl Place<'_, *mut c_char> {
    /// Gives the caller a text, which it frees by [`free_text`].
    pub fn give_text(&self, text: &str) {
        self.put(c_text(text).into_raw());
    }
}

/// Frees a handle; nothing for null.
///
/// # Safety
/// `at` is null or was given by [`Place::give`], and is freed once.
pub unsafe fn free<T>(function: &'static str, at: *mut T) {
    let _ = status(function, |_| {
        if !at.is_null() {
            // SAFETY: from Box::into_raw by the contract.
            drop(unsafe { Box::from_raw(at) });
        }
        Ok(())
    });
}

/// Frees a text; nothing for null.
///
/// # Safety
/// `at` is null or was given by [`Place::give_text`], and is freed once.
pub unsafe fn free_text(function: &'static str, at: *mut c_char) {
    let _ = status(function, |_| {
        if !at.is_null() {
            // SAFETY: from CString::into_raw by the contract.
            drop(unsafe { CString::from_raw(at) });
        }
        Ok(())
    });
}

/// A text for C, without zero bytes.
pub fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// A prepared strike and what it borrows.
pub struct HeldStrike {
    /// Borrows the rest; dropped before it.
    strike: PreparedStrike<'static>,
    /// Names of locked joints, from the chain.
    _names: Arc<[&'static str]>,
    chain: Arc<Chain>,
}

impl HeldStrike {
    /// The strike that `prepare` makes of the chain and the `names` of joints in it.
    ///
    /// # Errors
    /// Those of `names` and `prepare`.
    pub fn new(
        chain: Arc<Chain>,
        names: impl for<'c> FnOnce(&'c Chain) -> Result<Vec<&'c str>, Fault>,
        prepare: impl for<'c> FnOnce(&'c Chain, &'c [&'c str]) -> Result<PreparedStrike<'c>, Fault>,
    ) -> Result<Self, Fault> {
        // SAFETY: the chain does not change, is at one address as long as the Arc lives, and the Arc lives in the same struct, which
        // drops the strike first. The lifetime 'static does not leave this struct: see `with`.
        let borrowed: &'static Chain = unsafe { &*Arc::as_ptr(&chain) };
        let names: Arc<[&'static str]> = names(borrowed)?.into();
        // SAFETY: as for the chain.
        let strike = prepare(borrowed, unsafe { &*Arc::as_ptr(&names) })?;
        Ok(Self { strike, _names: names, chain })
    }

    /// Calls `work` with the chain and the strike, for whatever lifetime, so that it can keep neither.
    pub fn with<R>(&mut self, work: impl for<'c> FnOnce(&'c Chain, &mut PreparedStrike<'c>) -> R) -> R {
        // SAFETY: as in `new`; `work` holds for every lifetime 'c, so that nothing that borrows the chain leaves it.
        let borrowed: &'static Chain = unsafe { &*Arc::as_ptr(&self.chain) };
        work(borrowed, &mut self.strike)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_status() {
        assert_eq!(status("carom_test", |_| panic!("at {}", 7)), Status::CAROM_PANIC);
        assert_eq!(error::last(), "carom_test: a defect of carom: at 7; please report it");
        assert_eq!(status("carom_test", |_| Ok(())), Status::CAROM_OK);
        assert_eq!(error::last(), "");
    }
}
