//! Diagrams of one impact: where their points and lines are, in the data and in the SVG, read back through its own axes.

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
    shape.pieces.iter().flatten().map(|p| Vector2::from(*p)).collect()
}

/// Distance from a point to a line's pieces.
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

/// What an SVG shows: the numbers on its axes give the way back from its units.
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
        // Numbers below the plot share their y, those on its left their x.
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

    /// How near the nearest circle comes to a point of the diagram, as a share of the picture's width.
    fn nearest(&self, p: Vector2<f64>) -> f64 {
        let at = |c: &Vector2<f64>| vector![self.x[0] + self.x[1] * c.x, self.y[0] + self.y[1] * c.y];
        let offs = self.circles.iter().map(|c| {
            let off = at(c) - p;
            (off.x / self.x[1]).hypot(off.y / self.y[1])
        });
        offs.fold(f64::INFINITY, f64::min) / (820.0 * 8.0)
    }
}

/// Laws that lose energy, within the cone and beyond compression, lie in the green; Whittaker's gains and does not.
#[test]
fn routh_diagram_tells_permissible_impulses_from_others() {
    let problem = pendulum();
    let (hits, u) = (outcomes(&problem, 0.5, 0.5), *problem.u_minus());
    let diagram = routh_diagram(&problem, 0.5, &points(&hits)).unwrap();
    let green = line(&diagram, "permissible");
    // The ellipse is a polygon of 360 corners: flatter than it by 1 - cos(0.5°) of its longer half axis at most.
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

/// Slips that stop and leave, that stick, and that never come near rest.
#[test]
fn hodograph_shows_where_each_law_leaves_the_path() {
    for (u, mu, stop) in [
        (vector![0.6, -0.2, -1.0], 0.3, None),
        (vector![0.2, 0.5, -1.0], 0.9, Some("slip stops, and sticks")),
        (vector![-0.2, 0.2 * 28.60519_f64.to_radians().tan(), -1.0], 0.3, None),
        (vector![-0.2, 0.15, -1.0], 0.5, Some("slip stops, and sticks")),
    ] {
        let problem = in_space(u);
        let hits = outcomes(&problem, 0.6, mu);
        let diagram = hodograph(&problem, mu, &points(&hits)).unwrap();
        let mark = |name: &str| diagram.marks.iter().find(|mark| mark.name == name).map(|mark| Vector2::from(mark.at));
        for hit in &hits {
            let at = mark(hit.law).unwrap();
            assert!((at - hit.u_plus.xy()).norm() < 1e-14, "{}", hit.law);
            if ["newton", "poisson", "energetic"].contains(&hit.law) && hit.u_plus.xy().norm() > 0.0 {
                // Newton's law may be the last of them: the path goes on to it.
                assert!(off(&diagram, "path in restitution", at) < 1e-4, "{} {u} {mu}", hit.law);
            }
        }
        assert_eq!(mark("before"), Some(u.xy()));
        // Poisson's law without restitution ends where compression does.
        let plastic = outcomes(&problem, 0.0, mu);
        let turn = plastic.iter().find(|hit| hit.law == "poisson").unwrap().u_plus.xy();
        assert!((mark("end of compression").unwrap() - turn).norm() < 1e-12);
        let stopped = diagram.marks.iter().find(|mark| mark.symbol == Symbol::Stop);
        assert_eq!(stopped.map(|mark| mark.name.as_str()), stop, "{u} {mu}");
        assert!(stopped.is_none_or(|mark| mark.at == [0.0, 0.0]));
        let rays = diagram.shapes.iter().filter(|shape| shape.name.starts_with("invariant"));
        assert_eq!(rays.count(), problem.invariant_directions(mu).unwrap().len());
    }
}

#[test]
fn rays_of_the_hodograph_are_the_invariant_directions() {
    let problem = in_space(vector![0.6, -0.2, -1.0]);
    let diagram = hodograph(&problem, 0.3, &points(&outcomes(&problem, 0.6, 0.3))).unwrap();
    for (name, degrees) in [("invariant -45.3°, out", -45.30081_f64), ("invariant 151.4°, in", 151.39478)] {
        let end = *line(&diagram, name).last().unwrap();
        assert!((end.y.atan2(end.x).to_degrees() - degrees).abs() < 1e-5, "{name}");
        // To the window's edge.
        let [x, y] = diagram.window;
        let rest = [end.x - x[0], x[1] - end.x, end.y - y[0], y[1] - end.y].into_iter().fold(f64::INFINITY, f64::min);
        assert!(rest.abs() < 1e-12, "{name} {rest}");
    }
}

#[test]
fn svg_is_well_formed_and_its_points_are_where_the_laws_say() {
    let planar = pendulum();
    let hits = outcomes(&planar, 0.5, 0.5);
    let diagram = routh_diagram(&planar, 0.5, &points(&hits)).unwrap();
    let read = Read::svg(&diagram.svg().unwrap(), &diagram.axes);
    for hit in &hits {
        assert!(read.texts.iter().any(|text| text == hit.law), "{}", hit.law);
        // A pixel of 820, for the numbers on the axes stand beside their ticks in whole units.
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

/// Lines are cut at the window. Where that is the frame itself, none of them ends in mid-air, and the legend is outside.
#[test]
fn the_frame_is_the_window_and_the_legend_stands_beside_it() {
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
        let pixel = 8.0; // of the view box; the numbers on the axes stand beside their ticks in whole units
        for (k, (axis, ends)) in [(read.x, [left, right]), (read.y, [low, top])].into_iter().enumerate() {
            for (end, at) in ends.into_iter().zip(diagram.window[k]) {
                let off = (axis[0] + axis[1] * end - at) / axis[1];
                // Numbers stand by their ticks' middle, half a letter off.
                assert!(off.abs() < pixel, "{} {off}", diagram.title);
            }
        }
        for shape in &diagram.shapes {
            let text = document.descendants().find(|n| n.text().is_some_and(|text| text.trim() == shape.name)).unwrap();
            let text = text.ancestors().find(|n| n.has_tag_name("text")).unwrap();
            assert!(number(&text, "x") > right, "{}", shape.name);
        }
    }
}

/// Speeds and masses over many orders: a picture, or none, but no panic and no endless drawing.
#[test]
fn there_is_a_picture_for_an_impact_and_none_without() {
    let leaving = ImpactProblem::new(matrix![1.0, 0.0; 0.0, 1.0], vector![0.0, 1.0]).unwrap();
    assert!(routh_diagram(&leaving, 0.5, &[]).is_none());
    assert!(hodograph(&in_space(vector![1.0, 0.0, 0.0]), 0.5, &[]).is_none());
    assert!(impulse_space(&in_space(vector![1.0, 0.0, 0.1]), 0.5, &[]).is_none());
    // One joint, held by friction while it is carried along: no path.
    let row = vector![0.3, 0.0, 0.7];
    let wedged = ImpactProblem::new(row * row.transpose(), vector![0.5, 0.0, -0.7]).unwrap();
    assert!(hodograph(&wedged, 4.0, &[]).is_none() && impulse_space(&wedged, 4.0, &[]).is_none());
    for exponent in [-300, -120, -12, 0, 12, 120, 300] {
        let scale = 10.0_f64.powi(exponent);
        for (h, u) in [(H, vector![0.6, -0.2, -1.0] * scale), (H * scale, vector![0.0, 0.0, -1.0])] {
            let Ok(problem) = ImpactProblem::new(h, u) else { continue };
            for mu in [0.0, 0.3, 1e6] {
                let picture = hodograph(&problem, mu, &[]).map(|diagram| diagram.svg().is_some());
                assert_ne!(picture, Some(false), "{exponent} {mu}");
                assert!(picture.is_some() || exponent.abs() > 100, "{exponent} {mu}");
                let planar = ImpactProblem::new(h.fixed_view::<2, 2>(1, 1).into_owned(), u.yz()).unwrap();
                let picture = routh_diagram(&planar, mu, &[]).map(|diagram| diagram.svg().is_some());
                assert_ne!(picture, Some(false), "{exponent} {mu}");
            }
        }
    }
}
