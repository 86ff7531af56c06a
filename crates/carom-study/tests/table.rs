//! Tables: numbers are read back exactly, and files are complete or absent.

use carom_study::{Column, Table, TableError};
use parquet::basic::{Repetition, Type};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::DoubleType;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::fs::File;
use std::path::Path;

/// Numbers with many digits, extreme numbers, NaN and infinities.
const AWKWARD: [f64; 12] = [
    0.1,
    -0.0,
    1.0 / 3.0,
    5e-324,
    f64::MIN_POSITIVE,
    f64::MAX,
    -1e-300,
    9007199254740993.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1.0,
];

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn number(row: usize, column: usize) -> f64 {
    AWKWARD[(row + column) % AWKWARD.len()] * (1 + row / AWKWARD.len()) as f64
}

fn write(path: &Path, columns: &[String], rows: usize) {
    let mut table = Table::create(path, columns).unwrap();
    for row in 0..rows {
        let values: Vec<f64> = (0..columns.len()).map(|column| number(row, column)).collect();
        table.row(&values).unwrap();
    }
    assert!(!path.exists(), "an unfinished table does not have its final name");
    table.finish().unwrap();
    assert_eq!(files(path.parent().unwrap()), 1, "only the table is left");
}

fn files(folder: &Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

/// Column names, numbers by column, rows of each row group.
fn read_parquet(path: &Path) -> (Vec<String>, Vec<Vec<f64>>, Vec<usize>) {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    for column in schema.columns() {
        assert_eq!(column.physical_type(), Type::DOUBLE);
        assert_eq!(column.self_type().get_basic_info().repetition(), Repetition::REQUIRED);
    }
    let found = schema.columns().iter().map(|column| column.name().to_owned()).collect();
    let mut columns = vec![Vec::new(); schema.num_columns()];
    let mut groups = Vec::new();
    for k in 0..reader.num_row_groups() {
        let group = reader.get_row_group(k).unwrap();
        let rows = group.metadata().num_rows() as usize;
        for (j, column) in columns.iter_mut().enumerate() {
            let mut numbers = get_typed_column_reader::<DoubleType>(group.get_column_reader(j).unwrap());
            assert_eq!(numbers.read_records(rows, None, None, column).unwrap().0, rows);
        }
        groups.push(rows);
    }
    (found, columns, groups)
}

#[test]
fn numbers_of_a_csv_table_are_read_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.csv");
    let columns = names(&["time", "q.a,b", "say \"q\"", "two\nlines"]);
    write(&path, &columns, 30);
    let mut reader = csv::Reader::from_path(&path).unwrap();
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), columns);
    let mut rows = 0;
    for record in reader.records() {
        for (column, text) in record.unwrap().iter().enumerate() {
            let (read, written): (f64, f64) = (text.parse().unwrap(), number(rows, column));
            assert!(read.to_bits() == written.to_bits() || read.is_nan() && written.is_nan(), "{text} for {written}");
        }
        rows += 1;
    }
    assert_eq!(rows, 30);
}

#[test]
fn numbers_of_a_parquet_table_are_read_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    // the extension is case-insensitive
    let path = folder.path().join("x.PARQUET");
    let columns = names(&["time", "q.shoulder", "qd.\"elbow\", m/s"]);
    let rows = 2 * 65536 + 7;
    write(&path, &columns, rows);
    let (found, numbers, groups) = read_parquet(&path);
    assert_eq!(found, columns);
    assert_eq!(groups, [65536, 65536, 7]);
    for (column, numbers) in numbers.iter().enumerate() {
        assert_eq!(numbers.len(), rows);
        for (row, read) in numbers.iter().enumerate() {
            assert_eq!(read.to_bits(), number(row, column).to_bits(), "row {row}, column {column}");
        }
    }
}

#[test]
fn row_groups_of_wide_tables_have_fewer_rows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.parquet");
    let columns: Vec<String> = (0..400).map(|k| format!("q{k}")).collect();
    write(&path, &columns, 10_500);
    let (_, numbers, groups) = read_parquet(&path);
    assert_eq!(groups, [(1 << 22) / 400, 10_500 - (1 << 22) / 400]);
    assert_eq!(numbers[399][10_499].to_bits(), number(10_499, 399).to_bits());
}

#[test]
fn a_table_without_rows_has_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.parquet");
    write(&path, &names(&["time"]), 0);
    assert_eq!(read_parquet(&path), (names(&["time"]), vec![vec![]], vec![]));
    std::fs::remove_file(&path).unwrap();
    let path = folder.path().join("x.csv");
    write(&path, &names(&["time"]), 0);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "time\n");
}

#[test]
fn an_unfinished_table_leaves_no_file_and_replaces_none() {
    for name in ["x.csv", "x.parquet"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut table = Table::create(&path, &names(&["time"])).unwrap();
        table.row(&[1.0]).unwrap();
        assert!(folder.path().join(format!("{name}.part")).exists());
        drop(table);
        assert_eq!(files(folder.path()), 0);

        // an existing table is unchanged
        std::fs::write(&path, "before").unwrap();
        drop(Table::create(&path, &names(&["time"])).unwrap());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");
        Table::create(&path, &names(&["time"])).unwrap().finish().unwrap();
        assert_ne!(std::fs::read(&path).unwrap(), b"before");
    }
}

#[test]
fn a_row_of_wrong_length_is_refused_and_the_table_stays_usable() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.csv");
    let mut table = Table::create(&path, &names(&["a", "b"])).unwrap();
    table.row(&[1.0, 2.0]).unwrap();
    let refused = table.row(&[1.0]).unwrap_err();
    assert!(matches!(refused, TableError::Row { given: 1, columns: 2, .. }));
    assert_eq!(refused.to_string(), format!("{}: a row has 1 numbers, but the table has 2 columns", path.display()));
    table.row(&[0.5, -2.0]).unwrap();
    table.finish().unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "a,b\n1,2\n0.5,-2\n");
}

#[test]
fn invalid_names_columns_and_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, columns: &[&str]| {
        let path = folder.path().join(name);
        let message = Table::create(&path, &names(columns)).err().expect(name).to_string();
        assert_eq!(files(folder.path()), 0);
        message.strip_prefix(&format!("{}: ", path.display())).expect("the message names the file").to_owned()
    };
    for name in ["x.xlsx", "x", "csv", ".csv", "x.csv.gz"] {
        assert_eq!(refused(name, &["time"]), "the name of a table must end in .csv or .parquet");
    }
    assert_eq!(refused("x.csv", &[]), "a table needs at least one column");
    assert_eq!(refused("x.parquet", &["q", "qd", "q"]), "two columns have the name 'q'");
    for name in ["nowhere/x.csv", "nowhere/x.parquet"] {
        assert!(refused(name, &["time"]).starts_with("cannot be written: No such file"), "{name}");
    }
    std::fs::create_dir(folder.path().join("x.csv")).unwrap();
    let message = Table::create(&folder.path().join("x.csv"), &names(&["time"])).err().unwrap().to_string();
    assert!(message.ends_with("x.csv: cannot be written: is a directory"), "{message}");
    assert_eq!(files(folder.path()), 1);
}

/// /dev/full: every write fails as on a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_and_leaves_no_table() {
    for name in ["x.csv", "x.parquet"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::os::unix::fs::symlink("/dev/full", folder.path().join(format!("{name}.part"))).unwrap();
        let mut table = Table::create(&path, &names(&["time"])).unwrap();
        let mut failed = None;
        for row in 0..100_000 {
            failed = failed.or(table.row(&[f64::from(row)]).err());
        }
        let message = failed.expect("the disk is full").to_string();
        assert!(message.contains("cannot be written: No space left"), "{message}");
        assert!(table.finish().is_err());
        assert_eq!(files(folder.path()), 0);
    }
}

/// Version, units of the columns that have one, and texts; the partial tables of maps hold them as well.
#[test]
fn parquet_tables_tell_version_units_and_where_they_come_from() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.parquet");
    let columns =
        [Column::number("q.\"elbow\"").in_unit("rad"), Column::number("ratio"), Column::word("mode", ["stick"])];
    let mut table = Table::create_with(&path, &columns).unwrap();
    table.describe("carom.scene", "[robot]\nurdf = \"ü.urdf\"");
    table.row(&[0.1, 0.2, 0.0]).unwrap();
    table.finish().unwrap();
    let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
    let told = reader.metadata().file_metadata().key_value_metadata().unwrap().iter();
    let told: Vec<_> = told.map(|it| (it.key.as_str(), it.value.as_deref().unwrap())).collect();
    let expected = [
        ("carom.version", env!("CARGO_PKG_VERSION")),
        ("carom.units", r#"{"q.\"elbow\"":"rad"}"#),
        ("carom.scene", "[robot]\nurdf = \"ü.urdf\""),
    ];
    assert_eq!(told, expected);
}
