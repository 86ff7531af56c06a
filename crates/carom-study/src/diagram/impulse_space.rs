//! The space of impulses (P_t1, P_t2, P_n) of one impact in space, the counterpart of the Routh diagram in the plane.
//!
//! With `H = L Lᵀ` and the centre `c = -H⁻¹u⁻`, the impulse with u⁺ = 0, no energy is lost on the ellipsoid
//! `P = c + r L⁻ᵀ w`, |w| = 1, `r² = cᵀHc`. There `u⁺ = r L w`. Compression ends on the plane through c with `(L w)_n = 0`.
//! Slip ends on the line through c with `(L w)_t = 0`. For lower triangular L this is w = ±e_n, the highest and the lowest
//! point of the ellipsoid.

use super::hodograph::{path_of, phases, stations};
use super::{BLUE, DARK, Diagram, GREY, LawPoint, RED, Shape, Stroke, has_room, spread};
use carom_impact::{ImpactProblem, PathPoint};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

/// Number of vertices of a circle.
const CORNERS: usize = 96;

/// The space of impulses of an impact, N s: wireframes of friction cone, ellipsoid of zero energy loss and plane of maximum
/// compression, the path of the impulse, and the impulses of some laws. `None` if H is singular (the impulses are unbounded
/// then), the contact does not approach, or numbers cannot be drawn.
pub fn impulse_space(problem: &ImpactProblem<f64, 3>, friction: f64, laws: &[LawPoint<3>]) -> Option<Diagram<3>> {
    let (h, u) = (*problem.delassus(), *problem.u_minus());
    let lower = h.cholesky()?.l();
    if problem.approach_speed() <= 0.0 {
        return None;
    }
    let path = path_of(problem, friction, laws)?;
    let impulse = |point: &PathPoint<3>| <[f64; 3]>::from(point.impulse);
    let mut marks = stations(&path, impulse);
    marks.extend(laws.iter().map(|law| law.mark(law.impulse)));

    let to_space = lower.transpose().try_inverse()?;
    let centre = -to_space * lower.try_inverse()? * u;
    let radius = (lower.transpose() * centre).norm();
    let on = |w: Vector3<f64>| <[f64; 3]>::from(centre + to_space * w * radius);
    let [bottom, top] = [-Vector3::z(), Vector3::z()].map(on);
    let circle = |at: &dyn Fn(f64) -> [f64; 3]| -> Vec<[f64; 3]> {
        (0..=CORNERS).map(|k| at(TAU * k as f64 / CORNERS as f64)).collect()
    };

    // cone slightly higher than all impulses
    let height = laws.iter().map(|law| law.impulse[2]).fold(path.points.last()?.impulse.z, f64::max).min(top[2]) * 1.1;
    let edge = |angle: f64| [friction * height * angle.cos(), friction * height * angle.sin(), height];
    let mut cone: Vec<_> = [0.25, 0.5, 0.75, 1.0].map(|k| circle(&|angle| edge(angle).map(|x| x * k))).to_vec();
    cone.extend((0..16).map(|k| vec![[0.0; 3], edge(TAU * f64::from(k) / 16.0)]));

    let mut globe: Vec<_> = (1..6)
        .map(|k| {
            let (sin, cos) = (PI * f64::from(k) / 6.0).sin_cos();
            circle(&|angle| on(Vector3::new(sin * angle.cos(), sin * angle.sin(), cos)))
        })
        .collect();
    globe.extend((0..6).map(|k| {
        let (sin, cos) = (PI * f64::from(k) / 6.0).sin_cos();
        circle(&|angle| on(Vector3::new(angle.cos() * cos, angle.cos() * sin, angle.sin())))
    }));

    // w perpendicular to the last row of L
    let across = basis_across(&Vector3::from(lower.row(2).transpose()));
    let plane = circle(&|angle| on(across.column(0) * angle.cos() + across.column(1) * angle.sin()));

    let mut shapes = vec![
        Shape::new("no energy lost", DARK, Stroke::Thin, globe),
        Shape::new("friction cone", GREY, Stroke::Thin, cone),
        Shape::new("end of compression", BLUE, Stroke::Thin, vec![plane]),
        Shape::new("sticking", RED, Stroke::Thin, vec![vec![bottom, top]]),
    ];
    shapes.extend(phases(&path, impulse));
    let all = || shapes.iter().flat_map(|s| s.pieces.iter().flatten().copied()).chain(marks.iter().map(|m| m.at));
    let window = [0, 1, 2].map(|k| spread(all().map(|p| p[k])));
    has_room(&window).then_some(())?;
    Some(Diagram {
        title: "Space of impulses of one impact".into(),
        axes: ["impulse along t1, N s", "impulse along t2, N s", "normal impulse, N s"].map(String::from),
        window,
        equal_scales: true,
        shapes,
        marks,
    })
}

/// An orthonormal basis with `along` as the direction of its third column.
fn basis_across(along: &Vector3<f64>) -> Matrix3<f64> {
    let along = along.normalize();
    let first = along.cross(&Matrix3::identity().column(along.iamin())).normalize();
    Matrix3::from_columns(&[first, along.cross(&first), along])
}

#[cfg(test)]
mod tests {
    use super::*;
    use carom_impact::{Coefficients, LAW_NAMES, law_by_name};
    use nalgebra::{matrix, vector};

    /// Checks energy, velocity and cone at the vertices of each wireframe.
    #[test]
    fn vertices_of_the_wireframes_fulfil_their_equations() {
        let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
        let u = vector![0.6, -0.2, -1.0];
        let problem = ImpactProblem::new(h, u).unwrap();
        let rough = Coefficients { restitution: 0.6, friction: 0.3, ..Coefficients::default() };
        let answer = |law: &str| law_by_name::<3>(law, rough).unwrap().resolve(&problem).unwrap().impulse.into();
        let laws = LAW_NAMES.map(|law| LawPoint { law: law.into(), impulse: answer(law) });
        let diagram = impulse_space(&problem, 0.3, &laws).unwrap();
        let corners = |name: &str| -> Vec<Vector3<f64>> {
            let shape = diagram.shapes.iter().find(|shape| shape.name == name).unwrap();
            shape.pieces.iter().flatten().map(|p| Vector3::from(*p)).collect()
        };
        let energy = |p: &Vector3<f64>| p.dot(&(u + h * p / 2.0));
        let after = |p: &Vector3<f64>| u + h * p;
        assert!(corners("no energy lost").iter().all(|p| energy(p).abs() < 1e-12));
        assert!(corners("friction cone").iter().all(|p| (p.xy().norm() - 0.3 * p.z).abs() < 1e-12));
        assert!(corners("end of compression").iter().all(|p| after(p).z.abs() < 1e-12 && energy(p).abs() < 1e-12));
        assert!(corners("sticking").iter().all(|p| after(p).xy().norm() < 1e-12));
        assert!(corners("path in compression").iter().all(|p| after(p).z < 1e-12));
        assert!(corners("path in restitution").iter().all(|p| after(p).z > -1e-12 && energy(p) < 0.0));
        assert!(diagram.window[2][1] >= corners("no energy lost").iter().map(|p| p.z).fold(0.0, f64::max));
        let singular = ImpactProblem::new(Matrix3::from_diagonal(&vector![1.0, 0.0, 1.0]), u).unwrap();
        assert!(impulse_space(&singular, 0.3, &[]).is_none());
    }
}
