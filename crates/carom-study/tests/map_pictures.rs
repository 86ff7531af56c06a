//! Pictures and optimal rows of impact maps, compared with the rows.

use base64::Engine;
use carom_study::map_study::{CLASSES, Study, StudyError, Values};
use carom_study::{NumberedRows, self_motion};
use carom_testing::files::{path, robot};
use nalgebra::Vector3;

fn study(text: &str) -> Study {
    Study::from_toml(&text.replace("ROBOTS", "../robots"), path("studies")).unwrap()
}

/// The place of a column in rows.
fn column(study: &Study, name: &str) -> usize {
    study.columns().iter().position(|column| column.name == name).unwrap()
}

const TIPS: &str = r#"
[robot]
urdf = "ROBOTS/planar2.urdf"
[tip]
x = { from = -0.3, to = 0.95, count = 26 }
y = { from = -0.8, to = 0.5, count = 14 }
[impact]
normal = [-1, 0, 0]
along = [0, -1, 0]
approach_deg = 45
speed = 0.2
law = "energetic"
restitution = 0.35
friction = 0.05
[map]
quantities = ["impulse", "mode"]
"#;

/// The pixels of the images in an SVG: width, height, RGBA from the top left.
fn images(svg: &str) -> Vec<(u32, u32, Vec<u8>)> {
    let data = svg.split("base64,").skip(1).map(|part| part.split('"').next().unwrap());
    data.map(|data| {
        let bytes = base64::engine::general_purpose::STANDARD.decode(data).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width, info.height, pixels)
    })
    .collect()
}

/// Compares every pixel with its row: x increases to the right, y upwards, one heat map for each elbow.
#[test]
fn pixels_of_a_heat_map_are_the_colours_of_their_rows() {
    let study = study(TIPS);
    let svg = study.picture("class", false).unwrap();
    let values = study.values("class").unwrap();
    let images = images(&svg);
    assert_eq!(images.len(), 2);
    let mut evaluator = study.evaluator();
    let mut row = vec![0.0; study.columns().len()];
    let column = |name: &str| column(&study, name);
    let mut colours = std::collections::BTreeMap::new();
    for index in 0..study.rows() {
        evaluator.row(index, &mut row);
        let across = ((row[column("tip.x")] + 0.3) / 0.05).round() as usize;
        let up = ((row[column("tip.y")] + 0.8) / 0.1).round() as usize;
        let (width, height, pixels) = &images[row[column("elbow")] as usize];
        assert_eq!((*width, *height), (26, 14));
        let at = 4 * ((13 - up) * 26 + across);
        let class = row[column("class")];
        assert_eq!(pixels[at..at + 3], values.colour(class, (0.0, 1.0)), "row {index}");
        colours.insert(class as usize, pixels[at..at + 3].to_vec());
    }
    // each class has a distinct colour, and an entry in the legend
    let distinct: std::collections::BTreeSet<_> = colours.values().collect();
    assert!(colours.len() >= 4 && distinct.len() == colours.len(), "{colours:?}");
    assert!(colours.keys().all(|class| svg.contains(CLASSES[*class])));
}

/// A map of signed numbers up to a singular pose: the colour bar contains the colours of all pixels, and marks values beyond
/// its ends.
#[test]
fn a_colour_bar_contains_every_colour_of_its_map() {
    let text = TIPS.replace("\"impulse\", \"mode\"", "\"tangential_jump\"");
    let study = study(&text);
    let (svg, values) = (study.picture("tangential_jump", false).unwrap(), study.values("tangential_jump").unwrap());
    let range = values.colour_range();
    let beyond = values.values.iter().filter(|x| **x < range.0 || **x > range.1).count();
    assert!(range.0 < 0.0 && range.1 > 0.0 && beyond > 2, "{range:?} {beyond}");
    assert!(svg.contains("≥ ") && svg.contains("≤ "));
    for (end, more) in [(range.0, -1e9), (range.1, 1e9)] {
        assert_eq!(values.colour(end, range), values.colour(more, range));
    }
    // fine enough for every colour, as each of the three channels has at most 256 values
    let step = |k: i32| values.colour(range.0 + (range.1 - range.0) * f64::from(k) / 1e6, range);
    let bar: std::collections::BTreeSet<[u8; 3]> = (0..=1_000_000).map(step).collect();
    assert!(!bar.contains(&values.colour(f64::NAN, range)));
    let mut coloured = 0;
    for (_, _, pixels) in images(&svg) {
        for pixel in pixels.chunks(4).filter(|pixel| pixel[3] != 0) {
            assert!(bar.contains(&pixel[..3]), "{pixel:?}");
            coloured += 1;
        }
    }
    let finite = values.values.iter().filter(|x| x.is_finite()).count();
    assert!(coloured == finite && finite > 400, "{coloured} coloured pixels for {finite} values");
}

#[test]
fn a_map_over_one_axis_is_drawn_as_one_curve_for_each_word() {
    let text = TIPS.replace("x = { from = -0.3, to = 0.95, count = 26 }", "x = 0.5");
    let svg = study(&text).picture("impulse", false).unwrap();
    assert!(svg.starts_with("<svg") && !svg.contains("<image") && svg.contains("up") && svg.contains("tip.y, m"));
    assert!(svg.contains("\nelbow\n"), "the legend has a title");
    assert!(svg.matches("<polyline").count() >= 2);
}

#[test]
fn maps_that_cannot_be_drawn_are_refused() {
    let said = |text: &str, column: &str| match study(text).picture(column, false) {
        Err(StudyError::File { rule, .. }) => rule,
        other => panic!("{other:?}"),
    };
    assert!(said(TIPS, "impulses").contains("did you mean \"impulse\"?"));
    let four = TIPS.replace("speed = 0.2", "speed = [0.1, 0.2]").replace("= 45", "= [30, 45]");
    assert!(said(&four, "impulse").contains("5 axes vary"), "{}", said(&four, "impulse"));
    let uneven = TIPS.replace("x = { from = -0.3, to = 0.95, count = 26 }", "x = [0.1, 0.2, 0.5]");
    assert!(said(&uneven, "impulse").contains("tip.x are not evenly spaced"));
    let none = TIPS.replace("[tip]", "[joints]\nshoulder = 0.1\nelbow = 0.5\n[tip_]");
    let none = none.split("[tip_]").next().unwrap().to_owned() + &none[none.find("[impact]").unwrap()..];
    assert!(said(&none, "impulse").contains("no axis varies"));
}

/// Compares with a search over all rows: the first optimum is the best row, and all of them fulfil the constraints.
#[test]
fn the_first_optimum_is_the_best_row_of_the_map() {
    let wish = "[advise]\nminimise = \"impulse\"\nclass = [\"reverses\"]\nat_least = { \"tip.x\" = 0.2 }\nbest = 4\n";
    let study = study(&format!("{TIPS}{wish}"));
    let advice = study.advise().unwrap();
    let column = |name: &str| column(&study, name);
    let mut evaluator = study.evaluator();
    let mut row = vec![0.0; study.columns().len()];
    let (mut best, mut fulfil) = (f64::INFINITY, 0);
    for index in 0..study.rows() {
        evaluator.row(index, &mut row);
        if CLASSES[row[column("class")] as usize] == "reverses" && row[column("tip.x")] >= 0.2 {
            best = best.min(row[column("impulse")]);
            fulfil += 1;
        }
    }
    assert!(fulfil > 10);
    assert_eq!((advice.fulfil, advice.best[0].row[column("impulse")]), (fulfil, best));
    assert!((2..=4).contains(&advice.best.len()), "{}", advice.best.len());
    assert!(advice.best.windows(2).all(|w| w[0].row[column("impulse")] <= w[1].row[column("impulse")]));
    for it in &advice.best {
        assert_eq!(CLASSES[it.row[column("class")] as usize], "reverses");
        assert!(it.row[column("tip.x")] >= 0.2 && it.self_motion.is_none());
        // the configuration is that of the row
        assert_eq!(it.q, [it.row[column("q.shoulder")], it.row[column("q.elbow")]]);
    }
}

/// The impulse is proportional to the speed: of speeds 1 to 4 the mean of the two in the middle is 2.5.
#[test]
fn the_median_of_an_even_number_of_rows_is_the_mean_of_the_two_in_the_middle() {
    for (speeds, middle) in [("[0.1, 0.4, 0.3, 0.2]", 2.5), ("[0.1, 0.4, 0.2]", 2.0)] {
        for goal in ["minimise", "maximise"] {
            let text = format!(
                "[robot]\nurdf = \"ROBOTS/planar2.urdf\"\n[joints]\nshoulder = 0.7\nelbow = -1.2\n[impact]\nnormal = [-1, 0, 0]\n\
                 approach_deg = 90\nspeed = {speeds}\nlaw = \"frictionless\"\nrestitution = 0.35\n[map]\nquantities = [\"impulse\"]\n\
                 [advise]\n{goal} = \"impulse\"\n"
            );
            let study = study(&text);
            let spread = study.advise().unwrap().spread.unwrap();
            let least = spread[0].min(spread[2]);
            assert!((spread[1] / least - middle).abs() < 1e-12, "{goal} {speeds}: {spread:?}");
        }
    }
}

/// The descent along the self-motion of three links leaves the tip in place and ends at the minimum of the effective mass. The
/// reference solution is a dense search over the directions of the last link.
#[test]
fn the_descent_along_a_self_motion_ends_at_the_minimum_of_a_dense_search() {
    let text = r#"
[robot]
urdf = "ROBOTS/planar3.urdf"
limits = false
[tip]
x = 0.7
y = 0.2
[impact]
normal = [-1, 0, 0]
approach_deg = 90
speed = 0.2
law = "frictionless"
restitution = 0.35
[map]
quantities = ["effective_mass", "position"]
[advise]
minimise = "effective_mass"
"#;
    let study = study(text);
    let advice = study.advise().unwrap();
    let column = |name: &str| column(&study, name);
    let chain = robot("planar3");
    let tip = chain.frame("tip").unwrap();
    let mut workspace = chain.workspace();
    let at = |q: &[f64; 3]| -> Vec<Vector3<f64>> {
        let kin = &workspace.clone().update(&chain, q).unwrap().pose(tip);
        vec![kin.translation]
    };
    let reach = at(&[0.0; 3])[0].x;
    let lengths = [0.45, 0.45, reach - 0.9];
    let (normal, tangent) = (-Vector3::x(), -Vector3::y());
    let dense = self_motion(&chain, tip, lengths, [0.7, 0.2], normal, tangent, 20_000).unwrap();
    let least = dense.iter().filter_map(|p| p.effective_mass).fold(f64::INFINITY, f64::min);
    // a row for each of the two seeds, both of them improved
    assert_eq!(advice.best.len(), 2);
    let mut ended = f64::INFINITY;
    for it in &advice.best {
        let before = it.row[column("effective_mass")];
        let (q, row) = it.self_motion.as_ref().expect("the self-motion improves the row");
        let after = row[column("effective_mass")];
        assert!(after < before, "{after} kg after {before} kg");
        let mut kin = workspace.update(&chain, q).unwrap();
        let place = kin.pose(tip).translation;
        assert!((place - Vector3::new(0.7, 0.2, 0.0)).norm() < 1e-10, "the tip has moved to {place:?}");
        let mass = kin.contact_inertia(chain.point(tip, Vector3::zeros())).unwrap().effective_mass(&[-1.0, 0.0, 0.0]);
        assert!((after - mass.unwrap()).abs() < 1e-9 * after);
        // not below the minimum, up to the resolution of the dense search
        assert!(after > least * (1.0 - 1e-6));
        ended = ended.min(after);
    }
    // 20 000 directions are 3e-4 rad apart, and the error at a minimum is of second order
    assert!((ended - least).abs() < 1e-5 * least, "{ended} kg, the dense search finds {least} kg");
}

/// The title names the conditions that do not vary; ticks of a colour bar are multiples of 1, 2 or 5 times a power of ten, but for the ends
/// with a sign.
#[test]
fn pictures_name_their_conditions_and_have_round_ticks() {
    let text = TIPS.replace("\"impulse\", \"mode\"", "\"tangential_jump\"");
    let study_of = study(&text);
    let svg = study_of.picture("tangential_jump", false).unwrap();
    let title = study_of.values("tangential_jump").unwrap().title;
    for part in ["e = ", "0.2 m/s", "approach 45°"] {
        assert!(title.contains(part), "{title}");
    }
    assert!(svg.contains(&format!("\n{title}\n")), "{title}");
    let varied = study(
        &text
            .replace("speed = 0.2", "speed = [0.1, 0.2]")
            .replace("x = { from = -0.3, to = 0.95, count = 26 }", "x = 0.5"),
    );
    assert!(!varied.values("tangential_jump").unwrap().title.contains("m/s"), "the speed varies");
    let ticks: Vec<f64> = svg
        .split("<text x=\"")
        .filter_map(|part| part.split_once('>')?.1.split_once('<')?.0.trim().parse::<f64>().ok())
        .collect();
    let round = |x: f64| [1.0, 2.0, 5.0].iter().any(|step| ((x / step * 1e3).round() - x / step * 1e3).abs() < 1e-6);
    assert!(ticks.len() > 6 && ticks.iter().all(|x| round(*x)), "{ticks:?}");
}

/// Rows without a number are holes in the image, through which the hatch is seen, and the legend gives their share.
#[test]
fn rows_without_a_result_are_hatched_and_told_from_zero() {
    let study = study(TIPS);
    let (svg, values) = (study.picture("impulse", false).unwrap(), study.values("impulse").unwrap());
    let nothing = values.values.iter().filter(|x| x.is_nan()).count();
    let holes: usize =
        images(&svg).iter().map(|(.., pixels)| pixels.chunks(4).filter(|pixel| pixel[3] == 0).count()).sum();
    assert!(nothing > 50 && holes == nothing, "{holes} {nothing}");
    let share = 100.0 * nothing as f64 / values.values.len() as f64;
    assert!(svg.contains(&format!("\nno result {share:.1} %\n")));
    assert_eq!(svg.matches("url(#no-result)").count(), 3, "two panels and the legend");
    let whole = TIPS.replace("x = { from = -0.3, to = 0.95, count = 26 }", "x = { from = 0.4, to = 0.5, count = 3 }");
    let whole = whole.replace("y = { from = -0.8, to = 0.5, count = 14 }", "y = { from = 0.0, to = 0.1, count = 3 }");
    assert!(!self::study(&whole).picture("impulse", false).unwrap().contains("no result"));
}

/// On a logarithmic scale equal ratios are equal distances: of colours, and of the ticks of the colour bar.
#[test]
fn a_logarithmic_picture_has_equal_steps_for_equal_ratios_and_needs_numbers_above_zero() {
    let study = study(&TIPS.replace("\"impulse\", \"mode\"", "\"effective_mass\", \"tangential_jump\", \"mode\""));
    let mut values = study.values("effective_mass").unwrap();
    values.logarithmic = true;
    let range = (0.1, 1000.0);
    let even = Values { logarithmic: false, ..study.values("effective_mass").unwrap() };
    for k in 0..=8 {
        let share = f64::from(k) / 8.0;
        let own = values.colour(range.0 * 1e4f64.powf(share), range);
        let linear = even.colour(range.0 + (range.1 - range.0) * share, range);
        assert!(own.iter().zip(linear).all(|(a, b)| a.abs_diff(b) <= 1), "{k}: {own:?} {linear:?}");
    }
    let svg = study.picture("effective_mass", true).unwrap();
    assert_ne!(svg, study.picture("effective_mass", false).unwrap());
    let heights: Vec<(f64, f64)> = svg
        .split("<text x=\"")
        .filter_map(|part| {
            let (head, rest) = part.split_once('>')?;
            let number = rest.split_once('<')?.0.trim().parse::<f64>().ok()?;
            let (x, y) = head.split_once("\" y=\"")?;
            let right = x.parse::<f64>().ok()? > 850.0; // of the colour bar
            right.then_some((number, y.split_once('"')?.0.parse::<f64>().ok()?))
        })
        .collect();
    assert!(heights.len() >= 3, "{heights:?}");
    let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 / a.0).ln();
    let first = slope(heights[0], heights[heights.len() - 1]);
    for two in heights.windows(2) {
        let step = (two[1].1 - two[0].1).abs();
        assert!((slope(two[0], two[1]) - first).abs() * (two[1].0 / two[0].0).ln().abs() < 2.5, "{step} {heights:?}");
    }
    let curve = self::study(&TIPS.replace("x = { from = -0.3, to = 0.95, count = 26 }", "x = 0.5"));
    assert!(curve.picture("impulse", true).unwrap().contains("<polyline"));
    for (column, why) in [("tangential_jump", "above 0, and the least one is -"), ("mode", "words")] {
        let refused = study.picture(column, true).unwrap_err().to_string();
        assert!(refused.contains(why) && refused.contains(column), "{refused}");
    }
}

/// A circle in the work space is a circle in the picture.
#[test]
fn axes_of_lengths_have_one_scale() {
    for (x, y) in [((-0.3, 0.95), (-0.8, 0.5)), ((0.2, 0.8), (0.0, 0.1)), ((0.4, 0.5), (-0.4, 0.4))] {
        let range = |(from, to): (f64, f64)| format!("{{ from = {from}, to = {to}, count = 5 }}");
        let text = TIPS.replace("{ from = -0.3, to = 0.95, count = 26 }", &range(x));
        let svg =
            study(&text.replace("{ from = -0.8, to = 0.5, count = 14 }", &range(y))).picture("impulse", false).unwrap();
        let image = svg.split("<image ").nth(1).unwrap();
        let size =
            |key: &str| image.split(&format!("{key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse::<f64>();
        let scales = [size("width").unwrap() / (x.1 - x.0), size("height").unwrap() / (y.1 - y.0)];
        assert!((scales[0] / scales[1] - 1.0).abs() < 0.03, "{x:?} {y:?}: {scales:?}");
    }
}
