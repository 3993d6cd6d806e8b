//! Programs of a few instructions for every arm of the loop, and for the slow paths behind the arms.
//!
//! A program is the code of a function without parameters; `constants` lists the constants that all programs
//! share. There is no library, so a failure ends the task with a description. Miri runs all programs.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use esl_bytecode::BigInt;
use esl_bytecode::assembler::assemble;
use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{
    Capture, CaptureSource, Constant, FunctionNumber, Module, ModuleFunction, Parameters, PoolIdx,
};
use esl_bytecode::opcode::{OPCODES, Opcode};
use esl_bytecode::symbol::Symbol;
use esl_host::VirtualHost;

use crate::describe::describe;
use crate::names::load::{Alone, load};
use crate::value::Value;
use crate::vm::{Config, Vm};

/// Returns the constants `k0`, `k1` and so on.
fn constants() -> Vec<Constant> {
    vec![
        // k0 to k3: a special variable, a function of one argument, a builtin, an undefined function
        Constant::Symbol(Symbol::esl("V")),
        Constant::Symbol(Symbol::esl("SUCCESSOR")),
        Constant::Symbol(Symbol::cl("LIST")),
        Constant::Symbol(Symbol::esl("NOTHING")),
        // k4 to k8: numbers, a character
        Constant::Integer(BigInt::from(1)),
        Constant::Integer(BigInt::from(1) << 62),
        Constant::Float(1.5),
        Constant::Float(1e300),
        Constant::Character('b'),
        // k9 to k12: a string, a vector, a pair, types of a handler
        Constant::String("abc".into()),
        Constant::Vector(vec![PoolIdx(4), PoolIdx(6)]),
        Constant::Cons(PoolIdx(4), PoolIdx(6)),
        Constant::Vector(vec![PoolIdx(0)]),
        // k13: a class
        Constant::Class(Symbol::esl("POINT")),
        // k14 to k21: the shared functions
        Constant::Function(FunctionNumber(0)),
        Constant::Function(FunctionNumber(1)),
        Constant::Function(FunctionNumber(2)),
        Constant::Function(FunctionNumber(3)),
        Constant::Function(FunctionNumber(4)),
        Constant::Function(FunctionNumber(5)),
        Constant::Function(FunctionNumber(6)),
        Constant::Function(FunctionNumber(7)),
    ]
}

fn function(parameters: Parameters, registers: u8, captures: Vec<Capture>, text: &str) -> ModuleFunction {
    ModuleFunction {
        parameters,
        registers,
        captures,
        constants: (0..constants().len() as u32).map(PoolIdx).collect(),
        code: assemble(text).unwrap_or_else(|error| panic!("{error}\n{text}")),
        ..ModuleFunction::default()
    }
}

/// Returns the functions that programs may use.
fn shared_functions() -> Vec<ModuleFunction> {
    let later = CaptureSource::Later;
    let captures = vec![
        Capture::value(CaptureSource::Register(0)),
        Capture::boxed(CaptureSource::Register(1)),
        Capture::value(later),
    ];
    let inherited =
        vec![Capture::value(CaptureSource::Capture(0)), Capture::value(CaptureSource::Register(4))];
    let optional = Parameters {
        required: 1,
        optional: 1,
        rest: true,
        keys: Some(vec![PoolIdx(0)]),
        allow_other_keys: false,
    };
    vec![
        function(Parameters::exactly(1), 2, vec![], "add-int r1 r0 1 \n return r1"),
        // Stores the sum of its first two captures in the second, a box; `patch-capture` sets the third.
        function(
            Parameters::default(),
            8,
            captures,
            "capture-ref r0 0 \n capture-box-ref r1 1 \n add r2 r0 r1 \n capture-box-set r2 1
             capture-ref r3 2
             move r4 r3 \n make-closure r5 k17 \n call r5.. 0 want 1 \n move r4 r5 \n list r5 r0.. 5
             return r5",
        ),
        function(
            optional,
            5,
            vec![],
            "jump-if-supplied r1 L \n load-int r1 -1 \n L: jump-if-supplied r3 M \n load-int r3 -3
             M: list r4 r0.. 4 \n return r4",
        ),
        function(
            Parameters::default(),
            3,
            inherited,
            "capture-ref r0 0 \n capture-ref r1 1 \n list r2 r0.. 2 \n return r2",
        ),
        // Adds the integers up to its argument, each in a frame of its own.
        function(
            Parameters::exactly(1),
            5,
            vec![],
            "jump-greater-int r0 0 L \n return r0 \n L: add-int r3 r0 -1 \n call-self r1.. 1 want 1
             add r4 r0 r1 \n return r4",
        ),
        // Adds the integers up to its first argument to its second.
        function(
            Parameters::exactly(2),
            8,
            vec![],
            "jump-greater-int r0 0 L \n return r1 \n L: add r6 r1 r0 \n add-int r4 r0 -1 \n load-nil r7.. 1
             move r5 r6 \n call-self r2.. 2 want 1 \n return r2",
        ),
        // Returns what its argument returns. A call for which the stack grows is none of the loop's, so it
        // calls one with many registers before.
        function(
            Parameters::exactly(1),
            4,
            vec![],
            "make-closure r1 k21 \n call r1.. 0 want 1 \n move r1 r0 \n call r1.. 0 want all \n return-all",
        ),
        function(Parameters::default(), 100, vec![], "load-nil r0.. 1 \n return r0"),
    ]
}

/// Returns the shared functions, then a function for each program.
pub(super) fn functions<'a>(programs: impl IntoIterator<Item = &'a str>) -> Vec<ModuleFunction> {
    let mains = programs.into_iter().map(|text| function(Parameters::default(), 16, vec![], text));
    shared_functions().into_iter().chain(mains).collect()
}

/// A machine without a library, with a class `POINT`, an instance of it in `V`, and the function `SUCCESSOR`.
/// Its programs are called by the function beside it, if there is one.
pub(super) struct Machine(Vm, Option<Value>);

impl Machine {
    pub(super) fn new() -> Machine {
        Machine::with(Config::default())
    }

    pub(super) fn with(config: Config) -> Machine {
        let mut vm = Vm::new(config, Box::new(VirtualHost::new())).unwrap();
        let Vm { heap, names, .. } = &mut vm;
        let mut intern = |name| names.intern(heap, &Symbol::esl(name)).unwrap();
        let [class, x, y] = ["POINT", "X", "Y"].map(&mut intern);
        names.define_class(heap, class, &[], &[x, y], Value::NIL).unwrap();
        let mut machine = Machine(vm, None);
        let successor = machine.load(["make-closure r0 k14 \n return r0"])[0];
        let successor = machine.0.call(successor, &[], u64::MAX).unwrap()[0];
        let Vm { heap, names, .. } = &mut machine.0;
        let symbol = names.intern(heap, &Symbol::esl("SUCCESSOR")).unwrap();
        heap.symbol_set_function(symbol, successor).unwrap();
        machine
    }

    /// A machine that makes machine code of all functions loaded from now on.
    #[cfg(feature = "native")]
    fn native() -> Machine {
        let mut machine = Machine::new();
        machine.0.set_tier(crate::vm::Tier::Native);
        assert_eq!(machine.0.tier().1.refused, None);
        let caller = machine.load(["make-closure r0 k20 \n return r0"])[0];
        machine.1 = Some(machine.0.call(caller, &[], u64::MAX).unwrap()[0]);
        machine
    }

    /// Returns the ticks of all tasks.
    pub(super) fn ticks(&self) -> u64 {
        self.0.ticks()
    }

    /// Sets the special variable to a new point.
    fn set_point(&mut self) {
        let Vm { heap, names, .. } = &mut self.0;
        let mut intern = |name| names.intern(heap, &Symbol::esl(name)).unwrap();
        let [v, name] = ["V", "POINT"].map(&mut intern);
        let class = names.find_class(name).unwrap();
        let point = heap.alloc_structure(class, &[Value::small(3), Value::small(4)]).unwrap();
        heap.symbol_set_value(v, point).unwrap();
    }

    /// Loads the programs as one module, and returns their functions.
    pub(super) fn load<'a>(&mut self, programs: impl IntoIterator<Item = &'a str>) -> Vec<Value> {
        let functions = functions(programs);
        let mains = shared_functions().len()..functions.len();
        let toplevel = mains.clone().map(|number| FunctionNumber(number as u32)).collect();
        let module = Module { constants: constants(), functions, toplevel, ..Module::default() };
        let Vm { heap, names, .. } = &mut self.0;
        let mut rest = load(heap, names, &module, &mut Alone::default()).unwrap();
        self.0.pin(rest);
        let mut items = Vec::with_capacity(mains.len());
        while let Some(pair) = self.0.heap.as_cons(rest) {
            items.push(pair.car);
            rest = pair.cdr;
        }
        items
    }

    /// Runs the function of a program, and returns its values or the description of its failure.
    pub(super) fn run(&mut self, function: Value) -> String {
        let result = match self.1 {
            Some(caller) => self.0.call(caller, &[function], u64::MAX),
            None => self.0.call(function, &[], u64::MAX),
        };
        match result {
            Ok(values) => {
                let values: Vec<String> = values.iter().map(|&v| describe(&self.0.heap, v)).collect();
                values.join(", ")
            }
            Err(error) => error.to_string(),
        }
    }

    /// Runs the programs, and lists those with another result than expected.
    pub(super) fn wrong<'a>(&mut self, programs: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
        let (programs, results): (Vec<&str>, Vec<&str>) = programs.into_iter().unzip();
        let functions = self.load(programs.iter().copied());
        let mut wrong = String::new();
        for ((program, expected), function) in programs.into_iter().zip(results).zip(functions) {
            let found = self.run(function);
            if found != expected {
                _ = writeln!(wrong, "{program}\nexpected {expected}\nfound    {found}\n");
            }
        }
        wrong
    }
}

/// Programs and what they return.
const PROGRAMS: &[(&str, &str)] = &[
    // Arithmetic: fixnums, doubles, both, and what is beyond them.
    (
        "load-int r0 7 \n load-int r1 2 \n add r2 r0 r1 \n sub r3 r0 r1 \n mul r4 r0 r1 \n floor r5 r0 r1
         truncate r6 r0 r1 \n mod r7 r0 r1 \n rem r8 r0 r1 \n add-int r9 r0 -3 \n div r10 r0 r1
         list r11 r2.. 9 \n return r11",
        "(9 5 14 3 3 1 1 4 7/2)",
    ),
    (
        "load-const r0 k6 \n load-const r1 k6 \n add r2 r0 r1 \n sub r3 r0 r1 \n mul r4 r0 r1 \n div r5 r0 r1
         add-int r6 r0 1 \n list r7 r2.. 5 \n return r7",
        "(3.0 0.0 2.25 1.0 2.5)",
    ),
    (
        "load-const r0 k6 \n load-int r1 2 \n add r2 r0 r1 \n sub r3 r1 r0 \n mul r4 r0 r1 \n div r5 r0 r1
         list r6 r2.. 4 \n return r6",
        "(3.5 0.5 3.0 0.75)",
    ),
    (
        "load-const r0 k5 \n add r1 r0 r0 \n sub r2 r0 r0 \n mul r3 r0 r0 \n add-int r4 r0 1
         load-const r7 k7 \n add r5 r7 r7 \n list r6 r1.. 5 \n return r6",
        "(9223372036854775808 0 21267647932558653966460912964485513216 4611686018427387905 2e300)",
    ),
    (
        "load-int r0 12 \n load-int r1 10 \n load-int r9 -2 \n logand r2 r0 r1 \n logior r3 r0 r1
         logxor r4 r0 r1
         ash r5 r0 r1 \n ash r6 r0 r9 \n load-int r7 100 \n ash r7 r0 r7 \n not r8 r0 \n list r10 r2.. 7
         return r10",
        "(8 14 6 12288 3 15211807202738752817960438464512 NIL)",
    ),
    (
        "load-int r0 7 \n load-int r1 -2 \n floor r2 r0 r1 \n truncate r3 r0 r1 \n mod r4 r0 r1
         rem r5 r0 r1
         load-const r8 k5 \n logand r6 r8 r0 \n ash r7 r8 r1 \n list r9 r2.. 6 \n return r9",
        "(-4 -3 -1 1 0 1152921504606846976)",
    ),
    ("load-true r0 \n load-int r1 1 \n add r2 r0 r1 \n return r2", ":TYPE-ERROR T NUMBER"),
    ("load-int r0 1 \n load-int r1 0 \n div r2 r0 r1 \n return r2", ":DIVISION-BY-ZERO / (1 0) NIL"),
    // Comparisons with the results T and NIL.
    (
        "load-int r0 1 \n load-const r1 k6 \n load-const r2 k5 \n load-const r3 k8 \n eq r4 r0 r0
         eql r5 r2 r2
         num-eq r6 r0 r1 \n less r7 r0 r1 \n less-eq r8 r2 r1 \n char-eq r9 r3 r3 \n is-type r10 r0 t5
         list r11 r4.. 7 \n return r11",
        "(T T NIL T NIL T T)",
    ),
    ("load-const r0 k8 \n load-int r1 1 \n char-eq r2 r0 r1 \n return r2", ":TYPE-ERROR 1 CHARACTER"),
    // Loops.
    ("load-int r0 0 \n L: add-int r0 r0 1 \n jump-greater-int r0 3 M \n loop L \n M: return r0", "4"),
    ("load-true r0 \n L: not r0 r0 \n loop-if-nil r0 L \n return r0", "T"),
    ("load-const r0 k11 \n list r0 r0.. 1 \n L: cdr r0 r0 \n loop-if-not-nil r0 L \n return r0", "NIL"),
    ("load-const r0 k11 \n list r0 r0.. 1 \n L: cdr r0 r0 \n loop-if-cons r0 L \n return r0", "NIL"),
    ("load-int r0 0 \n load-int r1 5 \n L: add-int r0 r0 1 \n loop-less r0 r1 L \n return r0", "5"),
    ("load-int r0 5 \n load-int r1 2 \n L: add-int r0 r0 -1 \n loop-not-less r0 r1 L \n return r0", "1"),
    (
        "load-int r0 0 \n load-int r1 5 \n load-int r2 0 \n L: add r2 r2 r0 \n loop-count r0 r1 1 L
         return r2",
        "10",
    ),
    ("load-const r0 k6 \n load-int r1 4 \n L: loop-count r0 r1 1 L \n return r0", "4.5"),
    ("load-true r0 \n load-int r1 4 \n L: loop-count r0 r1 1 L \n return r0", ":TYPE-ERROR T NUMBER"),
    // Lists.
    (
        "load-int r0 1 \n load-int r1 2 \n list r2 r0.. 2 \n car r3 r2 \n cdr r4 r2 \n cadr r5 r2
         cddr r6 r2
         cons r7 r0 r1 \n load-const r8 k8 \n set-car r7 r8 \n set-cdr r7 r0 \n load-nil r8.. 1 \n car r8 r8
         cddr r9 r8 \n list r10 r3.. 7 \n return r10",
        "(1 (2) 2 NIL (#\\b . 1) NIL NIL)",
    ),
    ("load-int r0 5 \n car r0 r0 \n return r0", ":TYPE-ERROR 5 LIST"),
    ("load-int r0 5 \n list r0 r0.. 1 \n list r1 r0.. 1 \n car r1 r1 \n cadr r0 r1 \n return r0", "NIL"),
    ("load-nil r0.. 1 \n set-car r0 r0 \n return r0", ":TYPE-ERROR NIL CONS"),
    // Vectors and strings.
    (
        "load-const r0 k10 \n load-int r1 1 \n load-int r2 0 \n vector-ref r3 r0 r1 \n vector-set r0 r2 r3
         array-ref r4 r0 r2 \n array-set r0 r1 r2 \n load-const r5 k9 \n char-ref r6 r5 r1
         array-ref r7 r5 r2 \n move r5 r0 \n list r8 r3.. 5 \n return r8",
        "(1.5 1.5 #(1.5 0) #\\b #\\a)",
    ),
    (
        "load-const r0 k10 \n load-int r1 2 \n vector-ref r0 r0 r1 \n return r0",
        ":TYPE-ERROR 2 (INTEGER 0 (2))",
    ),
    (
        "load-const r0 k10 \n load-int r1 7 \n vector-set-int r0 #1 r1 \n vector-ref-int r2 r0 #1
         vector-set-int r0 #0 r2 \n return r0",
        "#(7 7)",
    ),
    ("load-const r0 k10 \n vector-ref-int r0 r0 #2 \n return r0", ":TYPE-ERROR 2 (INTEGER 0 (2))"),
    ("load-const r0 k10 \n vector-set-int r0 #2 r0 \n return r0", ":TYPE-ERROR 2 (INTEGER 0 (2))"),
    ("load-int r0 5 \n vector-ref-int r0 r0 #0 \n return r0", ":TYPE-ERROR 5 SIMPLE-VECTOR"),
    ("load-int r0 5 \n vector-set-int r0 #0 r0 \n return r0", ":TYPE-ERROR 5 SIMPLE-VECTOR"),
    (
        "load-const r0 k9 \n load-int r1 3 \n load-const r2 k8 \n array-set r0 r1 r2 \n return r0",
        ":TYPE-ERROR 3 (INTEGER 0 (3))",
    ),
    (
        "load-const r0 k9 \n load-int r1 1 \n load-true r2 \n array-set r0 r1 r2 \n return r0",
        ":TYPE-ERROR T CHARACTER",
    ),
    // Variables.
    (
        "load-int r0 10 \n load-int r1 20 \n make-box r1 r1 \n make-closure r2 k15 \n patch-capture r2 2 r0
         move r5 r2 \n call r5.. 0 want 1 \n box-ref r6 r1 \n box-set r1 r0 \n box-ref r7 r1
         list r8 r5.. 3 \n return r8",
        "((10 20 30 10 (10 10)) 30 10)",
    ),
    (
        "load-int r0 1 \n set-symbol-value r0 k0 \n load-int r1 2 \n bind r1 k0 \n symbol-value r2 k0
         load-int r0 3 \n set-symbol-value r0 k0 \n symbol-value r3 k0 \n unbind 1 \n symbol-value r4 k0
         list r5 r2.. 3 \n return r5",
        "(2 3 1)",
    ),
    (
        "load-const r0 k0 \n list r0 r0.. 1 \n load-int r1 9 \n list r1 r1.. 1 \n push-scope r2..
         bind-list r0 r1 \n symbol-value r2 k0 \n pop-control 1 \n return r2",
        "9",
    ),
    (
        "load-int r0 9 \n push-scope r2.. \n bind-list r0 r0 \n pop-control 1 \n return r0",
        ":TYPE-ERROR 9 LIST",
    ),
    ("symbol-value r0 k3 \n return r0", ":UNBOUND-VARIABLE NOTHING"),
    ("function-ref r0 k3 \n return r0", ":UNDEFINED-FUNCTION NOTHING"),
    // Calls.
    ("function-ref r0 k1 \n load-int r2 1 \n call r0.. 1 want 1 \n return r0", "2"),
    ("load-const r0 k1 \n load-int r2 1 \n call r0.. 1 want 1 \n return r0", "2"),
    ("load-int r2 1 \n call-global r0.. 1 want 1 k1 \n return r0", "2"),
    ("load-int r2 1 \n call-global r0.. 1 want 1 k2 \n return r0", "(1)"),
    ("call-global r0.. 0 want 1 k3 \n return r0", ":UNDEFINED-FUNCTION NOTHING"),
    ("function-ref r0 k1 \n load-int r2 1 \n tail-call r0.. 1", "2"),
    ("load-const r0 k1 \n load-int r2 1 \n tail-call r0.. 1", "2"),
    ("load-int r2 1 \n tail-call-global r0.. 1 k1", "2"),
    ("load-int r2 1 \n tail-call-global r0.. 1 k2", "(1)"),
    (
        "function-ref r0 k2 \n load-int r2 1 \n load-const r3 k4 \n list r3 r3.. 1
         apply r0.. 2 want 1 \n return r0",
        "(1 1)",
    ),
    ("function-ref r0 k1 \n load-const r2 k4 \n list r2 r2.. 1 \n tail-apply r0.. 1", "2"),
    ("function-ref r0 k1 \n load-const r2 k4 \n tail-apply r0.. 1", ":TYPE-ERROR 1 LIST"),
    ("load-const r0 k4 \n call r0.. 0 want 1 \n return r0", ":TYPE-ERROR 1 FUNCTION"),
    ("load-const r0 k16 \n load-int r2 1 \n call r0.. 1 want 1 \n return r0", "(1 -1 NIL -3)"),
    (
        "load-const r0 k16 \n load-int r2 1 \n load-int r3 2 \n load-const r4 k0 \n load-int r5 4
         call r0.. 4 want 1 \n return r0",
        "(1 2 (V 4) 4)",
    ),
    (
        "load-const r0 k16 \n call r0.. 0 want 1 \n return r0",
        ":PROGRAM-ERROR \"an anonymous function was called with 0 arguments; it takes ...\"",
    ),
    (
        "load-const r0 k16 \n load-int r2 1 \n load-int r3 1 \n load-int r4 1 \n load-int r5 1
         tail-call r0.. 4",
        ":PROGRAM-ERROR \"an anonymous function has no key 1; its keys are V\"",
    ),
    ("make-closure r0 k18 \n load-int r2 300 \n call r0.. 1 want 1 \n return r0", "45150"),
    // Values.
    ("load-int r0 1 \n load-int r1 2 \n return-values r0.. 2", "1, 2"),
    ("load-int r0 1 \n return-values r0.. 1", "1"),
    ("load-int r0 1 \n load-int r1 2 \n set-values r0.. 2 \n return-all", "1, 2"),
    (
        "load-int r0 1 \n load-int r1 2 \n set-values r0.. 2 \n values-to-list r2 \n list-to-values r2
         get-values r3.. 3 \n list r6 r2.. 4 \n return r6",
        "((1 2) 1 2 NIL)",
    ),
    ("load-int r0 1 \n list-to-values r0 \n return-all", ":TYPE-ERROR 1 LIST"),
    // The control stack.
    (
        "new-tag r0 \n push-catch r1.. r0 want 2 L \n load-int r1 5 \n load-int r2 6 \n set-values r1.. 2
         throw r0 0 \n load-nil r1.. 2 \n pop-control 1 \n L: return-values r1.. 2",
        "5, 6",
    ),
    (
        "new-tag r0 \n load-int r1 5 \n set-values r1.. 1 \n throw r0 1 \n return r1",
        ":CONTROL-ERROR \"the block of this RETURN-FROM has been left\"",
    ),
    (
        "load-int r0 1 \n push-cleanup r1.. L \n load-int r1 7 \n set-values r1.. 1 \n enter-cleanup
         L: load-int r0 2 \n end-cleanup \n values-to-list r1 \n cons r1 r0 r1 \n return r1",
        "(2 7)",
    ),
    (
        "load-const r0 k10 \n push-recovery r1.. r0 L \n load-int r1 1 \n pop-control 1 \n return r1
         L: return r2",
        "1",
    ),
    (
        "load-nil r0.. 1 \n push-handlers r1.. r0 \n load-int r1 0 \n push-mask r2.. r1
         pop-control 2 \n return r1",
        "0",
    ),
    ("push-handler-case r1.. k12 L \n load-int r1 1 \n pop-control 1 \n return r1 \n L: return r2", "1"),
    ("pass 16777215 \n load-int r0 1 \n pass 0 \n return r0", "1"),
    ("point \n load-int r0 1 \n return r0", "1"),
    (
        "push-failure-cleanup r1.. L \n load-int r1 1 \n pop-control 1 \n return r1
         L: end-cleanup \n values-to-list r1 \n return r1",
        "1",
    ),
];

/// Programs with the instance in `V`. A class constant is resolved when it is first needed.
const INSTANCES: &[(&str, &str)] = &[
    (
        "symbol-value r0 k0 \n slot r1 r0 1 k13 \n load-int r2 8 \n set-slot r0 0 r2 k13 \n slot r2 r0 0 k13
         list r3 r1.. 2 \n return r3",
        "(4 8)",
    ),
    (
        "symbol-value r0 k0 \n jump-if-not-instance r0 k13 L \n load-int r0 1 \n return r0 \n L: return r0",
        "1",
    ),
    ("load-int r0 2 \n jump-if-not-instance r0 k13 L \n load-int r0 1 \n return r0 \n L: return r0", "2"),
    (
        "load-const r0 k9 \n jump-if-not-instance r0 k13 L \n load-int r0 1 \n return r0 \n L: return r0",
        "\"abc\"",
    ),
    ("load-int r0 2 \n slot r0 r0 0 k13 \n return r0", ":TYPE-ERROR 2 POINT"),
];

/// Jumps, with whether they are taken. `r0` to `r7` hold 1, 2, 1.5, 2^62, `NIL`, a pair, a string, and `T`.
const JUMPS: [(&str, bool); 41] = [
    ("jump L", true),
    ("jump-if-nil r4 L", true),
    ("jump-if-nil r0 L", false),
    ("jump-if-not-nil r0 L", true),
    ("jump-if-not-nil r4 L", false),
    ("jump-if-cons r5 L", true),
    ("jump-if-cons r4 L", false),
    ("jump-if-not-cons r4 L", true),
    ("jump-if-not-cons r5 L", false),
    ("jump-eq r0 r0 L", true),
    ("jump-eq r0 r1 L", false),
    ("jump-not-eq r0 r1 L", true),
    ("jump-eql r3 r3 L", true),
    ("jump-eql r3 r2 L", false),
    ("jump-not-eql r3 r6 L", true),
    ("jump-eql-const r3 k5 L", true),
    ("jump-eql-const r0 k5 L", false),
    ("jump-not-eql-const r2 k6 L", false),
    ("jump-if-type r0 t5 L", true),
    ("jump-if-type r6 t5 L", false),
    ("jump-if-not-type r6 t10 L", false),
    ("jump-num-eq r0 r0 L", true),
    ("jump-num-eq r3 r0 L", false),
    ("jump-not-num-eq r0 r2 L", true),
    ("jump-less r0 r1 L", true),
    ("jump-less r2 r2 L", false),
    ("jump-less r0 r3 L", true),
    ("jump-not-less r1 r0 L", true),
    ("jump-not-less r0 r3 L", false),
    ("jump-less-eq r0 r0 L", true),
    ("jump-less-eq r3 r2 L", false),
    ("jump-not-less-eq r3 r0 L", true),
    ("jump-num-eq-int r0 1 L", true),
    ("jump-num-eq-int r2 1 L", false),
    ("jump-not-num-eq-int r2 1 L", true),
    ("jump-less-int r0 2 L", true),
    ("jump-less-int r3 2 L", false),
    ("jump-not-less-int r3 2 L", true),
    ("jump-greater-int r3 2 L", true),
    ("jump-greater-int r0 2 L", false),
    ("jump-not-greater-int r2 2 L", true),
];

/// Returns a program that returns whether `jump` is taken.
fn jump_program(jump: &str) -> String {
    format!(
        "load-int r0 1 \n load-int r1 2 \n load-const r2 k6 \n load-const r3 k5 \n load-nil r4.. 1
         load-const r5 k11 \n load-const r6 k9 \n load-true r7
         {jump} \n load-nil r0.. 1 \n return r0 \n L: load-true r0 \n return r0"
    )
}

/// Returns programs that call builtins, whose numbers come from the table.
fn builtin_programs() -> [(String, &'static str); 5] {
    let [list, values, cons] = [Builtin::List, Builtin::Values, Builtin::Cons].map(|builtin| builtin as u32);
    [
        (
            format!("load-int r2 1 \n load-int r3 2 \n call-builtin r0.. 2 want 1 b{cons} \n return r0"),
            "(1 . 2)",
        ),
        (
            format!(
                "load-int r2 1 \n load-int r3 2 \n call-builtin r0.. 2 want 2 b{values}
                 return-values r0.. 2"
            ),
            "1, 2",
        ),
        (format!("load-int r2 1 \n call-builtin r0.. 1 want all b{list} \n return-all"), "(1)"),
        (format!("load-int r2 1 \n tail-call-builtin r0.. 1 b{list}"), "(1)"),
        (format!("load-int r2 1 \n load-int r3 2 \n tail-call-builtin r0.. 2 b{values}"), "1, 2"),
    ]
}

#[test]
fn programs_return_what_they_should() {
    assert_eq!(Machine::new().wrong(PROGRAMS.iter().copied()), "");
    let builtins = builtin_programs();
    assert_eq!(Machine::new().wrong(builtins.iter().map(|(program, expected)| (&**program, *expected))), "");
}

#[test]
fn jumps_are_taken_when_their_test_holds() {
    let programs = JUMPS.map(|(jump, is_taken)| (jump_program(jump), if is_taken { "T" } else { "NIL" }));
    assert_eq!(Machine::new().wrong(programs.iter().map(|(program, expected)| (&**program, *expected))), "");
}

#[test]
fn slots_are_read_and_written() {
    let mut machine = Machine::new();
    machine.set_point();
    assert_eq!(machine.wrong(INSTANCES.iter().copied()), "");
}

#[test]
#[cfg(feature = "native")]
fn machine_code_does_what_the_arms_do() {
    let jumps = JUMPS.map(|(jump, is_taken)| (jump_program(jump), if is_taken { "T" } else { "NIL" }));
    let builtins = builtin_programs();
    let owned = jumps.iter().chain(&builtins).map(|(program, expected)| (&**program, *expected));
    let mut machine = Machine::native();
    assert_eq!(machine.wrong(owned.chain(PROGRAMS.iter().copied())), "");
    machine.set_point();
    assert_eq!(machine.wrong(INSTANCES.iter().copied()), "");
    let report = machine.0.tier().1;
    assert_eq!(report.refused, None);
    assert!(report.functions > JUMPS.len() + PROGRAMS.len(), "{} functions", report.functions);
}

#[test]
#[cfg_attr(miri, ignore = "there is nothing unsafe in a table")]
fn every_opcode_is_in_a_program() {
    let mut found = BTreeSet::new();
    let jumps = JUMPS.map(|(jump, _)| jump_program(jump));
    let builtins = builtin_programs();
    let programs = PROGRAMS.iter().chain(INSTANCES).map(|(program, _)| *program);
    let programs = programs.chain(jumps.iter().map(|program| &**program));
    for function in functions(programs.chain(builtins.iter().map(|(program, _)| &**program))) {
        let mut at = 0;
        while let Some(opcode) = function.code.get(at).and_then(|&word| Opcode::from_number(word as u8)) {
            found.insert(opcode as u8);
            at += opcode.words();
        }
    }
    let missing: Vec<&str> =
        OPCODES.iter().filter(|row| !found.contains(&(row.opcode as u8))).map(|row| row.mnemonic).collect();
    assert_eq!(missing, Vec::<&str>::new());
}
