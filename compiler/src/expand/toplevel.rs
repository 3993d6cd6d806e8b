//! Top-level forms: which of them run at compile time, and in which chunks.
//!
//! A file is compiled form by form. The forms in a top-level `progn`, `locally`, `macrolet`,
//! `symbol-macrolet` and `eval-when` are top-level forms again. Functions and macros are also defined at
//! compile time, so that macros may call them; `eval-when` is as in Common Lisp.
//!
//! A form given to `eval` is treated likewise, except that each of its top-level forms is evaluated before
//! the next one is expanded. The last one is left to the caller, which needs its value.

use esl_bytecode::compile::{Environment, GlobalFunction, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE};

use super::binding::symbol_macros;
use super::chunk::Purpose;
use super::control::{Situations, situations};
use super::define::{package_change, proclamations};
use super::expander::Expander;
use super::form::{Checked, Form, is_constant};
use super::job::{AwaitedOutcome, Job, Mode, To, Top};
use super::local::local_macros;
use super::scope::{FunctionMeaning, Visible};
use crate::core::{LambdaId, NodeId};

impl Top {
    /// Returns the purpose of a chunk of this form.
    fn purpose(self, is_definition: bool) -> Purpose {
        match self.mode {
            Mode::File { now_too } => Purpose { emit: true, load: now_too || is_definition, keep: false },
            Mode::Evaluate => Purpose { emit: self.is_last, load: !self.is_last, keep: false },
        }
    }

    /// Returns a destination for forms that are not part of a chunk.
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

impl Expander {
    /// Processes a top-level form.
    pub(super) fn top_level(&mut self, environment: &mut dyn Environment, datum: Datum, top: Top) -> Checked {
        let is_operation = datum.as_cons().is_some_and(|(head, _)| head.as_symbol().is_some());
        if !is_operation {
            self.top_chunk(datum, top, false);
            return Ok(());
        }
        let form = Form::of(&datum, top.span)?;
        match self.scope.function(&form.operator, self.level()) {
            Visible::Is(FunctionMeaning::Macro(Some(function))) => {
                return self.stop_for_top(MacroRef::Local(function), &form, false, top);
            }
            Visible::Is(_) | Visible::OutOfReach => {
                self.top_chunk(datum, top, false);
                return Ok(());
            }
            Visible::No => {}
        }
        if !self.is_operator(&form.operator) {
            let global = environment.global(&form.operator);
            if global.locked && global.function == GlobalFunction::Macro {
                self.check_written(environment, &form, top.origin);
                if top.origin.is_none() && matches!(top.mode, Mode::File { .. }) {
                    self.check_twice(&form, &datum);
                }
            }
            let is_macro = self.is_macro(environment, &form.operator);
            if is_macro && !self.globals.is_broken_macro(&form.operator) {
                return self.stop_for_top(MacroRef::Global(form.operator.clone()), &form, global.locked, top);
            }
            self.top_chunk(datum, top, false);
            return Ok(());
        }
        let name = if form.operator.is_in(CL_PACKAGE) { form.operator.name() } else { "" };
        if form.operator.is_in(ESL_PACKAGE) && form.operator.name() == "%WITH-ALLOWED-WARNINGS" {
            let body = self.allow_warnings(&form)?;
            self.top_forms(body, top);
            return Ok(());
        }
        match name {
            "PROGN" => self.top_forms(form.args, top),
            "LOCALLY" => {
                let body = self.take_body(&form.args, false, &form, top.origin)?;
                let entries = body.free_declarations(&[]);
                let count = entries.len();
                self.top_scope(vec![Job::Enter(entries)], count, body.forms, top);
            }
            "SYMBOL-MACROLET" => {
                let (entries, body) = symbol_macros(self, environment, &form, top.origin)?;
                let count = entries.len();
                self.top_scope(vec![Job::Enter(entries)], count, body.forms, top);
            }
            "MACROLET" => {
                let (jobs, count, body) = local_macros(self, environment, &form, top.to())?;
                self.top_scope(jobs, count, body.forms, top);
            }
            "EVAL-WHEN" => self.top_eval_when(&form, top)?,
            "DECLAIM" => {
                let effects = proclamations(self, &form, top.origin)?;
                self.schedule([Job::TopLevel(effects, top)]);
            }
            "IN-PACKAGE" => {
                let enter = package_change(environment, &form)?;
                self.schedule([Job::TopLevel(enter, top)]);
            }
            "DEFUN" | "DEFMACRO" => self.top_chunk(datum, top, true),
            _ => self.top_chunk(datum, top, false),
        }
        Ok(())
    }

    /// Stops for the expansion of a top-level macro call.
    fn stop_for_top(&mut self, function: MacroRef, form: &Form, is_standard: bool, top: Top) -> Checked {
        let waiting = |origin| AwaitedOutcome::TopLevel(Top { origin, ..top });
        self.stop_for_macro(function, form, is_standard, top.origin, waiting)
    }

    /// Processes forms in a row as top-level forms.
    fn top_forms(&mut self, forms: Vec<Datum>, top: Top) {
        let jobs = top_jobs(forms, top);
        self.schedule(jobs);
    }

    /// Processes forms in a row as top-level forms. `jobs` bring `count` names into scope.
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

/// Returns the jobs that process forms in a row. The value of the last form is that of the whole.
fn top_jobs(mut forms: Vec<Datum>, top: Top) -> Vec<Job> {
    if forms.is_empty() && top.is_last {
        forms.push(Datum::nil(top.span));
    }
    let last = forms.len().saturating_sub(1);
    let jobs = forms.into_iter().enumerate();
    jobs.map(|(index, form)| Job::TopLevel(form, Top { is_last: top.is_last && index == last, ..top }))
        .collect()
}
