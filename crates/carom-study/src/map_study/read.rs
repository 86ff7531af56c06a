//! Reads a study file into a [`Study`]. All keys and values are checked here, before the first row is computed.

use super::advise::Wish;
use super::arm::{Arm, CONDITIONS, Engine, Limit, Poses, Tool};
use super::axis::{Axis, total};
use super::file::{self, Advise, Elbow, File, Tip, Values, Words};
use super::pointing::{self, Pointing};
use super::quantity::{self, CLASSES, Quantity, Wants};
use super::reach::{About, Reach};
use super::surface::{Normal, normals, surface_in_plane, surface_in_space};
use super::{Study, StudyError};
use crate::Column;
use crate::problem_file;
use carom_chain::algebra::Algebra;
use carom_chain::urdf::{JointType, LoadOptions, Meshes};
use carom_chain::{Chain, ChainError, Coordinates, FrameId, FramePoint, JointInfo, Point, ToolMotion, input};
use carom_impact::{AnyLaw, Coefficients, LAW_NAMES, LAWS, LawInfo};
use carom_sim::keys::Table;
use nalgebra::{SMatrix, SVector, Vector3};
use std::path::Path;

impl Study {
    /// Reads a study file and the robot that it names. The book documents the keys: `book/src/reference-study.md`.
    ///
    /// # Errors
    /// [`StudyError::File`] with key, value and rule; [`StudyError::Robot`] for an invalid URDF.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, StudyError> {
        problem_file::read(path.as_ref(), |file, rule| StudyError::File { file, rule }, Self::read, |it| &mut it.files)
    }

    /// Reads a study from the text of a study file. File names in it are relative to `folder`.
    ///
    /// # Errors
    /// As [`Study::from_file`]; the file of the messages is `<study>`.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self, StudyError> {
        Self::read(text, "<study>".into(), folder.as_ref())
    }

    fn read(text: &str, name: String, folder: &Path) -> Result<Self, StudyError> {
        let refuse = |rule: String| StudyError::File { file: name.clone(), rule };
        let file: File = carom_sim::from_toml(text).map_err(refuse)?;
        let (urdf, options) = file.robot.0.0.options(folder).map_err(|why| refuse(format!("[robot] {why}")))?;
        let options = LoadOptions { meshes: Meshes::Ignored, ..options }; // collision shapes are not used
        let chain = Chain::from_urdf_file_with(&urdf, &options).map_err(|e| match key_of(&e, &options) {
            Some(key) => refuse(format!("[robot]{key} {e}")),
            None => StudyError::Robot(e),
        })?;
        let files = vec![urdf.clone()];
        let urdf = input::read_text(&urdf, input::MOST_MIB).map_err(|e| refuse(format!("[robot] urdf: {e}")))?;
        let read = Reading { file: &file, chain: &chain };
        let (engine, columns, mut warnings) = read.all().map_err(refuse)?;
        warnings.extend(chain.report().summary(5).into_iter().map(|line| format!("{}: {line}", files[0].display())));
        let rows = total(engine.axes())
            .ok_or_else(|| refuse("the map has 2⁶⁴ rows or more: give the axes fewer values".into()))?;
        let wish = file.advise.as_ref().map(|advise| wish(advise, &columns)).transpose().map_err(refuse)?;
        let text = text.to_owned();
        Ok(Self { file: name.clone(), text, urdf, wish, chain, engine, rows, columns, files, warnings })
    }
}

/// A parsed study file and its robot.
struct Reading<'a> {
    file: &'a File,
    chain: &'a Chain,
}

/// A chain with its contact point, and the pose of its own axes in the world frame.
struct Placed<A: Algebra, const D: usize> {
    chain: Chain<A>,
    point: Point<A>,
    basis: SMatrix<f64, 3, D>,
    origin: Vector3<f64>,
    /// From the axes of the tip's link to those of its body.
    turn: SMatrix<f64, D, 3>,
}

/// The linear part of an affine map.
fn turn<const D: usize>(of: impl Fn(Vector3<f64>) -> SVector<f64, D>) -> SMatrix<f64, D, 3> {
    let origin = of(Vector3::zeros());
    SMatrix::from_columns(&[Vector3::x(), Vector3::y(), Vector3::z()].map(|unit| of(unit) - origin))
}

type Whole = (Box<dyn Engine>, Vec<Column>, Vec<String>);

impl Reading<'_> {
    /// Whether the position limits of the joints hold.
    fn has_limits(&self) -> bool {
        let Table((_, robot)) = &self.file.robot;
        robot.limits
    }

    fn all(&self) -> Result<Whole, String> {
        let (Table((load, robot)), chain) = (&self.file.robot, self.chain);
        let frame = chain.frame(&load.tip).map_err(|e| format!("[robot] tip = \"{}\": {e}", load.tip))?;
        if let Some(x) = robot.point.iter().find(|x| !x.is_finite()) {
            return Err(format!("[robot] point holds {x}: every number must be finite"));
        }
        let offset = Vector3::from(robot.point);
        let point = chain.point(frame, offset);
        if point.body.is_none() {
            return Err(format!(
                "[robot] tip = \"{}\": this link is fixed to the world; choose a link that a joint moves",
                load.tip
            ));
        }
        let wide = |joint: &&JointInfo| matches!(joint.kind, JointType::Planar | JointType::Floating);
        if let Some(joint) = chain.moving_joints().find(wide) {
            return Err(format!(
                "[robot] joint '{}' is {}: every joint of a study must be revolute, continuous or prismatic",
                joint.name,
                joint.kind.name()
            ));
        }
        let added = self.added()?;
        chain.check_dynamics_with(&added).map_err(|e| format!("[robot] urdf: {e}"))?;
        let zero = vec![0.0; chain.nq()];
        let mut workspace = chain.workspace();
        let at_zero = {
            let mut kin = workspace.update(chain, &zero).map_err(|e| e.to_string())?;
            kin.contact(point, Vector3::zeros(), &added).map_err(|e| format!("[robot] {e}"))?;
            kin.position(point)
        };
        // planar only if all normals lie in the plane
        match chain.to_planar() {
            Ok(flat) if self.stands_in(&flat.plane.normal) => {
                let own = flat.point(frame, offset);
                let basis = SMatrix::<f64, 3, 2>::from_columns(&[flat.plane.x, flat.plane.y]);
                let mut workspace = flat.chain.workspace();
                let flat_zero = workspace.update(&flat.chain, &zero).map_err(|e| e.to_string())?.position(own);
                let origin = at_zero - basis * flat_zero;
                let turn = turn(|v| flat.point(frame, v).position);
                let placed = Placed { chain: flat.chain, point: own, basis, origin, turn };
                self.with(placed, frame, |normal, along, n| surface_in_plane(&basis, normal, along, n))
            }
            _ => {
                if self.file.impact.normal_deg.is_some() {
                    return Err("[impact] normal_deg needs a planar arm: give normal = [x, y, z]".into());
                }
                let turn = turn(|v| chain.point(frame, v).position);
                let (basis, origin) = (SMatrix::identity(), Vector3::zeros());
                let placed = Placed { chain: chain.clone(), point, basis, origin, turn };
                self.with(placed, frame, surface_in_space)
            }
        }
    }

    /// Whether the given normals and `along` lie in a plane with this normal.
    fn stands_in(&self, plane: &Vector3<f64>) -> bool {
        let impact = &self.file.impact;
        let given = impact.normal.iter().flat_map(|normals| &normals.0).chain(&impact.along);
        given.into_iter().all(|v| {
            let v = Vector3::from(*v);
            v.dot(plane).abs() <= 1e-12 * v.norm()
        })
    }

    fn with<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        &self,
        placed: Placed<A, D>,
        frame: FrameId,
        surface: impl Fn(Normal, Option<Vector3<f64>>, bool) -> Result<SMatrix<f64, D, D>, String>,
    ) -> Result<Whole, String> {
        let mut warnings = Vec::new();
        let Placed { chain, point, basis, origin, turn } = placed;
        let impact = &self.file.impact;
        let approach = axis("impact", "approach_deg", "°", &impact.approach_deg)?;
        within("impact", &approach, 0.0, 180.0, "the angle must lie between 0 and 180 degrees")?;
        let straight = approach.outside(90.0, 90.0).is_none();
        let (normal, surfaces) = normals(impact, straight, surface)?;
        let (poses, pose_axes) = match (&self.file.joints, &self.file.tip) {
            (Some(_), None) => (Poses::Joints, self.joint_axes(&mut warnings)?),
            (None, Some(tip)) => {
                let made = Placed { chain: chain.clone(), point, basis, origin, turn };
                self.tip_axes(tip, &made, frame)?
            }
            (None, None) => {
                return Err("no poses are given: add [joints] or [tip]".into());
            }
            (Some(_), Some(_)) => return Err("both [joints] and [tip] are given: keep one of them".into()),
        };
        let sought = matches!(poses, Poses::Tip { .. });
        let mut axes = pose_axes;
        axes.extend([normal, approach]);
        let speed = axis("impact", "speed", "m/s", &impact.speed)?;
        within("impact", &speed, f64::MIN_POSITIVE, f64::MAX, "the speed must be above 0")?;
        let restitution = axis("impact", "restitution", "", &impact.restitution)?;
        within("impact", &restitution, 0.0, 1.0, "a coefficient of restitution lies between 0 and 1")?;
        let tangential = impact.tangential_restitution.clone();
        let tangential = axis("impact", "tangential_restitution", "", &tangential.unwrap_or(Values::One(0.0)))?;
        let rule = "a coefficient of tangential restitution lies between -1 and 1";
        within("impact", &tangential, -1.0, 1.0, rule)?;
        let friction = axis("impact", "friction", "", &impact.friction)?;
        within("impact", &friction, 0.0, f64::MAX, "a coefficient of friction is not negative")?;
        axes.extend([speed, restitution, tangential, friction, laws(&impact.law)?]);
        let varies = |name: &str| axes.iter().any(|axis| axis.name == name && axis.varies());
        for (name, given) in
            [("tangential_restitution", impact.tangential_restitution.is_some()), ("friction", varies("friction"))]
        {
            let users: Vec<&str> = LAWS.iter().filter(|law| law.has(name)).map(|law| law.name).collect();
            let uses = |law: &String| LawInfo::named(law).is_some_and(|law| users.contains(&law.name));
            if given && !impact.law.0.iter().any(uses) {
                return Err(format!(
                    "[impact] {name} is used by none of the laws in law = {:?}, only by {}: leave it out, or add one of these laws",
                    impact.law.0,
                    users.join(", ")
                ));
            }
        }

        let slides = |joint: &JointInfo| joint.kind == JointType::Prismatic;
        let named = |joint: &JointInfo| (joint.name.clone(), if slides(joint) { "m/s" } else { "rad/s" });
        let joints: Vec<_> = self.chain.moving_joints().map(named).collect();
        let (limited, limits) = velocity_limits(self.chain);
        let quantities = self.quantities(&limited)?;
        let mut columns = Vec::new();
        for (k, it) in axes.iter().enumerate().filter(|(_, it)| it.varies()) {
            if k == axes.len() - CONDITIONS && !it.names().is_empty() {
                columns.extend(["normal.x", "normal.y", "normal.z"].map(Column::number));
            } else {
                columns.push(Column { name: it.name.clone(), words: it.names().to_vec(), unit: it.unit });
            }
        }
        if sought {
            columns.extend(self.chain.moving_joints().map(|joint| {
                Column::number(format!("q.{}", joint.name)).in_unit(if slides(joint) { "m" } else { "rad" })
            }));
        }
        columns.push(Column::word("class", CLASSES));
        columns.extend(quantities.iter().flat_map(|quantity| quantity.columns(D, &joints, &limited)));
        let ranges = if self.has_limits() { ranges(self.chain) } else { Vec::new() };
        let tangential_restitution = impact.tangential_restitution.is_some();
        let engine: Box<dyn Engine> = Box::new(Arm {
            chain,
            point,
            basis,
            origin,
            surfaces,
            poses,
            ranges,
            limits,
            tangential_restitution,
            added: self.added()?,
            tool: self.tool(frame)?,
            axes,
            laws: impact.law.0.iter().filter_map(|law| AnyLaw::named(law, Coefficients::default())).collect(),
            wants: Wants::of(&quantities),
            quantities,
        });
        Ok((engine, columns, warnings))
    }

    /// One axis for each joint with coordinates of its own, in the order of q.
    fn joint_axes(&self, warnings: &mut Vec<String>) -> Result<Vec<Axis>, String> {
        let given = self.file.joints.as_ref();
        let get = |name: &str| given.and_then(|given| given.get(name));
        for name in given.into_iter().flatten().map(|(name, _)| name) {
            let joint = self.chain.joint(name).map_err(|e| format!("[joints] {name}: {e}"))?;
            match &joint.coordinates {
                Coordinates::Own { .. } => {}
                Coordinates::None => return Err(format!("[joints] {name}: this joint is fixed, leave it out")),
                Coordinates::Follows { joint, .. } => {
                    return Err(format!("[joints] {name}: this joint mimics '{joint}', leave it out"));
                }
            }
        }
        self.chain
            .moving_joints()
            .map(|joint| {
                let name = &joint.name;
                let values =
                    get(name).ok_or_else(|| format!("[joints] has no {name}: give every moving joint a value or a range"))?;
                let unit = if joint.kind == JointType::Prismatic { "m" } else { "rad" };
                let axis = Axis::new(format!("q.{name}"), unit, values).map_err(|why| format!("[joints] {name}: {why}"))?;
                let (lower, upper) = range_of(self.chain, joint);
                if let Some(at) = axis.outside(lower, upper).filter(|_| self.has_limits()) {
                    let alone = (lower, upper) == limits_of(joint);
                    let whose = if alone { "the joint's limits" } else { "the limits of the joint and of those that mimic it" };
                    warnings.push(format!(
                        "[joints] {name} = {at} {unit} is beyond {whose}, {lower} to {upper}: such rows have no numbers; set \
                         [robot] limits = false to compute them"
                    ));
                }
                Ok(axis)
            })
            .collect()
    }

    /// Axes of the tip's coordinates and of the branch (elbow or seed).
    fn tip_axes<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        &self,
        tip: &Tip,
        placed: &Placed<A, D>,
        frame: FrameId,
    ) -> Result<(Poses<D>, Vec<Axis>), String> {
        let Placed { chain, point, basis, origin, .. } = placed;
        let (mut coordinates, mut axes) = (Vec::new(), Vec::new());
        for (k, (name, values)) in [("x", &tip.x), ("y", &tip.y), ("z", &tip.z)].into_iter().enumerate() {
            let Some(values) = values else { continue };
            if basis.row(k).norm() < 1e-9 {
                let link = self.chain.frame_name(frame);
                return Err(format!("[tip] {name}: no joint moves '{link}' along {name}: leave it out"));
            }
            coordinates.push(k);
            axes.push(Axis::new(format!("tip.{name}"), "m", values).map_err(|why| format!("[tip] {name}: {why}"))?);
        }
        if coordinates.is_empty() {
            return Err("[tip] has no coordinate: give at least one of x, y and z".into());
        }
        if let Some(seeds) = &tip.seeds {
            if seeds.is_empty() {
                return Err("[tip] seeds is empty: give at least one configuration".into());
            }
            for seed in seeds {
                self.chain.check_state(seed, &vec![0.0; self.chain.nv()]).map_err(|e| format!("[tip] seeds: {e}"))?;
            }
        }
        let (mut limits, mut hinges) = (Vec::new(), Vec::new());
        for joint in self.chain.moving_joints() {
            let unbounded = (f64::NEG_INFINITY, f64::INFINITY);
            limits.push(if self.has_limits() { range_of(self.chain, joint) } else { unbounded });
            hinges.push(joint.kind != JointType::Prismatic);
        }
        let about = About { basis, origin: *origin, limits, hinges };
        let pointing = tip.pointing.as_ref().map(|it| self.pointing(it, placed, frame)).transpose()?;
        let search = (pointing, tip.seeds.clone());
        let reach = Reach::new(chain, *point, &coordinates, search, about).map_err(|e| format!("[tip] {e}"))?;
        let (branches, names): (Vec<usize>, Vec<String>) = if reach.is_closed() {
            if tip.seeds.is_some() {
                return Err(
                    "[tip] seeds: two revolute links in a plane have a closed form: give elbow = \"both\" instead"
                        .into(),
                );
            }
            match tip.elbow.unwrap_or(Elbow::Both) {
                Elbow::Both => (vec![0, 1], vec!["up".into(), "down".into()]),
                Elbow::Up => (vec![0], vec!["up".into()]),
                Elbow::Down => (vec![1], vec!["down".into()]),
            }
        } else {
            if tip.elbow.is_some() {
                return Err("[tip] elbow needs two revolute links in a plane: give seeds = [[q …], …] instead".into());
            }
            (0..reach.seeds()).map(|k| (k, (k + 1).to_string())).unzip()
        };
        axes.push(Axis::words(if reach.is_closed() { "elbow" } else { "seed" }, names));
        Ok((Poses::Tip { reach: Box::new(reach), branches }, axes))
    }

    /// The direction that the tip keeps; in the plane both vectors must lie in it.
    fn pointing<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        &self,
        given: &file::Pointing,
        placed: &Placed<A, D>,
        frame: FrameId,
    ) -> Result<Pointing<D>, String> {
        let [axis, direction] = pointing::given(given.axis, given.direction)?;
        // The pose of the tip at q = 0 takes the axis to the world, and from there to the chain's axes.
        let mut workspace = self.chain.workspace();
        let kin = workspace.update(self.chain, &vec![0.0; self.chain.nq()]).map_err(|e| e.to_string())?;
        let [at, ahead] = [Vector3::zeros(), axis].map(|v| kin.position(self.chain.point(frame, v)));
        for (key, vector) in [("axis", ahead - at), ("direction", direction)] {
            let inside = placed.basis * placed.basis.tr_mul(&vector);
            if (vector - inside).norm() > 1e-9 {
                return Err(format!(
                    "[tip] pointing.{key} leaves the plane in which the arm moves: give a vector in it"
                ));
            }
        }
        Ok(Pointing::new(placed.turn * axis, placed.basis.tr_mul(&direction)))
    }

    /// The motion of the tip before the impact, if it is not that of least kinetic energy.
    fn tool(&self, frame: FrameId) -> Result<Option<Tool>, String> {
        let impact = &self.file.impact;
        let Some(name) = &impact.motion else { return Ok(None) };
        let motion = ToolMotion::from_name(name).map_err(|why| format!("[impact] motion: {why}"))?;
        if motion == ToolMotion::LeastEnergy {
            return Ok(None);
        }
        if !impact.locked.is_empty() {
            return Err(format!(
                "[impact] motion = \"{name}\" and locked: locked joints are computed with motion = \"least-energy\" only: \
                 leave one of both out"
            ));
        }
        let Table((_, robot)) = &self.file.robot;
        Ok(Some(Tool { chain: self.chain.clone(), at: FramePoint::new(frame, robot.point), motion }))
    }

    /// The inertia that locked joints add to M.
    fn added(&self) -> Result<Vec<f64>, String> {
        let names: Vec<&str> = self.chain.moving_joints().map(|joint| joint.name.as_str()).collect();
        let locked = &self.file.impact.locked;
        if let Some(name) = locked.iter().find(|name| !names.contains(&name.as_str())) {
            return Err(format!("[impact] locked holds \"{name}\": {}", nearest(name, &names)));
        }
        let added = |name: &&str| if locked.iter().any(|own| own == name) { f64::INFINITY } else { 0.0 };
        Ok(if locked.is_empty() { Vec::new() } else { names.iter().map(added).collect() })
    }

    fn quantities(&self, limited: &[String]) -> Result<Vec<Quantity>, String> {
        let mut found = Vec::new();
        for name in self.file.map.quantities.iter().filter(|name| *name != "class") {
            let quantity = quantity::by_name(name).ok_or_else(|| {
                format!("[map] quantities holds \"{name}\": {}", nearest(name, &quantity::names().collect::<Vec<_>>()))
            })?;
            if found.contains(&quantity) {
                return Err(format!("[map] quantities holds \"{name}\" twice"));
            }
            if matches!(quantity, Quantity::LimitShare | Quantity::LimitJoint) && limited.is_empty() {
                return Err(format!(
                    "[map] quantities holds \"{name}\", but no joint of '{}' has a velocity limit: use joint_jump instead",
                    self.chain.name()
                ));
            }
            found.push(quantity);
        }
        Ok(found)
    }
}

/// The criterion and constraints of `[advise]`, as indices of columns.
fn wish(advise: &Advise, columns: &[Column]) -> Result<Wish, String> {
    let numbers: Vec<&str> = columns.iter().filter(|c| c.words.is_empty()).map(|c| c.name.as_str()).collect();
    let column = |key: &str, name: &str| {
        let found = columns.iter().position(|c| c.name == name && c.words.is_empty());
        found.ok_or_else(|| {
            format!(
                "[advise] {key}: the map has no column of numbers '{name}': add it to quantities, or give it more than one value \
                 if it is an axis; {}",
                nearest(name, &numbers)
            )
        })
    };
    let (name, maximise) = match (&advise.minimise, &advise.maximise) {
        (Some(name), None) => (column("minimise", name)?, false),
        (None, Some(name)) => (column("maximise", name)?, true),
        _ => return Err("[advise] needs exactly one of minimise and maximise".into()),
    };
    if advise.class.as_ref().is_some_and(Vec::is_empty) {
        return Err(format!("[advise] class is empty: give at least one of {}, or leave it out", CLASSES.join(", ")));
    }
    let classes = advise.class.iter().flatten().map(|class| {
        let found = CLASSES.iter().position(|known| known == class);
        found.map(|k| k as f64).ok_or_else(|| format!("[advise] class = \"{class}\": {}", nearest(class, &CLASSES)))
    });
    let classes = classes.collect::<Result<_, _>>()?;
    let mut bounds = Vec::new();
    for (name, most) in &advise.at_most {
        bounds.push((column("at_most", name)?, f64::NEG_INFINITY, *most));
    }
    for (name, least) in &advise.at_least {
        bounds.push((column("at_least", name)?, *least, f64::INFINITY));
    }
    if let Some((k, low, high)) = bounds.iter().find(|(_, low, high)| low.is_nan() || high.is_nan()) {
        return Err(format!("[advise] the bound on {} is {}: it must not be NaN", columns[*k].name, low + high));
    }
    if advise.best == 0 {
        return Err("[advise] best = 0: it must be at least 1".into());
    }
    Ok(Wish { column: name, maximise, classes, bounds, best: advise.best })
}

/// Where an error comes from numbers of `[robot]` and not from the URDF: the key, if the message does not begin with it.
fn key_of(error: &ChainError, options: &LoadOptions) -> Option<&'static str> {
    match error {
        ChainError::UnknownFrame { name, .. } if options.mass.contains_key(name) => Some(" mass:"),
        ChainError::UnknownFrame { .. } => Some(" inertia:"),
        ChainError::UnknownJoint { .. } => Some(" rotor_inertia:"),
        ChainError::OutOfRange { .. } => Some(""),
        _ => None,
    }
}

fn limits_of(joint: &JointInfo) -> (f64, f64) {
    let hinge = joint.kind == JointType::Continuous;
    let (lower, upper) = if hinge { (None, None) } else { (joint.limits.lower, joint.limits.upper) };
    (lower.unwrap_or(f64::NEG_INFINITY), upper.unwrap_or(f64::INFINITY))
}

/// The limits of a joint with a coordinate of its own, and of those that mimic it; those of the joint where they leave no position.
fn range_of(chain: &Chain, joint: &JointInfo) -> (f64, f64) {
    let own = chain.coordinate_of(joint).map_or([None, None], |own| chain.limits_of(own.q));
    let (lower, upper) = (own[0].unwrap_or(f64::NEG_INFINITY), own[1].unwrap_or(f64::INFINITY));
    if lower <= upper { (lower, upper) } else { limits_of(joint) }
}

/// Every joint with a position limit: index of q, ratio and shift (position = ratio · q + shift), lower and upper limit.
fn ranges(chain: &Chain) -> Vec<(usize, f64, f64, f64, f64)> {
    let range = |joint: &JointInfo| {
        let (lower, upper) = limits_of(joint);
        let moves = chain.coordinate_of(joint)?;
        Some((moves.q, moves.multiplier, moves.offset, lower, upper))
    };
    let limited = chain.joints().iter().filter_map(range);
    limited.filter(|(.., lower, upper)| lower.is_finite() || upper.is_finite()).collect()
}

/// Names and velocity limits of the joints that have one.
fn velocity_limits(chain: &Chain) -> (Vec<String>, Vec<Limit>) {
    let limit = |joint: &JointInfo| {
        let velocity = joint.limits.velocity.filter(|limit| *limit > 0.0)?;
        let moves = chain.coordinate_of(joint)?;
        Some((joint.name.clone(), Limit { v: moves.v, ratio: moves.multiplier, velocity }))
    };
    chain.joints().iter().filter_map(limit).unzip()
}

pub(super) fn axis(table: &str, name: &str, unit: &'static str, values: &Values) -> Result<Axis, String> {
    Axis::new(name.into(), unit, values).map_err(|why| format!("[{table}] {name}: {why}"))
}

fn within(table: &str, axis: &Axis, low: f64, high: f64, rule: &str) -> Result<(), String> {
    match axis.outside(low, high) {
        Some(x) => Err(format!("[{table}] {} = {x}: {rule}", axis.name)),
        None => Ok(()),
    }
}

fn laws(words: &Words) -> Result<Axis, String> {
    if words.0.is_empty() {
        return Err("[impact] law is empty: give at least one law".into());
    }
    let mut laws: Vec<String> = Vec::new();
    for given in &words.0 {
        let unknown = || format!("[impact] law = \"{given}\": {}", nearest(given, &LAW_NAMES));
        let law = LawInfo::named(given).ok_or_else(unknown)?.name;
        if laws.iter().any(|own| own == law) {
            return Err(format!("[impact] law holds \"{law}\" twice"));
        }
        laws.push(law.to_owned());
    }
    Ok(Axis::words("law", laws))
}

/// A hint for an unknown name: the most similar known name, and all known names.
pub(super) fn nearest(name: &str, known: &[&str]) -> String {
    let near = known.iter().map(|k| (strsim::jaro_winkler(name, k), k)).max_by(|a, b| a.0.total_cmp(&b.0));
    let list = known.join(", ");
    match near {
        Some((likeness, near)) if likeness > 0.7 => format!("did you mean \"{near}\"? Known names: {list}"),
        _ => format!("known names: {list}"),
    }
}
