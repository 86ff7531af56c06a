//! What a [`Workspace`](crate::Workspace) holds for each body: its pose, its motion, and its articulated inertia.

use crate::algebra::{Algebra, Articulated, Axis, Force, Inertia, Motion};
use num_traits::Zero;

/// Position and orientation of a body and its joint axis, in world axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link<A: Algebra> {
    pub rotation: A::Rotation,
    pub offset: A::Vector,
    pub position: A::Vector,
    pub axis: Axis<A>,
}

impl<A: Algebra> Link<A> {
    /// The world.
    pub fn world() -> Self {
        let axis = Axis::Turn(A::zero_angular());
        Self { rotation: A::no_rotation(), offset: A::zero(), position: A::zero(), axis }
    }
}

/// Motion of a body: ω, ω̇, and the acceleration of the body's origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flow<A: Algebra> {
    pub spin: A::Angular,
    pub spin_rate: A::Angular,
    pub acceleration: A::Vector,
}

impl<A: Algebra> Flow<A> {
    /// A base at rest, in a frame that accelerates.
    #[inline(always)]
    pub fn base(acceleration: A::Vector) -> Self {
        Self { spin: A::zero_angular(), spin_rate: A::zero_angular(), acceleration }
    }
}

/// Results of the recursion for one body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Free<A: Algebra> {
    pub articulated: A::Articulated,
    pub transmitted: Force<A>,
    pub inverse_d: A::Scalar,
    pub drive: A::Scalar,
    pub acceleration: Motion<A>,
}

impl<A: Algebra> Free<A> {
    pub fn zero() -> Self {
        let zero = A::Scalar::zero();
        let articulated = A::Articulated::from_rigid(&Inertia::zero());
        let (transmitted, acceleration) = (Force::zero(), Motion::zero());
        Self { articulated, transmitted, inverse_d: zero, drive: zero, acceleration }
    }
}
