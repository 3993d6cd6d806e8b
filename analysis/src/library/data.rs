//! Functions of data: lists, vectors, tables, slots, properties, facts.

use esl_bytecode::builtin::{Builtin, Shares};

use super::LibraryCall;
use crate::effect::{FailureKind, NodeEffect, Reason};
use crate::flow::{CallArguments, FlowWatcher, ValueFlow};
use crate::value::{CellKey, FlowValue, ThingKey};

/// Functions that return an element.
const ELEMENTS: &[&str] = &[
    "CAR",
    "FIRST",
    "SECOND",
    "THIRD",
    "FOURTH",
    "FIFTH",
    "SIXTH",
    "SEVENTH",
    "EIGHTH",
    "NINTH",
    "TENTH",
    "NTH",
    "AREF",
    "SVREF",
    "ELT",
    "ROW-MAJOR-AREF",
    "VECTOR-POP",
    "CADR",
];

/// Functions that return no part of their arguments.
const WITHOUT_PARTS: &[&str] = &[
    "NOT",
    "NULL",
    "EQ",
    "EQL",
    "EQUAL",
    "EQUALP",
    "CONSP",
    "ATOM",
    "LISTP",
    "LENGTH",
    "+",
    "-",
    "*",
    "/",
    "=",
    "<",
    ">",
    "<=",
    ">=",
    "/=",
    "1+",
    "1-",
    "ENDP",
    "SYMBOLP",
    "STRINGP",
    "NUMBERP",
    "INTEGERP",
    "FUNCTIONP",
    "KEYWORDP",
    "ASSERT",
    "RETRACT",
    "FORMAT",
    "PRINT",
    "TERPRI",
    "EVENT-COUNT",
    "NOW",
    "%ASSERT",
    "%RETRACT",
    "SIGNAL",
    "HASH-TABLE-COUNT",
    "RANDOM",
    "ROUND",
    "FLOOR",
    "MIN",
    "MAX",
    "ABS",
    "MOD",
    "STRING=",
    "STRING-EQUAL",
    "STRING/=",
    "STRING<",
    "STRING>",
    "STRING<=",
    "STRING>=",
    "STRING-DOWNCASE",
    "STRING-UPCASE",
    "STRING-CAPITALIZE",
    "STRING-TRIM",
    "STRING-LEFT-TRIM",
    "STRING-RIGHT-TRIM",
    "PARSE-INTEGER",
    "TYPEP",
    "SYMBOL-NAME",
    "%PROCLAIM-SPECIAL",
    "BOUNDP",
    "FBOUNDP",
    "CONCATENATE",
    "%STRING-CONCAT",
];

/// Functions in ESL that return parts of their arguments, and call no function in them.
pub(super) const CALLS_NO_ARGUMENT: &[&str] =
    &["COERCE", "PRIN1-TO-STRING", "PRINC-TO-STRING", "%CHECK-TABLE", "COPY-SEQ", "SUBSEQ", "STRING"];

/// Functions that print their first argument to the stream that is the second, and call functions only in
/// that.
pub(super) const PRINTING: &[&str] = &["PRIN1", "PRINC", "WRITE-STRING", "WRITE-LINE", "WRITE-CHAR"];

impl ValueFlow<'_> {
    /// Looks at a call of a function of data. Returns whether it is one.
    pub(super) fn call_of_data(&mut self, call: &LibraryCall<'_>) -> bool {
        match call.name {
            "LIST" | "VECTOR" | "CONS" | "LIST*" | "ACONS" | "APPEND" | "%MAKE-VECTOR" => {
                self.make_list(call)
            }
            "GETHASH" => {
                if let Some(table) = call.argument(1) {
                    self.watch(table, FlowWatcher::Contents(call.value));
                }
                if let Some(default) = call.argument(2) {
                    self.copy(default, call.value);
                }
                self.any_list(call);
            }
            "%PUT" => self.put(call),
            "GET" => match (self.quoted(call, 0), self.quoted(call, 1)) {
                (Some(symbol), Some(indicator)) => {
                    let from = self.cell(CellKey::Property(symbol, indicator));
                    self.copy(from, call.value);
                }
                _ => {
                    let from = self.cell(CellKey::Instances);
                    self.copy(from, call.value);
                }
            },
            "SET" | "%SET-CONSTANT" => {
                if let (Some(symbol), Some(from)) = (self.quoted(call, 0), call.argument(1)) {
                    let to = self.cell(CellKey::Special(symbol));
                    self.copy(from, to);
                }
            }
            "SYMBOL-VALUE" => {
                if let Some(symbol) = self.quoted(call, 0) {
                    let from = self.cell(CellKey::Special(symbol));
                    self.copy(from, call.value);
                }
            }
            "%MAKE-STRUCTURE" | "%MAKE-VALUE-STRUCTURE" => self.make_structure(call),
            "%SLOT-VALUE" | "SLOT-VALUE" | "%CONDITION-SLOT" => {
                let from = self.cell(CellKey::Instances);
                self.copy(from, call.value);
            }
            "%SET-SLOT-VALUE" | "(SETF SLOT-VALUE)" | "%SET-CONDITION-SLOT" => {
                let to = self.cell(CellKey::Instances);
                for (from, _) in &call.arguments.given {
                    self.copy(*from, to);
                    self.copy(*from, call.value);
                }
            }
            "INTERN" | "FIND-SYMBOL" | "MAKE-SYMBOL" => self.add(call.value, FlowValue::AnySymbol),
            "READ" | "READ-FROM-STRING" | "SYMBOL-FUNCTION" | "FDEFINITION" => {
                if let Some(named) = self.quoted_function(call, 0) {
                    let name = self.name(&named);
                    self.add(call.value, FlowValue::Function(name));
                } else {
                    if let Some(from) = call.argument(0) {
                        self.copy(from, call.value);
                    }
                    self.add(call.value, FlowValue::AnySymbol);
                }
            }
            "EVAL" | "LOAD" => self.note(call.spot, NodeEffect::Fail(FailureKind::Any(Reason::Code))),
            "ASSERT" if call.nodes.len() == 1 => {
                let facts = self.cell(CellKey::Facts);
                if let Some(fact) = call.argument(0) {
                    self.watch(fact, FlowWatcher::AllContents(facts));
                }
            }
            "%PROPERTY" | "%PROPERTY-VALUE" | "DB-QUERY" => {
                let facts = self.cell(CellKey::Facts);
                self.copy(facts, call.value);
            }
            "FIND" | "FIND-IF" | "FIND-IF-NOT" if !call.nodes.is_empty() => {
                let others = self.beside(call.spot);
                let positions = self.called_positions(call, true);
                self.call_arguments(call.spot, &call.arguments, others, positions.as_deref());
                if let Some(from) = call.argument(1) {
                    self.watch(from, FlowWatcher::Contents(call.value));
                }
            }
            "CAR" | "FIRST" => {
                for (from, _) in &call.arguments.given {
                    self.watch(*from, FlowWatcher::First(call.value));
                }
                self.any_list(call);
            }
            _ if ELEMENTS.contains(&call.name) => {
                for (from, _) in &call.arguments.given {
                    self.watch(*from, FlowWatcher::Contents(call.value));
                }
                self.any_list(call);
            }
            _ if is_path(call.name) => {
                for (from, _) in &call.arguments.given {
                    self.watch(*from, FlowWatcher::AllContents(call.value));
                    self.watch(*from, FlowWatcher::Parts);
                    self.copy(*from, call.value);
                }
                self.any_list(call);
            }
            _ if WITHOUT_PARTS.contains(&call.name) => {}
            _ if changes_arguments(call.name) => {
                for (from, _) in &call.arguments.given {
                    for (to, _) in &call.arguments.given {
                        self.watch(*to, FlowWatcher::Store(*from));
                    }
                }
                self.return_parts(call);
            }
            _ => return false,
        }
        true
    }

    fn any_list(&mut self, call: &LibraryCall<'_>) {
        for list in call.arguments.lists.iter().chain(&call.arguments.any) {
            self.watch(*list, FlowWatcher::AllContents(call.value));
        }
    }

    /// Returns an object with the arguments as contents.
    fn make_list(&mut self, call: &LibraryCall<'_>) {
        let is_exact = matches!(call.name, "LIST" | "CONS" | "LIST*") && !call.nodes.is_empty();
        let (first, contents) = if is_exact {
            self.make_exact(call.spot, 0, call.value)
        } else {
            let contents = self.make(call.spot, 0, call.value);
            (contents, contents)
        };
        let parts_too = matches!(call.name, "LIST*" | "APPEND" | "ACONS");
        for (index, (from, _)) in call.arguments.given.iter().enumerate() {
            self.copy(*from, if index == 0 { first } else { contents });
            if parts_too {
                self.watch(*from, FlowWatcher::Contents(contents));
            }
        }
        if call.name == "CONS"
            && let Some(tail) = call.argument(1)
        {
            self.watch(tail, FlowWatcher::Contents(contents));
        }
        for list in call.arguments.lists.iter().chain(&call.arguments.any) {
            self.copy(*list, contents);
            self.watch(*list, FlowWatcher::Contents(contents));
        }
    }

    fn put(&mut self, call: &LibraryCall<'_>) {
        let Some(from) = call.argument(2) else { return };
        let to = match (self.quoted(call, 0), self.quoted(call, 1)) {
            (Some(symbol), Some(indicator)) => CellKey::Property(symbol, indicator),
            _ => CellKey::Instances,
        };
        let to = self.cell(to);
        self.copy(from, to);
        self.copy(from, call.value);
    }

    fn make_structure(&mut self, call: &LibraryCall<'_>) {
        let Some(class) = self.quoted(call, 0) else { return };
        if crate::cause::is_condition(self.forms, &class) {
            let name = self.name(&class);
            self.add(call.value, FlowValue::Condition(name));
            return;
        }
        let class = self.forms.base_class(&class).clone();
        for (index, (from, _)) in call.arguments.given.iter().enumerate().skip(1) {
            let to = self.cell(CellKey::Slot(class.clone(), index as u16 - 1));
            self.copy(*from, to);
        }
    }

    /// Returns the arguments and their contents.
    pub(super) fn return_parts(&mut self, call: &LibraryCall<'_>) {
        for (from, _) in &call.arguments.given {
            self.copy(*from, call.value);
            self.watch(*from, FlowWatcher::Contents(call.value));
            self.watch(*from, FlowWatcher::Parts);
        }
        self.any_list(call);
    }

    /// Notes the arguments of a failure.
    pub(super) fn note_failure_arguments(&mut self, arguments: &CallArguments) {
        let thing = self.thing(ThingKey::FailureArguments);
        let to = self.cell(CellKey::Contents(thing));
        for (from, _) in arguments.given.iter().skip(1) {
            self.copy(*from, to);
            self.watch(*from, FlowWatcher::Contents(to));
        }
    }
}

/// Whether a name is that of a path through pairs, such as `CADDR`.
fn is_path(name: &str) -> bool {
    let Some(path) = name.strip_prefix('C').and_then(|rest| rest.strip_suffix('R')) else { return false };
    !path.is_empty() && path.chars().all(|step| matches!(step, 'A' | 'D'))
}

/// Whether a function changes its arguments.
fn changes_arguments(name: &str) -> bool {
    let symbols = [esl_bytecode::symbol::Symbol::esl(name), esl_bytecode::symbol::Symbol::cl(name)];
    let of_table = symbols.iter().find_map(Builtin::named).is_some_and(|builtin| {
        matches!(builtin.info().shares, Shares::Pairs | Shares::Elements | Shares::Tables | Shares::Slots)
    });
    of_table
        || matches!(name, "VECTOR-PUSH-EXTEND" | "FILL" | "REPLACE" | "%SET-FLUENT" | "%SET-NTH" | "%SET-ELT")
        || (name.starts_with("(SETF ") && name != "(SETF FDEFINITION)" && name != "(SETF SYMBOL-FUNCTION)")
}
