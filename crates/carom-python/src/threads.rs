//! The threads of batches, maps and fits, and the end of a computation by a signal (Ctrl-C).

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two looks for signals: a tenth of what a user notices as a delay.
const PAUSE: Duration = Duration::from_millis(50);

/// Simulated time, s, in which a run looks for signals at least once: one that reports less often reports every step.
pub const LOOK: f64 = 0.01;

/// The threads, and the process that has started them.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// The threads of this process, as many as RAYON_NUM_THREADS says or as there are cores. A forked process starts its own: the
/// threads of its parent do not exist in it, and work that is given to them is never done.
fn pool(_held: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    // Python forks with the GIL held, as it is here, so that no child gets this lock while another thread holds it.
    let mut known = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((owner, pool)) = &*known
        && *owner == process
    {
        return Ok(pool.clone());
    }
    let pool = ThreadPoolBuilder::new().build().map_err(|e| {
        PyRuntimeError::new_err(format!("threads cannot be started ({e}): set RAYON_NUM_THREADS to a smaller number"))
    })?;
    let pool = Arc::new(pool);
    // Not dropped: that would wake the threads of the parent through locks that they may have held when they were lost.
    std::mem::forget(known.replace((process, pool.clone())));
    Ok(pool)
}

/// What unwinds a computation that a signal ends. It is no error, and prints nothing.
struct Ended;

fn end() -> ! {
    resume_unwind(Box::new(Ended))
}

/// Ends a computation by [`on_all_cores`] or [`left_behind`] from a callback of it, once `stop` is set.
pub fn halt(stop: &AtomicBool) {
    if stop.load(Ordering::Relaxed) {
        end();
    }
}

/// The result; the exception of a signal if there was one; the panic if there was another one.
fn passed<R>(done: Done<R>, raised: Option<PyErr>) -> PyResult<R> {
    match (done, raised) {
        (_, Some(signal)) => Err(signal),
        (Ok(result), None) => Ok(result),
        // The interpreter is shutting down.
        (Err(panic), None) if panic.is::<Ended>() => Err(PyRuntimeError::new_err("the interpreter is shutting down")),
        (Err(panic), None) => resume_unwind(panic),
    }
}

/// Looks for signals. Whether the computation goes on; it does not where the interpreter is shutting down.
fn goes_on(raised: &mut Option<PyErr>) -> bool {
    Python::try_attach(|py| *raised = py.check_signals().err()).is_some() && raised.is_none()
}

type Done<R> = Result<R, Box<dyn Any + Send>>;

/// Waits for the result, and looks for signals, which set `stop`. The error comes when the work has ended; with `leave` at once.
fn wait<R>(told: &Receiver<Done<R>>, stop: &AtomicBool, leave: bool) -> PyResult<R> {
    let mut raised = None;
    loop {
        match told.recv_timeout(PAUSE) {
            Ok(done) => return passed(done, raised),
            Err(RecvTimeoutError::Timeout) => {
                if !stop.load(Ordering::Relaxed) {
                    stop.store(!goes_on(&mut raised), Ordering::Relaxed);
                }
                if leave && stop.load(Ordering::Relaxed) {
                    return passed(Err(Box::new(Ended)), raised);
                }
            }
            Err(RecvTimeoutError::Disconnected) => return passed(Err(Box::new(Ended)), raised),
        }
    }
}

/// Runs `work` without the GIL, on the threads of this process, while this thread looks for signals. A signal sets the flag that `work`
/// gets, and becomes the error when `work` has ended.
///
/// # Errors
/// `RuntimeError` if the system starts no more threads; the exception of a signal, KeyboardInterrupt for Ctrl-C.
pub fn on_all_cores<R: Send>(py: Python<'_>, work: impl FnOnce(&AtomicBool) -> R + Send) -> PyResult<R> {
    let (stop, pool) = (AtomicBool::new(false), pool(py)?);
    py.detach(|| {
        let (tell, told) = channel();
        pool.in_place_scope(|scope| {
            let stop = &stop;
            scope.spawn(move |_| drop(tell.send(catch_unwind(AssertUnwindSafe(|| work(stop))))));
            wait(&told, stop, false)
        })
    })
}

/// As [`on_all_cores`] for work that may look at the flag rarely: after a signal it is left behind, and ends where it looks at it. The
/// flag is [`carom_sim::Simulation::stop`] of the runs that it makes.
///
/// # Errors
/// As [`on_all_cores`].
pub fn left_behind<R: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>) -> R + Send + 'static,
) -> PyResult<R> {
    let (stop, pool) = (Arc::new(AtomicBool::new(false)), pool(py)?);
    py.detach(|| {
        let ((tell, told), seen) = (channel(), stop.clone());
        pool.spawn(move || drop(tell.send(catch_unwind(AssertUnwindSafe(|| work(&seen))))));
        wait(&told, &stop, true)
    })
}

/// Runs `work` without the GIL, on this thread. It calls its argument often, which looks for signals and ends it by unwinding.
///
/// # Errors
/// The exception of a signal, KeyboardInterrupt for Ctrl-C.
pub fn interruptible<R: Send>(py: Python<'_>, work: impl FnOnce(&mut dyn FnMut()) -> R + Send) -> PyResult<R> {
    py.detach(|| {
        let (raised, mut last) = (Cell::new(None), Instant::now());
        let mut look = || {
            if last.elapsed() < PAUSE {
                return;
            }
            let mut found = None;
            if !goes_on(&mut found) {
                raised.set(found);
                end();
            }
            last = Instant::now();
        };
        let done = catch_unwind(AssertUnwindSafe(|| work(&mut look)));
        passed(done, raised.take())
    })
}
