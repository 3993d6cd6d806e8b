//! Drawing.

use esl_bytecode::diagnostic::{Diagnostic, Label};
use esl_bytecode::span::{SourceId, Span};
use esl_compiler::diagnostic::{Format, Renderer, Sources, code};

const HUMAN: Renderer = Renderer { color: false, format: Format::Human };
const JSON: Renderer = Renderer { color: false, format: Format::Json };

fn sources(texts: &[(&str, &str)]) -> Sources {
    let mut sources = Sources::new();
    for (name, text) in texts {
        sources.add(*name, Some((*text).into()));
    }
    sources
}

/// The span of the first `part` in `text`.
fn span(source: u32, text: &str, part: &str) -> Span {
    let start = text.find(part).expect("the part is there");
    Span::new(SourceId(source), start as u32, (start + part.len()) as u32)
}

fn snapshot(name: &str, output: &str) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(format!("render-{name}"), output));
}

fn example() -> (Sources, Diagnostic) {
    let text = "(defun area (width)\n  (* width heigth))\n\n(print (area 3))\n";
    let diagnostic = code::UNDEFINED_VARIABLE
        .at(span(0, text, "heigth"), "the variable `heigth` is not defined")
        .label("not bound here")
        .also(span(0, text, "area"), "in this function")
        .help("did you mean `height`?");
    (sources(&[("area.esl", text)]), diagnostic)
}

#[test]
fn labels_and_help() {
    let (sources, diagnostic) = example();
    snapshot("labels", &HUMAN.render(&diagnostic, &sources));
}

#[test]
fn color_is_on_request() {
    let (sources, diagnostic) = example();
    let colored = Renderer { color: true, ..HUMAN }.render(&diagnostic, &sources);
    assert!(colored.contains('\u{1b}'));
    assert!(!HUMAN.render(&diagnostic, &sources).contains('\u{1b}'));
}

#[test]
fn json_is_one_object_on_one_line() {
    let (sources, diagnostic) = example();
    snapshot("json", &JSON.render(&diagnostic, &sources));
    let odd = code::INVALID_TOKEN.at(Span::new(SourceId(7), 3, 4), "a \"quote\", a \\, a\nline, a \u{1}");
    snapshot("json-without-a-text", &JSON.render(&odd, &sources));
}

#[test]
fn labels_in_several_sources() {
    let user = "(twice\n  (print 1))\n";
    let library = "; macros\n(defmacro twice (form)\n  (car form))\n";
    let diagnostic = code::MACRO_FAILED
        .at(span(1, user, "(twice\n  (print 1))"), "the macro `twice` failed")
        .label("in this call")
        .also(span(0, library, "twice"), "defined here");
    snapshot(
        "several-sources",
        &HUMAN.render(&diagnostic, &sources(&[("macros.esl", library), ("user.esl", user)])),
    );
}

#[test]
fn without_its_text_only_the_position_is_shown() {
    let mut sources = Sources::new();
    let source = sources.add("lost.esl", None);
    let diagnostic = code::INVALID_UTF_8.at(Span::new(source, 17, 18), "not UTF-8").help("convert it");
    let unknown = code::INVALID_UTF_8.at(Span::new(SourceId(9), 17, 18), "not UTF-8");
    let both = [HUMAN.render(&diagnostic, &sources), HUMAN.render(&unknown, &sources)];
    snapshot("without-a-text", &both.join("\n\n"));
}

#[test]
fn a_line_of_a_megabyte_is_cut_around_the_label() {
    let text = format!("(print 1)\n(list {}(a:b:c) {})\n", "é ".repeat(500_000), "x ".repeat(500_000));
    let diagnostic = code::INVALID_TOKEN.at(span(0, &text, "a:b:c"), "too many colons");
    snapshot("long-line", &HUMAN.render(&diagnostic, &sources(&[("long.esl", &text)])));
    let string = format!("(print \"{}", "x".repeat(1_000_000));
    let whole = Span::new(SourceId(0), 7, string.len() as u32);
    let diagnostic = code::TOKEN_TOO_LONG.at(whole, "too long").label("all of this");
    snapshot("long-label", &HUMAN.render(&diagnostic, &sources(&[("long.esl", &string)])));
}

#[test]
fn labels_far_apart_are_shown_apart() {
    let text = format!("(first)\n{}(last)\n", "(middle)\n".repeat(1_000_000));
    let diagnostic =
        code::UNCLOSED_LIST.at(span(0, &text, "(first)"), "far").also(span(0, &text, "(last)"), "from here");
    snapshot("far-apart", &HUMAN.render(&diagnostic, &sources(&[("far.esl", &text)])));
}

#[test]
fn a_label_over_many_lines_is_shown_at_its_first() {
    let text = format!("(first\n{})\n", "  (middle)\n".repeat(1_000_000));
    let whole = Span::new(SourceId(0), 0, text.len() as u32);
    let diagnostic = code::MALFORMED_FORM.at(whole, "all of it").label("this form");
    snapshot("many-lines", &HUMAN.render(&diagnostic, &sources(&[("long.esl", &text)])));
    let text = "(first\n  (second\n    third))\n";
    let diagnostic = code::MALFORMED_FORM.at(Span::new(SourceId(0), 0, 27), "all of it").label("this form");
    snapshot("some-lines", &HUMAN.render(&diagnostic, &sources(&[("short.esl", text)])));
}

#[test]
fn the_end_of_the_text_has_a_place() {
    let text = "(a\n";
    let end = Span::new(SourceId(0), 3, 3);
    let diagnostic = code::UNCLOSED_LIST.at(end, "the end").label("here");
    snapshot("end", &HUMAN.render(&diagnostic, &sources(&[("end.esl", text)])));
    assert!(HUMAN.render(&diagnostic, &sources(&[("empty.esl", "")])).contains("empty.esl"));
}

#[test]
fn spans_that_do_not_fit_the_text_are_drawn_all_the_same() {
    let sources = sources(&[("odd.esl", "é(\r\nb\tc)\rd\u{202e}e")]);
    for start in 0..20 {
        for end in 0..20 {
            let span = Span::new(SourceId(0), start, end);
            let mut diagnostic = code::INVALID_TOKEN.at(span, "odd");
            diagnostic.secondary.push(Label { span: Span::new(SourceId(0), end, start), text: "odd".into() });
            assert!(HUMAN.render(&diagnostic, &sources).contains("odd.esl"));
            assert!(JSON.render(&diagnostic, &sources).contains("odd.esl"));
        }
    }
}

#[test]
fn messages_cannot_break_the_line_or_steer_the_terminal() {
    let diagnostic = code::INVALID_TOKEN.at(Span::default(), "a\u{1b}[31m\nb\u{202e}").help("c\nd");
    let text = HUMAN.render(&diagnostic, &sources(&[("x.esl", "x")]));
    assert!(!text.contains(['\u{1b}', '\u{202e}']), "{text}");
    assert_eq!(text.lines().count(), 7, "{text}");
}
