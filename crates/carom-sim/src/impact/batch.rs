//! The frictionless impact at one configuration or at many: the kernel for sweeps.
//!
//! `qd⁺ = qd⁻ − (1+e) (n·J qd⁻)/(nᵀHn) M⁻¹Jᵀn`: eqs. (10)–(15) of Pagilla & Yu, IEEE/ASME T. Mechatronics 9 (2004), with
//! J, M, H and M⁻¹Jᵀ from one fused pass ([`carom_chain::ContactPoint`]).
//!
//! **Batches.** [`FrictionlessJump::many`] reads and writes columns: one slice for each coordinate, with one entry for each
//! configuration. It computes sines and cosines of whole columns and then runs the kernel for four or eight
//! configurations at once (SIMD); the instruction set is detected at run time. The operations on each configuration are
//! those of [`FrictionlessJump::jump_into`] in the same order, so the results are bitwise equal (`tests/batch.rs`).
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | n | unit normal, world axes, from the environment to the robot | `normal` |
//! | e | restitution; Newton's, Poisson's and Stronge's coefficients are equal without friction | `restitution` |
//! | p = −(1+e) (n·u⁻)/(nᵀHn) | normal impulse, N s | `impulse` |

use carom_chain::algebra::Algebra;
use carom_chain::sine::sin_cos_into;
use carom_chain::{Angle, Chain, ChainError, ContactPoint, Kept, Point, PointResponse, ResponseMemory, Turned, Visit};
use nalgebra::SimdRealField;
use pulp::{Arch, Simd, WithSimd};
use simba::simd::AutoSimd;

/// `L` configurations as SIMD lanes: plain arrays, which the compiler vectorises for the instruction set.
type Lanes<const L: usize> = AutoSimd<[f64; L]>;

/// Number of configurations whose sines are computed together: fills the vectors and fits into the level-1 cache.
const BLOCK: usize = 64;

/// The frictionless impact of one point of a chain, prepared for many configurations. Immutable; share it by reference.
#[derive(Debug, Clone)]
pub struct FrictionlessJump<A: Algebra<Scalar = f64>> {
    chain: Chain<A>,
    point: Point<A>,
}

/// The result of one impact, with its scratch memory.
#[derive(Debug, Clone)]
pub struct Jumped<A: Algebra> {
    /// Joint velocities after the impact, length nv; rad/s, m/s.
    pub qd_plus: Vec<A::Scalar>,
    /// Normal impulse, N s.
    pub impulse: A::Scalar,
    /// Position, J, M and H at the contact point.
    pub memory: ResponseMemory<A>,
}

/// States before the impacts, as columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct States<'a> {
    /// A column for each entry of q; rad, m, quaternion.
    pub q: &'a [&'a [f64]],
    /// A column for each entry of qd; rad/s, m/s.
    pub qd: &'a [&'a [f64]],
}

/// Results of the impacts, as columns of the length of those of the states. An empty slice leaves a result out.
#[derive(Debug, Default)]
pub struct Outcomes<'a, 'b> {
    /// A column for each joint velocity after the impact; rad/s, m/s.
    pub qd_plus: &'a mut [&'b mut [f64]],
    /// One column: the normal impulses, N s.
    pub impulse: &'a mut [&'b mut [f64]],
    /// Entries of H in column-major order: 9 columns, or 4 in the plane; world axes, 1/kg.
    pub delassus: &'a mut [&'b mut [f64]],
    /// Entries of J in column-major order: 3·nv columns, or 2·nv in the plane; world axes.
    pub jacobian: &'a mut [&'b mut [f64]],
    /// Entries of M in column-major order: nv² columns.
    pub mass_matrix: &'a mut [&'b mut [f64]],
}

impl<A: Algebra<Scalar = f64>> FrictionlessJump<A> {
    /// Prepares a point of a chain.
    ///
    /// # Errors
    /// [`ChainError::Coupled`] for a chain with mimic joints; [`ChainError::FixedPoint`] for a point of the world.
    pub fn new(chain: &Chain<A>, point: Point<A>) -> Result<Self, ChainError> {
        chain.contact_point(point)?;
        Ok(Self { chain: chain.clone(), point })
    }

    fn contact_point(&self) -> Result<ContactPoint<'_, A>, ChainError> {
        self.chain.contact_point(self.point)
    }

    /// Allocates the memory for one impact, for [`FrictionlessJump::jump_into`].
    pub fn jump(&self) -> Jumped<A> {
        Jumped { qd_plus: vec![0.0; self.chain.nv()], impulse: 0.0, memory: ResponseMemory::default() }
    }

    /// Computes the impact at `q` (length nq), `qd` (length nv), with the unit `normal` in world axes, from the environment
    /// to the robot. Allocates only at the first
    /// use of `jump`.
    ///
    /// The kernel checks neither the sign of the approach velocity nor a singular normal, which gives infinite results; use
    /// [`crate::Strike`] for these checks.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`] for `q` or `qd`.
    ///
    /// # Panics
    /// If `jump` was made for another chain.
    pub fn jump_into(
        &self,
        q: &[f64],
        qd: &[f64],
        normal: A::Vector,
        restitution: f64,
        jump: &mut Jumped<A>,
    ) -> Result<(), ChainError> {
        if qd.len() != self.chain.nv() {
            self.chain.check_v("qd", qd)?;
        }
        assert_eq!(jump.qd_plus.len(), qd.len(), "this jump belongs to another chain");
        let Jumped { qd_plus, impulse, memory } = jump;
        self.contact_point()?.visit(q, normal, &[], memory, Single { normal, qd, restitution, qd_plus, impulse })
    }

    /// Computes the impacts at many states with the same unit `normal` (world axes, from the environment to the robot) and
    /// `restitution`. Allocates its scratch memory once for each call. As in [`FrictionlessJump::jump_into`], approach and
    /// normal are not checked.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`]: a wrong number of columns, or columns of different lengths.
    pub fn many(
        &self,
        states: States,
        normal: A::Vector,
        restitution: f64,
        outcomes: &mut Outcomes,
    ) -> Result<(), ChainError> {
        let count = self.check(&states, outcomes)?;
        Arch::new().dispatch(Sweep { jump: self, states, normal, restitution, outcomes, count })
    }

    /// Checks number and length of all columns; returns the number of states.
    fn check(&self, states: &States, outcomes: &Outcomes) -> Result<usize, ChainError> {
        let chain = &self.chain;
        let (nv, linear) = (chain.nv(), A::LINEAR);
        let number = |what, got, expected: usize, optional: bool| {
            let layout = "one column for each number".to_string();
            if got == expected || optional && got == 0 {
                Ok(())
            } else {
                Err(ChainError::WrongLength { what, got, expected, layout })
            }
        };
        number("columns of q", states.q.len(), chain.nq(), false)?;
        number("columns of qd", states.qd.len(), nv, false)?;
        number("columns of qd_plus", outcomes.qd_plus.len(), nv, true)?;
        number("columns of impulse", outcomes.impulse.len(), 1, true)?;
        number("columns of delassus", outcomes.delassus.len(), linear * linear, true)?;
        number("columns of jacobian", outcomes.jacobian.len(), linear * nv, true)?;
        number("columns of mass_matrix", outcomes.mass_matrix.len(), nv * nv, true)?;
        let count = states.qd.first().map_or(0, |column| column.len());
        let given = states.q.iter().chain(states.qd).map(|c| c.len());
        let wanted = outcomes.all().map(|c| c.len());
        match given.chain(wanted).find(|&length| length != count) {
            None => Ok(count),
            Some(got) => {
                let layout = "one entry for each state".to_string();
                Err(ChainError::WrongLength { what: "column", got, expected: count, layout })
            }
        }
    }
}

impl<'b> Outcomes<'_, 'b> {
    fn all(&self) -> impl Iterator<Item = &&'b mut [f64]> {
        let rest = self.delassus.iter().chain(self.jacobian.iter()).chain(self.mass_matrix.iter());
        self.qd_plus.iter().chain(self.impulse.iter()).chain(rest)
    }
}

/// p = −(1+e) (n·u⁻)/(nᵀHn)
#[inline(always)]
fn impulse<T: SimdRealField + Copy>(restitution: T, approach: T, mobility: T) -> T {
    -(T::one() + restitution) * approach / mobility
}

/// A single impact.
struct Single<'a, A: Algebra> {
    normal: A::Vector,
    qd: &'a [f64],
    restitution: f64,
    qd_plus: &'a mut [f64],
    impulse: &'a mut f64,
}

impl<A: Algebra<Scalar = f64>> Visit<A> for Single<'_, A> {
    const KEEPS: Kept = Kept::Matrices;
    // Loops over a known number of entries, as in [`Several`]: values then stay in registers.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn visit(&mut self, found: PointResponse<A>) {
        let n = found.response.len();
        let (qd, qd_plus, normal) = (&self.qd[..n], &mut self.qd_plus[..n], self.normal);
        let mut approach = A::dot(found.jacobian[0], normal) * qd[0];
        for i in 1..n {
            approach += A::dot(found.jacobian[i], normal) * qd[i];
        }
        let impulse = impulse(self.restitution, approach, found.mobility);
        let push = A::times(normal, impulse);
        for i in 0..n {
            qd_plus[i] = qd[i] + A::dot(found.response[i], push);
        }
        *self.impulse = impulse;
    }
}

/// The computation over all states, dispatched to the instruction set of the processor.
struct Sweep<'a, 'b, 'c, A: Algebra<Scalar = f64>> {
    jump: &'a FrictionlessJump<A>,
    states: States<'a>,
    normal: A::Vector,
    restitution: f64,
    outcomes: &'a mut Outcomes<'b, 'c>,
    count: usize,
}

impl<A: Algebra<Scalar = f64>> WithSimd for Sweep<'_, '_, '_, A> {
    type Output = Result<(), ChainError>;

    // Everything must be inlined here: only this function is compiled for the detected instruction set.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        if S::F64_LANES >= 8 { self.over::<8>() } else { self.over::<4>() }
    }
}

impl<A: Algebra<Scalar = f64>> Sweep<'_, '_, '_, A> {
    #[inline(always)]
    fn over<const L: usize>(self) -> Result<(), ChainError>
    where
        Lanes<L>: SimdRealField + Copy,
    {
        let Self { jump, states, normal, restitution, outcomes, count } = self;
        let angles = jump.contact_point()?.angles();
        let bodies = jump.chain.bodies().len();
        let chain = jump.chain.cast::<Lanes<L>>();
        let point = Point { body: jump.point.body, position: A::cast_vector(jump.point.position) };
        let point = chain.contact_point(point)?;
        let normal = A::cast_vector(normal);
        let restitution = AutoSimd([restitution; L]);
        let mut memory = ResponseMemory::default();
        let zero = AutoSimd([0.0; L]);
        let mut q = vec![zero; states.q.len()];
        let turns_only = angles.len() == bodies;
        let mut block_angles = [0.0; BLOCK];
        let (mut sines, mut cosines) = (vec![[0.0; BLOCK]; bodies], vec![[0.0; BLOCK]; bodies]);
        for block in (0..count).step_by(BLOCK) {
            let size = BLOCK.min(count - block);
            for &(body, Angle { coordinate, sense, shift }) in &angles {
                for (angle, q) in block_angles.iter_mut().zip(&states.q[coordinate][block..block + size]) {
                    *angle = sense * q + shift;
                }
                sin_cos_into(&block_angles, &mut sines[body], &mut cosines[body]);
            }
            for start in (0..size).step_by(L) {
                let at = block + start;
                if !turns_only {
                    for (q, column) in q.iter_mut().zip(states.q) {
                        *q = load(column, at);
                    }
                }
                let turned = ByColumn { sines: &sines, cosines: &cosines, start };
                let several = Several::<L, A::Cast<Lanes<L>>> { normal, qd: states.qd, restitution, outcomes, at };
                point.visit_turned(&q, &turned, normal, &mut memory, several)?;
            }
        }
        Ok(())
    }
}

/// `L` impacts, starting at entry `at` of the columns.
struct Several<'a, 'b, 'c, const L: usize, A: Algebra> {
    normal: A::Vector,
    qd: &'a [&'a [f64]],
    restitution: Lanes<L>,
    outcomes: &'a mut Outcomes<'b, 'c>,
    at: usize,
}

impl<const L: usize, A: Algebra<Scalar = Lanes<L>>> Visit<A> for Several<'_, '_, '_, L, A>
where
    Lanes<L>: SimdRealField + Copy,
{
    const KEEPS: Kept = Kept::Nothing;
    // The compiler unrolls these loops where it knows the number of joints; it did not with iterators.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn visit(&mut self, found: PointResponse<A>) {
        let Self { normal, qd, restitution, outcomes, at } = self;
        let (at, normal) = (*at, *normal);
        // Slices of the length of the response, so that the compiler can unroll where it knows this length.
        let n = found.response.len();
        let qd = &qd[..n];
        let mut approach = A::dot(found.jacobian[0], normal) * load(qd[0], at);
        for i in 1..n {
            approach += A::dot(found.jacobian[i], normal) * load(qd[i], at);
        }
        let impulse = impulse(*restitution, approach, found.mobility);
        let push = A::times(normal, impulse);
        if !outcomes.qd_plus.is_empty() {
            let columns = &mut outcomes.qd_plus[..n];
            for i in 0..n {
                store(columns[i], at, load(qd[i], at) + A::dot(found.response[i], push));
            }
        }
        for column in outcomes.impulse.iter_mut() {
            store(column, at, impulse);
        }
        let linear = A::LINEAR;
        if !outcomes.delassus.is_empty() {
            let columns = &mut outcomes.delassus[..linear * linear];
            for k in 0..linear * linear {
                store(columns[k], at, A::linear_part(found.delassus[k / linear], k % linear));
            }
        }
        if !outcomes.jacobian.is_empty() {
            let columns = &mut outcomes.jacobian[..linear * n];
            for k in 0..linear * n {
                store(columns[k], at, A::linear_part(found.jacobian[k / linear], k % linear));
            }
        }
        if !outcomes.mass_matrix.is_empty() {
            let columns = &mut outcomes.mass_matrix[..n * n];
            for k in 0..n * n {
                store(columns[k], at, found.mass_matrix[k]);
            }
        }
    }
}

/// Sines and cosines from the precomputed columns of a block.
struct ByColumn<'a> {
    sines: &'a [[f64; BLOCK]],
    cosines: &'a [[f64; BLOCK]],
    start: usize,
}

impl<const L: usize, A: Algebra<Scalar = Lanes<L>>> Turned<A> for ByColumn<'_>
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
fn load<const L: usize>(column: &[f64], at: usize) -> Lanes<L> {
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
fn store<const L: usize>(column: &mut [f64], at: usize, AutoSimd(x): Lanes<L>) {
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
