//! Properties of all forms, sensible or not.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::NodeKind;
use esl_compiler::expand::{Expander, operator, print::print};
use proptest::prelude::*;

use crate::expand_form;
use crate::host::FakeHost;

fn symbols() -> impl Strategy<Value = Symbol> {
    let mut operators: Vec<Symbol> = operator::names().collect();
    operators.sort_by_key(|symbol| symbol.name().to_string());
    let words = [
        "&OPTIONAL",
        "&REST",
        "&KEY",
        "&BODY",
        "&WHOLE",
        "&AUX",
        "SPECIAL",
        "IGNORE",
        "CAR",
        "AREF",
        "T",
        "LIST",
    ];
    let others = ["X", "Y", "*X*", "F", "G", "WHEN", "TWICE", "WRONG", "FAILING", "POINT-Y", "FIRST-OF"];
    let user = |name: &str| Symbol::new(&esl_bytecode::symbol::USER_PACKAGE.into(), name);
    prop_oneof![
        3 => prop::sample::select(operators),
        2 => prop::sample::select(words.map(Symbol::cl).to_vec()),
        3 => prop::sample::select(others.map(user).to_vec()),
        1 => prop::sample::select(["EXECUTE", "K", "TEST"].map(Symbol::keyword).to_vec()),
    ]
}

/// Data of the shapes that forms have: most lists begin with an operator.
fn data() -> impl Strategy<Value = Datum> {
    let place = Span::new(SourceId(0), 1, 2);
    let leaf = prop_oneof![
        6 => symbols().prop_map(move |symbol| Datum::symbol(symbol, place)),
        1 => Just(Datum::nil(place)),
        1 => (-2..3_i32).prop_map(move |value| Datum::integer(value, place)),
        1 => Just(Datum::string("text", place)),
    ];
    leaf.prop_recursive(6, 120, 6, move |inner| {
        let items = prop::collection::vec(inner.clone(), 0..6);
        prop_oneof![
            8 => (symbols(), items.clone()).prop_map(move |(symbol, items)| {
                Datum::list(std::iter::once(Datum::symbol(symbol, place)).chain(items).collect::<Vec<_>>(), place)
            }),
            4 => items.clone().prop_map(move |items| Datum::list(items, place)),
            1 => (items.clone(), inner).prop_map(move |(items, tail)| Datum::list_with_tail(items, tail, place)),
            1 => items.prop_map(move |items| Datum::new(DatumKind::Vector(items.into()), place)),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3_000, ..ProptestConfig::default() })]

    #[test]
    fn any_datum_expands_to_sound_chunks_or_is_refused(datum in data()) {
        let mut host = FakeHost::new();
        let mut expander = Expander::new();
        let chunks = expand_form(&mut expander, &mut host, datum);
        for chunk in &chunks {
            check(&chunk.core);
        }
        // The next form is not disturbed by what was wrong with this one.
        let form = host.read("(vector (untouched 1))");
        let chunks = expand_form(&mut expander, &mut host, form);
        prop_assert_eq!(print(&chunks[0].core), "(vector (untouched 1))");
        prop_assert!(esl_compiler::lower::lower(&chunks[0].core, &esl_compiler::lower::SourceLines::new()).is_ok());
    }

    #[test]
    fn what_expands_can_be_lowered(datum in data()) {
        let mut host = FakeHost::new();
        let chunks = expand_form(&mut Expander::new(), &mut host, datum);
        for chunk in &chunks {
            if let Ok(module) = esl_compiler::lower::lower(&chunk.core, &esl_compiler::lower::SourceLines::new()) {
                let verified = esl_bytecode::verify::verify(&module);
                prop_assert!(verified.is_ok(), "{:?}\n{}", verified, print(&chunk.core));
            }
        }
    }
}

/// The invariants of the core language: no holes, each node referred to once, by one with a lower number.
fn check(core: &esl_compiler::core::Core) {
    for node in &core.nodes {
        assert!(!matches!(node.kind, NodeKind::Hole), "a hole is left: {}", print(core));
    }
    assert!(!print(core).contains("%hole"));
}
