//! A tree of joints of any type or of hinges alone, with the point on any body.
//!
//! Bodies are numbered depth first, so that a segment without branches is a run of consecutive indices, each the parent of
//! the next: within a run no parent is looked up. An impulse moves only the branch from the world that contains its point:
//! with a fixed pelvis, an impulse on the hand does not move the legs, and their diagonal block of M is not factored.

use super::kernel::{Link, Shape};
use crate::algebra::Algebra;
use crate::moves::Moves;
use crate::steps::Step;
use crate::turned::Turned;
use std::marker::PhantomData;
use std::ops::Range;

/// The path from each body to the world, and the body of the point.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Limbs {
    ways: Vec<Way>,
    point: usize,
    moved: Range<usize>,
}

/// The path from one body to the world.
#[derive(Debug, Clone, PartialEq)]
struct Way {
    /// Its coordinate.
    coordinate: usize,
    /// Number of its ancestors.
    depth: usize,
    /// The run of bodies that ends with its parent; empty if the parent is the world.
    run: Range<usize>,
}

impl Limbs {
    /// The paths of a tree with the point on the body `point`.
    pub fn of<A: Algebra>(steps: &[Step<A>], point: usize) -> Self {
        let mut ways: Vec<Way> = Vec::with_capacity(steps.len());
        for step in steps {
            let (depth, run) = match step.parent {
                None => (0, 0..0),
                Some(p) => (ways[p].depth + 1, steps[p].run..p + 1),
            };
            ways.push(Way { coordinate: step.v_index, depth, run });
        }
        let root = std::iter::successors(Some(point), |&i| steps[i].parent).last().unwrap_or(point);
        Self { ways, point, moved: root..steps[root].end }
    }

    /// The tree in the form that the kernel uses.
    #[inline(always)]
    pub fn tree<'a, A: Algebra, X>(&'a self, steps: &'a [Step<A>]) -> Tree<'a, A, X> {
        let Range { start, end } = self.moved;
        let steps = &steps[..self.ways.len()];
        Tree { steps, ways: &self.ways, point: self.point, moved: (start, end), axis: PhantomData }
    }
}

/// See [`Shape::runs`].
struct Runs<'a> {
    ways: &'a [Way],
    /// The body whose path comes next.
    next: usize,
}

impl Iterator for Runs<'_> {
    type Item = Range<usize>;
    #[inline(always)]
    fn next(&mut self) -> Option<Range<usize>> {
        let run = self.ways[self.next].run.clone();
        self.next = run.start;
        (!run.is_empty()).then_some(run)
    }
}

/// A tree in the form that the kernel uses: a copy of the fields of [`Limbs`], so that loops do not load them repeatedly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tree<'a, A: Algebra, X> {
    steps: &'a [Step<A>],
    ways: &'a [Way],
    point: usize,
    moved: (usize, usize),
    axis: PhantomData<X>,
}

impl<A: Algebra, X: Moves<A>> Shape<A> for Tree<'_, A, X> {
    type Axis = X;
    #[inline(always)]
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>> {
        Runs { ways: self.ways, next: i }
    }
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        self.ways[i].run.end.checked_sub(1)
    }
    #[inline(always)]
    fn depth(self, i: usize) -> usize {
        self.ways[i].depth
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        self.ways[i].coordinate
    }
    #[inline(always)]
    fn point(self, _: usize) -> usize {
        self.point
    }
    #[inline(always)]
    fn moved(self, _: usize) -> Range<usize> {
        self.moved.0..self.moved.1
    }
    #[inline(always)]
    fn place(self, i: usize, outer: Option<A::Rotation>, q: &[A::Scalar], turned: &impl Turned<A>) -> Link<A, X> {
        let step = &self.steps[i];
        let (rotation, offset) = X::place(step, i, outer.unwrap_or_else(A::no_rotation), q, turned);
        Link::at(rotation, offset, X::at_rotation(step, rotation), X::own(step, rotation))
    }
    #[inline(always)]
    fn shifted(self, i: usize, inertia: &X::Inertia, r: A::Vector) -> X::Inertia {
        X::shifted(&self.steps[i], inertia, r)
    }
}
