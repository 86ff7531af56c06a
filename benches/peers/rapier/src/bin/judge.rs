//! Adapter of the judge (`benches/peers/judge`) for rapier: one request for each line of standard input, one answer for each line.

use rapier3d_f64::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::io::{BufRead, Write};

#[derive(Deserialize)]
struct Request {
    id: Value,
    #[serde(default)]
    about: bool,
    #[serde(default)]
    settings: String,
    scene: Option<Scene>,
    #[serde(default)]
    times: Vec<f64>,
    step: Option<f64>,
}

#[derive(Deserialize)]
struct Scene {
    gravity: [f64; 3],
    bodies: Vec<Body>,
    planes: Vec<Plane>,
    pairs: Vec<[String; 2]>,
    contact: Contact,
    start: Start,
}

#[derive(Deserialize)]
struct Contact {
    restitution: f64,
    friction: f64,
    #[serde(default)]
    limit_restitution: f64,
}

#[derive(Deserialize)]
struct Start {
    q: Vec<f64>,
    qd: Vec<f64>,
}

#[derive(Deserialize)]
struct Plane {
    point: [f64; 3],
    normal: [f64; 3],
}

#[derive(Deserialize)]
struct Body {
    name: String,
    parent: Option<String>,
    joint: String,
    #[serde(default)]
    at: [f64; 3],
    #[serde(default)]
    axis: [f64; 3],
    limits: Option<[f64; 2]>,
    mass: f64,
    #[serde(default)]
    centre: [f64; 3],
    inertia: [f64; 3],
    #[serde(default)]
    shapes: Vec<Shape>,
}

#[derive(Deserialize)]
struct Shape {
    sphere: Option<f64>,
    #[serde(rename = "box")]
    cuboid: Option<[f64; 3]>,
    #[serde(default)]
    at: [f64; 3],
}

const STEP: [f64; 2] = [1.0 / 60.0, 1e-4];

fn about() -> Value {
    json!({"engine": "rapier", "version": "0.36.1 (f64)", "law": "Newton's e for each contact, Coulomb", "settings": {
        "default": {"method": "step 1/60 s, impulse joints, restitution and friction set, all else default",
                    "source": "documentation of rapier3d, IntegrationParameters"},
        "best": {"method": "step 0.1 ms, multibody joints for chains that hang on the world, prediction distance and allowed error 0, no recycled contacts, no CCD, 16 iterations",
                 "source": "documentation of rapier3d, IntegrationParameters"}}})
}

fn vector(v: [f64; 3]) -> Vector {
    Vector::new(v[0], v[1], v[2])
}

struct Run<'a> {
    scene: &'a Scene,
    world: PhysicsWorld,
    bodies: Vec<RigidBodyHandle>,
    above: Vec<Option<usize>>,
    /// The chain in reduced coordinates, if there is one.
    multibody: Option<MultibodyJointHandle>,
}

impl<'a> Run<'a> {
    fn new(scene: &'a Scene, step: f64, best: bool) -> Result<Self, String> {
        let mut world = PhysicsWorld { gravity: vector(scene.gravity), ..Default::default() };
        let parameters = &mut world.integration_parameters;
        parameters.dt = step;
        if best {
            parameters.normalized_prediction_distance = 0.0;
            parameters.normalized_allowed_linear_error = 0.0;
            parameters.contact_recycling = false;
            parameters.max_ccd_substeps = 0;
            parameters.num_solver_iterations = 16;
        }
        let contact = &scene.contact;
        // The planes are in group 1, the bodies in groups of their own, as far as they have shapes.
        let group = |k: usize| Group::from_bits_truncate(1 << k);
        let mut groups = HashMap::new();
        for body in scene.bodies.iter().filter(|body| !body.shapes.is_empty()) {
            groups.insert(&body.name, groups.len() + 1);
        }
        let touching = |shape: ColliderBuilder, own: Group, others: Group| {
            let rule = InteractionGroups::new(own, others, InteractionTestMode::And);
            shape.restitution(contact.restitution).friction(contact.friction).density(0.0).collision_groups(rule)
        };
        for plane in &scene.planes {
            let normal = rapier3d_f64::na::Unit::new_unchecked(vector(plane.normal));
            let place = RigidBodyBuilder::fixed().translation(vector(plane.point));
            world.insert(place, touching(ColliderBuilder::halfspace(normal), group(0), Group::ALL));
        }
        let base = world.insert_body(RigidBodyBuilder::fixed());
        let (mut bodies, mut above): (Vec<RigidBodyHandle>, Vec<Option<usize>>) = Default::default();
        let mut poses: Vec<(Rotation, Vector, Vector, Vector)> = Vec::new(); // rotation, origin, velocity, angular velocity
        let (mut q, mut qd) = (&scene.start.q[..], &scene.start.qd[..]);
        let reduced = best && scene.bodies.iter().all(|body| body.joint == "hinge");
        let mut multibody = None;
        for body in &scene.bodies {
            let parent = body.parent.as_ref().and_then(|name| scene.bodies.iter().position(|it| &it.name == name));
            let pose = match body.joint.as_str() {
                "free" => {
                    let pose = (
                        Rotation::from_xyzw(q[3], q[4], q[5], q[6]),
                        Vector::new(q[0], q[1], q[2]),
                        Vector::new(qd[0], qd[1], qd[2]),
                        Vector::new(qd[3], qd[4], qd[5]),
                    );
                    (q, qd) = (&q[7..], &qd[6..]);
                    pose
                }
                "hinge" => {
                    let rest = (Rotation::IDENTITY, Vector::ZERO, Vector::ZERO, Vector::ZERO);
                    let (turn, origin, velocity, spin) = parent.map_or(rest, |p| poses[p]);
                    let (axis, arm) = (vector(body.axis), turn * vector(body.at));
                    let turned = turn * Rotation::from_axis_angle(axis, q[0]);
                    let pose = (turned, origin + arm, velocity + spin.cross(arm), spin + turned * axis * qd[0]);
                    (q, qd) = (&q[1..], &qd[1..]);
                    pose
                }
                other => return Err(format!("joint type {other} is not in this adapter")),
            };
            poses.push(pose);
            let properties = MassProperties::new(vector(body.centre), body.mass, vector(body.inertia));
            // The velocity of a body in rapier is that of its centre of mass.
            let place = RigidBodyBuilder::dynamic()
                .pose(Pose::from_parts(pose.1, pose.0))
                .linvel(pose.2 + pose.3.cross(pose.0 * vector(body.centre)))
                .angvel(pose.3)
                .additional_mass_properties(properties)
                .can_sleep(false);
            let handle = world.insert_body(place);
            let partners = scene.pairs.iter().fold(group(0), |all, [a, b]| match (&body.name == a, &body.name == b) {
                (true, _) => all | group(groups[b]),
                (_, true) => all | group(groups[a]),
                _ => all,
            });
            for shape in &body.shapes {
                let made = match (shape.sphere, shape.cuboid) {
                    (Some(radius), _) => ColliderBuilder::ball(radius),
                    (_, Some(size)) => ColliderBuilder::cuboid(size[0] / 2.0, size[1] / 2.0, size[2] / 2.0),
                    _ => return Err("a shape is neither a sphere nor a box".into()),
                };
                let collider = touching(made.translation(vector(shape.at)), group(groups[&body.name]), partners);
                world.insert_collider(collider, Some(handle));
            }
            if body.joint == "hinge" {
                let mut hinge = RevoluteJointBuilder::new(vector(body.axis))
                    .local_anchor1(vector(body.at))
                    .local_anchor2(Vector::ZERO);
                if let Some(limits) = body.limits {
                    hinge = hinge.limits(limits);
                }
                let parent = parent.map_or(base, |p| bodies[p]);
                if reduced {
                    multibody = world.insert_multibody_joint(parent, handle, hinge);
                } else {
                    world.insert_impulse_joint(parent, handle, hinge);
                }
            }
            bodies.push(handle);
            above.push(parent);
        }
        if let Some(handle) = multibody {
            let (tree, _) = world.multibody_joints.get_mut(handle).ok_or("the multibody is gone")?;
            tree.forward_kinematics(&world.bodies, true);
            tree.damping_mut().fill(0.0);
            let skipped = tree.ndofs() - scene.start.q.len(); // the root's, none for a fixed one
            let mut displacement = vec![0.0; skipped];
            displacement.extend(&scene.start.q);
            tree.apply_displacements(&displacement);
            let rates = &scene.start.qd;
            tree.generalized_velocity_mut().rows_mut(skipped, rates.len()).copy_from_slice(rates);
            tree.forward_kinematics(&world.bodies, false);
            tree.update_rigid_bodies(&mut world.bodies, true);
        }
        Ok(Run { scene, world, bodies, above, multibody })
    }

    fn state(&self, time: f64) -> Value {
        let (mut q, mut qd) = (Vec::new(), Vec::new());
        for ((body, handle), above) in self.scene.bodies.iter().zip(&self.bodies).zip(&self.above) {
            let now = &self.world.bodies[*handle];
            let (turn, spin, at, velocity) = (*now.rotation(), now.angvel(), now.translation(), now.linvel());
            if body.joint == "free" {
                q.extend([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]);
                qd.extend([velocity.x, velocity.y, velocity.z, spin.x, spin.y, spin.z]);
                continue;
            }
            let (above_turn, above_spin) = above.map_or((Rotation::IDENTITY, Vector::ZERO), |p| {
                let it = &self.world.bodies[self.bodies[p]];
                (*it.rotation(), it.angvel())
            });
            let (relative, axis) = (above_turn.inverse() * turn, vector(body.axis));
            let angle = 2.0 * Vector::new(relative.x, relative.y, relative.z).dot(axis).atan2(relative.w);
            q.push((angle + std::f64::consts::PI).rem_euclid(2.0 * std::f64::consts::PI) - std::f64::consts::PI);
            qd.push((spin - above_spin).dot(turn * axis));
        }
        if let Some((tree, _)) = self.multibody.and_then(|handle| self.world.multibody_joints.get(handle)) {
            // The velocities of the bodies do not contain the restitution yet; those of the joints do.
            qd = tree.generalized_velocity().iter().skip(tree.ndofs() - q.len()).copied().collect();
        }
        json!({"t": time, "q": q, "qd": qd})
    }
}

fn answer(request: &Request) -> Value {
    if request.about {
        return about();
    }
    let Some(scene) = &request.scene else { return json!({"failed": "the request has no scene"}) };
    if scene.contact.limit_restitution > 0.0 && scene.bodies.iter().any(|body| body.limits.is_some()) {
        return json!({"refused": "joint limits have no coefficient of restitution"});
    }
    let best = request.settings == "best";
    let step = request.step.unwrap_or(STEP[usize::from(best)]);
    let mut run = match Run::new(scene, step, best) {
        Ok(run) => run,
        Err(why) => return json!({"refused": why}),
    };
    let (mut states, mut made) = (Vec::new(), 0);
    for time in &request.times {
        let count = (time / step).round() as usize;
        for _ in made..count {
            run.world.step();
        }
        made = made.max(count);
        states.push(run.state(made as f64 * step));
    }
    // serde_json writes numbers that are not finite as null.
    let finite = |state: &Value| {
        ["q", "qd"].iter().all(|key| state[key].as_array().is_some_and(|it| it.iter().all(Value::is_number)))
    };
    if states.iter().all(finite) {
        json!({"states": states, "used": {"step": step}})
    } else {
        json!({"failed": "the state is no longer finite"})
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for line in std::io::stdin().lock().lines() {
        let request: Request = serde_json::from_str(&line?)?;
        let mut reply = answer(&request);
        reply["id"] = request.id.clone();
        println!("{reply}");
        std::io::stdout().flush()?;
    }
    Ok(())
}
