//! Handles that free themselves, and what most tests need.

use carom_c::*;
use std::ffi::{CStr, CString, c_char};
use std::ptr;

/// A handle and the function that frees it.
pub struct Own<T> {
    pub at: *mut T,
    free: unsafe extern "C" fn(*mut T),
}

impl<T> Own<T> {
    /// The handle that `make` writes.
    pub fn new(free: unsafe extern "C" fn(*mut T), make: impl FnOnce(*mut *mut T) -> Status) -> Self {
        let mut at = ptr::null_mut();
        assert_eq!(make(&mut at), Status::CAROM_OK, "{}", error());
        assert!(!at.is_null());
        Self { at, free }
    }
}

impl<T> Drop for Own<T> {
    fn drop(&mut self) {
        // SAFETY: freed once.
        unsafe { (self.free)(self.at) }
    }
}

/// The message of the last call.
pub fn error() -> String {
    text(carom_error())
}

pub fn text(at: *const c_char) -> String {
    assert!(!at.is_null());
    // SAFETY: a text of the library, which is valid here.
    unsafe { CStr::from_ptr(at) }.to_str().unwrap().to_owned()
}

pub fn c(text: &str) -> CString {
    CString::new(text).unwrap()
}

pub fn file(name: &str) -> String {
    format!("{}/../../{name}", env!("CARGO_MANIFEST_DIR"))
}

pub fn robot(name: &str) -> Own<Chain> {
    let path = c(&file(&format!("robots/{name}.urdf")));
    // SAFETY: valid arguments.
    Own::new(carom_chain_free, |at| unsafe { carom_chain_load(path.as_ptr(), 0, at) })
}

pub fn law(name: &str, restitution: f64, friction: f64) -> Own<Law> {
    let name = c(name);
    // SAFETY: valid arguments.
    Own::new(carom_law_free, |at| unsafe { carom_law_create(name.as_ptr(), restitution, friction, 0.0, at) })
}

pub fn frame(chain: &Own<Chain>, name: &str) -> usize {
    let (name, mut frame) = (c(name), usize::MAX);
    // SAFETY: valid arguments.
    let status = unsafe { carom_chain_frame(chain.at, name.as_ptr(), &mut frame) };
    assert_eq!(status, Status::CAROM_OK, "{}", error());
    frame
}

pub fn strike(chain: &Own<Chain>, link: &str, normal: [f64; 3], locked: Option<&str>) -> Own<Strike> {
    let (frame, locked) = (frame(chain, link), locked.map(c));
    let locked = locked.as_ref().map_or(ptr::null(), |names| names.as_ptr());
    Own::new(carom_strike_free, |at| {
        // SAFETY: valid arguments.
        unsafe { carom_strike_prepare(chain.at, frame, [0.0; 3].as_ptr(), normal.as_ptr(), locked, at) }
    })
}

/// Memory for a hit, filled with a value that no result has.
pub fn blank() -> Hit {
    Hit {
        impulse: [-7.0; 3],
        u_minus: [-7.0; 3],
        u_plus: [-7.0; 3],
        energy_before: -7.0,
        energy_after: -7.0,
        normal_work: -7.0,
        friction_work: -7.0,
        drive_work: -7.0,
        mode: Mode::CAROM_OPEN,
        flags: 1 << 31,
        status: Status::CAROM_PANIC,
    }
}

/// The impact at one state.
pub fn resolve(strike: &Own<Strike>, law: &Own<Law>, q: &[f64], qd: &[f64]) -> (Status, Vec<f64>, Hit) {
    let (mut qd_plus, mut hit) = (vec![-7.0; qd.len()], blank());
    // SAFETY: valid arguments.
    let status = unsafe {
        carom_strike_resolve(
            strike.at,
            law.at,
            q.as_ptr(),
            q.len(),
            qd.as_ptr(),
            qd.len(),
            qd_plus.as_mut_ptr(),
            qd_plus.len(),
            &mut hit,
        )
    };
    (status, qd_plus, hit)
}

/// Some states of a robot with `nv` joints of one degree of freedom.
pub fn states(nv: usize, count: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let draw = |a: f64, k: usize| (0..nv).map(|i| (a * (i + 1) as f64 + 1.7 * k as f64).sin()).collect::<Vec<f64>>();
    ((0..count).map(|k| draw(0.7, k)).collect(), (0..count).map(|k| draw(1.3, k)).collect())
}
