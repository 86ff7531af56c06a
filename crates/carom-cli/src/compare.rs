//! `carom compare`: every impact law on measured data.

use crate::error::CliError;
use crate::fit::{AtRobot, bar};
use crate::input::{Given, words};
use crate::output::{make_folder, to_json, write_whole};
use crate::{files, output::answer_about};
use carom_evidence::compare::{
    CompareOptions, Comparison, DataSet, TossCases, compare, data_sets, markdown, summary, svg, toss_cases,
};
use carom_study::Horizon;
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Compare all impact laws on measured data
///
/// Fits every law to each data set by cross-validation and judges it by the measurements that its
/// coefficients were not fitted to. The measurements are dealt out to --folds folds by a seeded
/// shuffle; for each fold the coefficients are fitted to the mean error outside it.
///
/// Input: your own impacts as `carom fit --velocities` reads them, as JSON lines (.jsonl; - is
/// standard input) or as a CSV table with the columns q.<joint>, qd_minus.<joint>, qd_plus.<joint>,
/// with --robot, --tip and --normal; or published measurements: folders, folders of such folders, or
/// tables. A folder is recognised by its content:
/// tosses.csv with a URDF (as for `carom tosses`; of several URDF files the one whose name begins
/// the names of all others); a CSV table of single impacts of a planar ellipse (columns pre_vx,
/// pre_vy, pre_w, post_…, d_x, d_y, d_th, n_…) or of a dropped square (columns drop, pre_x, pre_z,
/// pre_th, pre_vx, pre_vz, pre_w, post_…, n_post); a CSV table of landings of a biped with the links
/// and joints of Cassie, beside its URDF (columns log, t, base_qw …, hip_roll_left,
/// hip_roll_leftdot …, hip_roll_left_motor …; samples every 0.5 ms). The names of the tables do not
/// matter.
/// Models: every law with constant coefficients; then effects, each in addition to those above:
///   arm        the tangential lever arm of the ellipse as a multiple of that of the table
///   strikes    strikes of further corners of the square before its velocity is measured
///   corners    radius of the corners of boxes, and length added to their edges (tosses)
///   hinge      viscous damping and dry friction of the joints (tosses)
///   inertia    multiples of the second moments of mass (tosses of one link)
///   masses     the same and a multiple of the masses after the first link (tosses of several)
///   placement  offsets of the origins of the joints (tosses)
///   floor      height of the floor (tosses)
///   speed      restitution e (v/v1)^-nu for the approach speed v, with v1 = 1 m/s
///   errors     errors of the measured angles of the start: their mean is predicted (tosses)
///   rotors     reflected inertias of the motors' rotors (landings)
///   rods       rods from thigh to heel that close loops (landings)
///   springs    springs of knee and heel, and the measured torques of the motors (landings)
///   toe        an inertia of the toe's drive beyond that of its rotor (landings)
/// Effects are added to every law for single impacts and landings, and for tosses to the law with the
/// least error of the measurements that it is fitted to, judged from the fitted start alone. For each
/// fold a model is selected by the measurements outside it: an effect is accepted if it lowers their
/// error by more than two standard errors.
/// Output: for your own impacts the table of all laws with their mean error on held-out impacts, as
/// share of the velocity before; for each other set the best law, its mean error on held-out measurements with its standard
/// error, the next law with the paired difference, and the bound of any impulse at the point or the
/// floor from the noise of the start. Tosses are judged to 0.1 s after the first impact and as a
/// whole, from starts fitted to the flight and from starts given by the table; landings 7 and 5 ms
/// after them, in folds of whole logs.
/// --out writes a Markdown table and an SVG picture of each set, summary.md and compare.json.
/// JSON keys: seed, folds, comparisons [{set, what, measure, numbers, folds, left_out, rows [{law,
///   several, effects, coefficients [{name, values}], mean, standard_error, median, below_threshold,
///   to_best and to_simpler {mean, standard_error}, refused, errors}], bound and floor {mean,
///   standard_error, median}, selected {models, mean, standard_error, median, to_constant, errors},
///   weakest {model, direction [[name, component]], deviation, least_deviation}}].
/// JSON keys of --export, for each set of tosses: set, urdf, gravity, folds, seed, trials, horizon,
///   length, max_friction, cases [{number, fold, fitted, fitted_start and given_start {q, qd}, times,
///   poses [q], early (index of the last sample to 0.1 s after the first impact)}].
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct CompareCommand {
    /// Own impacts, folders or tables
    #[arg(value_name = "DATA", required = true)]
    data: Vec<PathBuf>,
    #[command(flatten)]
    at: AtRobot,
    /// Number of folds, 2 or more
    #[arg(long, value_name = "K", default_value_t = 5)]
    folds: usize,
    /// Seed of the folds, of the tosses that are fitted, and of the perturbed starts
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Largest friction of the search, above 0, at most 100
    #[arg(long, value_name = "MU", default_value_t = 1.0, allow_hyphen_values = true)]
    max_friction: f64,
    /// Sets of parameters that each model may try on tosses and landings for each fold
    #[arg(long, value_name = "N", default_value_t = 60)]
    trials: usize,
    /// Tosses to which parameters are fitted; all tosses are judged
    #[arg(long, value_name = "N", default_value_t = 60)]
    tosses: usize,
    /// Part of the tosses whose error is fitted: whole, or early, to 0.1 s after the first impact
    #[arg(long, value_parser = words(&Horizon::ALL, Horizon::name), default_value = "early")]
    horizon: Horizon,
    /// Part of the tosses that is judged: whole, with the early part, or early alone, which is many times faster
    #[arg(long, value_parser = words(&Horizon::ALL, Horizon::name), default_value = "whole")]
    judge: Horizon,
    /// Length L of the pose error of tosses, m: mean |Δp|²/L + mean Δθ² over the samples
    #[arg(long, value_name = "METRES", default_value_t = 0.0524, allow_hyphen_values = true)]
    length: f64,
    /// Relative tolerance of the integration of tosses and landings
    #[arg(long, default_value = "1e-5", allow_hyphen_values = true)]
    tolerance: f64,
    /// Length of a time step of tosses, where time steps are computed, s
    #[arg(long, value_name = "SECONDS", default_value_t = 1e-3, allow_hyphen_values = true)]
    contact_step: f64,
    /// Folder for the tables, pictures and the JSON file
    #[arg(short, long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Write the tosses with their starts, folds and measured poses to a JSON file, for other
    /// simulators, and compare nothing
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "json"], verbatim_doc_comment)]
    export: Option<PathBuf>,
    /// Print one line of JSON, with the error of every measurement, instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    seed: u64,
    folds: usize,
    comparisons: Vec<Comparison>,
}

impl CompareCommand {
    pub fn run(self, given: &Given, out: &mut dyn Write) -> Result<(), CliError> {
        if let Some(folder) = &self.out {
            files::check_folder(folder)?;
        }
        files::check(&[], &[("--export", self.export.as_deref())])?;
        let options = CompareOptions {
            folds: self.folds,
            seed: self.seed,
            max_friction: self.max_friction,
            trials: self.trials,
            tosses: self.tosses,
            horizon: self.horizon,
            judged: self.judge,
            tolerance: self.tolerance,
            contact_step: self.contact_step,
            length: self.length,
        };
        let load = self.at.load.options(true)?;
        let mut sets = Vec::new();
        let mut own = Vec::new();
        for path in &self.data {
            if is_own(path) {
                self.at.refuse(given)?;
                let (impacts, _) = self.at.jumps(path)?;
                let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
                let name = if path == Path::new("-") { "impacts".into() } else { stem };
                own.push(sets.len());
                sets.push(DataSet::of_impacts(name, (1..=impacts.len() as i64).collect(), impacts));
            } else {
                sets.extend(data_sets(path, &load)?);
            }
        }
        if own.is_empty() {
            let rule = "they belong to your own impacts, and none of the data are: give JSON lines (.jsonl), or a CSV table with \
                        the columns q.<joint>, qd_minus.<joint>, qd_plus.<joint>";
            given.refuse(&["robot", "floating", "joints", "tip", "point", "normal"], rule)?;
        }
        let rolls = |set: &DataSet| set.is_of_tosses() || set.is_of_landings();
        if !sets.iter().any(rolls) {
            let rule = "they are about tosses and landings, and none of the data are: leave them out";
            given.refuse(&["trials", "tolerance"], rule)?;
        }
        if !sets.iter().any(DataSet::is_of_tosses) {
            let rule = "they are about tosses, and none of the data are: leave them out";
            given.refuse(&["tosses", "horizon", "judge", "length", "contact-step"], rule)?;
        }
        if let Some(file) = &self.export {
            let cases: Vec<Option<TossCases>> =
                sets.iter().map(|set| toss_cases(set, &options)).collect::<Result<_, _>>()?;
            let cases: Vec<TossCases> = cases.into_iter().flatten().collect();
            if cases.is_empty() {
                return Err(CliError::Input("--export: none of the data sets has tosses".into()));
            }
            let json = to_json(&cases).map_err(CliError::Output)?;
            return write_whole(file, &format!("{json}\n"));
        }
        let mut comparisons: Vec<Vec<Comparison>> = Vec::new();
        for set in &sets {
            let bar = bar("steps");
            comparisons.push(compare(set, &options, &|done, all| bar.tell(done, all))?);
        }
        let (pages, others): (Vec<_>, Vec<_>) = comparisons.iter().enumerate().partition(|(k, _)| own.contains(k));
        let mut printed: String = pages.iter().map(|(_, one)| markdown(one)).collect();
        if !others.is_empty() {
            printed += &summary(&others.into_iter().flat_map(|(_, one)| one.clone()).collect::<Vec<_>>());
        }
        let report = |comparisons| Report { seed: self.seed, folds: self.folds, comparisons };
        let all: Vec<Comparison> = comparisons.concat();
        if let Some(folder) = &self.out {
            make_folder(folder)?;
            for (k, one) in comparisons.iter().enumerate() {
                // two sets of the same name are numbered
                let same = sets[..k].iter().filter(|set| set.name == sets[k].name).count();
                let name = if same == 0 { sets[k].name.clone() } else { format!("{}-{}", sets[k].name, same + 1) };
                write_whole(&folder.join(format!("{name}.md")), &markdown(one))?;
                write_whole(&folder.join(format!("{name}.svg")), &svg(one)?)?;
            }
            write_whole(&folder.join("summary.md"), &summary(&all))?;
            let json = to_json(&report(all.clone())).map_err(CliError::Output)?;
            write_whole(&folder.join("compare.json"), &format!("{json}\n"))?;
        }
        let told = |_: &Report, out: &mut dyn Write| -> io::Result<()> {
            printed.lines().try_for_each(|line| writeln!(out, "{line}"))
        };
        answer_about(&self.data[0], out, &report(all), self.json, told)
    }
}

/// Whether a file holds impacts as `carom fit --velocities` reads them: JSON lines, or a table with velocities of joints.
fn is_own(path: &Path) -> bool {
    let ends = |ending: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    let table = || {
        let header = csv::Reader::from_path(path).and_then(|mut reader| reader.headers().cloned());
        header.is_ok_and(|header| header.iter().any(|name| name.trim().starts_with("qd_plus.")))
    };
    path == Path::new("-") || ends("jsonl") || ends("json") || (ends("csv") && table())
}
