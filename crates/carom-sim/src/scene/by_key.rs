//! Any number of a scene file as a parameter.

use super::{Body, Scene, in_file, path, refuse};
use crate::error::SimError;
use crate::model::{Drive, Parameter, Simulation};
use crate::state::reach;
use carom_chain::JointCoordinate;

/// The share of a number by which it is changed to see what depends on it.
const CHANGE: f64 = 1e-5;
/// A number is counted as large as this share of the least of 1, the reach (m) and the mass (kg) of the robots, or larger: it is changed by a share
/// of its size, and what that changes must be above rounding. A zero has the size of its list, or 1.
const LEAST: f64 = 1e-2;
/// The keys of `[run]` that change how a motion is computed, or how much of it, but not the motion.
const NO_PARAMETERS: [&str; 8] =
    ["duration", "tolerance", "accuracy", "sample", "max_step", "zeno_time", "contact_step", "neglect"];

impl Scene {
    /// The size of the number at the path of a key of the file (of zero the largest of its list, or 1), and the same scene with `change`
    /// added to it. The duration is that of this scene, and
    /// the start that of the file.
    ///
    /// # Errors
    /// [`SimError::Scene`]: a path that leads nowhere, a value that is no number, a number that the scene refuses.
    pub fn with_number(&self, path: &str, change: f64) -> Result<(f64, Self), SimError> {
        let mut size = 0.0;
        let scene = self.with_keys(|keys| {
            size = path::add(keys, path, change).map_err(|why| of_key(path, &why))?;
            Ok(())
        })?;
        Ok((size, Self { duration: self.duration, ..scene }))
    }

    /// The number at the path of a key of the file.
    ///
    /// # Errors
    /// [`SimError::Scene`]: a path that leads nowhere, a value that is no number.
    pub fn number(&self, path: &str) -> Result<f64, SimError> {
        let mut keys: toml::Table = self.text.parse().map_err(|e: toml::de::Error| refuse(e.to_string()))?;
        path::get(&mut keys, path).map_err(|why| of_key(path, &why))
    }

    /// The same scene with these numbers at the paths of keys of the file. The duration is that of this scene unless it is among them, and
    /// the start that of the file.
    ///
    /// # Errors
    /// As [`Scene::with_number`].
    pub fn with_values(&self, values: &[(String, f64)]) -> Result<Self, SimError> {
        let scene = self.with_keys(|keys| {
            values.iter().try_for_each(|(path, value)| path::set(keys, path, *value).map_err(|why| of_key(path, &why)))
        });
        let own = values.iter().find(|(path, _)| path == "run.duration");
        Ok(Self { duration: own.map_or(self.duration, |(_, duration)| *duration), ..scene? })
    }

    /// The scene of the file with other values at the paths of keys.
    ///
    /// # Errors
    /// As [`Scene::from_toml`]; a path that leads nowhere.
    #[doc(hidden)]
    pub fn with_entries(&self, values: &toml::Table) -> Result<Self, SimError> {
        self.with_keys(|keys| {
            values.iter().try_for_each(|(path, value)| {
                let own = |why: String| of_key(path, &why);
                let (at, part) = path::place(keys, path).map_err(own)?;
                *path::entry(at, part, path).map_err(own)? = value.clone();
                Ok(())
            })
        })
    }

    /// Sets all on which the error of the integration depends to that of another simulation, in the text, too.
    pub(crate) fn set_accuracy(&mut self, of: &Simulation) -> Result<(), SimError> {
        let own = &mut self.simulation;
        (own.tolerance, own.zeno_time, own.max_step) = (of.tolerance, of.zeno_time, of.max_step);
        let mut keys: toml::Table = self.text.parse().map_err(|e: toml::de::Error| refuse(e.to_string()))?;
        if let Some(toml::Value::Table(run)) = keys.get_mut("run") {
            run.remove("accuracy");
            let numbers = [("tolerance", of.tolerance), ("zeno_time", of.zeno_time), ("max_step", of.max_step)];
            run.extend(numbers.map(|(key, number)| (key.to_owned(), number.into())));
        }
        self.text = toml::to_string(&keys).map_err(|e| refuse(e.to_string()))?;
        Ok(())
    }

    fn with_keys(&self, change: impl FnOnce(&mut toml::Table) -> Result<(), SimError>) -> Result<Self, SimError> {
        let mut keys: toml::Table = self.text.parse().map_err(|e: toml::de::Error| refuse(e.to_string()))?;
        let robots = |keys: &toml::Table| keys.get("robot").map(Body::keys);
        let before = robots(&keys);
        change(&mut keys)?;
        let text = toml::to_string(&keys).map_err(|e| refuse(e.to_string()))?;
        let bodies = (robots(&keys) == before).then_some(&self.bodies);
        Self::read(&text, &self.folder, bodies).map_err(|e| match e {
            // The text is written here, so that its lines are not those of a file.
            SimError::Scene { rule, .. } => {
                let after = rule.strip_prefix("line ").and_then(|rule| rule.split_once([',', ':']));
                let rule = after.map_or(rule.as_str(), |(_, rule)| rule.trim_start()).to_owned();
                SimError::Scene { file: "the scene with changed keys".into(), rule }
            }
            other => other,
        })
    }

    /// The number at the path of a key of the file as a parameter: `contact.friction`, `robot.mass.hand`, `surface[0].contact.restitution`.
    ///
    /// ```
    /// # use carom_sim::Scene;
    /// # let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/planar2.toml");
    /// let scene = Scene::from_file(file)?;
    /// let found = scene.plan()?.sensitivity(0.5, &[scene.parameter("contact.restitution")?])?;
    /// assert_eq!(found.names[4], "contact.restitution");
    /// # Ok::<(), carom_sim::SimError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Scene::with_number`]; a key that changes the start or the duration.
    pub fn parameter(&self, path: &str) -> Result<Parameter, SimError> {
        if let Some(own) = self.of_drive(path) {
            return Ok(own);
        }
        self.parameter_by(path, |scene, path, change| scene.with_number(path, change))
    }

    /// The number of a controller at one joint, whose derivative has a closed form: `run.kp.elbow`, `robot[0].target[2]`.
    #[doc(hidden)]
    pub fn of_drive(&self, path: &str) -> Option<Parameter> {
        let (table, rest) = path.split_once('.')?;
        let (key, joint) = rest.split_once(['.', '['])?;
        let chain = &self.simulation.chain;
        // The first numbers of q and qd of the robot, and the prefix of its joints.
        let (first, prefix) = match table.strip_prefix("robot[").and_then(|k| k.strip_suffix(']')) {
            None if table == "run" && self.simulation.after_impact.is_none() => ((0, 0), String::new()),
            None => return None,
            Some(k) => {
                let member = chain.members().get(k.parse::<usize>().ok()?)?;
                let Drive::Robots(drives) = &self.simulation.drive else { return None };
                let own = drives.iter().find(|own| own.robot == member.name)?;
                own.after_impact.is_none().then_some(((member.q.start, member.v.start), format!("{}/", member.name)))?
            }
        };
        let joint = match joint.strip_suffix(']') {
            None => format!("{prefix}{joint}"),
            Some(index) => {
                let index: usize = index.parse().ok()?;
                let place = |at: &JointCoordinate| if key == "target" { at.q - first.0 } else { at.v - first.1 };
                let own = chain.joints().iter().filter(|own| own.name.starts_with(&prefix));
                let mut own = own.filter_map(|own| Some((own, chain.coordinate_of(own)?)));
                own.find(|(_, at)| index == place(at))?.0.name.clone()
            }
        };
        let name = format!("{key} {joint}");
        let is_number = chain.joint(&joint).is_ok() && self.number(path).is_ok();
        let mut all = is_number.then(|| Parameter::all(&self.simulation)).into_iter().flatten();
        all.find(|own| own.name() == name).map(|own| own.named(path))
    }

    /// [`Scene::parameter`], with a changed scene from `with_number`.
    #[doc(hidden)]
    pub fn parameter_by(
        &self,
        path: &str,
        with_number: impl Fn(&Self, &str, f64) -> Result<(f64, Self), SimError> + Send + Sync + 'static,
    ) -> Result<Parameter, SimError> {
        let settings = |key: &&str| NO_PARAMETERS.contains(key) || key.starts_with("perturb");
        if let Some(key) = path.strip_prefix("run.").filter(settings) {
            let why = format!(
                "{key} is no parameter of the motion: its derivative by the time is the final velocity and acceleration"
            );
            return Err(of_key(
                path,
                if key == "duration" { &why } else { "it is a setting of the computation, no parameter of the motion" },
            ));
        }
        let (scale, same) = with_number(self, path, 0.0)?;
        let chain = &self.simulation.chain;
        let sizes = [reach(chain), chain.total_mass()].into_iter().filter(|size| *size > 0.0);
        let scale = scale.max(LEAST * sizes.fold(1.0, f64::min));
        // One of them is refused at an end of the number's range.
        let beside = |change| with_number(self, path, change * scale);
        let (_, beside) = beside(CHANGE).or_else(|why| beside(-CHANGE).map_err(|_| why))?;
        if (&same.q, &same.qd, same.duration) != (&beside.q, &beside.qd, beside.duration) {
            let why = "it changes the start or the duration: take the start by \"q\", \"qd\" or a part of it (a tip_velocity \
                       depends on the masses: give qd instead), and the end by the final state";
            return Err(of_key(path, why));
        }
        let (scene, key) = (self.clone(), path.to_owned());
        Ok(Parameter::try_new(path, scale, move |simulation, delta| {
            let changed = with_number(&scene, &key, delta)?.1.plan()?.simulation;
            *simulation = Simulation { stop: simulation.stop.clone(), ..changed };
            Ok(())
        }))
    }
}

/// A refusal of a key.
fn of_key(path: &str, why: &str) -> SimError {
    let why = why.strip_prefix(path).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(why);
    in_file(path.to_owned(), refuse(why.to_owned()))
}
