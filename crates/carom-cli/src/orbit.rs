//! `carom orbit`: periodic orbits, their stability, and branches of them.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::motion::write_motion;
use crate::output::{Printed, answer_about, brief, say, warn, write_whole};
use crate::plan::moving_joints;
use crate::record::Record;
use crate::rows::{RowOptions, bar};
use crate::simulate::Tables;
use carom_study::Diagram;
use carom_study::orbit::{Attractor, Branch, Orbit, OrbitError, Problem, Special};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Find a periodic orbit, its stability, and how it changes with a parameter
///
/// Input: a problem (TOML) that names a scene, the section at which a period begins and ends (an
/// impact of a contact, a linear function of the state that passes zero, or a time), and what need
/// not return or exchanges its role. Newton's method, with the derivative of the motion through its
/// impacts, finds the orbit near the start of the scene.
///
/// Output: the state on the section, the period, the events, and the multipliers: the factors by
/// which small disturbances grow in each period. The orbit is stable if all are below 1 in size.
/// With --branch the orbit is followed over the parameter of [vary], and folds, flips,
/// Neimark-Sacker points and changes of the sequence of events are located. With --cycles no orbit
/// is looked for: the motion runs from the start of the scene at each value of the parameter. With
/// --basin it runs from each start of the grid of [basin], and it is told to which attractor it leads.
/// JSON keys: joints, start {q, qd}, start_time, period, events [{time, what}],
///   multipliers [[re, im]], stability, residual, iterations; with --branch: parameter, points
///   [{parameter, as above}], passages, special [{kind, parameter, what, after}], ended, end, and
///   with --doubled: doubled [{as a branch}]; with --cycles: values, rows, failed; with --basin:
///   rows, computed, outcomes [{outcome, cells}], attractors [{period, state {q, qd}, cells}].
/// An interruption (Ctrl-C) or a full disk keeps the rows of --cycles and --basin that are done in
/// X.partial.csv or X.partial.parquet; the exit status is 1, and --resume continues.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct OrbitCommand {
    /// Problem (TOML file)
    #[arg(value_name = "PROBLEM.toml")]
    problem: PathBuf,
    /// Follow the orbit over the parameter of [vary]
    #[arg(long, conflicts_with_all = ["cycles", "basin"])]
    branch: bool,
    /// Follow also the orbits of twice the period that begin at the first flip, N times in turn
    #[arg(long, value_name = "N", default_value_t = 0, requires = "branch", conflicts_with_all = ["cycles", "basin"])]
    doubled: u8,
    /// Tell the attractor of each start of the grid of [basin]
    #[arg(long, conflicts_with = "cycles", requires = "out")]
    basin: bool,
    /// Run N cycles at each of --values values of the parameter, after --skip cycles
    #[arg(long, value_name = "N", requires = "out", value_parser = clap::value_parser!(u64).range(1..))]
    cycles: Option<u64>,
    /// Number of cycles before those that --cycles writes
    #[arg(long, value_name = "N", default_value_t = 0, requires = "cycles", conflicts_with_all = ["branch", "basin"])]
    skip: u64,
    /// Number of values of the parameter, evenly from [vary] from to to
    #[arg(long, value_name = "N", default_value_t = 1, requires = "cycles", conflicts_with_all = ["branch", "basin"], value_parser = clap::value_parser!(u64).range(1..))]
    values: u64,
    /// File to write, of the kind that the ending of its name says; may be repeated
    ///
    /// .csv, .parquet: the motion of one period, the branch, the cycles or the basin as a table. .svg: a
    /// picture of these, of the columns of --show. .rrd: a recording of one period for the Rerun viewer; needs a
    /// carom that is built with the feature `rerun`. With - the table of an orbit or a branch is
    /// on standard output as CSV, in place of the answer.
    #[arg(short, long, value_name = "FILE", verbatim_doc_comment)]
    out: Vec<PathBuf>,
    /// Column that is drawn
    ///
    /// Of a branch or of cycles a column over the parameter [default: multiplier.size; q of the first
    /// joint]; of a branch also `multipliers`, all of them in the plane of complex numbers. Of one orbit two
    /// columns, as q.left,qd.left [default: q and qd of the first joint].
    #[arg(long, value_name = "COLUMN", requires = "out", conflicts_with = "basin", verbatim_doc_comment)]
    show: Option<String>,
    #[command(flatten)]
    rows: RowOptions,
    #[command(flatten)]
    record: Record,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Found<'a> {
    joints: Vec<&'a str>,
    #[serde(flatten)]
    orbit: &'a Orbit,
}

#[derive(Serialize)]
struct Cycles {
    values: u64,
    rows: u64,
    failed: u64,
}

#[derive(Serialize)]
struct Branches {
    #[serde(flatten)]
    branch: Branch,
    #[serde(skip_serializing_if = "Option::is_none")]
    doubled: Option<Vec<Branch>>,
}

#[derive(Serialize)]
struct Basins<'a> {
    rows: u64,
    computed: u64,
    outcomes: Vec<Outcome<'a>>,
    attractors: Vec<Attractor>,
}

#[derive(Serialize)]
struct Outcome<'a> {
    outcome: &'a str,
    cells: u64,
}

impl OrbitCommand {
    pub fn run(mut self, out: &mut dyn Write) -> Result<(), CliError> {
        let numbered = self.basin || self.cycles.is_some();
        let kinds: &[Kind] = if self.branch || numbered {
            &[Kind::Table, Kind::Picture]
        } else {
            &[Kind::Table, Kind::Picture, Kind::Recording]
        };
        if let Some(option) = self.rows.given().filter(|_| !numbered) {
            return Err(CliError::Input(format!("{option} is for the rows of --cycles and --basin: leave it out")));
        }
        let outputs = Outputs::of(&self.out, kinds)?;
        self.record.check(outputs.recording.as_deref())?;
        if self.show.is_some() && outputs.picture.is_none() {
            return Err(CliError::Input("--show: no picture is written: give --out a name that ends in .svg".into()));
        }
        if self.record.is_asked() && (self.branch || numbered) {
            return Err(CliError::Input(
                "--connect and --spawn record one orbit: leave out --branch, --cycles and --basin".into(),
            ));
        }
        let mut problem = Problem::from_file(&self.problem).map_err(|e| self.refuse(e))?;
        warn(&self.problem, &problem.warnings);
        if numbered {
            files::check(&problem.files, &outputs.files())?;
            let stop = files::interrupts();
            problem.scene.simulation.stop = Some(stop.clone());
            let table = self.rows.table(&outputs)?;
            return match self.cycles {
                Some(cycles) => self.run_cycles(&problem, cycles, (table, outputs.picture.as_deref()), &stop, out),
                None => self.run_basin(&problem, (table, outputs.picture.as_deref()), &stop, out),
            };
        }
        let printed = Printed::of(outputs.tables.iter().map(PathBuf::as_path), self.json)?;
        files::check(&problem.files, &outputs.files())?;
        files::clear_when_interrupted();
        let tables: Vec<&Path> = outputs.tables.iter().map(|path| printed.place(path)).collect();
        let picture = outputs.picture.as_deref();
        if self.branch {
            let branch = self.run_branch(&problem, &tables, picture)?;
            if printed.is_asked() {
                return printed.print(out);
            }
            return answer_about(&self.problem, out, &branch, self.json, |all, out| {
                print_branch(&all.branch, out)?;
                all.doubled.iter().flatten().try_for_each(|branch| print_branch(branch, out))
            });
        }
        let orbit = problem.find().map_err(|e| self.refuse(e))?;
        let plan = problem.plan_of(&orbit).map_err(|e| self.refuse(e))?;
        write_motion((&self.problem, &problem.scene), (&plan, orbit.period), &tables, &self.record)?;
        if let Some(path) = picture {
            self.draw_period(&problem, &orbit, path)?;
        }
        if printed.is_asked() {
            return printed.print(out);
        }
        let found = Found { joints: moving_joints(&plan), orbit: &orbit };
        let names = problem.scene.simulation.state_names();
        answer_about(&self.problem, out, &found, self.json, |found, out| print_orbit(found.orbit, &names, out))
    }

    fn refuse(&self, error: OrbitError) -> CliError {
        match error {
            OrbitError::Run(error) => CliError::scene(&self.problem, error),
            OrbitError::File { .. } => CliError::Input(error.to_string()),
            other => CliError::Input(format!("{}: {other}", self.problem.display())),
        }
    }

    /// The branch and those that begin at its flips, as tables and as a picture.
    fn run_branch(&self, problem: &Problem, tables: &[&Path], picture: Option<&Path>) -> Result<Branches, CliError> {
        let (branch, doubled, fewer) = problem.branches(self.doubled).map_err(|e| self.refuse(e))?;
        if let Some(why) = fewer {
            say(&format!("warning: --doubled {}: {}", self.doubled, self.refuse(why)));
        }
        let columns = problem.branch_columns();
        let mut table = Tables::begin(tables.iter().copied(), &columns, &problem.scene.text)?;
        std::iter::once(&branch).chain(&doubled).flat_map(Branch::rows).for_each(|row| table.row(&row));
        table.finish()?;
        if let Some(path) = picture {
            let show = self.show.as_deref().unwrap_or("multiplier.size");
            let diagram = if show == "multipliers" {
                branch.multipliers()
            } else {
                let names: Vec<&str> =
                    columns.iter().filter(|it| it.words.is_empty()).map(|it| it.name.as_str()).collect();
                branch.diagram(&doubled, &columns, show).ok_or_else(|| {
                    CliError::Input(format!("--show {show}: the columns of the branch are {}", names.join(", ")))
                })?
            };
            draw(&diagram, path)?;
        }
        Ok(Branches { branch, doubled: (self.doubled > 0).then_some(doubled) })
    }

    /// The motion of one period as a picture.
    fn draw_period(&self, problem: &Problem, orbit: &Orbit, path: &Path) -> Result<(), CliError> {
        let given = self.show.as_deref().map(|show| match show.split_once(',') {
            Some((x, y)) => Ok([x.trim().to_owned(), y.trim().to_owned()]),
            None => {
                Err(CliError::Input(format!("--show {show}: the picture of one orbit has two columns: q.left,qd.left")))
            }
        });
        let usual = || {
            let why = "--show is missing: no joint has one coordinate that must return: give two columns";
            problem.usual_portrait().ok_or_else(|| CliError::Input(why.into()))
        };
        let [x, y] = given.unwrap_or_else(usual)?;
        let diagram = problem.portrait(orbit, [&x, &y]).map_err(|error| match error {
            OrbitError::File { rule, .. } => CliError::Input(format!("--show: {rule}")),
            other => self.refuse(other),
        })?;
        draw(&diagram, path)
    }

    /// The table of cycles.
    fn run_cycles(
        &self,
        problem: &Problem,
        keep: u64,
        (table, picture): (Option<&Path>, Option<&Path>),
        stop: &AtomicBool,
        out: &mut dyn Write,
    ) -> Result<(), CliError> {
        let mut cycles = problem.cycles(self.values, self.skip, keep).map_err(|e| self.refuse(e))?;
        if picture.is_some() {
            let usual = problem.usual_portrait().map(|[q, _]| q);
            let show = self.show.clone().or(usual).unwrap_or_default();
            cycles = cycles.drawing(&show).map_err(|e| self.refuse(e))?;
        }
        let rows = self.rows.rows(&cycles);
        let count = rows.end - rows.start;
        let pool = self.rows.pool()?;
        if let Some(path) = table {
            self.rows.write(&cycles, (path, rows), (&pool, stop))?;
        }
        if let Some(path) = picture {
            let bar = bar(count);
            let diagram = pool.install(|| cycles.picture(&|rows| bar.inc(rows), stop));
            draw(&diagram.ok_or_else(interrupted)?, path)?;
        }
        let (failed, first) = cycles.failures();
        let name = problem.parameter_name();
        if let Some((value, error)) = first {
            warn(&self.problem, [format!("{name} = {value}: {error}")]);
        }
        let done = Cycles { values: count / keep, rows: count, failed };
        answer_about(&self.problem, out, &done, self.json, |done, out| {
            writeln!(out, "{} rows: cycles at {} values of {name}", done.rows, done.values)?;
            if done.failed > 0 {
                writeln!(out, "at {} values the motion does not return to the section", done.failed)
            } else {
                Ok(())
            }
        })
    }

    /// The table and the picture of a basin.
    fn run_basin(
        &self,
        problem: &Problem,
        (table, picture): (Option<&Path>, Option<&Path>),
        stop: &AtomicBool,
        out: &mut dyn Write,
    ) -> Result<(), CliError> {
        let basin = problem.basin().map_err(|e| self.refuse(e))?;
        let rows = self.rows.rows(&basin);
        let count = rows.end - rows.start;
        let pool = self.rows.pool()?;
        if let Some(path) = table {
            self.rows.write(&basin, (path, rows), (&pool, stop))?;
        }
        if let Some(path) = picture {
            let bar = bar(count);
            let svg = pool.install(|| basin.picture(&|cells| bar.inc(cells), stop)).map_err(|e| self.refuse(e))?;
            write_whole(path, &svg.ok_or_else(interrupted)?)?;
        }
        let outcomes: Vec<Outcome> =
            basin.outcomes().into_iter().map(|(outcome, cells)| Outcome { outcome, cells }).collect();
        let computed = outcomes.iter().map(|it| it.cells).sum();
        let done = Basins { rows: count, computed, outcomes, attractors: basin.attractors() };
        answer_about(&self.problem, out, &done, self.json, print_basin)
    }
}

fn interrupted() -> CliError {
    CliError::Input("interrupted: the picture is not written".into())
}

/// Writes a diagram as SVG.
fn draw(diagram: &Diagram<2>, path: &Path) -> Result<(), CliError> {
    let undrawn = || CliError::Input(format!("--out {}: the numbers cannot be drawn", path.display()));
    write_whole(path, &diagram.svg().ok_or_else(undrawn)?)
}

/// Number of attractors that are listed for people.
const LISTED: usize = 20;

fn print_basin(basin: &Basins, out: &mut dyn Write) -> io::Result<()> {
    let Basins { rows, computed, outcomes, attractors } = basin;
    writeln!(out, "{rows} cells, of which {computed} were computed")?;
    for Outcome { outcome, cells } in outcomes {
        writeln!(out, "{outcome:>14} {cells:>9}")?;
    }
    writeln!(out)?;
    writeln!(out, "attractors: period in cycles, cells, state on the section")?;
    for Attractor { period, state, cells } in attractors.iter().take(LISTED) {
        let numbers: Vec<String> = state.q.iter().chain(&state.qd).map(|x| brief(*x)).collect();
        writeln!(out, "{period:>14} {cells:>9}  {}", numbers.join(" "))?;
    }
    match attractors.len().saturating_sub(LISTED) {
        0 => Ok(()),
        more => writeln!(out, "and {more} more"),
    }
}

fn print_orbit(orbit: &Orbit, names: &[String], out: &mut dyn Write) -> io::Result<()> {
    let what = orbit.stability.name();
    writeln!(
        out,
        "{what} orbit of period {} s, found in {} steps; P(x) - x is {:.0e}",
        orbit.period, orbit.iterations, orbit.residual
    )?;
    writeln!(out)?;
    writeln!(out, "state on the section:")?;
    let numbers = orbit.start.q.iter().chain(&orbit.start.qd);
    if names.len() == orbit.start.q.len() + orbit.start.qd.len() {
        let width = names.iter().map(|name| name.chars().count()).max().unwrap_or_default();
        names.iter().zip(numbers).try_for_each(|(name, x)| writeln!(out, "  {name:width$}  {x:>19.13}"))?;
    } else {
        writeln!(out, "  q  {:?}\n  qd {:?}", orbit.start.q, orbit.start.qd)?;
    }
    writeln!(out)?;
    writeln!(out, "events:")?;
    orbit.events.iter().try_for_each(|event| writeln!(out, "  {:>12.9} s  {}", event.time, event.what))?;
    writeln!(out)?;
    writeln!(out, "multipliers, of small disturbances in each period:")?;
    for x in orbit.lasting() {
        let imaginary = if x.im == 0.0 {
            String::new()
        } else {
            format!(" {} {:.9} i", if x.im < 0.0 { '-' } else { '+' }, x.im.abs())
        };
        writeln!(out, "  {:>12.9}{imaginary:18}  |.| {:.9}", x.re, x.norm())?;
    }
    match orbit.multipliers.len() - orbit.lasting().len() {
        0 => Ok(()),
        zeros => writeln!(
            out,
            "  and {zeros} below 1e-7: of directions that contacts or the section forbid, or that die out"
        ),
    }
}

fn print_branch(branch: &Branch, out: &mut dyn Write) -> io::Result<()> {
    let name = &branch.parameter;
    if branch.passages > 1 {
        writeln!(out, "orbits of {} passages", branch.passages)?;
    }
    writeln!(out, "{:>14}  {:>14}  {:>26}  stability", brief_head(name), "period, s", "largest multiplier")?;
    for point in &branch.points {
        let orbit = &point.orbit;
        let largest = orbit.multipliers.first().copied().unwrap_or_default();
        let sign = if largest.im < 0.0 { '-' } else { '+' };
        let text = if largest.im == 0.0 {
            format!("{:.6}", largest.re)
        } else {
            format!("{:.6} {sign} {:.6} i", largest.re, largest.im.abs())
        };
        writeln!(
            out,
            "{:>14}  {:>14.9}  {text:>26}  {}",
            brief(point.parameter),
            orbit.period,
            orbit.stability.name()
        )?;
    }
    writeln!(out)?;
    for Special { kind, parameter, what, .. } in &branch.special {
        writeln!(out, "{kind} at {name} = {parameter:.9}: {what}")?;
    }
    writeln!(out, "the branch ends at {}", branch.end)
}

/// A name of at most 14 characters.
fn brief_head(name: &str) -> String {
    if name.chars().count() <= 14 { name.to_owned() } else { name.chars().take(13).chain(['…']).collect() }
}
