//! `carom paper` and `carom consistency`.

use crate::command_line::desk::*;
use serde_json::Value;
use std::path::Path;

const TABLE1: &str = include_str!("../../../../docs/table1.csv");

/// A CSV file of numbers, by column.
fn csv(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(str::to_owned).collect();
    (names, lines.map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect())
}

fn column(path: &Path, name: &str) -> Vec<f64> {
    let (names, rows) = csv(path);
    let k = names.iter().position(|column| column == name).unwrap_or_else(|| panic!("{name} in {names:?}"));
    rows.iter().map(|row| row[k]).collect()
}

/// Values for the stand-in (p₁ = 3.473, p₂ = .196, p₃ = .242 kg m², links of .45 m) at .2 m/s with the e of Table I, computed
/// by hand from eqs. (10) to (16) to five digits.
#[test]
fn data_of_the_paper_are_the_documented_numbers_of_the_stand_in() {
    let desk = Desk::new();
    let ran = desk.run("paper --out figures");
    done(&ran);
    let folder = desk.join("figures");
    for (file, name, digits, unit) in [
        ("fig9.csv", "up_before", [0.17321, 0.14142, 0.10000, 0.0], 5e-6),
        ("fig9.csv", "up_after_newton", [0.29740, 0.31079, 0.29668, 0.23952], 5e-6),
        ("fig9.csv", "down_after_newton", [0.05788, -0.02795, -0.10590, -0.23952], 5e-6),
        ("table1.csv", "up_energy_root_model", [0.9873, 0.9749, 0.9575, 0.9017], 5e-5),
        ("table1.csv", "down_energy_root_model", [0.8893, 0.4148, 0.6247, 0.9017], 5e-5),
        ("table1.csv", "down_energy_root", [0.76, 0.93, 0.91, 0.79], 0.0),
    ] {
        let values = column(&folder.join(file), name);
        assert_eq!(values.len(), digits.len(), "{file}: {name}");
        for (got, want) in values.iter().zip(digits) {
            close(name, *got, want, unit);
        }
    }
    // Fig. 8: rows by speed, then angle; the loss is proportional to the square of the speed
    for (name, digits) in [("up_loss", [7.672, 16.028, 25.250, 32.056]), ("down_loss", [8.311, 16.028, 24.231, 32.056])]
    {
        let (loss, speed) = (column(&folder.join("fig8.csv"), name), column(&folder.join("fig8.csv"), "speed"));
        assert_eq!(loss.len(), 12);
        for (k, want) in digits.iter().enumerate() {
            close(name, loss[4 + k] * 1e3, *want, 5e-4);
            for j in [k, 8 + k] {
                close(name, loss[j] / loss[4 + k], (speed[j] / 0.2).powi(2), 1e-12);
            }
        }
    }
    // Fig. 10: the definition of e
    for (k, e) in [0.40, 0.35, 0.28, 0.35].into_iter().enumerate() {
        let path = folder.join("fig10.csv");
        close("e", column(&path, "up_measured")[k] / -column(&path, "up_before")[k], e, 1e-12);
    }
    // Fig. 4: the jump is that of Fig. 9
    let (time, along) = (column(&folder.join("fig4.csv"), "time"), column(&folder.join("fig4.csv"), "up_tangential"));
    let after = time.iter().rposition(|t| *t == 0.0).unwrap();
    close("v_t⁺", along[after], 0.31079, 5e-6);
    close("v_t⁻", along[after - 1], 0.14142, 5e-6);
}

#[test]
fn report_of_the_paper_names_every_file_and_all_exist() {
    let desk = Desk::new();
    let report = &desk.one("paper --out figures --json");
    assert_eq!(keys(report), ["arm", "claims", "files", "impacts", "stand_in"]);
    assert_eq!(report["impacts"].as_array().unwrap().len(), 24);
    let folder = desk.join("figures");
    let there = desk.files("figures");
    let mut named: Vec<String> = texts(&report["files"]).into_iter().map(str::to_owned).collect();
    named.sort();
    assert_eq!(there, named);
    let text = std::fs::read_to_string(folder.join("report.md")).unwrap();
    for file in named.iter().filter(|file| file.ends_with(".svg")) {
        assert!(text.contains(&format!("]({file})")), "{file} is shown");
        assert!(std::fs::read_to_string(folder.join(file)).unwrap().trim_end().ends_with("</svg>"), "{file} is whole");
    }
    assert!(text.contains("stand-in, not the authors' arm"));
    let claims = report["claims"].as_array().unwrap();
    let confirmed = claims.iter().filter(|claim| claim["confirmed"] == true).count();
    assert!(text.contains(&format!("{confirmed} of {} confirmed", claims.len())));
    let rows = text.lines().filter(|line| line.starts_with("| ") && line.contains("confirmed"));
    assert!(rows.clone().count() == claims.len() && rows.into_iter().all(|row| row.matches('|').count() == 5));
    for claim in claims {
        assert!(text.contains(claim["evidence"].as_str().unwrap()), "{claim}");
    }
    assert_eq!(
        desk.files(""),
        ["arm7.urdf", "box.urdf", "figures", "planar2.urdf", "planar3.urdf"],
        "no partial files"
    );
}

#[test]
fn folder_of_the_paper_is_replaced_only_if_it_holds_an_earlier_report() {
    let desk = Desk::new();
    let folder = desk.join("out");
    std::fs::create_dir(&folder).unwrap();
    done(&desk.run("paper --out out")); // empty
    std::fs::write(folder.join("report.md"), "old").unwrap();
    done(&desk.run("paper --out out/")); // an earlier report
    assert!(std::fs::read_to_string(folder.join("report.md")).unwrap().len() > 1000);
    std::fs::write(folder.join("thesis.tex"), "mine").unwrap();
    let before = std::fs::read(folder.join("fig4.svg")).unwrap();
    desk.refused("paper --out out",
        "out: it contains 'thesis.tex', which is not a file of this report: give a new or empty folder, or the folder of an \
         earlier report, which is replaced",
    );
    assert_eq!(std::fs::read_to_string(folder.join("thesis.tex")).unwrap(), "mine");
    assert_eq!(std::fs::read(folder.join("fig4.svg")).unwrap(), before);
    for (out, words) in [
        ("planar2.urdf", "--out planar2.urdf: it is a file: give a folder"),
        ("no/such/folder", "--out no/such/folder: there is no folder no/such: make it first"),
    ] {
        desk.refused(&format!("paper --out {out}"), words);
    }
    let empty = desk.join("empty");
    std::fs::create_dir(&empty).unwrap();
    let ran = finish(desk.command("paper --out .").current_dir(&empty).spawn().unwrap(), b"");
    refused(ran, ".: cannot be written: it is the working directory, which cannot be replaced: give a folder in it");
    usage(desk.run("paper"), "--out <DIR>");
}

#[test]
fn table_1_is_reported_as_json_text_and_picture() {
    let desk = Desk::new();
    desk.write("table1.csv", TABLE1);
    let report = &desk.one("consistency table1.csv --json --svg v.svg");
    assert_eq!(keys(report), ["rows"]);
    let [up, down] = report["rows"].as_array().unwrap().as_slice() else { panic!("{report}") };
    for row in [up, down] {
        let expected = ["branches", "changes", "consistent", "directions", "fit", "points", "row", "verdict"];
        assert_eq!(keys(row), expected);
        assert_eq!(row["directions"]["agree"], false);
    }
    assert_eq!((&up["consistent"], &down["consistent"]), (&Value::Bool(true), &Value::Bool(false)));
    close("factor", number(&up["fit"]["factor"]), 0.99799, 1e-5);
    close("factor", number(&down["fit"]["factor"]), 13.62666, 1e-4);
    let h = &up["branches"][0]["h"];
    assert!(number(&h["least"]) < number(&up["fit"]["h"]) && number(&up["fit"]["h"]) < number(&h["most"]));
    assert_eq!(up["points"][1]["implied"]["changes"], serde_json::json!(["reverses"]));
    let svg = desk.read("v.svg");
    assert!(svg.contains("up-elbow: fit within rounding") && svg.contains("down-elbow: best fit"));

    let ran = desk.run("consistency table1.csv");
    done(&ran);
    assert!(
        ran.out.contains("up-elbow: consistent\n") && ran.out.contains("down-elbow: NOT consistent\n"),
        "{}",
        ran.out
    );
    // with a rounding twenty times as coarse every row is consistent
    let coarse = &desk.one("consistency table1.csv --json --rounding 0.1");
    assert_eq!(coarse["rows"].as_array().unwrap().len(), 2);
    assert!(coarse["rows"].as_array().unwrap().iter().all(|row| row["consistent"] == true));
}

/// An unbounded end of a range is left out of the JSON instead of being null.
#[test]
fn unbounded_ends_of_ranges_are_left_out_of_the_json() {
    let desk = Desk::new();
    desk.write("t.csv", "row,angle_deg,newton,energy_root\na,45,0.4,0.7\n");
    let ran = desk.run("consistency t.csv --json");
    done(&ran);
    civil(&ran, "one angle");
    let report: Value = serde_json::from_str(&ran.out).unwrap();
    let branches = report["rows"][0]["branches"].as_array().unwrap();
    assert!(branches.iter().any(|branch| branch["h"].get("most").is_none()), "{report}");
    done(&desk.run("consistency t.csv"));
}

#[test]
fn invalid_tables_are_refused_and_no_picture_is_written() {
    let desk = Desk::new();
    desk.write("t.csv", "row,angle_deg,newton,energy_root\nup,45,1.4,0.7\n");
    let refusal = "t.csv: line 2, row 'up', column 'newton': '1.4': a coefficient of restitution lies between 0 and 1";
    desk.refused("consistency t.csv --svg x.svg", refusal);
    desk.write("t.csv", "row,angle_deg,newton,energy_root\nup,1e-9,0.4,0.7\n");
    desk.refused(
        "consistency t.csv --svg x.svg",
        "t.csv: row 'up': cot α = 5.7e10 is too large for a plot: leave out angles within 0.01° of 0° and 180°",
    );
    assert!(!desk.join("x.svg").exists());
    desk.refused(
        "consistency t.csv --rounding -1",
        "t.csv: the rounding is -1: it must lie between 1e-12 (the resolution of the arithmetic) and 1",
    );
    desk.write("t.csv", b"row,angle_deg\xff");
    refused_with(&desk.run("consistency t.csv"), "error: t.csv: cannot be read: ");
    desk.write("t.csv", "row,angle_deg,newton,energy_root\nup,45,0.4,0.7\n");
    let ran = desk.run("consistency t.csv --out no/such/x.svg");
    refused(ran, "--out no/such/x.svg: there is no folder no/such: make it first");
}
