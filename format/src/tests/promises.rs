//! Guarantees for every text: its data and comments stay, and formatting it again changes nothing. Tested
//! with all programs of the project, random edits of them, and random programs and texts.

use std::path::{Path, PathBuf};

use esl_conformance::differential::Grammar;
use proptest::prelude::*;

use super::super::*;

/// All programs of the project.
fn programs() -> Vec<PathBuf> {
    let mut folders = vec![esl_conformance::root().to_path_buf()];
    let mut programs = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the folder can be read").flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            if path.is_dir() && !name.starts_with('.') && name != "target" {
                folders.push(path);
            } else if name.ends_with(".esl") {
                programs.push(path);
            }
        }
    }
    programs.sort();
    assert!(programs.len() > 500, "these are not all programs: {}", programs.len());
    programs
}

/// Checks what is promised of a text: it is read as before, formatting it again changes nothing, and lines
/// are long only where they cannot be broken.
#[track_caller]
fn check_promises(text: &str, styles: &Styles, path: &Path) {
    let tree = SyntaxTree::new(text);
    let formatted = format(&tree, styles, None);
    let is_readable = formatted.is_ok();
    let once = match formatted {
        Ok(once) => once,
        Err(FormatError::Unreadable) => Edit::apply(text, &indent_edits(&tree, styles, None)),
        Err(FormatError::Changed) => panic!("{}: {text}", path.display()),
    };
    let again = SyntaxTree::new(&*once);
    let edits = match is_readable {
        true => format_edits(&again, styles, None).expect("it can be read as before"),
        false => indent_edits(&again, styles, None),
    };
    assert_eq!(edits, [], "{}: {once}", path.display());
}

#[test]
fn the_programs_of_the_project_keep_their_data_and_comments() {
    let styles = Styles::standard();
    for path in programs() {
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        check_promises(&text, &styles, &path);
    }
}

#[test]
fn random_edits_of_programs_keep_their_data_and_comments() {
    let pieces = [
        "(",
        ")",
        "\"",
        "\n",
        "\n\n",
        "  ",
        "\t",
        ";",
        " ; c\n",
        "#|",
        "|#",
        "'",
        "`",
        ",@",
        "#+esl ",
        "#(",
        "#\\",
        "\\",
        "|",
        "#.",
        " . ",
        "#1=",
        "\r\n",
        "\u{a0}",
        "loop for x ",
        "cond ",
        "é",
        "(let ((",
        "#2A",
    ];
    let styles = Styles::standard();
    // A linear congruential generator: the same edits each time.
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for path in programs() {
        let Ok(mut text) = std::fs::read_to_string(&path) else { continue };
        text.truncate((0..=text.len().min(6000)).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0));
        for _ in 0..3 {
            let at = text.floor_char_boundary(random(text.len() + 1));
            if random(3) == 0 {
                let end = text.ceil_char_boundary((at + random(12)).min(text.len()));
                text.replace_range(at..end, "");
            } else {
                text.insert_str(at, pieces[random(pieces.len())]);
            }
            check_promises(&text, &styles, &path);
        }
    }
}

#[test]
fn random_programs_keep_their_data_on_any_lines() {
    let grammar = esl_conformance::root().join("conformance/differential/grammar.txt");
    let grammar = std::fs::read_to_string(grammar).expect("the grammar is there");
    let styles = Styles::standard();
    for seed in 0..4 {
        let programs = Grammar::parse(&grammar, seed).expect("it is a grammar").programs();
        for program in programs {
            check_promises(&program, &styles, Path::new("a random program"));
            let one_line = program.split('\n').filter(|line| !line.contains([';', '"'])).collect::<Vec<_>>();
            check_promises(&one_line.join(" "), &styles, Path::new("a random program on one line"));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_texts_keep_their_data(text in "[ \\n()'`,;\"#|+a-c1.:@&]{0,120}") {
        check_promises(&text, &Styles::standard(), Path::new("a random text"));
    }

    #[test]
    fn random_lists_keep_their_data(
        parts in prop::collection::vec(
            prop::sample::select(&[
                "(", "(", ")", ")", "(let (", "(defun f (x)", "(loop ", "(cond (", "'(", "`(", ",@", "#(", "(setf ",
                "\n", " ; c\n", "#|b|#", "\"s\"", ":key ", "for ", "collect ", "some-name ", "another-long-name ",
                "&key ", "(a b)", "#'f ", "#+x ", " . ", "t ", "12 ",
            ][..]),
            0..160,
        )
    ) {
        let text = parts.concat();
        // The lists that are open get their ends, and what would end nothing is left out.
        let mut depth = 0_i32;
        let mut closed = String::new();
        for c in text.chars() {
            depth += i32::from(c == '(') - i32::from(c == ')');
            if depth < 0 {
                depth = 0;
            } else {
                closed.push(c);
            }
        }
        closed.push('\n');
        closed.extend(std::iter::repeat_n(')', depth as usize));
        check_promises(&closed, &Styles::standard(), Path::new("random lists"));
    }
}
