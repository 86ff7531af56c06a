//! The scenes in rapier: impulse joints and multibodies, with its defaults and without predictive contacts.
//!
//! `carom-peers-rapier SCENES.json OUT.jsonl CPU [REPEATS] [BUDGET]`; the format is described in `benches/peers/README.md`.

use rapier3d_f64::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fs::OpenOptions;
use std::io::Write;
use std::time::Instant;

const STEPS: [f64; 6] = [5e-3, 1e-3, 2.5e-4, 1e-4, 2.5e-5, 1e-5];

#[derive(Deserialize)]
struct Scene {
    name: String,
    floating: bool,
    tip: String,
    shapes: Vec<Shape>,
    duration: f64,
    gravity: [f64; 3],
    q: Vec<f64>,
    qd: Vec<f64>,
    restitution: f64,
    friction: f64,
    plane: Option<Plane>,
    surfaces: Vec<Value>,
    /// Distance to the first surface at the start, m.
    #[serde(default)]
    gap: f64,
    chain: Option<Hinges>,
    body: Option<Free>,
    drive: Option<Drive>,
}

/// A shape that can touch, in the axes of its link.
#[derive(Deserialize)]
struct Shape {
    link: String,
    kind: String,
    size: Vec<f64>,
    at: [f64; 3],
    turn: [[f64; 3]; 3],
}

#[derive(Deserialize)]
struct Drive {
    kp: f64,
    kd: f64,
    target: Vec<f64>,
    effort: Vec<f64>,
}

#[derive(Deserialize)]
struct Plane {
    point: [f64; 3],
    normal: [f64; 3],
}

#[derive(Deserialize)]
struct Free {
    mass: f64,
    inertia: [f64; 3],
}

#[derive(Deserialize)]
struct Hinges {
    links: Vec<Link>,
    places: HashMap<String, Place>,
}

/// The moving link that carries a link of the file, -1 for the base, and the pose there.
#[derive(Deserialize)]
struct Place {
    link: i64,
    turn: [[f64; 3]; 3],
    shift: [f64; 3],
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
    limits: Option<[f64; 2]>,
}

#[derive(Clone, Copy, PartialEq)]
enum Joints {
    Impulse,
    Multibody,
}

struct Run<'a> {
    scene: &'a Scene,
    world: PhysicsWorld,
    /// The free base of a robot.
    base: Option<RigidBodyHandle>,
    bodies: Vec<RigidBodyHandle>,
    multibody: Option<MultibodyJointHandle>,
}

fn vector(v: [f64; 3]) -> Vector {
    Vector::new(v[0], v[1], v[2])
}

/// The rotation of a matrix given by rows.
fn rotation(rows: [[f64; 3]; 3]) -> Rotation {
    let column = |k: usize| Vector::new(rows[0][k], rows[1][k], rows[2][k]);
    Rotation::from_mat3(&Matrix::from_cols(column(0), column(1), column(2)))
}

impl Scene {
    /// The colliders that a moving link carries, -1 for the base.
    fn colliders(&self, body: i64) -> Result<Vec<ColliderBuilder>, String> {
        let mut found = Vec::new();
        for shape in &self.shapes {
            let place = self.chain.as_ref().and_then(|chain| chain.places.get(&shape.link));
            if place.map_or(-1, |it| it.link) != body {
                continue;
            }
            let (mut turn, mut at) = (rotation(shape.turn), vector(shape.at));
            if let Some(place) = place {
                let outer = rotation(place.turn);
                (turn, at) = (outer * turn, vector(place.shift) + outer * at);
            }
            let made = match (shape.kind.as_str(), &shape.size[..]) {
                ("sphere", &[radius]) => ColliderBuilder::ball(radius),
                ("box", &[x, y, z]) => ColliderBuilder::cuboid(x / 2.0, y / 2.0, z / 2.0),
                ("cylinder", &[radius, length]) => {
                    // Along y here, along z in URDF.
                    turn *= Rotation::from_axis_angle(Vector::new(1.0, 0.0, 0.0), std::f64::consts::FRAC_PI_2);
                    ColliderBuilder::cylinder(length / 2.0, radius)
                }
                (kind, _) => return Err(format!("no shape {kind}")),
            };
            found.push(made.position(Pose::from_parts(at, turn)));
        }
        Ok(if self.surfaces.is_empty() { Vec::new() } else { found })
    }
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
        // Only surfaces and robot touch.
        let groups = |own, others| InteractionGroups::new(own, others, InteractionTestMode::And);
        let ground = groups(Group::GROUP_1, Group::GROUP_2);
        for (k, surface) in scene.surfaces.iter().enumerate() {
            let (place, shape) = match &scene.plane {
                Some(plane) if k == 0 && (surface.get("box").is_none() || scene.shapes.len() == 1) => {
                    let normal = rapier3d_f64::na::Unit::new_unchecked(vector(plane.normal));
                    (vector(plane.point), ColliderBuilder::halfspace(normal))
                }
                _ => {
                    let number = |key: &str, i: usize| {
                        surface["box"][key][i].as_f64().ok_or("a surface is neither a plane nor a box")
                    };
                    let place = Vector::new(number("centre", 0)?, number("centre", 1)?, number("centre", 2)?);
                    let (x, y, z) = (number("size", 0)? / 2.0, number("size", 1)? / 2.0, number("size", 2)? / 2.0);
                    (place, ColliderBuilder::cuboid(x, y, z))
                }
            };
            world.insert(RigidBodyBuilder::fixed().translation(place), touching(shape).collision_groups(ground));
        }
        let add = |world: &mut PhysicsWorld, place: RigidBodyBuilder, body: i64| -> Result<RigidBodyHandle, String> {
            let handle = world.insert_body(place);
            for shape in scene.colliders(body)? {
                let shape = touching(shape).collision_groups(groups(Group::GROUP_2, Group::GROUP_1));
                world.insert_collider(shape, Some(handle));
            }
            Ok(handle)
        };
        let mut bodies = Vec::new();
        let (mut q, mut qd, mut free) = (&scene.q[..], &scene.qd[..], None);
        if let (true, Some(body)) = (scene.floating, &scene.body) {
            let turn = Rotation::from_xyzw(q[3], q[4], q[5], q[6]);
            let place = RigidBodyBuilder::dynamic()
                .pose(Pose::from_parts(Vector::new(q[0], q[1], q[2]), turn))
                .linvel(turn * Vector::new(qd[0], qd[1], qd[2]))
                .angvel(turn * Vector::new(qd[3], qd[4], qd[5]))
                .additional_mass_properties(MassProperties::new(Vector::ZERO, body.mass, vector(body.inertia)))
                .can_sleep(false);
            let handle = add(&mut world, place, -1)?;
            if scene.chain.is_none() {
                return Ok(Run { scene, world, base: None, bodies: vec![handle], multibody: None });
            }
            if qd.iter().any(|it| *it != 0.0) {
                return Err("a robot on a free base starts at rest here".into());
            }
            free = Some(handle);
            (q, qd) = (&q[7..], &qd[6..]);
        }
        let chain = scene.chain.as_ref().ok_or("neither a chain nor a free body")?;
        let base = free.unwrap_or_else(|| world.insert_body(RigidBodyBuilder::fixed()));
        let root = world.bodies[base].position();
        let rest = (root.rotation, root.translation, Vector::ZERO, Vector::ZERO);
        let mut poses: Vec<(Rotation, Vector, Vector, Vector)> = Vec::new(); // turn, origin, velocity, spin
        let mut multibody = None;
        for (i, link) in chain.links.iter().enumerate() {
            if link.turn != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                return Err("a joint with a rotated frame is not supported here".into());
            }
            let (axis, shift) = (vector(link.axis), vector(link.shift));
            let above = usize::try_from(link.parent).ok();
            let (turn, origin, velocity, spin) = above.map_or(rest, |p| poses[p]);
            let arm = turn * shift;
            let turned = turn * Rotation::from_axis_angle(axis, q[i]);
            let pose = (turned, origin + arm, velocity + spin.cross(arm), spin + turned * axis * qd[i]);
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
            let body = add(&mut world, place, i as i64)?;
            let parent = above.map_or(base, |p| bodies[p]);
            let mut hinge = RevoluteJointBuilder::new(axis).local_anchor1(shift).local_anchor2(Vector::ZERO);
            if let Some(limits) = link.limits {
                hinge = hinge.limits(limits);
            }
            if let Some(drive) = &scene.drive {
                hinge = hinge.motor_model(MotorModel::ForceBased).motor_position(drive.target[i], drive.kp, drive.kd);
                hinge = hinge.motor_max_force(drive.effort[i]);
            }
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
            let skipped = tree.ndofs() - q.len(); // the root's, none for a fixed one
            let mut displacement = vec![0.0; skipped];
            displacement.extend(q);
            tree.apply_displacements(&displacement);
            tree.generalized_velocity_mut().rows_mut(skipped, qd.len()).copy_from_slice(qd);
            tree.forward_kinematics(&world.bodies, false);
            tree.update_rigid_bodies(&mut world.bodies, true);
        }
        Ok(Run { scene, world, base: free, bodies, multibody })
    }

    fn force(&self) -> f64 {
        let pairs = self.world.contact_pairs();
        pairs.flat_map(|pair| pair.solver_manifolds()).flat_map(|it| &it.points).map(|point| point.data.impulse).sum()
    }

    fn state(&self) -> Value {
        let bodies: Vec<&RigidBody> = self.bodies.iter().map(|&it| &self.world.bodies[it]).collect();
        let free = |body: &RigidBody| {
            let (turn, at) = (body_turn(body), body.translation());
            let (v, w) = (turn.inverse() * body.linvel(), turn.inverse() * body.angvel());
            (vec![at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w], vec![v.x, v.y, v.z, w.x, w.y, w.z])
        };
        let Some(chain) = &self.scene.chain else {
            let ((q, qd), velocity) = (free(bodies[0]), bodies[0].linvel());
            return json!({
                "q": q, "qd": qd, "tip_velocity": [velocity.x, velocity.y, velocity.z],
                "kinetic_energy": bodies[0].kinetic_energy(),
            });
        };
        let base = self.base.map(|it| &self.world.bodies[it]);
        let (mut q, mut qd) = (Vec::new(), Vec::new());
        for (link, body) in chain.links.iter().zip(&bodies) {
            let above = usize::try_from(link.parent).ok().map(|p| bodies[p]);
            let above = above.or(base);
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
        if let Some(base) = base {
            let (mut whole, mut rates) = free(base);
            whole.extend(q);
            rates.extend(qd);
            return json!({"q": whole, "qd": rates});
        }
        // Velocities and energy computed from the joint velocities, outwards.
        let place = chain.places.get(&self.scene.tip);
        let (carrier, at) = place.map_or((-1, Vector::ZERO), |it| (it.link, vector(it.shift)));
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
            if i as i64 == carrier {
                tip = velocity + spin.cross(turn * at);
            }
            moved.push((velocity, spin));
        }
        if let (None, Ok(carrier)) = (self.multibody, usize::try_from(carrier)) {
            // Impulse joints are compliant: joint velocities are computed from the velocities of the bodies.
            let last = bodies[carrier];
            let arm = body_turn(last) * (at - vector(chain.links[carrier].centre));
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
    // A contact that is closed at the start is no impact, and one without restitution does not end.
    let lasting = !run.scene.surfaces.is_empty() && (run.scene.gap == 0.0 || run.scene.restitution == 0.0);
    for k in 0..steps {
        run.world.step();
        if after.is_null() && !lasting {
            if run.force() > 0.0 {
                let mut state = run.state();
                state["time"] = json!((k + 1) as f64 * dt);
                touching = Some(state);
            } else if let Some(state) = touching.take() {
                after = state;
            }
        }
        let now = height(&run);
        if run.scene.floating && run.base.is_none() && before.1 > 0.0 && now.1 <= 0.0 {
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
    let scenes: Vec<Scene> = serde_json::from_str(&std::fs::read_to_string(scenes)?)?;
    let mut file = OpenOptions::new().create(true).append(true).open(out)?;
    for scene in &scenes {
        let kinds: &[(Joints, &str)] = if scene.chain.is_none() {
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
