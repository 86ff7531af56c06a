//! The book and the other documents of the repository: their commands run and print what the pages show, and their links have
//! targets.
#![cfg(unix)]

use carom_testing::files::{Folder, ROOT, path, text};
use pulldown_cmark::{CodeBlockKind, Event, HeadingLevel, Options, Parser, Tag, TagEnd};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The Markdown files of a folder of the repository, in order of their names.
fn markdown(folder: &str) -> Vec<PathBuf> {
    let mut pages: Vec<_> = std::fs::read_dir(path(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    pages.sort();
    pages
}

/// The code blocks of a page: the text after the opening fence, the content, and the line on which the block begins.
fn code_blocks(text: &str) -> Vec<(String, String, usize)> {
    let mut blocks: Vec<(String, String, usize)> = Vec::new();
    let mut inside = false;
    for (event, range) in Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter() {
        match event {
            Event::Start(Tag::CodeBlock(kind)) => {
                let language =
                    if let CodeBlockKind::Fenced(language) = kind { language.to_string() } else { String::new() };
                blocks.push((language, String::new(), text[..range.start].lines().count() + 1));
                inside = true;
            }
            Event::End(TagEnd::CodeBlock) => inside = false,
            Event::Text(code) if inside => blocks.last_mut().unwrap().1.push_str(&code),
            _ => {}
        }
    }
    blocks
}

/// Whether a printed line is the one on the page, where `…` at the end matches any text.
fn is_line(page: &str, printed: &str) -> bool {
    match page.split_once('…').filter(|(_, rest)| rest.is_empty()) {
        Some((start, _)) => printed.starts_with(start.trim_end()),
        None => page.trim_end() == printed.trim_end(),
    }
}

/// Checks that the lines of `page` are in `printed`, in this order, and that lines next to one another on the page are so in
/// `printed`; a line that is `…` alone matches any number of lines.
fn check_output(page: &str, printed: &str, place: &str) {
    let mut rest = printed.lines().filter(|line| !line.trim().is_empty()).peekable();
    let mut gap = true; // the page may begin with any line
    for line in page.lines().filter(|line| !line.trim().is_empty()) {
        if line.trim() == "…" {
            gap = true;
            continue;
        }
        let found = if gap {
            rest.any(|printed| is_line(line, printed))
        } else {
            rest.next().is_some_and(|p| is_line(line, p))
        };
        assert!(found, "{place}: the page shows\n{line}\nbut carom prints\n{printed}");
        gap = false;
    }
}

/// Every `sh` block runs, prints the `text` block that follows it, and draws the pictures of its names in `images`. `sh,ignore` marks commands that take long or need other
/// programs.
#[test]
fn printed_outputs_of_the_book_are_those_of_carom() {
    let carom = Path::new(env!("CARGO_BIN_EXE_carom"));
    let path = format!("{}:{}", carom.parent().unwrap().display(), std::env::var("PATH").unwrap());
    let (mut compared, mut pictures) = (0, 0);
    for page in markdown("book/src") {
        let desk = Folder::new();
        desk.link(&["robots", "scenes", "studies", "docs"]);
        let blocks = code_blocks(&std::fs::read_to_string(&page).unwrap());
        for (k, (language, script, line)) in blocks.iter().enumerate().filter(|(_, block)| block.0 == "sh") {
            let place = format!("{}:{line}", page.display());
            let out =
                Command::new("sh").args(["-e", "-c", script]).current_dir(&desk).env("PATH", &path).output().unwrap();
            let (printed, complaint) = (String::from_utf8(out.stdout).unwrap(), String::from_utf8_lossy(&out.stderr));
            assert!(out.status.success(), "{place}: {language} block ends with {}\n{printed}{complaint}", out.status);
            if let Some((_, page, _)) = blocks.get(k + 1).filter(|block| block.0 == "text") {
                check_output(page, &printed, &place);
                compared += 1;
            }
        }
        for drawn in std::fs::read_dir(&desk).unwrap().map(|entry| entry.unwrap().path()) {
            let shown = Path::new(ROOT).join("book/src/images").join(drawn.file_name().unwrap());
            if shown.is_file() {
                let same = std::fs::read(&drawn).unwrap() == std::fs::read(&shown).unwrap();
                assert!(
                    same,
                    "{}: a command draws another {} than book/src/images has",
                    page.display(),
                    shown.display()
                );
                pictures += 1;
            }
        }
    }
    assert!(pictures >= 3, "only {pictures} pictures were compared");
    assert!(compared > 10, "only {compared} outputs were compared: the pages are expected in book/src");
}

/// The length of a printed line, in characters, that fits on a page of the built book.
const WIDEST: usize = 118;

#[test]
fn printed_lines_of_the_book_fit_on_its_pages() {
    let mut wide = Vec::new();
    for page in markdown("book/src") {
        for (language, code, begin) in code_blocks(&std::fs::read_to_string(&page).unwrap()) {
            // Lines of Rust that begin with # are not shown.
            let shown =
                code.lines().enumerate().filter(|(_, text)| !(language.starts_with("rust") && text.starts_with("# ")));
            let too_long = shown.filter(|(_, text)| text.chars().count() > WIDEST);
            wide.extend(too_long.map(|(k, text)| format!("{}:{}: {text}", page.display(), begin + 1 + k)));
        }
    }
    assert!(wide.is_empty(), "lines of more than {WIDEST} characters, which the page cuts:\n{}", wide.join("\n"));
}

#[test]
fn check_output_detects_a_wrong_output() {
    let printed = "a 1\nb 2\n\nc 3\nd 4\n";
    check_output("b 2\nc …\n", printed, "");
    check_output("a 1\n…\nd 4\n", printed, "");
    for wrong in ["b 3\n", "a 1\nc 3\n", "c 3\n…\nb 2\n", "d 4\ne\n"] {
        assert!(std::panic::catch_unwind(|| check_output(wrong, printed, "")).is_err(), "{wrong}");
    }
}

/// The anchor of a heading in GitHub and mdBook: lower case, hyphens for spaces, no punctuation.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    kept.chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

/// Links and pictures of a document, and the anchors of its headings.
fn links_and_anchors(text: &str) -> (Vec<String>, HashSet<String>) {
    let (mut links, mut anchors, mut heading) = (Vec::new(), HashSet::new(), None::<String>);
    for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => links.push(dest_url.to_string()),
            Event::Start(Tag::Heading { level: HeadingLevel::H1 | HeadingLevel::H2 | HeadingLevel::H3, .. }) => {
                heading = Some(String::new());
            }
            Event::End(TagEnd::Heading(_)) => {
                let plain = anchor(&heading.take().unwrap_or_default());
                let repeats = (1..).map(|k| format!("{plain}-{k}"));
                let free = std::iter::once(plain.clone()).chain(repeats).find(|name| !anchors.contains(name)).unwrap();
                anchors.insert(free);
            }
            Event::Text(words) | Event::Code(words) => {
                if let Some(heading) = &mut heading {
                    heading.push_str(&words);
                }
            }
            _ => {}
        }
    }
    (links, anchors)
}

#[test]
fn every_link_has_a_target() {
    let root = Path::new(ROOT).canonicalize().unwrap();
    let book = root.join("book/src");
    let mut documents = markdown("");
    for folder in ["book/src", "docs", "robots", "benches/peers"] {
        documents.extend(markdown(folder));
    }
    let read: HashMap<PathBuf, (Vec<String>, HashSet<String>)> = documents
        .iter()
        .map(|path| (path.canonicalize().unwrap(), links_and_anchors(&std::fs::read_to_string(path).unwrap())))
        .collect();
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for (document, (links, _)) in &read {
        for link in links.iter().filter(|link| !link.contains("://") && !link.starts_with("mailto:")) {
            seen += 1;
            let (path, fragment) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { document.clone() } else { document.parent().unwrap().join(path) };
            let place = format!("{} → {link}", document.display());
            let Ok(target) = target.canonicalize() else {
                wrong.push(format!("{place}: no such file"));
                continue;
            };
            if !target.starts_with(&root) {
                wrong.push(format!("{place}: outside the repository"));
            }
            // mdBook changes .md to .html in every link, also to files that are not pages of the book.
            if document.starts_with(&book)
                && target.extension().is_some_and(|e| e == "md")
                && !target.starts_with(&book)
            {
                wrong.push(format!("{place}: not a page of the book"));
            }
            if !fragment.is_empty() && !read.get(&target).is_some_and(|(_, anchors)| anchors.contains(fragment)) {
                wrong.push(format!("{place}: no such heading"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(seen > 50, "only {seen} links were checked: the documents are expected in the repository");
}

/// A page must be in the summary to be built, and its Rust must be included in the façade crate to be tested.
#[test]
fn every_page_is_in_the_summary_and_its_rust_is_compiled() {
    let summary = text("book/src/SUMMARY.md");
    let linked: HashSet<String> = links_and_anchors(&summary).0.into_iter().collect();
    let facade = text("crates/carom/src/lib.rs");
    for page in markdown("book/src") {
        let name = page.file_name().unwrap().to_str().unwrap();
        assert!(name == "SUMMARY.md" || linked.contains(name), "{name} is missing from SUMMARY.md");
        let has_rust = code_blocks(&std::fs::read_to_string(&page).unwrap()).iter().any(|b| b.0.starts_with("rust"));
        let included = facade.contains(&format!("book/src/{name}\")"));
        assert_eq!(has_rust, included, "{name}: crates/carom/src/lib.rs includes the pages that have Rust in them");
    }
}

/// The lists of robots and scenes on the pages, and that of `robots/README.md`, are those of the folders.
#[test]
fn every_robot_and_scene_is_listed() {
    for (folder, ending, lists) in [
        ("robots", "urdf", [("book/src/task-dynamics.md", "`robots/NAME`"), ("robots/README.md", "`NAME`")].as_slice()),
        ("scenes", "toml", [("book/src/task-simulate.md", "`scenes/NAME`")].as_slice()),
    ] {
        let files = std::fs::read_dir(path(folder)).unwrap().map(|entry| entry.unwrap().path());
        let mut found = 0;
        for file in files.filter(|path| path.extension().is_some_and(|own| own == ending)) {
            found += 1;
            let name = file.file_name().unwrap().to_str().unwrap();
            for (page, listed) in lists {
                assert!(text(page).contains(&listed.replace("NAME", name)), "{page} does not list {folder}/{name}");
            }
        }
        assert!(found > 10, "only {found} files in {folder}");
    }
}
