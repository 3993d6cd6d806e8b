use esl_bytecode::assembler::assemble;
use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::{
    Compilation, Compile, CompileTimeHost, MacroCall, MacroRef, NameUse, Part, Step, StepOutcome, Work,
};
use esl_bytecode::datum::DatumKind;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::file::{ImageBytes, ModuleImage, write};
use esl_bytecode::locals::{LocalMeaning, Locals};
use esl_bytecode::module::{Constant, FunctionNumber, Module, ModuleFunction, PoolIdx};

use super::*;
use crate::datum::Unit;
use crate::names::load::prepare;

fn span() -> Span {
    Span::default()
}

/// Returns a function with these parameters, constants and code.
fn function(required: u8, registers: u8, constants: &[u32], code: &str) -> ModuleFunction {
    ModuleFunction {
        parameters: Parameters::exactly(required),
        registers,
        constants: constants.iter().map(|&index| PoolIdx(index)).collect(),
        code: assemble(code).unwrap(),
        ..ModuleFunction::default()
    }
}

/// Returns a module whose only form calls a builtin with constants.
fn call(builtin: Builtin, arguments: Vec<Constant>) -> Module {
    let count = arguments.len() as u8;
    let mut code: String =
        (0..count).map(|position| format!("load-const r{} k{position}\n", position + 2)).collect();
    code += &format!("tail-call-builtin r0.. {count} b{}", builtin.number());
    Module {
        constants: arguments,
        functions: vec![function(0, count + 2, &(0..u32::from(count)).collect::<Vec<_>>(), &code)],
        toplevel: vec![FunctionNumber(0)],
        ..Module::default()
    }
}

/// Returns a module that makes `(lambda (form environment) (list 'quote (cdr form)))` the macro `QUOTED`.
fn macro_module() -> Module {
    let define = format!(
        "load-const r2 k0
         make-closure r3 k1
         tail-call-builtin r0.. 2 b{}",
        Builtin::SetMacro.number()
    );
    Module {
        constants: vec![
            Constant::Symbol(Symbol::esl("QUOTED")),
            Constant::Function(FunctionNumber(1)),
            Constant::Symbol(Symbol::cl("QUOTE")),
        ],
        functions: vec![
            function(0, 4, &[0, 1], &define),
            function(2, 4, &[2], "load-const r2 k0\ncdr r3 r0\nlist r2 r2.. 2\nreturn r2"),
        ],
        toplevel: vec![FunctionNumber(0)],
        ..Module::default()
    }
}

fn load(vm: &mut Vm, module: &Module) {
    let functions = vm.load_module(module).unwrap();
    vm.run_toplevel(functions, 1_000).unwrap();
}

/// Returns two machines with the definitions of the modules: run once, and from the table of an image.
fn machines(modules: Vec<Module>) -> [Vm; 2] {
    let mut running = Vm::for_tests();
    modules.iter().for_each(|module| load(&mut running, module));
    let linked = prepare(esl_bytecode::link::link(modules));
    assert!(linked.toplevel.is_empty(), "all forms are definitions");
    let bytes = write(&linked).unwrap();
    let mut reading = Vm::for_tests();
    reading.open_image("test", ModuleImage::open(ImageBytes::Shared(bytes.into())).unwrap()).unwrap();
    [running, reading]
}

#[test]
fn a_compiler_learns_what_names_mean() {
    let symbol = |name| Constant::Symbol(Symbol::esl(name));
    let modules = vec![
        macro_module(),
        call(Builtin::ProclaimSpecial, vec![symbol("VARIABLE")]),
        call(Builtin::DefineConstant, vec![symbol("LIMIT"), Constant::Integer(7.into())]),
        call(Builtin::Put, vec![symbol("PLACE"), symbol("%SETF"), Constant::String("how".into())]),
    ];
    for vm in machines(modules) {
        let global = |name| vm.global(&Symbol::esl(name));
        assert_eq!(global("QUOTED").function, GlobalFunction::Macro);
        assert!(matches!(global("VARIABLE").variable, GlobalVariable::Special));
        match global("LIMIT").variable {
            GlobalVariable::Constant(value) => assert_eq!(value.to_string(), "7"),
            other => panic!("{other:?}"),
        }
        let how = vm.property(&Symbol::esl("PLACE"), &Symbol::esl("%SETF"));
        assert_eq!(how.map(|datum| datum.to_string()).as_deref(), Some("\"how\""));
        assert!(vm.property(&Symbol::esl("PLACE"), &Symbol::esl("OTHER")).is_none());
        assert!(matches!(global("NOTHING").function, GlobalFunction::Undefined));
        let car = vm.global(&Symbol::cl("CAR")).function;
        assert_eq!(car, GlobalFunction::Function(Some(Arity { min: 1, max: Some(1) })));
        assert!(matches!(vm.setf_function(&Symbol::cl("CAR")), GlobalFunction::Undefined));
        assert_eq!(vm.similar(&Symbol::esl("QUOTTED"), NameUse::Function), [Symbol::esl("QUOTED")]);
        let foreign = Symbol::new(&esl_bytecode::symbol::USER_PACKAGE.into(), "QUOTTED");
        assert_eq!(vm.similar(&foreign, NameUse::Function), [], "a program cannot use an internal name");
        assert_eq!(
            vm.similar(&Symbol::esl("LIMITS"), NameUse::Variable).len(),
            usize::from(vm.names.find(&Symbol::esl("LIMIT")).is_some())
        );
    }
}

#[test]
fn accessors_are_known_until_they_are_redefined() {
    let mut vm = Vm::for_tests();
    let symbol = |name| Constant::Symbol(Symbol::esl(name));
    let index = Constant::Integer(1.into());
    let define = vec![symbol("POINT-Y"), symbol("POINT"), index, Constant::Nil];
    load(&mut vm, &call(Builtin::DefineAccessor, define));
    let expected = Accessor { class: Symbol::esl("POINT"), slot: 1, access: SlotAccess::Free };
    assert_eq!(vm.global(&Symbol::esl("POINT-Y")).accessor, Some(expected));
    let name = vm.names.intern_esl(&mut vm.heap, "POINT-Y").unwrap();
    let car = vm.names.intern_cl(&mut vm.heap, "CAR").unwrap();
    let function = vm.names.function_of(&vm.heap, car).unwrap();
    crate::builtins::NATIVES[Builtin::SetFunction as usize](&mut vm, &[name, function]).unwrap();
    assert_eq!(vm.global(&Symbol::esl("POINT-Y")).accessor, None);
}

#[test]
fn a_macro_is_run_for_the_compiler() {
    let mut vm = Vm::for_tests();
    load(&mut vm, &macro_module());
    let argument = Datum::string("text", span());
    let form = Datum::list([Datum::symbol(Symbol::esl("QUOTED"), span()), argument.clone()], span());
    let locals = Locals::default().with(Symbol::esl("F"), LocalMeaning::Function);
    let call = |name| MacroCall {
        function: MacroRef::Global(Symbol::esl(name)),
        form: form.clone(),
        locals: locals.clone(),
    };
    let expansion = vm.expand(&call("QUOTED")).unwrap();
    assert_eq!(expansion.to_string(), "(QUOTE (\"text\"))");
    let quoted = expansion.as_list().unwrap()[1].clone();
    assert!(quoted.as_list().unwrap()[0].is_same(&argument), "the argument comes back as it was written");
    assert!(vm.expand(&call("UNDEFINED")).is_err());
}

#[test]
fn environments_share_what_they_have_in_common() {
    let mut vm = Vm::for_tests();
    let mut unit = Unit::default();
    let outer = Locals::default().with(Symbol::esl("F"), LocalMeaning::Function);
    let inner = outer.with(Symbol::esl("G"), LocalMeaning::Function);
    let beside = outer.with(Symbol::esl("H"), LocalMeaning::Variable);
    let mut made = |locals: &Locals| unit.environment(&mut vm.heap, &mut vm.names, locals).unwrap();
    let (first, second, third, again) = (made(&inner), made(&beside), made(&outer), made(&inner));
    assert_eq!(made(&inner), again);
    assert_eq!(made(&Locals::default()), Value::NIL);
    let rest = |environment| vm.heap.as_cons(environment).unwrap().cdr;
    assert_eq!([rest(first), rest(second), rest(again)], [third; 3]);
    assert_ne!(first, second);
    let entry = vm.heap.car(second).unwrap();
    let key = vm.heap.car(entry).unwrap();
    assert!(vm.heap.as_cons(key).is_some() && vm.heap.as_cons(entry).unwrap().cdr.is_nil());
}

#[test]
fn a_kept_value_comes_back_as_itself() {
    let mut vm = Vm::for_tests();
    let module = call(Builtin::List, vec![Constant::True]);
    let kept = CompileTimeHost::load(&mut vm, module, true).unwrap().unwrap();
    let value = vm.compiler.unit.borrow().pinned(kept).unwrap();
    assert_eq!(vm.heap.car(value), Some(Value::T));
}

/// A compiler of forms `(NAME . arguments)`: it expands the macro `NAME`, and the value is the expansion.
struct Toy;

enum ToyCompilation {
    Start(Datum),
    Expanding,
}

impl Compilation for ToyCompilation {
    fn step(&mut self, _: &mut dyn Environment, answer: StepOutcome, work: &mut Work) -> Step {
        work.add(1);
        match (std::mem::replace(self, ToyCompilation::Expanding), answer) {
            (ToyCompilation::Start(form), StepOutcome::Start) => {
                let name = form.as_cons().unwrap().0.as_symbol().unwrap().clone();
                Step::Expand(MacroCall { function: MacroRef::Global(name), form, locals: Locals::default() })
            }
            (_, StepOutcome::Expansion(expansion)) => {
                let DatumKind::Object(id) = expansion.kind() else {
                    let message = format!("{expansion} is no object");
                    return Step::Done(
                        None,
                        vec![Diagnostic::new("no-object", Severity::Error, message, span())],
                    );
                };
                Step::Done(Some(call(Builtin::Identity, vec![Constant::Object(*id)])), Vec::new())
            }
            (_, answer) => panic!("{answer:?}"),
        }
    }

    fn bytes(&self) -> usize {
        0
    }

    fn render(&self, diagnostic: &Diagnostic) -> String {
        diagnostic.message.clone()
    }
}

impl Compile for Toy {
    fn compile_form(&self, form: Datum, _: Option<Part<'_>>) -> Box<dyn Compilation> {
        Box::new(ToyCompilation::Start(form))
    }

    fn compile_text(&self, _: &str, _: &str) -> Box<dyn Compilation> {
        unreachable!("programs compile form by form")
    }

    /// Reads `name`, as a list of it.
    fn read(
        &self,
        environment: &mut dyn Environment,
        text: &str,
        start: usize,
    ) -> Result<(Option<Datum>, usize), Box<Diagnostic>> {
        let rest = &text[start..];
        let skipped = rest.len() - rest.trim_start().len();
        let Some(word) = rest.split_whitespace().next() else { return Ok((None, text.len())) };
        if word == "(" {
            return Err(Box::new(Diagnostic::new("unclosed-list", Severity::Error, "", span())));
        }
        let name = environment.intern(None, word, false).unwrap();
        Ok((Some(Datum::list([Datum::symbol(name, span())], span())), start + skipped + word.len()))
    }

    fn render(&self, diagnostic: &Diagnostic, _: Option<&str>, _: &str) -> String {
        diagnostic.message.clone()
    }
}

fn native(vm: &mut Vm, builtin: Builtin, arguments: &[Value]) -> Vec<Value> {
    match crate::builtins::NATIVES[builtin as usize](vm, arguments) {
        Ok(value) => vec![value],
        Err(crate::raise::Exit::Values) => vm.exchange.values.clone(),
        Err(exit) => panic!("{builtin:?}: {exit:?} {:?}", vm.exchange.raised),
    }
}

fn keyword(vm: &mut Vm, name: &str) -> Value {
    vm.names.keyword(&mut vm.heap, name).unwrap()
}

#[test]
fn a_program_steps_a_compilation() {
    let mut vm = Vm::for_tests();
    vm.enter_package("ESL").unwrap();
    vm.set_compiler(Box::new(Toy));
    load(&mut vm, &macro_module());
    let text = vm.heap.alloc_str("QUOTED ").unwrap();
    let text = native(&mut vm, Builtin::OpenText, &[text])[0];
    let (start, expand, expansion) =
        (keyword(&mut vm, "START"), keyword(&mut vm, "EXPAND"), keyword(&mut vm, "EXPANSION"));
    let done = keyword(&mut vm, "DONE");
    let begin = |vm: &mut Vm| {
        let name = vm.names.intern_esl(&mut vm.heap, "QUOTED").unwrap();
        let form = vm.heap.list(&[name]).unwrap();
        native(vm, Builtin::BeginCompilation, &[form])[0]
    };
    let from_text = native(&mut vm, Builtin::NextForm, &[text])[0];
    for handle in [begin(&mut vm), from_text] {
        let step = native(&mut vm, Builtin::CompilationStep, &[handle, start, Value::NIL]);
        assert_eq!(step[0], expand);
        // The expansion may be any object: here, the macro function itself.
        let step = native(&mut vm, Builtin::CompilationStep, &[handle, expansion, step[1]]);
        assert_eq!(step[0], done);
        let value = vm.run_toplevel(step[1], 1_000).unwrap();
        assert!(vm.heap.is(value, crate::heap::Kind::Function));
        assert_eq!(step[2], Value::NIL, "no diagnostics");
        native(&mut vm, Builtin::EndCompilation, &[handle]);
        assert!(
            crate::builtins::NATIVES[Builtin::CompilationStep as usize](
                &mut vm,
                &[handle, start, Value::NIL]
            )
            .is_err()
        );
    }
    assert_eq!(native(&mut vm, Builtin::NextForm, &[text]), [Value::NIL]);

    let handle = begin(&mut vm);
    native(&mut vm, Builtin::CompilationStep, &[handle, start, Value::NIL]);
    let step = native(&mut vm, Builtin::CompilationStep, &[handle, expansion, Value::NIL]);
    assert_eq!((step[0], step[1]), (done, Value::NIL));
    assert_eq!(vm.describe(step[2]), "((:ERROR :NO-OBJECT \"NIL is no object\"))");
}

#[test]
fn data_are_read_from_streams() {
    let host = esl_host::VirtualHost::new().with_input("ONE TW").with_input("O\nTHREE");
    let mut vm = Vm::new(crate::vm::Config::default(), Box::new(host)).unwrap();
    vm.set_compiler(Box::new(Toy));
    let mut read = Vec::new();
    loop {
        let values = native(&mut vm, Builtin::ReadStream, &[]);
        if values[0].is_nil() {
            break;
        }
        read.push(vm.describe(values[1]));
    }
    assert_eq!(read, ["(ONE)", "(TWO)", "(THREE)"]);
    let text = vm.heap.alloc_str(" (").unwrap();
    let values = native(&mut vm, Builtin::ReadDatum, &[text]);
    assert_eq!(vm.describe(values[0]), ":UNFINISHED");
}
