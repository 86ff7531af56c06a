//! Surfaces, laws and simulations.

use crate::build::{Part, Z, brick, chain};
use crate::files::{Folder, path, text};
use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::{Coefficients, ImpactError, ImpactOutcome, ImpactProblem, Law, Newton};
use carom_sim::{ContactLaw, ContactRule, Scene, SimError, Simulation, Surface, Touch, Trajectory};
use nalgebra::{Matrix2, Vector2, Vector3};

/// Gravity, m/s².
pub const G: f64 = 9.81;
/// Gravity along −z.
pub const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -G);

/// A half-space by a point on its surface and the normal.
pub fn half_space(point: impl Into<Vector3<f64>>, normal: impl Into<Vector3<f64>>) -> Obstacle {
    Obstacle::half_space(point.into(), normal.into()).expect("a half-space")
}

/// The half-space below z = 0.
pub fn level() -> Obstacle {
    half_space([0.0; 3], Vector3::z())
}

/// A law by its name, of which a coefficient that is not given is 0.
pub fn rule(law: &str, restitution: f64, friction: f64) -> ContactRule {
    let coefficients = Coefficients { restitution, friction, ..Coefficients::default() };
    ContactRule::new(ContactLaw::named(law, coefficients).expect("a law of this name"))
}

/// Newton's law.
pub fn newton(restitution: f64, friction: f64) -> ContactRule {
    ContactRule::new(Newton { restitution, friction })
}

/// A law that is not of the library.
#[derive(Debug)]
pub struct UsersLaw<F> {
    name: &'static str,
    resolve: F,
}

/// A law with this name and this outcome.
pub fn users_law<F>(name: &'static str, resolve: F) -> UsersLaw<F>
where
    F: Fn(&ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError>,
{
    UsersLaw { name, resolve }
}

impl<F> Law<f64, 3> for UsersLaw<F>
where
    F: Fn(&ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError>,
{
    fn name(&self) -> &'static str {
        self.name
    }

    fn resolve(&self, problem: &ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError> {
        (self.resolve)(problem)
    }
}

/// A surface at rest.
pub fn surface(name: &str, obstacle: Obstacle, contact: ContactRule) -> Surface {
    Surface { name: name.into(), obstacle, contact, motion: None }
}

/// The surface z = 0, by the name `floor`.
pub fn floor(contact: ContactRule) -> Surface {
    surface("floor", level(), contact)
}

/// The contacts of the links with the surfaces, without joint limits.
#[track_caller]
pub fn touching(chain: &Chain, surfaces: &[Surface]) -> Vec<Touch> {
    let touches = Touch::all(chain, surfaces, 0.0).unwrap().touches;
    touches.into_iter().filter(|touch| touch.link().is_some()).collect()
}

/// A chain among surfaces under gravity along −z, without joint limits.
#[track_caller]
pub fn among(chain: Chain, surfaces: &[Surface]) -> Simulation {
    let touches = touching(&chain, surfaces);
    Simulation { gravity: DOWN, ..Simulation::new(chain, touches) }
}

/// As [`among`] with half-spaces, each by a point and a normal, and a tolerance of 1e-11.
#[track_caller]
pub fn among_planes(chain: Chain, planes: &[[Vector3<f64>; 2]], contact: &ContactRule) -> Simulation {
    let plane = |(k, [point, normal]): (usize, &[Vector3<f64>; 2])| {
        surface(&format!("plane {k}"), half_space(*point, *normal), contact.clone())
    };
    let surfaces: Vec<Surface> = planes.iter().enumerate().map(plane).collect();
    Simulation { tolerance: 1e-11, ..among(chain, &surfaces) }
}

/// As [`among`] with the surface z = 0.
#[track_caller]
pub fn on_floor(chain: Chain, contact: ContactRule) -> Simulation {
    among(chain, &[floor(contact)])
}

/// A box of 2 kg and 0.2 m on a vertical guide: all its corners strike the floor at the same time.
#[track_caller]
pub fn guided_box(contact: ContactRule) -> Simulation {
    on_floor(chain(&[Part::slider("box", "base", Z).weighing(2.0, [1.0; 3]).shaped(&brick([0.2; 3]))]), contact)
}

/// A start of the paper's arm, `planar2`: q, and the q̇ with which its tip moves along +x and −y, at 45° towards a wall.
#[track_caller]
pub fn towards_wall(arm: &Chain, speed: f64) -> ([f64; 2], [f64; 2]) {
    let q = [45_f64.to_radians(), -90_f64.to_radians()];
    let mut workspace = arm.workspace();
    let tip = arm.point(arm.frame("tip").unwrap(), Vector3::zeros());
    let j = workspace.update(arm, &q).unwrap().point_jacobian(tip);
    let u = Vector2::new(speed, -speed) * 0.5_f64.sqrt();
    (q, Matrix2::from_fn(|a, b| j[(a, b)]).lu().solve(&u).unwrap().into())
}

/// The names of the events of a run.
pub fn kinds(run: &Trajectory) -> Vec<&'static str> {
    run.events.iter().map(|event| event.kind.name()).collect()
}

/// A scene of the repository.
#[track_caller]
pub fn shipped(name: &str) -> Scene {
    Scene::from_file(path(&format!("scenes/{name}.toml"))).unwrap()
}

/// A scene of the repository with some of its text replaced.
#[track_caller]
pub fn changed(name: &str, changes: &[(&str, &str)]) -> Scene {
    let mut scene = text(&format!("scenes/{name}.toml"));
    for (old, new) in changes {
        assert!(scene.contains(old), "{name}: {old}");
        scene = scene.replace(old, new);
    }
    Scene::from_toml(&scene, path("scenes")).unwrap()
}

/// Reads the scene of a text, with the files that it names, each by its name and text.
pub fn scene(files: &[(&str, &str)], text: &str) -> Result<Scene, SimError> {
    let folder = Folder::new();
    for (name, text) in files {
        folder.write(name, text);
    }
    Scene::from_file(folder.write("scene.toml", text))
}

/// Reads the scene of a text whose robots are those of the repository, by their file names.
pub fn with_robots(text: &str) -> Result<Scene, SimError> {
    Scene::from_toml(text, path("robots"))
}
