//! The model: a list of facts, and nested loops over it.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::{Effort, Fixture, ITEM};

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
        _ = fixture.database.step(query, &mut Effort::of(portion * ITEM));
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
