//! The types that a program knows: definitions found by name, and the types resolved from them.
//!
//! Guarantees: a type is resolved once; a name cannot lead out of the folders that are searched.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::bundle;
use super::complete::nearest;
use super::definition::{ElementName, MessageDefinition, is_name};
use super::fault::{DefinitionProblem, TypeFault, TypeResult};
use super::message_type::{ActionType, Element, MAX_DEPTH, MessageField, MessageType, ServiceType};

/// Greatest number of bytes of a file with a definition.
const MAX_FILE: u64 = 1 << 20;

/// Types of messages, services and actions, by name. Clones share them.
///
/// Definitions are taken from the texts that the program gives, then from folders in their order, then from
/// those that come with ESL.
#[derive(Clone, Debug)]
pub struct Types(Arc<Mutex<KnownTypes>>);

#[derive(Debug, Default)]
struct KnownTypes {
    folders: Vec<PathBuf>,
    given: HashMap<String, String>,
    messages: HashMap<String, Arc<MessageType>>,
    services: HashMap<String, Arc<ServiceType>>,
    actions: HashMap<String, Arc<ActionType>>,
}

/// The kinds of definitions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DefinitionKind {
    Message,
    Service,
    Action,
}

impl DefinitionKind {
    /// Returns the name of the folder, which is the extension of the files too.
    fn folder(self) -> &'static str {
        match self {
            DefinitionKind::Message => "msg",
            DefinitionKind::Service => "srv",
            DefinitionKind::Action => "action",
        }
    }

    /// Returns the names of the messages that a definition consists of.
    fn parts(self) -> &'static [&'static str] {
        match self {
            DefinitionKind::Message => &[""],
            DefinitionKind::Service => &["_Request", "_Response"],
            DefinitionKind::Action => &["_Goal", "_Result", "_Feedback"],
        }
    }
}

/// The types whose resolution is under way, from the outermost to the innermost.
struct Chain<'a> {
    name: &'a str,
    outer: Option<&'a Chain<'a>>,
}

impl Chain<'_> {
    fn depth(&self) -> usize {
        1 + self.outer.map_or(0, Chain::depth)
    }

    fn contains(&self, name: &str) -> bool {
        self.name == name || self.outer.is_some_and(|outer| outer.contains(name))
    }
}

impl Types {
    /// Creates types of the definitions that come with ESL.
    pub fn bundled() -> Types {
        Types::with_folders(Vec::new())
    }

    /// Creates types whose definitions are also searched in folders: a workspace's `install` or `share`, a
    /// folder of packages, or a package.
    pub fn with_folders(folders: Vec<PathBuf>) -> Types {
        Types(Arc::new(Mutex::new(KnownTypes { folders, ..KnownTypes::default() })))
    }

    fn known(&self) -> MutexGuard<'_, KnownTypes> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Searches a folder before the others.
    pub fn add_folder(&self, folder: PathBuf) {
        let mut known = self.known();
        known.folders.insert(0, folder);
        known.forget();
    }

    /// Defines a type by the text of its definition. Behind it there may be the definitions of the types that
    /// it names, each after a line of `=` and a line `MSG: package/Name`, as recordings have them.
    ///
    /// # Errors
    /// A name or a text that is wrong.
    pub fn define(&self, name: &str, text: &str) -> TypeResult<()> {
        let mut given = Vec::new();
        for (index, (part_name, part)) in joined_definitions(name, text).into_iter().enumerate() {
            let kind = if index == 0 { kind_of(&part_name) } else { DefinitionKind::Message };
            let full = full_name(&part_name, kind)?;
            parse_parts(&full, kind, part)?;
            given.push((full, part.to_owned()));
        }
        let mut known = self.known();
        known.given.extend(given);
        known.forget();
        Ok(())
    }

    /// Returns the type of messages of a name: `package/msg/Name`, `package/Name`, or a part of a service or
    /// an action, as `package/srv/Name_Request` and `package/action/Name_FeedbackMessage`.
    ///
    /// # Errors
    /// There is none, or a definition that it depends on is wrong.
    pub fn message(&self, name: &str) -> TypeResult<Arc<MessageType>> {
        let mut known = self.known();
        let kind = kind_of(name);
        let full = full_name(name, kind)?;
        if kind == DefinitionKind::Message {
            return known.message(&full, None, None);
        }
        known.part(&full, kind)
    }

    /// Returns the type of services of a name: `package/srv/Name`, `package/Name`, or one of those that an
    /// action consists of, `package/action/Name_SendGoal` and `package/action/Name_GetResult`.
    ///
    /// # Errors
    /// As for messages.
    pub fn service(&self, name: &str) -> TypeResult<Arc<ServiceType>> {
        let mut known = self.known();
        if kind_of(name) != DefinitionKind::Action {
            return known.service(&full_name(name, DefinitionKind::Service)?);
        }
        let full = full_name(name, DefinitionKind::Action)?;
        if let Some(whole) = full.strip_suffix("_SendGoal") {
            return Ok(known.action(whole)?.send_goal.clone());
        }
        if let Some(whole) = full.strip_suffix("_GetResult") {
            return Ok(known.action(whole)?.get_result.clone());
        }
        Err(TypeFault::Unknown { name: full, nearest: None, used_by: None })
    }

    /// Returns the type of actions of a name, `package/action/Name` or `package/Name`.
    ///
    /// # Errors
    /// As for messages.
    pub fn action(&self, name: &str) -> TypeResult<Arc<ActionType>> {
        self.known().action(&full_name(name, DefinitionKind::Action)?)
    }

    /// Returns the text of the definition of a type.
    ///
    /// # Errors
    /// There is none.
    pub fn text(&self, name: &str) -> TypeResult<String> {
        let kind = kind_of(name);
        let full = full_name(name, kind)?;
        let known = self.known();
        known.text(&full, kind)?.ok_or_else(|| known.unknown(&full, kind, None))
    }

    /// Returns the names of the types that come with ESL or that texts have defined, in their order.
    pub fn names(&self) -> Vec<String> {
        let known = self.known();
        let mut names: Vec<String> = bundle::definitions().keys().map(|&name| name.to_owned()).collect();
        names.extend(known.given.keys().cloned());
        names.sort();
        names.dedup();
        names
    }
}

/// Returns the kind that a full name denotes; a message, if it is not a full name.
fn kind_of(name: &str) -> DefinitionKind {
    match name.split('/').nth(1) {
        Some("srv") => DefinitionKind::Service,
        Some("action") => DefinitionKind::Action,
        _ => DefinitionKind::Message,
    }
}

/// Returns the full name of a type, whose parts are names: it has neither `..` nor separators of paths.
fn full_name(name: &str, kind: DefinitionKind) -> TypeResult<String> {
    let parts: Vec<&str> = name.split('/').collect();
    let wrong = || TypeFault::Name { name: name.to_owned(), kind: kind.folder() };
    if !parts.iter().all(|part| is_name(part)) {
        return Err(wrong());
    }
    match parts[..] {
        [package, base] => Ok(format!("{package}/{}/{base}", kind.folder())),
        [_, folder, _] if folder == kind.folder() => Ok(name.to_owned()),
        _ => Err(wrong()),
    }
}

/// Returns the definitions in a text, with their names.
fn joined_definitions<'a>(name: &str, text: &'a str) -> Vec<(String, &'a str)> {
    let mut definitions = Vec::new();
    let (mut name, mut start, mut place) = (name.to_owned(), 0, 0);
    let mut lines = text.split_inclusive('\n').peekable();
    while let Some(line) = lines.next() {
        let end = place + line.len();
        let is_separator = line.trim_end().len() >= 20 && line.trim_end().bytes().all(|b| b == b'=');
        let next = lines.peek().and_then(|next| next.trim().strip_prefix("MSG:"));
        if let Some(next) = next.filter(|_| is_separator) {
            definitions.push((std::mem::replace(&mut name, next.trim().to_owned()), &text[start..place]));
            start = end + lines.next().map_or(0, str::len);
            place = start;
        } else {
            place = end;
        }
    }
    definitions.push((name, &text[start..]));
    definitions
}

/// Returns the contents of the messages of a definition.
fn parse_parts(name: &str, kind: DefinitionKind, text: &str) -> TypeResult<Vec<MessageDefinition>> {
    let wrong = |(line, problem)| TypeFault::Definition { name: name.to_owned(), line, problem };
    if kind == DefinitionKind::Message {
        return Ok(vec![MessageDefinition::parse(text, 0).map_err(wrong)?]);
    }
    let lines: Vec<&str> = text.lines().collect();
    let parts: Vec<&[&str]> = lines.split(|line| line.trim() == "---").collect();
    let expected = kind.parts().len();
    if parts.len() != expected {
        return Err(wrong((lines.len(), DefinitionProblem::Parts { expected, given: parts.len() })));
    }
    let mut first = 0;
    let mut definitions = Vec::new();
    for part in parts {
        definitions.push(MessageDefinition::parse(&part.join("\n"), first).map_err(wrong)?);
        first += part.len() + 1;
    }
    Ok(definitions)
}

impl KnownTypes {
    /// Forgets resolved types: a new definition may be one of theirs. Programs keep those that they have.
    fn forget(&mut self) {
        self.messages.clear();
        self.services.clear();
        self.actions.clear();
    }

    /// Returns the message that is a part of a service or an action, by its full name.
    fn part(&mut self, full: &str, kind: DefinitionKind) -> TypeResult<Arc<MessageType>> {
        let unknown = || TypeFault::Unknown { name: full.to_owned(), nearest: None, used_by: None };
        if kind == DefinitionKind::Service {
            if let Some(whole) = full.strip_suffix("_Request") {
                return Ok(self.service(whole)?.request.clone());
            }
            let whole = full.strip_suffix("_Response").ok_or_else(unknown)?;
            return Ok(self.service(whole)?.response.clone());
        }
        let part_of = |suffix: &str, action: &ActionType| {
            let part = match suffix {
                "Goal" => &action.goal,
                "Result" => &action.result,
                "Feedback" => &action.feedback,
                "FeedbackMessage" => &action.feedback_message,
                "SendGoal_Request" => &action.send_goal.request,
                "SendGoal_Response" => &action.send_goal.response,
                "GetResult_Request" => &action.get_result.request,
                "GetResult_Response" => &action.get_result.response,
                _ => return None,
            };
            Some(part.clone())
        };
        // The name of an action may contain `_`.
        let base = full.rfind('/').unwrap_or(0);
        for (place, _) in full.match_indices('_').filter(|(place, _)| *place > base) {
            match self.action(&full[..place]) {
                Ok(action) => return part_of(&full[place + 1..], &action).ok_or_else(unknown),
                Err(TypeFault::Unknown { .. }) => {}
                Err(fault) => return Err(fault),
            }
        }
        Err(unknown())
    }

    /// Returns the text of a definition, wherever it is found first.
    fn text(&self, full: &str, kind: DefinitionKind) -> TypeResult<Option<String>> {
        if let Some(text) = self.given.get(full) {
            return Ok(Some(text.clone()));
        }
        for folder in &self.folders {
            if let Some(text) = text_in(folder, full, kind)? {
                return Ok(Some(text));
            }
        }
        Ok(bundle::definitions().get(full).map(|&text| text.to_owned()))
    }

    fn unknown(&self, full: &str, kind: DefinitionKind, used_by: Option<(String, usize)>) -> TypeFault {
        let of_kind = |name: &&str| kind_of(name) == kind;
        let bundled = bundle::definitions().keys().copied();
        let names = bundled.chain(self.given.keys().map(String::as_str)).filter(of_kind);
        // Packages are long and alike: names are compared without them.
        let base = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
        let bases = nearest(&base(full), names.clone().map(base));
        let nearest =
            bases.and_then(|nearest| names.clone().find(|name| base(name) == nearest).map(str::to_owned));
        TypeFault::Unknown { name: full.to_owned(), nearest, used_by }
    }

    fn definitions(
        &self,
        full: &str,
        kind: DefinitionKind,
        used_by: Option<(String, usize)>,
    ) -> TypeResult<Vec<MessageDefinition>> {
        let text = self.text(full, kind)?.ok_or_else(|| self.unknown(full, kind, used_by))?;
        parse_parts(full, kind, &text)
    }

    fn message(
        &mut self,
        full: &str,
        used_by: Option<(String, usize)>,
        outer: Option<&Chain<'_>>,
    ) -> TypeResult<Arc<MessageType>> {
        if let Some(known) = self.messages.get(full) {
            return Ok(known.clone());
        }
        if let Some(outer) = outer {
            let fault = if outer.contains(full) {
                DefinitionProblem::Circular(full.to_owned())
            } else if outer.depth() > MAX_DEPTH {
                DefinitionProblem::Deep(MAX_DEPTH)
            } else {
                return self.new_message(full, used_by, Some(outer));
            };
            let (name, line) = used_by.unwrap_or_default();
            return Err(TypeFault::Definition { name, line, problem: fault });
        }
        self.new_message(full, used_by, None)
    }

    fn new_message(
        &mut self,
        full: &str,
        used_by: Option<(String, usize)>,
        outer: Option<&Chain<'_>>,
    ) -> TypeResult<Arc<MessageType>> {
        let mut definitions = self.definitions(full, DefinitionKind::Message, used_by)?;
        let chain = Chain { name: full, outer };
        let definition = definitions.pop().unwrap_or_default();
        let message = self.resolved(full, definition, &chain)?;
        self.messages.insert(full.to_owned(), message.clone());
        Ok(message)
    }

    /// Returns the type of a definition, whose own types are resolved first.
    fn resolved(
        &mut self,
        full: &str,
        definition: MessageDefinition,
        chain: &Chain<'_>,
    ) -> TypeResult<Arc<MessageType>> {
        let own_package = full.split('/').next().unwrap_or_default();
        let mut fields = Vec::new();
        for field in definition.fields {
            let element = match field.element {
                ElementName::Scalar(scalar) => Element::Scalar(scalar),
                ElementName::Text { is_wide, most } => Element::Text { is_wide, most },
                ElementName::Message { package, name } => {
                    let part = format!("{}/msg/{name}", package.as_deref().unwrap_or(own_package));
                    let used_by = (chain.name.to_owned(), field.line);
                    Element::Message(self.message(&part, Some(used_by), Some(chain))?)
                }
            };
            // The default of a fixed array has all elements, so its size comes first.
            let line = field.line;
            let wrong = |problem| TypeFault::Definition { name: chain.name.to_owned(), line, problem };
            MessageField::check_size(&element, field.extent).map_err(wrong)?;
            fields.push(MessageField::new(&field.name, element, field.extent, field.default));
        }
        let wrong = |problem| TypeFault::Definition { name: chain.name.to_owned(), line: 1, problem };
        MessageType::new(full.to_owned(), fields, definition.constants).map(Arc::new).map_err(wrong)
    }

    fn service(&mut self, full: &str) -> TypeResult<Arc<ServiceType>> {
        if let Some(known) = self.services.get(full) {
            return Ok(known.clone());
        }
        let definitions = self.definitions(full, DefinitionKind::Service, None)?;
        let [request, response] = self.parts(full, definitions)?;
        let service = self.new_service(full.to_owned(), request, response)?;
        self.services.insert(full.to_owned(), service.clone());
        Ok(service)
    }

    fn new_service(
        &mut self,
        name: String,
        request: Arc<MessageType>,
        response: Arc<MessageType>,
    ) -> TypeResult<Arc<ServiceType>> {
        let info = self.message("service_msgs/msg/ServiceEventInfo", None, None)?;
        Ok(Arc::new(ServiceType::new(name, request, response, &info)))
    }

    /// Returns the messages that the parts of a definition are.
    fn parts<const N: usize>(
        &mut self,
        full: &str,
        parts: Vec<MessageDefinition>,
    ) -> TypeResult<[Arc<MessageType>; N]> {
        let chain = Chain { name: full, outer: None };
        let suffixes = kind_of(full).parts();
        let mut messages = Vec::new();
        for (suffix, definition) in suffixes.iter().zip(parts) {
            messages.push(self.resolved(&format!("{full}{suffix}"), definition, &chain)?);
        }
        messages.try_into().map_err(|_| TypeFault::Unknown {
            name: full.to_owned(),
            nearest: None,
            used_by: None,
        })
    }

    fn action(&mut self, full: &str) -> TypeResult<Arc<ActionType>> {
        if let Some(known) = self.actions.get(full) {
            return Ok(known.clone());
        }
        let definitions = self.definitions(full, DefinitionKind::Action, None)?;
        let [goal, result, feedback] = self.parts(full, definitions)?;
        let wrong = |problem| TypeFault::Definition { name: full.to_owned(), line: 1, problem };
        let made = |suffix: &str, fields: Vec<MessageField>| {
            MessageType::new(format!("{full}{suffix}"), fields, Vec::new()).map(Arc::new).map_err(wrong)
        };
        let id = MessageField::part("goal_id", &self.message("unique_identifier_msgs/msg/UUID", None, None)?);
        let stamp = MessageField::part("stamp", &self.message("builtin_interfaces/msg/Time", None, None)?);
        let feedback_message =
            made("_FeedbackMessage", vec![id.clone(), MessageField::part("feedback", &feedback)])?;
        let send_goal_request =
            made("_SendGoal_Request", vec![id.clone(), MessageField::part("goal", &goal)])?;
        let send_goal_response = made("_SendGoal_Response", vec![MessageField::truth("accepted"), stamp])?;
        let get_result_request = made("_GetResult_Request", vec![id])?;
        let get_result_response = made(
            "_GetResult_Response",
            vec![MessageField::status("status"), MessageField::part("result", &result)],
        )?;
        let send_goal =
            self.new_service(format!("{full}_SendGoal"), send_goal_request, send_goal_response)?;
        let get_result =
            self.new_service(format!("{full}_GetResult"), get_result_request, get_result_response)?;
        let action = Arc::new(ActionType {
            name: full.to_owned(),
            goal,
            result,
            feedback,
            send_goal,
            get_result,
            cancel_goal: self.service("action_msgs/srv/CancelGoal")?,
            feedback_message,
            status: self.message("action_msgs/msg/GoalStatusArray", None, None)?,
        });
        self.actions.insert(full.to_owned(), action.clone());
        Ok(action)
    }
}

/// Returns the text of a definition in a folder.
fn text_in(folder: &Path, full: &str, kind: DefinitionKind) -> TypeResult<Option<String>> {
    let Some((package, rest)) = full.split_once('/') else { return Ok(None) };
    let file = format!("{rest}.{}", kind.folder());
    let itself = (folder.file_name() == Some(package.as_ref())).then(|| folder.join(&file));
    let shared = folder.join("share").join(package).join(&file);
    for path in [folder.join(package).join(&file), shared].into_iter().chain(itself) {
        let failed = |reason: String| TypeFault::File { path: path.display().to_string(), reason };
        match fs::metadata(&path) {
            Ok(data) if data.len() > MAX_FILE => {
                return Err(failed(format!("it has more than {MAX_FILE} bytes")));
            }
            Ok(data) if data.is_file() => {
                return fs::read_to_string(&path).map(Some).map_err(|error| failed(error.to_string()));
            }
            _ => {}
        }
    }
    Ok(None)
}
