//! The manual's reference is what `help` says, and `docs/manual/reference.md` is up to date. `ESL_BLESS=1`
//! writes it.

use std::path::Path;

use esl::host::VirtualHost;
use esl::{Config, Data, Engine};

fn engine() -> Engine {
    Engine::with(Config::default(), Box::new(VirtualHost::new())).expect("there is room for the library")
}

fn text(engine: &mut Engine, form: &str) -> String {
    match engine.eval(form).expect("it can be evaluated") {
        Data::String(text) => text,
        other => panic!("`{form}` gives {other}"),
    }
}

#[test]
fn the_reference_is_up_to_date() {
    let expected = text(&mut engine(), "(esl::%reference)");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/manual/reference.md");
    if std::env::var_os("ESL_BLESS").is_some_and(|value| value == "1") {
        std::fs::write(&path, &expected).expect("the manual can be written");
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "docs/manual/reference.md is stale: run `ESL_BLESS=1 cargo test --test reference` and commit the result"
    );
    let rows: Vec<&str> = found.lines().filter(|line| line.starts_with("| `")).collect();
    assert!(rows.len() > 700, "there are {} rows", rows.len());
    let empty: Vec<&&str> = rows.iter().filter(|row| row.ends_with("` |  |")).collect();
    assert!(empty.is_empty(), "names without a text: {empty:#?}");
}

#[test]
fn help_says_what_the_reference_says() {
    let mut engine = engine();
    let help = text(&mut engine, "(with-output-to-string (s) (help 'member s))");
    let found =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/manual/reference.md"))
            .expect("the reference is there");
    let usage = help
        .lines()
        .next()
        .and_then(|line| line.strip_prefix("member is a function: "))
        .expect("it is a function");
    let row = found.lines().find(|row| row.starts_with(&format!("| `{usage}` |"))).expect("it has a row");
    let first = help.lines().nth(1).expect("it has a text").trim();
    assert!(row.contains(first), "{row}\n{help}");
}

#[test]
fn every_name_of_common_lisp_is_defined_or_said_to_be_left_out() {
    let silent = "(let ((names nil))
       (dolist (s (esl::%external-symbols \"COMMON-LISP\") (format nil \"~{~(~a~)~^ ~}\" names))
         (unless (or (esl::%entries s) (get s 'esl::%instead) (char= (char (symbol-name s) 0) #\\&)
                     (handler-case (progn (typep 1 s) t) (error () nil)))
           (push s names))))";
    let silent = text(&mut engine(), silent);
    // These are neither functions nor variables: words of declarations, types and other places.
    let words = "variable structure standard method-combination otherwise declaration compiler-macro ftype type declare ignore \
                 ignorable special optimize inline notinline speed safety debug space compilation-speed dynamic-extent satisfies";
    let unknown: Vec<&str> =
        silent.split(' ').filter(|name| !words.split(' ').any(|word| word == *name)).collect();
    assert!(unknown.is_empty(), "nothing is said of {unknown:?}");
}
