//! Top-level forms: which of them run at compile time, and in which chunks.
//!
//! A file is compiled form by form. The forms in a top-level `progn`, `locally`, `macrolet`, `symbol-macrolet` and
//! `eval-when` are top-level forms again. Functions and macros are also defined at compile time, so that macros may
//! call them; `eval-when` is as in Common Lisp.
//!
//! A form given to `eval` is treated likewise, except that each of its top-level forms is evaluated before the next one
//! is looked at; the last is left to the caller, who wants its value.

use esl_bytecode::compile::{Environment, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::chunk::Purpose;
use super::form::{Checked, Form, is_constant, is_known};
use super::machine::{Job, Machine, To};
use super::scope::{Function, Visible};
use crate::core::{LambdaId, NodeId};

/// How top-level forms are processed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// For a file.
    File {
        /// Whether every form is evaluated at compile time, too.
        now_too: bool,
    },
    /// For `eval`, or by `eval-when` only at compile time.
    Evaluate,
}

/// A top-level form's circumstances.
#[derive(Clone, Copy, Debug)]
pub(super) struct Top {
    /// How it is processed.
    pub(super) mode: Mode,
    /// Whether its value is the value of the whole.
    pub(super) is_last: bool,
    /// The macro call that made it.
    pub(super) origin: Option<u32>,
    /// Where it was written.
    pub(super) span: Span,
}

impl Top {
    /// A form of a file.
    pub(super) fn file() -> Top {
        Top { mode: Mode::File { now_too: false }, is_last: false, origin: None, span: Span::default() }
    }

    /// A form given to `eval`.
    pub(super) fn evaluate() -> Top {
        Top { mode: Mode::Evaluate, is_last: true, origin: None, span: Span::default() }
    }

    /// The same, with the place of `form` if that is known.
    pub(super) fn at(self, form: &Datum) -> Top {
        if is_known(form.span()) { Top { span: form.span(), ..self } } else { self }
    }

    /// What a chunk of this form is for.
    fn purpose(self, is_definition: bool) -> Purpose {
        match self.mode {
            Mode::File { now_too } => Purpose { emit: true, load: now_too || is_definition, keep: false },
            Mode::Evaluate => Purpose { emit: self.is_last, load: !self.is_last, keep: false },
        }
    }

    /// The circumstances, where forms outside of a chunk need some.
    fn to(self) -> To {
        To {
            node: NodeId(0),
            lambda: LambdaId(0),
            depth: 0,
            origin: self.origin,
            span: self.span,
            is_dropped: false,
        }
    }
}

/// When the body of an `eval-when` is evaluated.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Situations {
    pub(super) compile: bool,
    pub(super) load: bool,
    pub(super) execute: bool,
}

/// The situations of an `eval-when`.
pub(super) fn situations(form: &Form) -> Checked<Situations> {
    let Some(items) = form.args.first().and_then(Datum::as_list) else {
        return Err(form.malformed("needs a list of situations"));
    };
    let mut situations = Situations::default();
    for item in items {
        match item.as_symbol().map(Symbol::name) {
            Some("COMPILE-TOPLEVEL" | "COMPILE") => situations.compile = true,
            Some("LOAD-TOPLEVEL" | "LOAD") => situations.load = true,
            Some("EXECUTE" | "EVAL") => situations.execute = true,
            _ => {
                let what = "takes the situations `:compile-toplevel`, `:load-toplevel` and `:execute`";
                return Err(form.malformed_at(item.span(), what));
            }
        }
    }
    Ok(situations)
}

impl Machine {
    /// Processes a top-level form.
    pub(super) fn top_level(&mut self, environment: &mut dyn Environment, datum: Datum, top: Top) -> Checked {
        let is_operation = datum.as_cons().is_some_and(|(head, _)| head.as_symbol().is_some());
        if !is_operation {
            self.top_chunk(datum, top, false);
            return Ok(());
        }
        let form = Form::of(&datum, top.span)?;
        match self.scope.function(&form.operator, self.level()) {
            Visible::Is(Function::Macro(Some(function))) => {
                return self.stop_for_top(MacroRef::Local(function), &form, false, top);
            }
            Visible::Is(_) | Visible::OutOfReach => {
                self.top_chunk(datum, top, false);
                return Ok(());
            }
            Visible::No => {}
        }
        if super::operator::find(&form.operator).is_none() {
            let global = environment.global(&form.operator);
            let is_macro = self.is_macro(environment, &form.operator);
            if is_macro && !self.unit.is_broken_macro(&form.operator) {
                return self.stop_for_top(MacroRef::Global(form.operator.clone()), &form, global.locked, top);
            }
            self.top_chunk(datum, top, false);
            return Ok(());
        }
        let name =
            if form.operator.is_in(esl_bytecode::symbol::CL_PACKAGE) { form.operator.name() } else { "" };
        match name {
            "PROGN" => self.top_forms(form.args, top),
            "LOCALLY" => {
                let body = self.take_body(&form.args, false, &form, top.origin)?;
                self.top_scope(
                    vec![Job::Enter(body.free_specials(&[]))],
                    body.free_specials(&[]).len(),
                    body.forms,
                    top,
                );
            }
            "SYMBOL-MACROLET" => {
                let (entries, body) = super::binding::symbol_macros(self, environment, &form, top.origin)?;
                let count = entries.len();
                self.top_scope(vec![Job::Enter(entries)], count, body.forms, top);
            }
            "MACROLET" => {
                let (jobs, count, body) = super::local::local_macros(self, environment, &form, top.to())?;
                self.top_scope(jobs, count, body.forms, top);
            }
            "EVAL-WHEN" => self.top_eval_when(&form, top)?,
            "DECLAIM" => {
                let effects = super::define::proclamations(self, &form, top.origin)?;
                self.schedule([Job::TopLevel(effects, top)]);
            }
            "IN-PACKAGE" => {
                let enter = super::define::package_change(environment, &form)?;
                self.schedule([Job::TopLevel(enter, top)]);
            }
            "DEFUN" | "DEFMACRO" => self.top_chunk(datum, top, true),
            _ => self.top_chunk(datum, top, false),
        }
        Ok(())
    }

    /// Processes forms in a row as top-level forms.
    fn top_forms(&mut self, forms: Vec<Datum>, top: Top) {
        let jobs = top_jobs(forms, top);
        self.schedule(jobs);
    }

    fn top_scope(&mut self, mut jobs: Vec<Job>, count: usize, forms: Vec<Datum>, top: Top) {
        jobs.extend(top_jobs(forms, top));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);
    }

    fn top_eval_when(&mut self, form: &Form, top: Top) -> Checked {
        let Situations { compile, load, execute } = situations(form)?;
        let mode = match top.mode {
            Mode::Evaluate => execute.then_some(Mode::Evaluate),
            Mode::File { .. } if load && compile => Some(Mode::File { now_too: true }),
            Mode::File { now_too } if load => Some(Mode::File { now_too: now_too && execute }),
            Mode::File { now_too } => (compile || now_too && execute).then_some(Mode::Evaluate),
        };
        match mode {
            Some(mode) => self.top_forms(form.args[1..].to_vec(), Top { mode, ..top }),
            None => self.top_forms(Vec::new(), top),
        }
        Ok(())
    }

    /// Makes a chunk of a form.
    fn top_chunk(&mut self, datum: Datum, top: Top, is_definition: bool) {
        if !top.is_last && is_constant(&datum) && !matches!(datum.kind(), DatumKind::Cons(..)) {
            return;
        }
        let chunk = self.begin_chunk(top.span, top.origin, top.purpose(is_definition));
        let to = To { is_dropped: !top.is_last, ..chunk };
        self.schedule([Job::Expand(datum, to), Job::FinishChunk]);
    }
}

/// The jobs that process forms in a row; the value of the last one is that of the whole.
fn top_jobs(mut forms: Vec<Datum>, top: Top) -> Vec<Job> {
    if forms.is_empty() && top.is_last {
        forms.push(Datum::nil(top.span));
    }
    let last = forms.len().saturating_sub(1);
    let jobs = forms.into_iter().enumerate();
    jobs.map(|(index, form)| Job::TopLevel(form, Top { is_last: top.is_last && index == last, ..top }))
        .collect()
}
