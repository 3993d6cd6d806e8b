//! Functions as written: their names, and their texts taken apart.

use esl_bytecode::compile::Arity;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, setf_cell};

use super::form::{Checked, Form, name, plain};
use super::lambda_list::LambdaList;
use super::scope::{ScopeEntry, VariableMeaning};
use crate::diagnostic::code;

/// The name of a global function.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct FunctionName {
    /// The symbol; of `(setf f)`, the symbol `f`.
    pub(super) symbol: Symbol,
    /// Whether the name is `(setf symbol)`.
    pub(super) is_setf: bool,
}

impl FunctionName {
    /// Returns the name `symbol`.
    pub(super) fn plain(symbol: &Symbol) -> FunctionName {
        FunctionName { symbol: symbol.clone(), is_setf: false }
    }

    /// Returns the name `(setf symbol)`.
    pub(super) fn setf(symbol: &Symbol) -> FunctionName {
        FunctionName { symbol: symbol.clone(), is_setf: true }
    }

    /// Returns the name as messages show it.
    pub(super) fn shown(&self) -> String {
        if self.is_setf { format!("`(setf {})`", plain(&self.symbol)) } else { name(&self.symbol) }
    }
}

/// A function's name where it is written: a symbol, or `(setf symbol)`.
#[derive(Clone, Debug)]
pub(super) struct WrittenName {
    pub(super) name: FunctionName,
    /// Symbol that keeps the function.
    pub(super) cell: Symbol,
    /// The name as written.
    pub(super) datum: Datum,
}

impl WrittenName {
    /// Returns the name that `symbol` is; `datum` is where it is written.
    pub(super) fn symbol(symbol: &Symbol, datum: Datum) -> WrittenName {
        WrittenName { name: FunctionName::plain(symbol), cell: symbol.clone(), datum }
    }

    /// Returns the name that `datum` is, if it is one.
    pub(super) fn of(datum: &Datum) -> Option<WrittenName> {
        if let Some(symbol) = datum.as_symbol() {
            return Some(WrittenName::symbol(symbol, datum.clone()));
        }
        let list = datum.as_list()?;
        let [setf, symbol] = list.as_slice() else { return None };
        let symbol = symbol.as_symbol()?;
        let is_setf = setf.as_symbol().is_some_and(|setf| setf.is_cl("SETF"));
        is_setf.then(|| WrittenName {
            name: FunctionName::setf(symbol),
            cell: setf_cell(symbol),
            datum: datum.clone(),
        })
    }

    /// Returns the name of the block around the function's forms.
    pub(super) fn block(&self) -> Symbol {
        self.name.symbol.clone()
    }

    /// Rejects `t` as the name of a global function, since the module format does not treat it as a symbol.
    ///
    /// # Errors
    /// `not-an-operator`.
    pub(super) fn check_callable(&self, form: &Form) -> Checked {
        if self.cell.is_cl("T") {
            let message = "`t` is a constant and cannot be called";
            return Err(Box::new(code::NOT_AN_OPERATOR.at(form.at(self.datum.span()), message)));
        }
        Ok(())
    }

    /// Returns the error for macro code that refers to a local function of the code around it.
    pub(super) fn out_of_reach(&self, form: &Form) -> Box<Diagnostic> {
        let message =
            format!("the local function {} does not exist when macros are expanded", self.name.shown());
        Box::new(code::RUN_TIME_ONLY.at(form.at(self.datum.span()), message))
    }
}

/// A body taken apart.
#[derive(Debug, Default)]
pub(super) struct Body {
    /// Names declared special.
    pub(super) specials: Vec<Symbol>,
    /// Functions declared `notinline`, or `inline`.
    pub(super) written: Vec<(Symbol, bool)>,
    /// Names declared `ignore` or `ignorable`.
    pub(super) ignored: Vec<Symbol>,
    /// Documentation string.
    pub(super) documentation: Option<Datum>,
    /// Declarations as written.
    pub(super) declarations: Vec<Datum>,
    pub(super) forms: Vec<Datum>,
}

impl Body {
    /// Returns entries for what is declared of names that the form itself does not bind: which variables are
    /// special, and whether calls of functions stay as they are written.
    pub(super) fn free_declarations(&self, bound: &[Symbol]) -> Vec<ScopeEntry> {
        let free = self.specials.iter().filter(|symbol| !bound.contains(symbol));
        let special = free.map(|symbol| ScopeEntry::Variable(symbol.clone(), VariableMeaning::Special, None));
        let written = self.written.iter().map(|(name, is)| ScopeEntry::Written(name.clone(), *is));
        special.chain(written).collect()
    }
}

/// The parts of a function as written.
#[derive(Clone, Copy, Debug)]
pub(super) struct FunctionParts<'a> {
    /// Name to show to people.
    pub(super) name: Option<&'a Datum>,
    /// Name of the block around the forms.
    pub(super) block: Option<&'a Symbol>,
    /// Lambda list.
    pub(super) list: &'a Datum,
    pub(super) body: &'a [Datum],
}

/// A function's text, checked but not expanded.
#[derive(Debug)]
pub(super) struct FunctionText {
    /// Name to show to people.
    pub(super) name: Option<Datum>,
    /// Lambda list to show to people.
    pub(super) shown: Datum,
    pub(super) list: LambdaList,
    pub(super) body: Body,
    /// Name of the block around the forms.
    pub(super) block: Option<Symbol>,
    /// Place of the form that contains the text.
    pub(super) form: Span,
}

impl FunctionText {
    /// Returns how many arguments the function takes.
    pub(super) fn arity(&self) -> Arity {
        self.list.arity()
    }
}
