//! The numbers of a scene by their names: of the start, of contacts and drives, and any number of the file by its key.

use super::{Scene, in_file, path, refuse};
use crate::error::SimError;
use crate::model::{Parameter, Simulation};
use crate::plan::Plan;
use crate::run::Sensitivity;

/// The share of a number by which it is changed to see what depends on it.
const CHANGE: f64 = 1e-5;

/// Quantities by which a run is differentiated, chosen by their names.
pub struct Columns {
    /// The parameters among them.
    pub parameters: Vec<Parameter>,
    /// The columns that are asked for, in their order, among those of the whole start and of these parameters.
    pub columns: Vec<usize>,
}

impl Columns {
    /// All of the start, and all parameters.
    pub fn all(plan: &Plan) -> Self {
        let parameters = Parameter::all(&plan.simulation);
        let columns = (0..plan.simulation.state_names().len() + parameters.len()).collect();
        Self { parameters, columns }
    }

    /// Those of these names: a number of the start or a parameter, or all that begin with these words (`q`, `kp`, `torque elbow`); a
    /// name with a dot is the path of a key, of which `of_key` makes a parameter.
    ///
    /// # Errors
    /// That of `of_key`; `unknown` makes one of the message about a name that the scene does not have.
    pub fn of<E>(
        plan: &Plan,
        names: &[String],
        mut of_key: impl FnMut(&str) -> Result<Parameter, E>,
        unknown: impl Fn(String) -> E,
    ) -> Result<Self, E> {
        let (start, all) = (plan.simulation.state_names(), Parameter::all(&plan.simulation));
        let (mut parameters, mut columns) = (Vec::new(), Vec::new());
        for name in names {
            let part = format!("{name} ");
            let is_meant = |own: &str| own == name || own.starts_with(&part);
            let before = columns.len();
            columns.extend((0..start.len()).filter(|&k| is_meant(&start[k])));
            for own in all.iter().filter(|own| is_meant(own.name())) {
                columns.push(start.len() + parameters.len());
                parameters.push(own.clone());
            }
            if columns.len() == before && name.contains('.') {
                columns.push(start.len() + parameters.len());
                parameters.push(of_key(name)?);
            } else if columns.len() == before {
                let known = start.iter().map(String::as_str).chain(all.iter().map(Parameter::name));
                let message = format!(
                    "'{name}' is no number of the scene: wrt has \"q\", \"qd\", {}, and paths of keys like contact.friction",
                    listed(known).join(", ")
                );
                return Err(unknown(message));
            }
        }
        Ok(Self { parameters, columns })
    }

    /// The derivatives by these quantities.
    pub fn of_all(&self, mut found: Sensitivity) -> Sensitivity {
        let own = |by: &[f64]| self.columns.iter().map(|&k| by[k]).collect();
        found.names = self.columns.iter().map(|&k| found.names[k].clone()).collect();
        found.last_by = found.last_by.map(|by| by.select_columns(&self.columns));
        found.events.iter_mut().for_each(|event| event.time_by = own(&event.time_by));
        found
    }
}

/// The names, of the rows of a table the first one and a sign that there are more.
fn listed<'n>(names: impl Iterator<Item = &'n str>) -> Vec<&'n str> {
    let row = |name: &str| name.rsplit_once(' ').and_then(|(_, last)| last.parse::<usize>().ok());
    let (mut short, mut goes_on) = (Vec::new(), false);
    for name in names {
        let of_table = row(name).is_some_and(|row| row > 1) && !name.starts_with('q');
        if !of_table {
            short.push(name);
        } else if !goes_on {
            short.push("…");
        }
        goes_on = of_table;
    }
    short
}

impl Scene {
    /// The size of the number at the path of a key of the file (of zero the largest of its list, or 1), and the same scene with `change`
    /// added to it. The duration is that of this scene, and
    /// the start that of the file.
    ///
    /// # Errors
    /// [`SimError::Scene`]: a path that leads nowhere, a value that is no number, a number that the scene refuses.
    pub fn with_number(&self, path: &str, change: f64) -> Result<(f64, Self), SimError> {
        let mut keys: toml::Table = self.text.parse().map_err(|e: toml::de::Error| refuse(e.to_string()))?;
        let size = path::add(&mut keys, path, change).map_err(|why| of_key(path, &why))?;
        let text = toml::to_string(&keys).map_err(|e| refuse(e.to_string()))?;
        Ok((size, Self { duration: self.duration, ..Self::from_toml(&text, &self.folder)? }))
    }

    /// The number at the path of a key of the file as a parameter: `contact.friction`, `robot.mass.hand`, `surface[0].restitution`.
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
        self.parameter_by(path, |scene, path, change| scene.with_number(path, change))
    }

    /// [`Scene::parameter`], with a changed scene from `with_number`.
    #[doc(hidden)]
    pub fn parameter_by(
        &self,
        path: &str,
        with_number: impl Fn(&Self, &str, f64) -> Result<(f64, Self), SimError> + Send + Sync + 'static,
    ) -> Result<Parameter, SimError> {
        let (scale, same) = with_number(self, path, 0.0)?;
        let (_, beside) = with_number(self, path, CHANGE * scale)?;
        if (&same.q, &same.qd, same.duration) != (&beside.q, &beside.qd, beside.duration) {
            let why = "it changes the start or the duration: take the start by \"q\", \"qd\" or a part of it, and the end by the final state";
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
