//! Access to objects from safe code: what goes in comes out, and what does not fit is refused.

#![allow(unsafe_code, reason = "tests keep the promises that the heap asks of its owner")]

use esl_heap::heap::layout::{Array, CodeObject, Header, KINDS, SymbolObject};
use esl_heap::heap::{AllocError, CodeParts, Heap, HeapConfig, Kind};
use esl_heap::value::Value;

fn heap() -> Heap {
    // SAFETY: every test has one heap and keeps its values.
    unsafe { Heap::new(HeapConfig::default()) }
}

fn n(i: i32) -> Value {
    Value::small(i)
}

fn code(heap: &mut Heap, constants: &[Value], words: &[u32]) -> Value {
    let (name, debug, owner) = (n(1), n(2), n(3));
    let parts = CodeParts { name, debug, owner, arity: 2, nregs: 5, spare: [7, 8], constants, words };
    // SAFETY: this code is not run.
    unsafe { heap.alloc_code(parts) }.unwrap()
}

fn function(heap: &mut Heap) -> Value {
    let code = code(heap, &[], &[0]);
    // SAFETY: the code of this function is not run.
    unsafe { heap.alloc_function(code, &[n(10), n(11)]) }.unwrap()
}

fn symbol(heap: &mut Heap, name: &str) -> Value {
    let name = heap.alloc_str(name).unwrap();
    let function = function(heap);
    heap.alloc_symbol(SymbolObject::KEYWORD, name, n(9), function).unwrap()
}

/// One object of every kind, and a cons.
fn one_of_each(heap: &mut Heap) -> Vec<(Option<Kind>, Value)> {
    let vector = heap.alloc_vector(&[n(1), n(2)]).unwrap();
    let class = heap.alloc_record(Kind::Class, 0, 0, &[n(1)]).unwrap();
    let mut all = vec![(None, heap.cons(n(1), n(2)).unwrap())];
    // Only the machine itself makes hash tables, the words that they consist of, and what it has yet to fill.
    let is_internal = |kind: &Kind| {
        matches!(kind, Kind::HashTable | Kind::Words64 | Kind::UnfinishedVector | Kind::UnfinishedString)
    };
    for kind in KINDS.into_iter().filter(|kind| !is_internal(kind)) {
        let v = match kind {
            Kind::Symbol => symbol(heap, "car"),
            Kind::Function => function(heap),
            Kind::Box => heap.alloc_box(n(1)).unwrap(),
            Kind::Array => heap.alloc_array(Array::ADJUSTABLE, vector, n(1), &[n(2)]).unwrap(),
            Kind::Ratio => heap.alloc_ratio(n(1), n(2)).unwrap(),
            Kind::Complex => heap.alloc_complex(n(1), n(2)).unwrap(),
            Kind::Structure => heap.alloc_structure(class, &[n(5), n(6)]).unwrap(),
            Kind::Tag => heap.alloc_tag(n(1)).unwrap(),
            Kind::Code => code(heap, &[n(1)], &[1, 2, 3]),
            Kind::Float => heap.float(1e300).unwrap(),
            Kind::Bignum => heap.alloc_bignum(true, &[1, 2, 0]).unwrap(),
            Kind::String => heap.alloc_str("añ\u{10FFFF}").unwrap(),
            Kind::Words32 => heap.alloc_words(3, 7).unwrap(),
            Kind::Bytes => heap.alloc_bytes(b"abc").unwrap(),
            kind => heap.alloc_record(kind, 3, 4, &[n(1), n(2), n(3)]).unwrap(),
        };
        all.push((Some(kind), v));
    }
    all
}

#[test]
fn every_kind_is_itself_and_no_other() {
    let mut heap = heap();
    for (kind, v) in one_of_each(&mut heap) {
        assert_eq!(heap.kind(v), kind);
        let is = |k| kind == Some(k);
        assert_eq!(heap.as_cons(v).is_some(), kind.is_none());
        assert_eq!(heap.car(v).is_some(), kind.is_none());
        assert_eq!(heap.vector(v).is_some(), is(Kind::SimpleVector));
        assert_eq!(heap.string(v).is_some(), is(Kind::String));
        assert_eq!(heap.string_mut(v).is_some(), is(Kind::String));
        assert_eq!(heap.words(v).is_some(), is(Kind::Words32));
        assert_eq!(heap.bytes(v).is_some(), is(Kind::Bytes));
        assert_eq!(heap.bignum(v).is_some(), is(Kind::Bignum));
        assert_eq!(heap.ratio(v).is_some(), is(Kind::Ratio));
        assert_eq!(heap.symbol(v).is_some(), is(Kind::Symbol));
        assert_eq!(heap.function_code(v).is_some(), is(Kind::Function));
        assert_eq!(heap.code(v).is_some(), is(Kind::Code));
        assert_eq!(heap.array(v).is_some(), is(Kind::Array));
        assert_eq!(heap.structure_class(v).is_some(), is(Kind::Structure));
        assert_eq!(heap.as_double(v).is_some(), is(Kind::Float));
        for other in KINDS {
            assert_eq!(
                heap.record(v, other).is_some(),
                is(other) && other.is_record(),
                "{kind:?} as {other:?}"
            );
            assert_eq!(heap.flags(v, other).is_some(), is(other));
        }
    }
}

#[test]
fn what_is_no_object_is_refused() {
    let mut heap = heap();
    for v in [Value::T, n(1), Value::UNBOUND, Value::double(1.0).unwrap(), Value::handle(1, 1).unwrap()] {
        assert_eq!(heap.kind(v), None);
        assert_eq!((heap.car(v), heap.cdr(v)), (None, None));
        assert_eq!(heap.vector(v), None);
        assert_eq!(heap.vector_set(v, 0, v), None);
        assert_eq!((heap.set_car(v, v), heap.set_cdr(v, v)), (None, None));
        assert_eq!(heap.record_set(v, Kind::Box, 0, v), None);
    }
    assert_eq!((heap.car(Value::NIL), heap.cdr(Value::NIL)), (Some(Value::NIL), Some(Value::NIL)));
    assert_eq!(heap.set_car(Value::NIL, Value::T), None);
}

#[test]
fn slots_are_set_within_bounds_only() {
    let mut heap = heap();
    let cell = heap.cons(n(1), n(2)).unwrap();
    heap.set_car(cell, n(3)).unwrap();
    heap.set_cdr(cell, n(4)).unwrap();
    assert_eq!((heap.car(cell), heap.cdr(cell)), (Some(n(3)), Some(n(4))));

    let v = heap.alloc_vector_filled(3, Value::NIL).unwrap();
    assert_eq!(heap.vector_set(v, 2, n(1)), Some(()));
    assert_eq!(heap.vector_set(v, 3, n(1)), None);
    assert_eq!(heap.vector_set(v, usize::MAX, n(1)), None);
    assert_eq!(heap.vector(v), Some(&[Value::NIL, Value::NIL, n(1)][..]));

    let stream = heap.alloc_record_filled(Kind::Stream, 2, 4, Value::NIL).unwrap();
    assert_eq!(heap.record_set(stream, Kind::Stream, 3, n(1)), Some(()));
    assert_eq!(heap.record_set(stream, Kind::Stream, 4, n(1)), None);
    assert_eq!(heap.record_set(stream, Kind::Package, 0, n(1)), None);
    assert_eq!(heap.header(stream).map(|Header { aux, len, .. }| (aux, len)), Some((2, 4)));
    assert_eq!(heap.slots::<5>(stream, Kind::Stream), None);
    assert_eq!(heap.slots::<2>(stream, Kind::Package), None);
    assert_eq!(heap.slots_mut::<5>(stream, Kind::Stream), None);
    heap.slots_mut::<2>(stream, Kind::Stream).unwrap()[1] = n(2);
    assert_eq!(heap.slots::<4>(stream, Kind::Stream), Some(&[Value::NIL, n(2), Value::NIL, n(1)]));
    heap.set_aux(stream, Kind::Stream, 1).unwrap();
    heap.set_flags(stream, Kind::Stream, 9).unwrap();
    assert_eq!(heap.header(stream).map(|h| (h.aux, h.flags)), Some((1, 9)));

    let empty = heap.alloc_vector(&[]).unwrap();
    assert_eq!(heap.vector(empty), Some(&[][..]));
    assert_eq!(heap.vector_set(empty, 0, n(1)), None);
}

#[test]
fn what_the_interpreter_trusts_cannot_be_overwritten() {
    let mut heap = heap();
    let class = heap.alloc_record(Kind::Class, 0, 0, &[]).unwrap();
    let instance = heap.alloc_structure(class, &[n(1)]).unwrap();
    assert_eq!(heap.slots_mut::<1>(instance, Kind::Structure), None);
    assert_eq!(heap.record_set(instance, Kind::Structure, 0, n(1)), None);
    assert_eq!(heap.structure_set(instance, 0, n(2)), Some(()));
    assert_eq!(heap.structure_set(instance, 1, n(2)), None);
    assert_eq!(heap.structure_set(instance, usize::MAX, n(2)), None);
    assert_eq!(heap.structure_slots(instance), Some(&[n(2)][..]));
    assert_eq!(heap.structure_class(instance), Some(class));

    let f = function(&mut heap);
    assert_eq!(heap.slots_mut::<1>(f, Kind::Function), None);
    assert_eq!(heap.record_set(f, Kind::Function, 0, n(1)), None);
    // SAFETY: the code of this function is not run.
    let mut set_capture = |index| unsafe { heap.function_set_capture(f, index, n(1)) };
    assert_eq!((set_capture(1), set_capture(2)), (Some(()), None));
    assert_eq!(heap.function_captures(f), Some(&[n(10), n(1)][..]));

    let s = symbol(&mut heap, "x");
    assert_eq!(heap.slots_mut::<1>(s, Kind::Symbol), None);
    assert_eq!(heap.record_set(s, Kind::Symbol, 2, n(1)), None);
    assert_eq!(heap.symbol_set_function(s, n(1)), None);
    assert_eq!(heap.symbol_set_function(s, f), Some(()));
    assert_eq!(heap.symbol(s).unwrap().function, f);

    let data = heap.alloc_vector(&[n(1)]).unwrap();
    let array = heap.alloc_array(Array::HAS_FILL_POINTER, data, n(0), &[n(1), n(1)]).unwrap();
    assert_eq!(heap.array_set_data(array, n(1)), None);
    assert_eq!(heap.record_set(array, Kind::Array, 0, n(1)), None);
    assert_eq!(heap.set_aux(array, Kind::Array, 9), None);
    assert_eq!(heap.array_set_dimension(array, 1, n(7)), Some(()));
    assert_eq!(heap.array_set_dimension(array, 2, n(7)), None);
    assert_eq!(heap.array_dimensions(array), Some(&[n(1), n(7)][..]));
    heap.array_set_fill(array, n(1)).unwrap();
    assert_eq!(heap.array(array).map(|a| (a.data, a.fill, a.header.aux)), Some((data, n(1), 2)));
}

#[test]
fn a_structure_that_has_moved_has_the_slots_of_another_one() {
    let mut heap = heap();
    let class = |heap: &mut Heap| heap.alloc_record(Kind::Class, 0, 0, &[n(1)]).unwrap();
    let (old, new, moved) = (class(&mut heap), class(&mut heap), class(&mut heap));
    let small = heap.alloc_structure(old, &[n(1)]).unwrap();
    let whole = heap.alloc_structure(new, &[n(2), n(3)]).unwrap();
    let empty = heap.alloc_structure(old, &[]).unwrap();
    let unfit = [(small, small, moved), (empty, whole, moved), (small, whole, n(1)), (n(1), whole, moved)];
    for (v, to, class) in unfit {
        assert_eq!(heap.structure_move(v, to, class), None);
    }
    assert_eq!(heap.structure_slots(small), Some(&[n(1)][..]));
    assert_eq!(heap.structure_move(small, whole, moved), Some(()));
    assert_eq!(heap.structure_set(small, 1, n(4)), Some(()));
    assert_eq!(heap.structure_slots(small), Some(&[n(2), n(4)][..]));
    assert_eq!(heap.structure_slots(whole), Some(&[n(2), n(4)][..]));
    assert_eq!((heap.structure_class(small), heap.structure_whole(small)), (Some(moved), whole));
    // Its whole may move in turn; nothing moves twice, or to one that has moved.
    let larger = heap.alloc_structure(new, &[n(5), n(6), n(7)]).unwrap();
    assert_eq!(heap.structure_move(small, larger, moved), None);
    assert_eq!(heap.structure_move(whole, larger, moved), Some(()));
    assert_eq!(heap.structure_move(larger, whole, moved), None);
    assert_eq!(heap.structure_slots(small), Some(&[n(5), n(6), n(7)][..]));
}

#[test]
fn symbols_have_their_cells() {
    let mut heap = heap();
    let s = symbol(&mut heap, "foo");
    let made = *heap.symbol(s).unwrap();
    assert_eq!(heap.string_text(made.name).as_deref(), Some("foo"));
    assert_eq!(
        (made.package, made.value, made.macro_function, made.plist),
        (n(9), Value::UNBOUND, Value::NIL, Value::NIL)
    );
    assert_eq!(made.header.flags, SymbolObject::KEYWORD);
    heap.symbol_set_value(s, n(1)).unwrap();
    heap.symbol_set_macro_function(s, n(3)).unwrap();
    heap.symbol_set_plist(s, n(4)).unwrap();
    let now = heap.symbol(s).unwrap();
    assert_eq!((now.value, now.package, now.macro_function, now.plist), (n(1), n(9), n(3), n(4)));
    assert_eq!((now.name, now.function), (made.name, made.function));
}

#[test]
fn code_has_constants_and_words() {
    let mut heap = heap();
    for (nconsts, nwords) in [(0, 1), (1, 2), (3, 5), (2, 4)] {
        let constants: Vec<Value> = (0..nconsts).map(n).collect();
        let words: Vec<u32> = (100..100 + nwords).collect();
        let v = code(&mut heap, &constants, &words);
        assert_eq!(heap.code_constants(v), Some(&constants[..]));
        assert_eq!(heap.code_words(v), Some(&words[..]));
        let code: &CodeObject = heap.code(v).unwrap();
        assert_eq!((code.name, code.debug, code.owner), (n(1), n(2), n(3)));
        assert_eq!((code.arity, code.nregs, code.spare), (2, 5, [7, 8]));
        assert_eq!(code.entry, heap.code_words(v).unwrap().as_ptr());
    }
}

#[test]
fn numbers_come_back() {
    let mut heap = heap();
    for x in [0.0, -0.0, 1.5, 1e300, -1e-300, f64::MIN_POSITIVE, f64::INFINITY] {
        let v = heap.float(x).unwrap();
        assert_eq!(heap.as_double(v).map(f64::to_bits), Some(x.to_bits()));
    }
    let big = heap.alloc_bignum(true, &[1, 2, 0, 0]).unwrap();
    let view = heap.bignum(big).unwrap();
    assert_eq!((view.negative, view.limbs), (true, &[1, 2][..]));
    let zero = heap.alloc_bignum(false, &[0]).unwrap();
    assert_eq!(heap.bignum(zero).map(|b| (b.negative, b.limbs.len())), Some((false, 0)));
    let ratio = heap.alloc_ratio(n(1), big).unwrap();
    assert_eq!(heap.ratio(ratio), Some((n(1), big)));
}

#[test]
fn raw_data_changes_in_place() {
    let mut heap = heap();
    let s = heap.alloc_string_filled(3, 'a' as u32).unwrap();
    heap.string_mut(s).unwrap()[1] = 0xD800;
    assert_eq!(heap.string(s), Some(&[97, 0xD800, 97][..]));
    assert_eq!(heap.string_text(s).as_deref(), Some("a\u{FFFD}a"));
    let w = heap.alloc_words(2, 5).unwrap();
    heap.words_mut(w).unwrap()[0] = 6;
    assert_eq!(heap.words(w), Some(&[6, 5][..]));
    let b = heap.alloc_bytes_filled(9, 1).unwrap();
    heap.bytes_mut(b).unwrap()[8] = 2;
    assert_eq!(heap.bytes(b), Some(&[1, 1, 1, 1, 1, 1, 1, 1, 2][..]));
}

#[test]
fn lists_are_built_from_the_front() {
    let mut heap = heap();
    let list = heap.list_with_tail(&[n(1), n(2)], n(3)).unwrap();
    let rest = heap.cdr(list).unwrap();
    assert_eq!(heap.car(list), Some(n(1)));
    assert_eq!((heap.car(rest), heap.cdr(rest)), (Some(n(2)), Some(n(3))));
    assert_eq!(heap.list(&[]), Ok(Value::NIL));
}

#[test]
#[should_panic(expected = "the class of a structure is a Class")]
fn a_structure_needs_a_class() {
    let _ = heap().alloc_structure(n(1), &[]);
}

#[test]
#[should_panic(expected = "is made by a function of its own")]
fn a_symbol_is_not_made_as_a_record() {
    let _ = heap().alloc_record(Kind::Symbol, 0, 0, &[]);
}

#[test]
fn lengths_have_a_limit() {
    let mut heap = heap();
    let too_long = heap.alloc_bytes_filled((1 << 31) + 1, 0);
    assert_eq!(too_long, Err(AllocError::TooLarge { requested: (1 << 31) + 1 }));
    let too_large = heap.alloc_vector_filled(1 << 31, Value::NIL);
    assert!(matches!(too_large, Err(AllocError::TooLarge { requested }) if requested > 1 << 33));
}
