//! The response of a chain at its contact point for columns of states, four or eight configurations at once.
//!
//! Sines and cosines are computed for whole columns, the pass of [`carom_chain::ContactPoint`] runs in SIMD lanes. The
//! operations on each configuration are those of [`ContactPoint::visit`](carom_chain::ContactPoint::visit) in the same order,
//! so the results are bitwise equal. The instruction set is detected at run time.

use carom_chain::algebra::Algebra;
use carom_chain::sine::sin_cos_into;
use carom_chain::{Angle, Chain, ChainError, HingeAngles, Kept, Point, PointResponse, ResponseMemory, Visit};
use nalgebra::SimdRealField;
use pulp::{Arch, Simd, WithSimd};
use simba::simd::AutoSimd;

/// `L` configurations as SIMD lanes: plain arrays, which the compiler vectorises for the instruction set.
pub(super) type Lanes<const L: usize> = AutoSimd<[f64; L]>;

/// Number of configurations whose sines are computed together: fills the vectors and fits into the level-1 cache.
const BLOCK: usize = 64;

/// States before the impacts, as columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct States<'a> {
    /// A column for each entry of q; rad, m, quaternion.
    pub q: &'a [&'a [f64]],
    /// A column for each entry of qd; rad/s, m/s.
    pub qd: &'a [&'a [f64]],
}

impl States<'_> {
    /// Checks number and length of the columns; returns the number of states.
    pub(super) fn count<A: Algebra>(&self, chain: &Chain<A>) -> Result<usize, ChainError> {
        check_number("columns of q", self.q.len(), chain.nq())?;
        check_number("columns of qd", self.qd.len(), chain.nv())?;
        let count = self.qd.first().map_or(0, |column| column.len());
        check_lengths(self.q.iter().chain(self.qd).map(|column| column.len()), count)?;
        Ok(count)
    }
}

pub(super) fn check_number(what: &'static str, got: usize, expected: usize) -> Result<(), ChainError> {
    let layout = "one column for each number";
    if got == expected { Ok(()) } else { Err(ChainError::WrongLength { what, got, expected, layout: layout.into() }) }
}

pub(super) fn check_lengths(mut lengths: impl Iterator<Item = usize>, expected: usize) -> Result<(), ChainError> {
    let layout = "one entry for each state";
    match lengths.find(|&length| length != expected) {
        None => Ok(()),
        Some(got) => Err(ChainError::WrongLength { what: "column", got, expected, layout: layout.into() }),
    }
}

/// What is done with the responses of `L` configurations, which start at entry `at` of the columns. Those past the end of
/// the columns are copies of the last one.
pub(super) trait Receive {
    /// Called with the responses along `normal` while they are in registers; must be inlined there.
    fn receive<const L: usize, A: Algebra<Scalar = Lanes<L>>>(
        &mut self,
        at: usize,
        normal: A::Vector,
        found: PointResponse<A>,
    ) where
        Lanes<L>: SimdRealField + Copy;
}

/// A contact point, and the configurations at which its response is computed.
pub(super) struct Sweep<'a, A: Algebra<Scalar = f64>, R> {
    pub chain: &'a Chain<A>,
    pub point: Point<A>,
    pub normal: A::Vector,
    /// Inertia added to the diagonal of M; empty for none.
    pub added: &'a [f64],
    /// A column for each entry of q.
    pub q: &'a [&'a [f64]],
    pub count: usize,
    pub receive: R,
}

impl<A: Algebra<Scalar = f64>, R: Receive> Sweep<'_, A, R> {
    /// Computes all responses. Allocates its scratch memory once.
    ///
    /// # Errors
    /// As [`Chain::contact_point`].
    pub fn run(self) -> Result<(), ChainError> {
        Arch::new().dispatch(self)
    }
}

impl<A: Algebra<Scalar = f64>, R: Receive> WithSimd for Sweep<'_, A, R> {
    type Output = Result<(), ChainError>;

    // Everything must be inlined here: only this function is compiled for the detected instruction set.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        if S::F64_LANES >= 8 { self.over::<8>() } else { self.over::<4>() }
    }
}

impl<A: Algebra<Scalar = f64>, R: Receive> Sweep<'_, A, R> {
    #[inline(always)]
    fn over<const L: usize>(self) -> Result<(), ChainError>
    where
        Lanes<L>: SimdRealField + Copy,
    {
        let Self { chain, point, normal, added, q: columns, count, mut receive } = self;
        let angles = chain.contact_point(point)?.angles();
        let bodies = chain.bodies().len();
        let chain = chain.cast::<Lanes<L>>();
        let point = Point { body: point.body, position: A::cast_vector(point.position) };
        let point = chain.contact_point(point)?;
        let normal = A::cast_vector(normal);
        let added: Vec<Lanes<L>> = added.iter().map(|x| AutoSimd([*x; L])).collect();
        let mut memory = ResponseMemory::default();
        let zero = AutoSimd([0.0; L]);
        let mut q = vec![zero; columns.len()];
        let turns_only = angles.len() == bodies;
        let mut block_angles = [0.0; BLOCK];
        let (mut sines, mut cosines) = (vec![[0.0; BLOCK]; bodies], vec![[0.0; BLOCK]; bodies]);
        for block in (0..count).step_by(BLOCK) {
            let size = BLOCK.min(count - block);
            for &(body, Angle { coordinate, sense, shift }) in &angles {
                for (angle, q) in block_angles.iter_mut().zip(&columns[coordinate][block..block + size]) {
                    *angle = sense * q + shift;
                }
                sin_cos_into(&block_angles, &mut sines[body], &mut cosines[body]);
            }
            for start in (0..size).step_by(L) {
                let at = block + start;
                if !turns_only {
                    for (q, column) in q.iter_mut().zip(columns) {
                        *q = load(column, at);
                    }
                }
                let turned = ByColumn { sines: &sines, cosines: &cosines, start };
                let several = Several { receive: &mut receive, at, normal };
                point.visit_turned(&q, &turned, normal, &added, &mut memory, several)?;
            }
        }
        Ok(())
    }
}

/// Some configurations, starting at entry `at` of the columns.
struct Several<'r, R, V> {
    receive: &'r mut R,
    at: usize,
    normal: V,
}

impl<const L: usize, A: Algebra<Scalar = Lanes<L>>, R: Receive> Visit<A> for Several<'_, R, A::Vector>
where
    Lanes<L>: SimdRealField + Copy,
{
    const KEEPS: Kept = Kept::Nothing;
    #[inline(always)]
    fn visit(&mut self, found: PointResponse<A>) {
        self.receive.receive(self.at, self.normal, found);
    }
}

/// Sines and cosines from the precomputed columns of a block.
struct ByColumn<'a> {
    sines: &'a [[f64; BLOCK]],
    cosines: &'a [[f64; BLOCK]],
    start: usize,
}

impl<const L: usize, A: Algebra<Scalar = Lanes<L>>> HingeAngles<A> for ByColumn<'_>
where
    Lanes<L>: SimdRealField + Copy,
{
    #[inline(always)]
    fn sin_cos(&self, i: usize, _: Angle<Lanes<L>>) -> (Lanes<L>, Lanes<L>) {
        (load(&self.sines[i], self.start), load(&self.cosines[i], self.start))
    }
}

/// The `L` entries from `at` on; beyond the end of the column its last entry.
#[inline(always)]
pub(super) fn load<const L: usize>(column: &[f64], at: usize) -> Lanes<L> {
    match column.get(at..).and_then(<[f64]>::first_chunk) {
        Some(entries) => AutoSimd(*entries),
        None => AutoSimd(load_end(column, at)),
    }
}

#[cold]
#[inline(never)]
fn load_end<const L: usize>(column: &[f64], at: usize) -> [f64; L] {
    std::array::from_fn(|l| column[(at + l).min(column.len() - 1)])
}

/// Stores the entries from `at` on, up to the end of the column.
#[inline(always)]
pub(super) fn store<const L: usize>(column: &mut [f64], at: usize, AutoSimd(x): Lanes<L>) {
    match column.get_mut(at..at + L) {
        Some(entries) => entries.copy_from_slice(&x),
        None => store_end(&mut column[at..], &x),
    }
}

#[cold]
#[inline(never)]
fn store_end(end: &mut [f64], x: &[f64]) {
    end.iter_mut().zip(x).for_each(|(entry, x)| *entry = *x);
}
