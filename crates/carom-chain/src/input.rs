//! Bounds of input and of messages about it, for all crates of this repository. The book's table of limits
//! (`reference-limits.md`) gives the reasons.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest URDF, SRDF, scene or study, and longest line of JSON, in MiB. A reader needs up to 55 bytes for a byte of URDF, so
/// less than 1 GB; and 16 MiB are 30 000 links of 500 bytes each, whose mass matrix has 7 GB.
pub const MOST_MIB: u64 = 16;

/// Most characters of a name or value in a message.
const SHOWN: usize = 200;

/// Most characters of a message with several names.
pub const MESSAGE: usize = 4000;

/// Most characters of a name, so that a message with several of them stays within [`MESSAGE`] or nearly so.
pub const LONGEST_NAME: usize = 1000;

/// Most attributes of an XML element: each is compared with all before it.
const ATTRIBUTES: usize = 100;

/// Most declarations of namespaces in a document: an element with one of its own stores those of all elements around it.
const NAMESPACES: usize = 10_000;

/// A text file of at most `most` MiB.
///
/// # Errors
/// The error of the system, a folder, a larger file, a text that is not UTF-8.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(read_bytes(path, most)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no text: its bytes are not valid UTF-8"))
}

/// A file of at most `most` MiB.
///
/// # Errors
/// The error of the system, a folder, a larger file.
pub fn read_bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder: give the path of a file"));
    }
    let mut bytes = Vec::new();
    let bound = most << 20;
    // The length of a pipe or device is not known before it is read.
    if File::open(path)?.take(bound + 1).read_to_end(&mut bytes)? as u64 > bound {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it is larger than {most} MiB, the limit")));
    }
    Ok(bytes)
}

/// A name or value for a message, of at most 200 characters.
pub fn shown(text: &str) -> Cow<'_, str> {
    shortened(text, SHOWN)
}

/// A text for a message: of more than `most` characters, the first and the last half with … between them.
pub fn shortened(text: &str, most: usize) -> Cow<'_, str> {
    // Bytes are at least as many as characters.
    let count = if text.len() > most { text.chars().count() } else { 0 };
    if count <= most {
        return Cow::Borrowed(text);
    }
    let at = |n: usize| text.char_indices().nth(n).map_or(text.len(), |(place, _)| place);
    Cow::Owned(format!("{}…{}", &text[..at(most / 2)], &text[at(count - (most - most / 2))..]))
}

/// Checks what costs an XML parser time or memory that grows with the square of the text's length: see `ATTRIBUTES` and
/// `NAMESPACES`. Returns the line and the rule of the first violation.
///
/// # Errors
/// Too many attributes of an element, too many declarations of namespaces.
pub fn check_xml(text: &str) -> Result<(), (u32, String)> {
    let (mut at, mut namespaces) = (0, 0);
    while let Some(next) = text[at..].find('<') {
        let open = at + next;
        let rest = &text[open..];
        let behind = |end: &str| rest.find(end).map_or(text.len(), |k| open + k + end.len());
        at = match rest {
            _ if rest.starts_with("<!--") => behind("-->"),
            _ if rest.starts_with("<![CDATA[") => behind("]]>"),
            _ if rest.starts_with("<?") => behind("?>"),
            _ => {
                // A tag ends before the next <, which no value may contain.
                let tag = &rest[..rest[1..].find('<').map_or(rest.len(), |k| k + 1)];
                let (attributes, declared) = attributes(tag);
                namespaces += declared;
                let rule = if attributes > ATTRIBUTES {
                    format!(
                        "an element has more than {ATTRIBUTES} attributes, the limit: remove those that are not used"
                    )
                } else if namespaces > NAMESPACES {
                    format!("more than {NAMESPACES} namespaces are declared, the limit: declare each once, in the root")
                } else {
                    at = open + tag.len();
                    continue;
                };
                let line = 1 + text[..open].matches('\n').count();
                return Err((u32::try_from(line).unwrap_or(u32::MAX), rule));
            }
        };
    }
    Ok(())
}

/// Numbers of attributes and of declarations of namespaces of a tag, which text may follow.
fn attributes(tag: &str) -> (usize, usize) {
    let (mut quote, mut count, mut namespaces) = (None, 0, 0);
    for (k, byte) in tag.bytes().enumerate() {
        match (quote, byte) {
            (Some(open), _) if open == byte => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'=') => count += 1,
            (None, b'>') => break,
            (None, b'x') if tag[k..].starts_with("xmlns") => namespaces += 1,
            _ => {}
        }
    }
    (count, namespaces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortened_texts_keep_their_ends_and_have_the_length_asked_for() {
        assert_eq!(shortened("abcdef", 6), "abcdef");
        assert_eq!(shortened("abcdefg", 6), "abc…efg");
        assert_eq!(shortened("abcdefg", 5), "ab…efg");
        assert_eq!(shortened("äöüäöü", 6), "äöüäöü", "characters, not bytes");
        assert_eq!(shortened("äöüßäöü", 4), "äö…öü");
    }

    #[test]
    fn attributes_are_counted_in_tags_alone() {
        let many: String = (0..101).map(|k| format!(" a{k}='='")).collect();
        assert_eq!(attributes(&format!("<e{many}/>= = =")), (101, 0));
        for text in [format!("<!--<e{many}/>--><e/>"), format!("<e><![CDATA[<e{many}/>]]></e>"), "=".repeat(200)] {
            assert_eq!(check_xml(&text), Ok(()), "{text}");
        }
        let (line, rule) = check_xml(&format!("<r>\n<e{many}/></r>")).unwrap_err();
        assert!(line == 2 && rule.starts_with("an element has more than 100 attributes"), "{rule}");
        let spaces = "<e xmlns:a='a' xmlns='b'/>\n".repeat(5000);
        assert_eq!(check_xml(&spaces), Ok(()));
        assert_eq!(check_xml(&format!("{spaces}<e xmlns='c'/>")).unwrap_err().0, 5001);
    }
}
