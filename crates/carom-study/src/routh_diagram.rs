//! The Routh diagram: the plane of impulses (P_t, P_n) of one planar impact, with what bounds them and every law's impulse
//! as a point.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | cone | \|P_t\| ≤ μ P_n |
//! | line of compression | u_n⁺ = 0: u_n + B P_t + C P_n = 0 |
//! | line of sticking | u_t⁺ = 0: u_t + A P_t + B P_n = 0 |
//! | ellipse | T⁺ = T⁻: ½ PᵀHP + Pᵀu⁻ = 0, centre −H⁻¹u⁻ |
//! | permissible | in the cone, in the ellipse, at or beyond the line of compression (Chatterjee & Ruina 1998) |
//! | path | how the impulse grows while friction opposes the slip of each instant (Routh) |

use carom_impact::ImpactProblem;
use nalgebra::{Matrix2, Vector2};
use plotters::prelude::*;

/// A law's impulse in the diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct LawPoint {
    /// The law's name.
    pub law: String,
    /// (P_t, P_n), N s.
    pub impulse: [f64; 2],
}

const COLOURS: [RGBColor; 8] = [
    RGBColor(90, 90, 90),
    RGBColor(227, 26, 28),
    RGBColor(255, 127, 0),
    RGBColor(31, 120, 180),
    RGBColor(51, 160, 44),
    RGBColor(106, 61, 154),
    RGBColor(177, 89, 40),
    RGBColor(0, 150, 160),
];

/// The diagram as SVG; `None` if H is singular (no ellipse bounds the impulses then) or the contact does not approach.
pub fn routh_diagram(problem: &ImpactProblem<f64, 2>, friction: f64, laws: &[LawPoint]) -> Option<String> {
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
    let spread = |k: usize| points().map(|p| p[k]).fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    // The picture shows the laws and the permissible region, not the whole ellipse.
    let ((left, right), (_, top)) = (spread(0), spread(1));
    let room = 0.08 * (right - left).max(top);
    let (left, right, top) = (left - room, right + room, top + room);
    let mut svg = String::new();
    let drawn = draw(&mut svg, (left, right, top), &Parts { h, u, friction, ellipse, permissible, laws });
    drawn.ok().map(|()| svg)
}

/// Corners of a line, (P_t, P_n).
type Line = Vec<(f64, f64)>;

struct Parts<'a> {
    h: Matrix2<f64>,
    u: Vector2<f64>,
    friction: f64,
    ellipse: Vec<Vector2<f64>>,
    permissible: Vec<Vector2<f64>>,
    laws: &'a [LawPoint],
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

/// Corners of Routh's path, from no impulse to the top of the picture.
fn path(parts: &Parts, top: f64) -> Line {
    let Parts { h, u, friction: mu, .. } = *parts;
    let (a, b) = (h[(0, 0)], h[(0, 1)]);
    let sticks = || if mu >= b.abs() / a { -b / a } else { -mu * b.signum() };
    let slip = u.x.signum();
    if u.x == 0.0 {
        return vec![(0.0, 0.0), (sticks() * top, top)];
    }
    let rate = b - mu * slip * a; // du_t/dP_n while it slips
    let stops = if slip * rate < 0.0 { -u.x / rate } else { f64::INFINITY };
    if stops >= top {
        return vec![(0.0, 0.0), (-mu * slip * top, top)];
    }
    let corner = -mu * slip * stops;
    vec![(0.0, 0.0), (corner, stops), (corner + sticks() * (top - stops), top)]
}

fn draw(
    svg: &mut String,
    (left, right, top): (f64, f64, f64),
    parts: &Parts,
) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, (820, 600)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption("Routh diagram: impulses of one impact", ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(left..right + 0.35 * (right - left), 0.0..top)?;
    let labels = ("sans-serif", 14);
    let axes = ["tangential impulse, N s", "normal impulse, N s"];
    chart.configure_mesh().light_line_style(WHITE).x_desc(axes[0]).y_desc(axes[1]).label_style(labels).draw()?;

    let pair = |p: &Vector2<f64>| (p.x, p.y);
    let green = RGBColor(178, 223, 138).mix(0.5);
    if parts.permissible.len() > 2 {
        let region: Vec<(f64, f64)> = parts.permissible.iter().map(pair).collect();
        chart
            .draw_series([Polygon::new(region, green)])?
            .label("permissible")
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 18, y + 5)], green.filled()));
    }
    let closed = || parts.ellipse.iter().chain(parts.ellipse.first()).map(pair);
    let (h, u, mu) = (&parts.h, &parts.u, parts.friction);
    // u + a P_t + b P_n = 0 across the picture, along the axis in which it is longer.
    let line = |u: f64, a: f64, b: f64| -> Line {
        let share = |k: i32| f64::from(k) / 400.0;
        if b.abs() * top > a.abs() * (right - left) {
            (0..=400).map(|k| left + (right - left) * share(k)).map(|x| (x, -(u + a * x) / b)).collect()
        } else {
            (0..=400).map(|k| top * share(k)).map(|y| (-(u + b * y) / a, y)).collect()
        }
    };
    // What leaves the picture is not drawn: the drawing would bend it along the edge.
    let inside = |p: &(f64, f64)| (left..=right).contains(&p.0) && (0.0..=top).contains(&p.1);
    let visible = |line: Line| -> Vec<Line> {
        line.split(|p| !inside(p)).filter(|part| part.len() > 1).map(<[_]>::to_vec).collect()
    };
    // A straight piece from a point inside towards one outside, up to the edge.
    let ray = |from: (f64, f64), to: (f64, f64)| -> Line {
        let at = |k: i32| {
            let share = f64::from(k) / 400.0;
            (from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share)
        };
        (0..=400).map(at).take_while(|p| inside(p)).collect()
    };
    let grey = RGBColor(120, 120, 120);
    let curves: [(&str, RGBColor, u32, Line); 6] = [
        ("no energy lost", RGBColor(70, 70, 70), 1, closed().collect()),
        ("friction cone", grey, 1, ray((0.0, 0.0), (mu * top, top))),
        ("", grey, 1, ray((0.0, 0.0), (-mu * top, top))),
        ("end of compression", RGBColor(31, 120, 180), 1, line(u.y, h[(0, 1)], h[(1, 1)])),
        ("sticking", RGBColor(227, 26, 28), 1, line(u.x, h[(0, 0)], h[(0, 1)])),
        ("path of the impulse", BLACK, 2, path(parts, top).windows(2).flat_map(|w| ray(w[0], w[1])).collect()),
    ];
    for (name, colour, width, line) in curves {
        for (k, part) in visible(line).into_iter().enumerate() {
            let series = chart.draw_series(LineSeries::new(part, colour.stroke_width(width)))?;
            if k == 0 && !name.is_empty() {
                let swatch = move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(width));
                series.label(name).legend(swatch);
            }
        }
    }
    for (k, law) in parts.laws.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        chart
            .draw_series([Circle::new((law.impulse[0], law.impulse[1]), 5, colour.filled())])?
            .label(&law.law)
            .legend(move |(x, y)| Circle::new((x + 9, y), 5, colour.filled()));
    }
    let legend = chart.configure_series_labels().position(SeriesLabelPosition::UpperRight).label_font(labels).draw();
    legend?;
    root.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use carom_impact::{Energetic, Law};
    use nalgebra::{matrix, vector};

    fn pendulum() -> ImpactProblem<f64, 2> {
        let h = matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504];
        ImpactProblem::new(h, vector![-0.267174342835, -0.134202014333]).unwrap()
    }

    /// On the ellipse no energy is lost; the permissible region holds what Stronge's law answers, and lies in cone and ellipse.
    #[test]
    fn the_permissible_region_is_what_its_bounds_say() {
        let problem = pendulum();
        let (h, u) = (*problem.delassus(), *problem.u_minus());
        let centre = -h.try_inverse().unwrap() * u;
        let ellipse = ellipse(&h, &h.cholesky().unwrap().l(), centre);
        let energy = |p: &Vector2<f64>| p.dot(&(u + h * p / 2.0));
        assert!(ellipse.iter().all(|p| energy(p).abs() < 1e-12));
        let mut region = ellipse;
        for (normal, offset) in [(vector![1.0, 0.5], 0.0), (vector![-1.0, 0.5], 0.0), (h.column(1).into_owned(), u.y)] {
            region = clip(&region, &normal, offset);
        }
        assert!(region.iter().all(|p| energy(p) < 1e-12 && p.x.abs() <= 0.5 * p.y + 1e-12 && (u + h * p).y > -1e-12));
        let hit = Energetic { restitution: 0.5, friction: 0.5 }.resolve(&problem).unwrap();
        let inside = |p: Vector2<f64>| {
            let turn = |k: usize| {
                let (a, b) = (region[k], region[(k + 1) % region.len()]);
                (b - a).perp(&(p - a))
            };
            (0..region.len()).all(|k| turn(k) >= -1e-12) || (0..region.len()).all(|k| turn(k) <= 1e-12)
        };
        assert!(inside(hit.impulse));
    }

    /// Routh's path passes through the answer of every law that follows it.
    #[test]
    fn the_path_passes_through_stronges_answer() {
        let problem = pendulum();
        let hit = Energetic { restitution: 0.5, friction: 0.5 }.resolve(&problem).unwrap();
        let parts = Parts {
            h: *problem.delassus(),
            u: *problem.u_minus(),
            friction: 0.5,
            ellipse: Vec::new(),
            permissible: Vec::new(),
            laws: &[],
        };
        let path = path(&parts, 1.0);
        let on = path.windows(2).any(|ends| {
            let share = (hit.impulse.y - ends[0].1) / (ends[1].1 - ends[0].1);
            let there = ends[0].0 + share * (ends[1].0 - ends[0].0);
            (0.0..=1.0).contains(&share) && (there - hit.impulse.x).abs() < 1e-12
        });
        assert!(on, "{path:?} {}", hit.impulse);
    }

    #[test]
    fn there_is_a_diagram_for_an_impact_and_none_without() {
        let law = LawPoint { law: "energetic".into(), impulse: [0.04, 0.12] };
        let svg = routh_diagram(&pendulum(), 0.5, &[law]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("permissible") && svg.contains("energetic"));
        let leaving = ImpactProblem::new(matrix![1.0, 0.0; 0.0, 1.0], vector![0.0, 1.0]).unwrap();
        assert!(routh_diagram(&leaving, 0.5, &[]).is_none());
    }
}
