use super::*;

#[test]
fn a_deep_datum_is_dropped_without_native_recursion() {
    let span = Span::default();
    let mut deep = Datum::nil(span);
    for _ in 0..1_000_000 {
        deep = Datum::list([deep], span);
    }
    let mut vectors = Datum::nil(span);
    for _ in 0..200_000 {
        vectors = Datum::new(DatumKind::Vector([vectors].into()), span);
    }
    drop(deep);
    drop(vectors);
}

#[test]
fn a_list_gives_its_elements_and_its_tail() {
    let span = Span::default();
    let dotted = Datum::list_with_tail([Datum::integer(1, span)], Datum::integer(2, span), span);
    assert!(dotted.as_list().is_none());
    assert_eq!(dotted.to_string(), "(1 . 2)");
    assert_eq!(Datum::symbol(Symbol::cl("NIL"), span).to_string(), "NIL");
}

#[test]
fn a_datum_that_becomes_another_leaves_others_as_they_are() {
    let text = |datum: &Datum| datum.to_string();
    let mut datum = Datum::list([Datum::integer(1, Span::default())], Span::default());
    let kept = datum.clone();
    datum.put(DatumKind::Integer(2.into()));
    assert_eq!((text(&datum), text(&kept)), ("2".into(), "(1)".into()));
    let node = datum.identity();
    datum.put(DatumKind::Integer(3.into()));
    assert_eq!((text(&datum), datum.identity()), ("3".into(), node));
    datum.put(DatumKind::Call(Datum::nil(Span::default())));
    assert!(datum.has_calls());
    let kept = datum.clone();
    datum.put(DatumKind::Float(0.5));
    assert_eq!((text(&datum), datum.has_calls(), kept.has_calls()), ("0.5".into(), false, true));
}
