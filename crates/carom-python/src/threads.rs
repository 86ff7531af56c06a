//! The threads of batches, maps and fits.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Arc, Mutex, PoisonError};

/// The threads, and the process that has started them.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// The threads of this process, as many as RAYON_NUM_THREADS says or as there are cores. A forked process starts its own: the
/// threads of its parent do not exist in it, and work that is given to them is never done.
///
/// # Errors
/// `RuntimeError` if the system starts no more threads.
pub fn pool(_held: Python<'_>) -> PyResult<Arc<ThreadPool>> {
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

/// Runs `work` without the GIL, on the threads of this process.
///
/// # Errors
/// As [`pool`].
pub fn on_all_cores<R: Send>(py: Python<'_>, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    let pool = pool(py)?;
    Ok(py.detach(|| pool.install(work)))
}
