//! The kinds of places that functions of the library may change in their arguments, derived from its
//! bytecode: each such function is in the list by which explorations know that, or is known to change objects
//! of its own only.
//!
//! Each function is executed abstractly, along all paths: a register holds parts of arguments, holds an
//! object of the function's own with parts of arguments inside, or neither. A change of a part of an argument
//! is noted for the parameter. Functions that call each other are repeated until nothing is added.

use std::collections::{BTreeMap, HashMap};

use esl_bytecode::builtin::{Builtin, Shares};
use esl_bytecode::module::{CaptureSource, Constant, FunctionNumber, Module, ModuleFunction};
use esl_bytecode::opcode::{CallTarget, Instr, RegisterAccess};
use esl_bytecode::operand::Role;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol};

use esl_testing::explore::function_symbol;

/// The list.
const LIST: &str = include_str!("../src/explore/library-changes.txt");

/// Kinds of places, with their words in the list.
const KINDS: [(Shares, &str); 5] = [
    (Shares::Slots, "slots"),
    (Shares::Elements, "elements"),
    (Shares::Pairs, "pairs"),
    (Shares::Tables, "tables"),
    (Shares::Properties, "properties"),
];

/// Origins of a value, as bits: parameters by register, and captures from bit [`CAPTURES`] on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Origin {
    /// The value is an argument or a part of one.
    part: u64,
    /// The value is an object of the function's own, with such parts inside.
    inside: u64,
}

/// The bit of the first capture.
const CAPTURES: u32 = 40;

impl Origin {
    fn join(&mut self, other: Origin) -> bool {
        let before = *self;
        self.part |= other.part;
        self.inside |= other.inside;
        *self != before
    }

    /// Returns the origin of a part of the value.
    fn of_part(self) -> Origin {
        Origin { part: self.part | self.inside, inside: 0 }
    }

    /// Returns the origin of an object of the function's own that contains the value.
    fn of_container(self) -> Origin {
        Origin { part: 0, inside: self.part | self.inside }
    }
}

/// The effects of a function on its arguments and captures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Effects {
    changes: [u64; KINDS.len()],
    returns: Origin,
}

impl Effects {
    fn join(&mut self, other: Effects) -> bool {
        let before = *self;
        for (mine, other) in self.changes.iter_mut().zip(other.changes) {
            *mine |= other;
        }
        self.returns.join(other.returns);
        *self != before
    }
}

fn bit(at: usize) -> u64 {
    if at < 64 { 1 << at } else { 0 }
}

/// Returns the position of a kind of place, if an argument can have such places.
fn place(shares: Shares) -> Option<usize> {
    KINDS.iter().position(|(known, _)| *known == shares)
}

/// Returns the names of a builtin's parameters, and whether the last one takes all further arguments.
fn parameters(builtin: Builtin) -> (Vec<&'static str>, bool) {
    let words = builtin.info().lambda_list;
    (words.split(' ').filter(|word| !word.starts_with('&')).collect(), words.contains("&rest"))
}

/// Returns which arguments a builtin changes, if it changes any.
fn changed_arguments(builtin: Builtin, count: usize) -> u64 {
    let names: &[&str] = match builtin.info().shares {
        Shares::Slots => &["instance"],
        Shares::Elements => &["target", "vector", "array", "sequence", "string"],
        Shares::Pairs => &["pair", "list", "lists", "plist", "sequence"],
        Shares::Tables => &["table"],
        Shares::Properties => &["symbol"],
        _ => return 0,
    };
    let (parameters, has_rest) = parameters(builtin);
    let at = names.iter().find_map(|name| parameters.iter().position(|known| known == name));
    let at = at.unwrap_or_else(|| panic!("{builtin:?} changes none of {parameters:?}"));
    match has_rest && at + 1 == parameters.len() {
        true => (at..count).map(bit).fold(0, |all, bit| all | bit),
        false => bit(at),
    }
}

/// Builtins whose value is a part of their first or second argument.
const ACCESSORS: &[&str] =
    &["CAR", "CDR", "CADR", "CDDR", "CAAR", "CDAR", "NTH", "ELT", "SVREF", "AREF", "GETHASH", "GET", "%SLOT"];

/// Beginnings of the names of builtins and functions whose value is a new object, or contains nothing of
/// their arguments that can be changed.
const FRESH: &[&str] = &[
    "MAKE-",
    "%MAKE-",
    "COPY-",
    "%COPY-",
    "LIST",
    "CONS",
    "VECTOR",
    "REVERSE",
    "SUBSEQ",
    "%SUBSEQ",
    "APPEND",
    "STRING",
    "CONCATENATE",
    "REMOVE",
    "MAPCAR",
    "COERCE",
];

fn is_fresh(name: &str) -> bool {
    FRESH.iter().any(|beginning| name.starts_with(beginning)) && name != "LIST-TO-VALUES"
}

struct Derivation<'a> {
    module: &'a Module,
    named: HashMap<Symbol, usize>,
    /// Functions made inside of the same function, by function.
    family: Vec<Vec<usize>>,
    effects: Vec<Effects>,
}

impl<'a> Derivation<'a> {
    fn new(module: &'a Module) -> Derivation<'a> {
        let mut named = HashMap::new();
        for (number, function) in module.functions.iter().enumerate() {
            if let Some(symbol) = function.name.and_then(|name| function_symbol(module, name)) {
                named.insert(symbol, number);
            }
        }
        let children = |number: usize| -> Vec<usize> {
            let constants = module.functions[number].constants.iter();
            let functions = constants.filter_map(|index| match module.constants[index.0 as usize] {
                Constant::Function(FunctionNumber(number)) => Some(number as usize),
                _ => None,
            });
            functions.collect()
        };
        let mut parents = vec![None; module.functions.len()];
        let toplevel = |number: usize| module.toplevel.iter().any(|form| form.0 as usize == number);
        for number in (0..module.functions.len()).filter(|&number| !toplevel(number)) {
            children(number).into_iter().for_each(|child| parents[child] = Some(number));
        }
        let outermost = |mut number: usize| {
            for _ in 0..32 {
                number = parents[number].unwrap_or(number);
            }
            number
        };
        let mut families: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for number in 0..module.functions.len() {
            let outermost = outermost(number);
            if outermost != number {
                families.entry(outermost).or_default().push(number);
            }
        }
        let of = |number| families.get(&outermost(number)).cloned().unwrap_or_default();
        let family = (0..module.functions.len()).map(of).collect();
        Derivation { module, named, family, effects: vec![Effects::default(); module.functions.len()] }
    }

    fn derive(&mut self) {
        loop {
            let mut has_more = false;
            for number in 0..self.module.functions.len() {
                let effects = self.run(number);
                has_more |= self.effects[number].join(effects);
            }
            if !has_more {
                return;
            }
        }
    }

    /// Executes a function along all paths.
    fn run(&self, number: usize) -> Effects {
        let function = &self.module.functions[number];
        let parameters = &function.parameters;
        let fixed = usize::from(parameters.required) + usize::from(parameters.optional);
        let mut first = vec![Origin::default(); usize::from(function.registers) + 1];
        for (register, origin) in
            first.iter_mut().enumerate().take(parameters.registers().min(CAPTURES as usize))
        {
            let is_rest = parameters.rest && register == fixed;
            *origin = Origin { part: bit(register), inside: 0 };
            if is_rest {
                *origin = origin.of_container();
            }
        }
        let mut states: HashMap<usize, Vec<Origin>> = HashMap::from([(0, first)]);
        let mut pending = vec![0];
        let mut effects = Effects::default();
        while let Some(pc) = pending.pop() {
            let Some(instr) = Instr::decode(&function.code, pc) else { continue };
            let mut state = states[&pc].clone();
            self.step(number, function, instr, &mut state, &mut effects);
            let next = pc + instr.opcode().words();
            let mut targets = Vec::new();
            instr.visit_operands(|role| {
                if let Role::Forward(distance) | Role::Backward(distance) | Role::Landing(distance) = role {
                    targets.push((next as i64 + i64::from(distance)) as usize);
                }
            });
            if instr.opcode().falls_through() {
                targets.push(next);
            }
            for target in targets {
                match states.get_mut(&target) {
                    None => {
                        states.insert(target, state.clone());
                        pending.push(target);
                    }
                    Some(known) => {
                        let mut has_more = false;
                        known.iter_mut().zip(&state).for_each(|(known, new)| has_more |= known.join(*new));
                        if has_more {
                            pending.push(target);
                        }
                    }
                }
            }
        }
        effects
    }

    fn step(
        &self,
        number: usize,
        function: &ModuleFunction,
        instr: Instr,
        state: &mut [Origin],
        effects: &mut Effects,
    ) {
        let get = |state: &[Origin], register: u8| state[usize::from(register)];
        if let Some(call) = instr.call() {
            return self.call(
                number,
                function,
                instr,
                call.callee,
                (call.window.0, call.count.0),
                state,
                effects,
            );
        }
        let mut change = |at: Option<usize>, origin: Origin| {
            if let Some(at) = at {
                effects.changes[at] |= origin.part;
            }
        };
        match instr {
            Instr::Move { dst, src } | Instr::MakeBox { dst, src } => {
                state[usize::from(dst.0)] = get(state, src.0)
            }
            Instr::BoxRef { dst, cell } => state[usize::from(dst.0)] = get(state, cell.0),
            Instr::BoxSet { cell, src } => {
                let origin = get(state, src.0);
                state[usize::from(cell.0)].join(origin);
            }
            Instr::CaptureRef { dst, index } | Instr::CaptureBoxRef { dst, index } => {
                let part = bit(CAPTURES as usize + usize::from(index.0));
                state[usize::from(dst.0)] = Origin { part, inside: 0 };
            }
            Instr::Car { dst, list }
            | Instr::Cdr { dst, list }
            | Instr::Cadr { dst, list }
            | Instr::Cddr { dst, list } => state[usize::from(dst.0)] = get(state, list.0).of_part(),
            Instr::VectorRef { dst, vector, .. } | Instr::VectorRefInt { dst, vector, .. } => {
                state[usize::from(dst.0)] = get(state, vector.0).of_part();
            }
            Instr::ArrayRef { dst, array, .. } => state[usize::from(dst.0)] = get(state, array.0).of_part(),
            Instr::Slot { dst, instance, .. } => state[usize::from(dst.0)] = get(state, instance.0).of_part(),
            Instr::SetCar { pair, value } | Instr::SetCdr { pair, value } => {
                change(place(Shares::Pairs), get(state, pair.0));
                let inside = get(state, value.0).of_container();
                state[usize::from(pair.0)].join(inside);
            }
            Instr::VectorSet { vector, value, .. } | Instr::VectorSetInt { vector, value, .. } => {
                change(place(Shares::Elements), get(state, vector.0));
                let inside = get(state, value.0).of_container();
                state[usize::from(vector.0)].join(inside);
            }
            Instr::ArraySet { array, .. } => change(place(Shares::Elements), get(state, array.0)),
            Instr::SetSlot { instance, .. } => change(place(Shares::Slots), get(state, instance.0)),
            Instr::Return { src } => _ = effects.returns.join(get(state, src.0)),
            Instr::ReturnValues { first, count } => {
                for register in first.0..first.0.saturating_add(count.0) {
                    effects.returns.join(get(state, register));
                }
            }
            Instr::MakeClosure { dst, function: index } => {
                let Constant::Function(FunctionNumber(made)) =
                    self.module.constants[function.constants[usize::from(index.0)].0 as usize]
                else {
                    return;
                };
                let made = made as usize;
                for (at, capture) in self.module.functions[made].captures.iter().enumerate() {
                    let origin = match capture.source {
                        CaptureSource::Register(register) => get(state, register).part,
                        CaptureSource::Capture(index) => bit(CAPTURES as usize + usize::from(index)),
                        CaptureSource::Later => 0,
                    };
                    for (changes, of_made) in effects.changes.iter_mut().zip(self.effects[made].changes) {
                        if of_made & bit(CAPTURES as usize + at) != 0 {
                            *changes |= origin;
                        }
                    }
                }
                state[usize::from(dst.0)] = Origin::default();
            }
            _ => {
                let mut read = Origin::default();
                let (mut written, is_container) =
                    (Vec::new(), matches!(instr, Instr::Cons { .. } | Instr::List { .. }));
                instr.visit_registers(|access| match access {
                    RegisterAccess::Read { first, count } => {
                        (first..first.saturating_add(count))
                            .for_each(|register| _ = read.join(get(state, register)));
                    }
                    RegisterAccess::Write { first, count } => {
                        written.extend(first..first.saturating_add(count))
                    }
                });
                let origin = if is_container { read.of_container() } else { Origin::default() };
                written.into_iter().for_each(|register| state[usize::from(register)] = origin);
            }
        }
    }

    #[allow(clippy::too_many_arguments, reason = "the parts of one call")]
    fn call(
        &self,
        number: usize,
        function: &ModuleFunction,
        instr: Instr,
        callee: CallTarget,
        (window, count): (u8, u8),
        state: &mut [Origin],
        effects: &mut Effects,
    ) {
        let argument = |at: usize| state.get(usize::from(window) + 2 + at).copied().unwrap_or_default();
        let arguments: Vec<Origin> = (0..usize::from(count)).map(argument).collect();
        let mut result = Origin::default();
        let mut enter = |callee: usize, result: &mut Origin| {
            let of_callee = self.effects[callee];
            let parameters = &self.module.functions[callee].parameters;
            let fixed = usize::from(parameters.required) + usize::from(parameters.optional);
            let map = |bits: u64| {
                let mut origin = Origin::default();
                for (at, argument) in arguments.iter().enumerate() {
                    let is_meant = match at < fixed {
                        true => bits & bit(at) != 0,
                        false => bits & !(bit(fixed) - 1) & (bit(CAPTURES as usize) - 1) != 0,
                    };
                    if is_meant {
                        origin.join(*argument);
                    }
                }
                origin
            };
            for (changes, of_callee) in effects.changes.iter_mut().zip(of_callee.changes) {
                *changes |= map(of_callee).part;
            }
            result.join(map(of_callee.returns.part));
            result.join(map(of_callee.returns.inside).of_container());
        };
        let mut name = None;
        match (callee, instr) {
            (
                CallTarget::Builtin,
                Instr::CallBuiltin { builtin, .. } | Instr::TailCallBuiltin { builtin, .. },
            ) => {
                let builtin = Builtin::from_number(builtin.0).expect("it is a builtin");
                let changed = changed_arguments(builtin, arguments.len());
                name = Some(builtin.info().name);
                for (at, argument) in arguments.iter().enumerate() {
                    if let Some(place) = place(builtin.info().shares).filter(|_| changed & bit(at) != 0) {
                        effects.changes[place] |= argument.part;
                    }
                    result.join(*argument);
                }
                if ACCESSORS.contains(&builtin.info().name) {
                    result = result.of_part();
                }
            }
            (CallTarget::Global, Instr::CallGlobal { symbol, .. } | Instr::TailCallGlobal { symbol, .. }) => {
                let symbol = function_symbol(self.module, function.constants[symbol.0 as usize]);
                if let Some((symbol, &callee)) =
                    symbol.as_ref().and_then(|symbol| Some((symbol, self.named.get(symbol)?)))
                {
                    enter(callee, &mut result);
                    if is_fresh(symbol.name()) {
                        result = Origin::default();
                    }
                }
            }
            (CallTarget::Running, _) => enter(number, &mut result),
            _ => self.family[number].iter().for_each(|&callee| enter(callee, &mut result)),
        }
        if name.is_some_and(is_fresh) {
            result = result.of_container();
        }
        if instr.opcode().is_tail() {
            effects.returns.join(result);
        }
        state.iter_mut().skip(usize::from(window)).for_each(|origin| *origin = Origin::default());
        state[usize::from(window)] = result;
    }
}

/// Functions of the library, with public names, that the derivation takes to change their arguments and that
/// do not: they change objects that they have made, objects of the library's machinery which it protects,
/// streams, or what a point stands before.
const OWN: &str = "\
    APROPOS APROPOS-LIST ASSERT CERROR CLASS-OF CLOSE COERCE CONCATENATE DB-QUERY \
    DESCRIBE ERROR FAIL FAILURE-CAUSE FILE-POSITION FIND-CLASS FORMAT HELP MAKE-CONDITION MAKE-INSTANCE \
    MAKE-INSTANCES-OBSOLETE MAKE-LOAD-FORM-SAVING-SLOTS OPEN PPRINT PRIN1 PRINC PRINT PRINT-OBJECT \
    PROCLAIM READ-BYTE RESUME-TASK RETRACT SIGNAL SLOT-BOUNDP SLOT-EXISTS-P SLOT-VALUE SUBLIS SUBST \
    SUBST-IF SUBST-IF-NOT SUBSTITUTE SUBSTITUTE-IF SUBSTITUTE-IF-NOT SUSPEND-TASK \
    UPDATE-INSTANCE-FOR-DIFFERENT-CLASS WARN WRITE WRITE-BYTE WRITE-SEQUENCE";

/// Internal functions that macros call in the code of programs, on objects of the program.
const CALLED_BY_MACROS: &[&str] =
    &["%NCONC-TO", "%SET-NTH", "%SET-SLOT-VALUE-OF", "%SET-DOCUMENTATION", "%SET-CONDITION-SLOT"];

#[test]
fn each_function_that_may_change_its_arguments_is_classified() {
    let module = esl_stdlib::module().expect("the image is sound");
    let mut derivation = Derivation::new(&module);
    derivation.derive();
    let mut unknown = Vec::new();
    for (symbol, &number) in &derivation.named {
        let is_of_library = symbol.is_in(CL_PACKAGE) || symbol.is_in(ESL_PACKAGE);
        let name = symbol.name();
        let is_public = !name.starts_with('%') && !name.starts_with("(SETF %");
        if !is_of_library
            || !(is_public || CALLED_BY_MACROS.contains(&name))
            || OWN.split_whitespace().any(|own| own == name)
        {
            continue;
        }
        let line =
            LIST.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": ")).unwrap_or_default();
        for ((_, word), changes) in KINDS.iter().zip(derivation.effects[number].changes) {
            let changes_argument = changes & (bit(CAPTURES as usize) - 1) != 0;
            if changes_argument
                && !line.split(' ').any(|known| known == *word)
                && !name.starts_with("CHANGE-CLASS")
            {
                unknown.push(format!("{name}: {word}"));
            }
        }
    }
    unknown.sort();
    assert!(
        unknown.is_empty(),
        "add these functions to testing/src/explore/library-changes.txt, or to `OWN` if they change only objects of \
         their own: {unknown:#?}"
    );
    for line in LIST.lines() {
        let name = line.split(": ").next().unwrap_or_default();
        let symbols = [Symbol::cl(name), Symbol::esl(name)];
        assert!(symbols.iter().any(|symbol| derivation.named.contains_key(symbol)), "no function {name}");
    }
}
