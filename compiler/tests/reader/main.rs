//! The reader: tokens, data, errors, limits, and properties that hold of all texts.
//!
//! `INSTA_UPDATE=always cargo test -p esl-compiler --test reader` regenerates the snapshots; look at the
//! difference.

mod data;
mod errors;
mod limits;
mod properties;
mod run_time;
mod tokens;

use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::package::{PackageId, Packages, Qualifier};
use esl_bytecode::span::SourceId;
use esl_bytecode::symbol::USER_PACKAGE;
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::reader::{BareEnvironment, Reader, print};

/// Reads all of a text.
fn read_all(text: &str) -> Vec<Result<Datum, Box<Diagnostic>>> {
    let mut environment = BareEnvironment::new();
    let mut reader = Reader::new(SourceId::default(), text);
    std::iter::from_fn(|| reader.next(&mut environment)).collect()
}

/// The one datum of a text.
fn read_one(text: &str) -> Datum {
    match read_all(text).as_slice() {
        [Ok(datum)] => datum.clone(),
        other => panic!("expected one datum in {text:?}, found {other:?}"),
    }
}

/// The codes of the diagnostics of a text.
fn codes(text: &str) -> Vec<&'static str> {
    read_all(text).into_iter().filter_map(|read| read.err().map(|error| error.code)).collect()
}

/// A datum as text, symbols of `ESL-USER` without the package.
fn show(datum: &Datum) -> String {
    let packages = Packages::standard();
    print(datum, &|symbol| match symbol.package() {
        Some(home) if **home == *USER_PACKAGE => Qualifier::None,
        _ => packages.qualifier(symbol, PackageId::USER),
    })
}

/// Data and rendered diagnostics of a text, one after the other.
fn read_and_render(text: &str) -> String {
    let mut sources = Sources::new();
    sources.add("test.esl", Some(text.into()));
    let mut shown = String::new();
    for read in read_all(text) {
        match read {
            Ok(datum) => shown += &show(&datum),
            Err(diagnostic) => shown += &Renderer::default().render(&diagnostic, &sources),
        }
        shown.push('\n');
    }
    shown
}

/// Compares `output` for `source` with the snapshot called `name`. Characters that cannot be seen are shown
/// by number.
fn snapshot(name: &str, source: &str, output: &str) {
    let is_hidden = |c: char| c != '\n' && c.escape_debug().nth(1).is_some() && !"\"'\\".contains(c);
    let show = |c: char| if is_hidden(c) { c.escape_debug().to_string() } else { c.to_string() };
    let source: String = source.chars().map(show).collect();
    let output: String = output.chars().map(show).collect();
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(format!("reader-{name}"), format!("{source}\n=====\n{output}")));
}
