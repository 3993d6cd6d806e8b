//! Facts and queries: by example, and in `model` against a model.

mod model;

use std::collections::BTreeMap;

use esl_heap::{Heap, Value};

use super::effort::ITEM;
use super::{Database, Effort, Progress, Term};

/// A database and a heap, which is never collected, with texts in place of values.
struct Fixture {
    heap: Heap,
    database: Database,
    symbols: BTreeMap<String, Value>,
}

/// Returns the text of a value, which consists of pairs, symbols, numbers and strings.
fn describe(heap: &Heap, value: Value) -> String {
    if let Some(number) = value.as_fixnum() {
        return number.to_string();
    }
    if let Some(symbol) = heap.symbol(value) {
        return heap.string_text(symbol.name).unwrap();
    }
    if let Some(number) = heap.as_double(value) {
        return format!("{number:?}");
    }
    if let Some(text) = heap.string_text(value) {
        return format!("{text:?}");
    }
    if value.is_nil() {
        return "NIL".into();
    }
    assert!(value.is_cons(), "values in facts of these tests");
    let mut parts = Vec::new();
    let mut rest = value;
    while let Some(pair) = heap.as_cons(rest) {
        parts.push(describe(heap, pair.car));
        rest = pair.cdr;
    }
    if rest.is_true() {
        parts.extend([".".into(), describe(heap, rest)]);
    }
    format!("({})", parts.join(" "))
}

impl Fixture {
    fn new() -> Fixture {
        let mut heap = esl_heap_testing::heap();
        let mut database = Database::default();
        database.prepare(&mut heap).unwrap();
        Fixture { heap, database, symbols: BTreeMap::new() }
    }

    fn symbol(&mut self, name: String) -> Value {
        let make = || esl_heap_testing::symbol(&mut self.heap, &name).unwrap();
        *self.symbols.entry(name.clone()).or_insert_with(make)
    }

    fn read(&mut self, text: &str) -> Value {
        let spaced = text.replace('(', " ( ").replace(')', " ) ");
        let mut lists: Vec<Vec<Value>> = vec![Vec::new()];
        for word in spaced.split_whitespace() {
            let item = match word {
                "(" => {
                    lists.push(Vec::new());
                    continue;
                }
                ")" => {
                    let mut items = lists.pop().unwrap();
                    let dot = items.iter().position(|&item| item == Value::EOF);
                    let tail = dot.map_or(Value::NIL, |at| items[at + 1]);
                    items.truncate(dot.unwrap_or(items.len()));
                    self.heap.list_with_tail(&items, tail).unwrap()
                }
                "." => Value::EOF,
                "nil" => Value::NIL,
                word => match word.parse::<f64>() {
                    Ok(x) if word.contains('.') => self.heap.float(x).unwrap(),
                    Ok(x) => Value::fixnum(x as i64).unwrap(),
                    Err(_) if word.starts_with('"') => self.heap.alloc_str(word.trim_matches('"')).unwrap(),
                    Err(_) => self.symbol(word.to_uppercase()),
                },
            };
            lists.last_mut().unwrap().push(item);
        }
        lists[0][0]
    }

    fn assert(&mut self, text: &str) -> bool {
        let fact = self.read(text);
        self.database.assert(&mut self.heap, fact, &mut 0).unwrap().is_true()
    }

    fn retract(&mut self, text: &str) -> bool {
        let fact = self.read(text);
        self.database.retract(&mut self.heap, fact, &mut 0).unwrap()
    }

    fn rule(&mut self, head: &str, body: &str) {
        let parts = [self.read(head), self.read(body), self.read(&format!("({head} {body})"))];
        self.database.define_rule(&mut self.heap, parts, &mut 0).unwrap();
    }

    fn open(&mut self, text: &str) -> u64 {
        let query = self.read(text);
        self.database.open(&mut self.heap, query, Value::NIL, false, &mut 0).unwrap()
    }

    /// Finds all answers in steps of `portion`; a test holds if the sum of its variables is even.
    fn finish(&mut self, query: u64, portion: usize) -> Vec<String> {
        loop {
            match self.database.step(query, &mut Effort::of(portion * ITEM)).unwrap() {
                Ok(Progress::More) => {}
                Ok(Progress::Done) => break,
                Ok(Progress::Test(_, bindings)) => {
                    let sum: i64 = bindings.iter().filter_map(|(_, Term(value))| value.as_fixnum()).sum();
                    self.database.tell(query, sum % 2 == 0);
                }
                Err(error) => return vec![format!("{error:?}").split('(').next().unwrap().to_owned()],
            }
        }
        let mut all = Vec::new();
        loop {
            let heap = &mut self.heap;
            let mut list = self.database.answers(heap, query, &mut 0).unwrap().unwrap();
            if list.is_nil() {
                break;
            }
            while let Some(pair) = self.heap.as_cons(list) {
                all.push(describe(&self.heap, pair.car));
                list = pair.cdr;
            }
        }
        self.database.close(&mut self.heap, query);
        all
    }

    fn query(&mut self, text: &str) -> Vec<String> {
        let query = self.open(text);
        self.finish(query, 1000)
    }

    fn retract_all(&mut self, text: &str) -> Vec<String> {
        let pattern = self.read(text);
        let heap = &mut self.heap;
        let query = self.database.open(heap, pattern, Value::NIL, true, &mut 0).unwrap();
        while self.database.step(query, &mut Effort::of(7 * ITEM)) != Some(Ok(Progress::Done)) {}
        let mut all = Vec::new();
        loop {
            let heap = &mut self.heap;
            let fact = self.database.retract_next(heap, query, &mut 0).unwrap().unwrap();
            if fact.is_nil() {
                break;
            }
            all.push(describe(&self.heap, fact));
        }
        self.database.close(&mut self.heap, query);
        all
    }
}

#[track_caller]
fn check(facts: &str, query: &str, expected: &[&str]) {
    let mut fixture = Fixture::new();
    for fact in facts.split(';') {
        fixture.assert(fact);
    }
    assert_eq!(fixture.query(query), expected, "{query}");
}

#[test]
fn a_set_of_facts() {
    let mut fixture = Fixture::new();
    assert!(fixture.assert("(p 1 (2 x) \"s\" 0.5)"));
    assert!(!fixture.assert("(p 1 (2 x) \"s\" 0.5)"));
    assert!(fixture.assert("(p 1 (2 x) \"t\" 0.5)"));
    assert!(fixture.retract("(p 1 (2 x) \"s\" 0.5)"));
    assert!(!fixture.retract("(p 1 (2 x) \"s\" 0.5)"));
    assert_eq!(fixture.query("(p ?a ?b ?c ?d)").len(), 1);
}

#[test]
fn patterns_bind_variables() {
    let facts = "(at rover (loc 1 2));(at base (loc 0 0));(at base here);(ready)";
    check(facts, "(at base (loc ?x ?y))", &["((?X . 0) (?Y . 0))"]);
    check(facts, "(at ?w (loc ?x ?x))", &["((?W . BASE) (?X . 0))"]);
    check(
        facts,
        "(at ?w (?k . ?rest))",
        &["((?W . ROVER) (?K . LOC) (?REST 1 2))", "((?W . BASE) (?K . LOC) (?REST 0 0))"],
    );
    check(facts, "(ready)", &["NIL"]);
    check(facts, "(unready)", &[]);
    check(facts, "(at ? ?)", &["NIL"]);
    check(
        facts,
        "(?r . ?args)",
        &[
            "((?R . AT) (?ARGS ROVER (LOC 1 2)))",
            "((?R . AT) (?ARGS BASE (LOC 0 0)))",
            "((?R . AT) (?ARGS BASE HERE))",
            "((?R . READY) (?ARGS))",
        ],
    );
    check("(p (f 1) 1);(p (f 1) 2)", "(p (f ?x) ?x)", &["((?X . 1))"]);
}

#[test]
fn formulas_combine() {
    let facts = "(n 1);(n 2);(n 3);(n 4);(odd 1);(odd 3);(big 3);(big 4)";
    check(facts, "(and (n ?x) (not (odd ?x)))", &["((?X . 2))", "((?X . 4))"]);
    check(facts, "(and (not (odd ?x)) (n ?x))", &["((?X . 2))", "((?X . 4))"]);
    check(facts, "(or (big ?x) (odd ?x))", &["((?X . 3))", "((?X . 4))", "((?X . 1))"]);
    check(facts, "(and (test 0 ?x) (n ?x))", &["((?X . 2))", "((?X . 4))"]);
    check(
        facts,
        "(and (n ?x) (n ?y) (test 0 ?x ?y) (big ?x) (big ?y))",
        &["((?X . 3) (?Y . 3))", "((?X . 4) (?Y . 4))"],
    );
    check(facts, "(not (not (n 1)))", &["NIL"]);
    // Only one alternative binds what the negation shares with the pattern behind it.
    check(
        facts,
        "(and (or (none ?x) (big ?y)) (and (not (odd ?x)) (n ?x)))",
        &["((?X . 2) (?Y . 3))", "((?X . 4) (?Y . 3))", "((?X . 2) (?Y . 4))", "((?X . 4) (?Y . 4))"],
    );
    check(facts, "(and)", &["NIL"]);
    check(facts, "(or)", &[]);
}

#[test]
fn the_order_of_answers_does_not_depend_on_the_plan() {
    let mut fixture = Fixture::new();
    for x in 0..30 {
        fixture.assert(&format!("(a {x} {})", x % 3));
        fixture.assert(&format!("(b {} {x})", x % 3));
    }
    fixture.assert("(c 2)");
    fixture.assert("(c 1)");
    let joined = fixture.query("(and (a ?x ?k) (b ?k ?y) (c ?k))");
    let mut expected = Vec::new();
    for x in 0..30 {
        for y in 0..30 {
            if x % 3 == y % 3 && x % 3 != 0 {
                expected.push(format!("((?X . {x}) (?K . {}) (?Y . {y}))", x % 3));
            }
        }
    }
    assert_eq!(joined, expected);
}

#[test]
fn a_query_sees_what_was_there_when_it_began() {
    let mut fixture = Fixture::new();
    for x in 0..20 {
        fixture.assert(&format!("(n {x})"));
    }
    let query = fixture.open("(and (n ?x) (n ?x))");
    _ = fixture.database.step(query, &mut Effort::of(5 * ITEM));
    for x in 0..20 {
        fixture.retract(&format!("(n {x})"));
        fixture.assert(&format!("(n {})", x + 100));
    }
    assert!(fixture.query("(n 5)").is_empty());
    let answers = fixture.finish(query, 3);
    let expected: Vec<String> = (0..20).map(|x| format!("((?X . {x}))")).collect();
    assert_eq!(answers, expected);
    assert_eq!(fixture.query("(n ?x)").len(), 20);
}

#[test]
fn what_has_ended_is_given_back() {
    let mut fixture = Fixture::new();
    for x in 0..2000 {
        fixture.assert(&format!("(state rover (at {x} \"somewhere\"))"));
        fixture.retract(&format!("(state rover (at {x} \"somewhere\"))"));
        if x == 100 {
            let query = fixture.open("(state ?a ?b)");
            fixture.finish(query, 10);
        }
    }
    fixture.query("(state ?a ?b)");
    assert!(fixture.database.terms.kept() < 20, "{}", fixture.database.terms.kept());
    assert!(fixture.database.footprint() < 4000, "{}", fixture.database.footprint());
}

#[test]
fn retracting_by_pattern() {
    let mut fixture = Fixture::new();
    for fact in ["(p 1 2)", "(p 2 2)", "(p 1 3)", "(q 1 2)"] {
        fixture.assert(fact);
    }
    assert_eq!(fixture.retract_all("(p 1 ?x)"), ["(P 1 2)", "(P 1 3)"]);
    assert_eq!(fixture.retract_all("(?r ?x 2)"), ["(P 2 2)", "(Q 1 2)"]);
    assert_eq!(fixture.query("(?r ?x ?y)"), [""; 0]);
}

#[test]
fn properties_have_one_value() {
    let mut fixture = Fixture::new();
    let name = fixture.read("power");
    for fact in ["(power camera 0)", "(power heater 0)", "(power)"] {
        fixture.assert(fact);
    }
    assert!(fixture.database.define_property(&mut fixture.heap, name, 2, &mut 0).unwrap());
    for value in 0..50 {
        assert_eq!(fixture.assert(&format!("(power camera {value})")), value > 0);
        assert_eq!(fixture.query("(power camera ?x)"), [format!("((?X . {value}))")]);
    }
    assert_eq!(fixture.query("(power heater ?x)"), ["((?X . 0))"]);
    let of_camera = fixture.read("(power camera)");
    let value = fixture.database.property_value(&mut fixture.heap, of_camera, &mut 0).unwrap();
    assert_eq!(value, Value::small(49));
    fixture.retract("(power camera 49)");
    let value = fixture.database.property_value(&mut fixture.heap, of_camera, &mut 0).unwrap();
    assert_eq!(value, Value::UNBOUND);
}

#[test]
fn rules_in_any_order_end() {
    let bodies = [
        ["(edge ?x ?y)", "(and (edge ?x ?z) (path ?z ?y))"],
        ["(and (path ?x ?z) (edge ?z ?y))", "(edge ?x ?y)"],
        ["(edge ?x ?y)", "(and (path ?x ?z) (path ?z ?y))"],
    ];
    for rules in bodies {
        let mut fixture = Fixture::new();
        for body in rules {
            fixture.rule("(path ?x ?y)", body);
        }
        for edge in ["(edge 1 2)", "(edge 2 3)", "(edge 3 1)", "(edge 4 4)"] {
            fixture.assert(edge);
        }
        let mut from_one = fixture.query("(path 1 ?y)");
        from_one.sort();
        assert_eq!(from_one, ["((?Y . 1))", "((?Y . 2))", "((?Y . 3))"], "{rules:?}");
        assert_eq!(fixture.query("(path ?x ?y)").len(), 10, "{rules:?}");
        assert_eq!(fixture.query("(path ?x ?x)").len(), 4, "{rules:?}");
        assert_eq!(fixture.query("(and (edge ?x ?y) (not (path ?y 1)))"), ["((?X . 4) (?Y . 4))"]);
        assert_eq!(fixture.query("(path 1 4)"), [""; 0]);
        assert_eq!(fixture.query("(?r 4 ?x)"), ["((?R . EDGE) (?X . 4))", "((?R . PATH) (?X . 4))"]);
    }
}

#[test]
fn negation_in_rules() {
    let mut fixture = Fixture::new();
    fixture.rule("(reaches ?x ?y)", "(edge ?x ?y)");
    fixture.rule("(reaches ?x ?y)", "(and (reaches ?x ?z) (edge ?z ?y))");
    fixture.rule("(cut-off ?x ?y)", "(and (node ?x) (node ?y) (not (reaches ?x ?y)))");
    fixture.rule("(well ?x)", "(and (node ?x) (not (cut-off ?x 3)))");
    for fact in ["(node 1)", "(node 2)", "(node 3)", "(edge 1 2)", "(edge 2 3)"] {
        fixture.assert(fact);
    }
    assert_eq!(fixture.query("(well ?x)"), ["((?X . 1))", "((?X . 2))"]);
    assert_eq!(fixture.query("(cut-off 3 ?y)").len(), 3);
    fixture.rule("(win ?x)", "(and (edge ?x ?y) (not (win ?y)))");
    assert_eq!(fixture.query("(win ?x)"), ["Circular"]);
    fixture.rule("(open ?x ?y)", "(node ?x)");
    assert_eq!(fixture.query("(open 1 ?y)"), ["Unbound"]);
    assert_eq!(fixture.query("(open 1 7)"), ["NIL"]);
}
