//! A strike that puts a ball on a target. A ball falls, an arm strikes it with a racket, and 0.75 s after the start of the arm it
//! is to be at the target. What is chosen: the pose of the arm at the start, the target of its controller, which with the pose
//! gives the approach angle and the speed of the racket, and how long the ball has fallen when the arm starts.
//!
//! Newton's method for three equations with nine unknowns takes the smallest step, J⁺ r, with the derivatives of the whole run
//! through the impact. Near the solution the error of each iteration is in proportion to the square of the one before.
//!
//! `cargo run --release --example aim`, then `rerun aim.rrd`

use carom::chain::Chain;
use carom::chain::Coordinates;
use carom::nalgebra::{DVector, Matrix3xX, Quaternion, UnitQuaternion, Vector3};
#[cfg(feature = "rerun")]
use carom::sim::Sampling;
use carom::sim::{Drive, Parameter, Pd, Plan, Scene};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/racket.toml");
/// Where the centre of the ball is to be at the end, m: 14 cm above the plate.
const TARGET: [f64; 3] = [0.7, 1.8, 0.3];
const JOINTS: [&str; 4] = ["yaw", "shoulder", "elbow", "roll"];
const GRAVITY: f64 = 9.81;
/// The position of the ball is exact to about this, m.
const ROUNDING: f64 = 1e-9;

/// The numbers that are chosen: four angles of the pose, four of the controller's target, and the time of fall, s.
type Choice = DVector<f64>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::from_file(SCENE)?;
    let mut plan = scene.plan()?;
    let targets: Vec<Parameter> = Parameter::all(&plan.simulation)
        .into_iter()
        .filter(|parameter| parameter.name().starts_with("target"))
        .collect();
    let ball = ball(&plan.simulation.chain)?;
    let first = start(&plan);
    let mut choice = first.clone();

    println!("iteration   distance from the target, m   step");
    let mut errors: Vec<f64> = Vec::new();
    for iteration in 0..20 {
        let (miss, by) = miss(&mut plan, (&choice, scene.duration), &targets, ball)?;
        errors.push(miss.norm());
        print!("{iteration:9}   {:27.3e}", miss.norm());
        if miss.norm() < ROUNDING {
            println!();
            break;
        }
        let square = (&by * by.transpose()).cholesky().ok_or("the strike does not move the ball in all directions")?;
        let step = -by.tr_mul(&square.solve(&miss));
        // A step that does not come closer, such as one with which the racket misses the ball, is halved.
        let mut length = 1.0;
        while length > 1e-3 {
            set(&mut plan, &(&choice + &step * length), ball);
            let last = plan.run(scene.duration)?.summary.last.q;
            if (position(&last, ball) - Vector3::from(TARGET)).norm() < miss.norm() {
                break;
            }
            length *= 0.5;
        }
        println!("   {:.3e}{}", step.norm() * length, if length < 1.0 { ", shortened" } else { "" });
        choice += step * length;
    }
    check(&errors)?;

    println!("\n              first   chosen");
    for (k, name) in JOINTS.iter().enumerate() {
        println!("{name:9} {:9.4}{:9.4} rad at the start", first[k], choice[k]);
        println!("{:9} {:9.4}{:9.4} rad, target of the controller", "", first[4 + k], choice[4 + k]);
    }
    println!("{:9} {:9.4}{:9.4} s of fall before the arm starts", "ball", first[8], choice[8]);
    set(&mut plan, &choice, ball);
    record(&scene, &plan)
}

/// Index of the ball in q and in qd.
fn ball(chain: &Chain) -> Result<(usize, usize), Box<dyn std::error::Error>> {
    match &chain.joint("flight")?.coordinates {
        Coordinates::Own { q, v } => Ok((q.start, v.start)),
        _ => Err("the joint flight has no coordinates of its own".into()),
    }
}

/// The choice that the scene describes.
fn start(plan: &Plan) -> Choice {
    let Drive::Pd(Pd { target, .. }) = &plan.simulation.drive else { unreachable!("the scene has PD control") };
    DVector::from_iterator(9, plan.q[..4].iter().chain(&target[..4]).copied().chain([0.0]))
}

/// The scene with this choice. The ball falls freely from rest: it starts where it is after the time of fall.
fn set(plan: &mut Plan, choice: &Choice, (q, v): (usize, usize)) {
    let fall = choice[8];
    let height = 1.1 - 0.5 * GRAVITY * fall * fall;
    plan.q[..4].copy_from_slice(&choice.as_slice()[..4]);
    (plan.q[q + 2], plan.qd[v + 2]) = (height, -GRAVITY * fall);
    if let Drive::Pd(Pd { target, .. }) = &mut plan.simulation.drive {
        target[..4].copy_from_slice(&choice.as_slice()[4..8]);
    }
}

fn position(q: &[f64], (ball, _): (usize, usize)) -> Vector3<f64> {
    Vector3::from_column_slice(&q[ball..ball + 3])
}

/// How far the ball is from the target at the end, and the derivatives of that by the choice.
fn miss(
    plan: &mut Plan,
    (choice, duration): (&Choice, f64),
    targets: &[Parameter],
    ball: (usize, usize),
) -> Result<(Vector3<f64>, Matrix3xX<f64>), Box<dyn std::error::Error>> {
    set(plan, choice, ball);
    let nv = plan.qd.len();
    let found = plan.sensitivity(duration, targets)?;
    let Some(by) = found.last_by else {
        return Err(found.broken.map_or_else(String::new, |broken| broken.reason).into());
    };
    let (q, v) = ball;
    // The displacement of the ball is along its own axes, which have turned.
    let turned = &found.last.q[q + 3..q + 7];
    let axes = UnitQuaternion::from_quaternion(Quaternion::new(turned[3], turned[0], turned[1], turned[2]));
    let column = |j: usize| axes * Vector3::from_iterator(by.view((v, j), (3, 1)).iter().copied());
    // One more second of fall: the height changes by −gτ, the velocity by −g.
    let fall = -(column(v + 2) * choice[8] + column(nv + v + 2)) * GRAVITY;
    let columns: Vec<Vector3<f64>> = (0..4).chain(2 * nv..2 * nv + 4).map(column).chain([fall]).collect();
    Ok((position(&found.last.q, ball) - Vector3::from(TARGET), Matrix3xX::from_columns(&columns)))
}

/// Each of the last iterations has twice the digits of the one before.
fn check(errors: &[f64]) -> Result<(), Box<dyn std::error::Error>> {
    let near: Vec<&f64> = errors.iter().filter(|error| **error < 0.02).collect();
    let quadratic = near.windows(2).all(|pair| *pair[1] < (5.0 * pair[0] * pair[0]).max(ROUNDING));
    if near.len() < 3 || !quadratic || errors.last().is_none_or(|last| *last >= ROUNDING) {
        return Err(format!("the iterations do not converge quadratically: {errors:?}").into());
    }
    Ok(())
}

#[cfg(feature = "rerun")]
fn record(scene: &Scene, plan: &Plan) -> Result<(), Box<dyn std::error::Error>> {
    use carom::record::{SceneRecorder, Target};
    let path = std::path::PathBuf::from("aim.rrd");
    let mut recorder = SceneRecorder::begin(&Target::File(path.clone()), scene, plan)?;
    let sampling = Sampling { every: Some(0.005), ..Sampling::default() };
    let run = plan.stream(scene.duration, sampling, &mut |seen| recorder.see(seen))?;
    recorder.finish(&run)?;
    println!("\nRecorded to {}: open it with `rerun {}`.", path.display(), path.display());
    Ok(())
}

#[cfg(not(feature = "rerun"))]
fn record(_: &Scene, _: &Plan) -> Result<(), Box<dyn std::error::Error>> {
    println!("\nBuilt without the feature `rerun`: no recording.");
    Ok(())
}
