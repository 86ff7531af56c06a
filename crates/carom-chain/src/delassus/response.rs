//! The response of a chain at a contact point, as a view of the memory in which it is computed.

use crate::algebra::Algebra;

/// The response of a chain at a contact point, at one configuration. With inertia added by drives, all quantities but M include it.
#[derive(Debug, Clone, Copy)]
pub struct PointResponse<'a, A: Algebra> {
    /// World position of the point, m.
    pub position: A::Vector,
    /// The nv columns of the Jacobian: velocity of the point at unit joint rate, world axes.
    pub jacobian: &'a [A::Vector],
    /// The mass matrix, all nv×nv entries; kg m², kg m, kg. Empty if the recursion was used, which does not form it.
    pub mass_matrix: &'a [A::Scalar],
    /// Columns of the Delassus matrix J M⁻¹ Jᵀ, world axes, 1/kg; in the plane the third is zero.
    pub delassus: [A::Vector; 3],
    /// The nv rows of X = M⁻¹Jᵀ: the velocity of each joint after unit impulses along the world axes on the chain at rest.
    pub response: &'a [A::Vector],
    /// nᵀHn: the velocity of the point along the normal after a unit impulse along it, 1/kg.
    pub mobility: A::Scalar,
    /// The nv rows yₖ of Y: H = Σ yₖ yₖᵀ / Dₖ.
    #[doc(hidden)]
    pub reduced_jacobian: &'a [A::Vector],
    /// 1/Dₖ by coordinate; 0 for locked joints and for joints that the impulse cannot move.
    #[doc(hidden)]
    pub inverse_d: &'a [A::Scalar],
    /// The nv levers lₖ: the rounding error of column k of J is some ε of lₖ, also where the lengths cancel; m, or 1 for a slider.
    #[doc(hidden)]
    pub levers: &'a [A::Scalar],
}
