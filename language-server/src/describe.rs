//! Descriptions of names: for hovering, and while a call is typed.

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};
use lsp_types::{
    Documentation, Hover, HoverContents, HoverParams, MarkupContent, MarkupKind, ParameterInformation,
    ParameterLabel, SignatureHelp, SignatureHelpParams, SignatureInformation,
};

use super::definition::{DefinedAs, NameDefinition};
use super::document::OpenText;
use super::failures;
use super::project::Project;
use super::scope::{LocalKind, binding_of};

/// Answers what the name at a position is.
pub(super) fn hover(project: &Project, parameters: &HoverParams) -> Option<Hover> {
    let at = &parameters.text_document_position_params;
    let text = project.text(&at.text_document.uri)?;
    let node = text.tree.node_at(text.offset(at.position));
    let name = bare_name(text.tree.name(node)?);
    let value = match binding_of(&text.tree, node) {
        Some(binding) => {
            let line = text.position(text.tree.range(binding.name).start).line + 1;
            match binding.kind {
                LocalKind::Variable => format!("`{name}`: local variable, bound on line {line}"),
                LocalKind::Function => format!("`{name}`: local function, bound on line {line}"),
                LocalKind::Block => format!("`{name}`: block, which begins on line {line}"),
                LocalKind::Tag => format!("`{name}`: tag on line {line}"),
            }
        }
        None => {
            let found = project.find(text, &name);
            if found.is_empty() {
                return None;
            }
            let mut texts: Vec<String> = found.iter().map(|(definition, _)| markdown(definition)).collect();
            let is_function = found.iter().any(|(definition, _)| definition.kind == DefinedAs::Function);
            texts.extend(failures::note(project, text, &name).filter(|_| is_function));
            texts.extend(failures::note_of_form(project, text, node));
            texts.join("\n\n---\n\n")
        }
    };
    let contents = HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value });
    Some(Hover { contents, range: Some(text.range(text.tree.range(node))) })
}

/// Returns what a definition is, in one or two words.
pub(super) fn kind_word(kind: DefinedAs) -> &'static str {
    match kind {
        DefinedAs::Function => "function",
        DefinedAs::Macro => "macro",
        DefinedAs::Operator => "special operator",
        DefinedAs::Variable => "variable",
        DefinedAs::Constant => "constant",
        DefinedAs::Type => "type",
        DefinedAs::Cause => "cause",
        DefinedAs::Package => "package",
        DefinedAs::Test => "test",
        DefinedAs::Slot => "accessor",
        DefinedAs::Other => "definition",
    }
}

/// Returns a call as it is written: as the text says, if it begins with that, or else the name, and the
/// lambda list without its parentheses.
pub(super) fn usage(definition: &NameDefinition) -> String {
    if let Some(usage) = told_usage(definition) {
        return usage;
    }
    match parameters_of(definition).join(" ") {
        list if definition.lambda_list.is_none() => list + &definition.name,
        list if list.is_empty() => format!("({})", definition.name),
        list => format!("({} {list})", definition.name),
    }
}

/// Returns the usage with which the text of a macro or operator begins: `(IF TEST THEN [ELSE]) evaluates …`.
fn told_usage(definition: &NameDefinition) -> Option<String> {
    let name = definition.name.to_uppercase();
    let text = definition.text.strip_prefix('(').filter(|text| text.starts_with(&name))?;
    if !matches!(definition.kind, DefinedAs::Macro | DefinedAs::Operator) {
        return None;
    }
    let mut depth = 1;
    let end = text.find(|c| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        depth == 0
    })?;
    Some(format!("({})", text[..end].to_lowercase()))
}

/// Returns a definition as Markdown: usage, kind, documentation.
pub(super) fn markdown(definition: &NameDefinition) -> String {
    let mut out = format!("```lisp\n{}\n```\n*{}*", usage(definition), kind_word(definition.kind));
    if !definition.text.is_empty() {
        // A newline of a docstring only breaks its line; characters that steer Markdown stay visible.
        let text = definition.text.replace('\n', " ").replace('*', "\\*").replace('<', "\\<");
        out.push_str(&format!("\n\n{text}"));
    }
    out
}

/// Returns the parts of a definition's lambda list, as written.
fn parameters_of(definition: &NameDefinition) -> Vec<String> {
    let Some(list) = &definition.lambda_list else { return Vec::new() };
    let tree = SyntaxTree::new(list.as_str());
    let Some(list) = tree.data(SyntaxTree::ROOT).next() else { return Vec::new() };
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts: Vec<String> = Vec::new();
    let mut data = tree.data(list);
    while let Some(node) = data.next() {
        let shown = match tree.name(node).map(bare_name).as_deref() {
            // Callers do not pass these.
            Some("&environment" | "&whole") => {
                data.next();
                continue;
            }
            Some("&aux") => break,
            _ => tree.text(node),
        };
        let part: Vec<NodeId> = tree.data(node).collect();
        let has_words = parts.iter().any(|word| matches!(&**word, "&optional" | "&key"));
        parts.push(match (&*part, tree.kind(node)) {
            // Whether it was given is for the function itself.
            (&[name, default, _], SyntaxKind::List) if has_words && tree.name(name).is_some() => {
                format!("({} {})", tree.text(name), one_line(tree.text(default)))
            }
            _ => one_line(shown),
        });
    }
    parts
}

/// Returns the list in which a position is, and the number of data before it there.
pub(super) fn call_at(text: &OpenText, offset: usize) -> Option<(NodeId, usize)> {
    let tree = &text.tree;
    let mut node = tree.node_at(offset);
    loop {
        let is_list = tree.kind(node) == SyntaxKind::List && offset >= tree.opening_end(node);
        let is_behind = tree.is_closed(node) && offset >= tree.range(node).end;
        if is_list && !is_behind && tree.operator(node).is_some() {
            let index = tree.data(node).filter(|&child| tree.range(child).end < offset).count();
            return Some((node, index));
        }
        node = tree.parent(node)?;
    }
}

/// Answers how the call at a position is written, and which argument is being typed.
pub(super) fn signature(project: &Project, parameters: &SignatureHelpParams) -> Option<SignatureHelp> {
    let at = &parameters.text_document_position_params;
    let text = project.text(&at.text_document.uri)?;
    let (list, index) = call_at(text, text.offset(at.position))?;
    let name = text.tree.operator(list)?;
    let is_call = |found: &NameDefinition| found.lambda_list.is_some() || told_usage(found).is_some();
    let (definition, _) = project.find(text, &name).into_iter().find(|(found, _)| is_call(found))?;
    let parts = parameters_of(&definition);
    // The names of the lambda list are to be found in what is shown.
    let label = match parts.is_empty() {
        true => usage(&definition),
        false => format!("({} {})", definition.name, parts.join(" ")),
    };
    let active = active_parameter(&parts, &typed(text, list), index.saturating_sub(1));
    let information = |part: &String| ParameterInformation {
        label: ParameterLabel::Simple(part.clone()),
        documentation: None,
    };
    let value = definition.text.clone();
    let signature = SignatureInformation {
        label,
        documentation: (!value.is_empty()).then_some(Documentation::String(value)),
        parameters: Some(parts.iter().map(information).collect()),
        active_parameter: active.map(|active| active as u32),
    };
    let active_parameter = active.map(|active| active as u32);
    Some(SignatureHelp { signatures: vec![signature], active_signature: Some(0), active_parameter })
}

/// Returns the arguments of a call as they are written.
fn typed(text: &OpenText, list: NodeId) -> Vec<String> {
    text.tree.data(list).skip(1).map(|node| text.tree.text(node).to_lowercase()).collect()
}

/// Returns the parameter to which argument `index` belongs.
fn active_parameter(parts: &[String], arguments: &[String], index: usize) -> Option<usize> {
    let mut count = 0;
    let mut has_keys = false;
    for (at, part) in parts.iter().enumerate() {
        match &*part.to_lowercase() {
            "&optional" => {}
            "&rest" | "&body" => return (at + 1 < parts.len()).then_some(at + 1),
            "&key" => {
                has_keys = true;
                break;
            }
            word if word.starts_with('&') => return None,
            _ if count == index => return Some(at),
            _ => count += 1,
        }
    }
    // The keyword before it says which one it is.
    let keyword = [index.checked_sub(1), Some(index)].into_iter().flatten().rev();
    let keyword = keyword.filter_map(|at| arguments.get(at)).find_map(|text| text.strip_prefix(':'))?;
    let name =
        |part: &String| part.trim_start_matches('(').split([' ', ')']).next().unwrap_or("").to_lowercase();
    has_keys.then(|| parts.iter().position(|part| name(part) == keyword))?
}
