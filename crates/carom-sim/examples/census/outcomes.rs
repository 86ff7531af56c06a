//! Outcomes of many scenes as text, and what differs between two such files: the reference for a change of the simulator that must not
//! change them.
//!
//! ```text
//! scene NAME
//! event KIND TOUCH TIME Q̇⁺ …
//! end   STOP Q … Q̇ …
//! books START END DRIVE RESISTANCE IMPACTS
//! cost  STEPS REJECTIONS EVALUATIONS REFINEMENTS CONTACT_STEPS
//! ```
//!
//! A scene without an answer has one line `refused WHY` or `overdue`. Numbers have all their digits, so that equal lines are equal bits.

use super::census::case::{Answer, Case, End};
use super::census::{CENSUSES, LIMIT};
use super::motions::Answer as Done;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Numbers that differ by less than this, relative to their size or to 1, are the same but for the order of additions.
const SAME: f64 = 1e-10;

/// Every scene of the repository, as it is and by time steps, and the scenes of the first seeds of every census.
fn cases(seeds: u64) -> Done<Vec<(String, Case)>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut paths: Vec<_> =
        std::fs::read_dir(folder)?.map(|entry| entry.map(|it| it.path())).collect::<Result<_, _>>()?;
    paths.retain(|path| path.extension().is_some_and(|it| it == "toml"));
    paths.sort();
    let mut cases = Vec::new();
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for (kind, steps) in [("scenes", false), ("scenes by time steps", true)] {
            cases.push((format!("{kind}/{name}"), Case { path: Some(path.clone()), steps, ..Case::default() }));
        }
    }
    for census in CENSUSES {
        for seed in 0..seeds.min(census.many) {
            let own = (census.cases)(seed).into_iter().enumerate();
            cases.extend(own.map(|(number, case)| (format!("{}/{seed}/{number}", census.name), case)));
        }
    }
    Ok(cases)
}

fn numbers(out: &mut String, numbers: &[f64]) {
    numbers.iter().for_each(|number| write!(out, " {number:?}").expect("text"));
}

fn text(answer: &Answer) -> String {
    let mut out = String::new();
    for event in &answer.events {
        let touch = event.kind.touch().map_or(-1, |touch| touch as i64);
        write!(out, "event {} {touch} {:?}", event.kind.name(), event.time).expect("text");
        numbers(&mut out, &event.qd[1]);
        out.push('\n');
    }
    let (last, books, cost) = (&answer.summary.last, answer.books(), answer.statistics());
    out += &format!("end {}", answer.summary.stop.name());
    numbers(&mut out, &last.q);
    numbers(&mut out, &last.qd);
    out += "\nbooks";
    numbers(&mut out, &[books.start, books.end, books.drive, books.resistance, books.impacts]);
    let counts = [cost.steps, cost.rejections, cost.evaluations, cost.refinements, cost.contact_steps];
    out + "\ncost " + &counts.map(|count| count.to_string()).join(" ") + "\n"
}

/// Writes the outcomes of all scenes, those of `seeds` seeds of every census among them.
pub fn write(file: &str, seeds: u64) -> Done<()> {
    let cases = cases(seeds)?;
    let (next, done) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((name, case)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let outcome = match case.run(None, LIMIT) {
                        End::Done(answer) => text(&answer),
                        End::Refused(by, why) => format!("refused by the {by}: {}\n", why.replace('\n', " ")),
                        End::Panicked(why) => format!("panic: {}\n", why.replace('\n', " ")),
                        End::Overdue => "overdue\n".to_owned(),
                    };
                    done.lock().expect("no panic").insert(name.clone(), outcome);
                }
            });
        }
    });
    let done = done.into_inner()?;
    let all: String = done.iter().map(|(name, outcome)| format!("scene {name}\n{outcome}")).collect();
    std::fs::write(file, all)?;
    println!("{} scenes in {file}", done.len());
    Ok(())
}

/// The outcome of each scene of such a file.
fn read(file: &str) -> Done<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(file).map_err(|why| format!("{file}: {why}"))?;
    let blocks = text.split("scene ").filter(|block| !block.is_empty());
    Ok(blocks.filter_map(|block| block.split_once('\n')).map(|(name, outcome)| (name.into(), outcome.into())).collect())
}

/// Prints a line for each scene: its name, the number of its events, and a digest of its outcome.
pub fn digest(file: &str) -> Done<()> {
    for (name, outcome) in read(file)? {
        let events = outcome.lines().filter(|line| line.starts_with("event")).count();
        println!("{name}\t{events}\t{:016x}", hash(&outcome));
    }
    Ok(())
}

/// FNV-1a: that of the standard library may change with its version.
fn hash(outcome: &str) -> u64 {
    outcome.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

/// The largest difference of two outcomes, relative to the numbers or to 1; infinite if their words or lengths differ. Costs do not count.
fn difference(old: &str, new: &str) -> f64 {
    let words = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|line| !line.starts_with("cost"))
            .flat_map(str::split_whitespace)
            .map(str::to_owned)
            .collect()
    };
    let (old, new) = (words(old), words(new));
    if old.len() != new.len() {
        return f64::INFINITY;
    }
    let apart = |(a, b): (&String, &String)| match (a.parse::<f64>(), b.parse::<f64>()) {
        _ if a == b => 0.0,
        (Ok(a), Ok(b)) => (a - b).abs() / a.abs().max(b.abs()).max(1.0),
        _ => f64::INFINITY,
    };
    old.iter().zip(&new).map(apart).fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}

/// Compares two files, or a file of digests with one of outcomes: prints how many scenes have the same bits, how many the same events within
/// 1e-10, and the names of the others.
pub fn differ(old: &str, new: &str) -> Done<()> {
    let new = read(new)?;
    let text = std::fs::read_to_string(old).map_err(|why| format!("{old}: {why}"))?;
    let (mut same, mut close, mut cost, mut others) = (0, 0, 0, Vec::new());
    if !text.starts_with("scene ") {
        for line in text.lines() {
            let [name, _, digest] = line.split('\t').collect::<Vec<_>>()[..] else { continue };
            let Some(outcome) = new.get(name) else { continue };
            if format!("{:016x}", hash(outcome)) == digest { same += 1 } else { others.push(name.to_owned()) }
        }
    } else {
        for (name, outcome) in read(old)? {
            let Some(found) = new.get(&name) else { continue };
            match difference(&outcome, found) {
                _ if *found == outcome => same += 1,
                0.0 => cost += 1,
                off if off <= SAME => close += 1,
                // Whether a run ends in time depends on the machine.
                _ if [&outcome, found].iter().any(|it| it.starts_with("overdue")) => {}
                off => others.push(format!("{name}: {off:.1e}")),
            }
        }
    }
    println!(
        "{same} the same bits, {cost} but for the cost, {close} the same events within {SAME:e}, {} differ",
        others.len()
    );
    others.iter().for_each(|name| println!("  {name}"));
    Ok(())
}
