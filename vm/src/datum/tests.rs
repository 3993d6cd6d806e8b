use super::*;
use esl_bytecode::BigInt;
use esl_bytecode::properties::PropertyValue;
use esl_bytecode::span::SourceId;

use crate::equality::KeyTest;
use crate::table::{KeyComparison, Table};

struct Fixture {
    heap: Heap,
    names: Names,
    unit: Unit,
}

impl Fixture {
    fn new() -> Fixture {
        let mut heap = crate::trust::heap_for_tests();
        let names = Names::new(&mut heap).unwrap();
        Fixture { heap, names, unit: Unit::default() }
    }

    fn value_of(&mut self, datum: &Datum) -> Value {
        self.unit.value_of(&mut self.heap, &mut self.names, datum).unwrap()
    }

    fn datum_of(&mut self, value: Value) -> Result<Datum, DatumError> {
        self.unit.datum_of(&self.heap, &self.names, value, at(99))
    }
}

fn at(start: u32) -> Span {
    Span::new(SourceId(0), start, start + 1)
}

fn int(n: i64, start: u32) -> Datum {
    Datum::integer(n, at(start))
}

#[test]
fn data_survive_both_ways() {
    let big: BigInt = BigInt::from(7) << 100;
    let kinds = [
        DatumKind::Nil,
        DatumKind::Symbol(Symbol::cl("CAR")),
        DatumKind::Symbol(Symbol::cl("T")),
        DatumKind::Symbol(Symbol::keyword("KEY")),
        DatumKind::Integer((-5).into()),
        DatumKind::Integer(big.clone().into()),
        DatumKind::Integer((-big.clone()).into()),
        DatumKind::Ratio(BigInt::from(-1), big),
        DatumKind::Float(1e300),
        DatumKind::Float(-0.0),
        DatumKind::Character('λ'),
        DatumKind::String("text".into()),
        DatumKind::Vector([int(1, 0), int(2, 0)].into()),
        DatumKind::Array([1, 2].into(), [int(1, 0), int(2, 0)].into()),
        DatumKind::Array([].into(), [int(1, 0)].into()),
    ];
    let datum = Datum::list(kinds.map(|kind| Datum::new(kind, at(3))), at(4));
    let mut there = Fixture::new();
    let value = there.value_of(&datum);
    // Another unit, so that nothing is remembered.
    there.unit = Unit::default();
    let back = there.datum_of(value).unwrap();
    assert_eq!(back.to_string(), datum.to_string());
    assert_eq!(back.span(), at(99));
}

#[test]
fn parts_that_are_passed_through_keep_their_spans() {
    let mut fixture = Fixture::new();
    let inner = Datum::list([int(1, 10), int(2, 11)], at(12));
    let form = Datum::list([Datum::symbol(Symbol::esl("M"), at(1)), inner.clone()], at(2));
    let value = fixture.value_of(&form);
    let argument = fixture.heap.car(fixture.heap.cdr(value).unwrap()).unwrap();
    let expansion = fixture.heap.list(&[Value::T, argument]).unwrap();
    let back = fixture.datum_of(expansion).unwrap();
    let items = back.as_list().unwrap();
    assert!(items[1].is_same(&inner));
    assert_eq!((back.span(), items[0].span()), (at(99), at(99)));
    // In the other direction, the same datum is the same object.
    assert_eq!(fixture.value_of(&inner), argument);
    assert_eq!(fixture.value_of(&back), expansion);
}

#[test]
fn a_changed_form_is_seen_as_it_is_now() {
    let mut fixture = Fixture::new();
    let form = Datum::list([int(1, 10), int(2, 11)], at(12));
    let value = fixture.value_of(&form);
    fixture.heap.set_car(value, Value::small(7)).unwrap();
    let back = fixture.datum_of(value).unwrap();
    assert_eq!((back.to_string().as_str(), back.span()), ("(7 2)", at(12)));
    let rest = back.as_cons().unwrap().1;
    assert!(rest.is_same(form.as_cons().unwrap().1));
}

#[test]
fn what_is_shared_stays_shared() {
    let mut fixture = Fixture::new();
    let shared = Datum::string("s", at(1));
    let pair = Datum::cons(shared.clone(), shared, at(2));
    let value = fixture.value_of(&pair);
    assert_eq!(fixture.heap.car(value), fixture.heap.cdr(value));
    let cell = fixture.heap.cons(Value::NIL, Value::NIL).unwrap();
    let twice = fixture.heap.list(&[cell, cell]).unwrap();
    let back = fixture.datum_of(twice).unwrap();
    let items = back.as_list().unwrap();
    assert!(items[0].is_same(items[1]));
}

#[test]
fn uninterned_symbols_and_objects_keep_their_identity() {
    let mut fixture = Fixture::new();
    let g = Datum::symbol(Symbol::uninterned(7, "G"), at(0));
    let again = Datum::symbol(Symbol::uninterned(7, "G"), at(5));
    let (first, second) = (fixture.value_of(&g), fixture.value_of(&again));
    assert_eq!(first, second);
    assert_eq!(fixture.datum_of(first).unwrap().as_symbol(), g.as_symbol());

    let name = fixture.heap.alloc_str("H").unwrap();
    let made = fixture.names.make_symbol(&mut fixture.heap, name, Value::NIL, 0).unwrap();
    let back = fixture.datum_of(made).unwrap();
    assert_eq!(fixture.value_of(&back), made);
    assert_ne!(back.as_symbol(), fixture.datum_of(first).unwrap().as_symbol());

    let table = fixture.heap.alloc_tag(Value::NIL).unwrap();
    let back = fixture.datum_of(table).unwrap();
    assert!(matches!(back.kind(), DatumKind::Object(_)));
    assert_eq!(fixture.value_of(&back), table);
}

#[test]
fn circular_objects_are_refused() {
    let mut fixture = Fixture::new();
    let cell = fixture.heap.cons(Value::T, Value::NIL).unwrap();
    fixture.heap.set_cdr(cell, cell).unwrap();
    assert_eq!(fixture.datum_of(cell).unwrap_err(), DatumError::Circular);
}

#[test]
fn depth_takes_no_native_stack() {
    let mut fixture = Fixture::new();
    let mut deep = Datum::nil(at(0));
    for _ in 0..200_000 {
        deep = Datum::list([deep], at(0));
    }
    let value = fixture.value_of(&deep);
    fixture.unit = Unit::default();
    let back = fixture.datum_of(value).unwrap();
    assert!(!back.is_nil());
}

#[test]
fn parts_of_data_from_the_host_stay_shared_and_are_walked_once() {
    let mut fixture = Fixture::new();
    let mut import = |datum: &Datum| import(&mut fixture.heap, &mut fixture.names, datum).unwrap();
    // As many leaves as no machine could walk, in conses and in vectors with the same elements.
    let mut conses = Datum::list([int(1, 0)], at(0));
    let mut vectors = conses.clone();
    for _ in 0..100 {
        conses = Datum::list([conses.clone(), conses], at(0));
        let items: Arc<[Datum]> = [vectors.clone(), vectors].into();
        let one = Datum::new(DatumKind::Vector(items.clone()), at(0));
        vectors = Datum::list([one, Datum::new(DatumKind::Vector(items), at(0))], at(0));
    }
    let (list, work) = import(&conses);
    assert!(work < 1000, "{work}");
    import(&vectors);
    let heap = &fixture.heap;
    assert_eq!(heap.car(list).unwrap(), heap.car(heap.cdr(list).unwrap()).unwrap());
}

#[test]
fn a_property_list_of_the_host_is_the_list_that_it_stands_for_and_costs_as_much() {
    let keys = |names: &[&str]| -> Arc<[Datum]> {
        names.iter().map(|name| Datum::symbol(Symbol::keyword(name), Span::default())).collect()
    };
    let make = || {
        let text = Datum::string("text", Span::default());
        let inner = Datum::properties(
            keys(&["X", "Y"]),
            vec![PropertyValue::Float(0.5), PropertyValue::Integer(i64::MIN)],
        );
        let values = vec![
            PropertyValue::Integer(-7),
            inner.clone().into(),
            text.into(),
            Datum::nil(Span::default()).into(),
            inner.into(),
        ];
        let outer = Datum::properties(keys(&["A", "B", "C", "D", "E"]), values);
        Datum::list([outer.clone(), outer], Span::default())
    };
    let mut fixture = Fixture::new();
    let (packed, listed) = (make(), make());
    // A datum whose text is asked for becomes a list.
    let inner = "(:X 0.5 :Y -9223372036854775808)";
    let outer = format!("(:A -7 :B {inner} :C \"text\" :D NIL :E {inner})");
    assert_eq!(listed.to_string(), format!("({outer} {outer})"));
    let mut import = |datum: &Datum| import(&mut fixture.heap, &mut fixture.names, datum).unwrap();
    let ((one, work), (other, work_of_list)) = (import(&packed), import(&listed));
    assert_eq!(work, work_of_list);
    assert_eq!(fixture.datum_of(one).unwrap().to_string(), fixture.datum_of(other).unwrap().to_string());
    // A datum that occurs twice is one object.
    for list in [one, other] {
        let heap = &fixture.heap;
        let first = heap.car(list).unwrap();
        assert_eq!(first, heap.car(heap.cdr(list).unwrap()).unwrap());
        let rest = (0..3).fold(first, |rest, _| heap.cdr(rest).unwrap());
        let last = (0..6).fold(rest, |rest, _| heap.cdr(rest).unwrap());
        assert_eq!(heap.car(rest).unwrap(), heap.car(last).unwrap());
    }
}

#[test]
fn tables_cross_the_border_with_their_entries() {
    let mut fixture = Fixture::new();
    let text = |text: &str| Datum::string(text, Span::default());
    let entries = [text("a"), int(1, 0), text("b"), Datum::list([int(2, 0)], at(0)), text("a"), int(3, 0)];
    let datum = Datum::new(DatumKind::Table(entries.into()), Span::default());
    let (table, work) = import(&mut fixture.heap, &mut fixture.names, &datum).unwrap();
    assert_eq!(work, 9);
    let (datum, work) = export(&fixture.heap, &fixture.names, table, |_, _| "other".into()).unwrap();
    assert_eq!((datum.to_string().as_str(), work), ("#<hash-table \"a\" 3 \"b\" (2)>", 7));
    let test = KeyComparison::Native(KeyTest::Equalp);
    let table = Table::make(&mut fixture.heap, test, 1, [Value::NIL; 2]).unwrap();
    let (datum, _) = export(&fixture.heap, &fixture.names, table, |_, _| "other".into()).unwrap();
    assert_eq!(datum.to_string(), "other");
    // One that contains itself.
    let test = KeyComparison::Native(KeyTest::Eql);
    let table = Table::make(&mut fixture.heap, test, 1, [Value::NIL; 2]).unwrap();
    Table::of(&fixture.heap, table).unwrap().add(&mut fixture.heap, 7, Value::T, table).unwrap();
    let refused = export(&fixture.heap, &fixture.names, table, |_, _| String::new());
    assert_eq!(refused.map(|(datum, _)| datum.to_string()), Err(DatumError::Circular));
}

#[test]
fn shared_and_circular_objects_are_seen_on_the_way_to_the_host() {
    let mut fixture = Fixture::new();
    let heap = &mut fixture.heap;
    // As many leaves as no machine could walk.
    let mut tree = heap.list(&[Value::T]).unwrap();
    for n in 0..100 {
        tree = match n % 2 {
            0 => heap.cons(tree, tree).unwrap(),
            _ => heap.alloc_vector(&[tree, tree, Value::NIL]).unwrap(),
        };
    }
    let (datum, work) = export(&fixture.heap, &fixture.names, tree, |_, _| String::new()).unwrap();
    assert!(work < 1000, "{work}");
    let DatumKind::Vector(items) = datum.kind() else { panic!("{datum}") };
    assert!(items[0].is_same(&items[1]));
    let pair = fixture.heap.cons(Value::T, Value::NIL).unwrap();
    fixture.heap.set_cdr(pair, pair).unwrap();
    assert_eq!(
        export(&fixture.heap, &fixture.names, pair, |_, _| String::new()).unwrap_err(),
        DatumError::Circular
    );
}
