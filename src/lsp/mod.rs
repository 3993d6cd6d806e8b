//! `eslc lsp`: a language server over standard input and output, for editors.
//!
//! Guarantees: a request is answered from the texts as the editor has them; what is asked of a name works on
//! the lossless tree, so also in a file that does not compile. Diagnostics are those of the compiler, found
//! on a thread of its own once the typing pauses. Not here: the protocol (`lsp-server`, `lsp-types`),
//! formatting ([`crate::format`]).
//!
//! ```
//! // Standard input ends at once here: no client has said hello, which is an error.
//! assert_eq!(esl::lsp::serve(Vec::new()), 2);
//! ```

mod answer;
mod check;
mod complete;
mod definition;
mod describe;
mod document;
mod expand;
mod library;
mod navigate;
mod outline;
mod project;
mod recovery;
mod reference;
mod rename;
mod repair;
mod scope;
mod semantic;

use std::path::PathBuf;
use std::{fmt, io};

use lsp_server::{Connection, ErrorCode, Message, Notification, ProtocolError, Response};
use lsp_types::notification::{
    DidChangeTextDocument, DidCloseTextDocument, DidOpenTextDocument, DidSaveTextDocument, Exit,
    Notification as NotificationKind,
};
use lsp_types::request::{Request as _, Shutdown};
use lsp_types::{
    CodeActionProviderCapability, CompletionOptions, ExecuteCommandOptions, FoldingRangeProviderCapability,
    HoverProviderCapability, InitializeParams, OneOf, PositionEncodingKind, RenameOptions,
    SelectionRangeProviderCapability, SemanticTokensFullOptions, SemanticTokensOptions, ServerCapabilities,
    SignatureHelpOptions, TextDocumentSyncCapability, TextDocumentSyncKind,
};

use crate::command::{FAILED, SUCCESS, USAGE, complain};
use check::Checker;
use document::{ColumnUnit, path_of};
use project::Project;

/// What ended the service of a client before it said goodbye.
#[derive(Debug)]
enum LspError {
    /// The client breaks the protocol, or the connection ends.
    Protocol(ProtocolError),
    /// The client says hello wrongly.
    Hello(serde_json::Error),
    /// Standard output cannot be written, or standard input not be read.
    Streams(io::Error),
}

impl fmt::Display for LspError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LspError::Protocol(error) => error.fmt(f),
            LspError::Hello(error) => write!(f, "the client says hello wrongly: {error}"),
            LspError::Streams(error) => error.fmt(f),
        }
    }
}

/// Serves one client until it says goodbye. Returns the exit status: 0 if the client has asked for the end
/// before, 1 if it has not, 2 if it has not said hello.
pub fn serve(folders: Vec<PathBuf>) -> u8 {
    let (connection, threads) = Connection::stdio();
    let result = session(&connection, folders);
    // The writing thread ends when nobody can send any more.
    drop(connection);
    match result.and_then(|status| threads.join().map(|()| status).map_err(LspError::Streams)) {
        Ok(status) => status,
        Err(error) => {
            complain(error);
            USAGE
        }
    }
}

fn session(connection: &Connection, folders: Vec<PathBuf>) -> Result<u8, LspError> {
    let (id, parameters) = connection.initialize_start().map_err(LspError::Protocol)?;
    let parameters: InitializeParams = serde_json::from_value(parameters).map_err(LspError::Hello)?;
    let unit = unit_of(&parameters);
    let result = serde_json::json!({
        "capabilities": capabilities(unit),
        "serverInfo": { "name": "eslc", "version": env!("CARGO_PKG_VERSION") },
    });
    connection.initialize_finish(id, result).map_err(LspError::Protocol)?;
    let roots = parameters.workspace_folders.unwrap_or_default();
    let roots = roots.iter().map(|folder| path_of(&folder.uri)).collect();
    let mut project = Project::new(folders, roots, unit);
    let sender = connection.sender.clone();
    let checker = Checker::start(move |message| sender.send(message).is_ok());
    // What an end without a goodbye means: the client may have been killed.
    let mut status = FAILED;
    for message in &connection.receiver {
        match message {
            Message::Request(request) => {
                let response = match &*request.method {
                    _ if status == SUCCESS => {
                        let message = "the server has been asked to shut down".into();
                        Response::new_err(request.id, ErrorCode::InvalidRequest as i32, message)
                    }
                    Shutdown::METHOD => {
                        status = SUCCESS;
                        Response::new_ok(request.id, ())
                    }
                    _ => answer::answer(&project, request),
                };
                if connection.sender.send(Message::Response(response)).is_err() {
                    break;
                }
            }
            Message::Notification(notification) if notification.method == Exit::METHOD => break,
            Message::Notification(notification) => take(&mut project, &checker, notification),
            Message::Response(_) => {}
        }
    }
    Ok(status)
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
