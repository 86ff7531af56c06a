//! TOML with messages that help.

/// Parses TOML.
///
/// # Errors
/// A message with the line, its text if the message names no key, and the most similar key if a key is unknown.
#[doc(hidden)] // shared with the other files of this workspace that are written in TOML
pub fn from_toml<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|e: toml::de::Error| {
        let line = e.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
        let message = suggest(e.message());
        // Only messages about fields name a key.
        let quoted = text.lines().nth(line - 1).filter(|_| !message.contains(" field `")).map(str::trim);
        quoted.map_or_else(|| format!("line {line}: {message}"), |it| format!("line {line}, {it}: {message}"))
    })
}

/// Adds the most similar known key to serde's message about an unknown key.
fn suggest(message: &str) -> String {
    let message = message.trim_end().replace('\n', "; ");
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next().filter(|_| message.contains("unknown")) else { return message.clone() };
    let near = quoted.map(|name| (strsim::jaro_winkler(unknown, name), name)).max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((likeness, name)) if likeness > 0.7 => format!("{message}; did you mean `{name}`?"),
        _ => message.clone(),
    }
}
