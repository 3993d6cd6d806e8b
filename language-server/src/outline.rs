//! The structure of texts: symbols and folds.

use esl_syntax::SyntaxKind;
use lsp_types::{
    DocumentSymbol, DocumentSymbolParams, DocumentSymbolResponse, FoldingRange, FoldingRangeKind,
    FoldingRangeParams, OneOf, SelectionRange, SelectionRangeParams, SymbolKind, WorkspaceSymbol,
    WorkspaceSymbolParams, WorkspaceSymbolResponse,
};

use super::definition::{DefinedAs, definitions};
use super::describe::{kind_word, usage};
use super::project::Project;

/// Symbols of a workspace that are answered at once.
const MAX_SYMBOLS: usize = 1000;

/// Places that are offered to be selected around a position: so many of the innermost ones, and of the
/// outermost ones.
const INNERMOST: usize = 48;
const OUTERMOST: usize = 16;

fn symbol_kind(kind: DefinedAs) -> SymbolKind {
    match kind {
        DefinedAs::Function | DefinedAs::Macro | DefinedAs::Operator => SymbolKind::FUNCTION,
        DefinedAs::Variable => SymbolKind::VARIABLE,
        DefinedAs::Constant => SymbolKind::CONSTANT,
        DefinedAs::Type => SymbolKind::STRUCT,
        DefinedAs::Cause => SymbolKind::EVENT,
        DefinedAs::Package => SymbolKind::PACKAGE,
        DefinedAs::Test => SymbolKind::METHOD,
        DefinedAs::Slot => SymbolKind::FIELD,
        DefinedAs::Other => SymbolKind::OBJECT,
    }
}

/// Answers what a text defines. Further definitions by a structure stand inside it.
pub(super) fn symbols(
    project: &Project,
    parameters: &DocumentSymbolParams,
) -> Option<DocumentSymbolResponse> {
    let text = project.text(&parameters.text_document.uri)?;
    let mut symbols: Vec<DocumentSymbol> = Vec::new();
    let mut places: Vec<std::ops::Range<usize>> = Vec::new();
    let mut last_name = 0..0;
    for definition in definitions(&text.tree) {
        // The cause of a condition has no name of its own.
        if definition.kind == DefinedAs::Cause && definition.name_place == last_name {
            continue;
        }
        last_name = definition.name_place.clone();
        #[allow(deprecated, reason = "the field has to be there")]
        let symbol = DocumentSymbol {
            name: definition.name.clone(),
            detail: Some(match &definition.lambda_list {
                Some(_) => usage(&definition),
                None => kind_word(definition.kind).to_owned(),
            }),
            kind: symbol_kind(definition.kind),
            tags: None,
            deprecated: None,
            range: text.range(definition.place.clone()),
            selection_range: text.range(definition.name_place.clone()),
            children: None,
        };
        let is_inside = places.last().is_some_and(|outer| definition.place.start < outer.end);
        match symbols.last_mut().filter(|_| is_inside) {
            Some(outer) => outer.children.get_or_insert_default().push(symbol),
            None => {
                symbols.push(symbol);
                places.push(definition.place);
            }
        }
    }
    Some(DocumentSymbolResponse::Nested(symbols))
}

/// Answers which symbols of the workspace have the letters of a query, in order.
pub(super) fn workspace_symbols(
    project: &Project,
    parameters: &WorkspaceSymbolParams,
) -> Option<WorkspaceSymbolResponse> {
    let query: Vec<char> = parameters.query.to_lowercase().chars().collect();
    let fits = |name: &str| {
        let mut letters = name.chars();
        query.iter().all(|wanted| letters.any(|letter| letter == *wanted))
    };
    let mut symbols = Vec::new();
    for text in project.workspace() {
        for definition in definitions(&text.tree).into_iter().filter(|found| fits(&found.name)) {
            symbols.push(WorkspaceSymbol {
                kind: symbol_kind(definition.kind),
                container_name: Some(definition.package).filter(|package| !package.is_empty()),
                location: OneOf::Left(text.location(definition.name_place)),
                name: definition.name,
                tags: None,
                data: None,
            });
        }
    }
    symbols.truncate(MAX_SYMBOLS);
    Some(WorkspaceSymbolResponse::Nested(symbols))
}

/// Answers what can be folded: lists and comments of several
/// lines, of those that begin on one line the outermost.
pub(super) fn folds(project: &Project, parameters: &FoldingRangeParams) -> Option<Vec<FoldingRange>> {
    let text = project.text(&parameters.text_document.uri)?;
    let tree = &text.tree;
    let mut folds: Vec<FoldingRange> = Vec::new();
    let mut comment: Option<(u32, u32)> = None;
    let mut push = |start_line: u32, end_line: u32, kind: Option<FoldingRangeKind>| {
        let is_known = folds.last().is_some_and(|last| last.start_line == start_line);
        if start_line < end_line && !is_known {
            folds.push(FoldingRange { start_line, end_line, kind, ..FoldingRange::default() });
        }
    };
    for node in tree.nodes() {
        let place = tree.range(node);
        let lines = || (text.lines.line_of(place.start) as u32, text.lines.line_of(place.end) as u32);
        match tree.kind(node) {
            SyntaxKind::Comment => {
                let (line, _) = lines();
                comment = match comment {
                    Some((first, last)) if last + 1 == line => Some((first, line)),
                    before => {
                        if let Some((first, last)) = before {
                            push(first, last, Some(FoldingRangeKind::Comment));
                        }
                        Some((line, line))
                    }
                };
                continue;
            }
            SyntaxKind::List => {
                let (first, last) = lines();
                push(first, last, None);
            }
            SyntaxKind::BlockComment => {
                let (first, last) = lines();
                push(first, last, Some(FoldingRangeKind::Comment));
            }
            _ => {}
        }
    }
    if let Some((first, last)) = comment {
        push(first, last, Some(FoldingRangeKind::Comment));
    }
    folds.sort_by_key(|fold| fold.start_line);
    Some(folds)
}

/// Answers what to select around positions, step by step: a word, its form without the parentheses and with
/// them, the form around that, up to the whole text.
pub(super) fn selections(
    project: &Project,
    parameters: &SelectionRangeParams,
) -> Option<Vec<SelectionRange>> {
    let text = project.text(&parameters.text_document.uri)?;
    let tree = &text.tree;
    let around = |&position: &lsp_types::Position| {
        let mut places = Vec::new();
        let mut at = Some(tree.node_at(text.offset(position)));
        while let Some(node) = at {
            let place = tree.range(node);
            let (first, last) = (tree.data(node).next(), tree.data(node).last());
            if let (SyntaxKind::List, Some(first), Some(last)) = (tree.kind(node), first, last) {
                places.push(tree.range(first).start..tree.range(last).end);
            }
            places.push(place);
            at = tree.parent(node);
        }
        places.dedup();
        // The answer nests as deep as there are places, and clients read it by recursion.
        if places.len() > INNERMOST + OUTERMOST {
            places.drain(INNERMOST..places.len() - OUTERMOST);
        }
        let outwards = |parent: Option<Box<SelectionRange>>, place: std::ops::Range<usize>| {
            Some(Box::new(SelectionRange { range: text.range(place), parent }))
        };
        let whole = SelectionRange { range: text.range(0..tree.source().len()), parent: None };
        places.into_iter().rev().fold(None, outwards).map_or(whole, |range| *range)
    };
    Some(parameters.positions.iter().map(around).collect())
}
