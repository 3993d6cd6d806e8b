//! Functions that find functions, slots, properties or tests when the program runs: by names, in types, in
//! tables and in queries; and functions whose values share parts with their arguments.

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::{CL_PACKAGE, Symbol};
use esl_compiler::core::NodeKind;

use super::LibraryCall;
use crate::effect::{FailureKind, NodeEffect, Reason};
use crate::flow::{CallArguments, FlowWatcher, Passing, ValueFlow};
use crate::forms::symbols_inside;
use crate::value::{CellKey, FlowValue};

/// Functions that return an object in which their arguments, and parts of these, may be; some put them into
/// one of their arguments.
const SHARING_ARGUMENTS: &[&str] = &[
    "REVAPPEND",
    "(SETF SUBSEQ)",
    "MAP-INTO",
    "SUBSTITUTE",
    "SUBSTITUTE-IF",
    "SUBSTITUTE-IF-NOT",
    "NSUBSTITUTE",
    "NSUBSTITUTE-IF",
    "NSUBSTITUTE-IF-NOT",
    "SUBST",
    "SUBST-IF",
    "SUBST-IF-NOT",
    "NSUBST",
    "NSUBST-IF",
    "NSUBST-IF-NOT",
    "SUBLIS",
    "NSUBLIS",
    "ADJOIN",
];

impl ValueFlow<'_> {
    /// Looks at a call of such a function. Returns whether it is one.
    pub(super) fn call_by_found(&mut self, call: &LibraryCall<'_>) -> bool {
        match call.name {
            "GET" => {
                let key = match (self.quoted(call, 0), self.quoted(call, 1)) {
                    (Some(symbol), Some(indicator)) => CellKey::Property(symbol, indicator),
                    _ => CellKey::Instances,
                };
                for key in [key, CellKey::PropertyLists] {
                    let from = self.cell(key);
                    self.copy(from, call.value);
                }
            }
            "%SET-SYMBOL-PLIST" | "(SETF SYMBOL-PLIST)" => {
                let to = self.cell(CellKey::PropertyLists);
                for (from, _) in &call.arguments.given {
                    self.watch(*from, FlowWatcher::AllContents(to));
                }
                self.return_parts(call);
            }
            "%LOGICAL-VALUE" => {
                let facts = self.cell(CellKey::Facts);
                self.copy(facts, call.value);
            }
            // A query that is made when the program runs.
            "%WITH-TEST-FUNCTIONS" => {
                self.return_parts(call);
                if !self.constants_with("TEST").is_empty() {
                    self.note(call.spot, NodeEffect::Fail(FailureKind::Any(Reason::Code)));
                }
            }
            "%SLOT-VALUE" | "SLOT-VALUE" | "%CONDITION-SLOT" => {
                for key in [CellKey::Instances, CellKey::SlotsByName, CellKey::SetByName] {
                    let from = self.cell(key);
                    self.copy(from, call.value);
                }
                let protocol = ["SLOT-UNBOUND", "SLOT-MISSING", "UPDATE-INSTANCE-FOR-REDEFINED-CLASS"];
                self.call_protocol(call, &protocol);
            }
            "%SET-SLOT-VALUE" | "(SETF SLOT-VALUE)" | "%SET-CONDITION-SLOT" => {
                for key in [CellKey::Instances, CellKey::SetByName] {
                    let to = self.cell(key);
                    for (from, _) in &call.arguments.given {
                        self.copy(*from, to);
                        self.copy(*from, call.value);
                    }
                }
                self.call_protocol(call, &["SLOT-MISSING", "UPDATE-INSTANCE-FOR-REDEFINED-CLASS"]);
            }
            "%NO-NEXT-METHOD" => self.call_protocol(call, &["NO-NEXT-METHOD"]),
            "TYPEP" => self.type_test(call),
            "CONCATENATE" => {
                let is_text = self.quoted(call, 0).is_some_and(|kind| kind.name() == "STRING");
                if !is_text {
                    let contents = self.make(call.spot, 0, call.value);
                    for (from, _) in call.arguments.given.iter().skip(1) {
                        self.watch(*from, FlowWatcher::Contents(contents));
                    }
                    for list in call.arguments.lists.iter().chain(&call.arguments.any) {
                        self.watch(*list, FlowWatcher::AllContents(contents));
                    }
                }
            }
            // A function of which nothing is known.
            "COMPILE" => self.add(call.value, FlowValue::AnySymbol),
            "COERCE" if self.quoted(call, 1).is_some_and(|kind| kind.name() == "FUNCTION") => {
                if let Some(from) = call.argument(0) {
                    self.copy(from, call.value);
                }
                self.add(call.value, FlowValue::AnySymbol);
            }
            name if SHARING_ARGUMENTS.contains(&name) => self.share_arguments(call),
            _ => return false,
        }
        true
    }

    /// Looks at `typep`: `(satisfies name)` calls a function, as may a type that the program defines.
    fn type_test(&mut self, call: &LibraryCall<'_>) {
        if self.quoted(call, 1).is_some_and(|kind| kind.is_in(CL_PACKAGE)) {
            return;
        }
        let named = self.beside(call.spot);
        for datum in self.constants_with("SATISFIES") {
            for symbol in symbols_inside(&datum) {
                let name = self.name(&symbol);
                self.add(named, FlowValue::Function(name));
            }
        }
        let any = call.argument(0).into_iter().collect();
        let arguments = CallArguments { any, ..CallArguments::default() };
        self.call_values(call.spot, named, arguments, None, Passing::Through, false);
    }

    fn share_arguments(&mut self, call: &LibraryCall<'_>) {
        let positions = self.called_positions(call, true);
        self.call_arguments(call.spot, &call.arguments, call.value, positions.as_deref());
        let contents = self.make(call.spot, 0, call.value);
        let inside = self.beside(call.spot);
        for (from, _) in &call.arguments.given {
            self.copy(*from, contents);
            self.watch(*from, FlowWatcher::AllContents(contents));
            self.watch(*from, FlowWatcher::AllContents(inside));
        }
        for (from, _) in &call.arguments.given {
            self.watch(*from, FlowWatcher::Store(inside));
            self.watch(*from, FlowWatcher::Store(call.value));
        }
    }

    /// Calls the tests and hash functions of tables that the program has made with its own.
    pub(super) fn call_table_functions(&mut self, call: &LibraryCall<'_>) {
        let functions = self.cell(CellKey::TableFunctions);
        let any = call.arguments.given.iter().map(|(cell, _)| *cell).collect();
        let arguments = CallArguments { any, ..CallArguments::default() };
        self.call_values(call.spot, functions, arguments, None, Passing::Through, true);
    }

    /// Calls the methods that the program has for functions of the protocol of classes.
    pub(super) fn call_protocol(&mut self, call: &LibraryCall<'_>, names: &[&str]) {
        for name in names {
            let symbol = Symbol::cl(name);
            if self.forms.generic.contains(&symbol) {
                let methods = self.cell(CellKey::Methods(symbol));
                let any = call.arguments.given.iter().map(|(cell, _)| *cell).collect();
                let arguments = CallArguments { any, ..CallArguments::default() };
                self.call_values(call.spot, methods, arguments, Some(call.value), Passing::Through, false);
            }
        }
    }

    /// Returns the constants of the program in which a symbol with a name is.
    fn constants_with(&self, name: &str) -> Vec<Datum> {
        let nodes = self.forms.forms.iter().flat_map(|form| &form.core.nodes);
        let constants = nodes.filter_map(|node| match &node.kind {
            NodeKind::Constant(datum) => Some(datum),
            _ => None,
        });
        let is_it = |symbol: &Symbol| !symbol.is_keyword() && symbol.name() == name;
        let has = |datum: &&Datum| symbols_inside(datum).iter().any(is_it);
        constants.filter(has).cloned().collect()
    }
}
