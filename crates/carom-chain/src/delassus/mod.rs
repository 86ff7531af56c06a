//! The response of a chain at one contact point: position, J, M, H = J M⁻¹ Jᵀ and X = M⁻¹Jᵀ, computed together.
//!
//! M is computed once and factored in place, `M = Lᵀ D L`, which keeps the zeros of a tree. With `Y = L⁻ᵀ Jᵀ`, whose rows are
//! zero for bodies not between the point and the world, `H = Yᵀ D⁻¹ Y` and `X = L⁻¹ D⁻¹ Y`. There are no square roots, and one
//! division per joint.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J | 3×nv, 2×nv | velocity of the point for unit joint rates, world axes | `jacobian` |
//! | M | nv×nv | mass matrix | `mass_matrix` |
//! | L, D | nv×nv | unit lower triangle and diagonal: M = Lᵀ D L; stored as rows of D L, without the zeros | `factor`, `inverse_d` |
//! | yₖ | 3, 2 | row k of Y: unit forces at the point, projected on joint k after the joints beyond it are eliminated | `reduced_jacobian` |
//! | H | 3×3, 2×2 | Delassus matrix J M⁻¹ Jᵀ, world axes, 1/kg | `delassus` |
//! | X | nv×3, nv×2 | M⁻¹Jᵀ: joint velocities after unit impulses along the axes | `response` |
//! | nᵀHn | 1 | velocity of the point along n after a unit impulse along n, 1/kg | `mobility` |
//! | lₖ | nv | largest speed that the lengths between joint k and the point could give it: their sum for a hinge, 1 for a slider | `levers` |
//! | W | nv | inertia added to the diagonal of M by drives; infinite for a locked joint | `added` |
//!
//! **Two entries.** [`ContactPoint::visit`] starts from q and hands the results to a [`Visit`] while they are in registers: for
//! loops and SIMD lanes. [`Kinematics::contact`](crate::Kinematics::contact) starts from the poses of a workspace and returns
//! a view of its memory (`view.rs`).
//!
//! **Routes.** The fused pass (`fused.rs`) is generic over the structure of the chain (`topology.rs`), a row of hinges or a tree,
//! and over its joints: hinges alone, so that the joint type is known statically, or any joints. Rows of two and three hinges
//! have unrolled passes (`unrolled.rs`). Chains of more than [`LONG`] bodies use the
//! articulated-body recursion, whose time is proportional to their number; chains with mimic joints the same factorisation
//! without the zeros. `docs/performance.md` gives the gain in speed of each; `tests/delassus.rs` compares all of them with
//! the definitions.
//!
//! **Singularity.** One rule ([`singular`]): a quantity is zero if it is within the rounding of the terms that cancel in it. A
//! joint moves no inertia if its D is within the rounding of the composite inertia of its subtree
//! ([`Kinematics::check_inertia`](crate::Kinematics::check_inertia)). An entry of J is a sum of lengths between the joint and the
//! point, as long as the lever lₖ at most: a direction n is singular if √(nᵀHn) is within the rounding of √(Σ lₖ²/Dₖ), which is
//! what the same chain with its levers along n would have ([`PointResponse::moves`]). A comparison with H itself would take a
//! point that no joint moves at all, such as one on the axis of a hinge, for one that its rounding moves.
//!
//! **SIMD lanes.** Code that runs in lanes must be inlined, because it is otherwise compiled without AVX instructions. The
//! pass and the algebra that it calls therefore use no closures, and the pass uses no operators of nalgebra.
//!
//! Source: Featherstone (2008), tables 6.2 (CRBA), 6.3 (LTDL) and 6.4, in world axes (see [`crate::algebra`]).

mod fused;
mod response;
mod rows;
mod topology;
mod unrolled;
mod view;

use crate::algebra::{Algebra, Axis};
use crate::body::Point;
use crate::chain::Chain;
use crate::error::ChainError;
use crate::prepare::{Angle, ByBody, Hinge, HingeAngles, PreparedBody};
use crate::specialised::sine::{sin_cos, sin_cos_by_pairs, sin_cos_of_two};
use fused::{At, BodyAt, Memory, Poses, read, row_length};
use num_traits::Zero;
pub use response::PointResponse;
pub use rows::Rows;
use std::sync::Arc;
pub(crate) use topology::Structure;
use topology::{Row, Tree};
use unrolled::{read_three, read_two};
pub(crate) use view::Dense;

/// Largest number of bodies of the fused pass, which forms M: from here on the recursion is faster.
pub(crate) const LONG: usize = 48;

/// A contact point of a chain. It refers to the chain and holds no other memory.
#[derive(Debug, Clone, Copy)]
pub struct ContactPoint<'c, A: Algebra> {
    chain: &'c Chain<A>,
    body: usize,
    arm: A::Vector,
}

/// A function of the results, called while they are in registers. It is a trait because inlining of a closure cannot be
/// forced.
pub trait Visit<A: Algebra> {
    /// Which results are also stored in the [`ResponseMemory`].
    const KEEPS: Kept;
    /// Called once with the results.
    fn visit(&mut self, response: PointResponse<A>);
}

/// Which results a [`Visit`] stores. The others are unspecified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// None.
    Nothing,
    /// Position, J, M, H and nᵀHn.
    Matrices,
    /// All.
    All,
}

/// Stores the results in the memory and does nothing else.
pub struct Keep;

impl<A: Algebra> Visit<A> for Keep {
    const KEEPS: Kept = Kept::All;
    #[inline(always)]
    fn visit(&mut self, _: PointResponse<A>) {}
}

/// Memory for the results at one point, and scratch memory. It grows at first use and can be used for any chain.
#[derive(Debug, Clone)]
pub struct ResponseMemory<A: Algebra> {
    position: A::Vector,
    delassus: [A::Vector; 3],
    mobility: A::Scalar,
    size: usize,
    /// J, X, Y, and scratch memory by depth.
    vectors: Vec<A::Vector>,
    /// 1/D, levers, M, the factor.
    numbers: Vec<A::Scalar>,
    /// Angle of each body's joint, rad, used for hinges only; their sines and cosines.
    angles: [Vec<A::Scalar>; 3],
    hinges: Vec<BodyAt<A, Hinge<A>>>,
    joints: Vec<BodyAt<A, Axis<A>>>,
    /// The structure and the branch whose zeros are in place: those entries of M between branches and of J and Y off the path
    /// to the point that its pass does not write.
    zeros_of: Option<(Arc<Structure>, usize)>,
}

impl<A: Algebra> Default for ResponseMemory<A> {
    fn default() -> Self {
        Self {
            position: A::zero(),
            delassus: [A::zero(); 3],
            mobility: A::Scalar::zero(),
            size: 0,
            vectors: Vec::new(),
            numbers: Vec::new(),
            angles: [Vec::new(), Vec::new(), Vec::new()],
            hinges: Vec::new(),
            joints: Vec::new(),
            zeros_of: None,
        }
    }
}

impl<A: Algebra> Chain<A> {
    /// Whether [`ContactPoint::visit`] is the fastest route: neither mimic joints nor more than some 48 bodies. Otherwise
    /// [`Kinematics::contact`](crate::Kinematics::contact) is.
    #[doc(hidden)]
    pub fn has_fused_pass(&self) -> bool {
        !self.is_coupled() && self.bodies.len() <= LONG
    }

    /// A contact point, for [`ContactPoint::visit`].
    ///
    /// # Errors
    /// [`ChainError::Coupled`] for a chain with mimic joints; [`ChainError::FixedPoint`] for a point of the world.
    #[doc(hidden)]
    #[inline]
    pub fn contact_point(&self, point: Point<A>) -> Result<ContactPoint<'_, A>, ChainError> {
        match point.body {
            Some(body) if !self.is_coupled() => Ok(ContactPoint { chain: self, body, arm: point.position }),
            Some(_) => Err(ChainError::Coupled { chain: self.name().into() }),
            None => Err(ChainError::FixedPoint { chain: self.name().into() }),
        }
    }
}

impl<A: Algebra<Scalar = f64>> ContactPoint<'_, A> {
    /// Computes the response at `q` (length nq; rad, m, quaternion) for the unit normal n in world axes, and calls `visit` with
    /// it. `added`: inertia W added to the diagonal of M, by coordinate, kg m² or kg, 0 or more, infinite for a locked joint;
    /// empty for none. Allocates only at first use of the memory.
    ///
    /// The numbers are not checked; use [`Chain::check_state`] for that. A singular M gives infinite results:
    /// [`PointResponse::is_doubtful`].
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    #[inline(always)]
    pub fn visit(
        &self,
        q: &[f64],
        normal: A::Vector,
        added: &[f64],
        memory: &mut ResponseMemory<A>,
        visit: impl Visit<A>,
    ) -> Result<(), ChainError> {
        self.chain.check_nq(q.len())?;
        match self.row() {
            // All sines first: computed body by body, each would delay the next body.
            Some([a, b]) if added.is_empty() => {
                let (mut sines, mut cosines) = ([0.0; 2], [0.0; 2]);
                sin_cos_of_two(a.angle().at(q), b.angle().at(q), &mut sines, &mut cosines);
                let turned = ByBody { sines: &sines, cosines: &cosines };
                memory.keep(read_two([a, b], self.arm, &turned, normal).response(), visit);
            }
            Some([a, b, c]) if added.is_empty() => {
                let sin_cos = [a, b, c].map(|body| sin_cos(body.angle().at(q)));
                let turned = ByBody { sines: &sin_cos.map(|x| x.0), cosines: &sin_cos.map(|x| x.1) };
                memory.keep(read_three([a, b, c], self.arm, &turned, normal).response(), visit);
            }
            _ => {
                let [mut angles, mut sines, mut cosines] = std::mem::take(&mut memory.angles);
                let prepared = &self.chain.prepared;
                for all in [&mut angles, &mut sines, &mut cosines] {
                    all.resize(prepared.len(), 0.0);
                }
                for (angle, body) in angles.iter_mut().zip(prepared) {
                    if A::turns(body.joint) {
                        *angle = body.angle().at(q);
                    }
                }
                sin_cos_by_pairs(&angles, &mut sines, &mut cosines);
                let turned = ByBody { sines: &sines, cosines: &cosines };
                self.many(&At { q, turned: &turned }, normal, added, memory, visit);
                memory.angles = [angles, sines, cosines];
            }
        }
        Ok(())
    }
}

impl<A: Algebra> ContactPoint<'_, A> {
    /// The chain.
    pub fn chain(&self) -> &Chain<A> {
        self.chain
    }

    /// The hinges, if they are a row and the point is on the last body.
    #[inline(always)]
    fn row(&self) -> Option<&[PreparedBody<A>]> {
        let Chain { prepared, structure, .. } = self.chain;
        (structure.row && self.body + 1 == prepared.len()).then_some(prepared)
    }

    /// The hinges whose sines and cosines [`Self::visit_turned`] needs: index of the body, and angle.
    pub fn angles(&self) -> Vec<(usize, Angle<A::Scalar>)> {
        let hinges = self.chain.prepared.iter().enumerate().filter(|(_, body)| A::turns(body.joint));
        hinges.map(|(i, body)| (i, body.angle())).collect()
    }

    /// As [`Self::visit`], with the sines and cosines of the hinges' angles given. Each lane of a SIMD scalar gives the same
    /// digits as the scalar alone, for the same sines and cosines.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    #[inline(always)]
    pub fn visit_turned(
        &self,
        q: &[A::Scalar],
        turned: &impl HingeAngles<A>,
        normal: A::Vector,
        added: &[A::Scalar],
        memory: &mut ResponseMemory<A>,
        visit: impl Visit<A>,
    ) -> Result<(), ChainError> {
        self.chain.check_nq(q.len())?;
        match self.row() {
            Some([a, b]) if added.is_empty() => {
                memory.keep(read_two([a, b], self.arm, turned, normal).response(), visit)
            }
            Some([a, b, c]) if added.is_empty() => {
                memory.keep(read_three([a, b, c], self.arm, turned, normal).response(), visit)
            }
            _ => self.many(&At { q, turned }, normal, added, memory, visit),
        }
        Ok(())
    }

    /// The passes with loops.
    #[inline(always)]
    fn many(
        &self,
        poses: &(impl Poses<A> + ?Sized),
        normal: A::Vector,
        added: &[A::Scalar],
        memory: &mut ResponseMemory<A>,
        mut visit: impl Visit<A>,
    ) {
        let (Chain { prepared, structure, .. }, arm) = (self.chain, self.arm);
        let (n, tree) = (prepared.len(), Tree::new(&structure.paths, self.body));
        memory.grow(n, row_length::<A::Scalar>(n));
        memory.put_zeros(structure, self.body);
        let (hinges, joints, parts) = memory.parts(n);
        let response = if self.row().is_some() {
            hinges.resize(n, BodyAt::new());
            poses.write(Row, prepared, hinges);
            read(Row, prepared, hinges, arm, normal, added, parts)
        } else if structure.hinges_alone {
            hinges.resize(n, BodyAt::new());
            poses.write(tree, prepared, hinges);
            read(tree, prepared, hinges, arm, normal, added, parts)
        } else {
            joints.resize(n, BodyAt::new());
            poses.write(tree, prepared, joints);
            read(tree, prepared, joints, arm, normal, added, parts)
        };
        visit.visit(response);
        let PointResponse { position, delassus, mobility, .. } = response;
        (memory.position, memory.delassus, memory.mobility) = (position, delassus, mobility);
    }
}

impl<A: Algebra> ResponseMemory<A> {
    /// The results of the last evaluation.
    #[inline(always)]
    pub fn response(&self) -> PointResponse<'_, A> {
        let &Self { position, delassus, mobility, size: n, .. } = self;
        let Self { vectors, numbers, .. } = self;
        let m = if numbers.len() > 2 * n { n * n } else { 0 };
        PointResponse {
            position,
            delassus,
            mobility,
            jacobian: &vectors[..n],
            response: &vectors[n..2 * n],
            reduced_jacobian: &vectors[2 * n..3 * n],
            inverse_d: &numbers[..n],
            levers: &numbers[n..2 * n],
            mass_matrix: &numbers[2 * n..2 * n + m],
        }
    }

    /// Zeros for n coordinates, with a factor as for [`Self::grow`].
    fn clear(&mut self, n: usize, row: usize) {
        self.grow(n, row);
        self.fill();
        self.zeros_of = None;
        (self.position, self.delassus, self.mobility) = (A::zero(), [A::zero(); 3], A::Scalar::zero());
    }

    /// Memory for n coordinates, with a factor of rows of the length given; 0 without M and its factor.
    #[inline(always)]
    fn grow(&mut self, n: usize, row: usize) {
        let numbers = if row == 0 { 2 * n } else { n * (2 + n + row) };
        if self.size != n || self.numbers.len() != numbers {
            self.size = n;
            self.zeros_of = None;
            self.vectors.resize(4 * n, A::zero());
            self.numbers.resize(numbers, A::Scalar::zero());
        }
    }

    fn fill(&mut self) {
        self.vectors.fill(A::zero());
        self.numbers.fill(A::Scalar::zero());
    }

    /// The parts of the memory.
    #[inline(always)]
    #[allow(clippy::type_complexity)]
    fn parts(&mut self, n: usize) -> (&mut Vec<BodyAt<A, Hinge<A>>>, &mut Vec<BodyAt<A, Axis<A>>>, Memory<'_, A>) {
        let Self { vectors, numbers, hinges, joints, .. } = self;
        let (jacobian, rest) = vectors.split_at_mut(n);
        let (response, rest) = rest.split_at_mut(n);
        let (reduced_jacobian, by_depth) = rest.split_at_mut(n);
        let (inverse_d, rest) = numbers.split_at_mut(n);
        let (levers, rest) = rest.split_at_mut(n);
        let (mass_matrix, factor) = rest.split_at_mut(if rest.is_empty() { 0 } else { n * n });
        let memory = Memory { factor, by_depth, jacobian, mass_matrix, reduced_jacobian, inverse_d, levers, response };
        (hinges, joints, memory)
    }

    /// Writes zeros into the entries that the pass does not write, unless they are already there.
    #[inline(always)]
    fn put_zeros(&mut self, structure: &Arc<Structure>, body: usize) {
        if !self.zeros_of.as_ref().is_some_and(|(other, there)| *there == body && Arc::ptr_eq(other, structure)) {
            // J, X, Y, 1/D, levers and M; every entry of the factor that is read is written first.
            self.vectors.fill(A::zero());
            let results = self.size * (2 + self.size);
            self.numbers[..results].fill(A::Scalar::zero());
            self.zeros_of = Some((structure.clone(), body));
        }
    }

    /// Calls `visit` with the results, and stores those of `V::KEEPS`.
    #[inline(always)]
    fn keep<V: Visit<A>>(&mut self, found: PointResponse<A>, mut visit: V) {
        if V::KEEPS != Kept::Nothing {
            let n = found.jacobian.len();
            self.grow(n, row_length::<A::Scalar>(n));
            self.zeros_of = None;
            let (_, _, memory) = self.parts(n);
            memory.jacobian.copy_from_slice(found.jacobian);
            memory.mass_matrix.copy_from_slice(found.mass_matrix);
            if V::KEEPS == Kept::All {
                memory.reduced_jacobian.copy_from_slice(found.reduced_jacobian);
                memory.inverse_d.copy_from_slice(found.inverse_d);
                memory.levers.copy_from_slice(found.levers);
                memory.response.copy_from_slice(found.response);
            }
            (self.position, self.delassus, self.mobility) = (found.position, found.delassus, found.mobility);
        }
        visit.visit(found);
    }
}
