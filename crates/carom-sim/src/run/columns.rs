//! The quantities by which a run is differentiated, by their names.

use super::sensitivity::Sensitivity;
use crate::model::Parameter;
use crate::plan::Plan;

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
