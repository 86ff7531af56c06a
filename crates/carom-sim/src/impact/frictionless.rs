//! The frictionless impact at one configuration or at many: the kernels for sweeps.
//!
//! `qd⁺ = qd⁻ − (1+e) (n·J qd⁻)/(nᵀHn) M⁻¹Jᵀn`: eqs. (10)–(15) of Pagilla & Yu, IEEE/ASME T. Mechatronics 9 (2004), with
//! J, M, H and M⁻¹Jᵀ from one fused pass ([`carom_chain::ContactPoint`]).
//!
//! **Batches.** [`FrictionlessJump::many`] reads and writes columns: one slice for each coordinate, with one entry for each
//! configuration. It computes sines and cosines of whole columns and then runs the kernel for four or eight
//! configurations at once (SIMD); the instruction set is detected at run time. The operations on each configuration are
//! those of [`FrictionlessJump::jump_into`] in the same order, so the results are bitwise equal (`tests/batch.rs`).
//!
//! [`frictionless_jump_into`] is the same without J, M and H and without branches, for any scalar, also dual numbers: the
//! articulated-body recursion gives M⁻¹Jᵀn in O(n), and nᵀHn = (Jᵀn)·(M⁻¹Jᵀn).
//!
//! **Long chains**, of more than some 48 bodies, are computed by recursions in time proportional to their number, one configuration
//! after another.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | n | unit normal, world axes, from the environment to the robot | `normal` |
//! | e | restitution; Newton's, Poisson's and Stronge's coefficients are equal without friction | `restitution` |
//! | p = −(1+e) (n·u⁻)/(nᵀHn) | normal impulse, N s | `impulse` |

use super::lanes::{Lanes, Receive, States, Sweep, check_lengths, check_number, load, store};
use carom_chain::algebra::Algebra;
use carom_chain::{Chain, ChainError, Kept, Kinematics, Point, PointResponse, ResponseMemory, Visit, Workspace};
use nalgebra::SimdRealField;
use num_traits::{One, Zero};
use simba::simd::AutoSimd;

/// Number of configurations of a long chain that are read and written together.
const BLOCK: usize = 8;

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
    memory: ResponseMemory<A>,
    /// For long chains.
    workspace: Option<Box<Workspace<A>>>,
}

impl<A: Algebra> Jumped<A> {
    /// Position, J, M and H at the contact point.
    pub fn response(&self) -> PointResponse<'_, A> {
        self.memory.response()
    }
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

    /// Allocates the memory for one impact, for [`FrictionlessJump::jump_into`].
    pub fn jump(&self) -> Jumped<A> {
        let workspace = (!self.chain.has_fused_pass()).then(|| Box::new(self.chain.workspace()));
        Jumped { qd_plus: vec![0.0; self.chain.nv()], impulse: 0.0, memory: ResponseMemory::default(), workspace }
    }

    /// Computes the impact at `q` (length nq), `qd` (length nv), with the unit `normal` in world axes, from the environment
    /// to the robot. Allocates only at the first
    /// use of `jump`.
    ///
    /// The kernel checks neither the sign of the approach velocity nor a singular normal, which gives infinite results; use
    /// [`crate::Strike`] for these checks.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`] for `q` or `qd`; [`ChainError::NoInertia`] for a long chain with a singular M.
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
        if jump.workspace.is_some() {
            return self.jump_of_long_chain(q, qd, normal, restitution, jump);
        }
        let Jumped { qd_plus, impulse, memory, .. } = jump;
        let single = Single { normal, qd, restitution, qd_plus, impulse };
        self.chain.contact_point(self.point)?.visit(q, normal, &[], memory, single)
    }

    // Inlined, it takes some 50 instructions from impacts of short chains.
    #[cold]
    #[inline(never)]
    fn jump_of_long_chain(
        &self,
        q: &[f64],
        qd: &[f64],
        normal: A::Vector,
        restitution: f64,
        jump: &mut Jumped<A>,
    ) -> Result<(), ChainError> {
        let Jumped { qd_plus, impulse, memory, workspace: Some(workspace) } = jump else { return Ok(()) };
        workspace.update(&self.chain, q)?.contact_and_mass_matrix_into(self.point, normal, memory)?;
        Single { normal, qd, restitution, qd_plus, impulse }.visit(memory.response());
        Ok(())
    }

    /// Computes the impacts at many states with the same unit `normal` (world axes, from the environment to the robot) and
    /// `restitution`. Allocates its scratch memory once for each call. As in [`FrictionlessJump::jump_into`], approach and
    /// normal are not checked.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`]: a wrong number of columns, or columns of different lengths; [`ChainError::NoInertia`] for a
    /// long chain with a singular M.
    pub fn many(
        &self,
        states: States,
        normal: A::Vector,
        restitution: f64,
        outcomes: &mut Outcomes,
    ) -> Result<(), ChainError> {
        let (chain, point) = (&self.chain, self.point);
        let count = states.count(chain)?;
        outcomes.check::<A>(chain.nv(), count)?;
        if !chain.has_fused_pass() {
            return self.one_after_another(states, count, normal, restitution, outcomes);
        }
        let receive = InLanes { qd: states.qd, restitution, outcomes };
        Sweep { chain, point, normal, added: &[], q: states.q, count, receive }.run()
    }

    /// By recursions. Columns are read and written in blocks, because a number of each of n² columns is in a memory page of its own.
    fn one_after_another(
        &self,
        states: States,
        count: usize,
        normal: A::Vector,
        restitution: f64,
        outcomes: &mut Outcomes,
    ) -> Result<(), ChainError> {
        let (linear, blank) = (A::LINEAR, (vec![0.0; states.q.len()], vec![0.0; states.qd.len()], self.jump()));
        let mut block = vec![blank; BLOCK];
        for at in (0..count).step_by(BLOCK) {
            let block = &mut block[..BLOCK.min(count - at)];
            for (i, column) in states.q.iter().enumerate() {
                block.iter_mut().zip(&column[at..]).for_each(|((q, ..), x)| q[i] = *x);
            }
            for (i, column) in states.qd.iter().enumerate() {
                block.iter_mut().zip(&column[at..]).for_each(|((_, qd, _), x)| qd[i] = *x);
            }
            for (q, qd, jump) in block.iter_mut() {
                self.jump_into(q, qd, normal, restitution, jump)?;
            }
            let jumps = || block.iter().map(|(.., jump)| jump);
            let found: Vec<_> = jumps().map(|jump| jump.response()).collect();
            let part = |vectors: &[A::Vector], i: usize| A::linear_part(vectors[i / linear], i % linear);
            for (i, column) in outcomes.qd_plus.iter_mut().enumerate() {
                column[at..].iter_mut().zip(jumps()).for_each(|(x, jump)| *x = jump.qd_plus[i]);
            }
            for column in outcomes.impulse.iter_mut() {
                column[at..].iter_mut().zip(jumps()).for_each(|(x, jump)| *x = jump.impulse);
            }
            for (i, column) in outcomes.delassus.iter_mut().enumerate() {
                column[at..].iter_mut().zip(&found).for_each(|(x, found)| *x = part(&found.delassus, i));
            }
            for (i, column) in outcomes.jacobian.iter_mut().enumerate() {
                column[at..].iter_mut().zip(&found).for_each(|(x, found)| *x = part(found.jacobian, i));
            }
            for (i, column) in outcomes.mass_matrix.iter_mut().enumerate() {
                column[at..].iter_mut().zip(&found).for_each(|(x, found)| *x = found.mass_matrix[i]);
            }
        }
        Ok(())
    }
}

impl Outcomes<'_, '_> {
    /// Checks number and length of all columns.
    fn check<A: Algebra>(&self, nv: usize, count: usize) -> Result<(), ChainError> {
        let linear = A::LINEAR;
        let all = [
            ("columns of qd_plus", &self.qd_plus, nv),
            ("columns of impulse", &self.impulse, 1),
            ("columns of delassus", &self.delassus, linear * linear),
            ("columns of jacobian", &self.jacobian, linear * nv),
            ("columns of mass_matrix", &self.mass_matrix, nv * nv),
        ];
        for (what, columns, expected) in all {
            if !columns.is_empty() {
                check_number(what, columns.len(), expected)?;
            }
        }
        check_lengths(all.iter().flat_map(|(_, columns, _)| columns.iter().map(|column| column.len())), count)
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
    // Loops over a known number of entries, as in `receive`: values then stay in registers.
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

/// Impacts of configurations in lanes.
struct InLanes<'a, 'b, 'c> {
    qd: &'a [&'a [f64]],
    restitution: f64,
    outcomes: &'a mut Outcomes<'b, 'c>,
}

impl Receive for InLanes<'_, '_, '_> {
    // The compiler unrolls these loops where it knows the number of joints; it did not with iterators.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn receive<const L: usize, A: Algebra<Scalar = Lanes<L>>>(
        &mut self,
        at: usize,
        normal: A::Vector,
        found: PointResponse<A>,
    ) where
        Lanes<L>: SimdRealField + Copy,
    {
        let Self { qd, restitution, outcomes } = self;
        // Slices of the length of the response, so that the compiler can unroll where it knows this length.
        let n = found.response.len();
        let qd = &qd[..n];
        let mut approach = A::dot(found.jacobian[0], normal) * load(qd[0], at);
        for i in 1..n {
            approach += A::dot(found.jacobian[i], normal) * load(qd[i], at);
        }
        let impulse = impulse(AutoSimd([*restitution; L]), approach, found.mobility);
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

/// Joint velocities after a frictionless impact of `point` along the unit `normal` (world axes, from the environment to
/// the robot) with `restitution` (Newton's, Poisson's and Stronge's coefficients are equal without friction). Writes
/// `qd_plus`, overwrites `scratch` (both of length nv), and returns the normal impulse, N s. Allocates nothing.
///
/// The kernel checks neither the sign of the approach velocity nor a singular normal, which gives infinite results; use
/// [`crate::Strike`] for these checks.
///
/// # Errors
/// [`ChainError::WrongLength`]; [`ChainError::Coupled`] for a chain with mimic joints.
pub fn frictionless_jump_into<A: Algebra>(
    kin: &mut Kinematics<A>,
    point: Point<A>,
    normal: A::Vector,
    restitution: A::Scalar,
    qd: &[A::Scalar],
    scratch: &mut [A::Scalar],
    qd_plus: &mut [A::Scalar],
) -> Result<A::Scalar, ChainError> {
    let approach = A::dot(normal, kin.point_velocity(point, qd)?);
    kin.articulate()?.respond_along(point, normal, scratch, qd_plus)?;
    let mut c = A::Scalar::zero();
    for (j, x) in scratch.iter().zip(qd_plus.iter()) {
        c += *j * *x;
    }
    let impulse = -(A::Scalar::one() + restitution) * approach / c;
    for (x, v) in qd_plus.iter_mut().zip(qd) {
        *x = *v + *x * impulse;
    }
    Ok(impulse)
}
