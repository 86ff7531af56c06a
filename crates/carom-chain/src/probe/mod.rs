//! Position, J, M, H and the response to a unit impulse of one point of a chain, computed together in one pass.
//!
//! [`crate::Kinematics`] computes each of these quantities separately; the probe shares their intermediate results. M is
//! computed once and factored in place, `M = Lᵀ D L`, which keeps the zeros of a tree. With `Y = L⁻ᵀ Jᵀ`, whose rows are zero
//! for bodies not between the point and the world, `H = Yᵀ D⁻¹ Y` and `M⁻¹Jᵀn = L⁻¹ D⁻¹ Y n`. There are no square roots,
//! and one division per joint.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J | 3×nv, 2×nv | velocity of the point for unit joint rates, world axes | `jacobian` |
//! | M | nv×nv | mass matrix | `mass_matrix` |
//! | L, D | nv×nv | unit lower triangle and diagonal: M = Lᵀ D L; stored as rows of D L, without the zeros | `factor` |
//! | yₖ | 3, 2 | row k of Y: unit forces at the point, projected on joint k after the joints beyond it are eliminated | `felt` |
//! | H | 3×3, 2×2 | Delassus matrix J M⁻¹ Jᵀ, world axes, 1/kg | `delassus` |
//! | Jᵀn | nv | joint impulse of a unit impulse along n | `joint_impulse` |
//! | M⁻¹Jᵀn | nv | joint velocities after a unit impulse along n | `response` |
//! | nᵀHn | 1 | velocity of the point along n after a unit impulse along n, 1/kg | `mobility` |
//!
//! **Shapes.** The kernel (`kernel.rs`) is generic over the shape of the chain, which is determined once, when the probe is
//! made. A row of hinges (`row.rs`) needs no branches on joint types and parents, and its configuration-independent
//! quantities are precomputed; rows of two and three hinges have unrolled kernels. Any other chain is a tree (`tree.rs`): of
//! hinges alone, so that the joint type is known statically, or of any joints. `book/src/benchmarks.md` gives the gain in speed of
//! each; `tests/probe.rs` compares all of them with [`crate::Kinematics`].
//!
//! **SIMD lanes.** Code that runs in lanes must be inlined, because it is otherwise compiled without AVX instructions. The
//! kernel and the algebra that it calls therefore use no closures, and the kernel uses no operators of nalgebra.
//!
//! Source: Featherstone (2008), tables 6.2 (CRBA), 6.3 (LTDL) and 6.4, in world axes (see [`crate::algebra`]).

mod kernel;
mod row;
mod tree;

use crate::algebra::{Algebra, Axis, Real};
use crate::chain::{Chain, Point};
use crate::error::ChainError;
use crate::moves::Hinge;
use crate::sine::{sin_cos, sin_cos_by_pairs, sin_cos_of_two};
use crate::turned::{Angle, ByBody, Turned};
use kernel::{Link, Memory, read, read_three, read_two, row_length};
use nalgebra::convert;
use num_traits::Zero;
use row::HingeRow;
use std::sync::Arc;
use tree::Limbs;

/// One point of a chain, prepared for evaluation at many configurations. Immutable; can be shared by reference.
#[derive(Debug, Clone)]
pub struct Probe<A: Algebra> {
    chain: Chain<A>,
    arm: A::Vector,
    shape: Shape<A>,
    angles: Vec<(usize, Angle<A::Scalar>)>,
}

/// Shape of the chain.
#[derive(Debug, Clone)]
enum Shape<A: Algebra> {
    /// Two or three hinges in a row: unrolled kernels.
    Few(Few<A>),
    /// Any other chain: the kernel with loops.
    Many(Many<A>),
}

#[derive(Debug, Clone)]
enum Few<A: Algebra> {
    Two(HingeRow<A>),
    Three(HingeRow<A>),
}

#[derive(Debug, Clone)]
enum Many<A: Algebra> {
    Row(HingeRow<A>),
    /// A tree of hinges alone.
    Hinges(Arc<Limbs>),
    /// A tree of any joints.
    Tree(Arc<Limbs>),
}

/// Memory for the results of a probe, and its scratch memory.
#[derive(Debug, Clone)]
pub struct Reading<A: Algebra> {
    position: A::Vector,
    jacobian: Vec<A::Vector>,
    mass_matrix: Vec<A::Scalar>,
    delassus: [A::Vector; 3],
    joint_impulse: Vec<A::Scalar>,
    response: Vec<A::Scalar>,
    mobility: A::Scalar,
    /// Angle of each body's joint, rad; used for hinges only.
    angles: Vec<A::Scalar>,
    sines: Vec<A::Scalar>,
    cosines: Vec<A::Scalar>,
    factor: Vec<A::Scalar>,
    by_depth: Vec<A::Scalar>,
    hinges: Vec<Link<A, Hinge<A>>>,
    joints: Vec<Link<A, Axis<A>>>,
    /// The tree whose zeros are in place: those entries of M between branches and of J off the path to the point that its
    /// kernel does not write.
    zeros_of: Option<Arc<Limbs>>,
}

/// The results of a probe at one configuration.
#[derive(Debug, Clone, Copy)]
pub struct Found<'a, A: Algebra> {
    /// World position of the point, m.
    pub position: A::Vector,
    /// The nv columns of the Jacobian: velocity of the point at unit joint rate, world axes.
    pub jacobian: &'a [A::Vector],
    /// The mass matrix, all nv×nv entries; kg m², kg m, kg.
    pub mass_matrix: &'a [A::Scalar],
    /// Columns of the Delassus matrix J M⁻¹ Jᵀ, world axes, 1/kg; in the plane the third is zero.
    pub delassus: [A::Vector; 3],
    /// Jᵀn: the joint impulse of a unit impulse along the normal.
    pub joint_impulse: &'a [A::Scalar],
    /// M⁻¹Jᵀn: the joint velocities after a unit impulse along the normal on the chain at rest.
    pub response: &'a [A::Scalar],
    /// nᵀHn: the velocity of the point along the normal after that impulse, 1/kg.
    pub mobility: A::Scalar,
}

/// A function of the results of a probe, called while they are in registers. It is a trait because inlining of a closure
/// cannot be forced.
pub trait Finish<A: Algebra> {
    /// Whether the results are also stored in the [`Reading`]. If `false`, the contents of the reading are unspecified.
    const KEEPS: bool;
    /// Called once with the results.
    fn finish(&mut self, found: Found<A>);
}

impl<A: Algebra<Scalar = f64>> Chain<A> {
    /// Prepares a point for evaluation at many configurations.
    ///
    /// # Errors
    /// [`ChainError::Coupled`] for a chain with mimic joints; [`ChainError::FixedPoint`] for a point of the world.
    pub fn probe(&self, point: Point<A>) -> Result<Probe<A>, ChainError> {
        if self.is_coupled() {
            return Err(ChainError::Coupled { chain: self.name().into() });
        }
        let body = point.body.ok_or_else(|| ChainError::FixedPoint { chain: self.name().into() })?;
        let row = if body + 1 == self.bodies.len() { HingeRow::of(self) } else { None };
        let angles = match &row {
            Some(row) => row.bodies.iter().enumerate().map(|(i, b)| (i, b.angle(i))).collect(),
            None => {
                let hinges = self.steps.iter().enumerate().filter(|(_, step)| A::turns(step.joint));
                hinges.map(|(i, step)| (i, step.angle())).collect()
            }
        };
        let shape = match (row, self.bodies.len()) {
            (Some(row), 2) => Shape::Few(Few::Two(row)),
            (Some(row), 3) => Shape::Few(Few::Three(row)),
            (Some(row), _) => Shape::Many(Many::Row(row)),
            (None, _) => {
                let limbs = Arc::new(Limbs::of(&self.steps, body));
                Shape::Many(if self.hinges_alone { Many::Hinges(limbs) } else { Many::Tree(limbs) })
            }
        };
        Ok(Probe { chain: self.clone(), arm: point.position, shape, angles })
    }
}

impl<A: Algebra<Scalar = f64>> Probe<A> {
    /// The same probe over another scalar. Each lane of a SIMD scalar gives the same digits as the scalar alone, for the same
    /// sines and cosines.
    pub fn cast<U: Real>(&self) -> Probe<A::Cast<U>> {
        let shape = match &self.shape {
            Shape::Few(Few::Two(row)) => Shape::Few(Few::Two(row.cast())),
            Shape::Few(Few::Three(row)) => Shape::Few(Few::Three(row.cast())),
            Shape::Many(Many::Row(row)) => Shape::Many(Many::Row(row.cast())),
            Shape::Many(Many::Hinges(limbs)) => Shape::Many(Many::Hinges(limbs.clone())),
            Shape::Many(Many::Tree(limbs)) => Shape::Many(Many::Tree(limbs.clone())),
        };
        let angle = |&(i, Angle { coordinate, sense, shift }): &(usize, Angle<f64>)| {
            (i, Angle { coordinate, sense: convert(sense), shift: convert(shift) })
        };
        let angles = self.angles.iter().map(angle).collect();
        Probe { chain: self.chain.cast(), arm: A::cast_vector(self.arm), shape, angles }
    }

    /// Computes all results at `q` (length nq; rad, m, quaternion) for the unit normal n in world axes. Does not allocate.
    ///
    /// The numbers are not checked; use [`Chain::check_state`] for that. A singular M gives infinite results.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    ///
    /// # Panics
    /// May panic if the reading was made by a probe of another chain.
    pub fn read_into(&self, q: &[f64], normal: A::Vector, reading: &mut Reading<A>) -> Result<(), ChainError> {
        self.read_and(q, normal, reading, Keep)
    }

    /// As [`Self::read_into`], and calls `finish` with the results.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    ///
    /// # Panics
    /// May panic if the reading was made by a probe of another chain.
    #[inline(always)]
    pub fn read_and(
        &self,
        q: &[f64],
        normal: A::Vector,
        reading: &mut Reading<A>,
        finish: impl Finish<A>,
    ) -> Result<(), ChainError> {
        self.check(q, reading)?;
        match &self.shape {
            // All sines first: computed body by body, each would delay the next body.
            Shape::Few(few) => match few {
                Few::Two(row) => {
                    let [a, b] = [0, 1].map(|i| row.bodies[i].angle(i).at(q));
                    let (sines, cosines) = sin_cos_of_two(a, b);
                    let turned = ByBody { sines: &sines, cosines: &cosines };
                    reading.keep(read_two(row, self.arm, &turned, normal).found(), finish)
                }
                Few::Three(row) => {
                    let [a, b, c] = [0, 1, 2].map(|i| sin_cos(row.bodies[i].angle(i).at(q)));
                    let turned = ByBody { sines: &[a.0, b.0, c.0], cosines: &[a.1, b.1, c.1] };
                    reading.keep(read_three(row, self.arm, &turned, normal).found(), finish)
                }
            },
            Shape::Many(many) => {
                for (i, angle) in &self.angles {
                    reading.angles[*i] = angle.at(q);
                }
                let (mut sines, mut cosines) =
                    (std::mem::take(&mut reading.sines), std::mem::take(&mut reading.cosines));
                sin_cos_by_pairs(&reading.angles, &mut sines, &mut cosines);
                let turned = ByBody { sines: &sines, cosines: &cosines };
                many.read(self, q, &turned, normal, reading, finish);
                (reading.sines, reading.cosines) = (sines, cosines);
            }
        }
        Ok(())
    }
}

impl<A: Algebra> Probe<A> {
    /// The chain.
    pub fn chain(&self) -> &Chain<A> {
        &self.chain
    }

    /// Checks the length of a vector of joint velocities.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`] unless `length` is nv.
    pub fn check_velocities(&self, length: usize) -> Result<(), ChainError> {
        self.chain.check_nv("qd", length)
    }

    /// The hinges whose sines and cosines [`Self::read_turned`] needs: index of the body, and angle.
    pub fn angles(&self) -> &[(usize, Angle<A::Scalar>)] {
        &self.angles
    }

    /// Memory for the results of this probe. This call allocates; reading into it does not.
    pub fn reading(&self) -> Reading<A> {
        let n = self.chain.nv;
        let (hinges, joints) = if matches!(self.shape, Shape::Many(Many::Tree(_))) { (0, n) } else { (n, 0) };
        let zero = A::Scalar::zero();
        Reading {
            position: A::zero(),
            jacobian: vec![A::zero(); n],
            mass_matrix: vec![zero; n * n],
            delassus: [A::zero(); 3],
            joint_impulse: vec![zero; n],
            response: vec![zero; n],
            mobility: zero,
            angles: vec![zero; n],
            sines: vec![zero; n],
            cosines: vec![zero; n],
            factor: vec![zero; n * row_length::<A::Scalar>(n)],
            by_depth: vec![zero; n],
            hinges: vec![Link::new(); hinges],
            joints: vec![Link::new(); joints],
            zeros_of: None,
        }
    }

    /// As [`Self::read_and`], with the sines and cosines of the hinges' angles given. Does not allocate.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    ///
    /// # Panics
    /// May panic if the reading was made by a probe of another chain.
    #[inline(always)]
    pub fn read_turned<F: Finish<A>>(
        &self,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
        normal: A::Vector,
        reading: &mut Reading<A>,
        finish: F,
    ) -> Result<(), ChainError> {
        self.check(q, reading)?;
        match &self.shape {
            Shape::Few(few) => few.read(self.arm, turned, normal, reading, finish),
            Shape::Many(many) => many.read(self, q, turned, normal, reading, finish),
        }
        Ok(())
    }

    #[inline(always)]
    fn check(&self, q: &[A::Scalar], reading: &Reading<A>) -> Result<(), ChainError> {
        assert_eq!(
            reading.joint_impulse.len(),
            self.chain.nv,
            "this reading belongs to another chain: make one with Probe::reading"
        );
        self.chain.check_nq(q.len())
    }
}

impl<A: Algebra> Few<A> {
    #[inline(always)]
    fn read<F: Finish<A>>(
        &self,
        arm: A::Vector,
        turned: &impl Turned<A>,
        normal: A::Vector,
        reading: &mut Reading<A>,
        finish: F,
    ) {
        match self {
            Self::Two(row) => reading.keep(read_two(row, arm, turned, normal).found(), finish),
            Self::Three(row) => reading.keep(read_three(row, arm, turned, normal).found(), finish),
        }
    }
}

impl<A: Algebra> Many<A> {
    #[inline(always)]
    fn read<F: Finish<A>>(
        &self,
        probe: &Probe<A>,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
        normal: A::Vector,
        reading: &mut Reading<A>,
        mut finish: F,
    ) {
        let (n, arm) = (probe.chain.bodies.len(), probe.arm);
        let steps = &probe.chain.steps;
        match self {
            Self::Row(_) => reading.zeros_of = None,
            Self::Hinges(limbs) | Self::Tree(limbs) => reading.put_zeros(limbs),
        }
        let Reading { jacobian, mass_matrix, joint_impulse, response, factor, by_depth, hinges, joints, .. } = reading;
        let found = match self {
            Self::Row(row) => {
                let memory = Memory { links: hinges, factor, by_depth, jacobian, mass_matrix, joint_impulse, response };
                read(row, n, arm, q, turned, normal, memory)
            }
            Self::Hinges(limbs) => {
                let memory = Memory { links: hinges, factor, by_depth, jacobian, mass_matrix, joint_impulse, response };
                read(limbs.tree::<_, Hinge<A>>(steps), n, arm, q, turned, normal, memory)
            }
            Self::Tree(limbs) => {
                let memory = Memory { links: joints, factor, by_depth, jacobian, mass_matrix, joint_impulse, response };
                read(limbs.tree::<_, Axis<A>>(steps), n, arm, q, turned, normal, memory)
            }
        };
        finish.finish(found);
        let Found { position, delassus, mobility, .. } = found;
        (reading.position, reading.delassus, reading.mobility) = (position, delassus, mobility);
    }
}

impl<A: Algebra> Reading<A> {
    /// The results of the last evaluation; zeros before the first.
    pub fn found(&self) -> Found<'_, A> {
        let &Self { position, delassus, mobility, .. } = self;
        let Self { jacobian, mass_matrix, joint_impulse, response, .. } = self;
        Found { position, jacobian, mass_matrix, delassus, joint_impulse, response, mobility }
    }

    /// Writes zeros into the entries that the kernel of this tree does not write, unless they are already there.
    #[inline(always)]
    fn put_zeros(&mut self, limbs: &Arc<Limbs>) {
        if !self.zeros_of.as_ref().is_some_and(|other| Arc::ptr_eq(other, limbs)) {
            self.mass_matrix.fill(A::Scalar::zero());
            self.jacobian.fill(A::zero());
            self.joint_impulse.fill(A::Scalar::zero());
            self.response.fill(A::Scalar::zero());
            self.zeros_of = Some(limbs.clone());
        }
    }

    /// Calls `finish` with the results, and stores them if `F::KEEPS`.
    #[inline(always)]
    fn keep<F: Finish<A>>(&mut self, found: Found<A>, mut finish: F) {
        if F::KEEPS {
            self.zeros_of = None;
            self.jacobian.copy_from_slice(found.jacobian);
            self.mass_matrix.copy_from_slice(found.mass_matrix);
            self.joint_impulse.copy_from_slice(found.joint_impulse);
            self.response.copy_from_slice(found.response);
            (self.position, self.delassus, self.mobility) = (found.position, found.delassus, found.mobility);
        }
        finish.finish(found);
    }
}

/// Stores the results in the reading and does nothing else.
struct Keep;

impl<A: Algebra> Finish<A> for Keep {
    const KEEPS: bool = true;
    #[inline(always)]
    fn finish(&mut self, _: Found<A>) {}
}
