//! What a fuzzer feeds with bytes: the readers of every kind of input, and impacts at any state. Each function returns, whatever the
//! bytes are: an input is accepted or refused with a message, and what is computed from an accepted one is finite or refused.
//!
//! The targets in `targets/` and the test `crates/carom-evidence/tests/mutated_inputs.rs` call the same functions.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Mesh;
use carom_evidence::consistency::read_measured;
use carom_impact::{Coefficients, LAW_NAMES, law_by_name};
use carom_sim::Scene;
use carom_study::map_study::Study;
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Robots with more velocities than this are loaded but not computed: the time grows with their number.
const MANY: usize = 60;

/// Largest size of the numbers of a state.
const LARGEST: f64 = 1e100;

/// A folder of this process, with the arm that scenes and studies name.
fn desk() -> &'static Path {
    static DESK: OnceLock<PathBuf> = OnceLock::new();
    DESK.get_or_init(|| {
        let desk = std::env::temp_dir().join(format!("carom-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&desk).expect("the folder for temporary files can be written");
        std::fs::write(desk.join("arm.urdf"), ARM).expect("the folder for temporary files can be written");
        desk
    })
}

const ARM: &str = include_str!("../robots/planar2.urdf");

/// A file of this thread with these bytes.
fn file(name: &str, ending: &str, data: &[u8]) -> PathBuf {
    let path = desk().join(format!("{name}-{:?}.{ending}", std::thread::current().id()));
    std::fs::write(&path, data).expect("the folder for temporary files can be written");
    path
}

/// A robot, fixed and floating; its mass matrix at zero.
pub fn urdf(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    for floating_base in [false, true] {
        let options = LoadOptions { floating_base, ..LoadOptions::default() };
        let Ok(chain) = Chain::from_urdf_str(text, &options) else { continue };
        if chain.nv() > MANY || chain.check_dynamics().is_err() {
            continue;
        }
        let q = chain.zero_configuration();
        let mut workspace = chain.workspace();
        if let Ok(mut kin) = workspace.update(&chain, &q) {
            let mass = kin.mass_matrix();
            assert_eq!((mass.nrows(), mass.ncols()), (chain.nv(), chain.nv()));
        }
    }
}

/// A scene, and its plan.
pub fn scene(data: &[u8]) {
    if let Ok(scene) = Scene::from_file(file("scene", "toml", data)) {
        let _ = scene.plan();
    }
}

/// A study.
pub fn study(data: &[u8]) {
    let _ = Study::from_file(file("study", "toml", data));
}

/// The bytes as numbers: state, normal and coefficients of an impact of an arm under every law.
pub fn states(data: &[u8]) {
    static CHAIN: OnceLock<Chain> = OnceLock::new();
    let chain = CHAIN.get_or_init(|| Chain::from_urdf_str(ARM, &LoadOptions::default()).expect("the arm is valid"));
    let mut numbers = [0.5; 10];
    for (number, bytes) in numbers.iter_mut().zip(data.chunks_exact(8)) {
        *number = f64::from_le_bytes(bytes.try_into().expect("chunks of eight"));
    }
    // Energies are squares of these numbers: beyond, they overflow, and the laws do not refuse that yet.
    if numbers.iter().any(|x| x.abs() > LARGEST) {
        return;
    }
    let [q0, q1, v0, v1, nx, ny, nz, restitution, friction, tangential_restitution] = numbers;
    let Ok(tip) = chain.frame("tip") else { return };
    let coefficients = Coefficients { restitution, friction, tangential_restitution };
    for name in LAW_NAMES {
        let Some(law) = law_by_name::<3>(name, coefficients) else { continue };
        let hit = chain_impact(chain, ([q0, q1], [v0, v1]), tip, Vector3::new(nx, ny, nz), &*law);
        if let Some(qd_plus) = hit {
            assert!(qd_plus.iter().all(|v| v.is_finite()), "{name}: {numbers:?} gives {qd_plus:?}");
        }
    }
}

fn chain_impact(
    chain: &Chain,
    (q, qd): ([f64; 2], [f64; 2]),
    tip: carom_chain::FrameId,
    normal: Vector3<f64>,
    law: &dyn carom_impact::Law<f64, 3>,
) -> Option<Vec<f64>> {
    use carom_sim::Impacts;
    chain.impact(&q, &qd).at(tip).normal(normal).resolve(law).ok().map(|hit| hit.qd_plus)
}

/// A mesh; the first byte chooses its format.
pub fn meshes(data: &[u8]) {
    let Some((format, rest)) = data.split_first() else { return };
    let ending = ["stl", "obj", "dae"][usize::from(*format) % 3];
    let _ = Mesh::read(&file("mesh", ending, rest), Vector3::repeat(1.0), "fuzz");
}

/// A table over time, of torques and of forces, as CSV and as Parquet, and a table of measurements; the first byte chooses.
pub fn tables(data: &[u8]) {
    let Some((kind, rest)) = data.split_first() else { return };
    let ending = ["csv", "parquet"][usize::from(*kind) % 2];
    if kind % 3 == 2 {
        let _ = read_measured(&file("measured", "csv", rest), None);
        return;
    }
    let table = file("table", ending, rest);
    let name = table.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let robot = "[robot]\nurdf = \"arm.urdf\"\nq = [0, 1]\n";
    for scene in [
        format!("{robot}[run]\nduration = 1\ncontroller = \"torque-file\"\ntorque_file = \"{name}\"\n"),
        format!("{robot}[[force]]\nlink = \"tip\"\nfile = \"{name}\"\n[run]\nduration = 1\n"),
    ] {
        let _ = Scene::from_file(file("with-table", "toml", scene.as_bytes()));
    }
}
