//! Bodies and joints prepared for the recursions: quantities that do not depend on the configuration are precomputed, once
//! for all recursions.
//!
//! | file | what |
//! | --- | --- |
//! | `axes.rs` | axes of the bodies in which the placement of a hinge is a tilt |
//! | `base_parameters.rs` | inertias without the parts that the parent body can take |
//! | `angle.rs` | angles of hinges, and the source of their sines and cosines |
//! | `subspace.rs` | the motion subspace of a joint, for any joints or for hinges alone |

mod angle;
mod axes;
mod base_parameters;
mod subspace;

pub(crate) use angle::ByBody;
pub use angle::{Angle, HingeAngles};
pub(crate) use subspace::{Hinge, Subspace};

use crate::algebra::{Algebra, Inertia, Real};
use crate::body::{Body, Frame};
use axes::{Placing, align};
use base_parameters::base_parameters;
use nalgebra::convert;
use std::ops::AddAssign;

/// One body and its parent joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PreparedBody<A: Algebra> {
    pub joint: A::Joint,
    pub placing: Placing<A>,
    /// Position of the joint's origin in the parent body, parent axes, m.
    pub translation: A::Vector,
    /// Joint position = `ratio` · q + `shift`.
    pub ratio: A::Scalar,
    /// See `ratio`.
    pub shift: A::Scalar,
    /// Inertia of the rotor that turns with the joint, beside that of the bodies.
    pub rotor: A::Scalar,
    /// Base inertial parameters: see [`base_parameters`].
    pub inertia: Inertia<A>,
    pub parent: Option<usize>,
    pub q_index: usize,
    pub v_index: usize,
    /// First body of the run that ends with this one: consecutive bodies, each the parent of the next.
    pub run: usize,
    /// End of its subtree, which is the range from this body to `end`, because bodies are numbered depth first.
    pub end: usize,
    /// Whether it has more than one child.
    pub branches: bool,
    /// Where an inward pass stores its contribution to its parent.
    pub parent_slot: ParentSlot,
    /// Whether no base inertial parameters of its subtree have mass.
    pub massless: bool,
}

/// Where an inward pass stores the contribution of a body to its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ParentSlot {
    /// Nowhere: the parent is the world, and there is nothing to accumulate.
    World,
    /// Nowhere: the parent is the previous body, and the contribution is kept in registers.
    Previous,
    /// In the entry of this parent, which it overwrites: the body is the parent's last child, the first to be visited.
    Last(usize),
    /// In the entry of this parent, to which it is added.
    Between(usize),
}

impl ParentSlot {
    /// Stores the contribution of a body in its parent's entry.
    #[inline(always)]
    pub fn keep<X: Copy + AddAssign>(self, places: &mut [X], x: X) {
        match self {
            Self::World | Self::Previous => {}
            Self::Last(p) => places[p] = x,
            Self::Between(p) => places[p] += x,
        }
    }

    /// Adds the contribution of a body to its parent's entry, which already holds the parent's own part.
    #[inline(always)]
    pub fn add<X: Copy + AddAssign>(self, places: &mut [X], x: X) {
        match self {
            Self::World | Self::Previous => {}
            Self::Last(p) | Self::Between(p) => places[p] += x,
        }
    }
}

impl<A: Algebra<Scalar = f64>> PreparedBody<A> {
    /// All bodies of a tree with their joints; its bodies and frames are expressed in new axes: see [`align`].
    pub fn of(bodies: &mut [Body<A>], frames: &mut [Frame<A>]) -> Vec<Self> {
        let placings = align(bodies, frames);
        let placed = placings.into_iter().zip(base_parameters(bodies));
        let mut prepared: Vec<Self> = Vec::with_capacity(bodies.len());
        for (i, (body, ((placing, shift), inertia))) in bodies.iter().zip(placed).enumerate() {
            let Body { parent, joint, placement, q_index, v_index, ratio, rotor, .. } = *body;
            prepared.push(Self {
                joint,
                placing,
                translation: placement.translation,
                ratio,
                shift: body.shift + shift,
                rotor,
                inertia,
                parent,
                q_index,
                v_index,
                run: if i > 0 && parent == Some(i - 1) { prepared[i - 1].run } else { i },
                end: i + 1,
                branches: false,
                parent_slot: ParentSlot::World,
                massless: A::turns(joint),
            });
        }
        for i in (0..prepared.len()).rev() {
            let Self { parent: Some(p), end, massless, .. } = prepared[i] else { continue };
            prepared[i].parent_slot = match prepared[p].branches {
                _ if p + 1 == i => ParentSlot::Previous,
                true => ParentSlot::Between(p),
                false => ParentSlot::Last(p),
            };
            let below = &mut prepared[p];
            below.end = below.end.max(end);
            below.massless &= massless;
            below.branches |= p + 1 < i;
        }
        prepared
    }

    /// The same over another scalar.
    pub fn cast<U: Real>(&self) -> PreparedBody<A::Cast<U>> {
        PreparedBody {
            joint: self.joint,
            placing: self.placing.cast(),
            translation: A::cast_vector(self.translation),
            ratio: convert(self.ratio),
            shift: convert(self.shift),
            rotor: convert(self.rotor),
            inertia: self.inertia.cast(),
            parent: self.parent,
            q_index: self.q_index,
            v_index: self.v_index,
            run: self.run,
            end: self.end,
            branches: self.branches,
            parent_slot: self.parent_slot,
            massless: self.massless,
        }
    }
}

impl<A: Algebra> PreparedBody<A> {
    /// The angle of its hinge.
    #[inline(always)]
    pub fn angle(&self) -> Angle<A::Scalar> {
        Angle { coordinate: self.q_index, sense: self.ratio, shift: self.shift }
    }

    /// Offset of the joint's origin from the parent's, world axes, for the parent's rotation; `None` is the world.
    #[inline(always)]
    pub fn offset(&self, outer: Option<A::Rotation>) -> A::Vector {
        if let Some(outer) = outer { A::rotate(outer, self.translation) } else { self.translation }
    }

    /// The sum of the lengths that its offset (world axes) consists of. Those of a slider may cancel: the joint's place in the
    /// parent, and its travel, which is no longer than the offset and this place together.
    #[inline(always)]
    pub fn length(&self, offset: A::Vector) -> A::Scalar {
        let length = A::size(offset);
        if A::turns(self.joint) {
            return length;
        }
        let place = A::size(self.translation);
        length + place + place
    }

    /// Its inertia in world axes.
    #[inline(always)]
    pub fn turned_inertia(&self, rotation: A::Rotation) -> Inertia<A> {
        if A::turns(self.joint) { Hinge::whole(Hinge::own(self, rotation)) } else { self.inertia.rotated(rotation) }
    }
}
