//! Large and hostile forms, on a small native stack.

use std::time::Instant;

use crate::codes;

/// Runs `check` on a stack of 256 KiB and fails if it takes far too long.
fn small(check: impl FnOnce() + Send + 'static) {
    let start = Instant::now();
    let thread = std::thread::Builder::new().stack_size(256 << 10).spawn(check).expect("a thread");
    thread.join().expect("no panic");
    assert!(start.elapsed().as_secs() < 120, "took {:?}", start.elapsed());
}

fn nested(open: &str, depth: usize, close: &str) -> String {
    format!("{}1{}", open.repeat(depth), close.repeat(depth))
}

#[test]
fn forms_as_deep_as_the_reader_allows_expand() {
    small(|| {
        for open in
            ["(f ", "(progn 2 ", "(lambda () ", "(if 1 2 ", "(block b ", "(cond ((g) 2) (t ", "(let ((*x* "]
        {
            let parentheses = open.matches('(').count() - open.matches(')').count();
            let close = match open {
                "(let ((*x* " => "))(g))".to_string(),
                _ => ")".repeat(parentheses),
            };
            let depth = 1_900 / parentheses;
            let text = nested(open, depth, &close);
            assert!(!codes(&text).contains(&"nested-too-deeply"), "{open}");
        }
    });
}

#[test]
fn macros_cannot_nest_forms_without_end() {
    small(|| {
        // Each call of `deeper` puts another call around itself.
        let mut host = crate::host::FakeHost::new();
        host.define_macro("deeper", "(f (deeper))");
        let (chunks, findings) = crate::expand_file(&mut host, "(deeper) (g)");
        assert_eq!(findings.iter().map(|finding| finding.code).collect::<Vec<_>>(), ["nested-too-deeply"]);
        assert_eq!(chunks.len(), 1);
    });
}

#[test]
fn macros_cannot_expand_into_each_other_without_end() {
    small(|| {
        let mut host = crate::host::FakeHost::new();
        host.define_macro("one", "(two #1)");
        host.define_macro("two", "(one #1)");
        let (_, findings) = crate::expand_file(&mut host, "(one 1)");
        assert_eq!(findings.len(), 1);
        assert_eq!(findings[0].message, "the expansion of `one` does not end");
        assert_eq!(codes("(symbol-macrolet ((x x)) x)"), ["macro-failed"]);
        assert_eq!(codes("(symbol-macrolet ((x y) (y x)) (setf x 1))"), ["macro-failed"]);
    });
}

#[test]
fn long_forms_are_flat() {
    small(|| {
        let clauses: String = (0..20_000).map(|n| format!("((f {n}) {n}) ((f {n}))")).collect();
        assert_eq!(codes(&format!("(cond {clauses})")), [""; 0]);
        let bindings: String = (0..20_000).map(|n| format!("(x{n} {n}) ")).collect();
        assert!(!codes(&format!("(let* ({bindings}) 1)")).contains(&"nested-too-deeply"));
        let forms = "(g) ".repeat(20_000);
        for head in ["and", "or", "progn", "tagbody", "list", "values", "funcall #'g", "block b"] {
            assert_eq!(codes(&format!("({head} {forms})")), [""; 0], "{head}");
        }
        let items: String = (0..20_000).map(|n| format!(",*x* a{n} ")).collect();
        assert_eq!(codes(&format!("`({items})")), [""; 0]);
        let pairs = "*x* (g) ".repeat(2_000);
        assert_eq!(codes(&format!("(setq {pairs})")), [""; 0]);
        assert_eq!(codes(&format!("(psetq {pairs})")), [""; 0]);
        assert_eq!(codes(&format!("(setf {pairs})")), [""; 0]);
        assert_eq!(codes(&format!("(psetf {pairs})")), [""; 0]);
    });
}

#[test]
fn deep_templates_and_patterns() {
    small(|| {
        let template = format!("`{},*x*{}", "(a ".repeat(1_900), ")".repeat(1_900));
        assert_eq!(codes(&template), [""; 0]);
        let pattern = format!("(destructuring-bind {}a{} *x* a)", "(".repeat(1_900), ")".repeat(1_900));
        assert_eq!(codes(&pattern), [""; 0]);
    });
}

#[test]
fn many_names_are_looked_up_in_one_step() {
    small(|| {
        let start = Instant::now();
        let open: String = (0..900).map(|n| format!("(let ((x{n} {n})) ")).collect();
        let uses = "(g x0 x1 *x*) ".repeat(20_000);
        let text = format!("{open}{uses}{}", ")".repeat(900));
        let _ = codes(&text);
        assert!(start.elapsed().as_secs() < 20, "took {:?}", start.elapsed());
    });
}
