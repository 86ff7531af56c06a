//! Shapes of links and surfaces: logged once; afterwards only their poses change.

use crate::RecordError;
use crate::bounds::{Bounds, quaternion, xyz};
use crate::rerun;
use crate::rerun::{EntityPath, EntityPathPart, FillMode};
use crate::target::Sink;
use carom_chain::algebra::{Pose, z_onto};
use carom_chain::urdf::{Collision, Shape, Visual};
use carom_chain::{Chain, ChainError, FrameId, Kinematics, Plane, Spatial};
use carom_contact::{ContactError, LinkShape, Mesh, Solid, Surface as Form};
use carom_sim::Surface;
use nalgebra::{Matrix3, Vector3};

/// Colours of the links, in turn.
const LINKS: [u32; 3] = [0x4e79_a7ff, 0xa0cb_e8ff, 0x7f8f_a9ff];
const BONE: u32 = 0xd0d7_e2ff;
const JOINT: u32 = 0xf2f4_f8ff;
const SURFACE: u32 = 0x8a93_a3ff;
const GRID: u32 = 0xb6bd_c9ff;

/// The entity `/world/group/name`; the name may hold any character. `all`: the names of the group.
pub(crate) fn entity<'a>(group: &str, name: &str, mut all: impl Iterator<Item = &'a str>) -> EntityPath {
    let plain = plain(name);
    let taken = plain != name && all.any(|other| other != name && self::plain(other) == plain);
    EntityPath::new(["world", group, if taken { name } else { &plain }].map(EntityPathPart::new).to_vec())
}

/// A name without spaces, which the viewer shows with a backslash before each.
pub(crate) fn plain(name: &str) -> String {
    name.replace(' ', "_")
}

/// The entity of a surface.
pub(crate) fn of_surface(surface: &Surface, all: &[Surface]) -> EntityPath {
    entity("surfaces", &surface.name, all.iter().map(|it| it.name.as_str()))
}

fn part(of: &EntityPath, name: String) -> EntityPath {
    of.join(&EntityPath::from_single_string(name))
}

/// A link whose pose is logged during the motion.
pub(crate) struct Drawn {
    pub frame: FrameId,
    pub path: EntityPath,
}

/// What is drawn of a link, in its axes.
pub(crate) struct Look {
    pub frame: FrameId,
    link: String,
    pub origin: Pose<Spatial<f64>>,
    pub body: Body,
    /// Its own colour; without it, that of the link.
    colour: Option<u32>,
}

/// A body that is drawn.
pub(crate) enum Body {
    Solid(Solid),
    Mesh(Mesh),
}

/// What is drawn of each link: its visual shapes, or its collision shapes if it has no visual shape that can be drawn. Also
/// returns a sentence for each visual mesh that cannot be read.
pub(crate) fn looks(chain: &Chain, shapes: &[LinkShape]) -> Result<(Vec<Look>, Vec<String>), RecordError> {
    let (mut looks, mut unread) = (Vec::new(), Vec::new());
    for link in chain.links() {
        let Ok(frame) = chain.frame(&link.name) else { continue };
        let before = looks.len();
        for visual in &link.visuals {
            match look(&link.name, frame, visual) {
                Ok(look) => looks.push(look),
                Err(error) => unread.push(error.to_string()),
            }
        }
        if looks.len() > before {
            continue;
        }
        let of_link = shapes.iter().filter(|shape| shape.link() == link.name);
        let found = link.collisions.iter().filter(|collision| !matches!(collision.shape, Shape::MissingMesh { .. }));
        for (shape, collision) in of_link.zip(found) {
            let body = match &collision.shape {
                Shape::Mesh { file, scale } => Body::Mesh(Mesh::read(file, *scale, &link.name)?),
                _ => Body::Solid(shape.solid().clone()),
            };
            looks.push(Look { frame, link: link.name.clone(), origin: *shape.origin(), body, colour: None });
        }
    }
    Ok((looks, unread))
}

fn look(link: &str, frame: FrameId, visual: &Visual) -> Result<Look, ContactError> {
    let (origin, body) = match &visual.shape {
        Shape::Mesh { file, scale } => (visual.origin.into(), Body::Mesh(Mesh::read(file, *scale, link)?)),
        shape => {
            let same = Collision { name: None, origin: visual.origin, shape: shape.clone() };
            let shape = LinkShape::new(link, frame, &same)?;
            (*shape.origin(), Body::Solid(shape.solid().clone()))
        }
    };
    // Opaque, whatever the file says, so that nothing is invisible.
    let byte = |part: f64| (255.0 * part).round() as u32;
    let colour = visual.colour.map(|[r, g, b, _]| byte(r) << 24 | byte(g) << 16 | byte(b) << 8 | 0xff);
    Ok(Look { frame, link: link.into(), origin, body, colour })
}

/// Draws all links in their own axes, and returns those that may move.
///
/// Lines from the origin of each link to those of its child joints (bones) show links without a shape.
pub(crate) fn links(sink: &Sink, chain: &Chain, looks: &[Look], size: f64) -> Result<Vec<Drawn>, RecordError> {
    let mut drawn = Vec::new();
    let (mut workspace, zero) = (chain.workspace(), chain.zero_configuration());
    let at_zero = workspace.update(chain, &zero)?;
    for (k, frame) in chain.frames().iter().enumerate() {
        let path = entity("links", &frame.name, chain.frames().iter().map(|it| it.name.as_str()));
        for (n, look) in looks.iter().filter(|look| look.link == frame.name).enumerate() {
            let path = part(&path, format!("shape_{}", n + 1));
            let colour = look.colour.unwrap_or(LINKS[k % LINKS.len()]);
            place(sink, &path, &look.origin)?;
            match &look.body {
                Body::Mesh(triangles) => mesh(sink, &path, triangles, colour)?,
                Body::Solid(body) => solid(sink, &path, body, colour)?,
            }
        }
        let ends = children(&at_zero, &frame.name)?;
        if !ends.is_empty() {
            let joints = rerun::Points3D::new(ends.iter().map(|end| xyz(*end))).with_colors([JOINT]);
            sink.fixed(part(&path, "joints".into()), &joints.with_radii([0.008 * size as f32]))?;
            let bones: Vec<_> =
                ends.iter().filter(|end| end.norm() > 1e-6 * size).map(|end| [[0.0; 3], xyz(*end)]).collect();
            let bones = rerun::LineStrips3D::new(bones).with_colors([BONE]).with_radii([0.004 * size as f32]);
            sink.fixed(part(&path, "bones".into()), &bones)?;
        }
        let id = chain.frame(&frame.name)?;
        match frame.body {
            Some(_) => drawn.push(Drawn { frame: id, path }),
            None => place(sink, &path, &at_zero.pose(id))?,
        }
    }
    Ok(drawn)
}

/// Origins of the child joints of a link in its axes, m.
fn children(at_zero: &Kinematics<Spatial<f64>>, link: &str) -> Result<Vec<Vector3<f64>>, ChainError> {
    // At the zero configuration the frame of a child link is that of its joint, for every type of joint.
    let (chain, kin) = (at_zero.chain(), at_zero);
    let into = kin.pose(chain.frame(link)?).inverse();
    // Links that a reduction has removed have no frame.
    let joints = chain.joints().iter().filter(|joint| joint.parent == link);
    Ok(joints.filter_map(|joint| chain.frame(&joint.child).ok()).map(|f| into.point(kin.pose(f).translation)).collect())
}

/// Draws all surfaces. A half-space is a rectangular patch of the size of the scene; for a planar chain, a strip seen from its
/// edge.
pub(crate) fn surfaces(
    sink: &Sink,
    surfaces: &[Surface],
    bounds: &Bounds,
    plane: Option<&Plane>,
) -> Result<(), RecordError> {
    for surface in surfaces {
        let path = part(&of_surface(surface, surfaces), "shape".into());
        match surface.obstacle.surface() {
            Form::HalfSpace { point, normal } => half_space(sink, &path, *point, *normal, bounds, plane)?,
            Form::Solid { pose, solid: body } => {
                place(sink, &path, &(*pose).into())?;
                solid(sink, &path, body, SURFACE)?;
            }
            Form::Mesh { pose, mesh: triangles } => {
                place(sink, &path, &(*pose).into())?;
                mesh(sink, &path, triangles, SURFACE)?;
            }
        }
    }
    Ok(())
}

fn half_space(
    sink: &Sink,
    path: &EntityPath,
    point: Vector3<f64>,
    normal: Vector3<f64>,
    bounds: &Bounds,
    plane: Option<&Plane>,
) -> Result<(), RecordError> {
    let size = bounds.size();
    let middle = bounds.centre() - normal * normal.dot(&(bounds.centre() - point));
    // For a planar chain the surface is seen from its edge, where a deep patch would hide the chain: a strip is drawn.
    let strip = plane.filter(|plane| plane.normal.dot(&normal).abs() < 1e-6);
    let (rotation, depth) = match strip {
        Some(plane) => (Matrix3::from_columns(&[plane.normal.cross(&normal), plane.normal, normal]), 0.03),
        None => (z_onto(normal), 0.6),
    };
    let (wide, deep, thick) = (0.6 * size, depth * size, 0.012 * size);
    place(sink, path, &Pose { rotation, translation: middle })?;
    let slab = rerun::Boxes3D::from_centers_and_half_sizes(
        [xyz(Vector3::new(0.0, 0.0, -thick / 2.0))],
        [xyz(Vector3::new(wide, deep, thick / 2.0))],
    );
    sink.fixed(path.clone(), &slab.with_colors([SURFACE]).with_fill_mode(FillMode::Solid))?;
    if strip.is_none() {
        // Just above the slab, so that its face does not hide the lines.
        let at = |x: f64, y: f64| xyz(Vector3::new(x, y, 0.001 * size));
        let lines = (-5..=5).map(|k| f64::from(k) / 5.0);
        let lines =
            lines.flat_map(|k| [[at(k * wide, -deep), at(k * wide, deep)], [at(-wide, k * deep), at(wide, k * deep)]]);
        let lines = rerun::LineStrips3D::new(lines).with_colors([GRID]).with_radii([0.0008 * size as f32]);
        sink.fixed(part(path, "grid".into()), &lines)?;
    }
    Ok(())
}

fn place(sink: &Sink, path: &EntityPath, pose: &Pose<Spatial<f64>>) -> Result<(), RecordError> {
    sink.fixed(path.clone(), &transform(pose))
}

/// A transform of the viewer with the rotation and translation of a pose.
pub(crate) fn transform(pose: &Pose<Spatial<f64>>) -> rerun::Transform3D {
    rerun::Transform3D::update_fields().with_translation(xyz(pose.translation)).with_quaternion(quaternion(pose))
}

fn solid(sink: &Sink, path: &EntityPath, solid: &Solid, colour: u32) -> Result<(), RecordError> {
    let fill = FillMode::Solid;
    match solid {
        Solid::Sphere { radius } => {
            let ball = rerun::Ellipsoids3D::from_radii([*radius as f32]);
            sink.fixed(path.clone(), &ball.with_colors([colour]).with_fill_mode(fill))
        }
        Solid::Capsule { radius, half_length } => {
            // The origin of the viewer's capsules is at one end.
            let start = [0.0, 0.0, -*half_length as f32];
            let capsule = rerun::Capsules3D::from_lengths_and_radii([2.0 * *half_length as f32], [*radius as f32]);
            sink.fixed(path.clone(), &capsule.with_translations([start]).with_colors([colour]).with_fill_mode(fill))
        }
        Solid::Cylinder { radius, half_length } => {
            let cylinder = rerun::Cylinders3D::from_lengths_and_radii([2.0 * *half_length as f32], [*radius as f32]);
            sink.fixed(path.clone(), &cylinder.with_colors([colour]).with_fill_mode(fill))
        }
        Solid::Box { half } => {
            let cuboid = rerun::Boxes3D::from_half_sizes([xyz(*half)]);
            sink.fixed(path.clone(), &cuboid.with_colors([colour]).with_fill_mode(fill))
        }
        // Hulls come from meshes, which are drawn as meshes.
        Solid::Hull(hull) => {
            let corners = rerun::Points3D::new(hull.vertices().iter().map(|v| xyz(*v)));
            sink.fixed(path.clone(), &corners.with_colors([colour]))
        }
    }
}

/// Draws triangles with separate corners and normals, so that their edges are visible.
fn mesh(sink: &Sink, path: &EntityPath, mesh: &Mesh, colour: u32) -> Result<(), RecordError> {
    let corners = |triangle: &[u32; 3]| triangle.map(|k| mesh.vertices()[k as usize]);
    let triangles: Vec<[Vector3<f64>; 3]> = mesh.triangles().iter().map(corners).collect();
    let normals = triangles.iter().flat_map(|[a, b, c]| [(b - a).cross(&(c - a)).normalize(); 3]);
    let drawn = rerun::Mesh3D::new(triangles.iter().flatten().map(|v| xyz(*v)))
        .with_vertex_normals(normals.map(xyz))
        .with_albedo_factor(rerun::components::AlbedoFactor(colour.into()));
    sink.fixed(path.clone(), &drawn)
}
