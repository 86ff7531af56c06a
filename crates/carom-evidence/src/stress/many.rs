//! Motions with several lasting contacts whose modes change: a wedge, a stack, rolling that becomes sliding, rocking to rest.

use super::bodies::{
    self, G, chain, cuboid, free, joint, link, moments, plane, simulation, sphere, touches, with_method,
};
use super::method::{
    COMPLIANT, Found, GLOCKER_PFEIFFER, Judged, LIU_ZHAO_BROGLIATO, MOREAU, STEPS, law, runge_kutta, said,
};
use super::single::worse;
use carom_chain::Chain;
use carom_impact::{Accuracy, Constraint, ImpactProblem, Order, SeveralProblem, Stiffnesses};
use carom_sim::{ContactRule, EventKind, Load, Profile, Simulation, Touch, Trajectory, Wrench, WrenchAxes};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// A body that moves in the x–z plane, with the coordinates x, z and the angle about y.
fn body(name: &str, [mass, inertia]: [f64; 2], shape: &str) -> String {
    let [x, z] = ["x", "z"].map(|axis| format!("{name} carrier {axis}"));
    [
        format!(r#"<link name="{x}"/><link name="{z}"/>"#),
        link(name, mass, [inertia; 3], [0.0; 3], &format!("<collision>{shape}</collision>")),
        joint("prismatic", ["world", &x], 0.0, [1.0, 0.0, 0.0]),
        joint("prismatic", [&x, &z], 0.0, [0.0, 0.0, 1.0]),
        joint("continuous", [&z, name], 0.0, [0.0, 1.0, 0.0]),
    ]
    .concat()
}

/// Moment of inertia of a uniform box about y.
fn inertia_of(mass: f64, half: [f64; 3]) -> f64 {
    moments(mass, half)[1]
}

/// Compliant where the method is.
fn rule(method: &str, restitution: f64, friction: f64) -> ContactRule {
    with_method(method, bodies::rule(restitution, friction))
}

/// The chain over a floor, and with contacts between two of its links.
fn scene(
    method: &str,
    chain: Chain,
    floor: Option<ContactRule>,
    between: Option<([&str; 2], ContactRule)>,
) -> Result<Simulation, String> {
    let mut all = match floor {
        Some(contact) => touches(&chain, vec![plane(Vector3::zeros(), Vector3::z())?], &contact)?,
        None => Vec::new(),
    };
    if let Some(([link, other], contact)) = between {
        all.extend(Touch::between(&chain, link, other, &contact).map_err(said)?);
    }
    Ok(Simulation { zeno_time: Simulation::zeno_time_for(1e-12), ..simulation(method, chain, all) })
}

/// Without time steps, unless these are the method.
fn judged(method: &str, found: Found, moved: &Trajectory) -> Judged {
    let steps = moved.summary.statistics.contact_steps;
    Ok(found.must_be("no time step", method == STEPS || steps == 0))
}

/// A block of 1 kg slides down the face of a wedge of 3 kg that glides on a smooth floor: with the load
/// N = g cos α/(1/m + sin α (sin α − μ cos α)/M), both accelerations are constant.
pub fn wedge(method: &str) -> Judged {
    let (alpha, mu, [m, big]) = (0.4_f64, 0.2, [1.0, 3.0]);
    let (half, thick) = ([0.1, 0.1, 0.05], 0.05);
    let (s, c) = alpha.sin_cos();
    let face = format!(
        r#"<collision><origin xyz="{} 0 {}" rpy="0 {alpha} 0"/>{}</collision>"#,
        -thick * s,
        -thick * c,
        cuboid([1.0, 0.3, thick])
    );
    let glide = joint("prismatic", ["world", "wedge"], 0.0, [1.0, 0.0, 0.0]);
    let wedge = link("wedge", big, [1.0; 3], [0.0; 3], &face) + &glide;
    let block = body("block", [m, inertia_of(m, half)], &cuboid(half));
    let sim = scene(method, chain(&(wedge + &block))?, None, Some((["block", "wedge"], rule(method, 0.5, mu))))?;
    let (h, time) = (half[2], 0.3);
    let moved = sim.run(&[0.0, h * s, h * c, alpha], &[0.0; 4], time).map_err(said)?;
    let load = G * c / (1.0 / m + s * (s - mu * c) / big);
    let half_square = 0.5 * time * time;
    let expected = [
        -load * (s - mu * c) / big * half_square,
        h * s + load * (s - mu * c) / m * half_square,
        h * c + (load * (c + mu * s) / m - G) * half_square,
    ];
    let last = &moved.summary.last.q;
    let error = expected.iter().zip(last).map(|(e, q)| (e - q).abs()).fold(0.0, worse);
    judged(method, Found::figure(error).must("turn of the block, rad", (last[3] - alpha).abs(), 1e-2), &moved)
}

/// Two boxes, one on the other, slide at 1 m/s. The rougher floor stops the lower one, and the upper one slides on: the lower one
/// stops after v²/2a with a = (μ₁ (m₁ + m₂) − μ₂ m₂) g/m₁, the upper one after v²/(2 μ₂ g).
pub fn stack(method: &str) -> Judged {
    let (mass, mu, speed) = ([2.0, 1.0], [0.4, 0.2], 1.0);
    let half = [[0.4, 0.2, 0.1], [0.1, 0.1, 0.05]];
    let bodies: String = (0..2)
        .map(|k| body(["lower", "upper"][k], [mass[k], inertia_of(mass[k], half[k])], &cuboid(half[k])))
        .collect();
    let between = (["upper", "lower"], rule(method, 0.5, mu[1]));
    let sim = scene(method, chain(&bodies)?, Some(rule(method, 0.5, mu[0])), Some(between))?;
    let q = [0.0, half[0][2], 0.0, -0.1, 2.0 * half[0][2] + half[1][2], 0.0];
    let moved = sim.run(&q, &[speed, 0.0, 0.0, speed, 0.0, 0.0], 0.8).map_err(said)?;
    let brake = [(mu[0] * (mass[0] + mass[1]) - mu[1] * mass[1]) * G / mass[0], mu[1] * G];
    let last = &moved.summary.last.q;
    let error = |k: usize| (last[3 * k] - q[3 * k] - speed * speed / (2.0 * brake[k])).abs();
    let found = Found::figure(worse(error(0), error(1)));
    if method == STEPS {
        return judged(method, found, &moved);
    }
    let sticks = |time: f64| {
        let of = |event: &&carom_sim::Event| event.kind.name() == "sticking" && (event.time - time).abs() < 1e-10;
        moved.events.iter().filter(of).count()
    };
    let stops = [sticks(speed / brake[0]), sticks(speed / brake[1])];
    judged(method, found.must_be("four corners of each box stop at its time", stops == [4, 4]), &moved)
}

/// A pair of wheels on an axle rolls, pulled by a force F = c t, until its friction F (I/r²)/(m + I/r²) exceeds μ m g; then it slides,
/// and friction turns it at a constant rate.
pub fn wheels(method: &str) -> Judged {
    let (mass, inertia, r, mu, c, time) = (1.0, 0.004, 0.1, 0.2, 14.0, 0.8);
    let shapes = sphere([0.0, -0.2, 0.0], r) + &sphere([0.0, 0.2, 0.0], r);
    let chain = free(&link("wheels", mass, [0.05, inertia, 0.05], [0.0; 3], &shapes))?;
    let mut sim = scene(method, chain, Some(rule(method, 0.5, mu)), None)?;
    let rows = [[0.0; 6], [2.0 * c * time, 0.0, 0.0, 0.0, 0.0, 0.0]];
    let load = Load::Table(Profile::new(&[0.0, 2.0 * time], &rows).map_err(said)?);
    sim.wrenches = vec![Wrench { link: "wheels".into(), point: Vector3::zeros(), axes: WrenchAxes::World, load }];
    let moved = sim.run(&[0.0, 0.0, r, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], time).map_err(said)?;
    // F/(m + I/r²) while it rolls.
    let rolling = mass + inertia / (r * r);
    let slips = mu * mass * G * rolling / (c * inertia / (r * r));
    let (v, x) = (c * slips * slips / (2.0 * rolling), c * slips.powi(3) / (6.0 * rolling));
    let rest = time - slips;
    let brake = mu * G;
    let end = x + v * rest + c / mass * ((time.powi(3) - slips.powi(3)) / 6.0 - slips * slips * rest / 2.0)
        - brake * rest * rest / 2.0;
    let spin = v / r + mu * mass * G * r / inertia * rest;
    let last = &moved.summary.last;
    let error = worse((last.q[0] - end).abs(), r * (last.qd[4] - spin).abs());
    let found = Found::figure(error);
    if method == STEPS || method == COMPLIANT {
        return judged(method, found, &moved);
    }
    let slides: Vec<f64> =
        moved.events.iter().filter(|event| event.kind.name() == "sliding").map(|event| event.time).collect();
    let late = slides.iter().map(|at| (at - slips).abs()).fold(0.0, worse);
    let found = found.must("error of the time at which slip begins, s", late, 1e-9);
    judged(method, found.must_be("both wheels slip", slides.len() == 2), &moved)
}

/// Half the width and the height of the rocking block, m: tan α = 1/4.
const ROCKING: [f64; 3] = [0.05, 0.05, 0.2];

/// p² = 3 g/(4 R), and α, of the rocking block.
fn rocking() -> [f64; 2] {
    let [a, _, h] = ROCKING;
    [3.0 * G / (4.0 * a.hypot(h)), (a / h).atan()]
}

/// Housner's ratio of the angular velocities after and before an impact: angular momentum about the new corner is kept.
fn housner() -> f64 {
    1.0 - 1.5 * rocking()[1].sin().powi(2)
}

/// The largest angle after an impact with the angular velocity ω: ω² = 4 p² sin(α − θ/2) sin(θ/2).
fn amplitude(speed: f64) -> f64 {
    let [pp, alpha] = rocking();
    let mut top = speed * speed / (2.0 * pp * alpha.sin());
    for _ in 0..60 {
        let miss = 4.0 * pp * (alpha - top / 2.0).sin() * (top / 2.0).sin() - speed * speed;
        top -= miss / (2.0 * pp * (alpha - top).sin());
    }
    top
}

/// The time from the largest angle to the impact: ∫ dθ/√(4 p² sin(α − (θ + θ₀)/2) sin((θ₀ − θ)/2)), with θ = θ₀ (1 − s²), by Simpson's
/// rule.
fn fall(top: f64) -> f64 {
    let [pp, alpha] = rocking();
    let rate = |s: f64| {
        let theta = top * (1.0 - s * s);
        let half = 0.5 * top * s * s; // (θ₀ − θ)/2
        // sin(x)/x, which is 1 at 0.
        let sinc = if half == 0.0 { 1.0 } else { half.sin() / half };
        2.0 * top / (4.0 * pp * (alpha - 0.5 * (theta + top)).sin() * 0.5 * top * sinc).sqrt()
    };
    let n = 2000;
    let weight = |k: usize| if k == 0 || k == n { 1.0 } else { [2.0, 4.0][k % 2] };
    (0..=n).map(|k| weight(k) * rate(k as f64 / n as f64)).sum::<f64>() / (3.0 * n as f64)
}

/// The block is released at half its angle of balance, and rocks to rest on two corners. Every half swing has a quadrature, every
/// impact Housner's ratio: infinitely many impacts up to the time at which it rests.
pub fn rocking_to_rest(method: &str) -> Judged {
    let [a, _, h] = ROCKING;
    let [pp, alpha] = rocking();
    let first = 0.5 * alpha;
    let chain = chain(&body("block", [1.0, inertia_of(1.0, ROCKING)], &cuboid(ROCKING)))?;
    let restitution = if method == COMPLIANT { 0.01 } else { 0.0 };
    let sim = scene(method, chain, Some(rule(method, restitution, 2.0)), None)?;
    // The start turns about the corner at x = −a: the angle about y is −θ, and the corner stays at (−a, 0).
    let (s, c) = first.sin_cos();
    let q = [-a + a * c - h * s, a * s + h * c, -first];
    let mut impacts = vec![fall(first)];
    let mut speeds = vec![(4.0 * pp * (alpha - first / 2.0).sin() * (first / 2.0).sin()).sqrt() * housner()];
    while let (Some(time), Some(speed)) = (impacts.last(), speeds.last())
        && *speed > 1e-14
    {
        let next = time + 2.0 * fall(amplitude(*speed));
        let slower = speed * housner();
        impacts.push(next);
        speeds.push(slower);
    }
    let rests = impacts[impacts.len() - 1];
    let duration = rests + 0.2;
    // The angle between the impacts, up to the sixth.
    let mut angles = Vec::new();
    let mut trace = |start: f64, span: f64, y: [f64; 2], sign: f64| {
        let n = 400;
        let mut y = y;
        for k in 1..=n {
            let step = span / f64::from(n);
            y = runge_kutta(y, step, |[theta, rate]| [rate, -pp * (alpha - theta).sin()]);
            if k % 40 == 0 && k < n {
                angles.push((start + f64::from(k) * step, sign * y[0]));
            }
        }
    };
    trace(0.0, impacts[0], [first, 0.0], -1.0);
    for k in 0..6 {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        trace(impacts[k], impacts[k + 1] - impacts[k], [0.0, speeds[k]], sign);
    }
    let run = sim.run(&q, &[0.0; 3], duration).map_err(said)?;
    let error = angles.iter().map(|(time, angle)| (run.at(&sim.chain, *time).q[2] - angle).abs()).fold(0.0, worse);
    let found = Found::figure(error);
    if method == STEPS || method == COMPLIANT {
        return judged(method, found, &run);
    }
    let rest = run.events.iter().find(|event| matches!(event.kind, EventKind::Rest));
    let late = rest.map_or(f64::NAN, |event| (event.time - rests).abs());
    // Six impacts within the Zeno time of 3e-7 s are replaced by one, with the rest of them, of some times that duration.
    let found = found.must("error of the time at which it rests, s", late, 1e-5);
    judged(method, found, &run)
}

/// Mass matrix, and the rows of the corners at x = ±a: tangent and normal.
fn corner(side: f64) -> Matrix2x3<f64> {
    let [a, _, h] = ROCKING;
    // u = v + ω × r with r = (±a, −h) and ω about y.
    Matrix2x3::new(1.0, 0.0, -h, 0.0, 1.0, -side * a)
}

fn inverse_mass() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / inertia_of(1.0, ROCKING)))
}

/// ω⁺/ω⁻ of the impact on the second corner while the first one rests, without friction at the second: the first one is free.
pub fn smooth_ratio(_: &str) -> Result<f64, String> {
    let [a, ..] = ROCKING;
    Ok((1.0 - 2.0 * a * a / (inertia_of(1.0, ROCKING) + a * a) - housner()).abs())
}

/// One impact of the rocking block: it turns about one corner at 1 rad/s, the other one strikes, e = 0, μ = 2. The figure is the error of
/// ω⁺/ω⁻.
pub fn rocking_impact(method: &str) -> Judged {
    let [a, _, h] = ROCKING;
    // About the corner at x = −a.
    let v = Vector3::new(h, -a, 1.0);
    let (mu, w) = (2.0, inverse_mass());
    let (jump, flags): (Vector3<f64>, _) = match method {
        MOREAU | GLOCKER_PFEIFFER | LIU_ZHAO_BROGLIATO | super::method::SEQUENTIAL => {
            // In three dimensions, without motion along y.
            let mut j = DMatrix::zeros(6, 3);
            for (k, side) in [-1.0, 1.0].into_iter().enumerate() {
                let own = corner(side);
                j.row_mut(3 * k).copy_from(&own.row(0));
                j.row_mut(3 * k + 2).copy_from(&own.row(1));
            }
            let response = DMatrix::from_fn(3, 6, |i, k| w[(i, i)] * j[(k, i)]);
            let u = &j * DVector::from_column_slice(v.as_slice());
            let both = vec![Constraint::Contact { restitution: 0.0, friction: mu }; 2];
            let problem = SeveralProblem::new(&j * &response, u, both).map_err(said)?;
            let accuracy = Accuracy { tolerance: 1e-13, ..Accuracy::default() };
            let hit = match method {
                MOREAU => problem.simultaneous(&accuracy, None).map_err(said)?,
                GLOCKER_PFEIFFER => problem.poisson(&accuracy).total,
                LIU_ZHAO_BROGLIATO => {
                    let equal = Stiffnesses { exponent: 1.5, ratios: &[1.0, 1.0] };
                    problem.energetic(&equal, &accuracy).map_err(said)?.total
                }
                _ => problem.sequential(&Order::MostApproaching, &accuracy).map_err(said)?,
            };
            let jump = response * hit.impulse;
            (Vector3::new(jump[0], jump[1], jump[2]), hit.flags)
        }
        _ => {
            let j = corner(1.0);
            let delassus: Matrix2<f64> = j * w * j.transpose();
            let problem = ImpactProblem::new(delassus, j * v).map_err(said)?;
            let hit = law::<2>(method, 0.0, mu).resolve(&problem).map_err(said)?;
            let impulse: Vector2<f64> = hit.impulse;
            (w * j.transpose() * impulse, hit.flags)
        }
    };
    let after = v + jump;
    let left = corner(-1.0) * after;
    let found = Found::figure((after.z - housner()).abs());
    let note = if flags.is_empty() { String::new() } else { flags.to_string() };
    Ok(found.noting(note).must_be("the first corner lifts off", left.y > 0.0))
}

/// A block without friction whose two lower edges are at the height of its centre of mass, at the distance √(I/m): an impact on one does
/// not move the other, and each bounces like a ball of its own. Both edges are about 0.1 mm above the floor at the start, so that the turn
/// of at most 1e-4 rad couples them by 1e-8. The lower one rests √(2h/g) (1 + e)/(1 − e) after its start, while the other bounces on.
pub fn chatter_of_two(method: &str) -> Judged {
    let (e, arm, heights) = (0.5, 0.5, [1e-4_f64, 1.21e-4]);
    let half = [arm, 0.1, 0.05];
    let shape = format!(r#"<origin xyz="0 0 {}"/>{}"#, half[2], cuboid(half));
    let sim = scene(method, chain(&body("block", [1.0, arm * arm], &shape))?, Some(rule(method, e, 0.0)), None)?;
    let [low, high] = heights;
    let moved = sim.run(&[0.0, (low + high) / 2.0, (high - low) / (2.0 * arm)], &[0.0; 3], 0.03).map_err(said)?;
    let expected = heights.map(|height| (2.0 * height / G).sqrt() * (1.0 + e) / (1.0 - e));
    let ends = |event: &&carom_sim::Event| matches!(event.kind, EventKind::Zeno { .. });
    let mut times: Vec<f64> = moved.events.iter().filter(ends).map(|event| event.time).collect();
    times.dedup();
    let error = times.iter().zip(expected).map(|(time, expected)| (time - expected).abs()).fold(0.0, worse);
    let last = &moved.summary.last.q;
    let found =
        Found::figure(error).must("error of the pose at rest, m and rad", worse(last[1].abs(), last[2].abs()), 1e-9);
    judged(method, found.must_be("two accumulations of impacts", times.len() == 2), &moved)
}
