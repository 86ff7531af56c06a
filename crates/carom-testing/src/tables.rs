//! Tables of cases, and numbers, as text.

/// The cases of a table: an input on a line, and below it, further to the right, what is expected, a line each. Blank lines, and lines that begin
/// with `//`, do not count; `\n`, `\t` and `\\` are what they are in Rust, `""` is the empty text. The texts live as long as the program.
#[track_caller]
pub fn blocks(table: &str) -> Vec<(&'static str, Vec<&'static str>)> {
    let text = |line: &str| -> &'static str {
        let pieces = line.split(r"\\").map(|piece| piece.replace(r"\n", "\n").replace(r"\t", "\t"));
        if line == "\"\"" { "" } else { pieces.collect::<Vec<_>>().join("\\").leak() }
    };
    let lines = table.lines().filter(|line| !line.trim().is_empty() && !line.trim().starts_with("//"));
    let lines: Vec<_> = lines.map(|line| (line.len() - line.trim_start().len(), line.trim())).collect();
    let mut cases: Vec<(&str, Vec<&str>)> = Vec::new();
    for (at, line) in &lines {
        match cases.last_mut() {
            Some((_, expected)) if *at > lines[0].0 => expected.push(text(line)),
            _ => cases.push((text(line), Vec::new())),
        }
    }
    cases
}

/// The cases of a table in which one line is expected of each input.
#[track_caller]
pub fn cases(table: &str) -> Vec<(&'static str, &'static str)> {
    let one = |(input, expected): (&'static str, Vec<&'static str>)| match expected[..] {
        [line] => (input, line),
        _ => panic!("{input}: one line is expected, not {expected:?}"),
    };
    blocks(table).into_iter().map(one).collect()
}

/// The numbers of a line, with spaces between them.
#[track_caller]
pub fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().map(|number| number.parse().unwrap_or_else(|why| panic!("{number}: {why}"))).collect()
}
