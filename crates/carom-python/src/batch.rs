//! Loops over states: a single state on the calling thread, a batch without the GIL and on all cores.

use crate::error::{InBatch, Raise};
use crate::threads::on_all_cores;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Number of states that are computed together on one core.
pub const CHUNK: usize = 256;

/// Computes the result of each state into its `width` entries of `out`. `make` makes the memory of a thread. The error is that
/// of the first state that has one.
///
/// # Errors
/// The exception of the error.
pub fn each_row<M, E: Raise + Send>(
    py: Python<'_>,
    count: Option<usize>,
    out: &mut [f64],
    width: usize,
    make: impl Fn() -> M + Sync + Send,
    work: impl Fn(&mut M, usize, &mut [f64]) -> Result<(), E> + Sync + Send,
) -> PyResult<()> {
    let Some(count) = count else {
        return Ok(work(&mut make(), 0, out).map_err(|error| InBatch { error, state: None })?);
    };
    if width == 0 {
        return Ok(());
    }
    let chunk = |memory: &mut M, first: usize, out: &mut [f64]| {
        for (k, row) in out.chunks_exact_mut(width).enumerate() {
            let state = first + k;
            work(memory, state, row).map_err(|error| InBatch { error, state: Some(state) })?;
        }
        Ok(())
    };
    debug_assert_eq!(out.len(), count * width);
    let done: Result<(), InBatch<E>> = if count <= CHUNK {
        py.detach(|| chunk(&mut make(), 0, out))
    } else {
        on_all_cores(py, |stop| {
            let chunks = out.par_chunks_mut(CHUNK * width).enumerate();
            first_error(chunks.map_init(&make, |memory, (c, out)| {
                if stop.load(Ordering::Relaxed) { Ok(()) } else { chunk(memory, c * CHUNK, out) }
            }))
        })?
    };
    Ok(done?)
}

/// The error of the first state that has one, whichever thread has found it.
pub fn first_error<E: Send>(results: impl ParallelIterator<Item = Result<(), InBatch<E>>>) -> Result<(), InBatch<E>> {
    let errors = results.filter_map(Result::err);
    errors.min_by_key(|error| error.state).map_or(Ok(()), Err)
}
