//! Joints of any type in a tree, the point on any body.
//!
//! Bodies are numbered depth first, so that a limb is a run of numbers, each the parent of the next: on the way down a run no
//! parent is looked up. An impulse moves what hangs from the world where its point does: a fixed pelvis keeps the legs out
//! of a blow on the hand, and their part of M, a block of its own, is not factored.

use super::kernel::{Link, Moves, Shape};
use super::{Angle, Turned};
use crate::algebra::{Algebra, Axis, Force, Inertia};
use crate::steps::Step;
use std::ops::Range;

/// The way down from each body, and where the point is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Limbs {
    ways: Vec<Way>,
    point: usize,
    moved: Range<usize>,
}

/// The way down from one body.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Way {
    /// Its coordinate.
    coordinate: usize,
    /// The first body of its run.
    first: usize,
    /// The parent of that.
    below: Option<usize>,
}

impl Limbs {
    /// Of a tree with the point on the body `point`.
    pub fn of<A: Algebra>(steps: &[Step<A>], point: usize) -> Self {
        let mut ways: Vec<Way> = Vec::with_capacity(steps.len());
        for (i, step) in steps.iter().enumerate() {
            ways.push(match step.parent {
                Some(p) if p + 1 == i => Way { coordinate: step.v_index, ..ways[p] },
                below => Way { coordinate: step.v_index, first: i, below },
            });
        }
        let root = std::iter::successors(Some(point), |&i| steps[i].parent).last().unwrap_or(point);
        Self { ways, point, moved: root..steps[root].end }
    }

    /// The bodies that carry body `i`, from its parent down.
    #[inline(always)]
    fn below(&self, i: usize) -> Below<'_> {
        let Way { first, below, .. } = self.ways[i];
        Below { ways: &self.ways, first, next: i, below }
    }
}

/// See [`Limbs::below`].
struct Below<'a> {
    ways: &'a [Way],
    /// Of the run where it is.
    first: usize,
    below: Option<usize>,
    /// The body above the next, if that is in this run.
    next: usize,
}

impl Iterator for Below<'_> {
    type Item = usize;
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.next > self.first {
            self.next -= 1;
        } else {
            self.next = self.below?;
            Way { first: self.first, below: self.below, .. } = self.ways[self.next];
        }
        Some(self.next)
    }
}

/// A tree as the kernel walks it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tree<'a, A: Algebra> {
    pub steps: &'a [Step<A>],
    pub limbs: &'a Limbs,
}

impl<A: Algebra> Step<A> {
    /// The angle of its hinge.
    pub(super) fn angle(&self) -> Angle<A::Scalar> {
        Angle { coordinate: self.q_index, sense: self.ratio, shift: self.shift }
    }
}

impl<A: Algebra> Shape<A> for Tree<'_, A> {
    type Axis = Axis<A>;
    #[inline(always)]
    fn below(self, i: usize) -> impl Iterator<Item = usize> {
        self.limbs.below(i)
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        self.limbs.ways[i].coordinate
    }
    #[inline(always)]
    fn point(self, _: usize) -> usize {
        self.limbs.point
    }
    #[inline(always)]
    fn moved(self, _: usize) -> Range<usize> {
        self.limbs.moved.clone()
    }
    #[inline(always)]
    fn place(self, i: usize, outer: Option<A::Rotation>, q: &[A::Scalar], turned: &impl Turned<A>) -> Link<A, Axis<A>> {
        let step = &self.steps[i];
        let outer = outer.unwrap_or_else(A::no_rotation);
        let (placed, offset) = (step.placing.placed(outer), A::rotate(outer, step.translation));
        let (rotation, offset) = if A::turns(step.joint) {
            let (sin, cos) = turned.sin_cos(i, step.angle());
            (A::turn(placed, sin, cos), offset)
        } else {
            let (rotation, moved) = A::move_joint(step.joint, placed, step.ratio, step.shift, &q[step.q_index..]);
            (rotation, offset + moved)
        };
        let axis = A::axis(step.joint, rotation).scaled(step.ratio);
        Link::at(rotation, offset, axis, step.turned_inertia(rotation))
    }
    #[inline(always)]
    fn shifted(self, i: usize, inertia: &Inertia<A>, r: A::Vector) -> Inertia<A> {
        if self.steps[i].massless { inertia.shifted_massless(r) } else { inertia.shifted(r) }
    }
}

impl<A: Algebra> Moves<A> for Axis<A> {
    type Inertia = Inertia<A>;
    #[inline(always)]
    fn still() -> Self {
        Self::Turn(A::zero_angular())
    }
    #[inline(always)]
    fn nothing() -> Inertia<A> {
        Inertia::zero()
    }
    #[inline(always)]
    fn momentum(self, inertia: &Inertia<A>) -> Force<A> {
        inertia.along(self)
    }
    #[inline(always)]
    fn share(self, force: Force<A>) -> A::Scalar {
        self.dot(force)
    }
    #[inline(always)]
    fn at(self, r: A::Vector) -> A::Vector {
        self.point_velocity(r)
    }
}
