//! `carom simulate`: a scene, from its file to its events.

use crate::error::CliError;
use crate::output::{answer, say, short};
use crate::record::{Record, Recorder};
use carom_chain::{Chain, Coordinates};
use carom_sim::{Event, EventKind, Moment, Sampling, Scene, Seen, Simulation, Statistics};
use clap::Args;
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Samples of tables and recordings where the scene names no interval: the paper's 4 ms.
const SAMPLE: f64 = 0.004;

#[derive(Args)]
pub struct Simulate {
    /// The scene, TOML
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Write a table of time, q and qd, at the scene's sampling interval (or 4 ms)
    #[arg(long, value_name = "X.csv")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    record: Record,
    /// One line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Summary<'a> {
    stop_reason: &'static str,
    mode: &'static str,
    events: Vec<Happened<'a>>,
    r#final: Last<'a>,
    energy: Energy,
    statistics: Cost,
}

#[derive(Serialize)]
struct Happened<'a> {
    time: f64,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    contact: Option<&'a str>,
    q: &'a [f64],
    qd_minus: &'a [f64],
    qd_plus: &'a [f64],
    #[serde(skip_serializing_if = "Option::is_none")]
    impact: Option<Impact>,
}

#[derive(Serialize)]
struct Impact {
    law: &'static str,
    impulse: [f64; 3],
    u_minus: [f64; 3],
    u_plus: [f64; 3],
    energy_before: f64,
    energy_after: f64,
    mode: &'static str,
    normal_work: f64,
    friction_work: f64,
    flags: Vec<&'static str>,
}

#[derive(Serialize)]
struct Last<'a> {
    time: f64,
    q: &'a [f64],
    qd: &'a [f64],
}

#[derive(Serialize)]
struct Energy {
    start: f64,
    end: f64,
    lost_in_impacts: f64,
}

#[derive(Serialize)]
struct Cost {
    steps: usize,
    rejections: usize,
    evaluations: usize,
    refinements: usize,
}

impl Simulate {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let refuse = |e| CliError::scene(&self.scene, e);
        let scene = Scene::from_file(&self.scene).map_err(refuse)?;
        for warning in &scene.warnings {
            say(&format!("warning: {}: {warning}", self.scene.display()));
        }
        let plan = scene.plan().map_err(refuse)?;
        let sim = &plan.simulation;
        let mut table = self.csv.as_deref().map(|path| Table::begin(path, &sim.chain)).transpose()?;
        let mut recorder = Recorder::begin(&self.record, &scene, &plan)?;
        let sampled = table.is_some() || recorder.is_some();
        let every = sampled.then(|| scene.sample.unwrap_or(SAMPLE));
        let mut events = Vec::new();
        let sampling = Sampling { every, dense: false };
        let run = sim.stream(&plan.q, &plan.qd, scene.duration, sampling, &mut |seen| {
            match &seen {
                Seen::Moment(moment) => table.iter_mut().for_each(|table| table.row(moment)),
                Seen::Event(event) => events.push((*event).clone()),
                Seen::Segment(_) => {}
            }
            if let Some(recorder) = &mut recorder {
                recorder.see(seen);
            }
        });
        let run = run.map_err(refuse)?;
        if let Some(table) = table {
            table.finish()?;
        }
        if let Some(recorder) = recorder {
            recorder.finish(&run)?;
        }
        let written =
            answer(out, &summary(sim, &events, &run), self.json, |_, out| for_people(sim, &events, &run, out));
        written.map_err(|refused| CliError::refused(&self.scene, refused))
    }
}

fn summary<'a>(sim: &'a Simulation, events: &'a [Event], run: &'a carom_sim::Summary) -> Summary<'a> {
    let happened = |e: &'a Event| Happened {
        time: e.time,
        kind: e.kind.name(),
        contact: contact(sim, &e.kind),
        q: &e.q,
        qd_minus: &e.qd_minus,
        qd_plus: &e.qd_plus,
        impact: match &e.kind {
            EventKind::Impact { touch, hit } => Some(Impact {
                law: sim.touches[*touch].contact.law,
                impulse: hit.impulse.into(),
                u_minus: hit.u_minus.into(),
                u_plus: hit.u_plus.into(),
                energy_before: hit.energy_before,
                energy_after: hit.energy_after,
                mode: hit.mode.name(),
                normal_work: hit.contact.normal_work,
                friction_work: hit.contact.friction_work,
                flags: hit.flags.names().collect(),
            }),
            _ => None,
        },
    };
    let Statistics { steps, rejections, evaluations, refinements, .. } = run.statistics;
    Summary {
        stop_reason: run.stop.name(),
        mode: run.mode.name(),
        events: events.iter().map(happened).collect(),
        r#final: Last { time: run.last.time, q: &run.last.q, qd: &run.last.qd },
        energy: Energy { start: run.energy.start, end: run.energy.end, lost_in_impacts: run.energy.impacts },
        statistics: Cost { steps, rejections, evaluations, refinements },
    }
}

fn contact<'a>(sim: &'a Simulation, kind: &'a EventKind) -> Option<&'a str> {
    match kind {
        EventKind::Limit { joint, .. } => Some(joint),
        other => other.touch().map(|touch| sim.touches[touch].name.as_str()),
    }
}

fn for_people(sim: &Simulation, events: &[Event], run: &carom_sim::Summary, out: &mut dyn Write) -> io::Result<()> {
    for event in events {
        write!(
            out,
            "{:>14} s  {:10} {}",
            short(event.time),
            event.kind.name(),
            contact(sim, &event.kind).unwrap_or("")
        )?;
        if let EventKind::Impact { hit, .. } = &event.kind {
            let [u_minus, u_plus] =
                [hit.u_minus, hit.u_plus].map(|u| u.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" "));
            write!(
                out,
                ": u⁻ ({u_minus}), u⁺ ({u_plus}) m/s, impulse {} N s, {}",
                short(hit.impulse.norm()),
                hit.mode
            )?;
        }
        writeln!(out)?;
    }
    let last = &run.last;
    writeln!(out, "{:>14} s  end ({}), {}", short(last.time), run.stop.name(), run.mode.name())?;
    let numbers = |x: &[f64]| x.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" ");
    writeln!(out, "q  {}\nqd {}", numbers(&last.q), numbers(&last.qd))?;
    let (e, s) = (run.energy, run.statistics);
    writeln!(
        out,
        "energy {} J at the start, {} J at the end, {} J lost in impacts",
        short(e.start),
        short(e.end),
        short(e.impacts)
    )?;
    writeln!(out, "{} events, {} steps, {} rejected, {} evaluations", run.events, s.steps, s.rejections, s.evaluations)
}

/// A CSV file, written beside its place and moved there when it is whole.
struct Table {
    path: PathBuf,
    partial: PathBuf,
    out: BufWriter<File>,
    failed: Option<io::Error>,
}

impl Table {
    fn begin(path: &Path, chain: &Chain) -> Result<Self, CliError> {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(".part");
        let partial = path.with_file_name(name);
        let unwritable = |reason| CliError::Unwritable { file: path.display().to_string(), reason };
        let mut table = Self {
            path: path.to_owned(),
            out: BufWriter::new(File::create(&partial).map_err(unwritable)?),
            partial,
            failed: None,
        };
        let names = |letter: &str, range: fn(&Coordinates) -> usize| -> Vec<String> {
            let numbered = |name: &str, n: usize| -> Vec<String> {
                let quoted = name.replace(['"', ',', '\n'], "_");
                if n == 1 {
                    vec![format!("{letter}.{quoted}")]
                } else {
                    (0..n).map(|k| format!("{letter}.{quoted}.{k}")).collect()
                }
            };
            chain.joints().iter().flat_map(|j| numbered(&j.name, range(&j.coordinates))).collect()
        };
        let q = names("q", |c| if let Coordinates::Own { q, .. } = c { q.len() } else { 0 });
        let qd = names("qd", |c| if let Coordinates::Own { v, .. } = c { v.len() } else { 0 });
        table.line(&[vec!["time".to_owned()], q, qd].concat().join(","));
        Ok(table)
    }

    fn row(&mut self, moment: &Moment) {
        let numbers = std::iter::once(&moment.time).chain(&moment.q).chain(&moment.qd);
        self.line(&numbers.map(f64::to_string).collect::<Vec<_>>().join(","));
    }

    fn line(&mut self, text: &str) {
        if self.failed.is_none() {
            self.failed = writeln!(self.out, "{text}").err();
        }
    }

    fn finish(mut self) -> Result<(), CliError> {
        let done = match self.failed.take() {
            Some(error) => Err(error),
            None => self.out.flush().and_then(|()| std::fs::rename(&self.partial, &self.path)),
        };
        done.map_err(|reason| CliError::Unwritable { file: self.path.display().to_string(), reason })
    }
}

impl Drop for Table {
    /// What is not finished leaves nothing behind.
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.partial);
    }
}
