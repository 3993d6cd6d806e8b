//! Requests: which function answers which.

use std::fmt::Display;

use lsp_server::{ErrorCode, Request, Response};
use lsp_types::request::{
    CodeActionRequest, CodeLensRequest, Completion, DocumentHighlightRequest, DocumentLinkRequest,
    DocumentSymbolRequest, ExecuteCommand, FoldingRangeRequest, Formatting, GotoDefinition, HoverRequest,
    InlayHintRequest, OnTypeFormatting, PrepareRenameRequest, RangeFormatting, References, Rename,
    Request as RequestKind, SelectionRangeRequest, SemanticTokensFullRequest, SemanticTokensRangeRequest,
    SignatureHelpRequest, WorkspaceSymbolRequest,
};

use super::project::Project;
use super::{
    complete, describe, expand, layout, links, navigate, outline, recovery, rename, repair, semantic,
};

/// Answers a request.
pub(super) fn answer(project: &Project, request: Request) -> Response {
    match &*request.method.clone() {
        HoverRequest::METHOD => reply::<HoverRequest>(request, |p| describe::hover(project, &p)),
        SignatureHelpRequest::METHOD => {
            reply::<SignatureHelpRequest>(request, |p| describe::signature(project, &p))
        }
        Completion::METHOD => reply::<Completion>(request, |p| complete::complete(project, &p)),
        GotoDefinition::METHOD => reply::<GotoDefinition>(request, |p| navigate::definition(project, &p)),
        References::METHOD => reply::<References>(request, |p| navigate::references(project, &p)),
        DocumentHighlightRequest::METHOD => {
            reply::<DocumentHighlightRequest>(request, |p| navigate::highlights(project, &p))
        }
        PrepareRenameRequest::METHOD => {
            reply::<PrepareRenameRequest>(request, |p| rename::prepare_rename(project, &p))
        }
        Rename::METHOD => try_reply::<Rename, _>(request, |p| rename::rename(project, &p).map(Some)),
        DocumentSymbolRequest::METHOD => {
            reply::<DocumentSymbolRequest>(request, |p| outline::symbols(project, &p))
        }
        WorkspaceSymbolRequest::METHOD => {
            reply::<WorkspaceSymbolRequest>(request, |p| outline::workspace_symbols(project, &p))
        }
        SelectionRangeRequest::METHOD => {
            reply::<SelectionRangeRequest>(request, |p| outline::selections(project, &p))
        }
        FoldingRangeRequest::METHOD => reply::<FoldingRangeRequest>(request, |p| outline::folds(project, &p)),
        SemanticTokensFullRequest::METHOD => {
            reply::<SemanticTokensFullRequest>(request, |p| semantic::full(project, &p))
        }
        SemanticTokensRangeRequest::METHOD => {
            reply::<SemanticTokensRangeRequest>(request, |p| semantic::range(project, &p))
        }
        InlayHintRequest::METHOD => reply::<InlayHintRequest>(request, |p| recovery::hints(project, &p)),
        CodeActionRequest::METHOD => reply::<CodeActionRequest>(request, |p| repair::actions(project, &p)),
        Formatting::METHOD => reply::<Formatting>(request, |p| layout::whole(project, &p)),
        RangeFormatting::METHOD => reply::<RangeFormatting>(request, |p| layout::range(project, &p)),
        OnTypeFormatting::METHOD => reply::<OnTypeFormatting>(request, |p| layout::typed(project, &p)),
        DocumentLinkRequest::METHOD => reply::<DocumentLinkRequest>(request, |p| links::links(project, &p)),
        CodeLensRequest::METHOD => reply::<CodeLensRequest>(request, |p| links::lenses(project, &p)),
        ExecuteCommand::METHOD => try_reply::<ExecuteCommand, _>(request, |p| {
            expand::execute(project, &p).map(|text| Some(text.into()))
        }),
        method => {
            let message = format!("this server does not offer `{method}`");
            Response::new_err(request.id, ErrorCode::MethodNotFound as i32, message)
        }
    }
}

/// As [`reply`]; the answer may be a refusal, of which the client shows the text.
fn try_reply<R: RequestKind, E: Display>(
    request: Request,
    answer: impl FnOnce(R::Params) -> Result<R::Result, E>,
) -> Response {
    match serde_json::from_value(request.params) {
        Ok(parameters) => match answer(parameters) {
            Ok(result) => Response::new_ok(request.id, result),
            Err(refusal) => {
                Response::new_err(request.id, ErrorCode::RequestFailed as i32, refusal.to_string())
            }
        },
        Err(error) => refuse(request.id, &error),
    }
}

fn reply<R: RequestKind>(request: Request, answer: impl FnOnce(R::Params) -> R::Result) -> Response {
    match serde_json::from_value(request.params) {
        Ok(parameters) => Response::new_ok(request.id, answer(parameters)),
        Err(error) => refuse(request.id, &error),
    }
}

fn refuse(id: lsp_server::RequestId, error: &serde_json::Error) -> Response {
    Response::new_err(id, ErrorCode::InvalidParams as i32, error.to_string())
}
