//! The data flow over a function (V1's end, V6 to V11): what is known at each place, on every path to it.
//!
//! A state is kept for each word that control can come to from elsewhere. Whenever one of them changes, the
//! code from there on is gone through again, lowest word first: straight code once, a loop once more for each
//! loop around it. States only ever lose knowledge, so this ends; a limit of work ends it sooner for code
//! that no compiler makes.

use std::collections::BTreeSet;

use super::error::{Fault, FaultPlace, VerifyError};
use super::expect::{
    assign, call, expect_entry, expect_no_bindings, expect_value_list, expect_window, leave, pop, read,
    read_all, read_box, readable,
};
use super::pool;
use super::registers::{Class, RegisterSet, Registers};
use super::shape::CodeShape;
use super::state::{KnownEntry, LandingState, PlaceState, VerifiedEntry};
use crate::module::{
    CaptureSource, Constant, FunctionNumber, MAX_CONTROL, Module, ModuleFunction, Parameters, VariablePlace,
};
use crate::opcode::{Instr, RegisterAccess, Substitute};
use crate::operand::{Count, FunctionIdx, Role, Want, Window};

/// Work for each instruction: how often it may be gone through, times the control entries that then stand.
const WORK_PER_INSTRUCTION: usize = 1024;
/// Work that every function may take.
const WORK_FOR_ALL: usize = 16_384;
/// How large the states that are kept may be together, in control entries.
const MAX_STATE_WEIGHT: usize = 200_000;

/// Checks the function, whose instructions by themselves are in order.
pub(super) fn verify(module: &Module, number: FunctionNumber, shape: &CodeShape) -> Result<(), VerifyError> {
    let function = pool::function(module, number)
        .map_err(|fault| VerifyError { place: FaultPlace::Function(number), fault })?;
    let mut flow = Flow {
        module,
        function,
        shape,
        variables: registers_of_variables(function),
        states: vec![None; function.code.len()],
        pending: BTreeSet::new(),
        work: WORK_FOR_ALL + shape.instructions * WORK_PER_INSTRUCTION,
        weight: 0,
    };
    flow.run().map_err(|(pc, fault)| VerifyError { place: FaultPlace::Instruction(number, pc as u32), fault })
}

/// Returns which registers are said to hold variables, from each word on at which that changes.
fn registers_of_variables(function: &ModuleFunction) -> Vec<(u32, RegisterSet)> {
    let mut changes: Vec<(u32, bool, u8)> = Vec::new();
    for variable in &function.variables {
        if let VariablePlace::Register(register) = variable.place {
            changes.extend([(variable.from, true, register), (variable.to, false, register)]);
        }
    }
    changes.sort_unstable();
    let mut counts = [0_u32; 256];
    let mut held = RegisterSet::default();
    let mut rows: Vec<(u32, RegisterSet)> = Vec::new();
    for (word, begins, register) in changes {
        let count = &mut counts[usize::from(register)];
        // At one word, ends come before begins, so a count never drops below zero.
        *count = if begins { *count + 1 } else { *count - 1 };
        if *count == 0 {
            held.remove(register)
        } else {
            held.insert(register)
        }
        match rows.last_mut() {
            Some((last, registers)) if *last == word => *registers = held,
            _ => rows.push((word, held)),
        }
    }
    rows
}

struct Flow<'a> {
    module: &'a Module,
    function: &'a ModuleFunction,
    shape: &'a CodeShape,
    /// From which words on which registers are said to hold variables, by ascending words.
    variables: Vec<(u32, RegisterSet)>,
    /// For words that control gets to from elsewhere: what is known there.
    states: Vec<Option<Box<PlaceState>>>,
    /// Words whose state has changed since they were gone through.
    pending: BTreeSet<usize>,
    /// How much may still be done.
    work: usize,
    /// How large the states are together.
    weight: usize,
}

impl Flow<'_> {
    fn run(&mut self) -> Result<(), (usize, Fault)> {
        let entry = PlaceState::new(on_entry(&self.function.parameters));
        self.arrive(0, &entry).map_err(|fault| (0, fault))?;
        while let Some(pc) = self.pending.pop_first() {
            self.run_from(pc)?;
        }
        Ok(())
    }

    /// Goes on from `start` until control leaves or comes to a place with a state of its own.
    fn run_from(&mut self, start: usize) -> Result<(), (usize, Fault)> {
        let Some(mut state) = self.states[start].as_deref().cloned() else { return Ok(()) };
        self.charge(state.weight()).map_err(|fault| (start, fault))?;
        let mut pc = start;
        let mut ahead = self.variables.partition_point(|&(from, _)| from as usize <= start);
        loop {
            let here = |fault| (pc, fault);
            while self.variables.get(ahead).is_some_and(|&(from, _)| from as usize <= pc) {
                ahead += 1;
            }
            if let Some(&(_, held)) = ahead.checked_sub(1).and_then(|index| self.variables.get(index))
                && let Some(register) = state.registers.first_unknown(held)
            {
                return Err(here(Fault::Variable(register)));
            }
            self.charge(1 + state.entries.len()).map_err(here)?;
            let instr = Instr::decode(&self.function.code, pc).ok_or(here(Fault::MissingAux))?;
            let next = pc + instr.opcode().words();
            let falls_through = self.step(&mut state, instr, next).map_err(here)?;
            self.tell_landings(&mut state).map_err(here)?;
            if !falls_through {
                return Ok(());
            }
            if next >= self.function.code.len() {
                return Err(here(Fault::FallsOff));
            }
            if self.shape.is_target(next) {
                return self.arrive(next, &state).map_err(here);
            }
            pc = next;
        }
    }

    /// Control comes to `pc` with `state`.
    fn arrive(&mut self, pc: usize, state: &PlaceState) -> Result<(), Fault> {
        let changed = match &mut self.states[pc] {
            Some(known) => {
                let before = known.weight();
                let changed = known.meet(state)?;
                self.weight = self.weight - before + known.weight();
                changed
            }
            unknown @ None => {
                self.weight += state.weight();
                *unknown = Some(Box::new(PlaceState { lost: false, ..state.clone() }));
                true
            }
        };
        if self.weight > MAX_STATE_WEIGHT {
            return Err(Fault::TooComplex);
        }
        if changed {
            self.pending.insert(pc);
        }
        Ok(())
    }

    /// Control may leave the straight path for `to`.
    fn jump(&mut self, state: &mut PlaceState, to: usize) -> Result<(), Fault> {
        self.tell_landings(state)?;
        self.arrive(to, state)
    }

    /// If something was lost that code relies on at which entries land, that code is told.
    fn tell_landings(&mut self, state: &mut PlaceState) -> Result<(), Fault> {
        if std::mem::take(&mut state.lost) {
            for at in 0..state.entries.len() {
                self.land(state, at)?;
            }
        }
        Ok(())
    }

    /// An unwinding may end at entry `at`.
    fn land(&mut self, state: &PlaceState, at: usize) -> Result<(), Fault> {
        if let Some(landing) = state.entries[at].landing {
            let landed = state.landed(at, landing);
            self.charge(landed.weight())?;
            self.arrive(landing.to as usize, &landed)?;
        }
        Ok(())
    }

    fn charge(&mut self, work: usize) -> Result<(), Fault> {
        self.work = self.work.checked_sub(work).ok_or(Fault::TooComplex)?;
        Ok(())
    }

    /// Works `instr` on `state`, and says whether control goes on with the next instruction.
    fn step(&mut self, state: &mut PlaceState, instr: Instr, next: usize) -> Result<bool, Fault> {
        let value_list = state.registers.value_list;
        if instr.opcode().substitute() != Substitute::Silent {
            // A recovery may have run.
            state.registers.value_list = false;
        }
        if let Some(call) = instr.call() {
            return self::call(state, call);
        }
        match instr {
            Instr::Move { dst, src } => {
                let class = readable(state, src.0)?;
                let closure = state.registers.closure(src.0);
                state.set(dst.0, Some(class));
                if let Some(function) = closure {
                    state.set_closure(dst.0, function);
                }
            }
            Instr::JumpIfSupplied { test, to } => {
                if state.registers.class(test.0) != Some(Class::MaybeUnsupplied) {
                    return Err(Fault::NotParameter(test.0));
                }
                let mut supplied = state.clone();
                supplied.set(test.0, Some(Class::Value));
                self.jump(&mut supplied, target(next, to.0.into()))?;
                state.set(test.0, None);
            }
            Instr::LoopCount { counter, limit, to, .. } => {
                read(state, counter.0)?;
                read(state, limit.0)?;
                state.set(counter.0, Some(Class::Value));
                state.registers.value_list = false;
                self.jump(state, target(next, to.0))?;
            }

            Instr::MakeBox { dst, src } => {
                read(state, src.0)?;
                state.set(dst.0, Some(Class::Box));
            }
            Instr::BoxRef { dst, cell } => {
                read_box(state, cell.0)?;
                state.set(dst.0, Some(Class::Value));
            }
            Instr::BoxSet { cell, src } => {
                read_box(state, cell.0)?;
                read(state, src.0)?;
            }
            Instr::MakeClosure { dst, function } => self.make_closure(state, dst.0, function)?,
            Instr::PatchCapture { closure, index, src } => {
                read(state, src.0)?;
                read(state, closure.0)?;
                let made = state.registers.closure(closure.0).ok_or(Fault::Patch(closure.0))?;
                let captures = &pool::function(self.module, FunctionNumber(made))?.captures;
                match captures.get(usize::from(index.0)) {
                    Some(capture) if capture.source == CaptureSource::Later => {}
                    _ => return Err(Fault::Patch(closure.0)),
                }
            }
            Instr::CaptureRef { dst, index } => {
                let capture = self.function.captures.get(usize::from(index.0));
                let boxed = capture.ok_or(Fault::Capture(index.0))?.boxed;
                state.set(dst.0, Some(if boxed { Class::Box } else { Class::Value }));
            }

            Instr::Bind { src, .. } => {
                read(state, src.0)?;
                state.bindings += 1;
            }
            Instr::Unbind { count } => {
                let left = state.bindings.checked_sub(count.0.into());
                state.bindings = left.ok_or(Fault::UnbindCount(count.0))?;
            }
            Instr::BindList { symbols, values } => {
                read(state, symbols.0)?;
                read(state, values.0)?;
                expect_entry(state, VerifiedEntry::Scope, "a scope")?;
                // Only popping the scope undoes these, and so whatever lies under them.
                state.bindings = 0;
            }

            Instr::Return { src } => {
                read(state, src.0)?;
                return leave(state);
            }
            Instr::ReturnValues { first, count } => {
                read_all(state, first.0, count)?;
                return leave(state);
            }
            Instr::ReturnAll {} => {
                expect_value_list(value_list)?;
                return leave(state);
            }

            Instr::SetValues { first, count } => {
                read_all(state, first.0, count)?;
                state.registers.value_list = true;
            }
            Instr::GetValues { first, count } => {
                expect_value_list(value_list)?;
                assign(state, first.0, count.0);
            }
            Instr::ValuesToList { dst } => {
                expect_value_list(value_list)?;
                state.set(dst.0, Some(Class::Value));
            }
            Instr::ListToValues { src } => {
                read(state, src.0)?;
                state.registers.value_list = true;
            }

            Instr::PushCatch { window, tag, want, to } => {
                read(state, tag.0)?;
                let (results, value_list) = (want.registers(), want == Want::ALL);
                let landing = LandingState { to: target(next, to.0) as u32, results, value_list };
                self.push(state, VerifiedEntry::Catch, window, Some(landing))?;
            }
            Instr::PushCleanup { window, to } => {
                let landing = LandingState { to: target(next, to.0) as u32, results: 0, value_list: false };
                self.push(state, VerifiedEntry::Cleanup, window, Some(landing))?;
            }
            Instr::PushRecovery { window, state: table, to } => {
                read(state, table.0)?;
                let landing = LandingState { to: target(next, to.0) as u32, results: 2, value_list: false };
                self.push(state, VerifiedEntry::Recovery, window, Some(landing))?;
            }
            Instr::PushFailureCleanup { window, to } => {
                let landing = LandingState { to: target(next, to.0) as u32, results: 0, value_list: false };
                self.push(state, VerifiedEntry::FailureCleanup, window, Some(landing))?;
            }
            Instr::PushHandlerCase { window, to, .. } => {
                let landing = LandingState { to: target(next, to.0) as u32, results: 2, value_list: false };
                self.push(state, VerifiedEntry::HandlerCase, window, Some(landing))?;
            }
            Instr::PushHandlers { window, handlers } => {
                read(state, handlers.0)?;
                self.push(state, VerifiedEntry::Handlers, window, None)?;
            }
            Instr::PushMask { window, from } => {
                read(state, from.0)?;
                self.push(state, VerifiedEntry::Mask, window, None)?;
            }
            Instr::PushScope { window } => self.push(state, VerifiedEntry::Scope, window, None)?,
            Instr::PopControl { count } => pop(state, count)?,
            Instr::EnterCleanup {} => {
                expect_entry(state, VerifiedEntry::Cleanup, "a cleanup")?;
                expect_no_bindings(state)?;
                let entered = Box::new(state.registers.clone());
                if let Some(entry) = state.entries.last_mut() {
                    entry.kind = VerifiedEntry::RunningCleanup;
                    entry.landing = None;
                    entry.entered = Some(entered);
                }
                state.registers.value_list = false;
            }
            Instr::EndCleanup {} => {
                expect_entry(state, VerifiedEntry::RunningCleanup, "a running cleanup")?;
                expect_no_bindings(state)?;
                let Some(entry) = state.entries.pop() else { return Ok(false) };
                state.bindings = entry.bindings_below;
                // If it only ever runs while the stack unwinds, nothing comes after it.
                let Some(entered) = entry.entered else { return Ok(false) };
                state.registers = *entered;
            }
            Instr::Throw { tag, .. } => {
                read(state, tag.0)?;
                expect_value_list(value_list)?;
                state.registers.value_list = true;
            }

            _ => return self.step_plain(state, instr, next),
        }
        Ok(true)
    }

    /// Checks an instruction whose operands tell everything: reads, then writes, then perhaps a jump.
    fn step_plain(&mut self, state: &mut PlaceState, instr: Instr, next: usize) -> Result<bool, Fault> {
        let (mut fault, mut distance) = (None, None);
        instr.visit_registers(|access| {
            if let RegisterAccess::Read { first, count } = access {
                fault = fault.or(read_all(state, first, Count(count)).err());
            }
        });
        if let Some(fault) = fault {
            return Err(fault);
        }
        instr.visit_registers(|access| {
            if let RegisterAccess::Write { first, count } = access {
                assign(state, first, count);
            }
        });
        instr.visit_operands(|role| {
            if let Role::Forward(to) | Role::Backward(to) = role {
                distance = Some(to);
            }
        });
        if let Some(distance) = distance {
            if distance < 0 {
                // A tick: others may run.
                state.registers.value_list = false;
            }
            self.jump(state, target(next, distance))?;
        }
        Ok(instr.opcode().falls_through())
    }

    fn make_closure(&self, state: &mut PlaceState, dst: u8, operand: FunctionIdx) -> Result<(), Fault> {
        let found = u32::from(operand.0);
        let count = self.function.constants.len();
        let index = *self.function.constants.get(found as usize).ok_or(Fault::Constant { found, count })?;
        let Constant::Function(number) = pool::constant(self.module, index)? else {
            return Err(Fault::ConstantKind { found, expected: "a function" });
        };
        let captures = &pool::function(self.module, *number)?.captures;
        let mut later = false;
        for capture in captures {
            match capture.source {
                CaptureSource::Register(register) if capture.boxed => read_box(state, register)?,
                CaptureSource::Register(register) => read(state, register)?,
                CaptureSource::Capture(index) => {
                    let own = self.function.captures.get(usize::from(index)).ok_or(Fault::Capture(index))?;
                    if own.boxed != capture.boxed {
                        return Err(Fault::CaptureKind(index));
                    }
                }
                CaptureSource::Later => later = true,
            }
        }
        state.set(dst, Some(Class::Value));
        if later {
            state.set_closure(dst, number.0);
        }
        Ok(())
    }

    fn push(
        &mut self,
        state: &mut PlaceState,
        kind: VerifiedEntry,
        window: Window,
        landing: Option<LandingState>,
    ) -> Result<(), Fault> {
        expect_window(state, window)?;
        if state.entries.len() == MAX_CONTROL {
            return Err(Fault::ControlDepth);
        }
        let bindings_below = std::mem::take(&mut state.bindings);
        state.entries.push(KnownEntry { kind, window: window.0, bindings_below, landing, entered: None });
        self.land(state, state.entries.len() - 1)
    }
}

/// Returns the known contents of the registers of a frame that begins.
fn on_entry(parameters: &Parameters) -> Registers {
    let mut registers = Registers::default();
    let Parameters { required, optional, rest, .. } = parameters;
    let first_optional = usize::from(*required);
    let rest_list = first_optional + usize::from(*optional);
    for register in 0..parameters.registers() {
        let certain = register < first_optional || (*rest && register == rest_list);
        let class = if certain { Class::Value } else { Class::MaybeUnsupplied };
        registers.set(register as u8, Some(class));
    }
    registers
}

/// Returns the word that a jump goes to; the linear pass has seen that it is in the code.
fn target(next: usize, distance: i32) -> usize {
    next.saturating_add_signed(distance as isize)
}
