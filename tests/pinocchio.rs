//! Comparison with Pinocchio 4.1.0 in float64 for four robots (`tests/reference/*.json`, ten random states each). The files
//! also contain the parameters of the robots, from which this test generates the URDF text.
//!
//! `planar2`, `planar3`: uniform links in the xy plane. `panda7`: the published inertial parameters of a seven-joint arm
//! with hand. `chain10`: ten joints with random frames and inertias.

use carom::prelude::{Chain, FrameId, Frictionless, Impacts, Kinematics};
use carom_chain::Spatial;
use carom_chain::urdf::LoadOptions;
use nalgebra::{DMatrix, DVector, Vector3};
use serde_json::Value;
use std::fmt::Write;

/// Relative to the largest entry: both libraries round some thousand operations at 1e-16.
const DIRECT: f64 = 1e-12;
/// For results of a solve with M: additionally its condition number, up to 1e4 for these robots.
const SOLVED: f64 = 1e-10;

struct Reference {
    chain: Chain,
    json: Value,
}

fn numbers(v: &Value) -> Vec<f64> {
    match v {
        Value::Array(all) => all.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().expect("a number")],
    }
}

fn spaced(v: &Value) -> String {
    numbers(v).iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

fn text(v: &Value) -> &str {
    v.as_str().expect("a string")
}

fn load(name: &str) -> Reference {
    let path = format!("{}/tests/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let json: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut urdf = format!("<robot name=\"{name}\">\n");
    for link in json["links"].as_array().unwrap() {
        write!(urdf, "<link name=\"{}\">", text(&link["name"])).unwrap();
        if !link["mass"].is_null() {
            let i = numbers(&link["inertia"]);
            let rpy = if link["inertia_rpy"].is_null() { "0 0 0".into() } else { spaced(&link["inertia_rpy"]) };
            write!(
                urdf,
                "<inertial><origin xyz=\"{}\" rpy=\"{rpy}\"/><mass value=\"{}\"/><inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" \
                 iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
                spaced(&link["com"]),
                link["mass"],
                i[0],
                i[1],
                i[2],
                i[3],
                i[4],
                i[5]
            )
            .unwrap();
        }
        urdf += "</link>\n";
    }
    for joint in json["joints"].as_array().unwrap() {
        let axis = if joint["axis"].is_null() { "1 0 0".into() } else { spaced(&joint["axis"]) };
        writeln!(
            urdf,
            "<joint name=\"{}\" type=\"{}\"><parent link=\"{}\"/><child link=\"{}\"/><origin xyz=\"{}\" rpy=\"{}\"/>\
             <axis xyz=\"{axis}\"/></joint>",
            text(&joint["name"]),
            text(&joint["type"]),
            text(&joint["parent"]),
            text(&joint["child"]),
            spaced(&joint["xyz"]),
            spaced(&joint["rpy"])
        )
        .unwrap();
    }
    urdf += "</robot>\n";
    let chain = Chain::from_urdf_str(&urdf, &LoadOptions::default()).unwrap();
    // The reference files list the joints in the order of the file, as `Chain` does.
    let order: Vec<&str> = json["joint_order"].as_array().unwrap().iter().map(text).collect();
    let ours: Vec<&str> = chain.joints().iter().filter(|j| j.kind.name() != "fixed").map(|j| j.name.as_str()).collect();
    assert_eq!(ours, order);
    Reference { chain, json }
}

#[track_caller]
fn close(name: &str, got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len(), "{name}");
    let scale = want.iter().fold(1e-9_f64, |m, x| m.max(x.abs()));
    for (i, (g, w)) in got.iter().zip(want).enumerate() {
        assert!((g - w).abs() <= tolerance * scale, "{name}[{i}]: {g}, Pinocchio has {w}");
    }
}

fn row_major(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

fn each_sample(name: &str, check: impl Fn(&mut Kinematics<Spatial<f64>>, &Reference, &Value)) {
    let reference = load(name);
    let samples = reference.json["samples"].as_array().unwrap();
    assert_eq!(samples.len(), 10);
    let mut ws = reference.chain.workspace();
    for sample in samples {
        let mut kin = ws.update(&reference.chain, &numbers(&sample["q"])).unwrap();
        check(&mut kin, &reference, sample);
    }
}

impl Reference {
    fn gravity(&self) -> Vector3<f64> {
        Vector3::from_column_slice(&numbers(&self.json["gravity"]))
    }
    fn tip(&self) -> FrameId {
        self.chain.frame(text(&self.json["tip_frame"])).unwrap()
    }
}

fn mass_matrix(name: &str) {
    each_sample(name, |kin, reference, sample| {
        let lower = numbers(&sample["M_lower"]);
        let m = kin.mass_matrix();
        let ours: Vec<f64> = (0..m.nrows()).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|at| m[at]).collect();
        close("M", &ours, &lower, DIRECT);
        assert!((reference.chain.total_mass() - reference.json["total_mass"].as_f64().unwrap()).abs() < 1e-12);
    });
}

fn kinematics(name: &str) {
    each_sample(name, |kin, reference, sample| {
        let tip = reference.tip();
        let pose = kin.pose(tip);
        close("position", pose.translation.as_slice(), &numbers(&sample["tip_position"]), DIRECT);
        let rotation = numbers(&sample["tip_rotation_rowmajor"]);
        close("rotation", pose.rotation.transpose().as_slice(), &rotation, DIRECT);
        // Pinocchio orders the linear rows first, carom the angular rows.
        let j = kin.geometric_jacobian(tip);
        let six = DMatrix::from_fn(6, j.ncols(), |i, k| j[((i + 3) % 6, k)]);
        close("J", &row_major(&six), &numbers(&sample["J"]), DIRECT);
        let velocity = six * DVector::from_vec(numbers(&sample["v"]));
        close("velocity", velocity.as_slice(), &numbers(&sample["tip_velocity"]), DIRECT);
        let point = reference.chain.point(tip, Vector3::zeros());
        close("point J", &row_major(&kin.point_jacobian(point)), &numbers(&sample["J"])[..3 * j.ncols()], DIRECT);
    });
}

fn dynamics(name: &str) {
    each_sample(name, |kin, reference, sample| {
        let gravity = reference.gravity();
        let [qd, qdd, tau] = ["v", "a", "tau"].map(|key| numbers(&sample[key]));
        let bias = numbers(&sample["nle"]);
        close("bias", kin.bias(&qd, gravity).unwrap().as_slice(), &bias, DIRECT);
        close("gravity", kin.gravity_force(gravity).as_slice(), &numbers(&sample["gravity_torque"]), DIRECT);
        let inverse = kin.inverse_dynamics(&qd, &qdd, gravity).unwrap();
        close("inverse dynamics", inverse.as_slice(), &numbers(&sample["rnea"]), DIRECT);
        let forward = kin.forward_dynamics(&qd, &tau, gravity).unwrap();
        close("forward dynamics", forward.as_slice(), &numbers(&sample["aba"]), SOLVED);
        close("T", &[kin.kinetic_energy(&qd).unwrap()], &numbers(&sample["kinetic_energy"]), DIRECT);
        close("V", &[kin.potential_energy(gravity)], &numbers(&sample["potential_energy"]), DIRECT);
    });
}

fn delassus_and_impacts(name: &str) {
    each_sample(name, |kin, reference, sample| {
        let point = reference.chain.point(reference.tip(), Vector3::zeros());
        let want = numbers(&sample["H"]);
        close("H fused", &row_major(&kin.delassus(point).unwrap()), &want, SOLVED);
        close("H recursive", &row_major(&kin.articulate().unwrap().delassus(point)), &want, SOLVED);
        // The reference impact ignores the sign of the approach; in carom the normal points to the robot.
        let sign = if sample["tip_vn_minus"].as_f64().unwrap() < 0.0 { 1.0 } else { -1.0 };
        let normal: Vec<f64> = numbers(&sample["n"]).iter().map(|x| x * sign).collect();
        let (q, qd) = (numbers(&sample["q"]), numbers(&sample["v"]));
        let impacts = sample["impact"].as_array().unwrap();
        assert_eq!(impacts.len(), 3);
        for impact in impacts {
            let law = Frictionless { restitution: impact["e"].as_f64().unwrap() };
            let normal = [normal[0], normal[1], normal[2]];
            let hit = reference.chain.impact(&q, &qd).at(reference.tip()).normal(normal).resolve(&law).unwrap();
            close("qd+", &hit.qd_plus, &numbers(&impact["v_plus"]), SOLVED);
            close("u+", hit.u_plus.as_slice(), &numbers(&impact["tip_v_plus"]), SOLVED);
            close("T+", &[hit.energy_after], &numbers(&impact["kinetic_energy_plus"]), SOLVED);
            close("p", &[hit.impulse.norm()], &[impact["impulse_normal"].as_f64().unwrap().abs()], SOLVED);
        }
    });
}

macro_rules! robots {
    ($($name:ident: $robot:literal),*) => {$(
        mod $name {
            #[test]
            fn pinocchio_mass_matrix() { super::mass_matrix($robot) }
            #[test]
            fn pinocchio_kinematics() { super::kinematics($robot) }
            #[test]
            fn pinocchio_dynamics() { super::dynamics($robot) }
            #[test]
            fn pinocchio_delassus_and_impacts() { super::delassus_and_impacts($robot) }
        }
    )*};
}

robots!(planar2: "planar2", planar3: "planar3", panda7: "panda7", chain10: "chain10");
