//! The places of a program that tasks may share and that explorations at most grains do not see.
//!
//! A program is read, not run: each instruction and call that changes an object counts as a change of a place
//! that tasks may share, wherever the object comes from. So a program without unseen changes has no places
//! that tasks share but those that grain `variables` sees, and an exploration at that grain speaks of all its
//! schedules. The converse does not hold: an object that is changed may be known to one task only.
//!
//! Not here: changes by functions that the program makes while it runs, which count as unseen themselves
//! (`eval`, `compile`, `load`); what the library shares between tasks, which it protects.

use std::collections::HashSet;
use std::fmt;

use esl::program::Program;
use esl_bytecode::builtin::{Builtin, Shares};
use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::module::{Constant, Module, ModuleFunction};
use esl_bytecode::opcode::Instr;
use esl_bytecode::sharing::Sharing;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol};

use super::Grain;
use super::forms::SourceForms;
use super::late::{FINDING, FirstNames, defines_function, first_late_form};
use super::library;
use super::named::{called, constant, functions_named, instructions};

/// A kind of use of shared places that a grain does not see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum UnseenKind {
    /// Looking at what others do, which only grain `changes` does not see.
    Read,
    /// A change of a special variable, which grains below `variables` do not see.
    Variable,
    /// Of a variable of the library, which only grain `ticks` sees.
    LibraryVariable,
    /// Of a variable whose symbol has no package, which only grain `ticks` sees.
    UnnamedVariable,
    /// Of a variable that a closure shares with its surroundings.
    Captured,
    /// Of a slot of a structure or an instance.
    Slot,
    /// Of an element of an array or a string.
    Element,
    /// Of a pair.
    Pair,
    /// Of a hash table.
    Table,
    /// Of the properties of a symbol.
    Property,
    /// Of a stream that the program makes.
    Stream,
    /// Reading the column of standard output, by `fresh-line`.
    Column,
    /// Of whatever code changes that is made while the program runs, or functions that it finds by name.
    Code,
    /// Of functions, classes and packages by forms at top level that are evaluated while tasks may run, which
    /// only grain `ticks` sees. A new function that no code before it names is none.
    LateDefinition,
    /// Of functions, classes and packages by functions of the program, which no grain sees: states leave them
    /// out.
    Definition,
}

impl fmt::Display for UnseenKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            UnseenKind::Read => "data that tasks read",
            UnseenKind::Variable => "changes of special variables",
            UnseenKind::LibraryVariable => "changes of variables of the library",
            UnseenKind::UnnamedVariable => "changes of variables without a package",
            UnseenKind::Captured => "changes of variables of closures",
            UnseenKind::Slot => "changes of slots",
            UnseenKind::Element => "changes of elements of arrays",
            UnseenKind::Pair => "changes of pairs",
            UnseenKind::Table => "changes of hash tables",
            UnseenKind::Property => "changes of properties of symbols",
            UnseenKind::Stream => "uses of streams that the program makes",
            UnseenKind::Column => "the column of the output, which `fresh-line` reads",
            UnseenKind::Code => "effects of code that is made or found by name at run time",
            UnseenKind::LateDefinition => "definitions while tasks run",
            UnseenKind::Definition => "changes of functions, classes and packages",
        })
    }
}

/// A kind of change, and the first place at which the program makes one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnseenChange {
    /// The kind.
    pub kind: UnseenKind,
    /// The place, as `file:line:column`; `None` if the program has lost it.
    pub place: Option<String>,
}

impl fmt::Display for UnseenChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{} ({place})", self.kind),
            None => self.kind.fmt(f),
        }
    }
}

/// Functions written in ESL that evaluate code, and that change functions, classes and packages. The kinds of
/// places that functions of the library change in their arguments are in the list of `library`.
const EVALUATING: &[&str] = &["EVAL", "COMPILE", "LOAD"];
const DEFINING: &[&str] = &[
    "%SET-FUNCTION-NAMED",
    "%SET-FOUND-CLASS",
    "%ENSURE-GENERIC",
    "%ADD-METHOD",
    "CHANGE-CLASS",
    "MAKE-PACKAGE",
    "GENTEMP",
];

/// Functions written in ESL that give the time.
const CLOCKS: &[&str] = &["GET-DECODED-TIME"];

/// Returns the kinds of changes that a program makes and that a grain does not see, each with its first
/// place.
pub fn unseen_changes(program: &Program, grain: Grain) -> Vec<UnseenChange> {
    let module = program.module();
    let sees_variables = match grain {
        Grain::Ticks | Grain::Variables => true,
        Grain::Changes | Grain::Reads => false,
    };
    let (late, writers) = (first_late_form(module), slot_writers(module));
    let named = FirstNames::of(module, late);
    let (format, formats) = (Symbol::cl("FORMAT"), has_fill_pointers(module));
    let mut forms = SourceForms::default();
    let mut found: Vec<UnseenChange> = Vec::new();
    for (number, function) in module.functions.iter().enumerate() {
        let form = module.toplevel.iter().position(|toplevel| toplevel.0 as usize == number);
        let is_toplevel = form.is_some();
        for (pc, instr) in instructions(function) {
            let mut kinds = kinds_of(module, function, instr);
            if formats && functions_named(module, function, instr).contains(&format) {
                kinds.push(UnseenKind::Element);
            }
            let sets_slot = |symbol: Symbol| writers.contains(&symbol);
            if called(instr).and_then(|index| constant(module, function, index)).is_some_and(sets_slot) {
                kinds.push(UnseenKind::Slot);
            }
            for kind in kinds {
                let is_late = form.is_some_and(|form| form >= late);
                let is_new = defines_function(instr) && named.are_new_in(module, number);
                let kind = match kind {
                    UnseenKind::Definition if is_late && !is_new => UnseenKind::LateDefinition,
                    kind => kind,
                };
                if grain == Grain::Ticks && kind != UnseenKind::Definition
                    || found.iter().any(|change| change.kind == kind)
                {
                    continue;
                }
                let place = place(module, function, pc);
                let mut is_of = |operator| {
                    place.is_some_and(|(source, line, column)| {
                        let source = &module.sources[source];
                        forms.is_of(operator, source, line as usize, column as usize)
                    })
                };
                let is_known = match kind {
                    // A definition gives a variable its first value.
                    UnseenKind::Variable => sees_variables || is_of("defvar") || is_of("defparameter"),
                    // Definitions keep what they define at symbols, before any task can look at it.
                    UnseenKind::Property => is_toplevel && !is_late,
                    // A loop appends to a list of its own, by instructions.
                    UnseenKind::Pair => called(instr).is_none() && is_of("loop"),
                    // The calls of a slot's writer are instructions of the caller.
                    UnseenKind::Slot => is_of("defstruct"),
                    // A form at top level that no task runs beside; the modules of the machine define nothing
                    // that others could miss.
                    UnseenKind::Definition => {
                        is_toplevel
                            || place.is_some_and(|(source, ..)| {
                                module.sources[source].starts_with(MODULE_SOURCES)
                            })
                    }
                    _ => false,
                };
                if is_known {
                    continue;
                }
                let place =
                    place.map(|(source, line, column)| format!("{}:{line}:{column}", module.sources[source]));
                found.push(UnseenChange { kind, place });
            }
        }
    }
    if grain == Grain::Changes {
        found.push(UnseenChange { kind: UnseenKind::Read, place: None });
    }
    found.sort_by_key(|change| change.kind);
    found
}

/// Returns whether the program reads the clock, so that the time may decide what it does, or may do so by
/// code that it makes while it runs.
pub fn reads_clock(program: &Program) -> bool {
    may_call(program, |symbol| {
        Builtin::named(symbol).is_some_and(|builtin| builtin.info().shares == Shares::Clock)
            || symbol.is_in(CL_PACKAGE) && CLOCKS.contains(&symbol.name())
    })
}

/// Returns whether the program counts signals, so that their number may decide what it does, or may do so by
/// code that it makes while it runs.
pub fn counts_signals(program: &Program) -> bool {
    may_call(program, |symbol| Builtin::named(symbol) == Some(Builtin::EventCount))
}

/// Returns whether the program may look at the column of an output.
pub fn reads_column(program: &Program) -> bool {
    may_call(program, |symbol| Builtin::named(symbol) == Some(Builtin::FreshLine))
}

/// Returns whether a program names a function that `is_meant`, or makes code while it runs.
fn may_call(program: &Program, is_meant: impl Fn(&Symbol) -> bool) -> bool {
    let module = program.module();
    module.functions.iter().any(|function| {
        instructions(function).any(|(_, instr)| {
            functions_named(module, function, instr)
                .iter()
                .any(|symbol| is_meant(symbol) || kinds_of_function(symbol).contains(&UnseenKind::Code))
        })
    })
}

/// Returns the kinds of changes that an instruction makes.
pub(super) fn kinds_of(module: &Module, function: &ModuleFunction, instr: Instr) -> Vec<UnseenKind> {
    match instr.opcode().sharing() {
        Some(Sharing { place: Shares::Variables, is_change: true }) => {
            let Instr::SetSymbolValue { symbol, .. } = instr else { return vec![UnseenKind::Variable] };
            vec![match constant(module, function, symbol.0 as usize) {
                Some(symbol) if symbol.is_in(CL_PACKAGE) || symbol.is_in(ESL_PACKAGE) => {
                    UnseenKind::LibraryVariable
                }
                Some(symbol) if symbol.package().is_none() => UnseenKind::UnnamedVariable,
                _ => UnseenKind::Variable,
            }]
        }
        Some(Sharing { place, is_change: true }) => kind_of_place(place).into_iter().collect(),
        _ => functions_named(module, function, instr).iter().flat_map(kinds_of_function).collect(),
    }
}

/// Returns the kind of the changes of places of a kind.
fn kind_of_place(place: Shares) -> Option<UnseenKind> {
    match place {
        Shares::Pairs => Some(UnseenKind::Pair),
        Shares::Elements => Some(UnseenKind::Element),
        Shares::Slots => Some(UnseenKind::Slot),
        Shares::Tables => Some(UnseenKind::Table),
        Shares::Properties => Some(UnseenKind::Property),
        Shares::Variables => Some(UnseenKind::Variable),
        Shares::Captured => Some(UnseenKind::Captured),
        Shares::Streams => Some(UnseenKind::Stream),
        Shares::Definitions => Some(UnseenKind::Definition),
        Shares::Nothing | Shares::Points | Shares::Clock | Shares::Own => None,
    }
}

/// Returns the kinds of changes that the function of this name makes, if it belongs to the library.
fn kinds_of_function(symbol: &Symbol) -> Vec<UnseenKind> {
    if !symbol.is_in(CL_PACKAGE) && !symbol.is_in(ESL_PACKAGE) {
        return Vec::new();
    }
    if FINDING.contains(&symbol.name()) {
        return vec![UnseenKind::Code];
    }
    if Builtin::named(symbol) == Some(Builtin::FreshLine) {
        return vec![UnseenKind::Column];
    }
    if let Some(builtin) = Builtin::named(symbol) {
        return kind_of_place(builtin.info().shares).into_iter().collect();
    }
    let name = symbol.name();
    let mut kinds = library::changes(symbol).to_vec();
    kinds.extend(EVALUATING.contains(&name).then_some(UnseenKind::Code));
    kinds.extend(DEFINING.contains(&name).then_some(UnseenKind::Definition));
    let makes_stream = name == "OPEN" || name.starts_with("MAKE-") && name.ends_with("-STREAM");
    kinds.extend(makes_stream.then_some(UnseenKind::Stream));
    kinds
}

/// Returns the names of the functions that `defstruct` has made to set slots. Most slots are set without a
/// call of them.
fn slot_writers(module: &Module) -> HashSet<Symbol> {
    let sets_slot = |function: &&ModuleFunction| {
        instructions(function).any(|(_, instr)| kinds_of(module, function, instr).contains(&UnseenKind::Slot))
    };
    let writers = module.functions.iter().filter(sets_slot);
    let name = |function: &ModuleFunction| library::function_symbol(module, function.name?);
    writers.filter_map(name).filter(|symbol| symbol.name().starts_with("(SETF ")).collect()
}

/// Returns whether a program may make arrays with fill pointers: `format` appends to strings of this kind.
fn has_fill_pointers(module: &Module) -> bool {
    let is_meant = |constant: &Constant| match constant {
        Constant::Symbol(symbol) => symbol.is_in(KEYWORD_PACKAGE) && symbol.name() == "FILL-POINTER",
        _ => false,
    };
    module.constants.iter().any(is_meant)
}

/// Returns the source, line and column of an instruction.
fn place(module: &Module, function: &ModuleFunction, pc: usize) -> Option<(usize, u32, u32)> {
    let entry = function.lines.iter().take_while(|entry| entry.pc as usize <= pc).last()?;
    module.sources.get(entry.source as usize).map(|_| (entry.source as usize, entry.line, entry.column))
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl::program::{Source, compile};

    fn kinds(text: &str) -> Vec<UnseenKind> {
        let compiled = compile(&[Source::new("unseen.esl", text)]);
        let program = compiled.program.unwrap_or_else(|| panic!("{text}: {:?}", compiled.diagnostics));
        unseen_changes(&program, Grain::Variables).into_iter().map(|change| change.kind).collect()
    }

    #[test]
    fn changes_are_seen_in_whatever_way_they_are_written() {
        use UnseenKind::*;
        let expected: &[(&str, &[UnseenKind])] = &[
            ("(defvar *n* 0) (incf *n*) (assert '(door open)) (signal (make-event))", &[]),
            ("(let ((n 0)) (incf n) (print (mapcar #'1+ (list n))))", &[]),
            ("(let ((n 0)) (task-net (a (incf n)) (b (incf n))))", &[Captured]),
            ("(defstruct point x) (defvar *p* (make-point)) (setf (point-x *p*) 1)", &[Slot]),
            ("(defclass tank () ((level))) (setf (slot-value (make-instance 'tank) 'level) 1)", &[Slot]),
            ("(defvar *v* (vector 1)) (setf (svref *v* 0) 2)", &[Element]),
            ("(defvar *v* (make-array 1)) (setf (aref *v* 0) 2)", &[Element]),
            ("(defvar *v* (make-array '(1 1))) (setf (aref *v* 0 0) 2)", &[Element]),
            ("(defvar *s* (copy-seq \"abc\")) (setf (char *s* 0) #\\z)", &[Element]),
            ("(defvar *l* (list 1)) (setf (car *l*) 2)", &[Pair]),
            ("(defvar *l* (list 1)) (push 2 (cdr *l*))", &[Pair]),
            ("(defvar *l* (list 1)) (setf (nth 0 *l*) 2)", &[Pair]),
            ("(defvar *l* (list 1)) (print (funcall 'sort *l* #'<))", &[Element, Pair]),
            ("(defvar *l* (list 1)) (setf (getf *l* 'a) 2)", &[Pair]),
            ("(defvar *l* '((1))) (print (loop for part in *l* nconc part))", &[Pair]),
            ("(defstruct point x) (funcall #'(setf point-x) 1 (make-point))", &[Slot]),
            ("(defclass tank () ((level :accessor level)))", &[Slot]),
            ("(defvar *s* (make-string-output-stream)) (write-string \"a\" *s*)", &[Stream]),
            ("(print (with-output-to-string (s) (princ 1 s)))", &[Stream]),
            ("(handler-bind ((error (second '(on open)))) (print 1))", &[Stream]),
            ("(print (list (format nil \"a\") (random 3) (gensym)))", &[]),
            ("(spawn (print 1)) (setf (get 'robot 'state) 1)", &[Property]),
            ("(defvar *h* (make-hash-table)) (setf (gethash 1 *h*) 2)", &[Table]),
            ("(defvar *h* (make-hash-table)) (incf (gethash 1 *h* 0))", &[Table]),
            ("(defvar *h* (make-hash-table)) (remhash 1 *h*)", &[Table]),
            ("(defun note () (setf (get 'robot 'state) 1)) (note)", &[Property]),
            ("(defvar *s* (make-array 9 :fill-pointer 0)) (format *s* \"a\")", &[Element]),
            ("(setf (readtable-case *readtable*) :preserve)", &[Slot]),
            ("(print (list (fresh-line)))", &[Column]),
            ("(format t \"~&a\")", &[]),
            ("(eval (list 'print 1))", &[Code]),
            ("(defun f () 1) (defclass tank () ()) (defmethod level ((tank tank)) 1)", &[]),
            ("(defun f () (setf (symbol-function 'g) (lambda () 1)))", &[Definition]),
            ("(defun f () (defun g () 1))", &[Definition]),
            ("(defun f (x) (change-class x 'tank))", &[Slot, Definition]),
            ("(defun f (name) (intern name))", &[Definition]),
            ("(spawn (print 1)) (defun f () 1) (spawn (f))", &[]),
            ("(spawn (f)) (defun f () 1)", &[LateDefinition]),
            ("(spawn (funcall 'f)) (defun f () 1)", &[LateDefinition]),
            ("(spawn (apply (second '((f) f)) nil)) (defun f () 1)", &[LateDefinition]),
            ("(spawn (funcall (read-from-string \"f\"))) (defun f () 1)", &[Code, LateDefinition]),
            ("(print (funcall (find-symbol \"CAR\" \"CL\") nil))", &[Code]),
            ("(defvar *ways* '((:put . rplaca))) (funcall (cdr (assoc :put *ways*)) (list 1) 2)", &[Pair]),
            ("(mapc (lambda (way) (funcall way (list 1) 2)) #(rplaca))", &[Pair]),
            ("(print '(delete open))", &[]),
            ("(defun go-on () (spawn (f))) (defun f () 1) (go-on)", &[]),
            ("(defun go-on () (spawn (f))) (go-on) (defun f () 1)", &[LateDefinition]),
            ("(print (mapcar (lambda (x) (spawn x)) '(f))) (defun f () 1)", &[LateDefinition]),
            ("(task-net (a (print 1)) (b (print 2))) (defun f () 1)", &[]),
            ("(defun f () (setq *print-length* 3))", &[LibraryVariable]),
        ];
        for (text, expected) in expected {
            assert_eq!(kinds(text), *expected, "{text}");
        }
    }

    #[test]
    fn the_lists_of_functions_in_esl_have_no_builtin_and_no_other_name() {
        for name in EVALUATING.iter().chain(DEFINING).chain(CLOCKS) {
            let symbols = [Symbol::cl(name), Symbol::esl(name)];
            assert_eq!(symbols.iter().find(|symbol| Builtin::named(symbol).is_some()), None, "{name}");
        }
    }

    #[test]
    fn programs_that_read_the_clock_are_found() {
        let reads = |text: &str| {
            let compiled = compile(&[Source::new("clock.esl", text)]);
            reads_clock(&compiled.program.unwrap_or_else(|| panic!("{text}: {:?}", compiled.diagnostics)))
        };
        for text in
            ["(print (now))", "(mapcar #'now nil)", "(defun f () (get-universal-time))", "(eval '(now))"]
        {
            assert!(reads(text), "{text}");
        }
        for text in ["(sleep 3)", "(with-timeout 3 (sleep 1))", "(do-every 1 (print 1) (return))"] {
            assert!(!reads(text), "{text}");
        }
    }

    #[test]
    fn a_grain_sees_what_coarser_ones_do_not() {
        let compiled = compile(&[Source::new("unseen.esl", "(defvar *n*) (defun note () (setq *n* 1))")]);
        let program = compiled.program.expect("it compiles");
        let text = |grain| {
            let found = unseen_changes(&program, grain);
            found.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
        };
        assert_eq!(
            text(Grain::Changes),
            "data that tasks read, changes of special variables (unseen.esl:1:29)"
        );
        assert_eq!(text(Grain::Reads), "changes of special variables (unseen.esl:1:29)");
        assert_eq!((text(Grain::Variables), text(Grain::Ticks)), (String::new(), String::new()));
    }
}
