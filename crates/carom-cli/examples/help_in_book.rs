//! A preprocessor of mdBook: adds to each block of the book that is one command `carom … --help` the text that it prints.

use serde_json::Value;
use std::error::Error;
use std::process::Command;

/// Beginning and end of a block of one command.
const BLOCK: [&str; 2] = ["```sh\ncarom ", "--help\n```\n"];

fn main() -> Result<(), Box<dyn Error>> {
    if std::env::args().nth(1).is_some_and(|word| word == "supports") {
        return Ok(());
    }
    // mdBook writes the pair of its settings and the book, and reads the book.
    let [_, mut book]: [Value; 2] = serde_json::from_reader(std::io::stdin())?;
    shown(&mut book)?;
    serde_json::to_writer(std::io::stdout(), &book)?;
    Ok(())
}

/// Changes the content of all chapters.
fn shown(part: &mut Value) -> Result<(), Box<dyn Error>> {
    match part {
        Value::Array(all) => all.iter_mut().try_for_each(shown),
        Value::Object(all) => all.iter_mut().try_for_each(|(key, value)| match value {
            Value::String(text) if key == "content" => Ok(*text = with_help(text)?),
            value => shown(value),
        }),
        _ => Ok(()),
    }
}

fn with_help(page: &str) -> Result<String, Box<dyn Error>> {
    let mut whole = String::new();
    for (k, part) in page.split(BLOCK[0]).enumerate() {
        whole += if k == 0 { "" } else { BLOCK[0] };
        match part.split_once(BLOCK[1]).filter(|(command, _)| k > 0 && !command.contains('\n')) {
            Some((command, rest)) => whole += &format!("{command}{}\n```text\n{}```\n{rest}", BLOCK[1], help(command)?),
            None => whole += part,
        }
    }
    Ok(whole)
}

/// What `carom COMMAND --help` prints.
fn help(command: &str) -> Result<String, Box<dyn Error>> {
    let cargo = ["run", "-q", "--locked", "-p", "carom-cli", "--bin", "carom", "--"];
    let ran = Command::new("cargo").args(cargo).args(command.split_whitespace()).arg("--help").output()?;
    if !ran.status.success() {
        return Err(format!("carom {command}--help: {}", String::from_utf8_lossy(&ran.stderr)).into());
    }
    let lines = String::from_utf8(ran.stdout)?;
    Ok(lines.lines().map(|line| format!("{}\n", line.trim_end())).collect())
}
