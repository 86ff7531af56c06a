//! Censuses: many scenes from random numbers, each with a judge that knows what its answer must be.
//!
//! The tests run a few scenes of each; the example `census` any number, and writes the scene of a seed into a folder.

pub mod agreement;
pub mod blows;
pub mod build;
pub mod case;
pub mod energy;
pub mod errors;
pub mod extremes;
pub mod gradients;
pub mod immobile;
pub mod locked;
pub mod random;
pub mod wishes;

use case::{Answer, Case, End};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Seconds of computation that a run may take; without optimisation three times as many.
pub const LIMIT: f64 = if cfg!(debug_assertions) { 60.0 } else { 20.0 };

/// What a judge says of the answer of one seed.
pub struct Verdict {
    /// Kind of the scene.
    pub group: String,
    /// Kind of the answer.
    pub class: String,
    pub bad: bool,
    /// Whether the answer has been compared with what it must be, and agrees. An answer that is neither right nor bad is refused, told to be
    /// uncertain, or has nothing to be compared with.
    pub right: bool,
    pub note: String,
}

impl Verdict {
    pub fn new(group: impl Into<String>, class: impl Into<String>, bad: bool, note: String) -> Self {
        Self { group: group.into(), class: class.into(), bad, right: !bad, note }
    }

    pub fn right(group: impl Into<String>, class: impl Into<String>, note: String) -> Self {
        Self::new(group, class, false, note)
    }

    /// Neither right nor bad.
    pub fn open(group: impl Into<String>, class: impl Into<String>, note: String) -> Self {
        Self { right: false, ..Self::new(group, class, false, note) }
    }

    pub fn bad(group: impl Into<String>, class: impl Into<String>, note: String) -> Self {
        Self::new(group, class, true, note)
    }
}

impl End {
    /// The answer, or the verdict on a case without one that should have one.
    pub fn done(self, group: &str) -> Result<Answer, Verdict> {
        match self {
            Self::Done(answer) if answer.finite() => Ok(*answer),
            Self::Done(_) => Err(Verdict::bad(group, "not finite", String::new())),
            Self::Refused(by, why) => Err(Verdict::bad(group, format!("refused by the {by}"), why)),
            Self::Panicked(why) => Err(Verdict::bad(group, "panic", why)),
            Self::Overdue => Err(Verdict::bad(group, "overdue", String::new())),
        }
    }
}

impl Answer {
    /// How often each kind of event happened.
    pub fn names(&self) -> BTreeMap<&str, usize> {
        let mut names = BTreeMap::new();
        self.events.iter().for_each(|event| *names.entry(event.kind.name()).or_default() += 1);
        names
    }
}

/// The largest difference of two lists; infinite if their lengths differ.
pub fn compare(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}

/// A census: its scenes by their seeds, and its judge.
pub struct Census {
    pub name: &'static str,
    /// Scenes in the tests, and by default in the example.
    pub few: u64,
    pub many: u64,
    /// The least number of right answers among the few.
    pub least: usize,
    pub judge: fn(u64) -> Verdict,
    /// The scenes of a seed, for a reader.
    pub cases: fn(u64) -> Vec<Case>,
}

pub const CENSUSES: &[Census] = &[
    Census {
        name: "immobile",
        few: 240,
        many: 9600,
        least: 220,
        judge: immobile::judge,
        cases: |seed| immobile::cases(seed).2.into(),
    },
    Census { name: "blows", few: 1500, many: 125_000, least: 1300, judge: blows::judge, cases: |_| Vec::new() },
    Census {
        name: "energy",
        few: 64,
        many: 5000,
        least: 50,
        judge: energy::judge,
        cases: |seed| vec![energy::case(seed).1],
    },
    Census {
        name: "locked",
        few: 50,
        many: 4400,
        least: 45,
        judge: locked::judge,
        cases: |seed| {
            let locked = locked::case(seed);
            std::iter::once(locked.case).chain(locked.rigid).collect()
        },
    },
    Census {
        name: "wishes",
        few: 60,
        many: 2000,
        least: 36,
        judge: wishes::judge,
        cases: |seed| vec![wishes::wish(seed).case],
    },
    Census {
        name: "extremes",
        few: 24,
        many: 2000,
        least: 16,
        judge: extremes::judge,
        cases: |seed| vec![extremes::case(seed).1],
    },
    Census {
        name: "agreement",
        few: 6,
        many: 5000,
        least: 3,
        judge: agreement::judge,
        cases: |seed| vec![agreement::case(seed).1],
    },
    Census {
        name: "gradients",
        few: 12,
        many: 2000,
        least: 6,
        judge: gradients::judge,
        cases: |seed| vec![gradients::case(seed).1],
    },
    Census {
        name: "errors",
        few: 32,
        many: 100_000,
        least: 26,
        judge: errors::judge,
        cases: |seed| vec![errors::case(seed)],
    },
    Census {
        name: "accuracy",
        few: 32,
        many: 4000,
        least: 20,
        judge: errors::judge_accuracy,
        cases: |seed| vec![errors::case(seed)],
    },
];

/// The answers for the numbers of a range, on all cores, in their order.
pub fn each<T: Send>(range: Range<u64>, one: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let (next, found) = (AtomicU64::new(range.start), Mutex::new(Vec::new()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= range.end {
                        break;
                    }
                    let answer = one(number);
                    found.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push((number, answer));
                }
            });
        }
    });
    let mut found = found.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, answer)| answer).collect()
}

/// The table of a census, with the seeds of each kind of bad answer and their notes; the number of right answers, and the seeds of all bad ones.
pub fn report(census: &Census, seeds: Range<u64>) -> (String, usize, Vec<u64>) {
    let first = seeds.start;
    let verdicts = each(seeds.clone(), census.judge);
    let mut groups = BTreeMap::<&str, BTreeMap<(bool, &str), usize>>::new();
    let mut failures = BTreeMap::<(&str, &str), Vec<(u64, &str)>>::new();
    for (seed, verdict) in seeds.zip(&verdicts) {
        let group = groups.entry(&verdict.group).or_default();
        *group.entry((verdict.bad, &verdict.class)).or_default() += 1;
        if verdict.bad {
            failures.entry((&verdict.class, &verdict.group)).or_default().push((seed, &verdict.note));
        }
    }
    let bad: Vec<u64> = (first..).zip(&verdicts).filter(|(_, verdict)| verdict.bad).map(|(seed, _)| seed).collect();
    let right = verdicts.iter().filter(|verdict| verdict.right).count();
    let mut text = format!("{}: {} scenes, {right} right, {} bad\n", census.name, verdicts.len(), bad.len());
    text += "\n| scenes | number | answers | bad answers |\n| --- | --- | --- | --- |\n";
    for (group, classes) in groups {
        let listed = |bad: bool| {
            let of = classes.iter().filter(|(key, _)| key.0 == bad).map(|(key, count)| format!("{count} {}", key.1));
            of.collect::<Vec<_>>().join(", ")
        };
        text += &format!("| {group} | {} | {} | {} |\n", classes.values().sum::<usize>(), listed(false), listed(true));
    }
    for ((class, group), seeds) in failures {
        text += &format!("\n{class}, {group}: {} seeds\n", seeds.len());
        for (seed, note) in seeds.iter().take(5) {
            let note: String = note.chars().take(300).collect();
            text += &format!("  {seed}: {note}\n");
        }
    }
    (text, right, bad)
}
