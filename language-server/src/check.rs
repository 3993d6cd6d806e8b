//! Diagnostics: the compiler looks at a text on a thread of its own, once its editing pauses.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use esl::module_path::ModulePath;
use esl::program::{Compiled, Instrumentation, Source, compile_for_run};
use esl_analysis::AnalysisOptions;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;
use esl_vm::vm::Config;
use lsp_server::{Message, Notification, Request};
use lsp_types::notification::{Notification as NotificationKind, PublishDiagnostics};
use lsp_types::request::{CodeLensRefresh, Request as RequestKind};
use lsp_types::{
    Diagnostic as ShownDiagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, DiagnosticTag, Location,
    NumberOrString, PublishDiagnosticsParams, Uri,
};

use super::document::{ColumnUnit, OpenText, path_of, uri_of};
use super::explored::marks;
use super::inferred::{InferredText, InferredTexts};
use super::project::Project;

/// Time without a change after which a text is looked at.
const PAUSE: Duration = Duration::from_millis(150);
/// Time that an analysis may take before the findings of the compiler are told without it.
const PATIENCE: Duration = Duration::from_millis(100);
/// Ticks that the macros of a text may use.
const BUDGET: u64 = 50_000_000;
/// Native stack of the thread: the compiler takes more by itself.
const STACK: usize = 8 << 20;

/// A job of the checking thread.
enum CheckJob {
    Check(Box<CheckedText>),
    Forget(Uri),
}

struct CheckedText {
    uri: Uri,
    version: i32,
    text: String,
    path: ModulePath,
    unit: ColumnUnit,
    /// Folders of the workspace.
    roots: Vec<PathBuf>,
}

/// The thread that looks for diagnostics.
pub(super) struct Checker {
    jobs: mpsc::Sender<CheckJob>,
}

impl Checker {
    /// Starts the thread, which publishes what it finds by `sender`, and puts the failures of the texts into
    /// `inferred`. `refreshes` says whether the client can be asked to ask for lenses again.
    pub(super) fn start(
        inferred: InferredTexts,
        refreshes: bool,
        sender: impl Fn(Message) -> bool + Send + 'static,
    ) -> Checker {
        let (jobs, coming) = mpsc::channel();
        let run = move || work(&coming, &inferred, refreshes, &sender);
        // Without the thread there are no diagnostics, and all else works.
        drop(std::thread::Builder::new().name("diagnostics".into()).stack_size(STACK).spawn(run));
        Checker { jobs }
    }

    /// Has a text looked at, unless it changes again soon.
    pub(super) fn check(&self, project: &Project, uri: &Uri) {
        let Some(text) = project.text(uri) else { return };
        let job = CheckedText {
            uri: uri.clone(),
            version: text.version,
            text: text.tree.source().to_owned(),
            path: project.module_path(&text.path()),
            unit: project.unit,
            roots: project.roots.clone(),
        };
        _ = self.jobs.send(CheckJob::Check(Box::new(job)));
    }

    /// Takes back what was said of a text that is closed.
    pub(super) fn forget(&self, uri: &Uri) {
        _ = self.jobs.send(CheckJob::Forget(uri.clone()));
    }
}

fn work(
    coming: &mpsc::Receiver<CheckJob>,
    inferred: &InferredTexts,
    refreshes: bool,
    sender: &dyn Fn(Message) -> bool,
) {
    let mut refresh_count = 0;
    // Times that the analyses of texts have taken.
    let mut lasted: HashMap<String, Duration> = HashMap::new();
    let mut waiting: Vec<CheckedText> = Vec::new();
    let mut told: HashMap<String, HashSet<String>> = HashMap::new();
    loop {
        let next = match waiting.is_empty() {
            true => coming.recv().map_err(|_| RecvTimeoutError::Disconnected),
            false => coming.recv_timeout(PAUSE),
        };
        match next {
            Ok(CheckJob::Check(text)) => {
                waiting.retain(|other| other.uri != text.uri);
                waiting.push(*text);
            }
            Ok(CheckJob::Forget(uri)) => {
                waiting.retain(|other| other.uri != uri);
                inferred.forget(uri.as_str());
                for other in told.remove(uri.as_str()).unwrap_or_default() {
                    publish(sender, &other, Vec::new(), None);
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                let text = waiting.remove(0);
                let key = text.uri.as_str().to_owned();
                let mut compiled = compile(&text);
                // The findings of a long analysis do not keep those of the compiler waiting.
                if lasted.get(&key).is_some_and(|time| *time > PATIENCE) {
                    tell(sender, &mut told, &text, &compiled);
                }
                let begun = Instant::now();
                let failures = failures_of(&text, &mut compiled);
                lasted.insert(key.clone(), begun.elapsed());
                tell(sender, &mut told, &text, &compiled);
                let has_new_failures = failures.is_some();
                // A text with errors keeps the findings that it had before.
                if let Some(failures) = failures {
                    inferred.put(&key, failures);
                }
                if refreshes && has_new_failures {
                    refresh_count += 1;
                    let id = format!("lenses {refresh_count}").into();
                    let method = CodeLensRefresh::METHOD.to_owned();
                    _ = sender(Message::Request(Request::new(id, method, ())));
                }
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn publish(
    sender: &dyn Fn(Message) -> bool,
    uri: &str,
    diagnostics: Vec<ShownDiagnostic>,
    version: Option<i32>,
) {
    let Ok(uri) = uri.parse() else { return };
    let parameters = PublishDiagnosticsParams { uri, diagnostics, version };
    let method = PublishDiagnostics::METHOD.to_owned();
    _ = sender(Message::Notification(Notification::new(method, parameters)));
}

/// Compiles a text.
fn compile(checked: &CheckedText) -> Compiled {
    let source = Source::new(path_of(&checked.uri).display().to_string(), checked.text.as_str());
    let config = Config { budget: Some(BUDGET), ..Config::DEFAULT };
    compile_for_run(&[source], &checked.path, Instrumentation::Core, &config, &mut |_| {})
}

/// Finds the possible failures of a text without errors, and adds the findings to those of the compiler.
fn failures_of(checked: &CheckedText, compiled: &mut Compiled) -> Option<InferredText> {
    if compiled.has_errors() || compiled.stopped.is_some() {
        return None;
    }
    let cores = std::mem::take(&mut compiled.core);
    let (table, _) = esl_analysis::analyze(cores, &compiled.sources, &AnalysisOptions::default());
    esl_analysis::sharpen(&mut compiled.diagnostics, &table);
    let mut found = table.findings.clone();
    compiled.drop_allowed(&mut found);
    compiled.diagnostics.extend(found);
    let name = path_of(&checked.uri).display().to_string();
    Some(InferredText::new(name, checked.text.clone(), table))
}

/// Publishes what was found in a text and in the modules that it requires, and takes back what was told of
/// other texts before. `told` has the texts of which something was said, by the text that was looked at.
fn tell(
    sender: &dyn Fn(Message) -> bool,
    told: &mut HashMap<String, HashSet<String>>,
    text: &CheckedText,
    compiled: &Compiled,
) {
    let found = shown(text, compiled);
    let now: HashSet<String> = found.keys().cloned().collect();
    let key = text.uri.as_str().to_owned();
    for old in told.insert(key.clone(), now.clone()).unwrap_or_default().difference(&now) {
        publish(sender, old, Vec::new(), None);
    }
    for (uri, diagnostics) in found {
        let version = (uri == key).then_some(text.version);
        publish(sender, &uri, diagnostics, version);
    }
}

/// Returns what is to be said of a text, and of the modules that it requires, by their URIs.
fn shown(checked: &CheckedText, compiled: &Compiled) -> HashMap<String, Vec<ShownDiagnostic>> {
    let name = path_of(&checked.uri).display().to_string();
    let mut texts = ShownTexts { checked, name, compiled, known: HashMap::new() };
    let mut found: HashMap<String, Vec<ShownDiagnostic>> = HashMap::new();
    let explored = marks(&checked.uri, &checked.text, checked.unit, &checked.roots);
    found.insert(checked.uri.as_str().to_owned(), explored);
    if compiled.stopped.is_some() {
        let message = "the macros of this file have taken too much time or memory";
        let diagnostic = ShownDiagnostic { message: message.into(), ..ShownDiagnostic::default() };
        found.entry(checked.uri.as_str().to_owned()).or_default().push(diagnostic);
    }
    for diagnostic in &compiled.diagnostics {
        if let Some((uri, shown)) = texts.show(diagnostic) {
            found.entry(uri).or_default().push(shown);
        }
    }
    found
}

/// The texts that diagnostics refer to, with their places.
struct ShownTexts<'a> {
    checked: &'a CheckedText,
    name: String,
    compiled: &'a Compiled,
    known: HashMap<u32, Option<OpenText>>,
}

impl ShownTexts<'_> {
    fn text(&mut self, span: Span) -> Option<&OpenText> {
        let (checked, sources, own) = (self.checked, &self.compiled.sources, &self.name);
        let load = || {
            let (name, text) = (sources.name(span.source)?, sources.text(span.source)?);
            let uri = if name == own { checked.uri.clone() } else { uri_of(name.as_ref())? };
            Some(OpenText::new(uri, 0, text.to_string(), checked.unit))
        };
        self.known.entry(span.source.0).or_insert_with(load).as_ref()
    }

    fn location(&mut self, span: Span) -> Option<Location> {
        let text = self.text(span)?;
        Some(text.location(span.start as usize..span.end.max(span.start) as usize))
    }

    fn show(&mut self, diagnostic: &Diagnostic) -> Option<(String, ShownDiagnostic)> {
        let place = self.location(diagnostic.primary.span)?;
        let mut message = diagnostic.message.clone();
        for addition in [&diagnostic.primary.text, diagnostic.help.as_ref().unwrap_or(&String::new())] {
            if !addition.is_empty() {
                message.push_str(&format!("\n{addition}"));
            }
        }
        let related: Vec<DiagnosticRelatedInformation> = diagnostic
            .secondary
            .iter()
            .filter_map(|label| {
                let location = self.location(label.span)?;
                Some(DiagnosticRelatedInformation { location, message: label.text.clone() })
            })
            .collect();
        let is_unused = matches!(diagnostic.code, "unused-variable" | "unreachable-code");
        let shown = ShownDiagnostic {
            range: place.range,
            severity: Some(match diagnostic.severity {
                Severity::Error => DiagnosticSeverity::ERROR,
                Severity::Warning => DiagnosticSeverity::WARNING,
            }),
            code: Some(NumberOrString::String(diagnostic.code.into())),
            source: Some("eslc".into()),
            message,
            related_information: (!related.is_empty()).then_some(related),
            tags: is_unused.then(|| vec![DiagnosticTag::UNNECESSARY]),
            data: diagnostic.help.as_ref().map(|help| serde_json::json!({ "help": help })),
            ..ShownDiagnostic::default()
        };
        Some((place.uri.as_str().to_owned(), shown))
    }
}
