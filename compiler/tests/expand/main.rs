//! The expander: what forms become, and what is said of wrong ones.

mod host;

use std::sync::Arc;

use esl_bytecode::compile::{Answer, CompileTimeHost};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::SourceId;
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::expand::{Event, Expander, print::print};
use esl_compiler::reader::Reader;

use host::FakeHost;

/// Expands all forms of a text, and gives the chunks as text, and the findings.
fn expand_in(host: &mut FakeHost, text: &str) -> (Vec<String>, Vec<Diagnostic>) {
    let mut reader = Reader::new(SourceId(0), text);
    let mut expander = Expander::new();
    let mut chunks = Vec::new();
    while let Some(form) = reader.next(host) {
        expander.begin_file_form(form.expect("the text reads"));
        loop {
            match expander.run(host, &mut |_| {}) {
                Event::Done => break,
                Event::Macro(call) => {
                    let answer = host.expand(&call);
                    expander.answer(answer.map_or_else(Answer::Failed, Answer::Expansion));
                }
                Event::Chunk(chunk) => {
                    if !chunk.purpose.keep {
                        chunks.push(print(&chunk.core));
                    }
                    if chunk.purpose.load || chunk.purpose.keep {
                        let object = host.load(Default::default(), chunk.purpose.keep);
                        expander.answer(match object {
                            Ok(Some(object)) => Answer::Object(object),
                            _ => Answer::Loaded,
                        });
                    }
                }
            }
        }
    }
    (chunks, expander.finish(host))
}

fn expand(text: &str) -> String {
    let (chunks, findings) = expand_in(&mut FakeHost::new(), text);
    let mut shown = chunks.join("\n");
    for finding in findings {
        shown.push_str(&format!("\n{}: {}", finding.code, finding.message));
    }
    shown
}

#[allow(dead_code)]
fn findings(text: &str) -> String {
    let (_, findings) = expand_in(&mut FakeHost::new(), text);
    let mut sources = Sources::new();
    sources.add("test.esl", Some(Arc::from(text)));
    let shown: Vec<String> =
        findings.iter().map(|finding| Renderer::default().render(finding, &sources)).collect();
    shown.join("\n\n")
}

#[test]
#[ignore]
fn smoke() {
    for line in include_str!("smoke.txt").lines() {
        println!("{line}\n{}\n", expand(line));
    }
}
