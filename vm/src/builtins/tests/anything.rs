//! A builtin answers for all arguments.

use esl_bytecode::builtin::{BUILTINS, Builtin};

use super::parse_number;
use crate::builtins::NATIVES;
use crate::raise::Exit;
use crate::value::Value;
use crate::vm::Vm;

/// A generator that gives the same numbers each time.
struct Choices(u64);

impl Choices {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 16) as usize % limit
    }
}

/// One of everything, and several of what has edges.
fn objects(vm: &mut Vm) -> Vec<Value> {
    let mut all = vec![Value::NIL, Value::T, Value::INFINITY, Value::NAN, Value::NEGATIVE_ZERO];
    let numbers = [
        "0",
        "1",
        "2",
        "3",
        "7",
        "10",
        "36",
        "64",
        "100",
        "5000",
        "-1",
        "-2",
        "-5000",
        "2^40",
        "2^61",
        "2^64",
        "2^70",
        "2^200",
        "2^40000",
        "2^4000000",
        "1/2",
        "-7/3",
        "2^100/3",
        "0.0",
        "1.0",
        "-1.5",
        "0.1",
        "1e300",
        "1e-320",
        "1e22",
        "2305843009213693951",
        "-2305843009213693952",
    ];
    for number in numbers {
        let number = parse_number(vm, number).unwrap();
        all.push(number);
    }
    for code in [0, 10, 'a' as u32, 'Z' as u32, '7' as u32, 0xDF, 0xD800, 0x10_FFFF] {
        all.push(Value::character(code).unwrap());
    }
    let heap = &mut vm.heap;
    let two = Value::small(2);
    let [empty, text] = ["", "Hello, 12 wörld"].map(|text| heap.alloc_str(text).unwrap());
    let long = heap.alloc_string_filled(5000, 'x' as u32).unwrap();
    let vector = heap.alloc_vector(&[two, text, Value::NIL, two]).unwrap();
    let bytes = heap.alloc_bytes(&[1, 2, 3]).unwrap();
    let list = heap.list(&[two, text, Value::T]).unwrap();
    let dotted = heap.list_with_tail(&[two, two], Value::T).unwrap();
    let alist = heap.list(&[list, Value::NIL, dotted]).unwrap();
    let circle = heap.list(&[two, list]).unwrap();
    let end = heap.cdr(circle).unwrap();
    heap.set_cdr(end, circle);
    let nested = heap.list(&[circle, list, circle]).unwrap();
    heap.set_car(nested, nested);
    let chars = heap.alloc_string(&[97, 98, 99, 100]).unwrap();
    let fill = heap.alloc_array(3, vector, two, &[Value::small(4)]).unwrap();
    let buffer = heap.alloc_array(1, chars, two, &[Value::small(3)]).unwrap();
    let square = heap.alloc_array(0, vector, Value::NIL, &[two, two]).unwrap();
    let point = heap.alloc_array(0, vector, Value::NIL, &[]).unwrap();
    let state = heap.alloc_box(two).unwrap();
    all.extend([
        empty, text, long, vector, bytes, list, dotted, alist, circle, nested, fill, buffer, square, point,
        state,
    ]);
    for test in 0..5 {
        let arguments = [Value::small(test), Value::small(0), Value::NIL, Value::NIL];
        let table = crate::builtins::table::make_hash_table(vm, &arguments).unwrap();
        all.push(table);
    }
    let state = crate::builtins::float::make_random_state(vm, &[Value::NIL]).unwrap();
    let symbol = vm.names.intern_cl(&mut vm.heap, "CAR").unwrap();
    let keyword = vm.names.keyword(&mut vm.heap, "END").unwrap();
    all.extend([state, symbol, keyword]);
    all
}

#[test]
fn every_call_is_answered() {
    let mut choices = Choices(0x2545_F491_4F6C_DD1D);
    let (first, last) = (Builtin::Eq.number() as usize, Builtin::TableDelete.number() as usize);
    for round in 0..40 {
        let mut vm = Vm::for_tests();
        let all = objects(&mut vm);
        for info in &BUILTINS[first..=last] {
            for _ in 0..12 {
                let most = info.arity.max.unwrap_or(info.arity.min + 3);
                let count = info.arity.min as usize + choices.below((most - info.arity.min) as usize + 1);
                let arguments: Vec<Value> = (0..count).map(|_| all[choices.below(all.len())]).collect();
                vm.exchange.raised = None;
                match NATIVES[info.builtin as usize](&mut vm, &arguments) {
                    Ok(_) | Err(Exit::Values | Exit::Collect) => {}
                    Err(Exit::Raise) => {
                        assert!(vm.exchange.raised.is_some(), "{} of {arguments:?}", info.name)
                    }
                    Err(Exit::Slowly) => assert!(info.slowly.is_some(), "{} of {arguments:?}", info.name),
                    Err(exit) => panic!("{} of {arguments:?} gives {exit:?} in round {round}", info.name),
                }
            }
        }
    }
}
