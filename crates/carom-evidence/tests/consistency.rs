//! Consistency of energies: tables computed from a known H, tables with a wrong entry, and Table I, each compared with a second
//! method.

use super::measured::{Entry, Rounded, Seen, cot};
use super::{
    Change, Column, Findings, MeasuredRow, Point, Pose, Range, consistency, measured_from, read_measured, v_plot,
};
use crate::paper::{Elbow, Tangential};
use carom_impact::{Frictionless, ImpactProblem, Law};
use carom_testing::files::path;
use nalgebra::{Matrix2, Vector2};
use std::path::Path;

const ANGLES: [f64; 6] = [25.0, 40.0, 60.0, 75.0, 90.0, 120.0];

/// Deterministic pseudo-random numbers between 0 and 1 (Knuth's linear congruential generator).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.roll()
    }
}

/// (E, v_t⁺/V) of a frictionless impact with H = [[D + h², −h], [−h, 1]]: tangent first, normal away from the surface, so that
/// the paper's tᵀHn, with n into the surface, is h.
fn impact(h: f64, d: f64, angle: f64, e: f64) -> (f64, f64) {
    let delassus = Matrix2::new(d + h * h, -h, -h, 1.0);
    let (sin, cos) = angle.to_radians().sin_cos();
    let problem = ImpactProblem::new(delassus, Vector2::new(cos, -sin)).unwrap();
    let hit = Frictionless { restitution: e }.resolve(&problem).unwrap();
    (hit.energy_ratio().sqrt(), hit.u_plus.x)
}

fn rounded(value: f64, decimals: i32) -> Rounded {
    let unit = 10_f64.powi(-decimals);
    Rounded { value: (value / unit).round() * unit, half_unit: 0.5 * unit }
}

/// A row of the pose (h, D) with all numbers rounded, and the values of e before rounding.
fn row_of(h: f64, d: f64, decimals: i32, dice: &mut Dice) -> (MeasuredRow, Vec<f64>) {
    let es: Vec<f64> = ANGLES.iter().map(|_| dice.between(0.1, 0.8)).collect();
    let entries = ANGLES.iter().zip(&es).map(|(&angle_deg, &e)| {
        let energy_root = rounded(impact(h, d, angle_deg, e).0, decimals);
        Entry { angle_deg, cot: cot(angle_deg), newton: rounded(e, decimals), energy_root, seen: None }
    });
    (MeasuredRow { name: "made".into(), entries: entries.collect() }, es)
}

fn table1() -> Vec<MeasuredRow> {
    read_measured(&path("docs/table1.csv"), None).unwrap()
}

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "{got} against {want}");
}

/// Range of Y of an entry with its half units multiplied by `factor`: eq. (16) solved for Y at two corners of the rectangle of
/// (e, E).
fn y(entry: &Entry, factor: f64) -> (f64, f64) {
    let square = |e: f64, root: f64| (1.0 - e * e) / (1.0 - root * root) - 1.0;
    let (e, root) = (entry.newton, entry.energy_root);
    let ends = |x: Rounded| ((x.value - factor * x.half_unit).max(0.0), (x.value + factor * x.half_unit).min(1.0));
    let ((e0, e1), (r0, r1)) = (ends(e), ends(root));
    (square(e1, r0).max(0.0).sqrt(), square(e0, r1).max(0.0).sqrt())
}

/// Whether some (h, D) fits, by a second method: for each assignment of sides, b = a c − s Y is eliminated (Fourier–Motzkin),
/// which gives an interval of a for each pair of angles.
fn some_v(entries: &[&Entry], factor: f64) -> bool {
    let cot = |e: &Entry| 1.0 / e.angle_deg.to_radians().tan();
    (0..1 << entries.len()).any(|sides: usize| {
        let (mut low, mut high) = (0.0_f64, f64::INFINITY);
        for (i, p) in entries.iter().enumerate() {
            for (j, q) in entries.iter().enumerate() {
                let signed = |k: usize, (least, most): (f64, f64)| {
                    if sides >> k & 1 == 1 { (least, most) } else { (-most, -least) }
                };
                let (most, least) = (signed(i, y(p, factor)).1, signed(j, y(q, factor)).0);
                // a cot_i − most ≤ b ≤ a cot_j − least
                let (steep, room) = (cot(p) - cot(q), most - least);
                if steep.abs() < 1e-9 {
                    if room < 0.0 {
                        high = -1.0;
                    }
                } else if steep > 0.0 {
                    high = high.min(room / steep);
                } else {
                    low = low.max(room / steep);
                }
            }
        }
        low < high && high > 0.0
    })
}

/// Whether some D fits a given h: each angle gives an interval of a = 1/√D, Y₁ ≤ a |cot α − h| ≤ Y₂.
fn some_d(row: &MeasuredRow, h: f64) -> bool {
    let (mut low, mut high) = (0.0_f64, f64::INFINITY);
    for entry in &row.entries {
        let ((least, most), arm) = (y(entry, 1.0), (1.0 / entry.angle_deg.to_radians().tan() - h).abs());
        (low, high) = (low.max(least / arm), high.min(most / arm));
    }
    low <= high && high > 0.0
}

fn in_some(branches: &Findings, h: f64, d: f64) -> bool {
    branches.branches.iter().any(|b| b.h.holds(h) && b.d.holds(d))
}

#[test]
fn rows_of_a_known_pose_are_consistent_and_recover_it_within_rounding() {
    let mut dice = Dice(7);
    for case in 0..40 {
        let (h, d) = (dice.between(-2.0, 2.0), dice.between(0.1, 4.0));
        let mut widths = Vec::new();
        for decimals in [2, 4, 8] {
            let (row, _) = row_of(h, d, decimals, &mut dice);
            let found = consistency(&row);
            assert!(in_some(&found, h, d), "case {case}: h {h}, D {d}, {found:?}");
            assert!(found.changes.is_empty() && found.fit.factor <= 1.0);
            let Pose { h: fit_h, d: fit_d } = found.fit.at.unwrap();
            assert!(in_some(&found, fit_h, fit_d), "the best fit is admissible");
            let spread = found.branches.iter().map(|b| b.h.most - b.h.least).fold(0.0, f64::max);
            widths.push(spread);
            if decimals == 8 {
                // errors of 5e-9 in e and E, magnified where E is near 1
                close(fit_h, h, 1e-4);
                close(fit_d, d, 1e-3 * d.max(1.0));
            }
        }
        assert!(widths[1] < widths[0] && widths[2] < 1e-3, "{widths:?}");
    }
}

#[test]
fn implied_tangential_velocities_contain_the_true_one() {
    let mut dice = Dice(11);
    for _ in 0..40 {
        let (h, d) = (dice.between(-2.0, 2.0), dice.between(0.1, 4.0));
        let (row, es) = row_of(h, d, 3, &mut dice);
        let found = consistency(&row);
        assert_eq!(found.points.len(), ANGLES.len());
        for ((entry, e), point) in row.entries.iter().zip(es).zip(&found.points) {
            let implied = point.implied.as_ref().unwrap();
            let (_, after) = impact(h, d, entry.angle_deg, e);
            let slack = 1e-12;
            let wide = Range { least: implied.velocity.least - slack, most: implied.velocity.most + slack };
            assert!(wide.holds(after), "{after} in {implied:?}");
            let before = entry.angle_deg.to_radians().cos();
            let before = if entry.angle_deg == 90.0 { 0.0 } else { before };
            assert!(implied.changes.contains(&Tangential::of(before, after)), "{implied:?}");
        }
    }
}

#[test]
fn a_wrong_entry_is_identified_with_its_true_value() {
    let mut dice = Dice(13);
    let mut spoilt = 0;
    for case in 0..40 {
        let (h, d) = (dice.between(-2.0, 2.0), dice.between(0.2, 2.0));
        let (mut row, es) = row_of(h, d, 4, &mut dice);
        let k = case % ANGLES.len();
        let truth = impact(h, d, ANGLES[k], es[k]).0;
        let wrong = if truth > 0.6 { truth - 0.2 } else { truth + 0.2 };
        if wrong < es[k] + 0.01 {
            continue; // E < e is another kind of error
        }
        spoilt += 1;
        row.entries[k].energy_root = rounded(wrong, 4);
        let found = consistency(&row);
        assert!(!found.consistent && found.fit.factor > 1.0, "{found:?}");
        // with five correct angles no other angle can be the wrong one
        assert!(found.changes.iter().all(|change| change.entry == k), "{:?}", found.changes);
        let root = |change: &&Change| change.column == Column::EnergyRoot;
        let change = found.changes.iter().find(root).expect("the entry is named");
        assert!(change.to.iter().any(|range| range.holds(truth)), "{truth} in {change:?}");
        assert!(!change.to.iter().any(|range| range.holds(wrong)));
        // values inside a range make the row consistent, values slightly beyond it do not
        for change in &found.changes {
            for range in &change.to {
                let with = |value: f64| {
                    let mut row = row.clone();
                    let there = &mut row.entries[k];
                    let number =
                        if change.column == Column::Newton { &mut there.newton } else { &mut there.energy_root };
                    *number = Rounded { value, half_unit: 1e-9 };
                    consistency(&row).consistent
                };
                let middle = (range.least + range.most) / 2.0;
                assert!(with(middle), "{change:?}");
                // except where the range ends at the limits of the number, 0 and 1
                assert!(range.most > 0.999 || !with(range.most + 1e-4), "{change:?}");
                assert!(range.least < 1e-3 || !with(range.least - 1e-4), "{change:?}");
            }
        }
    }
    assert_eq!(spoilt, 36, "of 40 rows");
}

#[test]
fn polygons_agree_with_a_scan_over_h_and_with_fourier_motzkin_elimination() {
    let mut dice = Dice(17);
    let mut counts = [0, 0];
    for _ in 0..60 {
        let (h, d) = (dice.between(-2.0, 2.0), dice.between(0.2, 2.0));
        let (mut row, _) = row_of(h, d, 2, &mut dice);
        // one entry is changed slightly: about half of the rows remain consistent
        let k = (dice.roll() * 6.0) as usize;
        let old = row.entries[k].energy_root.value;
        let moved = (old + dice.between(-0.06, 0.06)).clamp(row.entries[k].newton.value + 0.02, 0.98);
        row.entries[k].energy_root = rounded(moved, 2);
        let found = consistency(&row);
        counts[usize::from(found.consistent)] += 1;
        let entries: Vec<&Entry> = row.entries.iter().collect();
        for factor in [0.5, 0.9, 1.1, 2.0, 8.0].map(|x| x * found.fit.factor) {
            assert_eq!(some_v(&entries, factor), factor > found.fit.factor, "{factor} {:?}", found.fit);
        }
        assert_eq!(some_v(&entries, 1.0), found.consistent);
        // h = tan θ over all directions
        let step = std::f64::consts::PI / 20000.0;
        for k in 1..20000 {
            let h = (-std::f64::consts::FRAC_PI_2 + step * f64::from(k)).tan();
            let near = |end: f64| (h - end).abs() < 1e-9 * end.abs().max(1.0);
            let edge = found.branches.iter().any(|b| near(b.h.least) || near(b.h.most));
            let inside = found.branches.iter().any(|b| b.h.holds(h));
            assert!(edge || inside == some_d(&row, h), "h {h} in {:?}", found.branches);
        }
    }
    assert!(counts[0] > 10 && counts[1] > 10, "{counts:?}");
}

/// Reference values from five linear programs for each row (one for each assignment of sides, solver HiGHS) and bisection of the
/// rounding factor. The factors are also checked by elimination.
#[test]
fn table_1_is_barely_consistent_for_the_up_elbow_and_inconsistent_for_the_down_elbow() {
    let table = table1();
    let [up, down] = table.as_slice() else { panic!("{table:?}") };
    let (found_up, found_down) = (consistency(up), consistency(down));
    for (row, found, factor, h, d) in
        [(up, &found_up, 0.997_990_3, 2.664_23, 8.425_64), (down, &found_down, 13.626_659_5, 17.054_04, 116.703_4)]
    {
        // feasibility tolerance of the solver: 1e-7
        close(found.fit.factor, factor, 1e-5 * factor);
        let Pose { h: fit_h, d: fit_d } = found.fit.at.unwrap();
        close(fit_h, h, 1e-4 * h);
        close(fit_d, d, 1e-4 * d);
        let entries: Vec<&Entry> = row.entries.iter().collect();
        let exact = found.fit.factor;
        assert!(some_v(&entries, exact * (1.0 + 1e-8)) && !some_v(&entries, exact * (1.0 - 1e-8)));
    }
    // up-elbow: h > cot 30°, so the tangential velocity would reverse at all angles
    assert!(found_up.consistent);
    assert_eq!(found_up.branches.iter().map(|b| b.below).collect::<Vec<_>>(), [4]);
    let reverses = |point: &Point| point.implied.as_ref().unwrap().changes == [Tangential::Reverses];
    assert!(found_up.points[..3].iter().all(reverses), "{:?}", found_up.points);
    // the observed directions require h < 0 instead
    let seen = found_up.directions.unwrap();
    assert!(!seen.agree && seen.factor.unwrap() > 10.0);
    assert_eq!(seen.h.unwrap().most, 0.0);
    // down-elbow: inconsistent without any single angle, so no change of a single entry makes it consistent
    assert!(!found_down.consistent && found_down.changes.is_empty());
    for k in 0..4 {
        let others: Vec<&Entry> = down.entries.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, e)| e).collect();
        assert!(!some_v(&others, 1.0), "without {k}");
    }
    // reversal from 45° on: h > cot 45° / (1 + .355)
    close(found_down.directions.unwrap().h.unwrap().least, 1.0 / 1.355, 1e-12);
}

#[test]
fn table_1_has_the_coefficients_of_the_experiment() {
    assert_eq!(table1().len(), 2);
    for (row, elbow) in table1().iter().zip([Elbow::Up, Elbow::Down]) {
        assert!(row.name.starts_with(elbow.name()));
        let newton: Vec<f64> = row.entries.iter().map(|e| e.newton.value).collect();
        let root: Vec<f64> = row.entries.iter().map(|e| e.energy_root.value).collect();
        assert_eq!((newton.as_slice(), root.as_slice()), (&elbow.newton()[..], &elbow.measured_energy_root()[..]));
        assert!(row.entries.iter().all(|e| (e.newton.half_unit - 0.005).abs() < 1e-15));
    }
}

#[test]
fn directions_of_the_pose_agree_with_its_energies_and_others_do_not() {
    let mut dice = Dice(19);
    for _ in 0..30 {
        let (h, d) = (dice.between(-2.0, 2.0), dice.between(0.1, 2.0));
        let (mut row, es) = row_of(h, d, 4, &mut dice);
        let before = |angle: f64| angle.to_radians().cos();
        for (k, entry) in row.entries.iter_mut().enumerate().filter(|(_, e)| e.angle_deg != 90.0) {
            let after = impact(h, d, entry.angle_deg, es[k]).1;
            entry.seen = match Tangential::of(before(entry.angle_deg), after) {
                Tangential::Grows => Some(Seen::Grows),
                Tangential::Shrinks => Some(Seen::Shrinks),
                _ => Some(Seen::Reverses),
            };
        }
        let seen = consistency(&row).directions.unwrap();
        assert!(seen.agree && seen.h.unwrap().holds(h), "{seen:?} h {h}");
        // growth at 25° needs h < 0, at 120° h > 0
        row.entries[0].seen = Some(Seen::Grows);
        row.entries[5].seen = Some(Seen::Grows);
        let contradictory = consistency(&row).directions.unwrap();
        assert!(!contradictory.agree, "{contradictory:?}");
    }
}

fn three(lines: &str) -> Vec<MeasuredRow> {
    measured_from(&format!("row,angle_deg,newton,energy_root\n{lines}"), Path::new("t.csv"), None).unwrap()
}

#[test]
fn an_energy_root_below_newtons_coefficient_is_inconsistent() {
    let rows = three("a,30,0.40,0.60\na,45,0.40,0.38\na,60,0.40,0.60\n");
    let found = consistency(&rows[0]);
    assert_eq!(found.points[1].range, None);
    assert!(!found.consistent && found.changes.iter().all(|change| change.entry == 1));
    assert!(found.verdict[0].contains("at 45° energy_root 0.38 is below newton 0.4"), "{found:?}");
    // E = e within rounding
    let rows = three("a,30,0.40,0.60\na,45,0.40,0.39\na,60,0.40,0.60\n");
    assert_eq!(consistency(&rows[0]).points[1].range.unwrap().least, 0.0);
}

#[test]
fn one_or_two_angles_are_always_consistent() {
    for lines in ["a,45,0.4,0.7\n", "a,45,0.4,0.7\na,90,0.4,0.9\n", "a,45,1,1\n", "a,45,0.4,1.000\n", "a,90,0,0\n"] {
        let row = &three(lines)[0];
        let found = consistency(row);
        assert!(found.consistent, "{lines} {found:?}");
        assert!(found.verdict.iter().any(|said| said.contains("needs at least three different angles")));
    }
    let one = consistency(&three("a,45,0.40,0.70\n")[0]);
    assert!(
        one.branches.iter().any(|b| b.h.most == f64::INFINITY)
            && one.branches.iter().any(|b| b.h.least == f64::NEG_INFINITY)
    );
}

#[test]
fn rounding_errors_are_half_a_unit_of_the_last_printed_digit() {
    let rows = three("a,45,0.3,.75\nb,45,5e-1,0.8750\na,60,0,1\n");
    let halves: Vec<[f64; 2]> =
        rows.iter().flat_map(|row| &row.entries).map(|e| [e.newton.half_unit, e.energy_root.half_unit]).collect();
    assert_eq!(halves.len(), 3);
    for (got, want) in halves.iter().zip([[0.05, 0.005], [0.5, 0.5], [0.05, 0.000_05]]) {
        close(got[0], want[0], 1e-15);
        close(got[1], want[1], 1e-15);
    }
    let given =
        measured_from("row,angle_deg,newton,energy_root\na,45,0.3,.75\n", Path::new("t.csv"), Some(0.02)).unwrap();
    assert_eq!(given[0].entries[0].newton, Rounded { value: 0.3, half_unit: 0.02 });
}

#[test]
fn invalid_tables_are_refused_with_file_row_column_value_and_rule() {
    let header = "row,angle_deg,newton,energy_root,tangential";
    let line = |line: &str| format!("{header}\nup,30,0.4,0.5,grows\n# a remark\n{line}\n");
    let value = |row: &str, column: &str, value: &str, rule: &str| {
        format!("t.csv: line 4, row '{row}', column '{column}': '{value}': {rule}")
    };
    let share = "lies between 0 and 1";
    let angle = "the impact angle must be above 0 and below 180 degrees; 90 is a normal impact";
    for (text, message) in [
        (line("up,45,1.2,0.5,"), value("up", "newton", "1.2", &format!("a coefficient of restitution {share}"))),
        (line("up,45,-0.1,0.5,"), value("up", "newton", "-0.1", &format!("a coefficient of restitution {share}"))),
        (
            line("up,45,0.2,1.01,"),
            value(
                "up",
                "energy_root",
                "1.01",
                "the square root of T+/T- must lie between 0 and 1: a frictionless impact gains no energy",
            ),
        ),
        (line("up,45,NaN,0.5,"), value("up", "newton", "NaN", "it must be finite")),
        (line("up,45,0.4,inf,"), value("up", "energy_root", "inf", "it must be finite")),
        (line("up,45,0.4,,"), value("up", "energy_root", "", "it is not a number")),
        (line("up,45°,0.4,0.5,"), value("up", "angle_deg", "45°", "it is not a number")),
        (line("up,0,0.4,0.5,"), value("up", "angle_deg", "0", angle)),
        (line("up,180,0.4,0.5,"), value("up", "angle_deg", "180", angle)),
        (line(",45,0.4,0.5,"), value("", "row", "", "it is empty: give the name of the pose")),
        (
            line("up,90,0.4,0.5,grows"),
            value(
                "up",
                "tangential",
                "grows",
                "a normal impact has no tangential velocity before it: leave the cell empty",
            ),
        ),
        (
            line("up,45,0.4,0.5,rises"),
            value(
                "up",
                "tangential",
                "rises",
                "leave it empty, or give one of 'grows', 'shrinks', 'reverses', 'shrinks or reverses', 'grows or shrinks'",
            ),
        ),
        (
            line("up,45,0,4,0,5,"),
            "t.csv: line 4 has 7 values for 5 columns: use a decimal point, and quote values that contain a comma"
                .into(),
        ),
        (format!("{header}\n"), "t.csv: it has no measurements: write one line for each below the header".into()),
        (
            "row,angle_deg,newton\n".into(),
            "t.csv: column 'energy_root' is missing: the columns are row, angle_deg, newton, energy_root, tangential \
             (the last is optional)"
                .into(),
        ),
        (
            "row,angle,newton,energy_root\n".into(),
            "t.csv: unknown column 'angle': the columns are row, angle_deg, newton, energy_root, tangential".into(),
        ),
        ("row,row,angle_deg\n".into(), "t.csv: column 'row' occurs twice: keep one".into()),
    ] {
        let refused = measured_from(&text, Path::new("t.csv"), None).unwrap_err();
        assert_eq!(refused.to_string(), message, "{text}");
    }
    let missing = read_measured(Path::new("no/such.csv"), None).unwrap_err().to_string();
    assert!(missing.starts_with("no/such.csv: cannot be read: "), "{missing}");
    for rounding in [0.0, -1.0, f64::NAN, 2.0] {
        let refused = measured_from(&line(""), Path::new("t.csv"), Some(rounding)).unwrap_err().to_string();
        assert!(
            refused.starts_with("t.csv: the rounding is ")
                && refused.ends_with("(the resolution of the arithmetic) and 1")
        );
    }
}

/// Angles whose squared cotangents overflow, and rows with equal angles.
#[test]
fn extreme_rows_have_finite_results() {
    let mut plots = [0; 2];
    for lines in [
        "a,1e-300,0.40,0.50\na,45,0.40,0.50\na,90,0.40,0.70\n",
        "a,179.99999999999,0.40,0.50\na,45,0.40,0.50\na,0.00001,0.40,0.70\n",
        "a,45,0.40,0.50\na,45,0.41,0.52\na,45,0.43,0.90\n",
        "a,45,0,0\na,60,0,0\na,90,0,0\n",
        "a,45,1,1\na,60,1,1\na,90,1,1\n",
        "a,45,0.000,1.000\na,60,1.000,0.000\na,90,0.5,0.5\n",
    ] {
        let rows = three(lines);
        let found = consistency(&rows[0]);
        assert!(found.fit.factor.is_finite() && !found.verdict.is_empty());
        for range in
            found.branches.iter().flat_map(|b| [b.h, b.d]).chain(found.changes.iter().flat_map(|c| c.to.clone()))
        {
            assert!(range.least <= range.most, "{lines} {found:?}");
        }
        let far = rows[0].entries.iter().any(|entry| entry.cot.abs() > 1e4);
        match v_plot(&[found]) {
            Ok(svg) => assert!(!far && svg.starts_with("<svg") && !svg.contains("NaN"), "{svg}"),
            Err(refused) => assert!(far && refused.to_string().starts_with("row 'a': cot α = "), "{refused}"),
        }
        plots[usize::from(far)] += 1;
    }
    assert_eq!(plots, [4, 2]);
}
