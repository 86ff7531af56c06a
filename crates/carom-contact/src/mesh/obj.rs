//! Wavefront OBJ: the lines `v x y z` and `f a b c …`; all others are ignored.

use super::soup::Soup;
use carom_chain::input::shown;
use nalgebra::Vector3;

/// Reads the text of a file.
///
/// # Errors
/// A vertex without three numbers; a face with something else than indices of vertices before it.
pub(super) fn read(text: &str) -> Result<Soup, String> {
    let mut soup = Soup::default();
    for (number, line) in text.lines().enumerate() {
        let refuse = |rule: &str| format!("line {}: '{}': {rule}", number + 1, shown(line));
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Option<Vec<f64>> = words.take(3).map(|word| word.parse().ok()).collect();
                match numbers.as_deref() {
                    Some([x, y, z]) => soup.vertices.push(Vector3::new(*x, *y, *z)),
                    _ => return Err(refuse("a vertex needs three numbers")),
                }
            }
            Some("f") => {
                let corners: Option<Vec<u32>> = words.map(|word| corner(word, soup.vertices.len())).collect();
                let rule = "a face needs indices of vertices above it, counted from 1";
                soup.add_polygon(&corners.ok_or_else(|| refuse(rule))?);
            }
            _ => {}
        }
    }
    Ok(soup)
}

/// The index of a vertex in `3`, `3/1`, `3//2` or `3/1/2`: the first number, counted from 1, or backwards from the last
/// vertex if negative.
fn corner(word: &str, count: usize) -> Option<u32> {
    let given: i64 = word.split('/').next()?.parse().ok()?;
    let index = if given < 0 { count as i64 + given } else { given - 1 };
    (0..count as i64).contains(&index).then_some(index as u32)
}
