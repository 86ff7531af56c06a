//! The Routh diagram: the plane of impulses (P_t, P_n) of one planar impact, with the region of permissible impulses and the
//! impulse of each law as a point.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | cone | \|P_t\| ≤ μ P_n |
//! | line of compression | u_n⁺ = 0: u_n + B P_t + C P_n = 0 |
//! | line of sticking | u_t⁺ = 0: u_t + A P_t + B P_n = 0 |
//! | ellipse | T⁺ = T⁻: ½ PᵀHP + Pᵀu⁻ = 0, centre −H⁻¹u⁻ |
//! | permissible | in the cone, in the ellipse, at or beyond the line of compression (Chatterjee & Ruina 1998) |
//! | path | the impulse during the impact, with friction opposing the instantaneous slip (Routh) |

use super::{BLACK, BLUE, DARK, Diagram, GREEN, GREY, LawPoint, RED, Shape, Stroke, has_room, spread, visible};
use carom_impact::ImpactProblem;
use nalgebra::{Matrix2, Vector2};

/// The Routh diagram of a planar impact, N s, with the impulses of some laws. `None` if H is singular (the impulses are
/// unbounded then), the contact does not approach, or numbers cannot be drawn.
pub fn routh_diagram(problem: &ImpactProblem<f64, 2>, friction: f64, laws: &[LawPoint<2>]) -> Option<Diagram<2>> {
    let (h, u) = (*problem.delassus(), *problem.u_minus());
    let lower = h.cholesky()?.l();
    if problem.approach_speed() <= 0.0 {
        return None;
    }
    let centre = -h.try_inverse()? * u;
    let ellipse = ellipse(&h, &lower, centre);
    let region =
        [(Vector2::new(1.0, friction), 0.0), (Vector2::new(-1.0, friction), 0.0), (h.column(1).into_owned(), u.y)];
    let permissible = region.iter().fold(ellipse.clone(), |polygon, (normal, offset)| clip(&polygon, normal, *offset));

    let points = || permissible.iter().copied().chain(laws.iter().map(|law| Vector2::from(law.impulse)));
    // the window contains the laws and the permissible region, not the whole ellipse
    let [[left, right], [_, top]] = [0, 1].map(|k| spread(points().map(|p| p[k])));
    let room = 0.08 * (right - left).max(top);
    let window = [[left - room, right + room], [0.0, top + room]];
    if !has_room(&window) {
        return None;
    }
    let top = window[1][1];
    let path = problem.impulse_path(friction, top).ok()?.points;

    let pair = |p: &Vector2<f64>| [p.x, p.y];
    let closed = ellipse.iter().chain(ellipse.first()).map(pair).collect();
    // the line u + a P_t + b P_n = 0, clipped by the window later
    let across = |u: f64, a: f64, b: f64| {
        let (size, middle) = (a.hypot(b), [0, 1].map(|k| (window[k][0] + window[k][1]) / 2.0));
        let reach = (window[0][1] - window[0][0]) + top;
        let off = (u + a * middle[0] + b * middle[1]) / size;
        let nearest = [middle[0] - off * a / size, middle[1] - off * b / size];
        let end = |way: f64| [nearest[0] - way * reach * b / size, nearest[1] + way * reach * a / size];
        vec![end(-1.0), end(1.0)]
    };
    let cone = |side: f64| vec![[0.0, 0.0], [side * friction * top, top]];
    let line = |name: &str, colour, stroke, lines: &[Vec<[f64; 2]>]| {
        Shape::new(name, colour, stroke, lines.iter().flat_map(|line| visible(line, &window)).collect())
    };
    let area = permissible.iter().map(pair).collect();
    let shapes = vec![
        Shape::new("permissible", GREEN, Stroke::Area, vec![area]),
        line("no energy lost", DARK, Stroke::Thin, &[closed]),
        line("friction cone", GREY, Stroke::Thin, &[cone(1.0), cone(-1.0)]),
        line("end of compression", BLUE, Stroke::Thin, &[across(u.y, h[(0, 1)], h[(1, 1)])]),
        line("sticking", RED, Stroke::Thin, &[across(u.x, h[(0, 0)], h[(0, 1)])]),
        line("path of the impulse", BLACK, Stroke::Thick, &[path.iter().map(|point| pair(&point.impulse)).collect()]),
    ];
    Some(Diagram {
        title: "Routh diagram: impulses of one impact".into(),
        axes: ["tangential impulse, N s".into(), "normal impulse, N s".into()],
        window,
        equal_scales: false,
        shapes: shapes.into_iter().filter(|shape| shape.pieces.iter().any(|piece| piece.len() > 1)).collect(),
        marks: laws.iter().map(|law| law.mark(law.impulse)).collect(),
    })
}

/// (P − c)ᵀH(P − c) = cᵀHc as a polygon: P = c + r L⁻ᵀ(cos, sin).
fn ellipse(h: &Matrix2<f64>, lower: &Matrix2<f64>, centre: Vector2<f64>) -> Vec<Vector2<f64>> {
    let radius = centre.dot(&(h * centre)).sqrt();
    let to_plane = lower.transpose().try_inverse().unwrap_or_else(Matrix2::identity);
    let at = |k: i32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 360.0).sin_cos();
        centre + to_plane * Vector2::new(cos, sin) * radius
    };
    (0..360).map(at).collect()
}

/// The part of a convex polygon with normal · P + offset ≥ 0 (Sutherland & Hodgman).
fn clip(polygon: &[Vector2<f64>], normal: &Vector2<f64>, offset: f64) -> Vec<Vector2<f64>> {
    let height = |p: &Vector2<f64>| normal.dot(p) + offset;
    let mut kept = Vec::new();
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (up, next) = (height(a), height(b));
        if up >= 0.0 {
            kept.push(*a);
        }
        if (up > 0.0) != (next > 0.0) && up != next {
            kept.push(a + (b - a) * (up / (up - next)));
        }
    }
    kept
}
