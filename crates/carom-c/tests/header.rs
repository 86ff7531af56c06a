//! The header `include/carom.h` is what cbindgen makes of the sources.

use std::path::Path;

/// The sources in the order of the header.
const SOURCES: [&str; 8] = ["error", "chain", "dynamics", "law", "hit", "strike", "scene", "session"];

const HEAD: &str = "\
/** The C API of carom: impacts of kinematic chains, qd+ = qd- + M^-1 J^T p.
 *
 * Generated from the sources of the crate carom-c: do not edit. The page \"Use carom from C and C++\" of the book shows its use.
 *
 * Conventions. SI units and radians. q and qd list the joints in the order of the URDF file, an added floating base first. Vectors
 * and matrices of points are in world axes. Matrices are stored row by row; the states of a batch are rows. A contact normal points
 * from the environment to the robot, an approach has a negative normal velocity, impulses and forces are those on the robot.
 *
 * Errors. Functions return a carom_status; after any but CAROM_OK, carom_error() is the message. Each array comes with its length,
 * which is checked. A panic of the library becomes CAROM_PANIC, with a message on standard error.
 *
 * Memory. The caller frees the handles and texts that are written to a pointer to a pointer; after a fault NULL is written there.
 * Texts that are returned belong to the library. Memory that is written to may be uninitialised. It must not overlap any other
 * argument: that is refused, as are NULL, wrong lengths and misaligned addresses. A dangling pointer is undefined behaviour.
 *
 * Threads. Chains, laws and scenes do not change: any number of threads may use one at the same time. Dynamics, strikes and
 * sessions hold memory: one thread at a time uses one, each thread makes its own. A handle may move from thread to thread. Nothing
 * is freed while another thread uses it.
 */";

fn generated() -> String {
    let renamed = ["Chain", "Dynamics", "Event", "Hit", "Joint", "Law", "Mode", "Scene", "Session", "Status", "Strike"];
    let renamed = renamed.map(|name| (name.to_owned(), format!("carom_{}", name.to_lowercase())));
    let mut config = cbindgen::Config {
        language: cbindgen::Language::C,
        header: Some(HEAD.into()),
        include_guard: Some("CAROM_H".into()),
        cpp_compat: true,
        documentation_style: cbindgen::DocumentationStyle::Doxy,
        style: cbindgen::Style::Type,
        usize_is_size_t: true,
        no_includes: true,
        sys_includes: ["stdbool.h", "stddef.h", "stdint.h"].map(String::from).to_vec(),
        line_length: 132,
        tab_width: 4,
        ..Default::default()
    };
    config.export.rename.extend(renamed);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let builder = cbindgen::Builder::new().with_config(config);
    let builder = SOURCES.iter().fold(builder, |builder, name| builder.with_src(folder.join(format!("{name}.rs"))));
    let mut text = Vec::new();
    builder.generate().expect("cbindgen reads the sources").write(&mut text);
    String::from_utf8(text).unwrap()
}

#[test]
fn the_header_is_what_cbindgen_makes_of_the_sources() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/carom.h");
    let generated = generated();
    if std::env::var_os("CAROM_RENEW").is_some() {
        std::fs::write(&path, generated).unwrap();
        return;
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let differing = generated.lines().zip(committed.lines()).position(|(new, old)| new != old);
    assert!(
        generated == committed,
        "include/carom.h is not that of the sources (from line {differing:?}, counted from 0): renew it by\n\
         CAROM_RENEW=1 cargo test -p carom-c --test main header::"
    );
}

#[test]
fn every_function_of_the_header_has_a_comment() {
    let text = generated();
    let lines: Vec<&str> = text.lines().collect();
    let declared = |line: &str| !line.starts_with([' ', '/', '#', '}', '{']) && line.contains('(');
    let functions: Vec<usize> = (0..lines.len()).filter(|&k| declared(lines[k])).collect();
    assert!(functions.len() > 30, "{} functions", functions.len());
    for k in functions {
        assert!(lines[k - 1].trim_end().ends_with("*/"), "{}", lines[k]);
    }
}
