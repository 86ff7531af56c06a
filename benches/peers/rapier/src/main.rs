//! The scenes in rapier: impulse joints and multibodies, with its defaults and without predictive contacts.
//!
//! `carom-peers-rapier SCENES.json OUT.jsonl CPU [REPEATS] [BUDGET]`; the format is described in `benches/peers/README.md`.

use rapier3d_f64::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use std::fs::OpenOptions;
use std::io::Write;
use std::time::Instant;

const STEPS: [f64; 6] = [5e-3, 1e-3, 2.5e-4, 1e-4, 2.5e-5, 1e-5];

#[derive(Deserialize)]
struct Scene {
    name: String,
    floating: bool,
    tip_radius: f64,
    duration: f64,
    gravity: [f64; 3],
    q: Vec<f64>,
    qd: Vec<f64>,
    restitution: f64,
    friction: f64,
    plane: Option<Plane>,
    surfaces: Vec<Value>,
    chain: Option<Hinges>,
    body: Option<Ball>,
}

#[derive(Deserialize)]
struct Plane {
    point: [f64; 3],
    normal: [f64; 3],
}

#[derive(Deserialize)]
struct Ball {
    mass: f64,
    inertia: [f64; 3],
}

#[derive(Deserialize)]
struct Hinges {
    links: Vec<Link>,
    tip: Tip,
}

#[derive(Deserialize)]
struct Tip {
    link: usize,
    at: [f64; 3],
}

#[derive(Deserialize)]
struct Link {
    parent: i64,
    turn: [[f64; 3]; 3],
    shift: [f64; 3],
    axis: [f64; 3],
    mass: f64,
    centre: [f64; 3],
    inertia: [[f64; 3]; 3],
}

#[derive(Clone, Copy, PartialEq)]
enum Joints {
    Impulse,
    Multibody,
}

struct Run<'a> {
    scene: &'a Scene,
    world: PhysicsWorld,
    bodies: Vec<RigidBodyHandle>,
    multibody: Option<MultibodyJointHandle>,
}

fn vector(v: [f64; 3]) -> Vector {
    Vector::new(v[0], v[1], v[2])
}

impl<'a> Run<'a> {
    fn new(scene: &'a Scene, dt: f64, joints: Joints, tuned: bool) -> Result<Self, String> {
        let mut world = PhysicsWorld { gravity: vector(scene.gravity), ..Default::default() };
        world.integration_parameters.dt = dt;
        if tuned {
            let parameters = &mut world.integration_parameters;
            parameters.normalized_prediction_distance = 0.0;
            parameters.normalized_allowed_linear_error = 0.0;
            parameters.contact_recycling = false;
            parameters.max_ccd_substeps = 0;
            parameters.num_solver_iterations = 16;
        }
        let touching =
            |shape: ColliderBuilder| shape.restitution(scene.restitution).friction(scene.friction).density(0.0);
        if let Some(plane) = &scene.plane {
            let place = RigidBodyBuilder::fixed().translation(vector(plane.point));
            world.insert(
                place,
                touching(ColliderBuilder::halfspace(rapier3d_f64::na::Unit::new_unchecked(vector(plane.normal)))),
            );
        }
        for surface in scene.surfaces.iter().skip(1) {
            let number =
                |key: &str, i: usize| surface["box"][key][i].as_f64().ok_or("only boxes beyond the first surface");
            let place = Vector::new(number("centre", 0)?, number("centre", 1)?, number("centre", 2)?);
            let (x, y, z) = (number("size", 0)? / 2.0, number("size", 1)? / 2.0, number("size", 2)? / 2.0);
            world.insert(RigidBodyBuilder::fixed().translation(place), touching(ColliderBuilder::cuboid(x, y, z)));
        }
        let ball = touching(ColliderBuilder::ball(scene.tip_radius));
        let mut bodies = Vec::new();
        if let (true, Some(body)) = (scene.floating, &scene.body) {
            let properties = MassProperties::new(Vector::ZERO, body.mass, vector(body.inertia));
            let q = &scene.q;
            if q[3..] != [0.0, 0.0, 0.0, 1.0] {
                return Err("a free body that starts rotated is not supported here".into());
            }
            let (linear, angular) = scene.qd.split_at(3);
            let place = RigidBodyBuilder::dynamic()
                .translation(Vector::new(q[0], q[1], q[2]))
                .linvel(Vector::new(linear[0], linear[1], linear[2]))
                .angvel(Vector::new(angular[0], angular[1], angular[2]))
                .additional_mass_properties(properties)
                .can_sleep(false);
            bodies.push(world.insert(place, ball).0);
            return Ok(Run { scene, world, bodies, multibody: None });
        }
        let chain = scene.chain.as_ref().ok_or("neither a chain nor a free body")?;
        let base = world.insert_body(RigidBodyBuilder::fixed());
        let mut poses: Vec<(Rotation, Vector, Vector, Vector)> = Vec::new(); // turn, origin, velocity, spin
        let mut multibody = None;
        for (i, link) in chain.links.iter().enumerate() {
            if link.turn != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                return Err("a joint with a rotated frame is not supported here".into());
            }
            let (axis, shift) = (vector(link.axis), vector(link.shift));
            let above = usize::try_from(link.parent).ok();
            let (turn, origin, velocity, spin) =
                above.map_or((Rotation::IDENTITY, Vector::ZERO, Vector::ZERO, Vector::ZERO), |p| poses[p]);
            let arm = turn * shift;
            let turned = turn * Rotation::from_axis_angle(axis, scene.q[i]);
            let pose = (turned, origin + arm, velocity + spin.cross(arm), spin + turned * axis * scene.qd[i]);
            poses.push(pose);
            let inertia = link.inertia;
            let inertia = Matrix::from_cols(vector(inertia[0]), vector(inertia[1]), vector(inertia[2]));
            let properties = MassProperties::with_inertia_matrix(vector(link.centre), link.mass, inertia);
            // The velocity of a body in rapier is that of its centre of mass.
            let place = RigidBodyBuilder::dynamic()
                .pose(Pose::from_parts(pose.1, pose.0))
                .linvel(pose.2 + pose.3.cross(pose.0 * vector(link.centre)))
                .angvel(pose.3)
                .additional_mass_properties(properties)
                .can_sleep(false);
            let body = if i == chain.tip.link && !scene.surfaces.is_empty() {
                world.insert(place, ball.clone().translation(vector(chain.tip.at))).0
            } else {
                world.insert_body(place)
            };
            let parent = above.map_or(base, |p| bodies[p]);
            let hinge = RevoluteJointBuilder::new(axis).local_anchor1(shift).local_anchor2(Vector::ZERO);
            match joints {
                Joints::Impulse => {
                    world.insert_impulse_joint(parent, body, hinge);
                }
                Joints::Multibody => multibody = world.insert_multibody_joint(parent, body, hinge),
            }
            bodies.push(body);
        }
        if let Some(handle) = multibody {
            let (tree, _) = world.multibody_joints.get_mut(handle).ok_or("the multibody is gone")?;
            tree.forward_kinematics(&world.bodies, true);
            tree.damping_mut().fill(0.0);
            let skipped = tree.ndofs() - scene.q.len(); // the root's, none for a fixed one
            let mut displacement = vec![0.0; skipped];
            displacement.extend(&scene.q);
            tree.apply_displacements(&displacement);
            tree.generalized_velocity_mut().rows_mut(skipped, scene.qd.len()).copy_from_slice(&scene.qd);
            tree.forward_kinematics(&world.bodies, false);
            tree.update_rigid_bodies(&mut world.bodies, true);
        }
        Ok(Run { scene, world, bodies, multibody })
    }

    fn force(&self) -> f64 {
        let pairs = self.world.contact_pairs();
        pairs.flat_map(|pair| pair.solver_manifolds()).flat_map(|it| &it.points).map(|point| point.data.impulse).sum()
    }

    fn state(&self) -> Value {
        let bodies: Vec<&RigidBody> = self.bodies.iter().map(|&it| &self.world.bodies[it]).collect();
        let Some(chain) = &self.scene.chain else {
            let (turn, at) = (body_turn(bodies[0]), bodies[0].translation());
            let (velocity, spin) = (bodies[0].linvel(), bodies[0].angvel());
            let kinetic = bodies[0].kinetic_energy();
            let (v, w) = (turn.inverse() * velocity, turn.inverse() * spin);
            return json!({
                "q": [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w], "qd": [v.x, v.y, v.z, w.x, w.y, w.z],
                "tip_velocity": [velocity.x, velocity.y, velocity.z], "kinetic_energy": kinetic,
            });
        };
        let (mut q, mut qd) = (Vec::new(), Vec::new());
        for (link, body) in chain.links.iter().zip(&bodies) {
            let above = usize::try_from(link.parent).ok().map(|p| bodies[p]);
            let (turn, spin) = above.map_or((Rotation::IDENTITY, Vector::ZERO), |it| (body_turn(it), it.angvel()));
            let (relative, axis) = (turn.inverse() * body_turn(body), vector(link.axis));
            let sine = Vector::new(relative.x, relative.y, relative.z).dot(axis);
            let angle = 2.0 * sine.atan2(relative.w);
            q.push((angle + std::f64::consts::PI).rem_euclid(2.0 * std::f64::consts::PI) - std::f64::consts::PI);
            qd.push((body.angvel() - spin).dot(body_turn(body) * axis));
        }
        if let Some((tree, _)) = self.multibody.and_then(|handle| self.world.multibody_joints.get(handle)) {
            // The velocities of the bodies do not contain the restitution yet; those of the joints do.
            qd = tree.generalized_velocity().iter().skip(tree.ndofs() - q.len()).copied().collect();
        }
        // Velocities and energy computed from the joint velocities, outwards.
        let (mut kinetic, mut tip, mut moved) = (0.0, Vector::ZERO, Vec::<(Vector, Vector)>::new());
        for (i, (link, body)) in chain.links.iter().zip(&bodies).enumerate() {
            let above = usize::try_from(link.parent).ok();
            let (velocity, spin) = above.map_or((Vector::ZERO, Vector::ZERO), |p| moved[p]);
            let origin = above.map_or(Vector::ZERO, |p| body_turn(bodies[p]) * vector(link.shift));
            let turn = body_turn(body);
            let (velocity, spin) = (velocity + spin.cross(origin), spin + turn * vector(link.axis) * qd[i]);
            let (centre, own) = (velocity + spin.cross(turn * vector(link.centre)), turn.inverse() * spin);
            let inertia = Matrix::from_cols(vector(link.inertia[0]), vector(link.inertia[1]), vector(link.inertia[2]));
            kinetic += 0.5 * (link.mass * centre.dot(centre) + own.dot(inertia * own));
            if i == chain.tip.link {
                tip = velocity + spin.cross(turn * vector(chain.tip.at));
            }
            moved.push((velocity, spin));
        }
        if self.multibody.is_none() {
            // Impulse joints are compliant: joint velocities are computed from the velocities of the bodies.
            let last = bodies[chain.tip.link];
            let arm = body_turn(last) * (vector(chain.tip.at) - vector(chain.links[chain.tip.link].centre));
            tip = last.linvel() + last.angvel().cross(arm);
            kinetic = bodies.iter().map(|body| body.kinetic_energy()).sum();
        }
        json!({"q": q, "qd": qd, "tip_velocity": [tip.x, tip.y, tip.z], "kinetic_energy": kinetic})
    }
}

fn body_turn(body: &RigidBody) -> Rotation {
    *body.rotation()
}

/// The state at the end of the last step of the first contact, the apexes of a free ball, and the last state.
fn watch(mut run: Run, dt: f64, steps: usize) -> Value {
    let (mut touching, mut after, mut apexes) = (None, Value::Null, Vec::new());
    let height = |run: &Run| {
        let body = &run.world.bodies[run.bodies[0]];
        (body.translation().z, body.linvel().z)
    };
    let mut before = height(&run);
    for k in 0..steps {
        run.world.step();
        if after.is_null() {
            if run.force() > 0.0 {
                let mut state = run.state();
                state["time"] = json!((k + 1) as f64 * dt);
                touching = Some(state);
            } else if let Some(state) = touching.take() {
                after = state;
            }
        }
        let now = height(&run);
        if run.scene.floating && before.1 > 0.0 && now.1 <= 0.0 {
            let share = before.1 / (before.1 - now.1);
            apexes.push(json!([(k as f64 + share) * dt, before.0 + 0.5 * before.1 * share * dt]));
        }
        before = now;
    }
    let mut last = run.state();
    last["time"] = json!(steps as f64 * dt);
    let mut result = json!({"final": last, "after_impact": after});
    if !apexes.is_empty() {
        result["apexes"] = apexes.into();
    }
    result
}

fn measure(
    scene: &Scene,
    dt: f64,
    joints: Joints,
    tuned: bool,
    repeats: usize,
    budget: f64,
) -> Result<Option<(f64, Value)>, String> {
    let steps = (scene.duration / dt).round() as usize;
    let timed = |count: usize| -> Result<f64, String> {
        let mut run = Run::new(scene, dt, joints, tuned)?;
        let begin = Instant::now();
        for _ in 0..count {
            run.world.step();
        }
        Ok(begin.elapsed().as_secs_f64())
    };
    let taste = steps.min(200);
    timed(taste)?;
    if timed(taste)? / taste as f64 * steps as f64 * (repeats + 1) as f64 > budget {
        return Ok(None);
    }
    let mut times = (0..repeats).map(|_| timed(steps)).collect::<Result<Vec<f64>, String>>()?;
    times.sort_by(f64::total_cmp);
    let result = watch(Run::new(scene, dt, joints, tuned)?, dt, steps);
    // serde_json writes numbers that are not finite as null.
    let finite = result["final"]["qd"].as_array().is_some_and(|them| them.iter().all(Value::is_number));
    if !finite { Err("the state is no longer finite".into()) } else { Ok(Some((times[repeats / 2], result))) }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, scenes, out, cpu, rest @ ..] = &args[..] else {
        return Err("usage: carom-peers-rapier SCENES.json OUT.jsonl CPU [REPEATS] [BUDGET]".into());
    };
    let repeats = rest.first().map_or(Ok(3), |it| it.parse())?;
    let budget = rest.get(1).map_or(Ok(20.0), |it| it.parse())?;
    let scenes: Vec<Scene> = serde_json::from_value(
        // In scenes without surfaces the radius of the tip does not matter.
        serde_json::from_str::<Vec<Value>>(&std::fs::read_to_string(scenes)?)?
            .into_iter()
            .map(|mut it| {
                if it["tip_radius"].is_null() {
                    it["tip_radius"] = json!(1e-6);
                }
                it
            })
            .collect(),
    )?;
    let mut file = OpenOptions::new().create(true).append(true).open(out)?;
    for scene in &scenes {
        let kinds: &[(Joints, &str)] = if scene.floating {
            &[(Joints::Impulse, "free body")]
        } else {
            &[(Joints::Impulse, "impulse joints"), (Joints::Multibody, "multibody")]
        };
        for dt in STEPS {
            for &(joints, name) in kinds {
                for tuned in [false, true] {
                    let method = format!("{name}, {}", if tuned { "no prediction" } else { "default" });
                    let settings = if tuned {
                        json!({"prediction_distance": 0, "allowed_linear_error": 0, "contact_recycling": false,
                               "max_ccd_substeps": 0, "num_solver_iterations": 16})
                    } else {
                        json!({})
                    };
                    let law = if scene.surfaces.is_empty() { None } else { Some("newton, coulomb") };
                    let mut line = json!({
                        "scene": scene.name, "method": method, "peer": "rapier", "version": "0.36.1 (f64)", "law": law,
                        "settings": settings, "knob": "dt", "value": dt, "wall_time_s": null, "result": null,
                        "machine": {"cpu": cpu, "cores": std::thread::available_parallelism()?.get(), "system": std::env::consts::OS},
                    });
                    match measure(scene, dt, joints, tuned, repeats, budget) {
                        Ok(Some((time, result))) => {
                            line["wall_time_s"] = json!(time);
                            line["result"] = result;
                        }
                        Ok(None) => {
                            eprintln!("rapier: {}, {method}: dt {dt} left out, over the budget", scene.name);
                            continue;
                        }
                        Err(why) => line["failure"] = json!(why),
                    }
                    writeln!(file, "{line}")?;
                }
            }
        }
    }
    Ok(())
}
