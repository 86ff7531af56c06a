//! Poses of the rows of a map: the tip is at its target and keeps its direction.

use crate::map_study::rows::{EVERYTHING, Row, compare, joints};
use crate::map_study::{refused, robot, study};
use carom_chain::Chain;
use carom_impact::Coefficients;
use carom_study::NumberedRows;
use carom_study::map_study::Study;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Rows are unreachable exactly beyond the length of the arm. All others have the tip at its target and the elbow on its side;
/// those without numbers violate a limit or are stretched out, folded or along the normal.
#[test]
fn poses_of_a_tip_grid_have_the_tip_at_its_target_with_both_elbows() {
    let impact = "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = 45\nspeed = 0.2\nlaw = \"energetic\"\nrestitution = 0.35\nfriction = 0.1";
    let poses = "[tip]\nx = { from = -1, to = 1, count = 21 }\ny = { from = -1, to = 1, count = 21 }";
    let study = study("planar2", poses, impact, EVERYTHING);
    let chain = Chain::from_urdf_file(robot("planar2")).unwrap();
    let mut evaluator = study.evaluator();
    let mut counted = [0; 2];
    let mut others = BTreeMap::new();
    for index in 0..study.rows() {
        let row = Row::of(&study, &mut evaluator, index);
        let (x, y) = (row.get("tip.x"), row.get("tip.y"));
        if row.class() == "unreachable" {
            // two links of 0.45 m; at the edge rounding decides
            assert!(x.hypot(y) > 0.9 - 1e-9, "({x}, {y})");
            assert!(row.get("impulse").is_nan() && row.get("q.elbow").is_nan());
            *others.entry("unreachable").or_insert(0) += 1;
            continue;
        }
        assert!(x.hypot(y) < 0.9 + 1e-9);
        let q = [row.get("q.shoulder"), row.get("q.elbow")];
        let (first, both) = (q[0], q[0] + q[1]);
        let tip = [0.45 * (first.cos() + both.cos()), 0.45 * (first.sin() + both.sin())];
        assert!((tip[0] - x).hypot(tip[1] - y) < 1e-12, "tip at {tip:?} instead of ({x}, {y})");
        if ["outside-limits", "singular"].contains(&row.class()) {
            let beyond = q.iter().any(|x| x.abs() > 3.1);
            let singular = q[1].sin().abs() < 1e-6;
            assert!(if row.class() == "singular" { singular } else { beyond }, "{} at {q:?}", row.class());
            *others.entry(row.class()).or_insert(0) += 1;
            continue;
        }
        assert!((row.get("position.x") - x).hypot(row.get("position.y") - y) < 1e-12);
        // elbow 0 is up: to the left of the line from the base to the tip
        let above = x * q[0].sin() - y * q[0].cos();
        let up = row.get("elbow") == 0.0;
        assert!(if up { above > 0.0 } else { above < 0.0 }, "elbow of {q:?} at ({x}, {y})");
        let with = Coefficients { restitution: 0.35, friction: 0.1, ..Coefficients::default() };
        compare(&study, &chain, &row, &q, [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], "energetic", with);
        counted[usize::from(up)] += 1;
    }
    assert_eq!(
        (counted, Vec::from_iter(others)),
        ([246; 2], vec![("outside-limits", 8), ("singular", 6), ("unreachable", 376)])
    );
}

/// Inverse kinematics by Newton's method: it finds a pose for every target within reach and for none beyond it.
#[test]
fn poses_of_redundant_arms_have_the_tip_at_every_target_within_reach() {
    let impact = "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = 45\nspeed = 0.2\nlaw = \"frictionless\"\nrestitution = 0.35";
    let planar = "[tip]\nx = { from = 0.2, to = 1.4, count = 13 }\ny = { from = -0.6, to = 0.6, count = 7 }";
    let space = "[tip]\nx = [0.2, 0.4, 3.0]\ny = [-0.2, 0.3]\nz = [0.3, 0.6]";
    // planar3 has links of 0.45, 0.45 and 0.25 m; the targets of arm7 with x = 3 are beyond its length
    let within: [fn(f64, f64) -> bool; 2] = [|x, y| x.hypot(y) < 1.15, |x, _| x < 1.0];
    for (name, poses, within, counts) in
        [("planar3", planar, within[0], [128, 54, 0]), ("arm7", space, within[1], [14, 8, 2])]
    {
        let study = study(name, poses, impact, "\"position\"");
        let mut evaluator = study.evaluator();
        // reached, beyond reach, without numbers
        let mut found = [0; 3];
        for index in 0..study.rows() {
            let row = Row::of(&study, &mut evaluator, index);
            let reachable = within(row.get("tip.x"), row.get("tip.y"));
            assert_eq!(row.class() != "unreachable", reachable, "{name}, row {index}: {}", row.class());
            if !reachable {
                found[1] += 1;
                continue;
            }
            if ["outside-limits", "singular"].contains(&row.class()) {
                found[2] += 1;
                continue;
            }
            let off = ["x", "y", "z"].map(|k| {
                let target = format!("tip.{k}");
                row.0.get(&target).map_or(0.0, |wanted| row.get(&format!("position.{k}")) - wanted)
            });
            assert!(off.iter().all(|x| x.abs() < 1e-9), "{name}, row {index}: {off:?}");
            found[0] += 1;
        }
        assert_eq!(found, counts, "{name}");
    }
}

/// The three links of planar3 with the last one along a given direction reach the targets whose wrist the first two reach: 0.45 m
/// and 0.45 m, and 0.25 m from the wrist to the tip.
#[test]
fn a_planar_arm_with_a_direction_reaches_what_its_other_links_do() {
    let impact = "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = 45\nspeed = 0.2\nlaw = \"frictionless\"\nrestitution = 0.35";
    let angle = 0.4_f64;
    let direction = [angle.cos(), angle.sin()];
    let poses = format!(
        "limits = false\n[tip]\nx = {{ from = 0.1, to = 1.2, count = 12 }}\ny = {{ from = -0.6, to = 0.6, count = 7 }}\n\
         pointing = {{ axis = [2, 0, 0], direction = [{}, {}, 0] }}",
        3.0 * direction[0],
        3.0 * direction[1]
    );
    let study = study("planar3", &poses, impact, "\"position\"");
    let (chain, mut evaluator) = (study.chain(), study.evaluator());
    let tip = chain.frame("tip").unwrap();
    let mut workspace = chain.workspace();
    let mut found = [0; 2];
    for index in 0..study.rows() {
        let row = Row::of(&study, &mut evaluator, index);
        let target = [row.get("tip.x"), row.get("tip.y")];
        let wrist = (target[0] - 0.25 * direction[0]).hypot(target[1] - 0.25 * direction[1]);
        assert_eq!(row.class() != "unreachable", wrist < 0.9, "row {index}: {}, wrist at {wrist} m", row.class());
        found[usize::from(wrist < 0.9)] += 1;
        if wrist < 0.9 && row.class() != "singular" {
            let q = row.group("q", &joints(chain));
            let pose = workspace.update(chain, &q).unwrap().pose(tip);
            let off = [pose.rotation[(0, 0)] - direction[0], pose.rotation[(1, 0)] - direction[1]];
            let away = [pose.translation.x - target[0], pose.translation.y - target[1]];
            assert!(off.iter().chain(&away).all(|x| x.abs() < 1e-9), "row {index}: {off:?}, {away:?}");
        }
    }
    assert!(found.iter().all(|n| *n > 10), "{found:?}");
}

/// In space the axis has its direction at every pose that is found, and at the better pose of the self-motion as well, which
/// keeps the position too. Tolerance: that of the inverse kinematics, 1e-10 of the arm's length.
#[test]
fn an_arm_in_space_keeps_the_direction_of_its_tip() {
    let impact = "normal = [-1, 0, 0]\napproach_deg = 90\nspeed = 0.2\nlaw = \"frictionless\"\nrestitution = 0.35";
    let direction = Vector3::new(1.0, 0.2, -0.4).normalize();
    let poses = "[tip]\nx = [0.65, 0.75]\ny = [-0.1, 0.2]\nz = [0.3, 0.5]\n\
                 pointing = { axis = [0, 0, 1], direction = [1, 0.2, -0.4] }\n\
                 [advise]\nminimise = \"impulse\"\nbest = 3";
    let study = study("arm7", poses, impact, "\"position\", \"impulse\"");
    let (chain, mut evaluator) = (study.chain(), study.evaluator());
    let tip = chain.frame("tip").unwrap();
    let mut workspace = chain.workspace();
    let mut off = |q: &[f64], target: [f64; 3]| {
        let pose = workspace.update(chain, q).unwrap().pose(tip);
        let axis = pose.rotation.column(2).into_owned();
        (axis - direction).norm().max((pose.translation - Vector3::from(target)).norm())
    };
    let target = |row: &Row| ["x", "y", "z"].map(|k| row.get(&format!("tip.{k}")));
    let mut found = 0;
    for index in 0..study.rows() {
        let row = Row::of(&study, &mut evaluator, index);
        if row.get("position.x").is_finite() {
            let error = off(&row.group("q", &joints(chain)), target(&row));
            assert!(error < 1e-9, "row {index}: {error}");
            found += 1;
        }
    }
    assert!(found >= 8, "{found} of {} poses found", study.rows());
    let advice = study.advise().unwrap();
    let mut moved = 0;
    for one in &advice.best {
        let row = Row(study.columns().iter().map(|c| c.name.clone()).zip(one.row.clone()).collect());
        if let Some((q, _)) = &one.self_motion {
            let error = off(q, target(&row));
            assert!(error < 1e-9, "self-motion of row {}: {error}", one.index);
            moved += 1;
        }
    }
    assert!(moved > 0);
}

#[test]
fn directions_of_the_tip_that_cannot_be_are_refused() {
    let impact =
        "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = 45\nspeed = 0.2\nlaw = \"newton\"\nrestitution = 0.3";
    for (axis, direction, said) in [
        ("[0, 0, 0]", "[1, 0, 0]", "[tip] pointing.axis = [0.0, 0.0, 0.0]: it must be finite and not zero"),
        ("[1, 0, 0]", "[1, 0, inf]", "[tip] pointing.direction = [1.0, 0.0, inf]: it must be finite and not zero"),
        ("[1, 0, 0]", "[1, 0, 1]", "[tip] pointing.direction leaves the plane in which the arm moves"),
    ] {
        let poses = format!("[tip]\nx = 0.5\ny = 0.1\npointing = {{ axis = {axis}, direction = {direction} }}");
        let refused = refused("planar3", &poses, impact);
        assert!(refused.contains(said), "{refused}");
    }
}

const INERTIAL: &str =
    "<inertial><mass value='1'/><inertia ixx='0.02' ixy='0' ixz='0' iyy='0.02' iyz='0' izz='0.02'/></inertial>";

/// A row of links with mass, each with the kind of its joint, its axis, its origin, and more of its elements.
fn arm(joints: &[(&str, &str, &str, &str)], tip: &str) -> String {
    let mut text = "<robot name='arm'><link name='l0'/>".to_owned();
    for (k, (kind, axis, origin, more)) in joints.iter().enumerate() {
        let n = k + 1;
        text += &format!(
            "<link name='l{n}'>{INERTIAL}</link><joint name='j{n}' type='{kind}'><parent link='l{k}'/><child link='l{n}'/>\
             <origin xyz='{origin}'/><axis xyz='{axis}'/>{more}</joint>"
        );
    }
    let last = joints.len();
    text + &format!(
        "<link name='tip'/><joint name='tool' type='fixed'><parent link='l{last}'/><child link='tip'/><origin xyz='{tip}'/></joint></robot>"
    )
}

/// The study of a robot that is given as text.
fn study_of(urdf: &str, robot: &str, poses: &str, normal: &str) -> Study {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.urdf"), urdf).unwrap();
    let text = format!(
        "[robot]\nurdf = \"arm.urdf\"\n{robot}\n{poses}\n[impact]\nnormal = {normal}\napproach_deg = 90\nspeed = 0.2\n\
         law = \"newton\"\nrestitution = 0.3\n[map]\nquantities = [\"position\"]\n"
    );
    Study::from_toml(&text, folder.path()).unwrap()
}

/// Arms whose fixed lengths are zero or nearly: what sliders add to the reach is the size of the arm.
#[test]
fn arms_with_sliders_reach_every_target_however_short_their_links_are() {
    let slider = "<limit lower='0.2' upper='1' velocity='1' effort='1'/>";
    let wide = "<limit lower='-2' upper='2' velocity='1' effort='1'/>";
    let (turn, slide) = ("continuous", "prismatic");
    let plane = "[tip]\nx = { from = -0.8, to = 0.81, count = 12 }\ny = { from = -0.7, to = 0.72, count = 11 }";
    let space = "[tip]\nx = { from = -0.9, to = 0.91, count = 5 }\ny = { from = -0.87, to = 0.9, count = 5 }\nz = { from = -0.6, to = 0.7, count = 5 }";
    let mut cases = Vec::new();
    for tip in ["0 0 0", "1e-9 0 0", "1e-6 0 0", "0.1 0 0"] {
        let polar = [(turn, "0 0 1", "0 0 0", ""), (slide, "1 0 0", "0 0 0", slider)];
        cases.push((arm(&polar, tip), plane.to_owned() + "\nseeds = [[0.6, 0.6]]"));
    }
    let one = |kind, axis| (kind, axis, "0 0 0", if kind == slide { wide } else { "" });
    for joints in [
        [one(turn, "0 0 1"), one(slide, "0 0 1"), one(slide, "1 0 0")],
        [one(turn, "0 0 1"), one(turn, "0 1 0"), one(slide, "1 0 0")],
        [one(slide, "1 0 0"), one(slide, "0 1 0"), one(slide, "0 0 1")],
    ] {
        cases.push((arm(&joints, "0 0 0"), space.to_owned() + "\nseeds = [[0.6, 0.6, 0.6]]"));
    }
    for (urdf, poses) in cases {
        let study = study_of(&urdf, "limits = false", &poses, "[-1, 0, 0]");
        let mut evaluator = study.evaluator();
        for index in 0..study.rows() {
            let row = Row::of(&study, &mut evaluator, index);
            assert_ne!(row.class(), "unreachable", "row {index} of {poses}");
            let q = row.group("q", &joints(study.chain()));
            let chain = study.chain();
            let at = chain.workspace().update(chain, &q).unwrap().pose(chain.frame("tip").unwrap()).translation;
            let off = ["tip.x", "tip.y", "tip.z"]
                .iter()
                .zip(at.iter())
                .map(|(name, x)| row.0.get(*name).map_or(0.0, |wanted| (x - wanted).abs()));
            assert!(off.fold(0.0, f64::max) < 1e-9, "row {index}: tip at {at:?}");
        }
    }
}

/// In each of the planes of the axes, with hinges of both senses: up is up in z where the plane stands, and up in y in the x-y plane,
/// for a tip on the side of x (of y in the y-z plane).
#[test]
fn an_elbow_is_up_whatever_the_plane_and_the_sense_of_its_hinges() {
    for (axis, link, along, up) in [("0 0", "0.4 0 0", 0, 1), ("0 0", "0.4 0 0", 0, 2), ("0 0", "0 0.4 0", 1, 2)] {
        let normal_axis = 3 - along - up;
        for sense in ["1", "-1"] {
            let mut axes: Vec<&str> = axis.split(' ').collect();
            axes.insert(normal_axis, sense);
            let axes = axes.join(" ");
            let hinges = [("continuous", axes.as_str(), "0 0 0", ""), ("continuous", axes.as_str(), link, "")];
            let name = ["x", "y", "z"];
            let poses = format!("[tip]\n{} = 0.6\n{} = 0.05", name[along], name[up]);
            let normal = ["[-1, 0, 0]", "[0, -1, 0]"][along];
            let study = study_of(&arm(&hinges, link), "", &poses, normal);
            let (chain, mut evaluator) = (study.chain(), study.evaluator());
            assert_eq!(study.rows(), 2);
            for (index, side) in [(0, 1.0), (1, -1.0)] {
                let q = Row::of(&study, &mut evaluator, index).group("q", &joints(chain));
                let elbow = chain.workspace().update(chain, &q).unwrap().pose(chain.frame("l2").unwrap()).translation;
                let above = elbow[up] - elbow[along] * 0.05 / 0.6;
                assert!(side * above > 0.2, "axis {axes}, row {index}: elbow at {elbow:?}");
            }
        }
    }
}

/// A joint that follows another has limits of its own: they hold for the joint that it follows, in warnings and in the search.
#[test]
fn limits_of_mimic_joints_hold_for_the_joint_that_they_follow() {
    let limit = "<limit lower='-3' upper='3' velocity='1' effort='1'/>";
    let follows = format!("{limit}<mimic joint='j2' multiplier='-2' offset='0.3'/>");
    let hinge = |more| ("revolute", "0 0 1", "0.4 0 0", more);
    let urdf = arm(&[hinge(limit), hinge(limit), hinge(&follows)], "0.4 0 0");
    let given = study_of(&urdf, "", "[joints]\nj1 = 0\nj2 = [0.5, 1.7, 3.2]", "[-1, 0, 0]");
    let said: Vec<&String> = given.warnings.iter().filter(|said| said.contains("[joints]")).collect();
    assert_eq!(
        said,
        [
            "[joints] j2 = 1.7 rad is beyond the limits of the joint and of those that mimic it, -1.35 to 1.65: such rows have no \
          numbers; set [robot] limits = false to compute them"
        ]
    );
    // The tip at j1 = 0.5, j2 = 1, sought from a seed beyond the limit of the joint that follows.
    let tip = |angles: [f64; 3]| angles.iter().fold([0.4, 0.0], |at, a| [at[0] + 0.4 * a.cos(), at[1] + 0.4 * a.sin()]);
    let [x, y] = tip([0.5, 1.5, -0.2]);
    let study = study_of(&urdf, "", &format!("[tip]\nx = {x}\ny = {y}\nseeds = [[0.9, 2.2]]"), "[-1, 0, 0]");
    let row = Row::of(&study, &mut study.evaluator(), 0);
    assert!(
        row.class() != "outside-limits" && (-1.35..=1.65).contains(&row.get("q.j2")),
        "{} {:?}",
        row.class(),
        row.0
    );
}
