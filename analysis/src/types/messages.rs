//! Fields of messages: keywords in calls of the module `ros` that the type of the message does not have, and
//! values that are not of the types of their fields.
//!
//! A type is known where a constant text names it: in the call itself, or in that which has made the
//! publisher, the input or the message. Types that the analysis cannot find, or that the program defines,
//! tell nothing.

use std::sync::OnceLock;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::kind::ValueType;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{BoundVariable, Callee, NodeId, NodeKind, VarId};
use rustc_hash::{FxHashMap, FxHashSet};

use super::set::{KnownFacts, TypeSet};
use super::walk::TypeWalk;
use crate::forms::{CoreForm, CoreForms};

/// A field of a type of messages.
#[derive(Clone, Debug)]
pub struct KnownField {
    /// Its keyword, in upper case and without its colon.
    pub keyword: String,
    /// Name of the type of its elements, if these are messages.
    pub part: Option<String>,
    /// Whether it is an array.
    pub is_array: bool,
    /// The values that a program may give for it, and perhaps more.
    pub values: ValueType,
}

/// A mistake about a field.
struct FieldFault {
    span: Span,
    /// The type of messages.
    of: String,
    /// The keyword of the field.
    keyword: String,
    /// The values that the field takes, and those that it is given, if there is such a field.
    values: Option<(ValueType, ValueType)>,
}

/// Finds the fields of a type of messages by its name.
pub type MessageFields = fn(&str) -> Option<Vec<KnownField>>;

static FIELDS: OnceLock<MessageFields> = OnceLock::new();

/// Has analyses compare fields of messages with their types, which `fields` finds. The first call counts.
pub fn compare_message_fields(fields: MessageFields) {
    FIELDS.get_or_init(|| fields);
}

/// Package of the module.
const PACKAGE: &str = "ROS";
/// Functions of the module that define types.
const DEFINING: [&str; 2] = ["DEFINE-MESSAGE", "DEFINITIONS"];
/// Longest way from a use of a value back to its type.
const LONGEST: u32 = 16;
/// Fields that a message names.
const NAMED: usize = 8;

/// The part of a message at a path.
enum MessagePart {
    Message(String),
    /// An array, with the type of its elements if these are messages.
    Array(Option<String>),
    Other,
}

impl MessagePart {
    fn of(field: &KnownField) -> MessagePart {
        match &field.part {
            part if field.is_array => MessagePart::Array(part.clone()),
            Some(part) => MessagePart::Message(part.clone()),
            None => MessagePart::Other,
        }
    }
}

/// The types of messages, and the origins of values.
pub(super) struct MessageTypes {
    fields: MessageFields,
    /// Types that the program defines.
    own: FxHashSet<String>,
    /// For each form, the values of variables that are not assigned.
    values: Vec<FxHashMap<VarId, NodeId>>,
    /// For each form, the parameters that are messages, with their types.
    parameters: Vec<FxHashMap<VarId, String>>,
}

impl MessageTypes {
    /// Returns the types for a program; `None` if it uses no messages, or searches their types in folders.
    pub(super) fn new(forms: &CoreForms) -> Option<MessageTypes> {
        let fields = *FIELDS.get()?;
        let mut types =
            MessageTypes { fields, own: FxHashSet::default(), values: Vec::new(), parameters: Vec::new() };
        let mut is_used = false;
        for form in &forms.forms {
            let mut values = FxHashMap::default();
            let mut parameters = FxHashMap::default();
            for node in &form.core.nodes {
                match &node.kind {
                    NodeKind::Let { bindings, .. } => {
                        for (variable, value) in bindings {
                            if let BoundVariable::Lexical(variable) = variable
                                && !form.core.variables[variable.index()].is_assigned
                            {
                                values.insert(*variable, *value);
                            }
                        }
                    }
                    NodeKind::Call(Callee::Global(symbol), arguments) if is_of_module(symbol) => {
                        is_used = true;
                        match (symbol.name(), text(form, arguments, 0), text(form, arguments, 2)) {
                            // The module itself calls it for folders of the environment only.
                            ("DEFINITIONS", ..) => return None,
                            ("DEFINE-MESSAGE", Some(name), _) => _ = types.own.insert(name.to_owned()),
                            ("DEFINE-MESSAGE", None, _) => return None,
                            ("CALL-SERVING", _, Some(name)) => {
                                note_parameter(form, arguments.get(5), name, "_Request", &mut parameters);
                            }
                            ("CALL-ACTION-SERVER", _, Some(name)) => {
                                note_parameter(form, arguments.get(5), name, "_Goal", &mut parameters);
                            }
                            _ => {}
                        }
                    }
                    // The program may define any type by them.
                    NodeKind::Apply(Callee::Global(symbol), _) | NodeKind::FunctionRef(symbol)
                        if is_of_module(symbol) && DEFINING.contains(&symbol.name()) =>
                    {
                        return None;
                    }
                    _ => {}
                }
            }
            types.values.push(values);
            types.parameters.push(parameters);
        }
        is_used.then_some(types)
    }

    fn fields(&self, name: &str) -> Option<Vec<KnownField>> {
        // A part of a service or an action is named after it.
        let is_own = |own: &String| name == own || name.strip_prefix(own.as_str()).is_some_and(starts_part);
        if self.own.iter().any(is_own) { None } else { (self.fields)(name) }
    }

    /// Returns the node whose value a node has, behind variables.
    fn origin(&self, forms: &CoreForms, at: usize, mut node: NodeId) -> NodeId {
        for _ in 0..LONGEST {
            match forms.forms[at].kind(node) {
                NodeKind::Local(variable) => match self.values[at].get(variable) {
                    Some(value) => node = *value,
                    None => break,
                },
                _ => break,
            }
        }
        node
    }

    /// Returns the type that the call named `maker` which has made a value names as its third argument.
    fn type_of_maker(&self, forms: &CoreForms, at: usize, node: NodeId, maker: &str) -> Option<String> {
        let form = &forms.forms[at];
        match form.kind(self.origin(forms, at, node)) {
            NodeKind::Call(Callee::Global(symbol), arguments)
                if is_of_module(symbol) && symbol.name() == maker =>
            {
                text(form, arguments, 2).map(str::to_owned)
            }
            _ => None,
        }
    }

    /// Returns the type of a message.
    fn type_of(&self, forms: &CoreForms, at: usize, node: NodeId, depth: u32) -> Option<String> {
        let form = &forms.forms[at];
        let node = self.origin(forms, at, node);
        match form.kind(node) {
            NodeKind::Local(variable) => self.parameters[at].get(variable).cloned(),
            NodeKind::Call(callee, arguments) => match callee {
                Callee::Builtin(Builtin::WaitForEvent) => {
                    self.type_of_maker(forms, at, *arguments.first()?, "SUBSCRIBE")
                }
                Callee::Global(symbol) if is_of_module(symbol) => match symbol.name() {
                    "MESSAGE" => text(form, arguments, 0).map(str::to_owned),
                    "CALL-SERVICE" => text(form, arguments, 2).map(|name| format!("{name}_Response")),
                    "DO-ACTION" => text(form, arguments, 2).map(|name| format!("{name}_Result")),
                    "FIELD" if depth < LONGEST => {
                        let whole = self.type_of(forms, at, *arguments.first()?, depth + 1)?;
                        match self.part(form, whole, arguments.get(1..)?).ok()? {
                            MessagePart::Message(name) => Some(name),
                            _ => None,
                        }
                    }
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns the part of a message at a path.
    ///
    /// # Errors
    /// The step to a field that there is not, and the type that has none.
    fn part(&self, form: &CoreForm, whole: String, path: &[NodeId]) -> Result<MessagePart, (NodeId, String)> {
        let mut part = MessagePart::Message(whole);
        for step in path {
            let keyword = form.symbol(*step).filter(|symbol| symbol.is_keyword());
            part = match (part, keyword) {
                (MessagePart::Message(name), Some(keyword)) => {
                    let Some(fields) = self.fields(&name) else { return Ok(MessagePart::Other) };
                    match fields.iter().find(|field| field.keyword == keyword.name()) {
                        Some(field) => MessagePart::of(field),
                        None => return Err((*step, name)),
                    }
                }
                // An index.
                (MessagePart::Array(Some(name)), None) => MessagePart::Message(name),
                _ => return Ok(MessagePart::Other),
            };
        }
        Ok(part)
    }
}

fn is_of_module(symbol: &Symbol) -> bool {
    symbol.package().is_some_and(|package| &**package == PACKAGE)
}

fn starts_part(rest: &str) -> bool {
    rest.starts_with('_')
}

/// Returns the constant text of an argument.
fn text<'f>(form: &'f CoreForm, arguments: &[NodeId], index: usize) -> Option<&'f str> {
    match form.kind(*arguments.get(index)?) {
        NodeKind::Constant(datum) => match datum.kind() {
            DatumKind::String(text) => Some(text),
            _ => None,
        },
        _ => None,
    }
}

/// Notes the parameter of a function that is called with messages.
fn note_parameter(
    form: &CoreForm,
    function: Option<&NodeId>,
    name: &str,
    part: &str,
    parameters: &mut FxHashMap<VarId, String>,
) {
    if let Some(NodeKind::Lambda(lambda)) = function.map(|function| form.kind(*function))
        && let Some(parameter) = form.core.lambdas[lambda.index()].required.first()
        && !form.core.variables[parameter.variable.index()].is_assigned
    {
        parameters.insert(parameter.variable, format!("{name}{part}"));
    }
}

impl TypeWalk<'_> {
    /// Compares the fields in a call of the module, and their values, whose types are `types`, with the type
    /// of their message.
    pub(super) fn check_message(
        &mut self,
        symbol: &Symbol,
        arguments: &[NodeId],
        types: &[TypeSet],
        known: &KnownFacts,
    ) {
        if self.found.is_none() || self.guards + self.message_guards > 0 || !is_of_module(symbol) {
            return;
        }
        let Some(messages) = self.messages.take() else { return };
        let (form, at) = (self.core_form(), self.at);
        let part_of = |part: &str| text(form, arguments, 2).map(|name| format!("{name}{part}"));
        let checked = match symbol.name() {
            "MESSAGE" => text(form, arguments, 0).map(|name| (name.to_owned(), 1..arguments.len())),
            "CALL-SERVICE" => part_of("_Request").map(|name| (name, 3..arguments.len())),
            "PUBLISH" => arguments
                .first()
                .and_then(|publisher| messages.type_of_maker(self.forms, at, *publisher, "ADVERTISE"))
                .map(|name| (name, 1..arguments.len())),
            "DO-ACTION" => {
                let is_goal = |node: &NodeId| form.symbol(*node).is_some_and(|key| key.name() == "GOAL");
                let goal = arguments.iter().skip(3).step_by(2).position(is_goal).map(|index| 4 + 2 * index);
                part_of("_Goal").zip(goal).map(|(name, goal)| (name, goal..goal + 1))
            }
            _ => None,
        };
        let mut faults = Vec::new();
        if let Some((name, fields)) = checked
            && let Some((fields, types)) = arguments.get(fields.clone()).zip(types.get(fields))
        {
            self.note_faults(&messages, &name, (fields, types), known, &mut faults);
        }
        if symbol.name() == "FIELD"
            && let Some(whole) = arguments.first()
            && let Some(name) = messages.type_of(self.forms, at, *whole, 0)
            && let Err((step, of)) = messages.part(form, name, &arguments[1..])
        {
            let keyword = form.symbol(step).map(|symbol| symbol.name().to_owned()).unwrap_or_default();
            let span = form.core.nodes[step.index()].span;
            faults.push(FieldFault { span, of, keyword, values: None });
        }
        for fault in &faults {
            self.warn_of_field(&messages, fault);
        }
        self.messages = Some(messages);
    }

    /// Returns the type of an item of a list that has been walked.
    fn type_of_item(&self, node: NodeId, known: &KnownFacts) -> TypeSet {
        match self.core_form().kind(node) {
            NodeKind::Constant(datum) => TypeSet::of(ValueType::of_datum(datum.kind())),
            NodeKind::Local(variable) => self.variable(*variable, known).types,
            _ => TypeSet::ANY,
        }
    }

    /// Notes keywords that a type has no fields for, and values that fields do not take.
    fn note_faults(
        &self,
        messages: &MessageTypes,
        of: &str,
        (fields, types): (&[NodeId], &[TypeSet]),
        known: &KnownFacts,
        faults: &mut Vec<FieldFault>,
    ) {
        let form = self.core_form();
        let span = |node: NodeId| form.core.nodes[node.index()].span;
        if let [whole] = fields {
            match form.kind(*whole) {
                NodeKind::Constant(datum) => note_faults_in(messages, of, datum, span(*whole), faults),
                NodeKind::Call(Callee::Builtin(Builtin::List), items) if items.len() > 1 => {
                    let types: Vec<TypeSet> =
                        items.iter().map(|item| self.type_of_item(*item, known)).collect();
                    self.note_faults(messages, of, (items, &types), known, faults);
                }
                _ => {}
            }
            return;
        }
        let Some(all) = messages.fields(of) else { return };
        for (pair, types) in fields.chunks(2).zip(types.chunks(2)) {
            let Some(keyword) = form.symbol(pair[0]).filter(|symbol| symbol.is_keyword()) else { return };
            let mut fault = |span, values| {
                faults.push(FieldFault { span, of: of.into(), keyword: keyword.name().into(), values });
            };
            match (all.iter().find(|field| field.keyword == keyword.name()), pair.get(1)) {
                (None, _) => fault(span(pair[0]), None),
                (Some(field), Some(value)) if !may_be(types[1], field.values) => {
                    fault(span(*value), Some((field.values, types[1].values)));
                }
                (Some(KnownField { part: Some(part), is_array: false, .. }), Some(_)) => {
                    self.note_faults(messages, part, (&pair[1..], &types[1..]), known, faults);
                }
                _ => {}
            }
        }
    }

    fn warn_of_field(&mut self, messages: &MessageTypes, fault: &FieldFault) {
        let FieldFault { span, of, keyword, values } = fault;
        let shown = |keyword: &str| format!("`:{}`", keyword.to_lowercase());
        let found = match values {
            Some((needed, given)) => {
                let (needed, given) = (needed.noun(), given.noun());
                let message =
                    format!("the field {} of `{of}` takes {needed}, and gets {given}", shown(keyword));
                Diagnostic::new("wrong-type", Severity::Warning, message, *span)
                    .label(format!("this is {given}"))
            }
            None => {
                let message = format!("`{of}` has no field {}", shown(keyword));
                let found = Diagnostic::new("unknown-keyword", Severity::Warning, message, *span);
                let fields = messages.fields(of).unwrap_or_default();
                let mut names: Vec<String> = fields.iter().map(|field| shown(&field.keyword)).collect();
                if names.len() > NAMED {
                    names.truncate(NAMED);
                    names.push("…".into());
                }
                match names.is_empty() {
                    true => found,
                    false => found.help(format!("its fields are {}", names.join(", "))),
                }
            }
        };
        if let Some(all) = &mut self.found {
            all.push(found);
        }
    }
}

/// Returns whether a value may be one of those.
fn may_be(types: TypeSet, values: ValueType) -> bool {
    types.is_empty() || !types.values.and(values).is_empty()
}

/// As [`TypeWalk::note_faults`], in a constant list at `span`.
fn note_faults_in(messages: &MessageTypes, of: &str, list: &Datum, span: Span, faults: &mut Vec<FieldFault>) {
    let (Some(known), Some(items)) = (messages.fields(of), list.as_list()) else { return };
    for pair in items.chunks(2) {
        let Some(keyword) = pair[0].as_symbol().filter(|symbol| symbol.is_keyword()) else { return };
        let mut fault = |datum: &Datum, values| {
            let own = datum.span();
            let span = if own == Span::default() { span } else { own };
            faults.push(FieldFault { span, of: of.into(), keyword: keyword.name().into(), values });
        };
        match (known.iter().find(|field| field.keyword == keyword.name()), pair.get(1)) {
            (None, _) => fault(pair[0], None),
            (Some(field), Some(value)) => {
                let given = ValueType::of_datum(value.kind());
                match &field.part {
                    _ if given.and(field.values).is_empty() => fault(value, Some((field.values, given))),
                    Some(part) if !field.is_array => note_faults_in(messages, part, value, span, faults),
                    _ => {}
                }
            }
            _ => {}
        }
    }
}
