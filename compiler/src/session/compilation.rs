//! A compilation under way: which part of the work comes next, and what the answers of its driver mean.

use esl_bytecode::compile::{Compilation, Environment, Required, SourcePlace, Step, StepOutcome, Work};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::link::join;
use esl_bytecode::module::{Constant, Module};
use esl_bytecode::span::{SourceId, Span};

use super::calls::FormCalls;
use super::cascade::without_consequences;
use super::queue::{FormQueue, Next, renumber_uninterned};
use crate::core::Core;
use crate::cover::{CountedPlace, cover};
use crate::diagnostic::{Renderer, Sources, Stage, code};
use crate::expand::print::print;
use crate::expand::{Chunk, Expander, FailurePlace, MacroFailure, Purpose, Stop, UnitFindings};
use crate::lower::{Lowering, SourceLines};
use crate::reader::datum_end;

/// Source of forms.
#[derive(Debug)]
pub(super) enum FormSource {
    /// Texts, all forms of which are compiled.
    Texts(FormQueue),
    /// A form to be evaluated.
    Form(Option<Datum>),
}

/// A compilation under way.
pub(super) struct CompilationState {
    pub(super) input: FormSource,
    pub(super) source: SourceId,
    /// Texts, for drawing diagnostics.
    pub(super) sources: Sources,
    pub(super) apart: bool,
    /// Module that was asked for, and the place of the form that requires it.
    pub(super) asked: Option<(String, Span)>,
    /// Place of the form that requires the compiled module that is being loaded.
    pub(super) loading: Option<Span>,
    /// Whether the program reads a form.
    pub(super) is_reading: bool,
    /// Form that has been read and whose calls are being made.
    pub(super) calls: Option<FormCalls>,
    pub(super) lines: SourceLines,
    pub(super) expander: Expander,
    /// Chunk that is being lowered.
    pub(super) lowering: Option<Box<ChunkLowering>>,
    /// Chunks of the program.
    pub(super) chunks: Vec<Module>,
    /// About how many bytes these take.
    pub(super) chunk_bytes: usize,
    pub(super) diagnostics: Vec<Diagnostic>,
    /// Expansion of the forms, if that is wanted.
    pub(super) listing: Option<String>,
    /// Places whose passages are counted, if they are.
    pub(super) places: Option<Vec<CountedPlace>>,
    /// Whether points stand before uses of places that tasks may share.
    pub(super) points: bool,
    /// Core language of the program, if it is kept.
    pub(super) forms: Option<Vec<Core>>,
}

/// A chunk that is being lowered.
pub(super) struct ChunkLowering {
    lowering: Lowering,
    purpose: Purpose,
    /// Place of the chunk.
    span: Span,
}

impl Compilation for CompilationState {
    fn step(&mut self, environment: &mut dyn Environment, answer: StepOutcome, work: &mut Work) -> Step {
        if matches!(answer, StepOutcome::More) {
            // Nothing was asked.
        } else if let Some((name, span)) = self.asked.take() {
            self.take_module(&name, span, answer);
        } else if let Some(span) = self.loading.take() {
            if let StepOutcome::Failed(failure) = answer {
                let message = format!("the module failed at compile time: {}", failure.report);
                self.diagnostics.push(code::COMPILE_TIME_FAILURE.at(span, message));
            }
        } else if std::mem::take(&mut self.is_reading) {
            self.take_read(answer);
        } else if let Some(calls) = self.calls.take() {
            if let Some(step) = self.take_call(calls, answer) {
                return step;
            }
        } else if let StepOutcome::Failed(failure) = answer {
            let here = failure.place.as_ref().and_then(|place| self.span_of(place));
            let mut failure = MacroFailure::from(failure);
            if let Some(span) = here {
                failure.place = FailurePlace::Here(span);
            }
            self.expander.fail(&failure);
        } else {
            self.expander.answer(answer);
        }
        loop {
            if let Some(step) = self.go_on_lowering(work) {
                return step;
            }
            match self.expander.run(environment, work) {
                Stop::Macro(call) => return Step::Expand(call),
                Stop::More => return Step::More,
                Stop::Chunk(chunk) => self.begin_lowering(*chunk),
                Stop::Done => {
                    self.diagnostics.extend(self.expander.take_diagnostics());
                    if self.is_package_in_doubt() {
                        return self.give_up();
                    }
                    match self.next_form(environment) {
                        Next::Form => {}
                        Next::Calls(form) => {
                            if let Some(step) = self.make_calls(FormCalls::new(form)) {
                                return step;
                            }
                        }
                        Next::Read(call) => {
                            self.is_reading = true;
                            return Step::Expand(call);
                        }
                        Next::Require(name, span) => {
                            self.asked = Some((name.clone(), span));
                            return Step::Require(name);
                        }
                        Next::Module(mut module, span) => {
                            renumber_uninterned(&mut module, environment);
                            self.take_sources(&mut module);
                            if !self.apart {
                                self.keep_chunk(module.clone());
                            }
                            self.loading = Some(span);
                            return Step::Load { module, keep: false };
                        }
                        Next::End => return self.finish(environment),
                    }
                }
            }
        }
    }

    fn render(&self, diagnostic: &Diagnostic) -> String {
        Renderer::default().render(diagnostic, &self.sources)
    }

    fn bytes(&self) -> usize {
        let lowering = self.lowering.as_ref().map_or(0, |current| current.lowering.bytes());
        self.expander.bytes() + lowering + self.chunk_bytes
    }
}

impl CompilationState {
    /// Begins the next form, if there is one.
    fn next_form(&mut self, environment: &mut dyn Environment) -> Next {
        match &mut self.input {
            FormSource::Form(form) => match form.take() {
                Some(form) if form.has_calls() => Next::Calls(form),
                Some(form) => {
                    self.expander.begin_evaluation(form);
                    Next::Form
                }
                None => Next::End,
            },
            FormSource::Texts(queue) => queue.next(environment, &mut self.expander, &mut self.diagnostics),
        }
    }

    /// Asks for the next call in a form to be made, or puts the form back if all have been made.
    fn make_calls(&mut self, calls: FormCalls) -> Option<Step> {
        if let Some(call) = calls.next() {
            self.calls = Some(calls);
            return Some(Step::Expand(call));
        }
        let form = calls.finish();
        match &mut self.input {
            FormSource::Form(place) => *place = Some(form),
            FormSource::Texts(queue) => queue.put_back(form),
        }
        None
    }

    /// Takes what a call in a form has given. A form with a call that fails is left out.
    fn take_call(&mut self, mut calls: FormCalls, answer: StepOutcome) -> Option<Step> {
        match answer {
            StepOutcome::Expansion(expansion) => {
                calls.take(&expansion);
                self.make_calls(calls)
            }
            StepOutcome::Failed(failure) => {
                let message = format!("this failed when it was read: {}", failure.report);
                self.diagnostics.push(code::READ_TIME_FAILURE.at(calls.span(), message));
                None
            }
            _ => None,
        }
    }

    /// Takes what the program has read of a text.
    fn take_read(&mut self, answer: StepOutcome) {
        let FormSource::Texts(queue) = &mut self.input else { return };
        match answer {
            StepOutcome::Expansion(read) => queue.take_read(&read),
            StepOutcome::Failed(failure) => {
                let message = format!("this cannot be read as `*readtable*` says: {}", failure.report);
                let help = "the forms behind it are not compiled";
                self.diagnostics
                    .push(code::READ_TIME_FAILURE.at(queue.give_up_reading(), message).help(help));
            }
            _ => _ = queue.give_up_reading(),
        }
    }

    /// Returns the span of the datum at a place, up to the end of its first line, if the text is one of the
    /// compilation.
    fn span_of(&self, place: &SourcePlace) -> Option<Span> {
        let (SourceId(index), start) = self.sources.offset_of(place)?;
        let text = self.sources.text(SourceId(index))?;
        let end = datum_end(text, start).unwrap_or(start + 1);
        let end = text[start..end].find('\n').map_or(end, |length| start + length);
        Some(Span::new(SourceId(index.checked_sub(self.source.0)?), start as u32, end as u32))
    }

    /// Puts the module that was asked for in the place of the form that requires it.
    fn take_module(&mut self, name: &str, span: Span, answer: StepOutcome) {
        let FormSource::Texts(queue) = &mut self.input else { return };
        match answer {
            StepOutcome::Module(Required::Source { name: path, text }) => {
                self.sources.add(path.clone(), Some(text.clone()));
                let source = self.lines.add(&path, text.clone());
                queue.enter(name, span, source, text);
            }
            StepOutcome::Module(Required::Compiled(module)) => queue.enter_compiled(name, span, *module),
            StepOutcome::Failed(failure) => {
                let message = format!("the module `{name}` is not available: {}", failure.report);
                self.diagnostics.push(code::UNKNOWN_MODULE.at(span, message));
                // All forms after it may use definitions of the module.
                queue.leave_out_forms();
            }
            _ => queue.add_call(name, span),
        }
    }

    /// Adds the sources of a compiled module to those of the compilation, without their texts.
    fn take_sources(&mut self, module: &mut Module) {
        let first = self.lines.names().count() as u32;
        for name in &module.sources {
            self.sources.add(name.clone(), None);
            self.lines.add(name, "".into());
        }
        for entry in module.functions.iter_mut().flat_map(|function| &mut function.lines) {
            entry.source = entry.source.saturating_add(first);
        }
        module.sources = self.lines.names().map(String::from).collect();
    }

    /// Whether the current form stays outside of the program.
    fn is_outside(&self) -> bool {
        self.apart && matches!(&self.input, FormSource::Texts(queue) if queue.is_inside_module())
    }

    /// Begins to lower a chunk.
    fn begin_lowering(&mut self, chunk: Chunk) {
        let Chunk { mut core, mut purpose } = chunk;
        purpose.emit &= !self.is_outside();
        let span = core.nodes.first().map(|node| node.span).unwrap_or_default();
        if let (Some(listing), true) = (&mut self.listing, purpose.emit) {
            listing.push_str(&print(&core));
            listing.push_str("\n\n");
        }
        if let (Some(forms), true) = (&mut self.forms, purpose.emit) {
            forms.push(core.clone());
        }
        if let Some(places) = &mut self.places {
            cover(&mut core, &self.lines, places);
        }
        self.lowering = Some(Box::new(ChunkLowering {
            lowering: Lowering::new(core).with_points(self.points),
            purpose,
            span,
        }));
    }

    /// Goes on lowering a chunk, if there is one, and returns the next step, if that leads to one.
    fn go_on_lowering(&mut self, work: &mut Work) -> Option<Step> {
        let mut current = self.lowering.take()?;
        let Some(lowered) = current.lowering.run(&self.lines, work) else {
            self.lowering = Some(current);
            return Some(Step::More);
        };
        self.chunk(lowered, current.purpose, current.span)
    }

    /// Takes a lowered chunk: keeps it for the program, asks for it to be loaded, or both.
    fn chunk(
        &mut self,
        lowered: Result<Module, Vec<Diagnostic>>,
        purpose: Purpose,
        span: Span,
    ) -> Option<Step> {
        let module = match lowered {
            Ok(module) => module,
            Err(diagnostics) => {
                self.diagnostics.extend(diagnostics);
                if purpose.load || purpose.keep {
                    self.expander.answer(StepOutcome::Start);
                }
                return None;
            }
        };
        let is_file = matches!(self.input, FormSource::Texts(_));
        if is_file
            && purpose.emit
            && module.constants.iter().any(|constant| matches!(constant, Constant::Object(_)))
        {
            let message = "a macro has put an object that cannot be written to a file into this form";
            let help = "have the macro return a form that makes the object when the program runs";
            self.diagnostics.push(code::LITERAL_OBJECT.at(span, message).help(help));
        }
        match (purpose.load, purpose.emit) {
            (true, true) => {
                self.keep_chunk(module.clone());
                Some(Step::Load { module, keep: purpose.keep })
            }
            (true, false) => Some(Step::Load { module, keep: purpose.keep }),
            (false, true) => {
                self.keep_chunk(module);
                None
            }
            (false, false) => None,
        }
    }

    /// Adds a chunk to the program.
    fn keep_chunk(&mut self, module: Module) {
        self.chunk_bytes += module.bytes();
        self.chunks.push(module);
    }

    /// Whether the last form was to make or enter a package, and has errors.
    fn is_package_in_doubt(&self) -> bool {
        matches!(&self.input, FormSource::Texts(queue) if queue.is_package_in_doubt(&self.expander))
    }

    /// Ends the compilation before the end of its texts: all names there would be in doubt.
    fn give_up(&mut self) -> Step {
        let mut errors = self.diagnostics.iter_mut().rev();
        if let Some(last) = errors.find(|diagnostic| diagnostic.severity == Severity::Error) {
            let help = if last.code == code::UNKNOWN_PACKAGE.name {
                "the forms behind it are not compiled, since their names depend on this. The whole file is compiled before \
                 any of it runs, `load` too: if another file makes the package, call that `NAME.esl`, and write \
                 `(require \"NAME\")`"
            } else {
                "the forms behind it are not compiled, since their names depend on this"
            };
            last.help.get_or_insert(help.into());
        }
        self.end(Vec::new())
    }

    /// Ends the compilation at the end of its texts.
    fn finish(&mut self, environment: &mut dyn Environment) -> Step {
        let is_partial = |diagnostic: &Diagnostic| {
            diagnostic.severity == Severity::Error
                && ([code::UNKNOWN_MODULE, code::READ_TIME_FAILURE]
                    .iter()
                    .any(|lost| lost.name == diagnostic.code)
                    || code::find(diagnostic.code).is_some_and(|code| code.stage == Stage::Reader))
        };
        let is_whole = !self.diagnostics.iter().any(is_partial);
        let UnitFindings { diagnostics, foreign } = self.expander.finish(environment, is_whole);
        self.diagnostics.extend(diagnostics);
        self.end(foreign)
    }

    /// Ends the compilation. Findings that follow from `foreign` forms are left out.
    fn end(&mut self, mut foreign: Vec<Span>) -> Step {
        let mut diagnostics = std::mem::take(&mut self.diagnostics);
        self.expander.drop_allowed(&mut diagnostics);
        for diagnostic in &mut diagnostics {
            self.renumber(diagnostic);
        }
        for span in &mut foreign {
            span.source.0 += self.source.0;
        }
        let mut diagnostics = without_consequences(diagnostics, foreign, &self.sources);
        diagnostics.sort_by_key(|diagnostic| {
            let span = diagnostic.primary.span;
            (span.source, span.start, span.end)
        });
        let has_failed = diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error);
        let mut module = (!has_failed).then(|| match std::mem::take(&mut self.chunks) {
            // Joining takes as long as making.
            mut chunks if chunks.len() == 1 => chunks.swap_remove(0),
            chunks => join(chunks),
        });
        if let (Some(module), FormSource::Texts(queue)) = (&mut module, &mut self.input) {
            module.requires = if self.apart { queue.take_apart() } else { Vec::new() };
        }
        Step::Done(module, diagnostics)
    }

    /// Numbers the sources of a diagnostic from the compiler's source number on. Within the compilation
    /// they begin at 0.
    fn renumber(&self, diagnostic: &mut Diagnostic) {
        diagnostic.primary.span.source.0 += self.source.0;
        for label in &mut diagnostic.secondary {
            label.span.source.0 += self.source.0;
        }
    }
}
