use std::sync::Arc;

use esl_bytecode::assembler::assemble;
use esl_bytecode::builtin::Builtin;
use esl_bytecode::file::{ImageBytes, ModuleImage, write};
use esl_bytecode::module::{
    Capture, CaptureSource, Constant, FunctionNumber, LineEntry, Module, ModuleFunction, Parameters, PoolIdx,
};
use esl_bytecode::symbol::Symbol;

use super::*;
use crate::vm::Vm;

/// Returns a function with these constants and this code.
fn function(registers: u8, constants: &[u32], code: &str) -> ModuleFunction {
    ModuleFunction {
        registers,
        constants: constants.iter().map(|&index| PoolIdx(index)).collect(),
        code: assemble(code).unwrap(),
        ..ModuleFunction::default()
    }
}

/// `(%set-function 'adder (lambda (n) (lambda (x) (+ n x))))` and shared data similar to `(quote #1=(a "text"
/// . #1#))`.
fn module() -> Module {
    let set_function = Builtin::SetFunction.number();
    let define = format!(
        "load-const r2 k0
         make-closure r3 k1
         tail-call-builtin r0.. 2 b{set_function}"
    );
    let mut adder = function(2, &[4], "make-closure r1 k0\nreturn r1");
    adder.parameters = Parameters::exactly(1);
    adder.name = Some(PoolIdx(0));
    adder.documentation = Some(PoolIdx(1));
    let mut inner = function(3, &[], "capture-ref r1 #0\nadd r2 r0 r1\nreturn r2");
    inner.parameters = Parameters::exactly(1);
    inner.captures = vec![Capture::value(CaptureSource::Register(0))];
    inner.lines = vec![LineEntry { pc: 1, source: 0, line: 7, column: 3 }];
    let data = function(2, &[2], "load-const r0 k0\nnot r1 r0\nreturn r0");
    Module {
        sources: vec!["adder.esl".into()],
        requires: Vec::new(),
        constants: vec![
            Constant::Symbol(Symbol::esl("ADDER")),
            Constant::String("Makes an adder.".into()),
            Constant::Cons(PoolIdx(1), PoolIdx(1)),
            Constant::Function(FunctionNumber(1)),
            Constant::Function(FunctionNumber(2)),
        ],
        functions: vec![function(4, &[0, 3], &define), adder, inner, data],
        toplevel: vec![FunctionNumber(0), FunctionNumber(3)],
    }
}

fn image(module: &Module) -> Arc<ModuleImage> {
    let bytes = write(module).unwrap();
    Arc::new(ModuleImage::open(ImageBytes::Shared(bytes.into())).unwrap())
}

/// Runs all top-level functions and returns the value of the last.
fn run(vm: &mut Vm, toplevel: Value) -> Value {
    vm.run_toplevel(toplevel, 1_000).unwrap()
}

/// Runs `((adder 2) 40)`.
fn use_adder(vm: &mut Vm) -> Value {
    let name = vm.names.intern_esl(&mut vm.heap, "ADDER").unwrap();
    let adder = vm.call(name, &[Value::small(2)], 1_000).unwrap()[0];
    vm.call(adder, &[Value::small(40)], 1_000).unwrap()[0]
}

fn check_loaded(vm: &mut Vm, toplevel: Value) {
    let data = run(vm, toplevel);
    assert_eq!(vm.heap.car(data), vm.heap.cdr(data), "constants keep their identity");
    assert_eq!(use_adder(vm), Value::small(42));
    let name = vm.names.intern_esl(&mut vm.heap, "ADDER").unwrap();
    let function = vm.names.function_of(&vm.heap, name).unwrap();
    let (_, documentation) = vm.names.texts_of_function(&mut vm.heap, function).unwrap().unwrap();
    assert_eq!(vm.heap.string_text(documentation).as_deref(), Some("Makes an adder."));
    let adder = vm.call(name, &[Value::small(2)], 1_000).unwrap()[0];
    let code = vm.heap.function_code(adder).unwrap();
    let place = vm.names.source_place(&vm.heap, code, 2).unwrap();
    assert_eq!((place.source.as_str(), place.line, place.column), ("adder.esl", 7, 3));
    assert_eq!(vm.names.source_place(&vm.heap, code, 0), None);
}

#[test]
fn a_module_runs() {
    let mut vm = Vm::for_tests();
    let toplevel = vm.load_module(&module()).unwrap();
    check_loaded(&mut vm, toplevel);
}

#[test]
fn an_image_runs() {
    let mut vm = Vm::for_tests();
    let image = image(&module());
    let toplevel = vm.names.open_image(&mut vm.heap, "test", image).unwrap();
    check_loaded(&mut vm, toplevel);
}

#[test]
fn definitions_of_an_image_are_there_without_running_it() {
    let prepared = prepare(module());
    assert_eq!(prepared.toplevel, [FunctionNumber(3)]);
    let mut vm = Vm::for_tests();
    // Once before there is an object of the symbol, once after.
    for interns_before in [false, true] {
        if interns_before {
            vm = Vm::for_tests();
            vm.names.intern_esl(&mut vm.heap, "ADDER").unwrap();
        }
        let image = image(&prepared);
        let toplevel = vm.names.open_image(&mut vm.heap, "test", image).unwrap();
        assert_eq!(use_adder(&mut vm), Value::small(42));
        check_loaded(&mut vm, toplevel);
    }
}

/// `(%make-class 'animal nil '(name) "data")`, `(%make-class 'bird '(animal) '(name) "data")`, and a class
/// whose parent is unknown.
fn classes() -> Module {
    let make = Builtin::MakeClass.number();
    let form = |constants: &[u32]| {
        let code = format!(
            "load-const r2 k0
             load-const r3 k1
             load-const r4 k2
             load-const r5 k3
             tail-call-builtin r0.. 4 b{make}"
        );
        function(6, constants, &code)
    };
    Module {
        constants: vec![
            Constant::Symbol(Symbol::esl("ANIMAL")),
            Constant::Symbol(Symbol::esl("BIRD")),
            Constant::Symbol(Symbol::esl("UNKNOWN")),
            Constant::Nil,
            Constant::Cons(PoolIdx(0), PoolIdx(3)),
            Constant::Cons(PoolIdx(2), PoolIdx(3)),
            Constant::Symbol(Symbol::esl("NAME")),
            Constant::Cons(PoolIdx(6), PoolIdx(3)),
            Constant::String("data".into()),
        ],
        functions: vec![form(&[0, 3, 7, 8]), form(&[1, 4, 7, 8]), form(&[2, 5, 7, 8])],
        toplevel: vec![FunctionNumber(0), FunctionNumber(1), FunctionNumber(2)],
        ..Module::default()
    }
}

#[test]
fn classes_of_an_image_are_made_when_their_names_are_met_parents_first() {
    let prepared = prepare(classes());
    assert_eq!(prepared.toplevel, [FunctionNumber(2)], "a class below an unknown one stays a form");
    for first in ["ANIMAL", "BIRD"] {
        let mut vm = Vm::for_tests();
        let image = image(&prepared);
        vm.names.open_image(&mut vm.heap, "test", image).unwrap();
        assert_eq!(vm.names.find(&Symbol::esl("BIRD")), None);
        vm.names.intern_esl(&mut vm.heap, first).unwrap();
        let [animal, bird] = ["ANIMAL", "BIRD"].map(|name| {
            let name = vm.names.intern_esl(&mut vm.heap, name).unwrap();
            vm.names.find_class(name).expect("the class is made")
        });
        assert!(vm.names.is_subclass(&vm.heap, bird, animal), "{first} first");
        assert!(!vm.names.is_subclass(&vm.heap, animal, bird));
    }
}

#[test]
fn collections_do_not_harm_what_is_loaded() {
    let config = crate::vm::Config { collect_always: true, ..Default::default() };
    let mut vm = Vm::new(config, Box::new(esl_host::VirtualHost::new())).unwrap();
    let toplevel = vm.load_module(&module()).unwrap();
    check_loaded(&mut vm, toplevel);
    let image = image(&module());
    let toplevel = vm.names.open_image(&mut vm.heap, "test", image).unwrap();
    check_loaded(&mut vm, toplevel);
}

#[test]
fn a_module_that_the_verifier_refuses_is_not_loaded() {
    let mut vm = Vm::for_tests();
    let mut module = module();
    module.functions[0].registers = 1;
    assert!(matches!(vm.load_module(&module), Err(LoadError::Refused(_))));
}

#[test]
fn uninterned_symbols_are_one_object_in_a_module() {
    let mut vm = Vm::for_tests();
    let symbol = || Constant::Symbol(Symbol::uninterned(1, "G"));
    let code = function(2, &[0, 1], "load-const r0 k0\nload-const r1 k1\neq r0 r0 r1\nreturn r0");
    let module = Module {
        constants: vec![symbol(), symbol()],
        functions: vec![code],
        toplevel: vec![FunctionNumber(0)],
        ..Module::default()
    };
    let toplevel = vm.load_module(&module).unwrap();
    assert_eq!(run(&mut vm, toplevel), Value::T);
}
