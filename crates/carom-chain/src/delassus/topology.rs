//! The structure of M: a row of bodies, or a tree with the point on any body.
//!
//! Bodies are numbered depth first, so that a segment without branches is a run of consecutive indices, each the parent of
//! the next: within a run no parent is looked up. An impulse moves only the branch from the world that contains its point:
//! with a fixed pelvis, an impulse on the hand does not move the legs, and their diagonal block of M is not factored.
//!
//! [`Structure`] says which of them a chain is. A row needs no table. `tests/delassus.rs` compares both with the definitions.

use crate::algebra::Algebra;
use crate::prepare::PreparedBody;
use std::ops::Range;

/// The structure of M: which entries of its factor are not zero.
pub(super) trait Topology: Copy {
    /// The ancestors of body `i`, from its parent to the world, as runs of consecutive indices, each to be visited backwards.
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>>;
    fn parent(self, i: usize) -> Option<usize>;
    /// Number of ancestors of body `i`.
    fn depth(self, i: usize) -> usize;
    fn coordinate(self, i: usize) -> usize;
    /// The body that the point is fixed to, in a chain of n bodies.
    fn point(self, n: usize) -> usize;
    /// The bodies that an impulse at the point moves: the branch of the point.
    fn moved(self, n: usize) -> Range<usize>;
}

/// Each body is the child of the one before and has the coordinate of its number; the point is on the last. Also a matrix
/// without known zeros, for bodies that share coordinates: body k is then coordinate k.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row;

impl Topology for Row {
    #[inline(always)]
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>> {
        std::iter::once(0..i)
    }
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        i.checked_sub(1)
    }
    #[inline(always)]
    fn depth(self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn point(self, n: usize) -> usize {
        n - 1
    }
    #[inline(always)]
    fn moved(self, n: usize) -> Range<usize> {
        0..n
    }
}

/// The path from one body to the world.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PathToRoot {
    /// Its coordinate.
    coordinate: usize,
    /// Number of its ancestors.
    depth: usize,
    /// The run of bodies that ends with its parent; empty if the parent is the world.
    run: Range<usize>,
    /// The branch from the world that contains it.
    branch: Range<usize>,
}

impl PathToRoot {
    /// The paths of all bodies.
    pub fn all<A: Algebra>(prepared: &[PreparedBody<A>]) -> Vec<Self> {
        let mut paths: Vec<Self> = Vec::with_capacity(prepared.len());
        for (i, body) in prepared.iter().enumerate() {
            let (depth, run, branch) = match body.parent {
                None => (0, 0..0, i..body.end),
                Some(p) => (paths[p].depth + 1, prepared[p].run..p + 1, paths[p].branch.clone()),
            };
            paths.push(Self { coordinate: body.v_index, depth, run, branch });
        }
        paths
    }
}

/// See [`Topology::runs`].
struct Runs<'a> {
    paths: &'a [PathToRoot],
    /// The body whose path comes next.
    next: usize,
}

impl Iterator for Runs<'_> {
    type Item = Range<usize>;
    #[inline(always)]
    fn next(&mut self) -> Option<Range<usize>> {
        let run = self.paths[self.next].run.clone();
        self.next = run.start;
        (!run.is_empty()).then_some(run)
    }
}

/// A tree with a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tree<'a> {
    paths: &'a [PathToRoot],
    point: usize,
    moved: (usize, usize),
}

impl<'a> Tree<'a> {
    #[inline(always)]
    pub fn new(paths: &'a [PathToRoot], point: usize) -> Self {
        let Range { start, end } = paths[point].branch;
        Self { paths, point, moved: (start, end) }
    }
}

impl Topology for Tree<'_> {
    #[inline(always)]
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>> {
        Runs { paths: self.paths, next: i }
    }
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        self.paths[i].run.end.checked_sub(1)
    }
    #[inline(always)]
    fn depth(self, i: usize) -> usize {
        self.paths[i].depth
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        self.paths[i].coordinate
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

/// The structure of a chain, prepared when it is made.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Structure {
    /// Whether every joint is a hinge with its own coordinate: see [`crate::prepare`].
    pub hinges_alone: bool,
    /// Whether they are a row, one after another in the order of their coordinates.
    pub row: bool,
    /// The longest path along the joints, from the origin of the chain, m.
    pub reach: f64,
    /// By coordinate, the sums of the ratios of the hinges that it turns, and of the joints that it slides.
    pub turns_and_slides: Vec<[f64; 2]>,
    pub(super) paths: Vec<PathToRoot>,
}

impl Structure {
    pub fn of<A: Algebra<Scalar = f64>>(prepared: &[PreparedBody<A>], nv: usize) -> Self {
        // In the plane a ratio of −1 is a hinge whose axis is opposite to the plane's normal.
        let hinge = |body: &PreparedBody<A>| A::turns(body.joint) && (body.ratio == 1.0 || A::ANGULAR == 1);
        let hinges_alone = prepared.len() == nv && prepared.iter().all(hinge);
        let follows = |(i, body): (usize, &PreparedBody<A>)| {
            (body.parent, body.v_index, body.q_index) == (i.checked_sub(1), i, i)
        };
        let row = hinges_alone && !prepared.is_empty() && prepared.iter().enumerate().all(follows);
        let mut turns_and_slides = vec![[0.0; 2]; nv];
        let mut paths = Vec::with_capacity(prepared.len());
        for body in prepared {
            turns_and_slides[body.v_index][usize::from(!A::turns(body.joint))] += body.ratio.abs();
            let length = A::dot(body.translation, body.translation).sqrt();
            paths.push(length + body.parent.map_or(0.0, |parent| paths[parent]));
        }
        let reach = paths.into_iter().fold(0.0, f64::max);
        Self { hinges_alone, row, reach, turns_and_slides, paths: PathToRoot::all(prepared) }
    }
}
