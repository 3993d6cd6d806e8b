//! The grammar for tree-sitter, in `editors/tree-sitter/`: its corpus, every program of the project, its
//! queries.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tree_sitter::{Node, Parser, Query, QueryCursor, StreamingIterator, Tree};

fn parser() -> Parser {
    let mut parser = Parser::new();
    parser.set_language(&tree_sitter_esl::LANGUAGE.into()).expect("the library knows the parser's version");
    parser
}

fn parse(text: &str) -> Tree {
    parser().parse(text, None).expect("nothing stops the parser")
}

/// The tree in one line, as in the corpus.
fn shown(tree: &Tree) -> String {
    tree.root_node().to_sexp()
}

/// A text of the corpus: its title, the program, the tree.
fn cases(corpus: &str) -> Vec<(String, String, String)> {
    let fence = "=".repeat(18);
    let parts: Vec<&str> = corpus.split(&fence).collect();
    let pairs = parts[1..].chunks(2);
    pairs
        .map(|pair| {
            let (program, tree) =
                pair[1].split_once("\n---\n").expect("a line of dashes follows the program");
            let tree = tree.split_whitespace().collect::<Vec<_>>().join(" ").replace(" )", ")");
            (pair[0].trim().to_owned(), program.trim_matches('\n').to_owned(), tree)
        })
        .collect()
}

#[test]
fn the_corpus_is_parsed_as_it_says() {
    let cases = cases(include_str!("../../../../editors/tree-sitter/test/corpus/data.txt"));
    assert!(cases.len() > 6, "the corpus is divided into cases");
    for (title, program, tree) in cases {
        assert_eq!(shown(&parse(&program)), tree, "{title}");
    }
}

/// Collects the programs below a folder, build products left out.
fn collect_programs(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("the folder can be listed") {
        let path = entry.expect("the folder can be listed").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && name != "node_modules" && !name.starts_with('.') {
            collect_programs(&path, found);
        } else if name.ends_with(".esl") {
            found.push(path);
        }
    }
}

/// The first place where a tree is not what the grammar says.
fn error_in(tree: &Tree) -> Option<Node<'_>> {
    let mut node = tree.root_node();
    if !node.has_error() {
        return None;
    }
    loop {
        let inner = (0..node.child_count()).filter_map(|at| node.child(at)).find(Node::has_error);
        match inner {
            Some(child) => node = child,
            None => return Some(node),
        }
    }
}

/// Programs that show what the reader refuses are among them: there, the grammar may find an error, too.
#[test]
fn every_program_of_the_project_is_parsed_without_an_error() {
    let mut programs = Vec::new();
    collect_programs(esl_conformance::root(), &mut programs);
    assert!(programs.len() > 500, "the programs are where this test looks for them");
    let mut errors = Vec::new();
    for path in programs {
        // Some are not text on purpose.
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        let is_refused = text.contains("; expect error:");
        if let Some(error) = error_in(&parse(&text)).filter(|_| !is_refused) {
            errors.push(format!(
                "{}:{}: {}",
                path.display(),
                error.start_position().row + 1,
                error.to_sexp()
            ));
        }
    }
    assert!(errors.is_empty(), "{}", errors.join("\n"));
}

/// Returns the highlighting of each word of a program: of several patterns that match, the last one counts.
fn colours(program: &str) -> BTreeMap<String, String> {
    let language = tree_sitter_esl::LANGUAGE.into();
    let query = Query::new(&language, tree_sitter_esl::HIGHLIGHTS_QUERY).expect("the query fits the grammar");
    let tree = parse(program);
    let mut found = BTreeMap::new();
    let mut cursor = QueryCursor::new();
    let mut matches = cursor.matches(&query, tree.root_node(), program.as_bytes());
    while let Some(one) = matches.next() {
        for capture in one.captures() {
            let word = program[capture.node.byte_range()].to_owned();
            let seen = found.entry(word).or_insert((one.pattern_index, ""));
            if one.pattern_index >= seen.0 {
                *seen = (one.pattern_index, query.capture_names()[capture.index as usize]);
            }
        }
    }
    found.into_iter().map(|(word, (_, name))| (word, name.to_owned())).collect()
}

#[test]
fn colours_tell_failures_and_tasks_from_other_forms() {
    let program = r#"
        (defun drive (x)
          "Drives there."
          (with-recovery-procedures ((:stuck (retry)))
            (spawn (go-to #?x *speed* 5 "m")))) ; at once
    "#;
    let colours = colours(program);
    for (word, colour) in [
        ("defun", "keyword.function"),
        ("drive", "function"),
        ("\"Drives there.\"", "string.documentation"),
        ("with-recovery-procedures", "keyword.exception"),
        (":stuck", "constant"),
        ("retry", "keyword.exception"),
        ("spawn", "keyword.coroutine"),
        ("go-to", "function.call"),
        ("#?x", "variable.parameter"),
        ("*speed*", "variable.builtin"),
        ("5", "number"),
        ("\"m\"", "string"),
        ("; at once", "comment"),
    ] {
        assert_eq!(colours.get(word).map(String::as_str), Some(colour), "{word}");
    }
    let folds = Query::new(&tree_sitter_esl::LANGUAGE.into(), tree_sitter_esl::FOLDS_QUERY);
    assert!(folds.is_ok(), "{folds:?}");
}

#[test]
fn parameters_and_bindings_are_not_coloured_as_calls() {
    let program = "(defun go (metres) (let ((a 1)) (dolist (b metres) (drive a b))))
        (defmethod stop :before ((rover rover) speed) (lambda (force) force))";
    let colours = colours(program);
    for word in ["metres", "rover", "force"] {
        assert_eq!(colours[word], "variable.parameter", "{word}");
    }
    for word in ["a", "b"] {
        assert_eq!(colours[word], "variable", "{word}");
    }
    assert_eq!(colours["drive"], "function.call");
}
