//! Lists of names and suggestions in messages.

use crate::input::{LONGEST_NAME, shown};

/// `'a', 'b' and 'c'`; only the first five names of a longer list.
pub(super) fn listed(names: &[&str]) -> String {
    const LISTED: usize = 5;
    let quoted: Vec<String> = names.iter().take(LISTED).map(|name| format!("'{}'", shown(name))).collect();
    match quoted.split_last() {
        Some((last, rest)) if !rest.is_empty() && names.len() <= LISTED => format!("{} and {last}", rest.join(", ")),
        _ if names.len() > LISTED => format!("{} and {} more", quoted.join(", "), names.len() - LISTED),
        _ => quoted.join(""),
    }
}

/// A hint for a name that is not among `names`: the most similar of them, or the list.
pub(crate) fn suggestion(wanted: &str, names: &[&str]) -> String {
    // Distances of longer texts would take time, and no name is near one.
    let short = wanted.len() <= LONGEST_NAME;
    let near = names.iter().filter(|_| short).map(|name| (edit_distance(wanted, name), name)).min();
    match near {
        Some((distance, name)) if distance <= 1 + wanted.chars().count() / 4 => {
            format!("did you mean '{}'?", shown(name))
        }
        // Names often have the robot's before them.
        _ if short && wanted.len() > 3 && names.iter().any(|name| name.contains(wanted)) => {
            let like: Vec<&str> = names.iter().copied().filter(|name| name.contains(wanted)).collect();
            format!(
                "did you mean {}?",
                if like.len() == 1 { listed(&like) } else { format!("one of {}", listed(&like)) }
            )
        }
        _ => format!("there are {}", listed(names)),
    }
}

/// Number of letters to insert, delete or replace (Levenshtein's distance).
fn edit_distance(a: &str, b: &str) -> usize {
    // distances of the letters of `a` so far to every prefix of `b`
    let b: Vec<char> = b.chars().collect();
    let mut distances: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut row = vec![i + 1];
        let mut last = i + 1;
        for (y, pair) in b.iter().zip(distances.windows(2)) {
            last = (pair[0] + usize::from(x != *y)).min(pair[1] + 1).min(last + 1);
            row.push(last);
        }
        distances = row;
    }
    distances.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::{edit_distance, listed, suggestion};

    #[test]
    fn a_name_without_the_prefix_of_the_robot_is_recognised() {
        let names = ["base", "arm_hand_left", "arm_hand_right", "arm_tool"];
        assert_eq!(suggestion("tool", &names), "did you mean 'arm_tool'?");
        assert_eq!(suggestion("hand", &names), "did you mean one of 'arm_hand_left' and 'arm_hand_right'?");
        assert_eq!(suggestion("wheel", &names), format!("there are {}", listed(&names)));
    }

    #[test]
    fn edit_distance_is_levenshteins() {
        for (a, b, distance) in [("", "", 0), ("ab", "", 2), ("", "ab", 2), ("kitten", "sitting", 3), ("ab", "ba", 2)] {
            assert_eq!(edit_distance(a, b), distance, "{a} {b}");
        }
    }

    #[test]
    fn lists_show_at_most_five_names() {
        assert_eq!(listed(&["a"]), "'a'");
        assert_eq!(listed(&["a", "b", "c"]), "'a', 'b' and 'c'");
        assert_eq!(listed(&["a"; 7]), "'a', 'a', 'a', 'a', 'a' and 2 more");
    }
}
