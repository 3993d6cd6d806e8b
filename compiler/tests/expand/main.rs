//! The expander and compilations: what forms become, and what is said of wrong ones.
//!
//! `INSTA_UPDATE=always cargo test -p esl-compiler --test expand` regenerates the snapshots; look at the
//! difference.

mod errors;
mod flags;
mod forms;
mod host;
mod limits;
mod properties;
mod session;
mod toplevel;

use std::sync::Arc;

use esl_bytecode::compile::{CompileTimeHost, StepOutcome, Work};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::SourceId;
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::expand::{Chunk, Expander, Stop, print::print};
use esl_compiler::reader::Reader;

use host::FakeHost;

/// Expands one form of a file, telling `host` of everything.
fn expand_form(expander: &mut Expander, host: &mut FakeHost, form: Datum) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    expander.begin_file_form(form);
    finish_form(expander, host, &mut chunks);
    chunks
}

fn finish_form(expander: &mut Expander, host: &mut FakeHost, chunks: &mut Vec<Chunk>) {
    loop {
        match expander.run(host, &mut Work::unbounded()) {
            Stop::Done => return,
            Stop::More => {}
            Stop::Macro(call) => {
                let answer = host.expand(&call);
                expander.answer(answer.map_or_else(StepOutcome::Failed, StepOutcome::Expansion));
            }
            Stop::Chunk(chunk) => {
                if chunk.purpose.load {
                    let object = host.load(Default::default(), chunk.purpose.keep);
                    expander.answer(match object {
                        Ok(Some(object)) => StepOutcome::Object(object),
                        Ok(None) => StepOutcome::Loaded,
                        Err(failure) => StepOutcome::Failed(failure),
                    });
                }
                chunks.push(*chunk);
            }
        }
    }
}

/// The forms of a text.
fn read_all(host: &mut FakeHost, text: &str) -> Vec<Datum> {
    let mut reader = Reader::new(SourceId(0), text);
    std::iter::from_fn(|| reader.next(host)).map(|read| read.expect("the text reads")).collect()
}

/// Expands all forms of a text as one file.
fn expand_file(host: &mut FakeHost, text: &str) -> (Vec<Chunk>, Vec<Diagnostic>) {
    let mut expander = Expander::new();
    let forms = read_all(host, text);
    let chunks = forms.into_iter().flat_map(|form| expand_form(&mut expander, host, form)).collect();
    (chunks, expander.finish(host, true).diagnostics)
}

/// Each line of a text expanded by itself, with the codes of what was found.
fn expand_lines(text: &str) -> String {
    let mut shown = String::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let (chunks, findings) = expand_file(&mut FakeHost::new(), line);
        shown.push_str(&format!("{line}\n"));
        for chunk in chunks {
            let text = print(&chunk.core).replace('\n', "\n    ");
            shown.push_str(&format!("    {text}\n"));
        }
        for finding in findings {
            shown.push_str(&format!("  ! {}: {}\n", finding.code, finding.message));
        }
        shown.push('\n');
    }
    shown
}

/// The rendered findings of a text.
fn findings(host: &mut FakeHost, text: &str) -> String {
    let (_, mut findings) = expand_file(host, text);
    findings.sort_by_key(|finding| finding.primary.span.start);
    let mut sources = Sources::new();
    sources.add("test.esl", Some(Arc::from(text)));
    let shown: Vec<String> =
        findings.iter().map(|finding| Renderer::default().render(finding, &sources)).collect();
    shown.join("\n")
}

/// The codes of the findings of a text.
fn codes(text: &str) -> Vec<&'static str> {
    let (_, findings) = expand_file(&mut FakeHost::new(), text);
    findings.iter().map(|finding| finding.code).collect()
}

/// Compares with the snapshot called `name`.
fn snapshot(name: &str, text: &str) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(format!("expand-{name}"), text));
}
