//! Diagrams of one impact: positions of points and lines in the data and in the SVG, which is read back by means of its axes.

use carom_impact::{Coefficients, Flags, ImpactOutcome, ImpactProblem, LAW_NAMES, law_by_name};
use carom_study::{Diagram, LawPoint, Symbol, hodograph, impulse_space, routh_diagram};
use nalgebra::{Matrix3, Vector2, Vector3, matrix, vector};

fn outcomes<const D: usize>(problem: &ImpactProblem<f64, D>, e: f64, mu: f64) -> Vec<ImpactOutcome<f64, D>> {
    let rough = Coefficients { restitution: e, friction: mu, ..Coefficients::default() };
    LAW_NAMES.map(|law| law_by_name::<D>(law, rough).unwrap().resolve(problem).unwrap()).to_vec()
}

fn points<const D: usize>(hits: &[ImpactOutcome<f64, D>]) -> Vec<LawPoint<D>> {
    hits.iter().map(|hit| LawPoint { law: hit.law.into(), impulse: hit.impulse.into() }).collect()
}

/// Kane & Levinson's double pendulum.
fn pendulum() -> ImpactProblem<f64, 2> {
    let h = matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504];
    ImpactProblem::new(h, vector![-0.267174342835, -0.134202014333]).unwrap()
}

const H: Matrix3<f64> = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];

fn in_space(u: Vector3<f64>) -> ImpactProblem<f64, 3> {
    ImpactProblem::new(H, u).unwrap()
}

fn line(diagram: &Diagram<2>, name: &str) -> Vec<Vector2<f64>> {
    let shape = diagram.shapes.iter().find(|shape| shape.name == name).unwrap_or_else(|| panic!("no {name}"));
    let points: Vec<_> = shape.pieces.iter().flatten().map(|p| Vector2::from(*p)).collect();
    assert!(points.len() > 1, "{name}: {points:?}");
    points
}

/// Distance from a point to a line.
fn off(diagram: &Diagram<2>, name: &str, p: Vector2<f64>) -> f64 {
    let shape = diagram.shapes.iter().find(|shape| shape.name == name).unwrap();
    let to = |ends: &[[f64; 2]]| {
        let (a, b) = (Vector2::from(ends[0]), Vector2::from(ends[1]));
        let along = b - a;
        let share =
            if along == Vector2::zeros() { 0.0 } else { (along.dot(&(p - a)) / along.norm_squared()).clamp(0.0, 1.0) };
        (a + along * share - p).norm()
    };
    shape.pieces.iter().flat_map(|piece| piece.windows(2)).map(to).fold(f64::INFINITY, f64::min)
}

/// How far a point lies inside a convex polygon; negative outside.
fn depth(polygon: &[Vector2<f64>], p: Vector2<f64>) -> f64 {
    let centre = polygon.iter().sum::<Vector2<f64>>() / polygon.len() as f64;
    let side = |k: usize| {
        let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
        let edge = (b - a).try_normalize(1e-12)?;
        Some(edge.perp(&(p - a)) * edge.perp(&(centre - a)).signum())
    };
    (0..polygon.len()).filter_map(side).fold(f64::INFINITY, f64::min)
}

/// Contents of an SVG. The numbers on its axes give the conversion from its units.
struct Read {
    x: [f64; 2],
    y: [f64; 2],
    texts: Vec<String>,
    circles: Vec<Vector2<f64>>,
}

impl Read {
    fn svg(text: &str, axes: &[String; 2]) -> Self {
        let document = roxmltree::Document::parse(text).expect("well formed");
        assert_eq!(document.root_element().attribute("width"), Some("820"));
        let value = |node: &roxmltree::Node, name: &str| node.attribute(name).unwrap().parse::<f64>().unwrap();
        let all: Vec<_> = document.descendants().filter(|node| node.is_element()).collect();
        let said = |node: &roxmltree::Node| node.text().unwrap_or_default().trim().to_owned();
        let texts: Vec<_> = all.iter().filter(|node| node.has_tag_name("text")).collect();
        // numbers below the plot have the same y, those to its left the same x
        let numbers: Vec<_> = texts
            .iter()
            .filter_map(|node| Some((said(node).parse::<f64>().ok()?, value(node, "x"), value(node, "y"))))
            .collect();
        let lowest = numbers.iter().map(|n| n.2).fold(0.0, f64::max);
        let fit = |pairs: Vec<(f64, f64)>| {
            let (first, last) = (pairs[0], pairs[pairs.len() - 1]);
            assert!(pairs.len() > 2 && first.0 != last.0);
            let slope = (last.0 - first.0) / (last.1 - first.1);
            assert!(pairs.iter().all(|p| (first.0 + slope * (p.1 - first.1) - p.0).abs() < 1e-2 * slope.abs() * 820.0));
            [first.0 - slope * first.1, slope]
        };
        let texts: Vec<String> = texts.iter().map(|node| said(node)).collect();
        assert!(axes.iter().all(|name| texts.contains(name)));
        Self {
            x: fit(numbers.iter().filter(|n| n.2 == lowest).map(|n| (n.0, n.1)).collect()),
            y: fit(numbers.iter().filter(|n| n.2 != lowest).map(|n| (n.0, n.2)).collect()),
            texts,
            circles: all
                .iter()
                .filter(|node| node.has_tag_name("circle"))
                .map(|node| vector![value(node, "cx"), value(node, "cy")])
                .collect(),
        }
    }

    /// Distance from a point of the diagram to the nearest circle, relative to the width of the picture.
    fn nearest(&self, p: Vector2<f64>) -> f64 {
        let at = |c: &Vector2<f64>| vector![self.x[0] + self.x[1] * c.x, self.y[0] + self.y[1] * c.y];
        let offs = self.circles.iter().map(|c| {
            let off = at(c) - p;
            (off.x / self.x[1]).hypot(off.y / self.y[1])
        });
        offs.fold(f64::INFINITY, f64::min) / (820.0 * 8.0)
    }
}

/// The impulses of all laws lie in the permissible region, except for Whittaker's, which gains energy.
#[test]
fn permissible_region_of_the_routh_diagram_contains_the_laws_without_energy_gain() {
    let problem = pendulum();
    let (hits, u) = (outcomes(&problem, 0.5, 0.5), *problem.u_minus());
    let diagram = routh_diagram(&problem, 0.5, &points(&hits)).unwrap();
    let green = line(&diagram, "permissible");
    // the ellipse is a polygon of 360 vertices: its error is at most 1 - cos(0.5°) of the longer semi-axis
    let least = problem.delassus().symmetric_eigenvalues().min();
    let flat = 3.9e-5 * (2.0 * hits[0].energy_before / least).sqrt();
    let mut gains = 0;
    for hit in &hits {
        let inside = depth(&green, hit.impulse);
        if hit.flags.contains(Flags::ENERGY_GAIN) {
            assert!(inside < -0.01, "{} {inside}", hit.law);
            gains += 1;
        } else {
            assert!(inside > -flat, "{} {inside}", hit.law);
        }
        if ["newton", "poisson", "energetic"].contains(&hit.law) {
            assert!(off(&diagram, "path of the impulse", hit.impulse) < 1e-12, "{}", hit.law);
        }
    }
    assert_eq!(gains, 1);
    let h = problem.delassus();
    assert!(line(&diagram, "end of compression").iter().all(|p| (u + h * p).y.abs() < 1e-12));
    assert!(line(&diagram, "sticking").iter().all(|p| (u + h * p).x.abs() < 1e-12));
    assert!(line(&diagram, "friction cone").iter().all(|p| (p.x.abs() - 0.5 * p.y).abs() < 1e-12));
    assert!(line(&diagram, "no energy lost").iter().all(|p| p.dot(&(u + h * p / 2.0)).abs() < 1e-4 * 0.0232));
}

/// Slips that stop and resume, that stick, and that do not stop.
#[test]
fn marks_of_the_hodograph_are_at_the_velocities_of_the_laws_and_events() {
    let mut on_path = 0;
    for (u, mu, stop) in [
        (vector![0.6, -0.2, -1.0], 0.3, None),
        (vector![0.2, 0.5, -1.0], 0.9, Some("slip stops, then sticks")),
        (vector![-0.2, 0.2 * 28.60519_f64.to_radians().tan(), -1.0], 0.3, None),
        (vector![-0.2, 0.15, -1.0], 0.5, Some("slip stops, then sticks")),
    ] {
        let problem = in_space(u);
        let hits = outcomes(&problem, 0.6, mu);
        let diagram = hodograph(&problem, mu, &points(&hits)).unwrap();
        let mark = |name: &str| diagram.marks.iter().find(|mark| mark.name == name).map(|mark| Vector2::from(mark.at));
        for hit in &hits {
            let at = mark(hit.law).unwrap();
            assert!((at - hit.u_plus.xy()).norm() < 1e-14, "{}", hit.law);
            if ["newton", "poisson", "energetic"].contains(&hit.law) && hit.u_plus.xy().norm() > 0.0 {
                assert!(off(&diagram, "path in restitution", at) < 1e-4, "{} {u} {mu}", hit.law);
                on_path += 1;
            }
        }
        assert_eq!(mark("before"), Some(u.xy()));
        // without restitution the impact ends with compression
        let plastic = outcomes(&problem, 0.0, mu);
        let turn = plastic.iter().find(|hit| hit.law == "poisson").unwrap().u_plus.xy();
        assert!((mark("end of compression").unwrap() - turn).norm() < 1e-12);
        let stopped = diagram.marks.iter().find(|mark| mark.symbol == Symbol::Stop);
        assert_eq!(stopped.map(|mark| mark.name.as_str()), stop, "{u} {mu}");
        assert!(stopped.is_none_or(|mark| mark.at == [0.0, 0.0]));
        let rays = diagram.shapes.iter().filter(|shape| shape.name.starts_with("invariant"));
        assert_eq!(rays.count(), problem.invariant_directions(mu).unwrap().len());
    }
    // three laws in the two impacts that still slip at the end
    assert_eq!(on_path, 6);
}

#[test]
fn rays_of_the_hodograph_are_the_invariant_directions() {
    let problem = in_space(vector![0.6, -0.2, -1.0]);
    let diagram = hodograph(&problem, 0.3, &points(&outcomes(&problem, 0.6, 0.3))).unwrap();
    for (name, degrees) in [("invariant -45.3°, out", -45.30081_f64), ("invariant 151.4°, in", 151.39478)] {
        let end = *line(&diagram, name).last().unwrap();
        assert!((end.y.atan2(end.x).to_degrees() - degrees).abs() < 1e-5, "{name}");
        // up to the edge of the window
        let [x, y] = diagram.window;
        let rest = [end.x - x[0], x[1] - end.x, end.y - y[0], y[1] - end.y].into_iter().fold(f64::INFINITY, f64::min);
        assert!(rest.abs() < 1e-12, "{name} {rest}");
    }
}

#[test]
fn points_in_the_svg_are_at_the_results_of_the_laws() {
    let planar = pendulum();
    let hits = outcomes(&planar, 0.5, 0.5);
    let diagram = routh_diagram(&planar, 0.5, &points(&hits)).unwrap();
    let read = Read::svg(&diagram.svg().unwrap(), &diagram.axes);
    for hit in &hits {
        assert!(read.texts.iter().any(|text| text == hit.law), "{}", hit.law);
        // tolerance of one pixel of 820, as the positions of the numbers on the axes are integers
        assert!(read.nearest(hit.impulse) < 1.0 / 820.0, "{} {}", hit.law, read.nearest(hit.impulse));
    }
    let problem = in_space(vector![-0.25, 0.35, -1.0]);
    let hits = outcomes(&problem, 0.6, 0.3);
    let diagram = hodograph(&problem, 0.3, &points(&hits)).unwrap();
    let read = Read::svg(&diagram.svg().unwrap(), &diagram.axes);
    for hit in &hits {
        assert!(read.texts.iter().any(|text| text == hit.law), "{}", hit.law);
        assert!(read.nearest(hit.u_plus.xy()) < 1.0 / 820.0, "{} {}", hit.law, read.nearest(hit.u_plus.xy()));
    }
    for shape in diagram.shapes.iter().map(|shape| &shape.name) {
        assert!(read.texts.contains(shape), "{shape}");
    }
    assert!((read.x[1].abs() / read.y[1].abs() - 1.0).abs() < 1e-2, "equal scales");
}

/// The frame of the plot is the window at which lines are clipped, and the legend is outside.
#[test]
fn the_frame_is_the_window_and_the_legend_is_beside_it() {
    let problem = in_space(vector![-0.25, 0.35, -1.0]);
    for diagram in [routh_diagram(&pendulum(), 0.5, &[]).unwrap(), hodograph(&problem, 0.3, &[]).unwrap()] {
        let svg = diagram.svg().unwrap();
        let read = Read::svg(&svg, &diagram.axes);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let number = |node: &roxmltree::Node, name: &str| node.attribute(name).unwrap().parse::<f64>().unwrap();
        let lines = document.descendants().filter(|node| node.has_tag_name("polyline"));
        let lines = lines.map(|node| -> Vec<[f64; 2]> {
            let pairs = node.attribute("points").unwrap().split_whitespace().map(|pair| pair.split_once(',').unwrap());
            pairs.map(|(x, y)| [x.parse().unwrap(), y.parse().unwrap()]).collect()
        });
        let frame = lines.into_iter().find(|line| line.len() == 5 && line[0] == line[4]).unwrap();
        let [[left, top], [right, low]] = [frame[0], frame[2]];
        let pixel = 8.0; // in units of the view box; the positions of the numbers on the axes are integers
        for (k, (axis, ends)) in [(read.x, [left, right]), (read.y, [low, top])].into_iter().enumerate() {
            for (end, at) in ends.into_iter().zip(diagram.window[k]) {
                let off = (axis[0] + axis[1] * end - at) / axis[1];
                assert!(off.abs() < pixel, "{} {off}", diagram.title);
            }
        }
        assert!(diagram.shapes.len() >= 4, "{}", diagram.shapes.len());
        for shape in &diagram.shapes {
            let text = document.descendants().find(|n| n.text().is_some_and(|text| text.trim() == shape.name)).unwrap();
            let text = text.ancestors().find(|n| n.has_tag_name("text")).unwrap();
            assert!(number(&text, "x") > right, "{}", shape.name);
        }
    }
}

/// Speeds and masses over many orders of magnitude: a diagram that can be drawn, or none beyond the range of f64.
#[test]
fn diagrams_exist_for_impacts_with_representable_numbers() {
    let leaving = ImpactProblem::new(matrix![1.0, 0.0; 0.0, 1.0], vector![0.0, 1.0]).unwrap();
    assert!(routh_diagram(&leaving, 0.5, &[]).is_none());
    assert!(hodograph(&in_space(vector![1.0, 0.0, 0.0]), 0.5, &[]).is_none());
    assert!(impulse_space(&in_space(vector![1.0, 0.0, 0.1]), 0.5, &[]).is_none());
    // one joint that jams: the path has no end
    let row = vector![0.3, 0.0, 0.7];
    let wedged = ImpactProblem::new(row * row.transpose(), vector![0.5, 0.0, -0.7]).unwrap();
    assert!(hodograph(&wedged, 4.0, &[]).is_none() && impulse_space(&wedged, 4.0, &[]).is_none());
    for exponent in [-300, -120, -12, 0, 12, 120, 300] {
        let scale = 10.0_f64.powi(exponent);
        for (k, (h, u)) in
            [(H, vector![0.6, -0.2, -1.0] * scale), (H * scale, vector![0.0, 0.0, -1.0])].into_iter().enumerate()
        {
            let problem = ImpactProblem::new(h, u).unwrap();
            for mu in [0.0, 0.3, 1e6] {
                let picture = hodograph(&problem, mu, &[]).map(|diagram| diagram.svg().is_some());
                assert_ne!(picture, Some(false), "{exponent} {mu}");
                assert!(picture.is_some() || exponent.abs() > 100, "hodograph: {exponent} {k} {mu}");
                let planar = ImpactProblem::new(h.fixed_view::<2, 2>(1, 1).into_owned(), u.yz()).unwrap();
                let picture = routh_diagram(&planar, mu, &[]).map(|diagram| diagram.svg().is_some());
                assert_ne!(picture, Some(false), "{exponent} {mu}");
                assert!(picture.is_some() || exponent.abs() > 100, "Routh diagram: {exponent} {k} {mu}");
            }
        }
    }
}
