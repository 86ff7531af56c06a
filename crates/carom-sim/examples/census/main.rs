//! Censuses: shares of right, refused and wrong answers over many random scenes.
//!
//! `cargo run --release -p carom-sim --example census -- NAME [COUNT [FIRST]]` runs a census of `tests/census/` over COUNT seeds from FIRST,
//! and prints its table, with the seeds and notes of bad answers; `-- NAME show SEED FOLDER` writes the scenes of a seed and prints the
//! verdict on it. `-- list` prints the names.
//!
//! `-- outcomes FILE [SEEDS]` writes the outcomes of all scenes of the repository and of the first seeds (100) of every census;
//! `-- differ OLD NEW` tells two such files apart, `-- digest FILE` prints a digest of each scene, which may stand for OLD.
//!
//! `-- [STARTS [SCENE]]` runs the box, the table and the quadruped of the repository from 1000 random starts each, and
//! prints the share of the simulated time that time steps took, each stretch counted by its reason, the failures by their message,
//! and the events by their kind. `-- order [STARTS [SCENE]]` runs box and table from 64 random starts each at tolerances from 1e-6
//! to 1e-10, and prints the quartiles of the error of q against a run at 1e-12, and of its order in the tolerance: at the last of
//! 200 samples before a change of the start by 1e-12 has grown to 1e-9. Where impacts accumulate at several corners their order
//! decides, and later states depend discontinuously on the start. `-- one NUMBER SCENE` prints the events of one start.

#[path = "../../tests/census/mod.rs"]
mod census;
mod motions;
mod outcomes;

use census::{CENSUSES, Census};
use motions::Answer;
use std::path::Path;

fn judged(name: &str, words: &[String]) -> Answer<()> {
    let census = CENSUSES.iter().find(|census| census.name == name);
    let census = census.ok_or_else(|| format!("no census '{name}': 'list' prints the names"))?;
    if let [word, seed, folder] = words
        && word == "show"
    {
        let seed = seed.parse()?;
        for (number, case) in (census.cases)(seed).iter().enumerate() {
            case.write(&Path::new(folder).join(number.to_string()))?;
        }
        let verdict = (census.judge)(seed);
        println!("{}: {}{}: {}", verdict.group, if verdict.bad { "BAD: " } else { "" }, verdict.class, verdict.note);
        return Ok(());
    }
    let count = words.first().map_or(Ok(census.many), |word| word.parse())?;
    let first: u64 = words.get(1).map_or(Ok(0), |word| word.parse())?;
    println!("{}", census::report(census, first..first + count).0);
    Ok(())
}

fn main() -> Answer<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize| args.get(k).map(String::as_str);
    let number = |k: usize| word(k).map(str::parse::<u64>).transpose();
    match word(0) {
        None => motions::census(1000, None),
        Some(starts) if starts.parse::<u64>().is_ok() => motions::census(starts.parse()?, word(1)),
        Some("order") => motions::order(number(1)?.unwrap_or(64), word(2)),
        Some("one") => motions::one(number(1)?.unwrap_or(0), word(2)),
        Some("outcomes") => outcomes::write(word(1).ok_or("which file?")?, number(2)?.unwrap_or(100)),
        Some("digest") => outcomes::digest(word(1).ok_or("which file?")?),
        Some("differ") => outcomes::differ(word(1).ok_or("which file?")?, word(2).ok_or("which second file?")?),
        Some("list") => {
            for Census { name, many, few, least, .. } in CENSUSES {
                println!("{name}: {many} scenes; in the tests {few}, at least {least} of them right");
            }
            Ok(())
        }
        Some(name) => judged(name, &args[1..]),
    }
}
