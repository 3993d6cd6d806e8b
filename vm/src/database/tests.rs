//! Facts and queries against a model: a list of facts, and nested loops over it.

use std::collections::BTreeSet;

use esl_bytecode::symbol::Symbol;
use proptest::prelude::*;

use super::{Progress, Term};
use crate::value::Value;
use crate::vm::Vm;

/// A machine, with texts in place of values.
struct Fixture {
    vm: Vm,
}

impl Fixture {
    fn new() -> Fixture {
        let mut vm = Vm::for_tests();
        if let Some(objects) = vm.database.prepare(&mut vm.heap).unwrap() {
            vm.pin(objects);
        }
        Fixture { vm }
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
                    self.vm.heap.list_with_tail(&items, tail).unwrap()
                }
                "." => Value::EOF,
                "nil" => Value::NIL,
                word => match word.parse::<f64>() {
                    Ok(x) if word.contains('.') => self.vm.heap.float(x).unwrap(),
                    Ok(x) => Value::fixnum(x as i64).unwrap(),
                    Err(_) if word.starts_with('"') => {
                        self.vm.heap.alloc_str(word.trim_matches('"')).unwrap()
                    }
                    Err(_) => {
                        let symbol = Symbol::esl(&word.to_uppercase());
                        self.vm.world.intern(&mut self.vm.heap, &symbol).unwrap()
                    }
                },
            };
            lists.last_mut().unwrap().push(item);
        }
        lists[0][0]
    }

    fn assert(&mut self, text: &str) -> bool {
        let fact = self.read(text);
        self.vm.database.assert(&mut self.vm.heap, fact, &mut 0).unwrap().is_true()
    }

    fn retract(&mut self, text: &str) -> bool {
        let fact = self.read(text);
        self.vm.database.retract(&mut self.vm.heap, fact, &mut 0).unwrap()
    }

    fn rule(&mut self, head: &str, body: &str) {
        let parts = [self.read(head), self.read(body), self.read(&format!("({head} {body})"))];
        self.vm.database.define_rule(&mut self.vm.heap, parts, &mut 0).unwrap();
    }

    fn open(&mut self, text: &str) -> u64 {
        let query = self.read(text);
        self.vm.database.open(&mut self.vm.heap, query, Value::NIL, false, &mut 0).unwrap()
    }

    /// Finds all answers in steps of `portion`; a test holds if the sum of its variables is even.
    fn finish(&mut self, query: u64, portion: usize) -> Vec<String> {
        loop {
            let mut work = portion;
            match self.vm.database.step(query, &mut work).unwrap() {
                Ok(Progress::More) => {}
                Ok(Progress::Done) => break,
                Ok(Progress::Test(_, bindings)) => {
                    let sum: i64 = bindings.iter().filter_map(|(_, Term(value))| value.as_fixnum()).sum();
                    self.vm.database.tell(query, sum % 2 == 0);
                }
                Err(error) => return vec![format!("{error:?}").split('(').next().unwrap().to_owned()],
            }
        }
        let mut all = Vec::new();
        loop {
            let heap = &mut self.vm.heap;
            let mut list = self.vm.database.answers(heap, query, &mut 0).unwrap().unwrap();
            if list.is_nil() {
                break;
            }
            while let Some(pair) = self.vm.heap.as_cons(list) {
                all.push(self.vm.describe(pair.car));
                list = pair.cdr;
            }
        }
        self.vm.database.close(&mut self.vm.heap, query);
        all
    }

    fn query(&mut self, text: &str) -> Vec<String> {
        let query = self.open(text);
        self.finish(query, 1000)
    }

    fn retract_all(&mut self, text: &str) -> Vec<String> {
        let pattern = self.read(text);
        let heap = &mut self.vm.heap;
        let query = self.vm.database.open(heap, pattern, Value::NIL, true, &mut 0).unwrap();
        while self.vm.database.step(query, &mut 7) != Some(Ok(Progress::Done)) {}
        let mut all = Vec::new();
        loop {
            let heap = &mut self.vm.heap;
            let fact = self.vm.database.retract_next(heap, query, &mut 0).unwrap().unwrap();
            if fact.is_nil() {
                break;
            }
            all.push(self.vm.describe(fact));
        }
        self.vm.database.close(&mut self.vm.heap, query);
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
    _ = fixture.vm.database.step(query, &mut 5);
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
    assert!(fixture.vm.database.terms.kept() < 20, "{}", fixture.vm.database.terms.kept());
    assert!(fixture.vm.database.footprint() < 4000, "{}", fixture.vm.database.footprint());
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
    assert!(fixture.vm.database.define_property(&mut fixture.vm.heap, name, 2, &mut 0).unwrap());
    for value in 0..50 {
        assert_eq!(fixture.assert(&format!("(power camera {value})")), value > 0);
        assert_eq!(fixture.query("(power camera ?x)"), [format!("((?X . {value}))")]);
    }
    assert_eq!(fixture.query("(power heater ?x)"), ["((?X . 0))"]);
    let of_camera = fixture.read("(power camera)");
    let value = fixture.vm.database.property_value(&mut fixture.vm.heap, of_camera, &mut 0).unwrap();
    assert_eq!(value, Value::small(49));
    fixture.retract("(power camera 49)");
    let value = fixture.vm.database.property_value(&mut fixture.vm.heap, of_camera, &mut 0).unwrap();
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

// ---- the model

#[derive(Clone, Debug)]
enum Part {
    Variable(usize),
    Any,
    Number(u8),
}

#[derive(Clone, Debug)]
enum Question {
    Pattern(&'static str, Vec<Part>),
    And(Vec<Question>),
    Or(Vec<Question>),
    Not(Box<Question>),
}

type Row = [Option<u8>; 3];
type Fact = (&'static str, Vec<u8>);

impl Question {
    fn text(&self) -> String {
        let all = |word: &str, parts: &[Question]| {
            let parts: Vec<String> = parts.iter().map(Question::text).collect();
            format!("({word} {})", parts.join(" "))
        };
        match self {
            Question::Pattern(name, parts) => {
                let parts = parts.iter().map(|part| match part {
                    Part::Variable(number) => format!("?v{number}"),
                    Part::Any => "?".into(),
                    Part::Number(n) => n.to_string(),
                });
                format!("({name} {})", parts.collect::<Vec<_>>().join(" "))
            }
            Question::And(parts) => all("and", parts),
            Question::Or(parts) => all("or", parts),
            Question::Not(inside) => format!("(not {})", inside.text()),
        }
    }

    /// Returns all answers, in the order of nested loops; negations come last.
    fn solve(&self, facts: &[Fact], row: Row) -> Vec<Row> {
        match self {
            Question::Pattern(name, parts) => {
                let fits = |(other, cells): &&Fact| other == name && cells.len() == parts.len();
                let matches = facts.iter().filter(fits).filter_map(|(_, cells)| {
                    let mut row = row;
                    for (part, &cell) in parts.iter().zip(cells) {
                        match part {
                            Part::Variable(v) if row[*v].is_none() => row[*v] = Some(cell),
                            Part::Variable(v) if row[*v] != Some(cell) => return None,
                            Part::Number(n) if *n != cell => return None,
                            _ => {}
                        }
                    }
                    Some(row)
                });
                matches.collect()
            }
            Question::And(parts) => {
                let (negations, others): (Vec<_>, Vec<_>) =
                    parts.iter().partition(|part| matches!(part, Question::Not(_)));
                let mut rows = vec![row];
                for part in others.into_iter().chain(negations) {
                    rows = rows.into_iter().flat_map(|row| part.solve(facts, row)).collect();
                }
                rows
            }
            Question::Or(parts) => parts.iter().flat_map(|part| part.solve(facts, row)).collect(),
            Question::Not(inside) if inside.solve(facts, row).is_empty() => vec![row],
            Question::Not(_) => Vec::new(),
        }
    }

    /// Appends the variables in the order of the text.
    fn variables(&self, seen: &mut Vec<usize>) {
        match self {
            Question::Pattern(_, parts) => {
                for part in parts {
                    if let Part::Variable(v) = part
                        && !seen.contains(v)
                    {
                        seen.push(*v);
                    }
                }
            }
            Question::And(parts) | Question::Or(parts) => parts.iter().for_each(|part| part.variables(seen)),
            Question::Not(inside) => inside.variables(seen),
        }
    }

    fn answers(&self, facts: &[Fact]) -> Vec<String> {
        let mut order = Vec::new();
        self.variables(&mut order);
        let mut seen = BTreeSet::new();
        let rows = self.solve(facts, [None; 3]).into_iter().filter(|row| seen.insert(*row));
        let shown = rows.map(|row| {
            let named = order.iter().filter_map(|&v| Some(format!("(?V{v} . {})", row[v]?)));
            let bindings = named.collect::<Vec<_>>().join(" ");
            if bindings.is_empty() { "NIL".into() } else { format!("({bindings})") }
        });
        shown.collect()
    }
}

fn part() -> impl Strategy<Value = Part> {
    prop_oneof![
        4 => (0usize..3).prop_map(Part::Variable),
        1 => Just(Part::Any),
        1 => (0u8..5).prop_map(Part::Number),
    ]
}

fn question() -> impl Strategy<Value = Question> {
    let pattern = prop_oneof![
        prop::collection::vec(part(), 2).prop_map(|parts| Question::Pattern("p", parts)),
        prop::collection::vec(part(), 2).prop_map(|parts| Question::Pattern("q", parts)),
        prop::collection::vec(part(), 1).prop_map(|parts| Question::Pattern("r", parts)),
        prop::collection::vec(part(), 3).prop_map(|parts| Question::Pattern("p", parts)),
    ];
    pattern.prop_recursive(3, 8, 3, |inside| {
        prop_oneof![
            3 => prop::collection::vec(inside.clone(), 1..4).prop_map(Question::And),
            1 => prop::collection::vec(inside.clone(), 1..3).prop_map(Question::Or),
            1 => inside.prop_map(|inside| Question::Not(Box::new(inside))),
        ]
    })
}

fn fact() -> impl Strategy<Value = Fact> {
    prop_oneof![
        prop::collection::vec(0u8..5, 2).prop_map(|cells| ("p", cells)),
        prop::collection::vec(0u8..5, 2).prop_map(|cells| ("q", cells)),
        prop::collection::vec(0u8..5, 1).prop_map(|cells| ("r", cells)),
        prop::collection::vec(0u8..3, 3).prop_map(|cells| ("p", cells)),
    ]
}

fn text_of((name, cells): &Fact) -> String {
    let cells: Vec<String> = cells.iter().map(u8::to_string).collect();
    format!("({name} {})", cells.join(" "))
}

proptest! {
    #[test]
    fn queries_agree_with_the_model(
        changes in prop::collection::vec((0u8..4, fact()), 0..60),
        first in question(),
        second in question(),
        meanwhile in prop::collection::vec((any::<bool>(), fact()), 0..20),
        portion in 1usize..40,
    ) {
        let mut fixture = Fixture::new();
        let mut facts: Vec<Fact> = Vec::new();
        let change = |fixture: &mut Fixture, facts: &mut Vec<Fact>, adds: bool, fact: Fact| {
            let known = facts.iter().position(|other| *other == fact);
            if adds {
                assert_eq!(fixture.assert(&text_of(&fact)), known.is_none());
                if known.is_none() {
                    facts.push(fact);
                }
            } else {
                assert_eq!(fixture.retract(&text_of(&fact)), known.is_some());
                known.map(|at| facts.remove(at));
            }
        };
        for (kind, fact) in changes {
            change(&mut fixture, &mut facts, kind > 0, fact);
        }
        let before = facts.clone();
        let query = fixture.open(&first.text());
        _ = fixture.vm.database.step(query, &mut portion.clone());
        for (adds, fact) in meanwhile {
            change(&mut fixture, &mut facts, adds, fact);
        }
        prop_assert_eq!(fixture.query(&second.text()), second.answers(&facts), "{}", second.text());
        prop_assert_eq!(fixture.finish(query, portion), first.answers(&before), "{}", first.text());
        prop_assert_eq!(fixture.query(&first.text()), first.answers(&facts), "{}", first.text());
    }

    #[test]
    fn closures_agree_with_the_model(
        edges in prop::collection::btree_set((0u8..8, 0u8..8), 0..24),
        shape in 0usize..3,
        portion in 1usize..40,
    ) {
        let mut fixture = Fixture::new();
        let bodies = [
            "(and (edge ?x ?z) (path ?z ?y))",
            "(and (path ?x ?z) (edge ?z ?y))",
            "(and (path ?x ?z) (path ?z ?y))",
        ];
        fixture.rule("(path ?x ?y)", bodies[shape]);
        fixture.rule("(path ?x ?y)", "(edge ?x ?y)");
        fixture.rule("(apart ?x ?y)", "(and (edge ?x ?) (edge ? ?y) (not (path ?x ?y)))");
        let mut path = edges.clone();
        for &(x, y) in &edges {
            fixture.assert(&format!("(edge {x} {y})"));
        }
        loop {
            let longer: BTreeSet<_> = path
                .iter()
                .flat_map(|&(x, z)| {
                    edges.iter().filter(move |&&(from, _)| from == z).map(move |&(_, y)| (x, y))
                })
                .collect();
            let size = path.len();
            path.extend(longer);
            if path.len() == size {
                break;
            }
        }
        let shown = |pairs: &BTreeSet<(u8, u8)>| -> BTreeSet<String> {
            pairs.iter().map(|(x, y)| format!("((?A . {x}) (?B . {y}))")).collect()
        };
        let query = fixture.open("(path ?a ?b)");
        let found = fixture.finish(query, portion);
        prop_assert_eq!(found.len(), path.len());
        prop_assert_eq!(found.into_iter().collect::<BTreeSet<_>>(), shown(&path));
        let from = fixture.query("(path 3 ?b)").len();
        prop_assert_eq!(from, path.iter().filter(|(x, _)| *x == 3).count());
        let to = fixture.query("(path ?a 3)").len();
        prop_assert_eq!(to, path.iter().filter(|(_, y)| *y == 3).count());
        let apart: BTreeSet<(u8, u8)> = edges
            .iter()
            .flat_map(|&(x, _)| edges.iter().map(move |&(_, y)| (x, y)))
            .filter(|pair| !path.contains(pair))
            .collect();
        let query = fixture.open("(apart ?a ?b)");
        let found = fixture.finish(query, portion);
        prop_assert_eq!(found.into_iter().collect::<BTreeSet<_>>(), shown(&apart));
    }
}
