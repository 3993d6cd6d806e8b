//! Functions of data: lists, vectors, tables, slots, properties, facts.

use esl_bytecode::builtin::{Builtin, Shares};
use esl_bytecode::kind::ValueType;

use super::LibraryCall;
use crate::effect::{FailureKind, NodeEffect, Reason};
use crate::flow::{CallArguments, FlowWatcher, ValueFlow};
use crate::value::{CellId, CellKey, FlowValue, ThingKey};

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
    "SYMBOL-NAME",
    "%PROCLAIM-SPECIAL",
    "BOUNDP",
    "FBOUNDP",
    "%STRING-CONCAT",
];

/// Functions in ESL that return parts of their arguments, and call no function in them.
pub(super) const CALLS_NO_ARGUMENT: &[&str] =
    &["COERCE", "PRIN1-TO-STRING", "PRINC-TO-STRING", "%CHECK-TABLE", "COPY-SEQ", "SUBSEQ", "STRING"];

/// Functions that print their first argument to the stream that is the second, and call functions only in
/// that.
pub(super) const PRINTING: &[&str] = &["PRIN1", "PRINC", "WRITE-STRING", "WRITE-LINE", "WRITE-CHAR"];

/// The value of a function that calls its arguments.
enum ReturnedValue {
    /// A list of the values of the functions.
    Results,
    /// A value of a function.
    Result,
    /// The second argument, or a part of that list.
    Second,
    /// An element of the second argument.
    ElementOfSecond,
    /// A number or a truth value.
    Data,
}

/// Values of functions that call their arguments. Those of the others are any of these.
const KNOWN_VALUES: &[(&[&str], ReturnedValue)] = &[
    (&["MAPCAR", "MAPLIST"], ReturnedValue::Results),
    (&["EVERY", "SOME"], ReturnedValue::Result),
    (&["MAPC", "MAPL", "MEMBER", "MEMBER-IF", "MEMBER-IF-NOT"], ReturnedValue::Second),
    (
        &["ASSOC", "ASSOC-IF", "ASSOC-IF-NOT", "RASSOC", "RASSOC-IF", "RASSOC-IF-NOT"],
        ReturnedValue::ElementOfSecond,
    ),
    (
        &[
            "NOTANY",
            "NOTEVERY",
            "POSITION",
            "POSITION-IF",
            "POSITION-IF-NOT",
            "COUNT",
            "COUNT-IF",
            "COUNT-IF-NOT",
            "SUBSETP",
            "SEARCH",
            "MISMATCH",
            "TREE-EQUAL",
            "MAPHASH",
        ],
        ReturnedValue::Data,
    ),
];

/// A thing that a function stores.
enum StoredThing {
    /// The argument at this position.
    Argument(usize),
    /// The last argument.
    Last,
    /// The elements of the argument at this position, which is a part of the other one then.
    Contents(usize),
}

/// Names of functions, and the things that these store, each with the position of the argument that changes.
type StoringRow = (&'static [&'static str], &'static [(StoredThing, usize)]);

/// Functions that change an argument. The others may store each argument in each.
const STORING: &[StoringRow] = &[
    (&["%PUTHASH"], &[(StoredThing::Argument(0), 1), (StoredThing::Argument(2), 1)]),
    (&["%SET-TABLE-VALUE", "%TABLE-ADD"], &[(StoredThing::Argument(2), 0), (StoredThing::Argument(3), 0)]),
    (&["RPLACA", "%SET-CAR", "%FILL", "FILL", "%FILL-MORE"], &[(StoredThing::Argument(1), 0)]),
    (&["RPLACD", "%SET-CDR", "NRECONC"], &[(StoredThing::Argument(1), 0), (StoredThing::Contents(1), 0)]),
    (&["%PUTF"], &[(StoredThing::Argument(1), 0), (StoredThing::Argument(2), 0)]),
    (&["%REPLACE", "REPLACE"], &[(StoredThing::Contents(1), 0)]),
    (&["VECTOR-PUSH", "VECTOR-PUSH-EXTEND"], &[(StoredThing::Argument(0), 1)]),
    (&["%SET-NTH"], &[(StoredThing::Argument(2), 1)]),
    (&["%SET-ELT", "%SET-SVREF", "%SET-AREF", "%SET-ROW-MAJOR-AREF"], &[(StoredThing::Last, 0)]),
    (
        &[
            "REMHASH",
            "CLRHASH",
            "%TABLE-DELETE",
            "%ADD-TO-VALUE",
            "%REMF",
            "NREVERSE",
            "NBUTLAST",
            "%SET-CHAR",
        ],
        &[],
    ),
];

/// Whether a builtin has numbers, texts or truth values as values, and nothing else.
fn gives_data(builtin: Option<Builtin>) -> bool {
    const DATA: ValueType =
        ValueType::NUMBER.or(ValueType::CHARACTER).or(ValueType::STRING).or(ValueType::SYMBOL);
    let Some(info) = builtin.map(Builtin::info) else { return false };
    info.gives.is_some_and(|gives| gives.and(DATA) == gives)
        && !matches!(info.name, "MAKUNBOUND" | "TASK-STATUS")
}

impl ValueFlow<'_> {
    /// Looks at a call of a function of data. Returns whether it is one.
    pub(super) fn call_of_data(&mut self, call: &LibraryCall<'_>) -> bool {
        match call.name {
            "LIST" | "VECTOR" | "CONS" | "LIST*" | "ACONS" | "APPEND" | "%MAKE-VECTOR" => {
                self.make_list(call)
            }
            "GETHASH" => {
                self.call_table_functions(call);
                if let Some(table) = call.argument(1) {
                    self.watch(table, FlowWatcher::Contents(call.value));
                }
                if let Some(default) = call.argument(2) {
                    self.copy(default, call.value);
                }
                self.any_list(call);
            }
            "%PUT" => self.put(call),
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
            "MAKE-HASH-TABLE" | "MAKE-ARRAY" | "MAKE-LIST" => {
                if call.name == "MAKE-HASH-TABLE" {
                    let functions = self.cell(CellKey::TableFunctions);
                    self.store_all(call, functions);
                }
                let contents = self.make(call.spot, 0, call.value);
                for (from, _) in &call.arguments.given {
                    self.copy(*from, contents);
                    self.watch(*from, FlowWatcher::AllContents(contents));
                }
                for list in call.arguments.lists.iter().chain(&call.arguments.any) {
                    self.watch(*list, FlowWatcher::AllContents(contents));
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
            _ if changes_arguments(call) => self.change(call),
            _ if gives_data(call.builtin) => {}
            _ => return false,
        }
        true
    }

    /// Calls functions among the arguments, if the value of the call is known: of the values of these, or of
    /// one argument. Returns whether it is.
    pub(super) fn call_for_known_value(
        &mut self,
        call: &LibraryCall<'_>,
        positions: Option<&[usize]>,
    ) -> bool {
        let Some((_, known)) = KNOWN_VALUES.iter().find(|(names, _)| names.contains(&call.name)) else {
            return false;
        };
        if call.nodes.is_empty() || !call.arguments.lists.is_empty() {
            return false;
        }
        let beside = self.beside(call.spot);
        let to = if matches!(known, ReturnedValue::Results) { call.value } else { beside };
        let (_, returned) = self.call_with_arguments(call.spot, &call.arguments, to, positions);
        match known {
            ReturnedValue::Results | ReturnedValue::Data => {}
            ReturnedValue::Result => self.copy(returned, call.value),
            ReturnedValue::Second => {
                if let Some(list) = call.argument(1) {
                    self.copy(list, call.value);
                }
            }
            ReturnedValue::ElementOfSecond => {
                if let Some(list) = call.argument(1) {
                    self.watch(list, FlowWatcher::Contents(call.value));
                }
            }
        }
        true
    }

    /// Stores arguments in others.
    fn change(&mut self, call: &LibraryCall<'_>) {
        if matches!(call.name, "REMHASH" | "%PUTHASH" | "%ADD-TO-VALUE") {
            self.call_table_functions(call);
        }
        let given: Vec<CellId> = call.arguments.given.iter().map(|(cell, _)| *cell).collect();
        let last = given.len().saturating_sub(1);
        if call.name == "NCONC" {
            let inside = self.beside(call.spot);
            for list in &given {
                self.watch(*list, FlowWatcher::Contents(inside));
                self.watch(*list, FlowWatcher::Store(inside));
            }
        }
        match STORING.iter().find(|(names, _)| names.contains(&call.name)) {
            Some((_, pairs)) => {
                for (what, into) in *pairs {
                    let (from, into) = match what {
                        StoredThing::Argument(index) => (given.get(*index).copied(), *into),
                        StoredThing::Last => (given.last().copied(), *into),
                        StoredThing::Contents(index) => {
                            let inside = self.beside(call.spot);
                            if let Some(from) = given.get(*index) {
                                self.watch(*from, FlowWatcher::Contents(inside));
                            }
                            (Some(inside), *into)
                        }
                    };
                    if let (Some(from), Some(into)) = (from, given.get(into.min(last))) {
                        self.watch(*into, FlowWatcher::Store(from));
                    }
                }
            }
            None => {
                for from in &given {
                    for to in &given {
                        self.watch(*to, FlowWatcher::Store(*from));
                    }
                }
            }
        }
        if gives_data(call.builtin) {
            for from in &given {
                self.watch(*from, FlowWatcher::Parts);
            }
        } else {
            self.return_parts(call);
        }
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
            for key in [CellKey::Slot(class.clone(), index as u16 - 1), CellKey::SlotsByName] {
                let to = self.cell(key);
                self.copy(*from, to);
            }
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
fn changes_arguments(call: &LibraryCall<'_>) -> bool {
    let name = call.name;
    let of_table = call.builtin.is_some_and(|builtin| {
        matches!(builtin.info().shares, Shares::Pairs | Shares::Elements | Shares::Tables | Shares::Slots)
    });
    of_table
        || matches!(name, "VECTOR-PUSH-EXTEND" | "FILL" | "REPLACE" | "%SET-FLUENT" | "%SET-NTH" | "%SET-ELT")
        || (name.starts_with("(SETF ") && name != "(SETF FDEFINITION)" && name != "(SETF SYMBOL-FUNCTION)")
}
