//! Motions: events, time steps, and contacts that give way.

use super::single::worse;
use super::{COMPLIANT, EVENTS, Found, Judged, STEPS, said};
use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use carom_impact::{HuntCrossley, NormalForce, TangentialForce, compliant_impact};
use carom_sim::{Compliance, ContactRule, EventKind, Holding, Simulation, Surface, Touch, Trajectory};
use nalgebra::{UnitQuaternion, Vector3, dmatrix, dvector};

const G: f64 = 9.81;
/// Where a scene does not say otherwise.
const STEP: f64 = 1e-3;
const STIFFNESS: f64 = 1e7;

fn chain(text: &str) -> Result<Chain, String> {
    Chain::from_urdf_str(text, &LoadOptions::default()).map_err(|e| e.to_string())
}

/// A ball of 1 kg and 0.1 m on sliders along the given axes.
fn ball(axes: &[[f64; 3]]) -> Result<Chain, String> {
    let mut text = r#"<robot name="ball"><link name="world"/>"#.to_owned();
    for (k, [x, y, z]) in axes.iter().enumerate() {
        let parent = if k == 0 { "world".to_owned() } else { format!("carrier{k}") };
        let last = k + 1 == axes.len();
        let child = if last { "ball".to_owned() } else { format!("carrier{}", k + 1) };
        let body = r#"<inertial><mass value="1"/>
            <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial>
            <collision><geometry><sphere radius="0.1"/></geometry></collision>"#;
        text += &format!(
            r#"<link name="{child}">{}</link>
            <joint name="slide{k}" type="prismatic"><parent link="{parent}"/><child link="{child}"/>
            <axis xyz="{x} {y} {z}"/><limit lower="-1e6" upper="1e6" effort="0" velocity="0"/></joint>"#,
            if last { body } else { "" }
        );
    }
    chain(&(text + "</robot>"))
}

/// Under gravity, with what a method means.
fn scene(
    method: &str,
    chain: Chain,
    surface: Obstacle,
    contact: ContactRule,
    stiffness: f64,
) -> Result<Simulation, String> {
    // Hunt & Crossley's force; friction smoothed below 1e-3 m/s.
    let compliance = Compliance::new(stiffness);
    let contact = ContactRule { compliance: (method == COMPLIANT).then_some(compliance), ..contact };
    let surface = Surface { name: "surface".into(), obstacle: surface, contact, motion: None };
    let touches = Touch::all(&chain, &[surface], 0.0).map_err(said)?.touches;
    // A slider's ends are far away.
    let touches = touches.into_iter().filter(|touch| touch.link().is_some()).collect();
    Ok(Simulation {
        gravity: Vector3::new(0.0, 0.0, -G),
        tolerance: 1e-12,
        contact_step: STEP,
        stepping: method == STEPS,
        ..Simulation::new(chain, touches)
    })
}

fn plane(normal: Vector3<f64>) -> Result<Obstacle, String> {
    Obstacle::half_space(Vector3::zeros(), normal).map_err(|e| e.to_string())
}

fn rule(restitution: f64, friction: f64) -> ContactRule {
    ContactRule { law: "energetic", restitution, friction, ..ContactRule::default() }
}

/// Without any rebound a contact that gives way has no finite damping.
fn inelastic(method: &str) -> f64 {
    if method == COMPLIANT { 0.01 } else { 0.0 }
}

const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Height over the floor of a ball dropped from 1 m.
fn bounce(e: f64, mut time: f64) -> f64 {
    let mut speed = (2.0 * G).sqrt();
    let fall = speed / G;
    if time < fall {
        return 1.0 - 0.5 * G * time * time;
    }
    time -= fall;
    loop {
        speed *= e;
        let arc = 2.0 * speed / G;
        if time < arc {
            return speed * time - 0.5 * G * time * time;
        }
        // Past the last bounce there is no height left.
        if arc < 1e-12 {
            return 0.0;
        }
        time -= arc;
    }
}

fn run(sim: &Simulation, q: &[f64], qd: &[f64], duration: f64) -> Result<Trajectory, String> {
    sim.run(q, qd, duration).map_err(said)
}

pub fn zeno(method: &str) -> Judged {
    let mut error = 0.0;
    for (e, until) in [(0.8, 2.5), (0.5, 3.0)] {
        let sim = scene(method, ball(&[UP])?, plane(Vector3::z())?, rule(e, 0.0), STIFFNESS)?;
        let moved = run(&sim, &[1.1], &[0.0], until)?;
        for k in 0..=500 {
            let time = until * f64::from(k) / 500.0;
            error = worse(error, (moved.at(&sim.chain, time).q[0] - 0.1 - bounce(e, time)).abs());
        }
    }
    let how = match method {
        STEPS => format!("steps of {STEP} s"),
        COMPLIANT => format!("k = {STIFFNESS:e} N/m^1.5"),
        _ => String::new(),
    };
    Ok(Found::figure(error).noting(how))
}

/// A ball on a string of 1 m beside a wall. It strikes at the lowest point, where no force presses it to the wall.
pub fn false_zeno(method: &str) -> Judged {
    let pendulum = chain(
        r#"<robot name="pendulum"><link name="frame"/><link name="ball">
        <inertial><origin xyz="0 0 -1"/><mass value="1"/>
        <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial>
        <collision><origin xyz="0 0 -1"/><geometry><sphere radius="0.1"/></geometry></collision></link>
        <joint name="string" type="continuous"><parent link="frame"/><child link="ball"/><axis xyz="0 1 0"/></joint></robot>"#,
    )?;
    let wall = Obstacle::half_space(Vector3::new(-0.1, 0.0, 0.0), Vector3::x()).map_err(|e| e.to_string())?;
    let e = 0.5;
    let sim = scene(method, pendulum, wall, rule(e, 0.0), STIFFNESS)?;
    // Half a period is about 1 s: six impacts and most of the seventh swing.
    let moved = run(&sim, &[-0.3], &[0.0], 6.4)?;
    if moved.events.iter().any(|event| matches!(event.kind, EventKind::Zeno { .. })) {
        return Ok(Found::figure(f64::INFINITY).noting("took the bounces for infinitely many;"));
    }
    // Energy over the lowest point: of the string's swing, (m l² + I) ω²/2.
    let energy = |state: &carom_sim::Moment| 0.5 * 1.004 * state.qd[0].powi(2) + G * (1.0 - state.q[0].cos());
    let start = G * (1.0 - 0.3_f64.cos());
    let share = (energy(&moved.summary.last) / start).sqrt();
    let expected = e.powi(6);
    Ok(Found::figure((share / expected - 1.0).abs()))
}

/// Thrown upward at a ceiling: the apex is `miss` below it (or above).
pub fn grazing_flight(method: &str) -> Judged {
    let ceiling = Obstacle::half_space(Vector3::new(0.0, 0.0, 1.0), -Vector3::z()).map_err(|e| e.to_string())?;
    let sim = scene(method, ball(&[UP])?, ceiling, rule(0.5, 0.0), STIFFNESS)?;
    let mut wrong = 0.0;
    for k in 3..=12 {
        for miss in [10_f64.powi(-k), -10_f64.powi(-k)] {
            let speed = (2.0 * G * (0.9 - miss)).sqrt();
            let moved = run(&sim, &[0.0], &[speed], 0.8)?;
            let free = speed * 0.8 - 0.5 * G * 0.8 * 0.8;
            // A hit turns the ball back earlier and slower. Without one it flies on as it would.
            let hit = (moved.summary.last.q[0] - free).abs() > 1e-10;
            if hit != (miss < 0.0) {
                wrong = worse(wrong, miss.abs());
            }
        }
    }
    Ok(Found::figure(wrong))
}

pub fn ten_thousand_bounces(method: &str) -> Judged {
    let mut sim = scene(method, ball(&[UP])?, plane(Vector3::z())?, rule(1.0, 0.0), STIFFNESS)?;
    let height = 0.02;
    let period = 2.0 * (2.0 * height / G).sqrt();
    if method == STEPS {
        sim.contact_step = 1e-4;
    }
    let mut bounces = 0;
    let sampling = carom_sim::Sampling { every: None, dense: false };
    let counted = &mut |seen: carom_sim::Seen| {
        if let carom_sim::Seen::Event(event) = seen {
            bounces += usize::from(matches!(event.kind, EventKind::Impact { .. } | EventKind::LiftOff { .. }));
        }
    };
    let summary = sim.stream(&[0.1 + height], &[0.0], period * 1e4, sampling, counted).map_err(said)?;
    let floor = G * 0.1;
    let (start, end) = (summary.energy.start - floor, summary.energy.end - floor);
    Ok(Found::figure((end / start - 1.0).abs()).noting(format!("{bounces} bounces")))
}

/// tan θ = 0.2 under μ = 0.3. With friction smoothed below the speed v_s it creeps with v_s artanh(tan θ/μ).
pub fn slope(method: &str) -> Judged {
    slope_with(method, Holding::Smoothed { slip_speed: CREEP })
}

/// The same with friction that sticks on a bristle.
pub fn slope_on_a_bristle(method: &str) -> Judged {
    slope_with(method, Holding::Bristle { stiffness: STIFFNESS, damping: 1e3 })
}

const CREEP: f64 = 1e-3;

fn slope_with(method: &str, tangential: Holding) -> Judged {
    let angle = 0.2_f64.atan();
    let (s, c) = angle.sin_cos();
    let normal = Vector3::new(s, 0.0, c);
    let mut sim =
        scene(method, ball(&[[1.0, 0.0, 0.0], UP])?, plane(normal)?, rule(inelastic(method), 0.3), STIFFNESS)?;
    for compliance in sim.touches.iter_mut().filter_map(|touch| touch.contact.compliance.as_mut()) {
        compliance.tangential = tangential;
    }
    // A contact that gives way rests where it bears the weight.
    let sunk = if method == COMPLIANT { (G * c / STIFFNESS).powf(1.0 / 1.5) } else { 0.0 };
    let start = normal * (0.1 - sunk);
    let moved = run(&sim, &[start.x, start.z], &[0.0; 2], 2.0)?;
    let last = &moved.summary.last;
    let along = Vector3::new(c, 0.0, -s);
    let way = along.dot(&Vector3::new(last.q[0] - start.x, 0.0, last.q[1] - start.z));
    let found = Found::figure(way.abs());
    if method != COMPLIANT || matches!(tangential, Holding::Bristle { .. }) {
        return Ok(found);
    }
    let creep = CREEP * (0.2_f64 / 0.3).atanh();
    let as_predicted = (way / 2.0 / creep - 1.0).abs() < 0.05;
    let how = format!("creeps with {:.3e} m/s: friction smoothed over 1e-3 m/s can't stick", way / 2.0);
    Ok(if as_predicted { found.failing(Some(how)) } else { found })
}

/// A rod in the plane of its motion, q = (x, z, angle), its lower end ahead.
pub fn painleve(method: &str) -> Judged {
    let rod = chain(
        r#"<robot name="rod"><link name="world"/><link name="a"/><link name="b"/>
        <link name="rod"><inertial><mass value="1"/>
          <inertia ixx="0.08333333333333333" ixy="0" ixz="0" iyy="0.08333333333333333" iyz="0" izz="0.08333333333333333"/>
          </inertial>
          <collision><origin xyz="-0.5 0 0"/><geometry><sphere radius="0.001"/></geometry></collision></link>
        <joint name="x" type="prismatic"><parent link="world"/><child link="a"/><axis xyz="1 0 0"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="z" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="turn" type="continuous"><parent link="b"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#,
    )?;
    let sim = scene(method, rod, plane(Vector3::z())?, rule(inelastic(method), 1.5), STIFFNESS)?;
    let tilt = 60_f64.to_radians();
    let until = 0.3;
    // The lower end slides to the side on which friction drives it into the floor.
    let moved = run(&sim, &[0.0, 0.5 * tilt.sin() + 0.001, -tilt], &[-1.0, 0.0, 0.0], until)?;
    let mut deepest = 0.0;
    for k in 0..=600 {
        let state = moved.at(&sim.chain, until * f64::from(k) / 600.0);
        deepest = worse(deepest, 0.001 - (state.q[1] + 0.5 * state.q[2].sin()));
    }
    let books = &moved.summary.energy;
    if books.end > books.start * (1.0 + 1e-6) {
        return Ok(Found::figure(f64::INFINITY).noting("energy gained;"));
    }
    let jam = moved.events.iter().find(|event| event.kind.name() == "stepping").filter(|_| method == EVENTS);
    let how = |time: f64| format!("rigid sliding has no acceleration at t = {time:.3} s: time steps take over");
    Ok(Found::figure(deepest).failing(jam.map(|event| how(event.time))))
}

pub fn stiffness(stiffness: f64) -> Judged {
    let mut sim = scene(COMPLIANT, ball(&[UP])?, plane(Vector3::z())?, rule(0.5, 0.0), stiffness)?;
    sim.gravity = Vector3::zeros();
    let moved = run(&sim, &[0.1], &[-1.0], 1.0)?;
    let e = moved.summary.last.qd[0];
    let lasted = moved.events.iter().find(|event| event.kind.name() == "lift-off").map_or(f64::NAN, |event| event.time);
    Ok(Found::figure((e / 0.5 - 1.0).abs())
        .noting(format!("{lasted:.1e} s of contact, {} steps", moved.summary.statistics.steps)))
}

pub fn time_step(step: f64) -> Judged {
    let mut sim = scene(STEPS, ball(&[UP])?, plane(Vector3::z())?, rule(0.8, 0.0), STIFFNESS)?;
    sim.contact_step = step;
    let moved = run(&sim, &[1.1], &[0.0], 3.0)?;
    let mut sum = 0.0;
    for k in 0..=3000 {
        let time = f64::from(k) / 1000.0;
        sum += (moved.at(&sim.chain, time).q[0] - 0.1 - bounce(0.8, time)).abs();
    }
    Ok(Found::figure(sum / 3001.0))
}

/// A free body turns evenly about an axis of its own: the attitude is known at any time.
pub fn quaternions() -> Judged {
    let body = Chain::from_urdf_str(
        r#"<robot name="body"><link name="body"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>"#,
        &LoadOptions { floating_base: true, ..LoadOptions::default() },
    )
    .map_err(|e| e.to_string())?;
    let (step, count) = (1e-3, 1_000_000);
    let turning = Vector3::new(0.7, -1.1, 0.4);
    let qd = [0.0, 0.0, 0.0, turning.x, turning.y, turning.z];
    let mut q = vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    for _ in 0..count {
        q = body.integrate(&q, &qd, step).map_err(|e| e.to_string())?;
    }
    let norm = q[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
    let found = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
    let expected = UnitQuaternion::from_scaled_axis(turning * (step * f64::from(count)));
    let error = found.angle_to(&expected);
    Ok(Found::figure(worse(error, (norm - 1.0).abs())).noting(format!("norm off by {:.1e}", (norm - 1.0).abs())))
}

/// Velocities after the first of three balls of 1 kg struck with 1 m/s, elastic contacts after Hertz, the first `ratio` times
/// as stiff as the second.
pub fn elastic_cradle(ratio: f64) -> Result<[f64; 3], String> {
    let hertz = |stiffness| HuntCrossley::new(stiffness, 1.5, 1.0).map(NormalForce::HuntCrossley);
    let said = |e: carom_impact::ImpactError| e.to_string();
    let contacts = [ratio, 1.0].map(|k| hertz(1e9 * k).map(|force| (force, TangentialForce::Frictionless)));
    let contacts = contacts.into_iter().collect::<Result<Vec<_>, _>>().map_err(said)?;
    let hit = compliant_impact(&dmatrix![2.0, -1.0; -1.0, 2.0], &dvector![-1.0, 0.0], &contacts).map_err(said)?;
    Ok([1.0 - hit.impulse[0], hit.impulse[0] - hit.impulse[1], hit.impulse[1]])
}
