//! Figs. 4 to 7 of Pagilla & Yu (2004) from a simulation: velocities, forces, path and velocity map of the tip at
//! 0.2 m/s under 45 degrees, elbow up and down. Writes `fig4.svg` … `fig7.svg` into a folder.
//!
//! `cargo run --example paper_figures -- figures`
//!
//! Lines are the model, dots what the paper's clock of 4 ms would sample. Velocities, path and map are those of the rigid
//! impact. A rigid impact has no force, so the forces are those of a contact that gives way (Hunt & Crossley, damped so
//! that e comes out as asked) with friction 0.1; its stiffness, and with it the duration, is our choice.

use carom::Chain;
use carom::nalgebra::Vector3;
use carom::sim::{
    Compliance, ContactMode, ContactRule, EventKind, Simulation, Surface, Touch, Trajectory, free_motion,
};
use carom::study::paper::{Elbow, NORMAL, TANGENT, strike};
use plotters::prelude::*;
use std::path::Path;

type Fault = Box<dyn std::error::Error>;
type Point = (f64, f64);

/// One line of a figure, with its samples.
struct Curve {
    name: String,
    colour: RGBColor,
    line: Vec<Point>,
    dots: Vec<Point>,
}

/// From 20 ms before the impact to 30 ms after it.
const BEFORE: f64 = 0.02;
const SPAN: f64 = 0.05;
const SAMPLE: f64 = 0.004;
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 120, 180), RGBColor(227, 26, 28), RGBColor(106, 176, 222), RGBColor(240, 130, 110)];

fn main() -> Result<(), Fault> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "figures".into());
    std::fs::create_dir_all(&folder)?;
    let at = |name: &str| Path::new(&folder).join(name);
    let arm = Chain::from_urdf_file(concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf"))?;

    let (mut velocities, mut forces, mut paths, mut maps) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (k, elbow) in Elbow::BOTH.into_iter().enumerate() {
        let (sim, run) = simulate(&arm, elbow, ContactRule { law: "newton", restitution: 0.35, ..Default::default() })?;
        let curve = |name: &str, colour, of: &dyn Fn(&[f64; 4]) -> Point| -> Result<Curve, Fault> {
            let states = |step: f64| -> Result<Vec<Point>, Fault> {
                (0..=(SPAN / step + 1e-9) as i32).map(|i| Ok(of(&tip(&sim, &run, f64::from(i) * step)?))).collect()
            };
            let name = format!("{name}, {}-elbow", elbow.name());
            Ok(Curve { name, colour, line: states(SPAN / 2000.0)?, dots: states(SAMPLE)? })
        };
        velocities.push(curve("into the wall", COLOURS[k], &|s| (s[0] * 1e3, s[1]))?);
        velocities.push(curve("along the wall", COLOURS[k + 2], &|s| (s[0] * 1e3, s[2]))?);
        maps.push(curve("tip", COLOURS[k], &|s| (s[2], s[1]))?);
        let name = format!("tip, {}-elbow", elbow.name());
        let path = |step: f64| -> Result<Vec<Point>, Fault> {
            (0..=(SPAN / step + 1e-9) as i32).map(|i| place(&sim, &run, f64::from(i) * step)).collect()
        };
        paths.push(Curve { name, colour: COLOURS[k], line: path(SPAN / 2000.0)?, dots: path(SAMPLE)? });
        forces.extend(pressing(&arm, elbow, [COLOURS[k], COLOURS[k + 2]])?);
    }
    draw(&at("fig4.svg"), "Fig. 4: velocity of the tip", ["time, ms", "velocity, m/s"], &velocities)?;
    draw(
        &at("fig5.svg"),
        "Fig. 5: force on the wall, compliant contact",
        ["time from contact, ms", "force, N"],
        &forces,
    )?;
    draw(&at("fig6.svg"), "Fig. 6: path of the tip", ["down along the wall, mm", "to the wall, mm"], &paths)?;
    draw(&at("fig7.svg"), "Fig. 7: map of velocities", ["along the wall, m/s", "into the wall, m/s"], &maps)?;
    println!("wrote fig4.svg, fig5.svg, fig6.svg and fig7.svg into {folder}");
    Ok(())
}

/// The arm before its wall, and what happens.
fn simulate(arm: &Chain, elbow: Elbow, contact: ContactRule) -> Result<(Simulation, Trajectory), Fault> {
    let hit = strike(arm, elbow, 45.0, 0.2, contact.restitution)?;
    let start = free_motion(arm, &elbow.pose(), &hit.qd_minus, Vector3::zeros(), -BEFORE, 2)?.remove(1);
    let mut workspace = arm.workspace();
    let at_impact = workspace.update(arm, &elbow.pose())?.pose(arm.frame("tip")?).translation;
    let obstacle = carom::contact::Obstacle::half_space(at_impact, NORMAL.into())?;
    let wall = Surface { name: "wall".into(), obstacle, contact, motion: None };
    let touches = Touch::all(arm, &[wall], 0.0)?.touches.into_iter().filter(|touch| touch.link() == Some("tip"));
    let sim = Simulation { tolerance: 1e-10, ..Simulation::new(arm.clone(), touches.collect()) };
    let run = sim.run(&start.q, &start.qd, SPAN)?;
    Ok((sim, run))
}

/// Time from the impact, velocities into the wall (the paper's normal) and along it, 0.
fn tip(sim: &Simulation, run: &Trajectory, time: f64) -> Result<[f64; 4], Fault> {
    let moment = run.at(&sim.chain, time);
    let point = sim.chain.point(sim.chain.frame("tip")?, Vector3::zeros());
    let mut workspace = sim.chain.workspace();
    let u = workspace.update(&sim.chain, &moment.q)?.point_velocity(point, &moment.qd)?;
    Ok([time - BEFORE, -Vector3::from(NORMAL).dot(&u), Vector3::from(TANGENT).dot(&u), 0.0])
}

/// Place of the tip from where it hits, mm: down along the wall, and to the wall.
fn place(sim: &Simulation, run: &Trajectory, time: f64) -> Result<Point, Fault> {
    let frame = sim.chain.frame("tip")?;
    let mut workspace = sim.chain.workspace();
    let mut at =
        |q: &[f64]| -> Result<Vector3<f64>, Fault> { Ok(workspace.update(&sim.chain, q)?.pose(frame).translation) };
    let moved = at(&run.at(&sim.chain, time).q)? - at(&run.events[0].q)?;
    Ok((Vector3::from(TANGENT).dot(&moved) * 1e3, -Vector3::from(NORMAL).dot(&moved) * 1e3))
}

/// Normal and tangential force on the wall while the contact gives way.
fn pressing(arm: &Chain, elbow: Elbow, colours: [RGBColor; 2]) -> Result<[Curve; 2], Fault> {
    let compliance = Some(Compliance::new(1e9));
    let rule = ContactRule { restitution: 0.35, friction: 0.1, compliance, ..Default::default() };
    let (sim, run) = simulate(arm, elbow, rule)?;
    let [first, last] = [&run.events[0], run.events.get(1).ok_or("the contact does not open again")?];
    let EventKind::Mode { mode: ContactMode::Pressing { touch, damping } } = first.kind else {
        return Err("the tip does not reach the wall".into());
    };
    let steps = 400;
    let force = |k: i32| -> Result<(f64, Vector3<f64>), Fault> {
        let span = (last.time - first.time) * f64::from(k) / f64::from(steps);
        let force = sim.pressing_force(touch, damping, &run.at(&sim.chain, first.time + span))?;
        Ok((span * 1e3, -force)) // on the wall
    };
    let curve = |name: &str, colour, direction: Vector3<f64>| -> Result<Curve, Fault> {
        let point = |k| force(k).map(|(time, force)| (time, direction.dot(&force)));
        let line = (0..=steps).map(point).collect::<Result<_, Fault>>()?;
        Ok(Curve { name: format!("{name}, {}-elbow", elbow.name()), colour, line, dots: Vec::new() })
    };
    Ok([curve("normal", colours[0], -Vector3::from(NORMAL))?, curve("tangential", colours[1], Vector3::from(TANGENT))?])
}

fn draw(path: &Path, title: &str, axes: [&str; 2], curves: &[Curve]) -> Result<(), Fault> {
    let all = || curves.iter().flat_map(|curve| &curve.line);
    let range = |of: fn(&Point) -> f64| {
        let (low, high) = all().map(of).fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        let room = 0.06 * (high - low).max(1e-9);
        low - room..high + room
    };
    let root = SVGBackend::new(path, (760, 460)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(range(|p| p.0), range(|p| p.1))?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc(axes[0])
        .y_desc(axes[1])
        .label_style(("sans-serif", 14))
        .draw()?;
    for curve in curves {
        let colour = curve.colour;
        chart
            .draw_series(LineSeries::new(curve.line.iter().copied(), colour.stroke_width(2)))?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(curve.dots.iter().map(|&dot| Circle::new(dot, 3, colour.filled())))?;
    }
    let labels = chart
        .configure_series_labels()
        .position(SeriesLabelPosition::Coordinate(448, if path.ends_with("fig4.svg") { 130 } else { 8 }))
        .label_font(("sans-serif", 14))
        .border_style(BLACK.mix(0.2))
        .background_style(WHITE.mix(0.8))
        .draw();
    labels?;
    root.present()?;
    Ok(())
}
