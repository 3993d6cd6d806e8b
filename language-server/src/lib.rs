//! `eslc lsp`: a language server over standard input and output, for editors.
//!
//! Guarantees: a request is answered from the texts as the editor has them; what is asked of a name works on
//! the lossless tree, so also in a file that does not compile. Diagnostics are those of the compiler and of
//! the analysis of failures, found on a thread of its own once the typing pauses. Not here: the messages of
//! the protocol (`lsp-server`, `lsp-types`), formatting ([`esl_format`]).
//!
//! ```
//! use esl_language_server::{ServeError, serve};
//!
//! // Standard input ends at once here: no client has said hello, which is an error.
//! assert!(matches!(serve(Vec::new()), Err(ServeError::NoGreeting)));
//! ```
#![forbid(unsafe_code)]

mod answer;
mod check;
mod complete;
mod definition;
mod describe;
mod document;
mod expand;
mod explored;
mod failures;
mod family;
mod inferred;
mod layout;
mod library;
mod links;
mod navigate;
mod outline;
mod project;
mod recovery;
mod reference;
mod rename;
mod repair;
mod scope;
mod semantic;
mod uses;
mod wire;

use std::fmt;
use std::io::{self, BufRead};
use std::path::PathBuf;
use std::sync::mpsc;

use lsp_server::{ErrorCode, Message, Notification, Request, Response};
use lsp_types::notification::{
    DidChangeTextDocument, DidChangeWatchedFiles, DidCloseTextDocument, DidOpenTextDocument,
    DidSaveTextDocument, Exit, Initialized, Notification as NotificationKind,
};
use lsp_types::request::{Initialize, RegisterCapability, Request as _, Shutdown};
use lsp_types::{
    CodeActionProviderCapability, CodeLensOptions, CompletionOptions, DocumentLinkOptions,
    DocumentOnTypeFormattingOptions, ExecuteCommandOptions, FoldingRangeProviderCapability,
    HoverProviderCapability, InitializeParams, OneOf, PositionEncodingKind, RenameOptions,
    SelectionRangeProviderCapability, SemanticTokensFullOptions, SemanticTokensOptions, ServerCapabilities,
    SignatureHelpOptions, TextDocumentSyncCapability, TextDocumentSyncKind,
};
use serde_json::Value;

use check::Checker;
use document::{ColumnUnit, path_of};
use project::Project;
use wire::{read_frame, sent, start_writer};

/// How a client has left the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientExit {
    /// It had asked for the end before.
    AfterShutdown,
    /// It had not: it may have been killed.
    WithoutShutdown,
}

/// Reason why no client was served, or not to its end.
#[derive(Debug)]
#[non_exhaustive]
pub enum ServeError {
    /// The input ended before a client has said hello.
    NoGreeting,
    /// Standard input cannot be read, or standard output not be written.
    Stream(io::Error),
}

impl fmt::Display for ServeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ServeError::NoGreeting => f.write_str("the input ended before an `initialize` request"),
            ServeError::Stream(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for ServeError {}

impl From<io::Error> for ServeError {
    fn from(error: io::Error) -> ServeError {
        ServeError::Stream(error)
    }
}

/// Serves one client over standard input and output until it says goodbye. Modules are found in `folders`
/// too.
///
/// # Errors
/// [`ServeError`].
pub fn serve(folders: Vec<PathBuf>) -> Result<ClientExit, ServeError> {
    let (sender, writer) = start_writer();
    let served = session(&mut io::stdin().lock(), &sender, folders);
    // The writing thread ends with the last sender.
    drop(sender);
    let written = writer.join().unwrap_or(Ok(()));
    let exit = served?;
    written?;
    Ok(exit)
}

/// The state of a session with a client.
struct ServedClient {
    /// The texts, once the client has said hello.
    greeted: Option<(Project, Checker)>,
    folders: Vec<PathBuf>,
    /// Whether the client can be asked to watch files.
    watches: bool,
    is_shut_down: bool,
}

/// Returns the request to watch files with findings of explorations.
fn watch_request() -> Request {
    let pattern = format!("**/*{}", explored::FINDINGS);
    let registration = serde_json::json!({
        "id": "findings", "method": DidChangeWatchedFiles::METHOD,
        "registerOptions": { "watchers": [{ "globPattern": pattern }] },
    });
    let parameters = serde_json::json!({ "registrations": [registration] });
    Request::new("findings".to_owned().into(), RegisterCapability::METHOD.to_owned(), parameters)
}

fn session(
    input: &mut impl BufRead,
    sender: &mpsc::Sender<Value>,
    folders: Vec<PathBuf>,
) -> Result<ClientExit, ServeError> {
    let mut session = ServedClient { greeted: None, folders, watches: false, is_shut_down: false };
    while let Some(frame) = read_frame(input)? {
        let answer = match frame {
            Ok(Message::Request(request)) => sent(Message::Response(session.answer(request, sender))),
            Ok(Message::Notification(notification)) if notification.method == Exit::METHOD => {
                return Ok(session.exit());
            }
            Ok(Message::Notification(notification))
                if notification.method == Initialized::METHOD && session.watches =>
            {
                sent(Message::Request(watch_request()))
            }
            Ok(Message::Notification(notification)) => {
                if let Some((project, checker)) = &mut session.greeted {
                    take(project, checker, notification);
                }
                continue;
            }
            Ok(Message::Response(_)) => continue,
            Err(fault) => fault.answer(),
        };
        if sender.send(answer).is_err() {
            break;
        }
    }
    // An end without `exit`: the client may have been killed.
    if session.greeted.is_none() { Err(ServeError::NoGreeting) } else { Ok(session.exit()) }
}

impl ServedClient {
    /// Returns how the client leaves if it leaves now.
    fn exit(&self) -> ClientExit {
        if self.is_shut_down { ClientExit::AfterShutdown } else { ClientExit::WithoutShutdown }
    }

    fn answer(&mut self, request: Request, sender: &mpsc::Sender<Value>) -> Response {
        let refuse = |id, code: ErrorCode, message: &str| Response::new_err(id, code as i32, message.into());
        match (&*request.method, &self.greeted) {
            _ if self.is_shut_down => {
                refuse(request.id, ErrorCode::InvalidRequest, "the server has been asked to shut down")
            }
            (Initialize::METHOD, None) => self.greet(request, sender),
            (Initialize::METHOD, Some(_)) => {
                refuse(request.id, ErrorCode::InvalidRequest, "the session is initialized already")
            }
            (_, None) => {
                let message = "the first request of a session is `initialize`";
                refuse(request.id, ErrorCode::ServerNotInitialized, message)
            }
            (Shutdown::METHOD, Some(_)) => {
                self.is_shut_down = true;
                Response::new_ok(request.id, ())
            }
            (_, Some((project, _))) => answer::answer(project, request),
        }
    }

    fn greet(&mut self, request: Request, sender: &mpsc::Sender<Value>) -> Response {
        let parameters: InitializeParams = match serde_json::from_value(request.params) {
            Ok(parameters) => parameters,
            Err(error) => {
                let message = format!("invalid `initialize` request: {error}");
                return Response::new_err(request.id, ErrorCode::InvalidParams as i32, message);
            }
        };
        let unit = unit_of(&parameters);
        let workspace = parameters.capabilities.workspace.as_ref();
        let of_lenses = workspace.and_then(|workspace| workspace.code_lens.as_ref());
        let of_watching = workspace.and_then(|workspace| workspace.did_change_watched_files.as_ref());
        self.watches = of_watching.and_then(|watching| watching.dynamic_registration).unwrap_or(false);
        let refreshes = of_lenses.and_then(|lenses| lenses.refresh_support).unwrap_or(false);
        let roots = parameters.workspace_folders.unwrap_or_default();
        let roots = roots.iter().map(|folder| path_of(&folder.uri)).collect();
        let sender = sender.clone();
        let project = Project::new(self.folders.clone(), roots, unit);
        let inferred = project.inferred.clone();
        let checker = Checker::start(inferred, refreshes, move |message| sender.send(sent(message)).is_ok());
        self.greeted = Some((project, checker));
        let result = serde_json::json!({
            "capabilities": capabilities(unit),
            "serverInfo": { "name": "eslc", "version": env!("CARGO_PKG_VERSION") },
        });
        Response::new_ok(request.id, result)
    }
}

/// Takes a change of a text in the editor. A notification that cannot be understood is left aside, as the
/// protocol wants.
fn take(project: &mut Project, checker: &Checker, notification: Notification) {
    let Notification { method, params } = notification;
    match &*method {
        DidOpenTextDocument::METHOD => {
            let Ok(opened) = parameters::<DidOpenTextDocument>(params) else { return };
            let opened = opened.text_document;
            let uri = opened.uri.clone();
            project.open(opened.uri, opened.version, opened.text);
            checker.check(project, &uri);
        }
        DidChangeTextDocument::METHOD => {
            let Ok(changed) = parameters::<DidChangeTextDocument>(params) else { return };
            let identity = changed.text_document;
            if let Some(text) = project.text_mut(&identity.uri) {
                text.change(identity.version, changed.content_changes);
                checker.check(project, &identity.uri);
            }
        }
        DidSaveTextDocument::METHOD => {
            let Ok(saved) = parameters::<DidSaveTextDocument>(params) else { return };
            checker.check(project, &saved.text_document.uri);
        }
        DidChangeWatchedFiles::METHOD => {
            project.open_uris().iter().for_each(|uri| checker.check(project, uri));
        }
        DidCloseTextDocument::METHOD => {
            let Ok(closed) = parameters::<DidCloseTextDocument>(params) else { return };
            project.close(&closed.text_document.uri);
            checker.forget(&closed.text_document.uri);
        }
        _ => {}
    }
}

fn parameters<N: NotificationKind>(value: serde_json::Value) -> Result<N::Params, serde_json::Error> {
    serde_json::from_value(value)
}

fn unit_of(parameters: &InitializeParams) -> ColumnUnit {
    let general = parameters.capabilities.general.as_ref();
    let offered = general.and_then(|general| general.position_encodings.as_ref());
    match offered.is_some_and(|offered| offered.contains(&PositionEncodingKind::UTF8)) {
        true => ColumnUnit::Bytes,
        false => ColumnUnit::Utf16,
    }
}

fn capabilities(unit: ColumnUnit) -> ServerCapabilities {
    let tokens = SemanticTokensOptions {
        legend: semantic::legend(),
        full: Some(SemanticTokensFullOptions::Bool(true)),
        range: Some(true),
        ..SemanticTokensOptions::default()
    };
    let triggers = |characters: &[&str]| Some(characters.iter().map(|text| text.to_string()).collect());
    ServerCapabilities {
        position_encoding: Some(match unit {
            ColumnUnit::Bytes => PositionEncodingKind::UTF8,
            ColumnUnit::Utf16 => PositionEncodingKind::UTF16,
        }),
        text_document_sync: Some(TextDocumentSyncCapability::Kind(TextDocumentSyncKind::INCREMENTAL)),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        completion_provider: Some(CompletionOptions {
            trigger_characters: triggers(&["(", ":", "-"]),
            ..CompletionOptions::default()
        }),
        signature_help_provider: Some(SignatureHelpOptions {
            trigger_characters: triggers(&["(", " "]),
            ..SignatureHelpOptions::default()
        }),
        definition_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        document_symbol_provider: Some(OneOf::Left(true)),
        workspace_symbol_provider: Some(OneOf::Left(true)),
        code_action_provider: Some(CodeActionProviderCapability::Simple(true)),
        document_formatting_provider: Some(OneOf::Left(true)),
        document_range_formatting_provider: Some(OneOf::Left(true)),
        document_on_type_formatting_provider: Some(DocumentOnTypeFormattingOptions {
            first_trigger_character: "\n".into(),
            more_trigger_character: None,
        }),
        document_link_provider: Some(DocumentLinkOptions {
            resolve_provider: Some(false),
            work_done_progress_options: Default::default(),
        }),
        code_lens_provider: Some(CodeLensOptions { resolve_provider: Some(false) }),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: Default::default(),
        })),
        selection_range_provider: Some(SelectionRangeProviderCapability::Simple(true)),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        inlay_hint_provider: Some(OneOf::Left(true)),
        semantic_tokens_provider: Some(tokens.into()),
        execute_command_provider: Some(ExecuteCommandOptions {
            commands: vec![expand::COMMAND.into()],
            ..ExecuteCommandOptions::default()
        }),
        ..ServerCapabilities::default()
    }
}
