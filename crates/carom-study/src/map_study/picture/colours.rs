//! The colours of pictures of maps.

use super::super::CLASSES;

/// Colour of NaN.
pub(super) const NOTHING: [u8; 3] = [150, 150, 150];
/// Dark blue to yellow, with linearly increasing lightness.
pub(super) const SEQUENTIAL: [[u8; 3]; 6] =
    [[33, 24, 82], [45, 75, 140], [36, 122, 142], [53, 168, 128], [138, 207, 85], [250, 231, 60]];
/// Blue over white to red.
pub(super) const DIVERGING: [[u8; 3]; 5] =
    [[33, 90, 160], [130, 178, 214], [247, 247, 247], [236, 150, 120], [170, 30, 45]];
/// For [`CLASSES`], in their order.
const OF_CLASSES: [[u8; 3]; 11] = [
    [250, 250, 250],
    [222, 222, 222],
    [60, 60, 60],
    [150, 150, 150],
    [190, 190, 190],
    [106, 81, 163],
    [65, 171, 170],
    [198, 219, 239],
    [120, 160, 200],
    [253, 190, 90],
    [205, 70, 70],
];
/// For other words.
pub(super) const OTHERS: [[u8; 3]; 8] = [
    [66, 133, 190],
    [240, 140, 50],
    [80, 165, 80],
    [200, 65, 65],
    [145, 105, 185],
    [140, 100, 80],
    [220, 130, 190],
    [120, 120, 120],
];

pub(super) fn word_colour(words: &[String], value: f64) -> [u8; 3] {
    if value.is_nan() {
        return NOTHING;
    }
    let k = value as usize;
    if words.iter().eq(CLASSES.iter()) { OF_CLASSES[k % OF_CLASSES.len()] } else { OTHERS[k % OTHERS.len()] }
}

pub(super) fn mix(colours: &[[u8; 3]], share: f64) -> [u8; 3] {
    let at = share * (colours.len() - 1) as f64;
    let k = (at as usize).min(colours.len() - 2);
    let part = at - k as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(colours[k][i]), f64::from(colours[k + 1][i]));
        (a + (b - a) * part).round() as u8
    })
}
