//! Damaged inputs of every kind are accepted or refused, never a panic: the entry functions of `fuzz/`, with mutated seeds.

#[path = "../../../fuzz/entries.rs"]
mod entries;

/// Numbers and words that readers stumble over.
const TOKENS: [&str; 20] = [
    "nan",
    "-inf",
    "1e308",
    "1e-308",
    "-0",
    "0",
    "99999999999999999999",
    "\u{feff}",
    "\"",
    "[[",
    "]",
    "{",
    "}",
    "=",
    "<",
    "/>",
    "&#0;",
    "\0",
    "\r\n",
    ",",
];

/// The seed with some of its bytes changed, removed, repeated or replaced by a token.
fn mutated(seed: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut data = seed.to_vec();
    for _ in 0..random.usize(1..6) {
        let at = random.usize(0..=data.len());
        let end = (at + random.usize(0..12)).min(data.len());
        match random.u8(0..6) {
            0 if at < data.len() => data[at] ^= 1 << random.u8(0..8),
            1 => drop(data.drain(at..end)),
            2 => {
                let piece = data[at..end].to_vec();
                data.splice(at..at, piece.into_iter().cycle().take(random.usize(0..60)));
            }
            3 => {
                let token = TOKENS[random.usize(0..TOKENS.len())].bytes();
                drop(data.splice(at..end, token));
            }
            4 => data.truncate(at),
            _ => {
                let from = random.usize(0..=seed.len());
                let piece = &seed[from..(from + random.usize(0..40)).min(seed.len())];
                drop(data.splice(at..at, piece.iter().copied()));
            }
        }
    }
    data
}

/// Mutations of each seed in `fuzz/seeds/NAME`, and the seeds themselves.
fn feed(name: &str, mutations: usize, entry: fn(&[u8])) {
    let folder = carom_testing::files::path(&format!("fuzz/seeds/{name}"));
    let mut seeds: Vec<_> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
    seeds.sort();
    assert!(!seeds.is_empty());
    let mut random = fastrand::Rng::with_seed(7);
    for seed in seeds {
        let seed = std::fs::read(seed).unwrap();
        entry(&seed);
        (0..mutations).for_each(|_| entry(&mutated(&seed, &mut random)));
    }
}

#[test]
fn mutated_robots_are_accepted_or_refused() {
    feed("urdf", 400, entries::urdf);
}

#[test]
fn mutated_scenes_are_accepted_or_refused() {
    feed("scene", 400, entries::scene);
}

#[test]
fn mutated_studies_are_accepted_or_refused() {
    feed("study", 300, entries::study);
}

/// Any bit pattern of states, normals and coefficients gives finite velocities or a refusal.
#[test]
fn impacts_at_any_state_are_finite_or_refused() {
    feed("states", 4000, entries::states);
}

#[test]
fn mutated_meshes_are_accepted_or_refused() {
    feed("meshes", 400, entries::meshes);
}

#[test]
fn mutated_tables_are_accepted_or_refused() {
    feed("tables", 400, entries::tables);
}
