//! Motions: events, time steps, and compliant contacts.

use super::bodies::{G, STIFFNESS, chain, free, joint, link, plane, rule, simulation, sphere, touches, with_method};
use super::method::{COMPLIANT, EVENTS, Found, Judged, STEPS, runge_kutta, said};
use super::single::worse;
use crate::halved;
use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_sim::{Compliance, ContactRule, EventKind, Holding, Simulation, Trajectory};
use nalgebra::{UnitQuaternion, Vector3};

/// A ball of 1 kg and 0.1 m on sliders along the given axes.
fn ball(axes: &[[f64; 3]]) -> Result<Chain, String> {
    let mut elements = link("ball", 1.0, [0.004; 3], [0.0; 3], &sphere([0.0; 3], 0.1));
    let carriers: Vec<String> = (1..axes.len()).map(|k| format!("carrier{k}")).collect();
    let links: Vec<&str> = ["world"].into_iter().chain(carriers.iter().map(String::as_str)).chain(["ball"]).collect();
    for (pair, axis) in links.windows(2).zip(axes) {
        elements += &joint("prismatic", [pair[0], pair[1]], 0.0, *axis);
    }
    elements.extend(carriers.iter().map(|name| format!(r#"<link name="{name}"/>"#)));
    chain(&elements)
}

/// A chain on one surface.
fn scene(method: &str, chain: Chain, surface: Obstacle, contact: ContactRule) -> Result<Simulation, String> {
    let touches = touches(&chain, vec![surface], &with_method(method, contact))?;
    Ok(simulation(method, chain, touches))
}

fn ground(normal: Vector3<f64>) -> Result<Obstacle, String> {
    plane(Vector3::zeros(), normal)
}

/// No finite damping gives a compliant contact a restitution of 0.
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

const ZENO: [(f64, f64); 2] = [(0.8, 2.5), (0.5, 3.0)];
const SAMPLES: u32 = 500;

pub fn zeno(method: &str) -> Judged {
    let (mut error, mut late) = (0.0, 0.0);
    let mut rest = f64::NAN;
    for (e, until) in ZENO {
        let sim = scene(method, ball(&[UP])?, ground(Vector3::z())?, rule(e, 0.0))?;
        let moved = run(&sim, &[1.1], &[0.0], until)?;
        for k in 0..=SAMPLES {
            let time = until * f64::from(k) / f64::from(SAMPLES);
            error = worse(error, (moved.at(&sim.chain, time).q[0] - 0.1 - bounce(e, time)).abs());
        }
        let impacts = moved.events.iter().filter(|event| matches!(event.kind, EventKind::Impact { .. }));
        for (k, event) in impacts.take(5).enumerate() {
            // The fall, and k flights.
            let expected = (2.0 / G).sqrt() * (1.0 + 2.0 * (1..=k as i32).map(|k| e.powi(k)).sum::<f64>());
            late = worse(late, (event.time - expected).abs());
        }
        let lasts = |event: &&carom_sim::Event| matches!(event.kind, EventKind::Mode { .. });
        rest = moved.events.iter().rev().find(lasts).map_or(f64::NAN, |event| event.time);
    }
    let found = Found::figure(error);
    if method != EVENTS {
        return Ok(found);
    }
    // The times of flight are a geometric series.
    let expected = (2.0 / G).sqrt() * 3.0;
    let found = found.must("error of an impact's time, s", late, super::method::EXACT);
    Ok(found.must("error of the time at which e = 0.5 comes to rest, s", (rest - expected).abs(), 1e-9))
}

/// What compliant contacts make of it, by an integration of one coordinate.
pub fn compliant_zeno(_: &str) -> Result<f64, String> {
    let mut error = 0.0;
    for (e, until) in ZENO {
        let ball = Compliant { fall: |_| -G, overlap: |q| (-q, -1.0), inertia: 1.0, stiffness: STIFFNESS, e };
        let mut next = 0;
        ball.run([1.0, 0.0], until, |time, [q, _], step, [q_next, _]| {
            while next <= SAMPLES && until * f64::from(next) / f64::from(SAMPLES) <= time + step {
                let at = until * f64::from(next) / f64::from(SAMPLES);
                let share = (at - time) / step;
                error = worse(error, (q + share * (q_next - q) - bounce(e, at)).abs());
                next += 1;
            }
        });
    }
    Ok(error)
}

/// One coordinate with Hunt & Crossley's contact, damped so that it rebounds exactly with e: a reference solution.
struct Compliant {
    /// Acceleration without contact.
    fall: fn(f64) -> f64,
    /// Overlap, and its derivative.
    overlap: fn(f64) -> (f64, f64),
    inertia: f64,
    stiffness: f64,
    e: f64,
}

impl Compliant {
    /// a v₀, the root x of ln((1 + x)/(1 − e x)) = (1 + e) x.
    fn number(e: f64) -> f64 {
        if e == 1.0 {
            return 0.0;
        }
        let below = |x: f64| ((1.0 + x) / (1.0 - e * x)).ln() < (1.0 + e) * x;
        halved([1e-9, (1.0 - 1e-15) / e], 200, below)[0]
    }

    fn step(&self, y: [f64; 2], damping: Option<f64>, h: f64) -> [f64; 2] {
        let rate = |[q, v]: [f64; 2]| {
            let (depth, slope) = (self.overlap)(q);
            let force =
                damping.map_or(0.0, |a| self.stiffness * depth.max(0.0).powf(1.5) * (1.0 + a * slope * v).max(0.0));
            [v, (self.fall)(q) - slope * force / self.inertia]
        };
        runge_kutta(y, h, rate)
    }

    /// Calls `seen` with time and state before each step, and with its length and the state after; returns the last state and the
    /// times of lift-off.
    fn run(
        &self,
        mut y: [f64; 2],
        until: f64,
        mut seen: impl FnMut(f64, [f64; 2], f64, [f64; 2]),
    ) -> ([f64; 2], Vec<f64>) {
        let (mut time, mut damping, mut lifts) = (0.0, None, Vec::new());
        let depth = |y: [f64; 2]| (self.overlap)(y[0]).0;
        while time < until {
            // A step of flight, or a thousandth of an impact.
            let h: f64 = if damping.is_some() { 2e-6 } else { 5e-4 };
            let mut h = h.min(until - time);
            let mut next = self.step(y, damping, h);
            let crosses = (depth(next) > 0.0) != damping.is_some();
            if crosses {
                let here = |h: f64| (depth(self.step(y, damping, h)) > 0.0) == damping.is_some();
                h = halved([0.0, h], 60, here)[1].max(1e-12);
                next = self.step(y, damping, h);
            }
            seen(time, y, h, next);
            (time, y) = (time + h, next);
            if crosses && damping.is_none() {
                let approach = (self.overlap)(y[0]).1 * y[1];
                damping = Some(Self::number(self.e) / approach.max(1e-3));
            } else if crosses {
                damping = None;
                lifts.push(time);
            }
        }
        (y, lifts)
    }
}

const SWINGS: (f64, f64) = (0.3, 6.4);

/// ω⁺/ω⁻ of six impacts relative to e⁶, from the energy of the string's swing (m l² + I) ω²/2 over the lowest point.
fn six_impacts(q: f64, qd: f64, e: f64) -> f64 {
    let energy = 0.5 * 1.004 * qd.powi(2) + G * (1.0 - q.cos());
    let start = G * (1.0 - SWINGS.0.cos());
    ((energy / start).sqrt() / e.powi(6) - 1.0).abs()
}

/// A ball on a string of 1 m beside a wall. It strikes at the lowest point, where no force presses it to the wall.
pub fn false_zeno(method: &str) -> Judged {
    let end = [0.0, 0.0, -1.0];
    let ball = link("ball", 1.0, [0.004; 3], end, &sphere(end, 0.1));
    let pendulum = chain(&(ball + &joint("continuous", ["world", "ball"], 0.0, [0.0, 1.0, 0.0])))?;
    let wall = plane(Vector3::new(-0.1, 0.0, 0.0), Vector3::x())?;
    let e = 0.5;
    let sim = scene(method, pendulum, wall, rule(e, 0.0))?;
    // Half a period is about 1 s: six impacts and most of the seventh swing.
    let moved = run(&sim, &[-SWINGS.0], &[0.0], SWINGS.1)?;
    let zeno = moved.events.iter().any(|event| matches!(event.kind, EventKind::Zeno { .. }));
    let last = &moved.summary.last;
    Ok(Found::figure(six_impacts(last.q[0], last.qd[0], e)).must_be("no accumulation of impacts reported", !zeno))
}

pub fn compliant_false_zeno(_: &str) -> Result<f64, String> {
    let e = 0.5;
    let fall = |q: f64| -G * q.sin() / 1.004;
    let ball = Compliant { fall, overlap: |q| (q.sin(), q.cos()), inertia: 1.004, stiffness: STIFFNESS, e };
    let ([q, qd], _) = ball.run([-SWINGS.0, 0.0], SWINGS.1, |_, _, _, _| {});
    Ok(six_impacts(q, qd, e))
}

/// Thrown upward at a ceiling: the apex is `miss` below it (or above).
pub fn grazing_flight(method: &str) -> Judged {
    let ceiling = plane(Vector3::new(0.0, 0.0, 1.0), -Vector3::z())?;
    let sim = scene(method, ball(&[UP])?, ceiling, rule(0.5, 0.0))?;
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

const LOW: f64 = 0.02;

pub fn ten_thousand_bounces(method: &str) -> Judged {
    let mut sim = scene(method, ball(&[UP])?, ground(Vector3::z())?, rule(1.0, 0.0))?;
    let period = 2.0 * (2.0 * LOW / G).sqrt();
    if method == STEPS {
        sim.contact_step = SHORT_STEP;
    }
    let mut bounces = 0_u32;
    let sampling = carom_sim::Sampling::default();
    let counted = &mut |seen: carom_sim::Seen| {
        if let carom_sim::Seen::Event(event) = seen {
            bounces += u32::from(matches!(event.kind, EventKind::Impact { .. } | EventKind::LiftOff { .. }));
        }
    };
    let summary = sim.stream(&[0.1 + LOW], &[0.0], period * 1e4, sampling, counted).map_err(said)?;
    let floor = G * 0.1;
    let (start, end) = (summary.energy.start - floor, summary.energy.end - floor);
    let found = Found::figure((end / start - 1.0).abs());
    Ok(match method {
        EVENTS => found.must("difference from 10 000 impacts", f64::from(bounces.abs_diff(10_000)), 1.0),
        COMPLIANT => {
            // A bounce lasts a flight and the time in contact.
            let ball = Compliant { fall: |_| -G, overlap: |q| (-q, -1.0), inertia: 1.0, stiffness: STIFFNESS, e: 1.0 };
            let (_, lifts) = ball.run([LOW, 0.0], 2.5 * period, |_, _, _, _| {});
            let one = lifts.get(1).zip(lifts.first()).map_or(f64::NAN, |(second, first)| second - first);
            let expected = (period * 1e4 - lifts.first().copied().unwrap_or(f64::NAN)) / one + 1.0;
            found.must("difference from the number of impacts", (f64::from(bounces) - expected).abs(), 2.0)
        }
        _ => found,
    })
}

pub const SHORT_STEP: f64 = 1e-4;

/// tan θ = 0.2 under μ = 0.3. With friction smoothed below the speed v_s it creeps with v_s artanh(tan θ/μ).
pub fn slope(method: &str) -> Judged {
    slope_with(method, Holding::Smoothed { slip_speed: CREEP })
}

/// The same with friction that sticks on a bristle.
pub fn slope_on_a_bristle(method: &str) -> Judged {
    slope_with(method, Holding::Bristle { stiffness: BRISTLE.0, damping: BRISTLE.1 })
}

const CREEP: f64 = 1e-3;

/// Seconds on the slope.
const REST: f64 = 2.0;

fn slope_with(method: &str, tangential: Holding) -> Judged {
    let angle = 0.2_f64.atan();
    let (s, c) = angle.sin_cos();
    let normal = Vector3::new(s, 0.0, c);
    let mut sim = scene(method, ball(&[[1.0, 0.0, 0.0], UP])?, ground(normal)?, rule(inelastic(method), 0.3))?;
    for compliance in sim.touches.iter_mut().filter_map(|touch| touch.contact.compliance.as_mut()) {
        compliance.tangential = tangential;
    }
    // A compliant contact rests where it bears the weight.
    let sunk = if method == COMPLIANT { (G * c / STIFFNESS).powf(1.0 / 1.5) } else { 0.0 };
    let start = normal * (0.1 - sunk);
    let moved = run(&sim, &[start.x, start.z], &[0.0; 2], REST)?;
    let last = &moved.summary.last;
    let along = Vector3::new(c, 0.0, -s);
    let way = along.dot(&Vector3::new(last.q[0] - start.x, 0.0, last.q[1] - start.z));
    let found = Found::figure(way.abs());
    Ok(match tangential {
        Holding::Bristle { .. } => found.must("relative error of the way", (way / bristle_way() - 1.0).abs(), 0.01),
        Holding::Smoothed { .. } => found,
    })
}

/// Creep of smoothed friction over the time of the scene, m: v_s artanh(tan θ/μ) t.
pub fn creep(_: &str) -> Result<f64, String> {
    Ok(CREEP * (0.2_f64 / 0.3).atanh() * REST)
}

const BRISTLE: (f64, f64) = (STIFFNESS, 1e3);

/// Way of a mass of 1 kg on the bristle: ẍ = g sin θ − P(f), c ż = P(f) − k z, f = k z + c ẋ, P(f) at most μ g cos θ. The first swing
/// slips a little; then it stands.
fn bristle_way() -> f64 {
    let ((k, c), (sin, cos)) = (BRISTLE, 0.2_f64.atan().sin_cos());
    let most = 0.3 * G * cos;
    let rate = |[_, v, z]: [f64; 3]| {
        let force = (k * z + c * v).clamp(-most, most);
        [v, G * sin - force, (force - k * z) / c]
    };
    let (mut y, h) = ([0.0; 3], 1e-6);
    for _ in 0..50_000 {
        y = runge_kutta(y, h, rate);
    }
    y[0]
}

/// A rod in the plane of its motion, q = (x, z, angle), its lower end ahead.
pub fn painleve(method: &str) -> Judged {
    let shape = sphere([-0.5, 0.0, 0.0], 0.001);
    let rod = chain(
        &[
            link("rod", 1.0, [1.0 / 12.0; 3], [0.0; 3], &shape),
            r#"<link name="a"/><link name="b"/>"#.to_owned(),
            joint("prismatic", ["world", "a"], 0.0, [1.0, 0.0, 0.0]),
            joint("prismatic", ["a", "b"], 0.0, UP),
            joint("continuous", ["b", "rod"], 0.0, [0.0, 1.0, 0.0]),
        ]
        .concat(),
    )?;
    let sim = scene(method, rod, ground(Vector3::z())?, rule(inelastic(method), 1.5))?;
    let tilt = 60_f64.to_radians();
    let until = 0.3;
    // The compliant contact begins with a little overlap.
    let gap = if method == COMPLIANT { -1e-8 } else { 0.0 };
    // The lower end slides to the side on which friction drives it into the floor.
    let moved = run(&sim, &[0.0, 0.5 * tilt.sin() + 0.001 + gap, -tilt], &[-1.0, 0.0, 0.0], until)?;
    let mut deepest = 0.0;
    for k in 0..=600 {
        let state = moved.at(&sim.chain, until * f64::from(k) / 600.0);
        deepest = worse(deepest, 0.001 - (state.q[1] + 0.5 * state.q[2].sin()));
    }
    // Impact without collision: stick, P = H⁻¹(1, 0) = (C, −B)/det H, q̇⁺ = q̇⁻ + M⁻¹Jᵀ P.
    let (sin, cos) = tilt.sin_cos();
    let (a, b, c) = (1.0 + 3.0 * sin * sin, -3.0 * sin * cos, 1.0 + 3.0 * cos * cos);
    let (p_t, p_n) = (c / (a * c - b * b), -b / (a * c - b * b));
    let expected = [-1.0 + p_t, p_n, 6.0 * (cos * p_n - sin * p_t)];
    let after = moved.at(&sim.chain, SOON).qd;
    let off = after.iter().zip(expected).fold(0.0, |most, (found, expected)| worse(most, (found - expected).abs()));
    let energy = &moved.summary.energy;
    let stepping = moved.events.iter().any(|event| event.kind.name() == "stepping");
    Ok(Found::figure(deepest)
        .must("error of the velocities after the jam", off, JAM_ERROR)
        .must("energy at the end over that at the start", energy.end / energy.start, 1.0 + 1e-6)
        .must_be("time steps only where they are asked for", stepping == (method == STEPS)))
}

/// A time at which the jam is over, s, and what gravity changes of the velocities until then.
const SOON: f64 = 0.01;
const JAM_ERROR: f64 = 0.3;

pub fn stiffness(stiffness: f64) -> Judged {
    let mut sim = scene(COMPLIANT, ball(&[UP])?, ground(Vector3::z())?, rule(0.5, 0.0))?;
    let contacts = sim.touches.iter_mut().filter(|touch| touch.link().is_some());
    contacts.for_each(|touch| touch.contact.compliance = Some(Compliance::new(stiffness)));
    sim.gravity = Vector3::zeros();
    let moved = run(&sim, &[0.1], &[-1.0], 1.0)?;
    let e = moved.summary.last.qd[0];
    let lasted = moved.events.iter().find(|event| event.kind.name() == "lift-off").map_or(f64::NAN, |event| event.time);
    // Time scales as k^(-2/5): the reference solution has a contact of a few thousand steps.
    let ball = Compliant { fall: |_| 0.0, overlap: |q| (-q, -1.0), inertia: 1.0, stiffness: 1e6, e: 0.5 };
    let (_, lifts) = ball.run([1e-9, -1.0], 0.1, |_, _, _, _| {});
    let expected = lifts.first().copied().unwrap_or(f64::NAN) * (1e6 / stiffness).powf(0.4);
    Ok(Found::figure((e / 0.5 - 1.0).abs()).must(
        "relative error of the duration",
        (lasted / expected - 1.0).abs(),
        1e-4,
    ))
}

pub fn time_step(step: f64) -> Judged {
    let mut sim = scene(STEPS, ball(&[UP])?, ground(Vector3::z())?, rule(0.8, 0.0))?;
    sim.contact_step = step;
    let moved = run(&sim, &[1.1], &[0.0], 3.0)?;
    let mut sum = 0.0;
    for k in 0..=3000 {
        let time = f64::from(k) / 1000.0;
        sum += (moved.at(&sim.chain, time).q[0] - 0.1 - bounce(0.8, time)).abs();
    }
    Ok(Found::figure(sum / 3001.0))
}

/// A free body of equal moments turns with constant angular velocity: the attitude is known at any time.
pub fn quaternions() -> Judged {
    let body = free(&link("body", 1.0, [1.0; 3], [0.0; 3], ""))?;
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
    Ok(Found::figure(worse(error, (norm - 1.0).abs())))
}
