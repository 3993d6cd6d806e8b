//! Compilations: from a text, or from a form, to a module.
//!
//! A compilation takes one top-level form after another through the reader, the expander and the lowering.
//! Each becomes one or more chunks, small modules. Chunks that are needed at compile time are loaded at
//! once ([`Step::Load`]), and all chunks of the program are joined at the end. All findings are reported
//! together, in the order of the text; an error in one form does not keep the others from being checked.
//!
//! A form `(require "name")` of a text stops the compilation ([`Step::Require`]). The forms of the module
//! come in its place, or at least their definitions at compile time; see `queue`.
//!
//! Not here: running code, finding modules. The driver of the compilation does that, see
//! [`esl_bytecode::compile`].

mod calls;
mod cascade;
mod compilation;
mod queue;

use std::sync::Arc;

use esl_bytecode::compile::{Compilation, Compile, Environment, Part, Step, StepOutcome, Work};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::SourceId;

use crate::core::Core;
use crate::cover::CountedPlace;
use crate::diagnostic::{Renderer, Sources};
pub use crate::expand::AllowedWarnings;
use crate::expand::Expander;
use crate::lower::SourceLines;
use crate::reader::read_datum;

use compilation::{CompilationState, FormSource};
use queue::FormQueue;

/// The compiler.
#[derive(Debug, Default)]
pub struct Compiler {
    /// Number of the first source in diagnostics.
    source: SourceId,
    /// Whether modules stay outside of the program, which finds them at run time.
    apart: bool,
    /// Whether passages of places are counted.
    covered: bool,
    /// Whether points stand before uses of places that tasks may share.
    points: bool,
    /// Whether the core language of the program is kept.
    core: bool,
}

impl Compiler {
    /// Creates a compiler whose diagnostics number the text `source`.
    pub fn for_source(source: SourceId) -> Compiler {
        Compiler { source, ..Compiler::default() }
    }

    /// Leaves required modules out of the program, which finds them at run time.
    #[must_use]
    pub fn apart(mut self) -> Compiler {
        self.apart = true;
        self
    }

    /// Has texts compiled so that a machine can count how often control passes their places.
    #[must_use]
    pub fn covered(mut self) -> Compiler {
        self.covered = true;
        self
    }

    /// Has texts compiled with points before the uses of places that tasks may share, for explorations.
    #[must_use]
    pub fn with_points(mut self) -> Compiler {
        self.points = true;
        self
    }

    /// Keeps the core language of texts, form by form, for analyses.
    #[must_use]
    pub fn with_core(mut self) -> Compiler {
        self.core = true;
        self
    }

    /// Begins to compile a whole text for the sake of its expansion.
    pub fn expand_text(&self, name: &str, text: &str) -> Texts {
        Texts(CompilationState { listing: Some(String::new()), ..self.texts(&[(name, text)]) })
    }

    /// Begins to compile texts, each with its name, to one module that runs them in order. They see each
    /// other's definitions like parts of one text, but each is read, and runs, in the package `ESL-USER`
    /// until it says otherwise, or in `COMMON-LISP-USER` if its name ends in `.lisp`. Diagnostics number
    /// them from the compiler's source number on.
    pub fn compile_texts(&self, texts: &[(&str, &str)]) -> Texts {
        Texts(self.texts(texts))
    }

    fn texts(&self, texts: &[(&str, &str)]) -> CompilationState {
        let mut sources = Sources::new();
        for _ in 0..self.source.0 {
            sources.add("", None);
        }
        let mut lines = SourceLines::new();
        let mut queue = FormQueue::default();
        for &(name, text) in texts {
            let text: Arc<str> = text.into();
            sources.add(name, Some(text.clone()));
            queue.add(name, lines.add(name, text.clone()), text);
        }
        let places = self.covered.then(Vec::new);
        CompilationState { places, ..self.session(FormSource::Texts(queue), lines, sources) }
    }

    fn session(&self, input: FormSource, lines: SourceLines, sources: Sources) -> CompilationState {
        CompilationState {
            input,
            source: self.source,
            sources,
            apart: self.apart,
            asked: None,
            loading: None,
            is_reading: false,
            calls: None,
            lines,
            expander: Expander::new(),
            lowering: None,
            chunks: Vec::new(),
            chunk_bytes: 0,
            diagnostics: Vec::new(),
            listing: None,
            places: None,
            points: self.points,
            forms: self.core.then(Vec::new),
        }
    }
}

impl Compile for Compiler {
    fn compile_form(&self, form: Datum, part: Option<Part<'_>>) -> Box<dyn Compilation> {
        let mut lines = SourceLines::new();
        let mut sources = Sources::new();
        if let Some(part) = part {
            sources.add_part(&part);
            lines.add_part(&part);
        }
        Box::new(self.session(FormSource::Form(Some(form)), lines, sources))
    }

    fn compile_text(&self, name: &str, text: &str) -> Box<dyn Compilation> {
        Box::new(self.texts(&[(name, text)]))
    }

    fn read(
        &self,
        environment: &mut dyn Environment,
        text: &str,
        start: usize,
    ) -> Result<(Option<Datum>, usize), Box<Diagnostic>> {
        read_datum(environment, text, start)
    }

    fn render(&self, diagnostic: &Diagnostic, name: Option<&str>, text: &str) -> String {
        let mut sources = Sources::new();
        if let Some(name) = name {
            sources.add(name, Some(text.into()));
        }
        Renderer::default().render(diagnostic, &sources)
    }
}

/// A compilation of whole texts.
pub struct Texts(CompilationState);

impl Texts {
    /// Returns the texts, those of required modules included.
    pub fn sources(&self) -> &Sources {
        &self.0.sources
    }

    /// Returns the places whose passages are counted, by their numbers.
    pub fn places(&self) -> &[CountedPlace] {
        self.0.places.as_deref().unwrap_or_default()
    }

    /// Returns the program's top-level forms in the core language, in order, those of required modules
    /// included. Takes them out, if they are kept.
    pub fn take_core(&mut self) -> Vec<Core> {
        self.0.forms.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Returns the warnings that forms allow, for those of analyses.
    pub fn allowed(&self) -> &[AllowedWarnings] {
        self.0.expander.allowed()
    }

    /// Returns the expansion so far, form by form, if the text is compiled for the sake of that.
    pub fn expansion(&self) -> &str {
        self.0.listing.as_deref().unwrap_or_default()
    }
}

impl Compilation for Texts {
    fn step(&mut self, environment: &mut dyn Environment, answer: StepOutcome, work: &mut Work) -> Step {
        self.0.step(environment, answer, work)
    }

    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    fn render(&self, diagnostic: &Diagnostic) -> String {
        self.0.render(diagnostic)
    }
}
