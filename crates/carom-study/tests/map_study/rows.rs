//! Rows of impact maps agree with single impacts, and do not depend on other rows.

use crate::map_study::{refused, robot, study};
use carom_chain::{Chain, ToolMotion};
use carom_impact::{Coefficients, law_by_name};
use carom_sim::{ChainImpact, Impacts, JointModel};
use carom_study::NumberedRows;
use carom_study::map_study::{CLASSES, Evaluator, Study};
use std::collections::BTreeMap;

pub const EVERYTHING: &str = r#""mode", "tangential_jump", "tangential_after", "normal_after", "impulse", "effective_mass", "coupling",
    "energy_loss", "energy_ratio", "joint_jump", "joint_load", "joint_impulse", "limit_share", "limit_joint", "qd_minus", "qd_plus", "position""#;

/// A row by the names of its columns.
pub struct Row(pub BTreeMap<String, f64>);

impl Row {
    pub fn of(study: &Study, evaluator: &mut Evaluator, index: u64) -> Self {
        let mut row = vec![0.0; study.columns().len()];
        evaluator.row(index, &mut row);
        Self(study.columns().iter().map(|c| c.name.clone()).zip(row).collect())
    }
    pub fn get(&self, name: &str) -> f64 {
        *self.0.get(name).unwrap_or_else(|| panic!("no column {name} among {:?}", self.0.keys()))
    }
    pub fn group(&self, prefix: &str, joints: &[String]) -> Vec<f64> {
        joints.iter().map(|joint| self.get(&format!("{prefix}.{joint}"))).collect()
    }
    pub fn class(&self) -> &'static str {
        CLASSES[self.get("class") as usize]
    }
}

pub fn joints(chain: &Chain) -> Vec<String> {
    let own = |j: &&carom_chain::JointInfo| matches!(j.coordinates, carom_chain::Coordinates::Own { .. });
    chain.joints().iter().filter(own).map(|j| j.name.clone()).collect()
}

/// A single impact of the chain, computed in space.
fn single(chain: &Chain, q: &[f64], qd: &[f64], normal: [f64; 3], law: &str, with: Coefficients) -> ChainImpact {
    let law = law_by_name::<3>(law, with).unwrap();
    chain.impact(q, qd).at(chain.frame("tip").unwrap()).normal(normal).resolve(law.as_ref()).unwrap()
}

/// Compares the numbers of a row with a single impact at its pose and velocity. Tolerances: the map computes qd⁻ from H, whose
/// condition number is below 1e5 here, so rounding errors of 1e-16 grow to 1e-11; the work is a sum of terms of the size of
/// the energy.
#[allow(clippy::too_many_arguments)] // all conditions of an impact
pub fn compare(
    study: &Study,
    chain: &Chain,
    row: &Row,
    q: &[f64],
    normal: [f64; 3],
    along: [f64; 3],
    law: &str,
    with: Coefficients,
) {
    let names = joints(chain);
    let qd = row.group("qd_minus", &names);
    let hit = single(chain, q, &qd, normal, law, with);
    let (n, t) = (nalgebra::Vector3::from(normal), nalgebra::Vector3::from(along));
    let close = |what: &str, ours: f64, theirs: f64, scale: f64| {
        assert!((ours - theirs).abs() <= 1e-9 * scale, "{what}: {ours} in the map, {theirs} single, at {q:?}");
    };
    let speed = hit.u_minus.norm();
    close("u_t⁺", row.get("tangential_after"), t.dot(&hit.u_plus), speed);
    close("u_n⁺", row.get("normal_after"), n.dot(&hit.u_plus), speed);
    close("jump", row.get("tangential_jump"), t.dot(&(hit.u_plus - hit.u_minus)), speed);
    close("impulse", row.get("impulse"), hit.impulse.norm(), hit.impulse.norm());
    close("loss", row.get("energy_loss"), hit.energy_loss(), hit.energy_before);
    close("T⁺/T⁻", row.get("energy_ratio"), hit.energy_ratio(), 1.0);
    let fastest = qd.iter().chain(&hit.qd_plus).fold(0.0_f64, |a, b| a.max(b.abs()));
    for (ours, theirs) in row.group("qd_plus", &names).iter().zip(&hit.qd_plus) {
        close("qd⁺", *ours, *theirs, fastest);
    }
    let jump: Vec<f64> = qd.iter().zip(&hit.qd_plus).map(|(a, b)| (b - a).abs()).collect();
    close("joint jump", row.get("joint_jump"), jump.iter().copied().fold(0.0, f64::max), fastest);
    let strike = chain.impact(q, &qd).at(chain.frame("tip").unwrap()).normal(normal);
    let loads = strike.loads(&hit).unwrap().joint_impulse;
    let most = loads.iter().fold(0.0_f64, |most, x| x.abs().max(most));
    close("joint load", row.get("joint_load"), most, most);
    for (ours, theirs) in row.group("joint_impulse", &names).iter().zip(&loads) {
        close("joint impulse", *ours, *theirs, most);
    }
    let share = |k: usize| jump[k] / chain.joint(&names[k]).unwrap().limits.velocity.unwrap();
    let worst = (0..names.len()).map(share).fold(0.0, f64::max);
    close("limit share", row.get("limit_share"), worst, worst);
    close("limit joint", share(row.get("limit_joint") as usize), worst, worst);
    let tip = chain.frame("tip").unwrap();
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(chain, q).unwrap();
    let at = kin.pose(tip).translation;
    for (name, x) in ["x", "y", "z"].into_iter().zip(at.iter()) {
        close("position", row.get(&format!("position.{name}")), *x, 1.0);
    }
    let mass = kin.contact_inertia(chain.point(tip, nalgebra::Vector3::zeros())).unwrap().effective_mass(&normal);
    close("effective mass", row.get("effective_mass"), mass.unwrap(), mass.unwrap());
    let mode = study.columns().iter().find(|c| c.name == "mode").unwrap().spell(row.get("mode")).to_owned();
    assert_eq!(mode, hit.mode.name());
}

#[test]
fn a_row_of_a_joint_grid_is_the_single_impact_at_its_pose() {
    let laws = ["frictionless", "newton", "poisson", "energetic", "chatterjee-ruina"];
    let impact = r#"normal = [-0.6, 0.8, 0]
        along = [0.8, 0.6, 0]
        approach_deg = { from = 20, to = 160, count = 8 }
        speed = [0.1, 0.3]
        law = ["frictionless", "newton", "poisson", "energetic", "chatterjee-ruina"]
        restitution = { from = 0, to = 1, count = 4 }
        tangential_restitution = [-0.5, 0.5]
        friction = [0, 0.2, 0.9]"#;
    let poses = "[joints]\nshoulder = { from = -175, to = 175, count = 36, unit = \"deg\" }\nelbow = { from = -2.9, to = 2.9, count = 30 }";
    let study = study("planar2", poses, impact, EVERYTHING);
    assert_eq!(study.rows(), 36 * 30 * 8 * 2 * 5 * 4 * 2 * 3);
    let chain = Chain::from_urdf_file(robot("planar2")).unwrap();
    let mut evaluator = study.evaluator();
    let mut random = 1_u64;
    let mut seen = std::collections::HashSet::new();
    for _ in 0..400 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let row = Row::of(&study, &mut evaluator, (random >> 20) % study.rows());
        seen.insert(row.class());
        let q = [row.get("q.shoulder"), row.get("q.elbow")];
        let with = Coefficients {
            restitution: row.get("restitution"),
            tangential_restitution: row.get("tangential_restitution"),
            friction: row.get("friction"),
        };
        let (normal, along) = ([-0.6, 0.8, 0.0], [0.8, 0.6, 0.0]);
        compare(&study, &chain, &row, &q, normal, along, laws[row.get("law") as usize], with);
        // the tangential velocity before the impact is the prescribed one
        let before = row.get("tangential_after") - row.get("tangential_jump");
        let wanted = row.get("speed") * row.get("approach_deg").to_radians().cos();
        assert!((before - wanted).abs() < 1e-12 * row.get("speed"));
    }
    assert!(["stick", "shrinks", "grows", "reverses"].iter().all(|class| seen.contains(class)), "{seen:?}");
}

#[test]
fn a_row_in_space_is_the_single_impact_at_its_pose() {
    let chain = Chain::from_urdf_file(robot("arm7")).unwrap();
    let names = joints(&chain);
    let poses: String = names
        .iter()
        .enumerate()
        .map(|(k, name)| format!("{name} = [{}, {}]\n", 0.3 + 0.05 * k as f64, -0.4 + 0.1 * k as f64))
        .collect();
    let impact = "normal = [0, 0, 1]\nalong = [1, 0, 0.5]\napproach_deg = [40, 75]\nspeed = 0.3\nlaw = \"energetic\"\nrestitution = 0.4\nfriction = 0.3";
    let study = study("arm7", &format!("[joints]\n{poses}"), impact, EVERYTHING);
    assert_eq!(study.rows(), 256);
    let mut evaluator = study.evaluator();
    let (mut compared, mut seen) = (0, std::collections::BTreeSet::new());
    for index in (0..study.rows()).step_by(7) {
        let row = Row::of(&study, &mut evaluator, index);
        let q = row.group("q", &names);
        let with = Coefficients { restitution: 0.4, friction: 0.3, ..Coefficients::default() };
        compare(&study, &chain, &row, &q, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], "energetic", with);
        compared += 1;
        seen.insert(row.class());
    }
    assert!(compared == 37 && seen.len() >= 2, "{compared} rows of the classes {seen:?}");
}

/// How many distances of a column were checked, and in which way.
#[derive(Debug, Default)]
struct Checked {
    /// The mode changes at the distance.
    changes: usize,
    /// NaN: the mode does not change at any sample.
    never: usize,
    /// Too small to be distinguished from rounding errors: not checked.
    tiny: usize,
}

impl Checked {
    /// Checks the distance of a row to the nearest change of mode against `mode`, the mode of a single impact as a function of
    /// the change of the parameter. `samples` are changes over the whole range of the parameter. The bisection of the map is
    /// exact up to rounding of its H, and the single impact computes its own H, so the tolerance is 1e-6 of the distance.
    fn add(&mut self, row: &Row, column: &str, samples: &[f64], mut mode: impl FnMut(f64) -> &'static str) {
        let distance = row.get(column);
        let own = mode(0.0);
        if distance.is_nan() {
            for sample in samples {
                assert_eq!(mode(*sample), own, "{column} is NaN, but the mode changes at {sample}");
            }
            self.never += 1;
        } else if distance.abs() < 1e-6 {
            self.tiny += 1;
        } else {
            assert_eq!(mode(distance * (1.0 - 1e-6)), own, "{column} {distance}");
            assert_ne!(mode(distance * (1.0 + 1e-6)), own, "{column} {distance}");
            // no nearer change in the other direction
            assert_eq!(mode(-distance * (1.0 - 1e-3)), own, "{column} {distance}, in the other direction");
            self.changes += 1;
        }
    }
}

#[test]
fn single_impacts_change_their_mode_at_the_distances_of_a_row() {
    let laws = ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "smith"];
    let impact = format!(
        "normal = [-0.6, 0.8, 0]\nalong = [0.8, 0.6, 0]\napproach_deg = {{ from = 20, to = 160, count = 8 }}\nspeed = 0.2\nlaw = {laws:?}\nrestitution = [0.1, 0.7]\nfriction = [0.05, 0.3, 0.9]"
    );
    let poses = "[joints]\nshoulder = { from = -175, to = 175, count = 36, unit = \"deg\" }\nelbow = { from = -2.9, to = 2.9, count = 30 }";
    let quantities = "\"mode\", \"qd_minus\", \"mode_margin\", \"mode_edge\", \"mode_beyond\", \"boundary_friction\", \"boundary_restitution\", \"boundary_approach_deg\"";
    let study = study("planar2", poses, &impact, quantities);
    let chain = Chain::from_urdf_file(robot("planar2")).unwrap();
    let (normal, names) = ([-0.6, 0.8, 0.0], joints(&chain));
    let word = |row: &Row, column: &str| {
        let code = row.get(column);
        study.columns().iter().find(|c| c.name == column).unwrap().spell(code).to_owned()
    };
    let mut evaluator = study.evaluator();
    let (mut random, mut compared) = (7_u64, 0);
    let mut checked: [Checked; 3] = Default::default();
    for _ in 0..150 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let row = Row::of(&study, &mut evaluator, (random >> 20) % study.rows());
        let law = laws[row.get("law") as usize];
        let q = [row.get("q.shoulder"), row.get("q.elbow")];
        let qd = row.group("qd_minus", &names);
        let with = Coefficients {
            restitution: row.get("restitution"),
            friction: row.get("friction"),
            ..Coefficients::default()
        };
        let tip = chain.frame("tip").unwrap();
        let mut contact = chain.impact(&q, &qd).at(tip).normal(normal).contact().unwrap();
        // the same boundary as `carom impact --derivatives` prints
        let alone = law_by_name::<3>(law, with).unwrap();
        let nearest = contact.problem().boundaries(alone.as_ref()).unwrap()[0];
        assert!((row.get("mode_margin") - nearest.margin).abs() < 1e-9, "{law} at {q:?}");
        assert_eq!(
            (word(&row, "mode_edge").as_str(), word(&row, "mode_beyond").as_str()),
            (nearest.edge.name(), nearest.beyond.name())
        );
        compared += 1;
        assert_eq!(word(&row, "mode"), contact.resolve(alone.as_ref()).unwrap().mode.name());

        let single = |qd: &[f64], with| single(&chain, &q, qd, normal, law, with).mode.name();
        let by_friction = |d: f64| single(&qd, Coefficients { friction: (with.friction + d).max(0.0), ..with });
        let frictions: Vec<f64> = (0..=40).map(|k| (2.0 * f64::from(k)).to_radians().tan() - with.friction).collect();
        checked[0].add(&row, "boundary_friction", &frictions, by_friction);
        let by_restitution =
            |d: f64| single(&qd, Coefficients { restitution: (with.restitution + d).clamp(0.0, 1.0), ..with });
        let restitutions: Vec<f64> = (0..=40).map(|k| f64::from(k) / 40.0 - with.restitution).collect();
        checked[1].add(&row, "boundary_restitution", &restitutions, by_restitution);
        let by_approach = |d: f64| {
            let angle = (row.get("approach_deg") + d).to_radians();
            let (t, n) = (nalgebra::vector![0.8, 0.6], nalgebra::vector![-0.6, 0.8]);
            let u = (t * angle.cos() - n * angle.sin()) * 0.2;
            let mut workspace = chain.workspace();
            let kin = workspace.update(&chain, &q).unwrap();
            let jacobian = kin.point_jacobian(chain.point(tip, nalgebra::Vector3::zeros()));
            let jacobian =
                nalgebra::Matrix2::new(jacobian[(0, 0)], jacobian[(0, 1)], jacobian[(1, 0)], jacobian[(1, 1)]);
            single(jacobian.try_inverse().map(|inverse| inverse * u).unwrap().as_slice(), with)
        };
        let approaches: Vec<f64> = (1..40).map(|k| 4.5 * f64::from(k) - row.get("approach_deg")).collect();
        checked[2].add(&row, "boundary_approach_deg", &approaches, by_approach);
    }
    assert_eq!(compared, 150);
    let [friction, restitution, approach] = &checked;
    let checked_of = |it: &Checked| (it.changes, it.never, it.tiny);
    assert_eq!(
        [friction, restitution, approach].map(checked_of),
        [(84, 66, 0), (16, 134, 0), (150, 0, 0)],
        "{checked:?}"
    );
}

/// Eq. (15) of Pagilla and Yu: without friction the tangential jump is −(1+e) h times the approach speed.
#[test]
fn frictionless_tangential_jump_is_proportional_to_the_coupling() {
    let impact = "normal_deg = { from = 0, to = 350, count = 36 }\napproach_deg = { from = 10, to = 170, count = 9 }\nspeed = 0.2\nlaw = \"frictionless\"\nrestitution = [0, 0.35, 1]";
    let study = study("planar2", "[joints]\nshoulder = [0.3, 1.1]\nelbow = [-1.2, 0.7]", impact, EVERYTHING);
    assert_eq!(study.rows(), 2 * 2 * 36 * 9 * 3);
    let mut evaluator = study.evaluator();
    for index in 0..study.rows() {
        let row = Row::of(&study, &mut evaluator, index);
        let approach = 0.2 * row.get("approach_deg").to_radians().sin();
        let expected = -(1.0 + row.get("restitution")) * row.get("coupling") * approach;
        let scale = 0.2 * (1.0 + row.get("coupling").abs());
        assert!((row.get("tangential_jump") - expected).abs() < 1e-12 * scale, "row {index}");
        let ratio = (row.get("tangential_after")) / (row.get("tangential_after") - row.get("tangential_jump"));
        let class = match ratio {
            r if r < 0.0 => "reverses",
            r if r > 1.0 => "grows",
            _ => "shrinks",
        };
        // at 90° the tangential velocity before the impact is zero
        let straight = row.get("approach_deg") == 90.0;
        assert_eq!(row.class(), if straight { "starts" } else { class }, "row {index}: {ratio}");
    }
}

/// Definition of the ellipse: an impulse equal to a semi-axis gives |Δqd| = 1.
#[test]
fn impulses_equal_to_semi_axes_give_unit_joint_velocity_jumps() {
    let impact = "normal = [-1, 0, 0]\napproach_deg = 90\nspeed = 0.2\nlaw = \"frictionless\"\nrestitution = 0.5";
    let poses = "[joints]\nshoulder = { from = -1, to = 1, count = 5 }\nelbow = { from = 0.3, to = 2.8, count = 6 }";
    let study = study("planar2", poses, impact, "\"impact_ellipse\"");
    assert_eq!(study.rows(), 30);
    let chain = Chain::from_urdf_file(robot("planar2")).unwrap();
    let point = chain.point(chain.frame("tip").unwrap(), nalgebra::Vector3::zeros());
    let mut evaluator = study.evaluator();
    let mut workspace = chain.workspace();
    for index in 0..study.rows() {
        let row = Row::of(&study, &mut evaluator, index);
        let q = [row.get("q.shoulder"), row.get("q.elbow")];
        let response = workspace.update(&chain, &q).unwrap().contact_inertia(point).unwrap().response;
        let angle = row.get("impact_ellipse.angle_deg").to_radians();
        for (length, angle) in [("long", angle), ("short", angle + std::f64::consts::FRAC_PI_2)] {
            let (sin, cos) = angle.sin_cos();
            let impulse =
                nalgebra::DVector::from_vec(vec![cos, sin, 0.0]) * row.get(&format!("impact_ellipse.{length}"));
            let jump = (&response * impulse).norm();
            assert!((jump - 1.0).abs() < 1e-9, "{length} at {q:?}: {jump}");
        }
        assert!(row.get("impact_ellipse.long") >= row.get("impact_ellipse.short"));
    }
}

/// With locked joints the arm is one free rigid body. Its effective mass along a line through its centre of mass is the total
/// mass of the moving links, along other lines it is smaller.
#[test]
fn locked_mass_is_at_most_the_mass_of_the_moving_links() {
    let impact = "normal_deg = { from = 0, to = 179, count = 180 }\napproach_deg = 90\nspeed = 0.2\nlaw = \"frictionless\"\nrestitution = 0.5";
    let study =
        study("planar2", "[joints]\nshoulder = 0.4\nelbow = 0.9", impact, "\"locked_mass\", \"effective_mass\"");
    let mut evaluator = study.evaluator();
    let masses: Vec<f64> = (0..180).map(|k| Row::of(&study, &mut evaluator, k).get("locked_mass")).collect();
    assert!(study.rows() == 180 && masses.iter().all(|m| m.is_finite()), "{masses:?}");
    let (low, high) = masses.iter().fold((f64::MAX, 0.0_f64), |(l, h), m| (l.min(*m), h.max(*m)));
    assert!(high <= 19.689 * (1.0 + 1e-12) && high > 19.5 && low < 12.0, "{low} to {high}");
}

/// Rows in any order are identical to rows computed alone. Checked for a study with inverse kinematics, and for one with nearly
/// stretched poses, of which some normals need the factorised inertia.
#[test]
fn a_row_does_not_depend_on_the_rows_computed_before() {
    let impact = "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = [30, 60]\nspeed = 0.2\nlaw = [\"energetic\", \"newton\"]\nrestitution = 0.35\nfriction = 0.1";
    let sought = study(
        "planar3",
        "[tip]\nx = { from = 0.2, to = 1.4, count = 9 }\ny = { from = -0.6, to = 0.6, count = 5 }",
        impact,
        EVERYTHING,
    );
    let normals = "normal = [[-0.6, 0.8, 0], [-1, 0, 0], [0, 1, 0], [-0.8, 0.6, 0]]";
    let stretched = study(
        "planar2",
        "[joints]\nshoulder = [0, 1e-9, 1e-6]\nelbow = [1e-7, 1e-5, 1e-4, 1e-3]",
        &impact.replace("normal = [-1, 0, 0]", normals).replace("along = [0, -1, 0]", ""),
        EVERYTHING,
    );
    for (study, least) in [(sought, 264), (stretched, 60)] {
        let width = study.columns().len();
        let bits = |row: &[f64]| row.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let mut row = vec![0.0; width];
        let mut forward = study.evaluator();
        let mut fresh = |index| {
            study.evaluator().row(index, &mut row);
            bits(&row)
        };
        let alone: Vec<Vec<u64>> = (0..study.rows()).map(&mut fresh).collect();
        let class = study.columns().iter().position(|column| column.name == "class").unwrap();
        let numbers = alone.iter().filter(|row| f64::from_bits(row[class]) > 4.0).count();
        assert!(numbers >= least, "only {numbers} of {} rows have numbers", study.rows());
        let mut backward = study.evaluator();
        for k in 0..study.rows() {
            let mut row = vec![0.0; width];
            forward.row(k, &mut row);
            assert_eq!(bits(&row), alone[k as usize], "row {k} after those before");
            let index = study.rows() - 1 - k;
            backward.row(index, &mut row);
            assert_eq!(bits(&row), alone[index as usize], "row {index} after those behind");
        }
    }
}

/// In a map with locked joints a row is the single impact with these joints locked, for velocities of the others; a name that is no joint
/// of the robot is refused.
#[test]
fn rows_with_locked_joints_are_single_impacts_with_locked_joints() {
    let impact = r#"normal = [-1, 0, 0]
        along = [0, -1, 0]
        approach_deg = [30, 60]
        speed = 0.2
        law = "energetic"
        restitution = 0.5
        friction = 0.3
        locked = ["wrist"]"#;
    let poses = "[joints]\nshoulder = [0.4, -0.7]\nelbow = [-1.2, 0.8]\nwrist = [0.3, 1.1]";
    let map = study("planar3", poses, impact, r#""impulse", "joint_impulse", "qd_minus", "qd_plus", "effective_mass""#);
    let chain = Chain::from_urdf_file(robot("planar3")).unwrap();
    let (mut evaluator, names) = (map.evaluator(), joints(&chain));
    let law =
        law_by_name::<3>("energetic", Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() }).unwrap();
    let mut seen = 0;
    for index in 0..map.rows() {
        let row = Row::of(&map, &mut evaluator, index);
        let (q, qd) = (row.group("q", &names), row.group("qd_minus", &names));
        assert_eq!(qd[2], 0.0, "a locked joint does not take part in the approach");
        let locked = JointModel::Locked(&["wrist"]);
        let strike = chain.impact(&q, &qd).at(chain.frame("tip").unwrap()).normal([-1.0, 0.0, 0.0]).joints(locked);
        let hit = strike.resolve(law.as_ref()).unwrap();
        assert!((row.get("impulse") - hit.impulse.norm()).abs() < 1e-11 * hit.impulse.norm());
        for (ours, theirs) in row.group("qd_plus", &names).iter().zip(&hit.qd_plus) {
            assert!((ours - theirs).abs() < 1e-10, "{ours} in the map, {theirs} single");
        }
        seen += usize::from(hit.impulse.norm() > 0.0);
    }
    assert_eq!(seen, 16);
    let why = refused("planar3", poses, &impact.replace("wrist", "hand"));
    assert!(why.contains("[impact] locked holds \"hand\"") && why.contains("shoulder, elbow, wrist"), "{why}");
}

/// A locked joint needs no mass behind it; the row is the single impact.
#[test]
fn rows_have_massless_links_behind_locked_joints() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(robot("planar3")).unwrap();
    let (start, end) = (urdf.rfind("<inertial>").unwrap(), urdf.rfind("</inertial>").unwrap() + "</inertial>".len());
    let urdf = urdf[..start].to_owned() + &urdf[end..];
    std::fs::write(folder.path().join("arm.urdf"), &urdf).unwrap();
    let study = |keys: &str| {
        let text = format!(
            "[robot]\nurdf = \"arm.urdf\"\n[joints]\nshoulder = 0.4\nelbow = -1.2\nwrist = [0.3, 1.1]\n[impact]\n{keys}\n\
             normal = [-1, 0, 0]\napproach_deg = 60\nspeed = 0.2\nlaw = \"newton\"\nrestitution = 0.5\nfriction = 0.3\n\
             [map]\nquantities = [\"impulse\", \"qd_minus\", \"qd_plus\"]\n"
        );
        Study::from_toml(&text, folder.path())
    };
    let refused = study("").err().unwrap().to_string();
    assert!(refused.starts_with("<study>: [robot] urdf: 'planar3' has no dynamics"), "{refused}");
    let map = study("locked = [\"wrist\"]").unwrap();
    let chain = Chain::from_urdf_str(&urdf, &Default::default()).unwrap();
    let law =
        law_by_name::<3>("newton", Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() }).unwrap();
    let (mut evaluator, names) = (map.evaluator(), joints(&chain));
    for (index, wrist) in [(0, 0.3), (1, 1.1)] {
        let row = Row::of(&map, &mut evaluator, index);
        let (q, qd) = ([0.4, -1.2, wrist], row.group("qd_minus", &names));
        let locked = JointModel::Locked(&["wrist"]);
        let strike = chain.impact(&q, &qd).at(chain.frame("tip").unwrap()).normal([-1.0, 0.0, 0.0]).joints(locked);
        let hit = strike.resolve(law.as_ref()).unwrap();
        assert!(hit.impulse.norm() > 0.0 && (row.get("impulse") - hit.impulse.norm()).abs() < 1e-11, "{:?}", row.0);
        for (ours, theirs) in row.group("qd_plus", &names).iter().zip(&hit.qd_plus) {
            assert!((ours - theirs).abs() < 1e-10, "{ours} in the map, {theirs} single");
        }
    }
}

/// With `motion` the joint velocities of a row are those of the chain's tool velocity, in the plane and in space, the row is the single
/// impact with them, and impulses do not depend on them.
#[test]
fn rows_have_the_tool_motion_that_is_asked_for() {
    let wanted = r#""impulse", "energy_ratio", "qd_minus", "qd_plus""#;
    let poses = [
        ("planar3", "[joints]\nshoulder = [0.4, -0.7]\nelbow = [-1.2, 0.8]\nwrist = [0.3, 1.1]".to_owned()),
        ("arm7", {
            let chain = Chain::from_urdf_file(robot("arm7")).unwrap();
            let one = |(k, name): (usize, &String)| format!("{name} = [{}, 0.9]\n", 0.3 + 0.1 * k as f64);
            format!("[joints]\n{}", joints(&chain).iter().enumerate().map(one).collect::<String>())
        }),
    ];
    for (name, poses) in &poses {
        let chain = Chain::from_urdf_file(robot(name)).unwrap();
        let tip = chain.frame("tip").unwrap();
        let of = |motion: &str| {
            let impact = format!(
                "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = 60\nspeed = 0.2\nlaw = \"energetic\"\n\
                 restitution = 0.5\nfriction = 0.3\n{motion}"
            );
            study(name, poses, &impact, wanted)
        };
        let plain = of("");
        let (mut least, names) = (plain.evaluator(), joints(&chain));
        let law = law_by_name::<3>("energetic", Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() })
            .unwrap();
        let u = 0.2 * nalgebra::Vector3::new(60f64.to_radians().sin(), -0.5, 0.0);
        for (motion, word) in ToolMotion::ALL {
            let map = of(&format!("motion = \"{word}\""));
            let mut evaluator = map.evaluator();
            let mut other = 0;
            for index in 0..map.rows().min(16) {
                let row = Row::of(&map, &mut evaluator, index);
                let q = row.group("q", &names);
                let wanted = chain.workspace().update(&chain, &q).unwrap().tool_velocity(tip.into(), u, motion);
                let Ok(wanted) = wanted else {
                    assert_eq!(row.class(), "singular");
                    continue;
                };
                let qd = row.group("qd_minus", &names);
                assert!(qd.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{word} {index}: {qd:?} {wanted}");
                let hit = chain.impact(&q, &qd).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref()).unwrap();
                let ratio = row.get("energy_ratio");
                assert!((ratio - hit.energy_ratio()).abs() < 1e-9, "{word}: {ratio} {}", hit.energy_ratio());
                let plus = row.group("qd_plus", &names);
                assert!(plus.iter().zip(&hit.qd_plus).all(|(a, b)| (a - b).abs() < 1e-9), "{word} {index}");
                let same = Row::of(&plain, &mut least, index);
                assert!((same.get("impulse") - row.get("impulse")).abs() < 1e-10);
                let apart = same.group("qd_minus", &names).iter().zip(&qd).any(|(a, b)| (a - b).abs() > 1e-4);
                other += usize::from(apart);
            }
            assert_eq!(other > 0, motion != ToolMotion::LeastEnergy, "{name} {word}: {other}");
        }
        for (keys, why) in [
            ("motion = \"fast\"", "[impact] motion: 'fast' is none of least-energy, least-norm, without-rotation"),
            (
                "motion = \"least-norm\"\nlocked = [\"elbow\"]",
                "locked joints are computed with motion = \"least-energy\" only",
            ),
        ] {
            let impact =
                format!("normal = [-1, 0, 0]\napproach_deg = 90\nspeed = 1\nlaw = \"newton\"\nrestitution = 0\n{keys}");
            let said = refused(name, poses, &impact.replace("elbow\"]", &format!("{}\"]", names[1])));
            assert!(said.contains(why), "{said}");
        }
    }
}
