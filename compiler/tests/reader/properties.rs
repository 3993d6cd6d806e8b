//! Properties of every text and every datum.

use esl_bytecode::BigInt;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::package::{CL_NAMES, PackageId, Packages};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_compiler::reader::lexer::Token;
use esl_compiler::reader::read_anything;
use logos::Logos;
use proptest::prelude::*;

use crate::{read_all, read_one, show};

/// Texts of pieces that mean something to the reader, in any order.
fn tokens() -> impl Strategy<Value = String> {
    let piece = prop::sample::select(vec![
        "(", ")", "(", ")", " ", "\n", "\n(", ".", "'", "`", ",", ",@", "#'", "#(", "#2A", "#1=", "#1#",
        "#2=", "#2#", "#+", "#-", "esl", "sbcl", "(or ", "(not ", "a", "b:c", "cl:car", ":k", "|", "\\",
        "\"", ";", "#|", "|#", "#\\", "#\\a", "#x1F", "1/2", "1.5e3", "#.", "#S", "#*01", "#p", "#c", "#:g",
        "#?x", "#<", ">", "\0", "\u{a0}", "é", "#", "#3(",
    ]);
    prop::collection::vec(piece, 0..60).prop_map(|pieces| pieces.concat())
}

fn symbols() -> impl Strategy<Value = Symbol> {
    let name = prop_oneof![
        "[A-Z+*/<>=?!-]{1,6}",
        "[a-zA-Z0-9 ().|\\\\:#'\",;éßλ\u{a0}\u{0}-]{0,6}",
        "[0-9+./e-]{1,5}",
    ];
    (name, 0..4_u8, prop::sample::select(CL_NAMES.to_vec())).prop_map(|(name, package, cl)| {
        let in_package = |package| Packages::standard().intern(package, &name).0;
        match package {
            0 => Symbol::keyword(&name),
            1 => Symbol::cl(cl),
            2 => in_package(PackageId::ESL),
            _ => in_package(PackageId::USER),
        }
    })
}

fn atoms() -> impl Strategy<Value = Datum> {
    let span = Span::default();
    prop_oneof![
        Just(Datum::nil(span)),
        symbols().prop_map(move |symbol| Datum::symbol(symbol, span)),
        any::<i128>().prop_map(move |value| Datum::integer(value, span)),
        (any::<i32>(), 2..9_i32).prop_map(move |(n, d)| {
            let ratio = DatumKind::Ratio(BigInt::from(n), BigInt::from(d));
            // A numerator that divides evenly would not be in lowest terms.
            let coprime = (2..=d).all(|k| n % k != 0 || d % k != 0);
            if coprime { Datum::new(ratio, span) } else { Datum::integer(n, span) }
        }),
        any::<f64>()
            .prop_filter("finite", |value| value.is_finite())
            .prop_map(move |value| Datum::new(DatumKind::Float(value), span)),
        any::<char>().prop_map(move |c| Datum::new(DatumKind::Character(c), span)),
        any::<String>().prop_map(move |value| Datum::string(&value, span)),
    ]
}

fn data() -> impl Strategy<Value = Datum> {
    let span = Span::default();
    atoms().prop_recursive(5, 60, 6, move |inner| {
        let items = || prop::collection::vec(inner.clone(), 0..6);
        let mark = prop::sample::select(vec![
            Symbol::cl("QUOTE"),
            Symbol::cl("FUNCTION"),
            Symbol::esl("%BACKQUOTE"),
            Symbol::esl("%UNQUOTE"),
            Symbol::esl("%UNQUOTE-SPLICING"),
            Symbol::esl("LOGICAL-VALUE"),
        ]);
        prop_oneof![
            items().prop_map(move |items| Datum::list(items, span)),
            (items(), inner.clone()).prop_map(move |(items, tail)| Datum::list_with_tail(items, tail, span)),
            items().prop_map(move |items| Datum::new(DatumKind::Vector(items.into()), span)),
            prop::collection::vec(inner.clone(), 6)
                .prop_map(move |items| Datum::new(DatumKind::Array([2, 3].into(), items.into()), span)),
            inner.clone().prop_map(move |item| Datum::new(DatumKind::Array([].into(), [item].into()), span)),
            (mark, inner.clone())
                .prop_map(move |(mark, item)| Datum::list([Datum::symbol(mark, span), item], span)),
        ]
    })
}

/// Whether both denote the same, wherever they were written.
fn same(a: &Datum, b: &Datum) -> bool {
    let all = |a: &[Datum], b: &[Datum]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b));
    match (a.kind(), b.kind()) {
        (DatumKind::Nil, DatumKind::Nil) => true,
        (DatumKind::Symbol(a), DatumKind::Symbol(b)) => a == b,
        (DatumKind::Integer(a), DatumKind::Integer(b)) => a == b,
        (DatumKind::Ratio(a, b), DatumKind::Ratio(c, d)) => a == c && b == d,
        (DatumKind::Float(a), DatumKind::Float(b)) => a.to_bits() == b.to_bits(),
        (DatumKind::Character(a), DatumKind::Character(b)) => a == b,
        (DatumKind::String(a), DatumKind::String(b)) => a == b,
        (DatumKind::Cons(a, b), DatumKind::Cons(c, d)) => same(a, c) && same(b, d),
        (DatumKind::Vector(a), DatumKind::Vector(b)) => all(a, b),
        (DatumKind::Array(a, b), DatumKind::Array(c, d)) => a == c && all(b, d),
        _ => false,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_read_without_panic(bytes: Vec<u8>) {
        read_anything(&bytes);
    }

    #[test]
    fn any_text_is_read_without_panic(text: String) {
        read_anything(text.as_bytes());
    }

    #[test]
    fn any_tokens_are_read_without_panic(text in tokens()) {
        read_anything(text.as_bytes());
    }

    #[test]
    fn diagnostics_lie_within_the_text(text in tokens()) {
        for error in read_all(&text).into_iter().filter_map(Result::err) {
            for label in error.secondary.iter().chain([&error.primary]) {
                let (start, end) = (label.span.start as usize, label.span.end as usize);
                prop_assert!(text.get(start..end).is_some(), "{error:?}");
            }
            prop_assert!(error.message.chars().count() < 200);
        }
    }

    #[test]
    fn tokens_come_in_order_and_leave_out_only_blanks_and_comments(text in tokens()) {
        let mut at = 0;
        for (_, span) in Token::lexer(&text).spanned() {
            prop_assert!(span.start >= at && span.end > span.start);
            let between = text[at..span.start].trim_start();
            prop_assert!(between.is_empty() || between.starts_with([';', '#']), "{between:?}");
            at = span.end;
        }
    }

    #[test]
    fn a_datum_printed_and_read_is_the_same(datum in data()) {
        let text = show(&datum);
        prop_assert!(same(&read_one(&text), &datum), "{}", text);
    }
}
