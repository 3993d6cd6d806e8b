//! Checks that the conformance programs use every function, macro and special form of the language.

use std::collections::BTreeSet;

use esl::{Config, Engine, host::VirtualHost};
use esl_conformance::programs;

/// Form that lists the defined names.
const NAMES: &str = "
(let ((names nil))
  (dolist (symbol (apropos-list \"\" \"ESL\") (format nil \"~{~a~^ ~}\" names))
    (when (and (eq (nth-value 1 (find-symbol (symbol-name symbol) (symbol-package symbol))) :external)
               (or (special-operator-p symbol) (macro-function symbol) (fboundp symbol)))
      (push (symbol-name symbol) names))))";

/// Returns the words of all programs, in upper case.
fn words() -> BTreeSet<String> {
    let mut words = BTreeSet::new();
    for path in programs::paths("") {
        let text = std::fs::read_to_string(&path).expect("a program is text").to_uppercase();
        for line in text.lines() {
            let code = line.split(" ;").next().unwrap_or(line);
            if !code.starts_with(';') {
                let parts = code.split(|c: char| c.is_whitespace() || "()'`,@#\"".contains(c));
                words.extend(parts.map(|word| word.trim_start_matches("CL:").to_string()));
            }
        }
    }
    words
}

#[test]
fn every_name_is_used_by_a_program() {
    let used = words();
    let mut engine =
        Engine::with(Config::default(), Box::new(VirtualHost::new())).expect("there is room for the library");
    let names = engine.eval(NAMES).expect("the names can be listed").to_string();
    let names: Vec<&str> = names.trim_matches('"').split(' ').collect();
    assert!(names.len() > 500, "only {} names are listed", names.len());
    let unused: Vec<&str> = names.into_iter().filter(|name| !used.contains(*name)).collect();
    assert!(unused.is_empty(), "no conformance program uses {} names: {}", unused.len(), unused.join(" "));
}
