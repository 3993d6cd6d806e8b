//! The functions of the library, as the analysis knows them: those that begin failures, call functions,
//! begin tasks, store and read data. `rows` is the table of the plain ones, `forms` has the functions that
//! the library's macros expand to, `data` those of lists, tables and slots, `found` those that find
//! functions, slots or properties when the program runs.
//!
//! A function of the library that none of these names may call its function arguments, returns parts of its
//! arguments or what these functions return, and fails by programming errors only. A builtin calls no
//! function.

mod data;
mod forms;
mod found;
mod rows;
mod work;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{NodeId, NodeKind};

use crate::effect::NodeEffect;
use crate::flow::{CallArguments, ValueFlow};
use crate::value::{CellId, CellKey, Spot};

pub(crate) use rows::{all_causes, function_positions};

/// Returns the causes of a function of the library, as its row has them.
pub(crate) fn causes_of(name: &str) -> &'static [&'static str] {
    rows::find(name).causes
}

/// A call of a function of the library.
pub(crate) struct LibraryCall<'c> {
    pub(crate) spot: Spot,
    pub(crate) name: &'c str,
    pub(crate) builtin: Option<Builtin>,
    /// The nodes of the arguments; empty if the function is called as a value.
    pub(crate) nodes: &'c [NodeId],
    pub(crate) arguments: CallArguments,
    pub(crate) value: CellId,
}

impl LibraryCall<'_> {
    /// Returns the cell of an argument.
    pub(crate) fn argument(&self, index: usize) -> Option<CellId> {
        self.arguments.given.get(index).map(|(cell, _)| *cell)
    }
}

impl ValueFlow<'_> {
    /// Calls a function of the library.
    pub(crate) fn call_library(
        &mut self,
        spot: Spot,
        symbol: &Symbol,
        nodes: &[NodeId],
        arguments: CallArguments,
        value: CellId,
    ) {
        let builtin = Builtin::named(symbol);
        let call = LibraryCall { spot, name: symbol.name(), builtin, nodes, arguments, value };
        if self.forms.generic.contains(symbol) {
            let methods = self.cell(CellKey::Methods(symbol.clone()));
            let any = call.arguments.given.iter().map(|(cell, _)| *cell).collect();
            let arguments = CallArguments { any, ..CallArguments::default() };
            self.call_values(spot, methods, arguments, Some(value), crate::flow::Passing::Through, false);
        }
        let row = rows::find(call.name);
        for cause in row.causes {
            match cause.strip_prefix('!') {
                Some(condition) => self.fail_condition(spot, condition),
                None => self.fail(spot, cause),
            }
        }
        if self.forms.narrows_rights && (row.causes.contains(&"!FILE-ERROR") || rows::needs_rights(call.name))
        {
            self.fail(spot, "PERMISSION-DENIED");
        }
        if rows::may_wait(call.name) {
            self.note(spot, NodeEffect::Wait);
        }
        if row.mistakes != 0 {
            self.note(spot, NodeEffect::Mistake(row.mistakes));
        }
        let is_known = self.call_of_form(&call)
            || self.call_of_work(&call)
            || self.call_by_found(&call)
            || self.call_of_data(&call);
        if is_known {
            return;
        }
        let is_plain = builtin.is_some() && !row.takes_functions;
        if is_plain || data::CALLS_NO_ARGUMENT.contains(&call.name) {
            self.return_parts(&call);
        } else {
            let prints = data::PRINTING.contains(&call.name);
            let positions = match prints {
                true => Some(vec![1]),
                false => self.called_positions(&call, row.takes_functions),
            };
            if !self.call_for_known_value(&call, positions.as_deref()) {
                self.call_arguments(spot, &call.arguments, value, positions.as_deref());
            }
            if rows::is_of_streams(call.name) {
                let given = call.arguments.given.into_iter().skip(usize::from(prints));
                for (cell, _) in given {
                    self.call_inside(spot, cell, CallArguments::default(), crate::flow::Passing::Through);
                }
            }
        }
    }

    /// Returns the positions of the arguments that a function calls, if they are known.
    pub(crate) fn called_positions(
        &self,
        call: &LibraryCall<'_>,
        takes_functions: bool,
    ) -> Option<Vec<usize>> {
        if !takes_functions {
            return None;
        }
        let mut positions = function_positions(call.name).to_vec();
        for (index, (_, keyword)) in call.arguments.given.iter().enumerate() {
            if keyword.as_ref().is_some_and(|key| matches!(key.name(), "KEY" | "TEST" | "TEST-NOT")) {
                positions.push(index + 1);
            }
        }
        Some(positions)
    }

    /// Returns whether an argument is `NIL` or was not given. False if that is unknown.
    pub(crate) fn is_absent(&self, call: &LibraryCall<'_>, index: usize) -> bool {
        if call.nodes.is_empty() || !call.arguments.lists.is_empty() {
            return false;
        }
        let form = &self.forms.forms[call.spot.form as usize];
        call.nodes.get(index).is_none_or(|node| form.is_nil(*node))
    }

    /// Returns whether the keyword is among the arguments, or may be.
    pub(crate) fn has_keyword(&self, call: &LibraryCall<'_>, keyword: &str) -> bool {
        if !call.arguments.lists.is_empty() || !call.arguments.any.is_empty() {
            return true;
        }
        let is_it =
            |(_, name): &(CellId, Option<Symbol>)| name.as_ref().is_some_and(|name| name.name() == keyword);
        call.nodes.is_empty() || call.arguments.given.iter().any(is_it)
    }

    /// Returns the symbol that an argument quotes.
    pub(crate) fn quoted(&self, call: &LibraryCall<'_>, index: usize) -> Option<Symbol> {
        self.forms.forms[call.spot.form as usize].symbol(*call.nodes.get(index)?).cloned()
    }

    /// Returns the function name that an argument quotes.
    pub(crate) fn quoted_function(&self, call: &LibraryCall<'_>, index: usize) -> Option<Symbol> {
        match self.forms.forms[call.spot.form as usize].kind(*call.nodes.get(index)?) {
            NodeKind::Constant(datum) => crate::forms::function_name(datum),
            _ => None,
        }
    }

    /// Returns whether an argument is a constant text.
    pub(crate) fn is_text(&self, call: &LibraryCall<'_>, index: usize) -> bool {
        let node = call.nodes.get(index).map(|node| self.forms.forms[call.spot.form as usize].kind(*node));
        matches!(node, Some(NodeKind::Constant(datum))
            if matches!(datum.kind(), esl_bytecode::datum::DatumKind::String(_)))
    }
}
