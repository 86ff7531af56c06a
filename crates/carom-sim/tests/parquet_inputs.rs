//! Tables of scenes as Parquet files: the same numbers as in CSV, by column name, and messages with the row.

use carom_sim::{Scene, SimError};
use carom_testing::files::Folder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::path::Path;
use std::sync::Arc;

type Column<'a> = (&'a str, &'a [f64]);

fn write_parquet(path: &Path, columns: &[Column], compression: Compression) {
    let fields: String = columns.iter().map(|(name, _)| format!("required double {name}; ")).collect();
    let schema = Arc::new(parse_message_type(&format!("message table {{ {fields}}}")).unwrap());
    let file = std::fs::File::create(path).unwrap();
    let mut writer = SerializedFileWriter::new(
        file,
        schema,
        WriterProperties::builder().set_compression(compression).build().into(),
    )
    .unwrap();
    let mut group = writer.next_row_group().unwrap();
    for (_, values) in columns {
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(values, None, None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
}

fn write_csv(path: &Path, columns: &[Column]) {
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..columns[0].1.len() {
        let cells: Vec<String> = columns.iter().map(|(_, values)| format!("{:?}", values[row])).collect();
        text += &(cells.join(",") + "\n");
    }
    std::fs::write(path, text).unwrap();
}

/// A folder with the presets' robots that is removed at the end.
struct Desk(Folder);

impl Desk {
    fn new() -> Self {
        let folder = Folder::new();
        for robot in ["robots/planar2.urdf", "robots/ball.urdf"] {
            folder.copy(robot);
        }
        Self(folder)
    }

    fn last(&self, scene: &str) -> Result<(Vec<f64>, Vec<f64>), SimError> {
        let scene = Scene::from_toml(scene, &self.0)?;
        let last = scene.plan()?.run(scene.duration)?.summary.last;
        Ok((last.q, last.qd))
    }

    /// The end of a scene with the table as CSV and as Parquet; `scene` has TABLE for the file's name.
    fn both(&self, scene: &str, columns: &[Column]) -> [(Vec<f64>, Vec<f64>); 2] {
        write_csv(&self.0.join("t.csv"), columns);
        write_parquet(&self.0.join("t.parquet"), columns, Compression::UNCOMPRESSED);
        ["t.csv", "t.parquet"].map(|file| self.last(&scene.replace("TABLE", file)).unwrap())
    }
}

const ARM: &str = "[robot]\nurdf = \"planar2.urdf\"\nq = [0.3, -0.4]\n[run]\nduration = 0.5\n";

/// m Δv is the integral of a force that is linear between the rows.
#[test]
fn a_force_from_a_parquet_table_has_the_impulse_of_its_integral() {
    let desk = Desk::new();
    let scene = "[robot]\nurdf = \"ball.urdf\"\nfloating = true\nq = [0, 0, 0, 0, 0, 0, 1]\n[[force]]\nlink = \"ball\"\n\
                 file = \"TABLE\"\n[run]\nduration = 1\ngravity = [0, 0, 0]\ntolerance = 1e-11\n";
    let columns: [Column; 3] = [("fz", &[0.0, 0.3, 0.1]), ("time", &[0.0, 0.4, 1.0]), ("fx", &[0.2, 0.2, 0.2])];
    let [csv, parquet] = desk.both(scene, &columns);
    assert_eq!(csv, parquet);
    let mass = 0.06;
    let expected = [0.2 / mass, 0.0, (0.5 * 0.4 * 0.3 + 0.6 * 0.2) / mass];
    for (found, expected) in parquet.1.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{:?} {expected}", parquet.1);
    }
}

/// zstd is the default of polars, snappy that of most other writers.
#[test]
fn compressed_tables_are_the_same_as_uncompressed_ones() {
    let desk = Desk::new();
    let columns: [Column; 3] =
        [("elbow", &[0.0, 0.02, -0.01]), ("time", &[0.0, 0.2, 0.5]), ("shoulder", &[0.1, 0.0, 0.05])];
    let scene = format!("{ARM}controller = \"torque-file\"\ntorque_file = \"TABLE\"\n");
    let [csv, _] = desk.both(&scene, &columns);
    for compression in [Compression::SNAPPY, Compression::ZSTD(ZstdLevel::default())] {
        write_parquet(&desk.0.join("t.parquet"), &columns, compression);
        assert_eq!(desk.last(&scene.replace("TABLE", "t.parquet")).unwrap(), csv, "{compression:?}");
    }
}

#[test]
fn torques_references_and_velocities_are_the_same_from_parquet_and_csv() {
    let desk = Desk::new();
    let times = [0.0, 0.2, 0.5];
    let columns: [Column; 3] = [("elbow", &[0.0, 0.02, -0.01]), ("time", &times), ("shoulder", &[0.1, 0.0, 0.05])];
    let free = desk.last(ARM).unwrap();
    for keys in [
        "controller = \"torque-file\"\ntorque_file = \"TABLE\"\n",
        "controller = \"tracking\"\nreference = \"TABLE\"\nkp = 5\nkd = 1\n",
    ] {
        let [csv, parquet] = desk.both(&format!("{ARM}{keys}"), &columns);
        assert_eq!(csv, parquet, "{keys}");
        assert_ne!(parquet, free, "{keys}");
    }
    let lifted = "[robot]\nurdf = \"ball.urdf\"\nfloating = true\nq = [0, 0, 0.06, 0, 0, 0, 1]\n[contact]\nlaw = \"newton\"\n\
                  restitution = 0.5\nfriction = 0\n[[surface]]\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }\n\
                  motion = { file = \"TABLE\" }\n[run]\nduration = 0.5\n";
    let [csv, parquet] = desk.both(lifted, &[("vz", &[0.0, 0.3, 0.0]), ("time", &times)]);
    assert_eq!(csv, parquet);
    assert!(parquet.0[2] > 0.06, "the floor has lifted the ball: {parquet:?}");
}

#[test]
fn invalid_parquet_tables_are_refused_with_their_row_or_column() {
    let desk = Desk::new();
    let scene = format!("{ARM}controller = \"torque-file\"\ntorque_file = \"t.parquet\"\n");
    let file = desk.0.join("t.parquet");
    let said = || desk.last(&scene).unwrap_err().to_string();
    let plain = Compression::UNCOMPRESSED;
    write_parquet(&file, &[("time", &[0.0]), ("elbow", &[0.0])], plain);
    assert!(said().contains("t.parquet: column shoulder is missing: add it"), "{}", said());
    write_parquet(&file, &[("time", &[0.0, 1.0]), ("elbow", &[0.0, f64::NAN]), ("shoulder", &[0.0, 0.0])], plain);
    assert!(said().contains("t.parquet: row 2: every cell must be a finite number"), "{}", said());
    write_parquet(&file, &[("time", &[1.0, 0.0]), ("elbow", &[0.0, 0.0]), ("shoulder", &[0.0, 0.0])], plain);
    assert!(said().contains("t.parquet: row 2: time 0 is below"), "{}", said());
    std::fs::write(&file, "time,elbow,shoulder\n0,0,0\n").unwrap();
    assert!(said().contains("t.parquet"), "{}", said());
}
