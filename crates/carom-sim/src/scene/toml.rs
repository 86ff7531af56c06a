//! TOML with messages that help.

use carom_chain::input::shown;

/// Parses TOML.
///
/// # Errors
/// A message with the line, its text if the message names no key, and the most similar key if a key is unknown.
#[doc(hidden)] // shared with the other files of this workspace that are written in TOML
pub fn from_toml<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        return Err("line 1: the file is XML; give a TOML file, in which the key urdf names the robot's URDF".into());
    }
    toml::from_str(text).map_err(|e: toml::de::Error| {
        let line = e.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
        let message = suggest(e.message());
        // Only messages about unknown fields name what is in the line.
        let quoted = text.lines().nth(line - 1).filter(|_| !message.contains("unknown field `")).map(str::trim);
        quoted.map_or_else(|| format!("line {line}: {message}"), |it| format!("line {line}, {}: {message}", shown(it)))
    })
}

/// serde's message with plain names of the types of numbers, a remedy for a missing key, and for an unknown one the most
/// similar that is known.
fn suggest(message: &str) -> String {
    let mut message = message.trim_end().replace('\n', "; ");
    for (kind, plain) in [("f64", "a number"), ("usize", "a whole number"), ("u64", "a whole number")] {
        message = message.replace(&format!("expected {kind}"), &format!("expected {plain}"));
    }
    if message.starts_with("missing field") {
        message += ": add it";
    }
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next().filter(|_| message.contains("unknown")) else { return message.clone() };
    let near = quoted
        .map(|name| (strsim::jaro_winkler(&unknown.to_lowercase(), name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((likeness, name)) if likeness > 0.7 => format!("{message}; did you mean `{name}`?"),
        _ => message.clone(),
    }
}
