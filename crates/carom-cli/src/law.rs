//! `carom law`: an impact law on plain numbers.

use crate::error::{CliError, LineError};
use crate::input::{Refused, for_each_line};
use crate::output::{answer, row, say, short};
use carom_impact::{Coefficients, ImpactError, ImpactProblem, LAW_NAMES, Law, law_by_name};
use carom_study::{LawPoint, routh_diagram};
use clap::{Args, builder::PossibleValuesParser};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Which law, with which coefficients.
#[derive(Args)]
pub struct LawArgs {
    /// The impact law, or `all`
    #[arg(long, value_parser = PossibleValuesParser::new(LAW_NAMES.into_iter().chain(["all"])))]
    law: String,
    /// Coefficient of restitution, 0 to 1, in the law's own sense (Newton, Poisson, Energetic)
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    pub restitution: f64,
    /// Coefficient of friction, 0 or more
    #[arg(long, value_name = "MU", default_value_t = 0.0, allow_hyphen_values = true)]
    pub friction: f64,
    /// Coefficient of tangential restitution, -1 to 1, for `chatterjee-ruina`; 0 if not given
    #[arg(long, value_name = "ET", allow_hyphen_values = true)]
    tangential_restitution: Option<f64>,
}

/// Laws with the names they go by.
type Named<const D: usize> = Vec<(&'static str, Box<dyn Law<f64, D> + Send + Sync>)>;

impl LawArgs {
    /// The laws asked for.
    pub fn laws<const D: usize>(&self) -> Result<Named<D>, CliError> {
        let range = |option: &str, x: f64, low: f64, high: f64, rule: &str| {
            if (low..=high).contains(&x) { Ok(()) } else { Err(CliError::Option(format!("{option} {x}: {rule}"))) }
        };
        range("--restitution", self.restitution, 0.0, 1.0, "a coefficient of restitution lies between 0 and 1")?;
        range("--friction", self.friction, 0.0, f64::MAX, "a coefficient of friction is finite and not negative")?;
        if let Some(et) = self.tangential_restitution {
            range(
                "--tangential-restitution",
                et,
                -1.0,
                1.0,
                "a coefficient of tangential restitution lies between -1 and 1",
            )?;
            if !["all", "chatterjee-ruina"].contains(&self.law.as_str()) {
                say(&format!("warning: --tangential-restitution is not used by {}", self.law));
            }
        }
        let asked = LAW_NAMES.into_iter().filter(|&name| self.law == "all" || self.law == name);
        let coefficients = Coefficients {
            restitution: self.restitution,
            tangential_restitution: self.tangential_restitution.unwrap_or_default(),
            friction: self.friction,
        };
        let law = |name| Some((name, law_by_name(name, coefficients)?));
        Ok(asked.filter_map(law).collect())
    }
}

/// The answers of `--law all`, and the laws that have none here.
#[derive(Serialize)]
pub struct All<A> {
    pub outcomes: Vec<A>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<Refusal>,
}

/// A law that has no answer here, and why.
#[derive(Serialize)]
pub struct Refusal {
    pub law: &'static str,
    pub reason: String,
}

impl<A> Default for All<A> {
    fn default() -> Self {
        Self { outcomes: Vec::new(), refused: Vec::new() }
    }
}

impl<A: Serialize> All<A> {
    /// One law's refusal beside the others' answers. What is wrong with the problem itself refuses the line.
    pub fn refuse(&mut self, law: &'static str, why: &ImpactError) -> Result<(), LineError> {
        match why {
            ImpactError::Wedged { .. } => {
                self.refused.push(Refusal { law, reason: why.to_string() });
                Ok(())
            }
            _ => Err(LineError(why.to_string())),
        }
    }

    /// Writes the answers: one law's outcome alone, or all of them.
    pub fn answer(
        &self,
        out: &mut dyn Write,
        json: bool,
        asked: usize,
        for_people: impl FnOnce(&Self, &mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Refused> {
        match self.outcomes.as_slice() {
            [alone] if json && asked == 1 => answer(out, alone, json, |_, _| Ok(())),
            _ => answer(out, self, json, for_people),
        }
    }
}

#[derive(Args)]
pub struct LawCommand {
    #[command(flatten)]
    law: LawArgs,
    /// JSON lines {"delassus":[[…]],"u":[…]} in contact axes, tangents first, normal last; - is standard input
    #[arg(long, value_name = "FILE")]
    problems: PathBuf,
    /// Draw the Routh diagram of the first problem, which must be planar: the plane of impulses with cone, lines of
    /// compression and sticking, energy ellipse, permissible region, and every law's impulse
    #[arg(long, value_name = "X.svg")]
    svg: Option<PathBuf>,
    /// One line of JSON for each line read
    #[arg(long)]
    json: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Problem {
    delassus: Vec<Vec<f64>>,
    u: Vec<f64>,
}

#[derive(Serialize)]
struct Answer {
    law: &'static str,
    impulse: Vec<f64>,
    u_plus: Vec<f64>,
    energy_ratio: f64,
    mode: &'static str,
    normal_work: f64,
    friction_work: f64,
    flags: Vec<&'static str>,
}

impl LawCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let (plane, space) = (self.law.laws::<2>()?, self.law.laws::<3>()?);
        let mut diagram = self.svg.as_deref();
        for_each_line(&self.problems, out, |problem: Problem, _, out| {
            if let Some(path) = diagram.take() {
                draw(path, &problem, &plane, self.law.friction)?;
            }
            let all = match problem.u.len() {
                2 => resolve(&problem, &plane)?,
                3 => resolve(&problem, &space)?,
                n => {
                    return Err(LineError(format!(
                        "u has {n} numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed"
                    ))
                    .into());
                }
            };
            all.answer(out, self.json, plane.len(), for_people)
        })
    }
}

/// Writes the Routh diagram beside its place and moves it there.
fn draw(path: &Path, problem: &Problem, laws: &Named<2>, friction: f64) -> Result<(), LineError> {
    if problem.u.len() != 2 {
        return Err(LineError("--svg draws planar problems: delassus 2×2, u = [t, n]".into()));
    }
    let all = resolve(problem, laws)?;
    let points = all.outcomes.iter().map(|a| LawPoint { law: a.law.into(), impulse: [a.impulse[0], a.impulse[1]] });
    let rows = &problem.delassus;
    let delassus = SMatrix::<f64, 2, 2>::from_fn(|i, j| rows[i][j]);
    let checked = ImpactProblem::new(delassus, SVector::from_column_slice(&problem.u))?;
    let Some(svg) = routh_diagram(&checked, friction, &points.collect::<Vec<_>>()) else {
        return Err(LineError("--svg needs a contact that approaches, and a delassus that is not singular".into()));
    };
    let partial = path.with_extension("svg.part");
    let written = std::fs::write(&partial, svg).and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|e| {
        let _ = std::fs::remove_file(&partial);
        LineError(format!("{}: cannot be written: {e}", path.display()))
    })
}

fn resolve<const D: usize>(problem: &Problem, laws: &Named<D>) -> Result<All<Answer>, LineError> {
    let rows = &problem.delassus;
    if rows.len() != D || rows.iter().any(|row| row.len() != D) {
        let shape = rows.iter().map(|row| row.len().to_string()).collect::<Vec<_>>().join(", ");
        return Err(LineError(format!(
            "delassus has rows of {shape} numbers: u has {D}, so {D} rows of {D} are needed"
        )));
    }
    let delassus = SMatrix::<f64, D, D>::from_fn(|i, j| rows[i][j]);
    let problem = ImpactProblem::new(delassus, SVector::from_column_slice(&problem.u))?;
    let mut all = All::default();
    for (name, law) in laws {
        match law.resolve(&problem) {
            Ok(hit) => {
                let (before, still) = (hit.energy_before, hit.u_minus.amax() == 0.0);
                if !before.is_finite() || (before < f64::MIN_POSITIVE && !still) {
                    let why = format!(
                        "the kinetic energy comes out as {before} J: the numbers of this line are too large, or too small, for f64"
                    );
                    return Err(LineError(why));
                }
                all.outcomes.push(Answer {
                    law: name,
                    impulse: hit.impulse.as_slice().to_vec(),
                    u_plus: hit.u_plus.as_slice().to_vec(),
                    energy_ratio: hit.energy_ratio(),
                    mode: hit.mode.name(),
                    normal_work: hit.normal_work,
                    friction_work: hit.friction_work,
                    flags: hit.flags.names().collect(),
                });
            }
            Err(why) if laws.len() > 1 => all.refuse(name, &why)?,
            Err(why) => return Err(why.into()),
        }
    }
    Ok(all)
}

fn for_people(all: &All<Answer>, out: &mut dyn Write) -> io::Result<()> {
    for a in &all.outcomes {
        let flags = if a.flags.is_empty() { String::new() } else { format!("  [{}]", a.flags.join(", ")) };
        writeln!(
            out,
            "{:16} {:12} u⁺ {}  p {}  T⁺/T⁻ {}{flags}",
            a.law,
            a.mode,
            row(&a.u_plus),
            row(&a.impulse),
            short(a.energy_ratio)
        )?;
    }
    for refused in &all.refused {
        writeln!(out, "{:16} not applicable: {}", refused.law, refused.reason)?;
    }
    writeln!(out)
}
