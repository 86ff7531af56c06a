//! Scenes in which several points touch at once.

use carom::Chain;
use carom::sim::{ContactMode, ContactRule, EventKind, Simulation, Surface, Touch};
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use nalgebra::Vector3;

const G: f64 = 9.81;

fn slope(angle: f64) -> Obstacle {
    Obstacle::half_space(Vector3::zeros(), Vector3::new(angle.sin(), 0.0, angle.cos())).unwrap()
}

fn simulation(chain: Chain, floor: Obstacle, law: &'static str, e: f64, friction: f64) -> Simulation {
    let contact = ContactRule { law, restitution: e, friction, ..ContactRule::default() };
    let surface = Surface { name: "floor".into(), obstacle: floor, contact, motion: None };
    let touches = Touch::all(&chain, &[surface], 0.0).unwrap().touches;
    let touches = touches.into_iter().filter(|touch| touch.link().is_some()).collect();
    Simulation { gravity: Vector3::new(0.0, 0.0, -G), tolerance: 1e-11, ..Simulation::new(chain, touches) }
}

/// A body that moves in the x–z plane: q = (x, z, angle about y).
fn in_plane(mass: f64, inertia: f64, shapes: &str) -> Chain {
    let text = format!(
        r#"<robot name="body"><link name="world"/><link name="a"/><link name="b"/>
        <link name="body"><inertial><mass value="{mass}"/>
          <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>{shapes}</link>
        <joint name="x" type="prismatic"><parent link="world"/><child link="a"/><axis xyz="1 0 0"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="z" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="turn" type="continuous"><parent link="b"/><child link="body"/><axis xyz="0 1 0"/></joint></robot>"#
    );
    Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap()
}

fn floating_box(size: [f64; 3], mass: f64) -> Chain {
    let [x, y, z] = size;
    let inertia = |a: f64, b: f64| mass * (a * a + b * b) / 12.0;
    let text = format!(
        r#"<robot name="box"><link name="box"><inertial><mass value="{mass}"/>
        <inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial>
        <collision><geometry><box size="{x} {y} {z}"/></geometry></collision></link></robot>"#,
        inertia(y, z),
        inertia(x, z),
        inertia(x, y)
    );
    Chain::from_urdf_str(&text, &LoadOptions { floating_base: true, ..LoadOptions::default() }).unwrap()
}

/// B9: a uniform rod dropped flat on both ends: simultaneous e = ½ rebounds as a whole with half the speed.
#[test]
fn a_rod_dropped_flat_rebounds_flat() {
    let ends = r#"<collision><origin xyz="0.5 0 0"/><geometry><sphere radius="0.01"/></geometry></collision>
        <collision><origin xyz="-0.5 0 0"/><geometry><sphere radius="0.01"/></geometry></collision>"#;
    for e in [0.0, 0.5, 1.0] {
        let sim = simulation(in_plane(1.0, 1.0 / 12.0, ends), slope(0.0), "newton", e, 0.0);
        let run = sim.run(&[0.0, 0.51, 0.0], &[0.0, 0.0, 0.0], 0.4).unwrap();
        let hit = &run.events[0];
        assert!(matches!(&hit.kind, EventKind::Several { touches, .. } if touches.len() == 2), "{hit:?}");
        assert_eq!(hit.blows.len(), 2);
        assert!((hit.time - (2.0 * 0.5 / G).sqrt()).abs() < 1e-11);
        assert!((hit.qd_plus[1] + e * hit.qd_minus[1]).abs() < 1e-11 && hit.qd_plus[2].abs() < 1e-10, "{hit:?}");
    }
}

/// B10: Housner's rocking block. From corner to corner ω⁺/ω⁻ = 1 − 1.5 sin²α, and a quarter period takes
/// acosh(1/(1−θ₀/α))/p in the linearised motion.
#[test]
fn a_rocking_block_loses_what_housner_says() {
    for (alpha, ratio) in [(0.1_f64, 0.985049933), (0.2, 0.940795746), (0.3, 0.869001711)] {
        let r = 1.0;
        let (b, h) = (r * alpha.sin(), r * alpha.cos()); // half width, half height
        let shape = format!(r#"<collision><geometry><box size="{} 0.4 {}"/></geometry></collision>"#, 2.0 * b, 2.0 * h);
        let chain = in_plane(3.0, r * r, &shape); // I = m R²/3 = 1 for m = 3
        let mut sim = simulation(chain, slope(0.0), "newton", 0.0, 5.0);
        // Corners come in the order of their x, y, z signs: those with y < 0 stand for both.
        let corners = sim.touches.drain(..).enumerate();
        sim.touches = corners.filter(|(k, _)| k & 2 == 0).map(|(_, touch)| touch).collect();
        assert_eq!(sim.touches.len(), 4);
        // Tilted by θ₀ about the right lower corner, which lies at the origin.
        let theta = 0.4 * alpha;
        let centre = |turn: f64, corner: f64| {
            // The corner (corner, −h) of the turned body at the origin: centre = −R(turn)(corner, −h).
            let (s, c) = turn.sin_cos();
            [-(c * corner - s * h), -(-s * corner - c * h)]
        };
        let [x, z] = centre(theta, b);
        let run = sim.run(&[x, z, theta], &[0.0; 3], 3.0).unwrap();
        let hits: Vec<_> = run.events.iter().filter(|e| matches!(e.kind, EventKind::Several { .. })).collect();
        assert!(hits.len() >= 2, "{:?}", run.events.iter().map(|e| (e.time, e.kind.name())).collect::<Vec<_>>());
        for hit in &hits[..2] {
            assert!(
                (hit.qd_plus[2] / hit.qd_minus[2] - ratio).abs() < 1e-8,
                "{alpha}: {}",
                hit.qd_plus[2] / hit.qd_minus[2]
            );
        }
        // Energy gives ω at the strike: ½ (I + m R²) ω² = m g R (cos(α−θ) … ) exactly.
        let inertia = 4.0 / 3.0 * 3.0 * r * r;
        let fall = 3.0 * G * r * ((alpha - theta).cos() - alpha.cos());
        assert!((0.5 * inertia * hits[0].qd_minus[2].powi(2) - fall).abs() < 1e-8 * fall);
        // Quarter period, linearised: p² = 3g/(4R); Housner's formula is for small angles.
        let quarter = (1.0 / (1.0 - theta / alpha)).acosh() / (0.75 * G / r).sqrt();
        assert!((hits[0].time / quarter - 1.0).abs() < alpha * alpha, "{} {quarter}", hits[0].time);
    }
}

/// A box put down flat stays where it is: no creep, no sinking.
#[test]
fn a_resting_box_rests() {
    let sim = simulation(floating_box([0.3, 0.2, 0.1], 2.0), slope(0.0), "energetic", 0.5, 0.4);
    let start = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0];
    let run = sim.run(&start, &[0.0; 6], 5.0).unwrap();
    assert!(run.events.iter().any(|e| e.kind.name() == "rest"), "{:?}", run.events);
    for (a, b) in run.summary.last.q.iter().zip(&start) {
        assert!((a - b).abs() < 1e-9, "{:?}", run.summary.last.q);
    }
}

/// On a slope: sticks below the friction angle, and slides above it with g (sin θ − μ cos θ), whatever the step.
#[test]
fn a_box_on_a_slope_follows_coulomb() {
    let mu = 0.3_f64;
    for (angle, slides) in [(mu.atan() - 0.02, false), (mu.atan() + 0.1, true)] {
        let sim = simulation(floating_box([0.3, 0.2, 0.1], 2.0), slope(angle), "newton", 0.0, mu);
        let (s, c) = angle.sin_cos();
        let half = angle / 2.0;
        let start = [0.05 * s, 0.0, 0.05 * c, 0.0, half.sin(), 0.0, half.cos()];
        let run = sim.run(&start, &[0.0; 6], 1.0).unwrap();
        let last = &run.summary.last;
        let way = (last.q[0] - start[0]).hypot(last.q[2] - start[2]);
        let expected = if slides { 0.5 * G * (s - mu * c) } else { 0.0 };
        // The midpoint rule is exact for constant acceleration.
        assert!((way - expected).abs() < 1e-7, "{way} against {expected}");
        assert!(last.qd[3..].iter().all(|w| w.abs() < 1e-8), "it does not turn: {:?}", last.qd);
    }
}

/// A box thrown on the floor tumbles, loses energy at every impact, and ends at rest on one of its faces, on the floor.
#[test]
fn a_tumbling_box_comes_to_rest_on_a_face() {
    let size = [0.1, 0.07, 0.05];
    let mut rng = fastrand::Rng::with_seed(3);
    for case in 0..12 {
        let (e, mu) = ([0.0, 0.3, 0.6][case % 3], [0.1, 0.3, 0.8][case / 4]);
        let sim = simulation(floating_box(size, 0.4), slope(0.0), "poisson", e, mu);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(3.0 * rng.f64(), 3.0 * rng.f64(), 3.0 * rng.f64());
        let q = [0.0, 0.0, 0.2 + 0.2 * rng.f64(), turn.i, turn.j, turn.k, turn.w];
        let qd: Vec<f64> = (0..6).map(|k| (rng.f64() - 0.5) * if k < 3 { 1.0 } else { 10.0 }).collect();
        let run = sim.run(&q, &qd, 6.0).unwrap_or_else(|error| panic!("case {case}: {error}"));
        let last = &run.summary.last;
        let names = || run.events.iter().map(|e| (e.time, e.kind.name())).collect::<Vec<_>>();
        assert!(run.events.iter().any(|e| e.kind.name() == "rest"), "case {case}: {:?}, {:?}", last, names());
        let heights = size.map(|side| (last.q[2] - side / 2.0).abs());
        assert!(heights.iter().any(|gap| *gap < 1e-6), "case {case}: centre at {}", last.q[2]);
        for event in run.events.iter().filter(|e| matches!(e.kind, EventKind::Impact { .. })) {
            let EventKind::Impact { hit, .. } = &event.kind else { continue };
            assert!(hit.energy_after <= hit.energy_before * (1.0 + 1e-12));
        }
        // Without restitution the problem of several contacts has a solution, and it is found; with it, friction may leave
        // none for redundant corners, and the residual says by how much.
        let allowed = if e == 0.0 { 1e-9 } else { 1e-4 };
        assert!(run.summary.statistics.worst_residual < allowed, "case {case}: {:?}", run.summary.statistics);
    }
}

/// Painlevé's rod slides into a jam: events have no answer there, time steps do, and nothing falls through.
#[test]
fn a_jammed_rod_does_not_fall_through() {
    let end = r#"<collision><origin xyz="-0.5 0 0"/><geometry><sphere radius="0.001"/></geometry></collision>
        <collision><origin xyz="0.5 0 0"/><geometry><sphere radius="0.001"/></geometry></collision>"#;
    let sim = simulation(in_plane(1.0, 1.0 / 12.0, end), slope(0.0), "energetic", 0.0, 1.5);
    let theta = 60_f64.to_radians();
    // Lower end at the floor and sliding to the side that jams.
    for side in [1.0, -1.0] {
        let run = sim.run(&[0.0, 0.5 * theta.sin() + 0.001, -theta], &[side, 0.0, 0.0], 2.0).unwrap();
        for k in 0..=400 {
            let moment = run.at(&sim.chain, f64::from(k) * 0.005);
            let low = moment.q[1] - 0.5 * moment.q[2].sin().abs() - 0.001;
            // Steps leave overlaps of up to two falls of one step, 2 g h².
            assert!(low > -3.0 * G * 1e-6, "{low} at {}", moment.time);
        }
        assert!(run.summary.energy.end < run.summary.energy.start + 1e-9);
    }
}

#[test]
fn modes_of_several_contacts_have_a_name() {
    assert_eq!(ContactMode::Several.name(), "several");
}

/// Time stepping throughout is first order in the step: over many starts, ten times shorter steps are some ten times better.
#[test]
fn time_stepping_converges_to_the_events() {
    let ball = in_plane(1.0, 0.1, r#"<collision><geometry><sphere radius="0.1"/></geometry></collision>"#);
    let exact = simulation(ball, slope(0.0), "newton", 0.5, 0.0);
    let error = |step: f64| {
        let steps = Simulation { stepping: true, contact_step: step, ..exact.clone() };
        // One impact within the time; its phase within a step is luck, so take the mean over many.
        let starts = (0..40).map(|k| 0.3 + 0.001_317 * f64::from(k));
        let misses = starts.map(|height| {
            let q = [0.0, 0.1 + height, 0.0];
            let [found, expected] = [&steps, &exact].map(|sim| sim.run(&q, &[0.0; 3], 0.4).unwrap().summary.last.q[1]);
            (found - expected).abs()
        });
        misses.sum::<f64>() / 40.0
    };
    let (coarse, fine) = (error(1e-2), error(1e-3));
    let order = (coarse / fine).log10();
    assert!((0.7..1.4).contains(&order), "{coarse} {fine}: order {order}");
}
