//! Energies by an own computation against the books, over the scenes of the repository and over random ones.

use super::case::{Answer, Case, End};
use super::{LIMIT, Verdict, random};
use std::path::Path;

/// What is wrong with the energies of an answer: the class and the numbers.
pub fn wrong(answer: &Answer) -> Option<(&'static str, String)> {
    let (books, scale) = (answer.books(), answer.scale());
    let [start, end, least, most] = answer.energy;
    let tolerance = answer.plan.simulation.tolerance;
    // Sums of terms of the size of the potential energies have their rounding.
    let size = scale + start.abs().max(end.abs()).max(least.abs()).max(most.abs());
    let rounding = 1e-9 * size;
    let [lost, flagged] = answer.lost;
    let stepped = answer.statistics().contact_steps > 0;
    let note = format!(
        "scale {scale:.3e} J, start {start:.6e}, end {end:.6e} (books {:.6e}, {:.6e}), drive {:.3e}, resistance {:.3e}, \
         lost in impacts {:.3e}, by the events {lost:.3e}, with a flag {flagged:.3e}, error {:.3e}, {} time steps ({:?}), {} events",
        books.start,
        books.end,
        books.drive,
        books.resistance,
        books.impacts,
        books.error(),
        answer.statistics().contact_steps,
        answer.reasons.first(),
        answer.summary.events,
    );
    let compliant = answer.scene.simulation.touches.iter().any(|touch| touch.contact.compliance.is_some());
    // Each integration step has an error of the tolerance; stiff contacts turn an error of positions into one of energy.
    let steps = answer.statistics().steps.max(100) as f64;
    let allowed = if stepped { 0.05 } else { (100.0 * steps * tolerance).clamp(1e-6, 1e-2) };
    let (told, warned) = (flagged.min(0.0), !answer.summary.warnings().is_empty());
    let stored = compliant && answer.scene.simulation.smallest_gap(&answer.scene.q).is_ok_and(|gap| gap < 0.0);
    let class = match () {
        // Told: the run warns its user of what its time steps, and no event, have gained or lost.
        () if warned && stepped => return None,
        // Compliant contacts store energy that q does not tell, and parts that cannot move add a constant.
        () if !compliant && (books.end - books.start - (end - start)).abs() > rounding => {
            "energies are not those of q, q̇"
        }
        () if !answer.driven() && !stored && books.resistance > allowed * scale => "resistance does work",
        () if !compliant && !stepped && !answer.summed && (books.impacts - lost).abs() > rounding => {
            "losses are not those of the events"
        }
        () if !answer.driven() && books.impacts < told - allowed * scale && stepped => {
            "time steps gain energy, booked as lost"
        }
        () if !answer.driven() && books.impacts < told - allowed * scale => "impacts gain energy without a flag",
        () if books.error().abs() > allowed * scale && stepped => "the balance of time steps is off",
        // Positions within the tolerance have a potential energy within as much of its size.
        () if books.error().abs() > allowed * scale + steps * tolerance * size && !warned => "the balance is off",
        () if !answer.driven() && !stored && end - start - books.drive > allowed * scale - told => "gain of energy",
        () => return None,
    };
    Some((class, note))
}

/// Messages that contradict themselves: what they name is a number of our own.
pub fn false_message(why: &str) -> bool {
    ["positive semidefinite", "is inf", "is NaN", "is nan", "moves no inertia"].iter().any(|words| why.contains(words))
}

/// The answer of a case whose energies are right, or the verdict.
pub fn balanced(group: &str, case: &Case, every: Option<f64>, limit: f64) -> Result<Answer, Verdict> {
    let answer = match case.run(every, limit) {
        End::Refused(by, why) => {
            let words: String = why.chars().filter(|c| !c.is_ascii_digit()).take(40).collect();
            let class = format!("refused by the {by}: {words}");
            return Err(Verdict { right: false, ..Verdict::new(group, class, false_message(&why), why) });
        }
        other => other.done(group)?,
    };
    match wrong(&answer) {
        Some((class, note)) => Err(Verdict::bad(group, class, note)),
        None => Ok(answer),
    }
}

pub fn verdict(group: &str, case: &Case, limit: f64) -> Verdict {
    let told = |answer: Answer| match answer.statistics().contact_steps {
        _ if !answer.summary.warnings().is_empty() => {
            Verdict::open(group, "an error of the balance, told", String::new())
        }
        0 => Verdict::right(group, "balanced", String::new()),
        _ => Verdict::right(group, "balanced, with time steps", String::new()),
    };
    balanced(group, case, None, limit).map_or_else(|verdict| verdict, told)
}

/// The scenes of the repository come first, each as it is and by time steps, then random ones.
pub fn case(seed: u64) -> (String, Case) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "toml"));
    files.sort();
    let steps = seed as usize >= files.len();
    if let Some(path) = files.get(seed as usize - if steps { files.len() } else { 0 }) {
        let group = if steps { "scenes/, by time steps" } else { "scenes/" };
        return (group.into(), Case { path: Some(path.clone()), steps, ..Case::default() });
    }
    let scene = random::scene(seed);
    (format!("random, {}", scene.kind), scene.as_is())
}

pub fn judge(seed: u64) -> Verdict {
    let (group, case) = case(seed);
    verdict(&group, &case, LIMIT)
}
