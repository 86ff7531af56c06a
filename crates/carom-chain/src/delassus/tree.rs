//! A tree of joints of any type or of hinges alone, with the point on any body.
//!
//! Bodies are numbered depth first, so that a segment without branches is a run of consecutive indices, each the parent of
//! the next: within a run no parent is looked up. An impulse moves only the branch from the world that contains its point:
//! with a fixed pelvis, an impulse on the hand does not move the legs, and their diagonal block of M is not factored.

use super::fused::{BodyAt, Shape, Topology};
use crate::algebra::Algebra;
use crate::moves::Moves;
use crate::steps::Step;
use crate::turned::Turned;
use crate::workspace::Link;
use std::marker::PhantomData;
use std::ops::Range;

/// The path from one body to the world.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Way {
    /// Its coordinate.
    coordinate: usize,
    /// Number of its ancestors.
    depth: usize,
    /// The run of bodies that ends with its parent; empty if the parent is the world.
    run: Range<usize>,
    /// The branch from the world that contains it.
    branch: Range<usize>,
}

impl Way {
    /// The paths of all bodies.
    pub fn all<A: Algebra>(steps: &[Step<A>]) -> Vec<Self> {
        let mut ways: Vec<Self> = Vec::with_capacity(steps.len());
        for (i, step) in steps.iter().enumerate() {
            let (depth, run, branch) = match step.parent {
                None => (0, 0..0, i..step.end),
                Some(p) => (ways[p].depth + 1, steps[p].run..p + 1, ways[p].branch.clone()),
            };
            ways.push(Self { coordinate: step.v_index, depth, run, branch });
        }
        ways
    }
}

/// See [`Topology::runs`].
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

/// A tree with a point, for axes of the type X.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tree<'a, A: Algebra, X> {
    steps: &'a [Step<A>],
    ways: &'a [Way],
    point: usize,
    moved: (usize, usize),
    axis: PhantomData<X>,
}

impl<'a, A: Algebra, X> Tree<'a, A, X> {
    #[inline(always)]
    pub fn new(steps: &'a [Step<A>], ways: &'a [Way], point: usize) -> Self {
        let Range { start, end } = ways[point].branch;
        Self { steps: &steps[..ways.len()], ways, point, moved: (start, end), axis: PhantomData }
    }
}

impl<A: Algebra, X: Moves<A>> Topology for Tree<'_, A, X> {
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
}

impl<A: Algebra, X: Moves<A>> Shape<A> for Tree<'_, A, X> {
    type Axis = X;
    #[inline(always)]
    fn place(self, i: usize, outer: Option<A::Rotation>, q: &[A::Scalar], turned: &impl Turned<A>) -> BodyAt<A, X> {
        let step = &self.steps[i];
        let (rotation, offset) = X::place(step, i, outer.unwrap_or_else(A::no_rotation), q, turned);
        BodyAt::at(rotation, offset, X::at_rotation(step, rotation), X::own(step, rotation))
    }
    #[inline(always)]
    fn shifted(self, i: usize, inertia: &X::Inertia, r: A::Vector) -> X::Inertia {
        X::shifted(&self.steps[i], inertia, r)
    }
}

/// A tree whose poses are known.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed<'a, A: Algebra, X> {
    pub tree: Tree<'a, A, X>,
    pub links: &'a [Link<A>],
}

impl<A: Algebra, X: Moves<A>> Topology for Placed<'_, A, X> {
    #[inline(always)]
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>> {
        self.tree.runs(i)
    }
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        self.tree.parent(i)
    }
    #[inline(always)]
    fn depth(self, i: usize) -> usize {
        self.tree.depth(i)
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        self.tree.coordinate(i)
    }
    #[inline(always)]
    fn point(self, n: usize) -> usize {
        self.tree.point(n)
    }
    #[inline(always)]
    fn moved(self, n: usize) -> Range<usize> {
        self.tree.moved(n)
    }
}

impl<A: Algebra, X: Moves<A>> Shape<A> for Placed<'_, A, X> {
    type Axis = X;
    #[inline(always)]
    fn place(self, i: usize, _: Option<A::Rotation>, _: &[A::Scalar], _: &impl Turned<A>) -> BodyAt<A, X> {
        let (step, link) = (&self.tree.steps[i], &self.links[i]);
        BodyAt::at(link.rotation, link.offset, X::of(step, link), X::own(step, link.rotation))
    }
    #[inline(always)]
    fn shifted(self, i: usize, inertia: &X::Inertia, r: A::Vector) -> X::Inertia {
        self.tree.shifted(i, inertia, r)
    }
}

/// A matrix without known zeros, for bodies that share coordinates: entry k of the topology is coordinate k.
#[derive(Debug, Clone, Copy)]
pub(super) struct Full;

impl Topology for Full {
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>> {
        std::iter::once(0..i)
    }
    fn parent(self, i: usize) -> Option<usize> {
        i.checked_sub(1)
    }
    fn depth(self, i: usize) -> usize {
        i
    }
    fn coordinate(self, i: usize) -> usize {
        i
    }
    fn point(self, n: usize) -> usize {
        n - 1
    }
    fn moved(self, n: usize) -> Range<usize> {
        0..n
    }
}
