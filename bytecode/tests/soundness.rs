//! The verifier against a model of the interpreter that knows what each register really holds.
//!
//! Random code that the verifier accepts is run by the model, which takes every freedom that a real run has:
//! tests go either way, instructions fail and are recovered from in all ways, anything that can land an
//! unwinding does. The model checks all assumptions of the interpreter (V1 to V11).

mod support;

use esl_bytecode::assembler::assemble;
use esl_bytecode::disasm;
use esl_bytecode::module::{CaptureSource, Constant, FunctionNumber, Module, ModuleFunction};
use esl_bytecode::opcode::{CallOperands, Instr, OPCODES, Substitute};
use esl_bytecode::operand::{Count, Role, Want, Window};
use esl_bytecode::verify::verify;
use support::{Random, build, module_with_random_code};

/// The contents of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ModelCell {
    /// A link word or a leftover of another frame.
    Garbage,
    Object,
    /// A closure of this function, made by this frame.
    Closure(u32),
    Box,
    Marker,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ModelKind {
    Catch {
        to: usize,
        want: Want,
    },
    HandlerCase {
        to: usize,
    },
    Cleanup {
        to: usize,
    },
    FailureCleanup {
        to: usize,
    },
    /// It came about by `enter-cleanup`, or by an unwinding to the entry with this index, or to somewhere
    /// below this frame.
    Running {
        unwinding: Option<ModelTarget>,
        value_list: bool,
    },
    Scope,
    Other,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ModelTarget {
    Entry(usize),
    Caller,
}

#[derive(Clone, Copy, Debug)]
struct ModelEntry {
    kind: ModelKind,
    window: u8,
    bindings: usize,
}

/// How a binding came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ModelBinding {
    One,
    OfList,
}

/// The successor of an instruction.
enum ModelNext {
    Instruction,
    Jump(usize),
    Left,
}

struct Model<'a> {
    module: &'a Module,
    function: &'a ModuleFunction,
    random: &'a mut Random,
    registers: Vec<ModelCell>,
    entries: Vec<ModelEntry>,
    bindings: Vec<ModelBinding>,
    /// Whether the value list is as this frame set it.
    value_list: bool,
    pc: usize,
}

impl<'a> Model<'a> {
    fn new(module: &'a Module, random: &'a mut Random) -> Model<'a> {
        let function = &module.functions[0];
        let parameters = &function.parameters;
        let mut registers = vec![ModelCell::Garbage; usize::from(function.registers)];
        let rest = usize::from(parameters.required + parameters.optional);
        for (number, register) in registers[..parameters.registers()].iter_mut().enumerate() {
            let certain = number < usize::from(parameters.required) || (parameters.rest && number == rest);
            *register = if certain || random.once_in(2) { ModelCell::Object } else { ModelCell::Marker };
        }
        Model {
            module,
            function,
            random,
            registers,
            entries: Vec::new(),
            bindings: Vec::new(),
            value_list: false,
            pc: 0,
        }
    }

    /// Runs up to `limit` instructions.
    fn run(&mut self, limit: usize) {
        for _ in 0..limit {
            let instr = Instr::decode(&self.function.code, self.pc).expect("V1: an instruction");
            let next = self.pc + instr.opcode().words();
            let outcome =
                if self.random.once_in(6) { self.fail(instr, next) } else { self.step(instr, next) };
            match outcome {
                ModelNext::Instruction => self.pc = next,
                ModelNext::Jump(to) => self.pc = to,
                ModelNext::Left => return,
            }
        }
    }

    fn read(&self, register: u8) {
        let cell = self.registers[usize::from(register)];
        assert!(matches!(cell, ModelCell::Object | ModelCell::Closure(_)), "V6: r{register} holds {cell:?}");
    }

    fn read_all(&self, first: u8, Count(count): Count) {
        (0..count).for_each(|i| self.read(first + i));
    }

    fn read_box(&self, register: u8) {
        assert_eq!(self.registers[usize::from(register)], ModelCell::Box, "V7: r{register}");
    }

    fn write(&mut self, register: u8, cell: ModelCell) {
        self.registers[usize::from(register)] = cell;
    }

    fn write_all(&mut self, first: u8, count: u8) {
        (0..count).for_each(|i| self.write(first + i, ModelCell::Object));
    }

    /// Frames of others have lain over the registers from here on, and used the value list.
    fn others_ran(&mut self, from: u8) {
        self.registers[usize::from(from)..].fill(ModelCell::Garbage);
        self.value_list = false;
    }

    /// The operands of `instr` must be in order, since it may look at them before it fails.
    fn fail(&mut self, instr: Instr, next: usize) -> ModelNext {
        let substitute = instr.opcode().substitute();
        if substitute == Substitute::Silent {
            return self.step(instr, next);
        }
        self.others_ran(self.function.registers);
        if self.random.once_in(2) {
            return self.unwind_somewhere();
        }
        match (substitute, instr) {
            (Substitute::Value, _) => {
                let mut first = None;
                instr.visit_operands(|role| first = first.or(Some(role)));
                let Some(Role::Write(register)) = first else { panic!("no first operand: {instr}") };
                self.write(register, ModelCell::Object);
                ModelNext::Instruction
            }
            (Substitute::Test | Substitute::TestNot, _) => self.maybe_jump(instr, next),
            (Substitute::Call | Substitute::Tail, _) => match instr.call() {
                Some(CallOperands { window, want: Some(want), .. }) => {
                    self.deliver(window, want);
                    ModelNext::Instruction
                }
                _ => ModelNext::Left,
            },
            (Substitute::Effect, _) => {
                // M5: the value list is empty then, or what the recovery gave, and not what others have left.
                self.value_list = matches!(instr, Instr::ListToValues { .. } | Instr::Throw { .. });
                ModelNext::Instruction
            }
            (Substitute::Never | Substitute::Silent, _) => self.step(instr, next),
        }
    }

    fn unwind_somewhere(&mut self) -> ModelNext {
        let targets: Vec<usize> = (0..self.entries.len())
            .filter(|&at| {
                let kind = self.entries[at].kind;
                matches!(
                    kind,
                    ModelKind::Catch { .. }
                        | ModelKind::HandlerCase { .. }
                        | ModelKind::FailureCleanup { .. }
                )
            })
            .collect();
        let target = match targets.is_empty() || self.random.once_in(4) {
            true => ModelTarget::Caller,
            false => ModelTarget::Entry(self.random.pick(&targets)),
        };
        self.unwind(target)
    }

    fn unwind(&mut self, target: ModelTarget) -> ModelNext {
        while let Some(entry) = self.entries.pop() {
            self.bindings.truncate(entry.bindings);
            if target == ModelTarget::Entry(self.entries.len()) {
                self.others_ran(entry.window);
                match entry.kind {
                    ModelKind::Catch { to, want } => {
                        self.deliver(Window(entry.window), want);
                        return ModelNext::Jump(to);
                    }
                    ModelKind::HandlerCase { to } => {
                        self.write_all(entry.window, 2);
                        return ModelNext::Jump(to);
                    }
                    ModelKind::FailureCleanup { to } => {
                        let kind = ModelKind::Running { unwinding: None, value_list: true };
                        self.entries.push(ModelEntry { kind, ..entry });
                        self.value_list = false;
                        return ModelNext::Jump(to);
                    }
                    kind => panic!("landed at {kind:?}"),
                }
            }
            let runs = match entry.kind {
                ModelKind::Cleanup { to } => Some(to),
                // For an abort, not for a throw.
                ModelKind::FailureCleanup { to }
                    if target == ModelTarget::Caller && self.random.once_in(2) =>
                {
                    Some(to)
                }
                _ => None,
            };
            if let Some(to) = runs {
                self.others_ran(entry.window);
                let kind = ModelKind::Running { unwinding: Some(target), value_list: false };
                self.entries.push(ModelEntry { kind, ..entry });
                return ModelNext::Jump(to);
            }
        }
        ModelNext::Left
    }

    fn deliver(&mut self, window: Window, want: Want) {
        self.write_all(window.0, want.registers());
        self.value_list = want == Want::ALL;
    }

    fn call(&mut self, CallOperands { callee, window, count, want }: CallOperands) -> ModelNext {
        assert!(u32::from(window.0) + 2 + u32::from(count.0) <= u32::from(self.function.registers), "V3");
        if callee.is_in_window() {
            self.read(window.0);
        }
        self.read_all(window.0 + 2, count);
        let Some(want) = want else { return self.leave() };
        for entry in &self.entries {
            assert!(window.0 >= entry.window, "V10");
        }
        self.others_ran(window.0);
        if self.random.once_in(3) {
            return self.unwind_somewhere();
        }
        self.deliver(window, want);
        ModelNext::Instruction
    }

    fn leave(&self) -> ModelNext {
        assert!(self.entries.is_empty() && self.bindings.is_empty(), "V9: leaves something behind");
        ModelNext::Left
    }

    fn maybe_jump(&mut self, instr: Instr, next: usize) -> ModelNext {
        let mut to = None;
        instr.visit_operands(|role| {
            if let Role::Forward(distance) | Role::Backward(distance) = role {
                to = next.checked_add_signed(distance as isize);
            }
        });
        let always = !instr.opcode().falls_through();
        match to {
            Some(to) if always || self.random.once_in(2) => {
                if to < next {
                    self.value_list = false;
                }
                ModelNext::Jump(to)
            }
            _ => ModelNext::Instruction,
        }
    }

    fn push(&mut self, kind: ModelKind, window: Window) {
        self.entries.push(ModelEntry { kind, window: window.0, bindings: self.bindings.len() });
    }

    fn step(&mut self, instr: Instr, next: usize) -> ModelNext {
        if let Some(call) = instr.call() {
            return self.call(call);
        }
        let landing = |distance: i32| next.checked_add_signed(distance as isize).expect("V2");
        match instr {
            Instr::Move { dst, src } => {
                let cell = self.registers[usize::from(src.0)];
                assert!(!matches!(cell, ModelCell::Garbage | ModelCell::Marker), "V6: moves {cell:?}");
                self.write(dst.0, cell);
            }
            Instr::LoadNil { first, count } => self.write_all(first.0, count.0),
            Instr::List { dst, first, count } => {
                self.read_all(first.0, count);
                self.write(dst.0, ModelCell::Object);
            }
            Instr::JumpIfSupplied { test, to } => match self.registers[usize::from(test.0)] {
                ModelCell::Marker => {}
                ModelCell::Object => return ModelNext::Jump(landing(to.0.into())),
                cell => panic!("V6: tests {cell:?}"),
            },
            Instr::LoopCount { counter, limit, .. } => {
                self.read(counter.0);
                self.read(limit.0);
                self.write(counter.0, ModelCell::Object);
                return self.maybe_jump(instr, next);
            }
            Instr::MakeBox { dst, src } => {
                self.read(src.0);
                self.write(dst.0, ModelCell::Box);
            }
            Instr::BoxRef { dst, cell } => {
                self.read_box(cell.0);
                self.write(dst.0, ModelCell::Object);
            }
            Instr::BoxSet { cell, src } => {
                self.read_box(cell.0);
                self.read(src.0);
            }
            Instr::MakeClosure { dst, function } => {
                let index = self.function.constants[usize::from(function.0)];
                let Constant::Function(number) = self.module.constants[index.0 as usize] else {
                    panic!("V4")
                };
                for capture in &self.module.functions[number.0 as usize].captures {
                    match capture.source {
                        CaptureSource::Register(register) if capture.boxed => self.read_box(register),
                        CaptureSource::Register(register) => self.read(register),
                        CaptureSource::Capture(own) => {
                            assert_eq!(self.function.captures[usize::from(own)].boxed, capture.boxed, "V8");
                        }
                        CaptureSource::Later => assert!(!capture.boxed, "V8"),
                    }
                }
                self.write(dst.0, ModelCell::Closure(number.0));
            }
            Instr::PatchCapture { closure, index, src } => {
                self.read(src.0);
                let ModelCell::Closure(number) = self.registers[usize::from(closure.0)] else { panic!("V8") };
                let capture = self.module.functions[number as usize].captures[usize::from(index.0)];
                assert_eq!(capture.source, CaptureSource::Later, "V8");
            }
            Instr::CaptureRef { dst, index } => {
                let boxed = self.function.captures[usize::from(index.0)].boxed;
                self.write(dst.0, if boxed { ModelCell::Box } else { ModelCell::Object });
            }
            Instr::CaptureBoxRef { dst, index } => {
                assert!(self.function.captures[usize::from(index.0)].boxed, "V7");
                self.write(dst.0, ModelCell::Object);
            }
            Instr::CaptureBoxSet { src, index } => {
                assert!(self.function.captures[usize::from(index.0)].boxed, "V7");
                self.read(src.0);
            }
            Instr::Bind { src, .. } => {
                self.read(src.0);
                self.bindings.push(ModelBinding::One);
            }
            Instr::Unbind { count } => {
                let since = self.entries.last().map_or(0, |entry| entry.bindings);
                for _ in 0..count.0 {
                    assert!(self.bindings.len() > since, "V9: unbinds too much");
                    assert_eq!(self.bindings.pop(), Some(ModelBinding::One), "V9");
                }
            }
            Instr::BindList { symbols, values } => {
                self.read(symbols.0);
                self.read(values.0);
                assert_eq!(self.entries.last().map(|entry| entry.kind), Some(ModelKind::Scope), "V9");
                let count = self.random.below(3);
                self.bindings.extend(std::iter::repeat_n(ModelBinding::OfList, count));
            }
            Instr::Return { src } => {
                self.read(src.0);
                return self.leave();
            }
            Instr::ReturnValues { first, count } => {
                self.read_all(first.0, count);
                return self.leave();
            }
            Instr::ReturnAll {} => {
                assert!(self.value_list, "V11");
                return self.leave();
            }
            Instr::SetValues { first, count } => {
                self.read_all(first.0, count);
                self.value_list = true;
            }
            Instr::GetValues { first, count } => {
                assert!(self.value_list, "V11");
                self.write_all(first.0, count.0);
            }
            Instr::ValuesToList { dst } => {
                assert!(self.value_list, "V11");
                self.write(dst.0, ModelCell::Object);
            }
            Instr::ListToValues { src } => {
                self.read(src.0);
                self.value_list = true;
            }
            Instr::PushCatch { window, tag, want, to } => {
                self.read(tag.0);
                self.push(ModelKind::Catch { to: landing(to.0), want }, window);
            }
            Instr::PushCleanup { window, to } => self.push(ModelKind::Cleanup { to: landing(to.0) }, window),
            Instr::PushHandlerCase { window, to, .. } => {
                self.push(ModelKind::HandlerCase { to: landing(to.0) }, window);
            }
            Instr::PushRecovery { window, state, to } => {
                self.read(state.0);
                self.push(ModelKind::HandlerCase { to: landing(to.0) }, window);
            }
            Instr::PushFailureCleanup { window, to } => {
                self.push(ModelKind::FailureCleanup { to: landing(to.0) }, window);
            }
            Instr::PushHandlers { window, handlers: read } | Instr::PushMask { window, from: read } => {
                self.read(read.0);
                self.push(ModelKind::Other, window);
            }
            Instr::PushScope { window } => self.push(ModelKind::Scope, window),
            Instr::PopControl { count } => {
                for _ in 0..count.0 {
                    let entry = self.entries.pop().expect("V9: pops what it pushed");
                    assert!(
                        !matches!(entry.kind, ModelKind::Cleanup { .. } | ModelKind::Running { .. }),
                        "V9"
                    );
                    self.bindings.truncate(entry.bindings);
                }
            }
            Instr::EnterCleanup {} => {
                let value_list = std::mem::take(&mut self.value_list);
                let entry = self.entries.last_mut().expect("V9: a cleanup");
                assert!(matches!(entry.kind, ModelKind::Cleanup { .. }), "V9");
                assert_eq!(entry.bindings, self.bindings.len(), "V9");
                entry.kind = ModelKind::Running { unwinding: None, value_list };
            }
            Instr::EndCleanup {} => {
                let entry = self.entries.pop().expect("V9: a running cleanup");
                assert_eq!(entry.bindings, self.bindings.len(), "V9");
                match entry.kind {
                    ModelKind::Running { unwinding: None, value_list } => self.value_list = value_list,
                    ModelKind::Running { unwinding: Some(target), .. } => return self.unwind(target),
                    kind => panic!("V9: ends {kind:?}"),
                }
            }
            Instr::Throw { tag, .. } => {
                self.read(tag.0);
                assert!(self.value_list, "V11");
                return self.unwind_somewhere();
            }
            _ => {
                let mut reads = Vec::new();
                let mut write = None;
                instr.visit_operands(|role| match role {
                    Role::Read(register) => reads.push(register),
                    Role::Write(register) => write = Some(register),
                    _ => {}
                });
                reads.iter().for_each(|&register| self.read(register));
                if let Some(register) = write {
                    self.write(register, ModelCell::Object);
                }
                return self.maybe_jump(instr, next);
            }
        }
        ModelNext::Instruction
    }
}

#[test]
fn what_is_verified_keeps_its_promises() {
    let cases: u64 = std::env::var("ESL_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(40_000);
    let mut accepted = 0;
    let mut used = std::collections::BTreeMap::new();
    for seed in 0..cases {
        let module = module_with_random_code(&mut Random(seed));
        if verify(&module).is_err() {
            continue;
        }
        accepted += 1;
        let run = std::panic::AssertUnwindSafe(|| {
            for round in 0..10 {
                Model::new(&module, &mut Random(seed ^ (round << 32))).run(100);
            }
        });
        if std::panic::catch_unwind(run).is_err() {
            let text = disasm::function(&module, FunctionNumber(0));
            panic!("the code of seed {seed} breaks the promise named above:\n{text}");
        }
        let mut pc = 0;
        while let Some(instr) = Instr::decode(&module.functions[0].code, pc) {
            *used.entry(instr.opcode().mnemonic()).or_insert(0) += 1;
            pc += instr.opcode().words();
        }
    }
    // The test is worth something only if enough code passes, and not just trivial code.
    assert!(accepted * 100 >= cases * 3, "only {accepted} of {cases} pass");
    for mnemonic in
        ["push-catch", "end-cleanup", "patch-capture", "capture-box-ref", "jump-if-supplied", "box-ref"]
    {
        assert!(used.get(mnemonic).copied().unwrap_or(0) >= 5, "{mnemonic}: {used:?}");
    }
}

#[test]
fn random_instructions_do_no_harm() {
    for seed in 0..20_000 {
        let random = &mut Random(seed);
        let mut module = module_with_random_code(random);
        let registers = random.next() as u8;
        let code = &mut module.functions[0].code;
        for _ in 0..random.below(8) {
            // Small numbers mean something more often.
            let largest = random.pick(&[1, 8, 1 << 16, 1 << 32]);
            let opcode = random.pick(OPCODES).opcode;
            let (word, aux) = build(opcode, |_| random.below(largest) as u32).encode();
            let at = random.below(code.len());
            code.splice(at..at, std::iter::once(word).chain(aux));
        }
        module.functions[0].registers = registers;
        let _ = verify(&module);
        disasm::module(&module);
    }
}

#[test]
fn the_assembler_undoes_the_disassembler() {
    for seed in 0..2000 {
        let module = module_with_random_code(&mut Random(seed));
        let text = disasm::function(&module, FunctionNumber(0));
        // A title and the size of the frame come first.
        let is_listing = |line: &&str| !line.starts_with("  capture") && !line.starts_with("  ;");
        let listing: Vec<&str> = text.lines().skip(2).filter(is_listing).collect();
        assert_eq!(assemble(&listing.join("\n")).as_ref(), Ok(&module.functions[0].code), "{text}");
    }
}
