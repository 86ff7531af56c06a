//! The hodograph: the path of the slip velocity (u_t1, u_t2) through one impact in space.
//!
//! Bhatt and Koechling, J. Appl. Mech. 62 (1995) 893. The flow of the slip velocity is determined by H and μ alone. It turns
//! from the inward invariant direction towards the outward one and crosses neither. Laws that integrate the slip have the same
//! path and differ in the point at which the impact ends; the results of other laws need not lie on the path.

use super::{BLACK, BLUE, Diagram, GREY, LawPoint, Mark, PALE, RED, Shape, Stroke, Symbol, has_room, spread, visible};
use carom_impact::{ImpactProblem, ImpulsePath, InvariantDirection, PathPoint};
use nalgebra::{Vector2, Vector3};

/// Laws whose result lies on the path.
const FOLLOWING: [&str; 3] = ["newton", "poisson", "energetic"];

/// Number of paths from other initial slip velocities, drawn to show the flow.
const OTHERS: usize = 32;

/// The path up to the greatest normal impulse of the laws that follow it, at least up to the end of compression.
pub(super) fn path_of(problem: &ImpactProblem<f64, 3>, friction: f64, laws: &[LawPoint<3>]) -> Option<ImpulsePath<3>> {
    let ends = laws.iter().filter(|law| FOLLOWING.contains(&law.law.as_str())).map(|law| law.impulse[2]);
    problem.impulse_path(friction, ends.fold(0.0, f64::max)).ok()
}

/// Marks at the start of the path, the end of compression and the end of slip.
pub(super) fn stations<const D: usize>(
    path: &ImpulsePath<3>,
    place: impl Fn(&PathPoint<3>) -> [f64; D],
) -> Vec<Mark<D>> {
    let mark =
        |name: &str, symbol, point: &PathPoint<3>| Mark { name: name.into(), colour: BLACK, symbol, at: place(point) };
    let mut marks = vec![mark("before", Symbol::Start, &path.points[0])];
    marks.push(mark("end of compression", Symbol::Turn, &path.points[path.compression_end]));
    if let Some(stop) = path.slip_end {
        let goes_on = path.points[stop..].iter().any(|point| point.velocity.xy() != Vector2::zeros());
        let name = if goes_on { "slip stops, then resumes" } else { "slip stops, then sticks" };
        marks.push(mark(name, Symbol::Stop, &path.points[stop]));
    }
    marks
}

/// The path as two lines, for compression and restitution.
pub(super) fn phases<const D: usize>(
    path: &ImpulsePath<3>,
    place: impl Fn(&PathPoint<3>) -> [f64; D],
) -> impl Iterator<Item = Shape<D>> {
    let (down, up) = (&path.points[..=path.compression_end], &path.points[path.compression_end..]);
    [("path in compression", BLACK, down), ("path in restitution", GREY, up)].into_iter().filter_map(
        move |(name, colour, points)| {
            let line: Vec<_> = points.iter().map(&place).collect();
            (line.len() > 1).then(|| Shape::new(name, colour, Stroke::Thick, vec![line]))
        },
    )
}

/// The hodograph of an impact, m/s, with the results of some laws. `None` if the contact does not approach, jams without an
/// end of the impact, or has numbers that cannot be drawn.
pub fn hodograph(problem: &ImpactProblem<f64, 3>, friction: f64, laws: &[LawPoint<3>]) -> Option<Diagram<2>> {
    if problem.approach_speed() <= 0.0 {
        return None;
    }
    let path = path_of(problem, friction, laws)?;
    let slip = |point: &PathPoint<3>| [point.velocity.x, point.velocity.y];
    let mark = |law: &LawPoint<3>| {
        let u = problem.u_minus() + problem.delassus() * Vector3::from(law.impulse);
        law.mark([u.x, u.y])
    };
    // events after the laws, as several laws at rest would hide them
    let marks: Vec<_> = laws.iter().map(mark).chain(stations(&path, slip)).collect();

    let seen = || path.points.iter().map(slip).chain(marks.iter().map(|mark| mark.at));
    let ends = [0, 1].map(|k| spread(seen().map(|p| p[k])));
    // square, with a least size for contacts that never slip
    let sides = ends.map(|[low, high]| high - low);
    let half = 0.6 * sides[0].max(sides[1]).max(0.05 * problem.approach_speed());
    let window = ends.map(|[low, high]| [(low + high) / 2.0 - half, (low + high) / 2.0 + half]);
    if !has_room(&window) {
        return None;
    }

    let ways = problem.invariant_directions(friction).ok()?;
    let mut shapes = vec![Shape::new("flow of the slip", PALE, Stroke::Thin, others(problem, friction, &window))];
    let reach = 8.0 * half; // beyond the edge from any point inside
    for (colour, out) in [(RED, true), (BLUE, false)] {
        for InvariantDirection { angle, .. } in ways.iter().filter(|way| (way.slip_rate >= 0.0) == out) {
            let ray = [[0.0, 0.0], [reach * angle.cos(), reach * angle.sin()]];
            let name = format!("invariant {:.1}°, {}", angle.to_degrees(), if out { "out" } else { "in" });
            shapes.push(Shape::new(name, colour, Stroke::Thin, visible(&ray, &window)));
        }
    }
    shapes.extend(phases(&path, slip));
    Some(Diagram {
        title: "Hodograph: slip velocity through one impact".into(),
        axes: ["slip along t1, m/s".into(), "slip along t2, m/s".into()],
        window,
        equal_scales: true,
        shapes,
        marks,
    })
}

/// Paths of slip velocities that start on the edge of the window.
fn others(problem: &ImpactProblem<f64, 3>, friction: f64, window: &[[f64; 2]; 2]) -> Vec<Vec<[f64; 2]>> {
    let [[left, right], [low, high]] = *window;
    let (width, height) = (right - left, high - low);
    let h = problem.delassus();
    let rate = h.fixed_view::<2, 1>(0, 2).norm() + friction * h.fixed_view::<2, 2>(0, 0).norm();
    let impulse = 8.0 * (width + height) / rate.max(f64::MIN_POSITIVE);
    let start = |k: usize| {
        // once around the edge
        let along = 2.0 * (width + height) * (k as f64 + 0.5) / OTHERS as f64;
        let (first, second) = (along.min(width), (along - width).clamp(0.0, height));
        let (third, fourth) = ((along - width - height).clamp(0.0, width), (along - 2.0 * width - height).max(0.0));
        Vector2::new(left + first - third, low + second - fourth)
    };
    let way = |k: usize| {
        let (slip, normal) = (start(k), problem.u_minus().z);
        let problem = ImpactProblem::new(*h, Vector3::new(slip.x, slip.y, normal)).ok()?;
        let points = problem.impulse_path(friction, impulse).ok()?.points;
        // leave out points closer than the resolution: slip that nearly stops has many
        let mut line: Vec<[f64; 2]> = Vec::new();
        for slip in points.iter().map(|point| [point.velocity.x, point.velocity.y]) {
            let seen = |last: &[f64; 2]| (slip[0] - last[0]).hypot(slip[1] - last[1]) > 5e-3 * width;
            if line.last().is_none_or(seen) {
                line.push(slip);
            }
        }
        Some(visible(&line, window))
    };
    (0..OTHERS).filter_map(way).flatten().collect()
}
