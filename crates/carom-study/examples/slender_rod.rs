//! A slender steel rod dropped on a steel block at an angle: the apparent coefficient of restitution and the number of
//! micro-collisions over the inclination, with the rod as segments on bending springs, beside the constant of rigid laws.
//!
//! `cargo run --release -p carom-study --example slender_rod [PICTURE.svg]` prints the table and draws it.
//!
//! D. Stoianovici and Y. Hurmuzlu (J. Appl. Mech. 63, 1996, 307) dropped steel bars of six lengths: the coefficient that a rigid rod
//! would need depends strongly on the inclination, because the rod vibrates and strikes several times within one bounce. The sizes
//! here are a 12.7 mm bar of steel with round ends; they are not read from the paper.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | θ | inclination of the rod from the horizontal; 90° is upright |
//! | v | speed of the fall, m/s; gravity does not act during the impact |
//! | e | −ż⁺/ż⁻ of the lower end of the rigid rod with the momentum and the angular momentum after the last contact |

use carom_chain::Chain;
use carom_sim::{Scene, Seen, SimError};
use nalgebra::{DVector, Vector3};
use plotters::prelude::*;
use std::fmt::Write as _;

/// Diameter, m.
const DIAMETER: f64 = 0.0127;
/// Young's modulus, Pa; density, kg/m³; Poisson's ratio of steel.
const STEEL: (f64, f64, f64) = (200e9, 7850.0, 0.3);
/// Coefficients of the contact.
const RESTITUTION: f64 = 0.85;
const FRICTION: f64 = 0.1;
const SPEED: f64 = 1.0;
/// Longest duration of a bounce, s.
const DURATION: f64 = 6e-3;
const LENGTHS: [f64; 3] = [0.1, 0.2, 0.4];
/// Number of bends of the model, and of the models whose convergence is shown.
const BENDS: usize = 16;
const CONVERGENCE: [usize; 5] = [0, 4, 8, BENDS, 32];

/// A drop.
struct Bounce {
    /// Apparent coefficient of restitution.
    restitution: f64,
    contacts: usize,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let inclinations: Vec<f64> = (1..=18).map(|k| 5.0 * f64::from(k)).collect();
    let mut curves = Vec::new();
    println!("apparent e (contacts), {BENDS} bends; rigid: no bend, the same contact");
    println!("{:>6}{:>14}{:>14}{:>14}{:>14}", "θ", "100 mm", "200 mm", "400 mm", "rigid 200 mm");
    for length in LENGTHS {
        let bounces = inclinations.iter().map(|angle| bounce(length, BENDS, *angle));
        curves.push((length, bounces.collect::<Result<Vec<_>, _>>()?));
    }
    let rigid = inclinations.iter().map(|angle| bounce(LENGTHS[1], 0, *angle)).collect::<Result<Vec<_>, _>>()?;
    for (k, angle) in inclinations.iter().enumerate() {
        print!("{angle:>5}°");
        for bounces in curves.iter().map(|(_, bounces)| bounces).chain([&rigid]) {
            print!("{:>14}", format!("{:.3} ({})", bounces[k].restitution, bounces[k].contacts));
        }
        println!();
    }
    println!("\n200 mm at 30°, over the number of bends");
    for bends in CONVERGENCE {
        let Bounce { restitution, contacts } = bounce(LENGTHS[1], bends, 30.0)?;
        println!("{bends:>4} bends   e {restitution:.4}   {contacts} contacts");
    }
    if let Some(file) = std::env::args().nth(1) {
        std::fs::write(file, picture(&inclinations, &curves, &rigid)?)?;
    }
    Ok(())
}

/// A drop at an inclination in degrees.
fn bounce(length: f64, bends: usize, angle: f64) -> Result<Bounce, Box<dyn std::error::Error>> {
    let (young, density, poisson) = STEEL;
    let radius = 0.5 * DIAMETER;
    let area = std::f64::consts::PI * radius * radius;
    let mass = density * area * length;
    let (along, across) = (0.5 * mass * radius * radius, mass * (length * length / 12.0 + radius * radius / 4.0));
    let bending = young * area * radius * radius / 4.0;
    // Hertz: a sphere on a half-space, both of steel.
    let stiffness = 4.0 / 3.0 * young / (2.0 * (1.0 - poisson * poisson)) * radius.sqrt();
    let slide = |name: &str, axis: &str, parent: &str, child: &str| {
        format!(
            "<joint name='{name}' type='prismatic'><parent link='{parent}'/><child link='{child}'/><axis xyz='{axis}'/>\
             <limit lower='-9' upper='9' effort='0' velocity='0'/></joint>"
        )
    };
    let urdf = format!(
        "<robot name='rod'><link name='world'/><link name='a'/><link name='b'/><link name='rod'><inertial><mass value='{mass}'/>\
         <inertia ixx='{along}' ixy='0' ixz='0' iyy='{across}' iyz='0' izz='{across}'/></inertial><collision>\
         <origin xyz='{end} 0 0'/><geometry><sphere radius='{radius}'/></geometry></collision></link>{}{}\
         <joint name='turn' type='continuous'><parent link='b'/><child link='rod'/><axis xyz='0 -1 0'/></joint></robot>",
        slide("x", "1 0 0", "world", "a"),
        slide("z", "0 0 1", "a", "b"),
        end = -0.5 * length
    );
    let folder = std::env::temp_dir().join(format!("carom-slender-rod-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("rod.urdf"), urdf)?;
    let beam = if bends == 0 {
        String::new()
    } else {
        format!(
            "[[robot.beam]]\nlink = \"rod\"\nfrom = [{}, 0, 0]\nto = [{}, 0, 0]\nbends = {bends}\n\
             bending = [{{ axis = [0, 1, 0], stiffness = {bending} }}]\n",
            -0.5 * length,
            0.5 * length
        )
    };
    let (sin, cos) = angle.to_radians().sin_cos();
    let scene = format!(
        "[robot]\nurdf = \"rod.urdf\"\nq = [0, {}, {}]\nqd = [0, -{SPEED}, 0]\n{beam}\
         [[surface]]\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
         [contact]\nrestitution = {RESTITUTION}\nfriction = {FRICTION}\n\
         compliance = {{ stiffness = {stiffness}, force = \"hunt-crossley\" }}\n\
         [run]\nduration = {DURATION}\ntolerance = 1e-9\n",
        0.5 * length * sin + radius + 1e-6,
        angle.to_radians()
    );
    let scene = Scene::from_toml(&scene, &folder)?;
    std::fs::remove_dir_all(&folder)?;
    let plan = scene.plan()?;
    let mut contacts = 0;
    let run = plan.stream(scene.duration, carom_sim::Sampling::default(), &mut |seen| {
        if let Seen::Event(event) = seen {
            contacts += usize::from(event.kind.name() == "pressing");
        }
    })?;
    let (velocity, turning) = rigid(&plan.simulation.chain, (&run.last.q, &run.last.qd), (mass, across))?;
    Ok(Bounce { restitution: (velocity - 0.5 * length * cos * turning) / SPEED, contacts })
}

/// Vertical velocity of the centre, m/s, and angular velocity, rad/s, of the rigid rod with the momentum of the bent one.
fn rigid(chain: &Chain, (q, qd): (&[f64], &[f64]), (mass, inertia): (f64, f64)) -> Result<(f64, f64), SimError> {
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(chain, q)?;
    let momentum = kin.mass_matrix() * DVector::from_column_slice(qd);
    // With gravity along −x and −z the potential energies per weight are the coordinates of the centre of mass.
    let mut centre = [Vector3::x(), Vector3::z()].map(|axis| kin.potential_energy(-axis) / mass);
    (centre[0], centre[1]) = (centre[0] - q[0], centre[1] - q[1]);
    // The third entry is the angular momentum about the hinge, with the sense of θ: from x to z.
    let about_centre = momentum[2] - (centre[0] * momentum[1] - centre[1] * momentum[0]);
    Ok((momentum[1] / mass, about_centre / inertia))
}

fn picture(
    inclinations: &[f64],
    curves: &[(f64, Vec<Bounce>)],
    rigid: &[Bounce],
) -> Result<String, Box<dyn std::error::Error>> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (900, 620)).into_drawing_area();
        area.fill(&WHITE)?;
        let (upper, lower) = area.split_vertically(400);
        let colours = [RGBColor(31, 119, 180), RGBColor(214, 90, 30), RGBColor(40, 140, 60)];
        let points = |of: fn(&Bounce) -> f64, bounces: &[Bounce]| -> Vec<(f64, f64)> {
            inclinations.iter().copied().zip(bounces.iter().map(of)).collect()
        };
        for (panel, title, most, of) in [
            (&upper, "apparent coefficient of restitution", 1.0, (|it| it.restitution) as fn(&Bounce) -> f64),
            (&lower, "contacts within the bounce", 12.0, |it| it.contacts as f64),
        ] {
            let mut chart = ChartBuilder::on(panel)
                .caption(title, ("sans-serif", 20))
                .margin(10)
                .margin_right(24)
                .x_label_area_size(42)
                .y_label_area_size(52)
                .build_cartesian_2d(0.0..90.0, 0.0..most)?;
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .x_desc("inclination from the horizontal, degrees")
                .label_style(("sans-serif", 15))
                .draw()?;
            for ((length, bounces), colour) in curves.iter().zip(colours) {
                let line = points(of, bounces);
                let mut name = String::new();
                write!(name, "{:.0} mm, bending", 1e3 * length)?;
                chart
                    .draw_series(LineSeries::new(line.clone(), colour.stroke_width(2)))?
                    .label(name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(2)));
                chart.draw_series(line.into_iter().map(|at| Circle::new(at, 3, colour.filled())))?;
            }
            chart
                .draw_series(DashedLineSeries::new(points(of, rigid), 7, 5, BLACK.stroke_width(2)))?
                .label("200 mm, rigid")
                .legend(|(x, y)| PathElement::new([(x, y), (x + 22, y)], BLACK.stroke_width(2)));
            if most == 1.0 {
                chart
                    .configure_series_labels()
                    .border_style(RGBColor(180, 180, 180))
                    .position(SeriesLabelPosition::LowerLeft)
                    .label_font(("sans-serif", 15))
                    .draw()?;
            }
        }
        area.present()?;
    }
    Ok(svg)
}
