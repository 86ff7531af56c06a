//! `carom law`: impact laws on given Delassus matrices and contact velocities.

use crate::error::{CliError, LineError, Refused};
use crate::files::{self, Kind, Outputs};
use crate::input::{check_coefficients, for_each_line, name, within};
use crate::output::{answer, row, say, short, write_whole};
use crate::record::{Record, record_diagrams};
use carom_impact::{
    Coefficients, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, LAWS, Law, LawInfo, law_by_name,
};
use carom_study::{Diagram, LawPoint, hodograph, impulse_space, routh_diagram};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The values of an option that takes a law, each with its description. An alias is read as the name of its law.
pub fn laws(all: bool) -> impl TypedValueParser<Value = String> {
    let all =
        all.then(|| PossibleValue::new("all").help("every law; those without an answer are listed with the reason"));
    let own = LAWS.into_iter().map(|law| {
        let also = match law.aliases {
            [] => String::new(),
            [one] => format!(" [alias: {one}]"),
            all => format!(" [aliases: {}]", all.join(", ")),
        };
        PossibleValue::new(law.name).help(format!("{}{also}", law.summary)).aliases(law.aliases)
    });
    let name = |given: String| LawInfo::named(&given).map_or(given, |law| law.name.to_owned());
    PossibleValuesParser::new(own.chain(all)).map(name)
}

// Which law, with which coefficients.
#[derive(Args)]
pub struct LawArgs {
    /// Impact law
    #[arg(long, value_parser = laws(true))]
    law: String,
    /// Coefficient of restitution, 0 to 1
    ///
    /// The ratio of normal velocities, except for two laws: the ratio of normal impulses for
    /// poisson, the square root of the ratio of normal works for energetic.
    #[arg(long, visible_alias = "e", value_name = "E", allow_hyphen_values = true, verbatim_doc_comment)]
    pub restitution: f64,
    /// Coefficient of Coulomb friction, 0 or more
    #[arg(long, visible_alias = "mu", value_name = "MU", default_value_t = 0.0, allow_hyphen_values = true)]
    pub friction: f64,
    /// Coefficient of tangential restitution, -1 to 1, of chatterjee-ruina only [default: 0]
    #[arg(long, value_name = "ET", allow_hyphen_values = true)]
    tangential_restitution: Option<f64>,
}

/// The checked `--tangential-restitution`, with a warning if the law does not use it.
pub fn tangential(law: &str, given: Option<f64>) -> Result<f64, CliError> {
    let Some(et) = given else { return Ok(0.0) };
    let rule = "a coefficient of tangential restitution lies between -1 and 1";
    within("--tangential-restitution", et, -1.0..=1.0, rule)?;
    if LawInfo::named(law).is_some_and(|law| !law.has("tangential_restitution")) {
        say(&format!("warning: --tangential-restitution is not used by {law}"));
    }
    Ok(et)
}

/// Laws with their names.
type Named<const D: usize> = Vec<(&'static str, Box<dyn Law<f64, D> + Send + Sync>)>;

impl LawArgs {
    /// The laws asked for.
    pub fn laws<const D: usize>(&self) -> Result<Named<D>, CliError> {
        check_coefficients(self.restitution, self.friction)?;
        let tangential_restitution = tangential(&self.law, self.tangential_restitution)?;
        let asked = LAW_NAMES.into_iter().filter(|&name| self.law == "all" || self.law == name);
        let (restitution, friction) = (self.restitution, self.friction);
        let coefficients = Coefficients { restitution, tangential_restitution, friction };
        let law = |name| Some((name, law_by_name(name, coefficients)?));
        Ok(asked.filter_map(law).collect())
    }
}

/// The answers of `--law all`, and the laws that have no solution for this problem.
#[derive(Serialize)]
pub struct All<A> {
    pub outcomes: Vec<A>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<Refusal>,
}

/// A law that has no solution for this problem, and why.
#[derive(Serialize)]
pub struct Refusal {
    pub law: &'static str,
    pub reason: String,
}

/// Prints the laws that have no solution, each on a line.
pub fn print_refused(all: &[Refusal], out: &mut dyn Write) -> io::Result<()> {
    all.iter().try_for_each(|one| writeln!(out, "{:16} not applicable: {}", one.law, one.reason))
}

impl<A> Default for All<A> {
    fn default() -> Self {
        Self { outcomes: Vec::new(), refused: Vec::new() }
    }
}

impl<A: Serialize> All<A> {
    /// Keeps the refusal of one law beside the answers of the others.
    ///
    /// # Errors
    /// A reason that holds for every law: the whole line is refused.
    pub fn refuse(&mut self, law: &'static str, why: &ImpactError) -> Result<(), LineError> {
        match why {
            ImpactError::Wedged { .. } => {
                self.refused.push(Refusal { law, reason: why.to_string() });
                Ok(())
            }
            _ => Err(LineError(why.to_string())),
        }
    }

    /// Writes the answers: the outcome itself if one law was asked for, else the lists of outcomes and refusals.
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

/// Apply impact laws to a given Delassus matrix and contact velocity
///
/// Solves u⁺ = u⁻ + H p for the impulse p of one contact, in the plane or in space; no robot is
/// needed.
///
/// Input: problems, one JSON object per line (--problems), in contact axes.
/// Output, for each problem and law: mode (open, stick, slip, reverse-slip), u⁺ (m/s), impulse p on
/// the robot (N s), ratio of kinetic energies T⁺/T⁻, and flags:
///   energy-gain  the law created kinetic energy
///   jam          friction drives the contact deeper at first (Painlevé)
///   singular     H has a null direction with a normal component, and the answer depends on it
///   grazing      the approach is slower than 1e-9 of the contact speed
///   non-unique   other impulses satisfy the law too; the answer lists them as branches
///   no-approach  the contact does not approach; the impulse is zero
/// JSON keys: law, impulse, u_plus, energy_ratio, mode, normal_work and friction_work (J), flags,
///   branches if there are several; with --law all {"outcomes":[…]}, and "refused":[…] of laws
///   without a solution.
/// Answers are printed in the order of the lines. If a line is refused, the answers to the lines
/// above it have been printed, no picture and no recording is written, and the exit status is 1.
#[derive(Args)]
#[command(verbatim_doc_comment)]
#[command(override_usage = "carom law [OPTIONS] --law <LAW> --restitution <E> --problems <FILE>")]
pub struct LawCommand {
    #[command(flatten)]
    law: LawArgs,
    /// Problems, one JSON object per line; - is standard input
    ///
    /// {"delassus":[[…],…],"u":[…]}: H = J M⁻¹ Jᵀ (1/kg) and u⁻ (m/s) in contact axes, tangents
    /// first, normal last: (t, n) in the plane, (t1, t2, n) in space. The normal points to the
    /// robot, so an approach has u_n < 0. Empty lines are skipped.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    problems: PathBuf,
    /// Draw (.svg) or record (.rrd) the first problem with its answers; may be repeated
    ///
    /// In the plane, the Routh diagram: the plane of impulses with friction cone, lines of
    /// compression and sticking, energy ellipse, permissible region and every law's impulse. In
    /// space, the hodograph: the plane of slip velocities with the path of the slip, the
    /// invariant directions and every law's u⁺.
    #[arg(short, long, aliases = ["svg", "rrd"], value_name = "FILE", verbatim_doc_comment)]
    out: Vec<PathBuf>,
    #[command(flatten)]
    record: Record,
    /// Print one line of JSON for each line of input instead of a table
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
    /// All outcomes that satisfy the law, this one first; left out if there is one only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    branches: Vec<Branch>,
}

/// One of several outcomes that satisfy a law.
#[derive(Serialize)]
pub struct Branch {
    /// Of an impact of a robot.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub qd_plus: Vec<f64>,
    pub impulse: Vec<f64>,
    pub u_plus: Vec<f64>,
    pub mode: &'static str,
    pub energy_ratio: f64,
}

impl LawCommand {
    pub fn run(mut self, out: &mut dyn Write) -> Result<(), CliError> {
        let (plane, space) = (self.law.laws::<2>()?, self.law.laws::<3>()?);
        let outputs = Outputs::of(&self.out, &[Kind::Picture, Kind::Recording])?;
        self.record.check(outputs.recording.as_deref())?;
        let reads: Vec<PathBuf> =
            (self.problems != Path::new("-")).then(|| self.problems.clone()).into_iter().collect();
        files::check(&reads, &outputs.files())?;
        let mut drawn = outputs.picture.is_none() && !self.record.is_asked();
        let mut drawing = None;
        for_each_line(&self.problems, out, |problem: Problem, _, out| {
            let first = !std::mem::replace(&mut drawn, true);
            let all = match problem.u.len() {
                2 => {
                    let all = resolve(&problem, &plane)?;
                    if first {
                        let routh = routh_diagram(&problem.checked()?, self.law.friction, &points(&all));
                        drawing = Some(Drawing::of(&all, routh, None)?);
                    }
                    all
                }
                3 => {
                    let all = resolve(&problem, &space)?;
                    if first {
                        let (problem, points) = (problem.checked()?, points(&all));
                        let slips = hodograph(&problem, self.law.friction, &points);
                        let space = impulse_space(&problem, self.law.friction, &points);
                        drawing = Some(Drawing::of(&all, slips, space)?);
                    }
                    all
                }
                n => {
                    return Err(LineError(format!(
                        "u has {n} numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed"
                    ))
                    .into());
                }
            };
            all.answer(out, self.json, plane.len(), for_people)
        })?;
        // Files are written only after every line has been answered.
        if let Some(Drawing { svg, plane, space, words }) = &drawing {
            if self.record.is_asked() {
                record_diagrams(&self.record, plane, space.as_ref(), words)?;
            }
            outputs.picture.as_ref().map_or(Ok(()), |path| write_whole(path, svg))?;
        }
        if drawn {
            return Ok(());
        }
        Err(CliError::Input(format!("{}: it holds no problem to draw: give at least one line", name(&self.problems))))
    }
}

/// What is drawn of the first problem.
struct Drawing {
    svg: String,
    plane: Diagram<2>,
    /// Used by recordings only.
    space: Option<Diagram<3>>,
    words: String,
}

impl Drawing {
    fn of(all: &All<Answer>, plane: Option<Diagram<2>>, space: Option<Diagram<3>>) -> Result<Self, LineError> {
        let missing = || {
            LineError(
                "no picture can be drawn: the contact must approach (u_n < 0) and delassus must not be singular".into(),
            )
        };
        let plane = plane.ok_or_else(missing)?;
        Ok(Self { svg: plane.svg().ok_or_else(missing)?, plane, space, words: page(all) })
    }
}

impl Problem {
    /// The problem, whose u has D numbers.
    fn checked<const D: usize>(&self) -> Result<ImpactProblem<f64, D>, LineError> {
        Ok(ImpactProblem::new(square(&self.delassus, "u")?, SVector::from_column_slice(&self.u))?)
    }
}

/// The Delassus matrix of a line, beside the velocity called `of`.
pub fn square<const D: usize>(rows: &[Vec<f64>], of: &str) -> Result<SMatrix<f64, D, D>, LineError> {
    if rows.len() != D || rows.iter().any(|row| row.len() != D) {
        let shape = rows.iter().map(|row| row.len().to_string()).collect::<Vec<_>>().join(", ");
        return Err(LineError(format!(
            "delassus has rows of {shape} numbers: {of} has {D}, so {D} rows of {D} are needed"
        )));
    }
    Ok(SMatrix::from_fn(|i, j| rows[i][j]))
}

fn points<const D: usize>(all: &All<Answer>) -> Vec<LawPoint<D>> {
    let point = |a: &Answer| LawPoint { law: a.law.into(), impulse: std::array::from_fn(|k| a.impulse[k]) };
    all.outcomes.iter().map(point).collect()
}

/// The answers as a Markdown page of a recording.
fn page(all: &All<Answer>) -> String {
    let vector = |numbers: &[f64]| numbers.iter().map(|x| short(*x)).collect::<Vec<_>>().join(", ");
    let mut page = "| law | mode | u⁺, m/s | P, N s | T⁺/T⁻ | |\n| --- | --- | --- | --- | --- | --- |\n".to_owned();
    for a in &all.outcomes {
        let (u_plus, impulse, ratio) = (vector(&a.u_plus), vector(&a.impulse), short(a.energy_ratio));
        page += &format!("| {} | {} | {u_plus} | {impulse} | {ratio} | {} |\n", a.law, a.mode, a.flags.join(", "));
    }
    for refused in &all.refused {
        page += &format!("\n{} is not applicable: {}\n", refused.law, refused.reason);
    }
    page
}

fn resolve<const D: usize>(problem: &Problem, laws: &Named<D>) -> Result<All<Answer>, LineError> {
    let problem = problem.checked::<D>()?;
    let mut all = All::default();
    for (name, law) in laws {
        match law.branches(&problem) {
            Ok(hits) => {
                let Some(hit) = hits.first() else { continue };
                let (before, still) = (hit.energy_before, hit.u_minus.amax() == 0.0);
                if !before.is_finite() || (before < f64::MIN_POSITIVE && !still) {
                    let why = format!(
                        "the kinetic energy is {before} J: the numbers of this line are too large, or too small, for f64"
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
                    branches: if hits.len() > 1 { hits.iter().map(branch).collect() } else { Vec::new() },
                });
            }
            Err(why) if laws.len() > 1 => all.refuse(name, &why)?,
            Err(why) => return Err(why.into()),
        }
    }
    Ok(all)
}

fn branch<const D: usize>(hit: &ImpactOutcome<f64, D>) -> Branch {
    Branch {
        qd_plus: Vec::new(),
        impulse: hit.impulse.as_slice().to_vec(),
        u_plus: hit.u_plus.as_slice().to_vec(),
        mode: hit.mode.name(),
        energy_ratio: hit.energy_ratio(),
    }
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
        for other in a.branches.iter().skip(1) {
            let (u_plus, p) = (row(&other.u_plus), row(&other.impulse));
            writeln!(
                out,
                "  or also        {:12} u⁺ {u_plus}  p {p}  T⁺/T⁻ {}",
                other.mode,
                short(other.energy_ratio)
            )?;
        }
    }
    print_refused(&all.refused, out)?;
    writeln!(out)
}
