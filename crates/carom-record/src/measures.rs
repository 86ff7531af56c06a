//! The time series of a recording: values and names.

use crate::RecordError;
use crate::rerun;
use crate::rerun::components::AggregationPolicy;
use crate::target::Sink;
use carom_chain::algebra::z_onto;
use carom_chain::{Chain, Coordinates, Kinematics, Plane, Point, Spatial};
use carom_contact::{LinkShape, Obstacle, Surface as Form, gap};
use carom_sim::{JointImpulse, Scene, Simulation, Surface};
use nalgebra::Vector3;

/// Colours of the lines, in turn.
const LINES: [u32; 8] =
    [0x4e9b_e8ff, 0xf28e_2bff, 0x59c1_7aff, 0xe157_59ff, 0xb07a_a1ff, 0xedc9_48ff, 0x76b7_b2ff, 0xff9d_a7ff];

pub(crate) const POSITION: &str = "series/position";
pub(crate) const VELOCITY: &str = "series/velocity";
pub(crate) const TIP: &str = "series/tip";
pub(crate) const ENERGY: &str = "series/energy";
pub(crate) const GAP: &str = "series/gap";
pub(crate) const MOTOR: &str = "series/motor";
/// Decimal logarithms of the estimated errors of q and of q̇.
pub(crate) const ERROR: [&str; 2] = ["series/error/position", "series/error/velocity"];
/// Magnitudes of the impulses through joints, and of their moments.
pub(crate) const THROUGH: [&str; 2] = ["series/through/force", "series/through/moment"];

/// The tip, whose velocity is shown.
pub(crate) struct Tip {
    pub point: Point<Spatial<f64>>,
    /// Components of its velocity: name and direction.
    axes: Vec<(&'static str, Vector3<f64>)>,
}

/// The values that are computed from each state of a chain.
pub(crate) struct Measures {
    gravity: Vector3<f64>,
    pub tip: Option<Tip>,
    /// Pairs that may touch: the shape of a link and the index of the surface.
    pairs: Vec<(LinkShape, usize)>,
    pub surfaces: Vec<Surface>,
}

impl Measures {
    pub fn of(
        scene: &Scene,
        sim: &Simulation,
        shapes: &[LinkShape],
        plane: Option<&Plane>,
    ) -> Result<Self, RecordError> {
        let tip = match &scene.tip {
            Some(tip) => Some(Tip {
                point: sim.chain.point(sim.chain.frame(tip)?, Vector3::zeros()),
                axes: axes(&scene.surfaces, plane),
            }),
            None => None,
        };
        let mut pairs = Vec::new();
        for shape in shapes {
            for (k, surface) in scene.surfaces.iter().enumerate() {
                let watched = |touch: &carom_sim::Touch| {
                    touch.link() == Some(shape.link()) && touch.surface() == Some(surface.name.as_str())
                };
                if sim.touches.iter().any(watched) {
                    pairs.push((shape.clone(), k));
                }
            }
        }
        Ok(Self { gravity: sim.gravity, tip, pairs, surfaces: scene.surfaces.clone() })
    }

    /// Whether any link may touch a surface.
    pub fn has_gaps(&self) -> bool {
        !self.pairs.is_empty()
    }

    /// Logs the names and colours of all lines.
    pub fn name(&self, sink: &Sink, chain: &Chain) -> Result<(), RecordError> {
        let [position, velocity] = coordinates(chain);
        let tip = self.tip.iter().flat_map(|tip| &tip.axes).map(|(name, _)| (*name).to_owned());
        let energy =
            if self.gravity == Vector3::zeros() { &["kinetic"][..] } else { &["total", "kinetic", "potential"] };
        let gaps = self.near().map(|k| self.surfaces[k].name.clone());
        for (entity, names) in [
            (POSITION, position),
            (VELOCITY, velocity),
            (TIP, tip.collect()),
            (ENERGY, energy.iter().map(|name| (*name).to_owned()).collect()),
            (GAP, gaps.collect()),
        ] {
            sink.fixed(entity, &lines(names))?;
        }
        Ok(())
    }

    /// Logs the names and colours of the forces of motors, by the entries of qd.
    pub fn name_motors(sink: &Sink, chain: &Chain) -> Result<(), RecordError> {
        let [_, velocity] = coordinates(chain);
        sink.fixed(MOTOR, &lines(velocity))
    }

    /// Logs the names and colours of the errors, by the entries of qd.
    pub fn name_errors(sink: &Sink, chain: &Chain) -> Result<(), RecordError> {
        let [_, velocity] = coordinates(chain);
        ERROR.iter().try_for_each(|entity| sink.fixed(*entity, &lines(velocity.clone())))
    }

    /// Logs the names and colours of the impulses through these joints, which are points.
    pub fn name_impulses(sink: &Sink, joints: &[JointImpulse]) -> Result<(), RecordError> {
        let names = joints.iter().map(|joint| joint.joint.clone());
        let style = rerun::SeriesPoints::new().with_names(names).with_colors(colours(joints.len()));
        let style = style.with_marker_sizes(vec![4.0; joints.len()]);
        THROUGH.iter().try_for_each(|entity| sink.fixed(*entity, &style))
    }

    /// Indices of the surfaces that a link may touch.
    fn near(&self) -> impl Iterator<Item = usize> {
        (0..self.surfaces.len()).filter(|k| self.pairs.iter().any(|(_, near)| near == k))
    }

    /// All values at one state: entity and numbers (rad or m, rad/s or m/s, J).
    pub fn at(
        &self,
        kin: &mut Kinematics<Spatial<f64>>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
    ) -> Result<Vec<(&'static str, Vec<f64>)>, RecordError> {
        let kinetic = kin.kinetic_energy(qd)?;
        let potential = kin.potential_energy(self.gravity);
        let energy = if self.gravity == Vector3::zeros() {
            vec![kinetic]
        } else {
            vec![kinetic + potential, kinetic, potential]
        };
        let mut values = vec![(POSITION, q.to_vec()), (VELOCITY, qd.to_vec()), (ENERGY, energy)];
        if let Some(tip) = &self.tip {
            let u = kin.point_velocity(tip.point, qd)?;
            values.push((TIP, tip.axes.iter().map(|(_, axis)| axis.dot(&u)).collect()));
        }
        if self.has_gaps() {
            let least = |surface: usize| {
                let of_surface = self.pairs.iter().filter(|(_, k)| *k == surface);
                of_surface
                    .map(|(shape, k)| self.gap(kin, shape, &self.surfaces[*k], time))
                    .fold(f64::INFINITY, f64::min)
            };
            values.push((GAP, self.near().map(least).collect()));
        }
        Ok(values)
    }

    fn gap(&self, kin: &Kinematics<Spatial<f64>>, shape: &LinkShape, surface: &Surface, time: f64) -> f64 {
        let mut pose = kin.pose(shape.frame());
        // The gap is computed in the axes of the surface, which may have moved.
        pose.translation -= surface.motion.as_ref().map_or_else(Vector3::zeros, |motion| motion.at(time)[0]);
        gap(shape, &pose, &surface.obstacle).distance
    }
}

/// Directions for the velocity of the tip: normal and tangents of the first half-space, else the axes of the plane or world.
fn axes(surfaces: &[Surface], plane: Option<&Plane>) -> Vec<(&'static str, Vector3<f64>)> {
    let normal = |obstacle: &Obstacle| match obstacle.surface() {
        Form::HalfSpace { normal, .. } => Some(*normal),
        _ => None,
    };
    match (surfaces.iter().find_map(|surface| normal(&surface.obstacle)), plane) {
        (Some(n), Some(plane)) if plane.normal.dot(&n).abs() < 1e-6 => {
            vec![("normal", n), ("tangential", plane.normal.cross(&n))]
        }
        (Some(n), _) => {
            let across = z_onto(n);
            let tangent = |k: usize| across.column(k).into_owned();
            vec![("normal", n), ("tangential 1", tangent(0)), ("tangential 2", tangent(1))]
        }
        (None, Some(plane)) => vec![("x", plane.x), ("y", plane.y)],
        (None, None) => vec![("x", Vector3::x()), ("y", Vector3::y()), ("z", Vector3::z())],
    }
}

fn colours(count: usize) -> impl Iterator<Item = u32> {
    (0..count).map(|k| LINES[k % LINES.len()])
}

/// The style of lines with these names.
fn lines(names: Vec<String>) -> rerun::SeriesLines {
    let style = rerun::SeriesLines::new().with_colors(colours(names.len())).with_widths(vec![1.8; names.len()]);
    // Without aggregation, since means over time would smooth the jumps.
    style.with_names(names).with_aggregation_policy(AggregationPolicy::Off)
}

/// Names of all entries of q and qd.
fn coordinates(chain: &Chain) -> [Vec<String>; 2] {
    let (mut q_names, mut v_names) = (vec![String::new(); chain.nq()], vec![String::new(); chain.nv()]);
    let alone = chain.joints().len() == 1;
    for joint in chain.joints() {
        let Coordinates::Own { q, v } = &joint.coordinates else { continue };
        for (names, range) in [(&mut q_names, q), (&mut v_names, v)] {
            let several: &[&str] = match range.len() {
                7 => &["x", "y", "z", "qx", "qy", "qz", "qw"],
                6 => &["vx", "vy", "vz", "wx", "wy", "wz"],
                3 => &["x", "y", "angle"],
                _ => &[],
            };
            for (k, name) in names[range.clone()].iter_mut().enumerate() {
                *name = match several.get(k) {
                    Some(axis) if alone => (*axis).to_owned(),
                    Some(axis) => format!("{} {axis}", joint.name),
                    None => joint.name.clone(),
                };
            }
        }
    }
    [q_names, v_names]
}
