//! Large ratios of masses, many bodies, stiff contacts: each run ends in a bounded time, with balanced books or a refusal.

use super::build::*;
use super::case::Case;
use super::{LIMIT, Verdict, energy};
use fastrand::Rng;

const SHAPES: [&str; 5] = ["ball", "box", "cylinder", "capsule", "mesh"];
fn solid(kind: usize, r: f64) -> (String, Option<(String, String)>) {
    match kind {
        0 => (ball(r), None),
        1 => (brick([2.0 * r, 1.5 * r, 1.2 * r]), None),
        2 => (cylinder(r, 1.5 * r), None),
        3 => (capsule(0.6 * r, r), None),
        _ => (r#"<mesh filename="m.obj"/>"#.into(), Some(("m.obj".into(), brick_mesh([2.0 * r, 1.5 * r, 1.2 * r])))),
    }
}

/// A free body with the inertia of a ball.
fn free(
    number: usize,
    kind: usize,
    (r, mass): (f64, f64),
    height: f64,
    rpy: [f64; 3],
    files: &mut Vec<(String, String)>,
) -> String {
    let (element, mesh) = solid(kind, r);
    let part = Part::new("body", "", "fixed", Z, O).with(shape(&element, O, O)).weighing(mass, [0.4 * mass * r * r; 3]);
    let name = format!("b{number}.urdf");
    files.push((name.clone(), rooted(&part.link(), &[])));
    files.extend(mesh);
    format!(
        "[[robot]]\nname = \"b{number}\"\nurdf = \"{name}\"\ntip = \"body\"\nfloating = true\nposition = [0, 0, {height:?}]\nrpy = {}\n",
        list(&rpy)
    )
}

/// Hinges one after another with a ball on each link.
fn rope(n: usize, last: f64) -> String {
    let parts: Vec<Part> = (0..n)
        .map(|k| {
            let parent = if k == 0 { "base".to_owned() } else { format!("l{}", k - 1) };
            let at = [if k == 0 { 0.0 } else { 0.1 }, 0.0, 0.0];
            let part =
                Part::new(&format!("l{k}"), &parent, "continuous", Y, at).with(shape(&ball(0.03), [0.1, 0.0, 0.0], O));
            let mass = if k == n - 1 { 0.1 * last } else { 0.1 };
            Part { com: [0.05, 0.0, 0.0], ..part.weighing(mass, [1e-4 * mass; 3]) }
        })
        .collect();
    urdf(&parts)
}

/// Seeds below 100 have at most 10 bodies, for the tests.
pub fn case(seed: u64) -> (String, Case) {
    let rng = &mut Rng::with_seed(seed);
    let most = if seed < 100 { 10 } else { 200 };
    let n = one_of(rng, &[2, 3, 5, 10, 20, 50, 100, 200]).min(most);
    let ratio = 10_f64.powi(rng.i32(0..=6)) * if rng.bool() { 1.0 } else { 0.1 };
    let (e, mu): (f64, f64) = (one_of(rng, &[0.0, 0.5, 0.9, 1.0]), one_of(rng, &[0.0, 0.0, 0.5]));
    let law = one_of(rng, &LAWS);
    let mut files = Vec::new();
    let floor = "[[surface]]\nname = \"floor\"\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }\n";
    let (mut text, mut duration, mut more) = (String::new(), 0.5, String::new());
    let mut several = one_of(rng, &SEVERAL);
    let group = match seed % 8 {
        0..=2 => {
            let (below, above) = (rng.usize(0..5), rng.usize(0..5));
            let turned = rng.bool();
            let mut rpy = || if turned { turn(rng) } else { O };
            text += &free(0, below, (0.1, 1.0), 0.25, rpy(), &mut files);
            text += &free(1, above, (0.1, ratio), 0.6, rpy(), &mut files);
            text += floor;
            let mut pair = [SHAPES[below], SHAPES[above]];
            pair.sort_unstable();
            format!("{} and {}", pair[0], pair[1])
        }
        3 => {
            let stack = n.min(if seed < 100 { 3 } else { 12 });
            let kind = rng.usize(0..5);
            (0..stack).for_each(|k| {
                let mass = if k % 2 == 1 { ratio.min(1e4) } else { 1.0 };
                text += &free(k, kind, (0.1, mass), 0.2 + 0.25 * k as f64, O, &mut files);
            });
            text += floor;
            format!("stack of {}", SHAPES[kind])
        }
        4 => {
            files.push(("r.urdf".into(), rope(n, 1.0)));
            let angles = vec![0.0; n];
            text += &format!("[robot]\nurdf = \"r.urdf\"\ntip = \"l0\"\nq = {}\n", list(&angles));
            text += "[[surface]]\nname = \"floor\"\nshape = { halfspace = { point = [0, 0, -0.06], normal = [0, 0, 1] } }\n";
            duration = 0.2;
            "rope that falls flat".into()
        }
        5 => {
            files.push(("r.urdf".into(), rope(n, ratio)));
            let angles: Vec<f64> = (0..n).map(|_| within(rng, -0.3, 0.3)).collect();
            text += &format!("[robot]\nurdf = \"r.urdf\"\ntip = \"l0\"\nq = {}\n", list(&angles));
            "rope with a load at its end".into()
        }
        6 => {
            let parts: Vec<Part> = (0..n)
                .map(|k| {
                    let part = Part::new(
                        &format!("l{k}"),
                        "base",
                        "prismatic",
                        X,
                        [0.2 * k as f64 + 1e-3 * k as f64, 0.0, 0.0],
                    );
                    part.with(shape(&ball(0.1), O, O)).weighing(if k % 2 == 1 { ratio } else { 1.0 }, [0.01; 3])
                })
                .collect();
            files.push(("r.urdf".into(), urdf(&parts)));
            let mut speeds = vec![0.0; n];
            speeds[0] = 1.0;
            text += &format!(
                "[robot]\nurdf = \"r.urdf\"\ntip = \"l0\"\nq = {}\nqd = {}\n",
                list(&vec![0.0; n]),
                list(&speeds)
            );
            more += "links = \"all\"\n";
            several = one_of(rng, &["moreau", "poisson", "sequential"]);
            "row of balls".into()
        }
        _ => {
            let k = 10_f64.powi(rng.i32(4..=18));
            text += &free(0, rng.usize(0..2), (0.1, ratio), 0.3, turn(rng), &mut files);
            text += floor;
            more += &format!("[contact.compliance]\nstiffness = {k:?}\n");
            format!("stiffness {}", if k > 1e14 { "above 1e14" } else { "to 1e14" })
        }
    };
    let e = if more.contains("compliance") { e.max(0.1) } else { e };
    let mu = if several == "energetic" { 0.0 } else { mu };
    text += &format!(
        "[contact]\nlaw = \"{law}\"\nseveral = \"{several}\"\nrestitution = {e:?}\nfriction = {mu:?}\n{more}[run]\nduration = {duration:?}\ngravity = [0, 0, -9.81]\n"
    );
    (group, Case { files, scene: text, ..Case::default() })
}

pub fn judge(seed: u64) -> Verdict {
    let (group, case) = case(seed);
    energy::verdict(&group, &case, LIMIT)
}
