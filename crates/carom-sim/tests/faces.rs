//! Bodies whose faces and edges touch: closed forms of tipping, sliding off an edge, resting on crossings of edges, rolling.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_sim::{ContactMode, ContactState, EventKind, Simulation, Touch, Trajectory};
use carom_testing::build::{O, Part, X, Y, Z, brick, chain, cylinder, floating_box, free, in_plane, shape};
use carom_testing::numeric::simpson;
use carom_testing::scenes::{DOWN, G, among, level, newton, surface};
use nalgebra::{Isometry3, Vector3};

/// A simulation without joint limits, on a box whose top is in the plane z = 0.
fn on_box(chain: Chain, centre: [f64; 2], size: [f64; 3], friction: f64) -> Simulation {
    let pose = Isometry3::translation(centre[0], centre[1], -size[2] / 2.0);
    on(chain, Obstacle::cuboid(pose, Vector3::from(size)).unwrap(), friction)
}

fn on(chain: Chain, obstacle: Obstacle, friction: f64) -> Simulation {
    Simulation { tolerance: 1e-11, ..among(chain, &[surface("table", obstacle, newton(0.0, friction))]) }
}

fn no_time_steps(run: &Trajectory) {
    assert_eq!(run.summary.statistics.contact_steps, 0);
}

/// A frictionless box slides over the edge of a table with the speed v. Its front corners leave the table when they pass the
/// edge, where the crossings of its lower edges with that of the table take over; its rear corners lift off when its
/// centre passes the edge. Both times follow from v.
#[test]
fn a_box_that_slides_over_an_edge_tips_when_its_centre_passes() {
    let (v, front, half) = (0.7, 0.21, 0.15);
    let sim = on_box(floating_box([2.0 * half, 0.2, 0.1], 2.0), [-1.0, 0.0], [2.0, 1.0, 0.5], 0.0);
    let q = [-front - half, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0];
    let tips = (front + half) / v;
    let run = sim.run(&q, &[v, 0.0, 0.0, 0.0, 0.0, 0.0], tips + 0.05).unwrap();
    no_time_steps(&run);
    let at = |name: &str, kind: &str| -> Vec<f64> {
        let named = |event: &&carom_sim::Event| {
            event.kind.name() == kind && event.kind.touch().is_some_and(|k| sim.touches[k].name.contains(name))
        };
        run.events.iter().filter(named).map(|event| event.time).collect()
    };
    let left = at("corner", "lift-off");
    assert_eq!(left.len(), 4, "{left:?}");
    // The event of a face is found to `Met::OUTSIDE` = 1e-9 m.
    assert!(left[..2].iter().all(|t| (t - front / v).abs() < 1e-8), "{left:?}");
    assert!(left[2..].iter().all(|t| (t - tips).abs() < 1e-8), "{left:?} {tips}");
    let crossings = at("edge", "sliding");
    assert!(crossings.len() == 2 && crossings.iter().all(|t| (t - front / v).abs() < 1e-8), "{crossings:?}");
    // The energy of the start: nothing is lost.
    let energy = run.summary.energy;
    assert!((energy.start - energy.end).abs() < 1e-8, "{energy:?}");
}

/// A rod released at rest with its centre k L beyond the edge of a table turns about the edge until it slips at the angle
/// tan θ = μ/(1 + 36 k²), because the force along it is m g sin θ (1 + 36 k²)/(1 + 12 k²) and that across it
/// m g cos θ/(1 + 12 k²). Its time is the integral of dθ/√(2 g k sin θ / (L (1/12 + k²))).
#[test]
fn a_rod_slips_off_an_edge_at_the_angle_of_its_closed_form() {
    let (length, mass, k, mu) = (0.8_f64, 1.3, 0.2_f64, 0.7_f64);
    // Its lower face is in the plane of its centre.
    let shape = format!(
        r#"<collision><origin xyz="0 0 0.01"/><geometry><box size="{length} 0.05 0.02"/></geometry></collision>"#
    );
    let chain = in_plane(mass, mass * length * length / 12.0, &shape);
    let sim = on_box(chain, [-1.0, 0.0], [2.0, 1.0, 0.5], mu);
    let run = sim.run(&[k * length, 0.0, 0.0], &[0.0; 3], 0.6).unwrap();
    no_time_steps(&run);
    let slips = run.events.iter().find(|event| event.kind.name() == "sliding").expect("it slips");
    let theta = (mu / (1.0 + 36.0 * k * k)).atan();
    // θ = φ² makes the integrand smooth.
    let c = 2.0 * G * k / (length * (1.0 / 12.0 + k * k));
    let f = |phi: f64| if phi == 0.0 { 2.0 / c.sqrt() } else { 2.0 * phi / (c * (phi * phi).sin()).sqrt() };
    let time = simpson(f, [0.0, theta.sqrt()]);
    assert!((slips.q[2] - theta).abs() < 1e-9, "{} {theta}", slips.q[2]);
    assert!((slips.time - time).abs() < 1e-8, "{} {time}", slips.time);
}

/// A plank lies across another one: no corner of either is near, and it rests on the four crossings of their edges. The load
/// of its two sides follows from the position of its centre, and it tips over a side when its centre is beyond it.
#[test]
fn crossed_planks_rest_on_the_crossings_of_their_edges() {
    let (mass, width) = (1.2, 0.1);
    let chain = floating_box([0.8, 0.06, 0.02], mass);
    let sim = on_box(chain, [0.0, 0.0], [width, 0.9, 0.3], 0.4);
    for offset in [0.0, 0.03, -0.02] {
        let q = [offset, 0.0, 0.01, 0.0, 0.0, 0.0, 1.0];
        let last = sim.run(&q, &[0.0; 6], 0.1).unwrap().summary;
        assert_eq!(last.statistics.contact_steps, 0);
        assert_eq!(last.contacts.len(), 4, "{:?}", last.contacts);
        for contact in &last.contacts {
            let share = 0.25 + 0.5 * contact.point.x.signum() * offset / width;
            assert!((contact.normal_force - share * mass * G).abs() < 1e-9, "{contact:?}");
            assert!(
                (contact.point.x.abs() - width / 2.0).abs() < 1e-12 && (contact.point.y.abs() - 0.03).abs() < 1e-12
            );
            assert!(sim.touches[contact.touch].name.contains("edge"));
        }
    }
    let beyond = sim.run(&[0.06, 0.0, 0.01, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], 0.1).unwrap().summary;
    assert_eq!((beyond.contacts.len(), beyond.statistics.contact_steps), (2, 0), "{:?}", beyond.contacts);
}

/// A cylinder that rolls down a slope: ẍ = g sin α/(1 + I/(m r²)), on the lowest points of its rims, which move on it.
#[test]
fn a_cylinder_rolls_down_a_slope_on_its_rims() {
    let (r, length, mass, angle): (f64, f64, f64, f64) = (0.1, 0.3, 1.5, 0.3);
    let (axial, across) = (mass * r * r / 2.0, mass * (3.0 * r * r + length * length) / 12.0);
    let chain = free(mass, [across, across, axial], &shape(&cylinder(r, length), O, O));
    for obstacle in
        [level(), Obstacle::cuboid(Isometry3::translation(0.0, 0.0, -0.1), Vector3::new(4.0, 1.0, 0.2)).unwrap()]
    {
        let mut sim = on(chain.clone(), obstacle, 0.5);
        sim.gravity = Vector3::new(angle.sin(), 0.0, -angle.cos()) * G;
        // Its axis along y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let run = sim.run(&[0.0, 0.0, r, half, 0.0, 0.0, half], &[0.0; 6], 0.8).unwrap();
        no_time_steps(&run);
        let a = G * angle.sin() / 1.5;
        let last = &run.summary.last;
        assert!((last.q[0] - a * 0.32).abs() < 1e-9 && (last.qd[2].abs()) < 1e-9, "{last:?}");
        let sticks = |state: &ContactState| matches!(state.mode, ContactMode::Sticking { .. });
        assert!(
            run.summary.contacts.len() == 2 && run.summary.contacts.iter().all(sticks),
            "{:?}",
            run.summary.contacts
        );
        let load = mass * G * angle.cos() / 2.0;
        assert!(run.summary.contacts.iter().all(|it| (it.normal_force - load).abs() < 1e-9));
    }
}

/// A cylinder dropped upright rests on fixed points of its rim, and rocks from its rim onto them when it is dropped tilted.
#[test]
fn a_cylinder_comes_to_rest_on_its_cap() {
    let can = free(1.0, [0.004, 0.004, 0.005], &shape(&cylinder(0.1, 0.12), O, O));
    let sim = Simulation { tolerance: 1e-9, ..on(can, level(), 0.5) };
    for tilt in [0.0_f64, 0.2] {
        let q = [0.0, 0.0, 0.12, 0.0, (tilt / 2.0).sin(), 0.0, (tilt / 2.0).cos()];
        let run = sim.run(&q, &[0.0; 6], 3.0).unwrap();
        no_time_steps(&run);
        assert!(run.events.iter().any(|event| matches!(event.kind, EventKind::Rest)), "tilt {tilt}");
        let summary = run.summary;
        assert!((summary.last.q[2] - 0.06).abs() < 1e-9, "{:?}", summary.last);
        let total: f64 = summary.contacts.iter().map(|contact| contact.normal_force).sum();
        assert!((total - G).abs() < 1e-9, "{:?}", summary.contacts);
    }
}

/// A box on a cart that a damper brakes: without slip both move as one mass, (M + m) v̇ = −c v. The faces of two links touch.
#[test]
fn a_box_is_carried_by_a_link() {
    let (cart, mass, c, v) = (3.0, 1.0, 2.0_f64, 1.5);
    let damped =
        Part::slider("cart", "base", X).joint(&format!(r#"<dynamics damping="{c}"/>"#)).weighing(cart, [1.0; 3]);
    let parts = [
        damped.with(shape(&brick([1.0, 0.5, 0.2]), [0.0, 0.0, -0.1], O)),
        Part::slider("a", "base", X).massless(),
        Part::slider("b", "a", Z).massless(),
        Part::hinge("box", "b", Y).weighing(mass, [0.01; 3]).shaped(&brick([0.2; 3])),
    ];
    let chain = chain(&parts);
    let touches = Touch::between(&chain, "box", "cart", &newton(0.0, 0.4)).unwrap();
    let sim = Simulation { gravity: DOWN, tolerance: 1e-11, ..Simulation::new(chain, touches) };
    let run = sim.run(&[0.0, 0.1, 0.1, 0.0], &[v, v, 0.0, 0.0], 1.0).unwrap();
    no_time_steps(&run);
    let exact = v * (-c / (cart + mass)).exp();
    let qd = &run.summary.last.qd;
    assert!((qd[0] - exact).abs() < 1e-9 && (qd[1] - exact).abs() < 1e-9, "{qd:?} {exact}");
    let total: f64 = run.summary.contacts.iter().map(|contact| contact.normal_force).sum();
    assert!((total - mass * G).abs() < 1e-9);
    // No contact slips at any time.
    let slips = |event: &carom_sim::Event| matches!(event.kind, EventKind::Mode { mode: ContactMode::Sliding { .. } });
    assert!(!run.summary.contacts.is_empty() && !run.events.iter().any(slips));
}
