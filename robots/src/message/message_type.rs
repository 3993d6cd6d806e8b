//! Types of messages, services and actions, resolved: all types that they name are known.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use hiroz_schema::TypeDescription;

use super::complete;
use super::definition::{FieldExtent, MessageConstant};
use super::describe;
use super::fault::DefinitionProblem;
use super::scalar::Scalar;

/// Greatest number of elements that the fixed arrays of a type have together, those of its parts included:
/// every message has all of them.
const MAX_FIXED: usize = 1 << 20;

/// Greatest number of levels in which types are nested.
pub(super) const MAX_DEPTH: usize = 64;

/// The type of an element of a field.
#[derive(Clone, Debug)]
pub enum Element {
    /// A number or a truth value.
    Scalar(Scalar),
    /// `string`, or `wstring`, with the greatest length in its code units.
    Text {
        /// Whether it is a `wstring`.
        is_wide: bool,
        /// Its greatest length.
        most: Option<usize>,
    },
    /// Another message.
    Message(Arc<MessageType>),
}

/// A field of a message.
#[derive(Clone, Debug)]
pub struct MessageField {
    /// Its name in the definition.
    pub name: String,
    /// Its name in programs, a keyword.
    pub keyword: Datum,
    /// The type of its elements.
    pub element: Element,
    /// The number of its elements.
    pub extent: FieldExtent,
    /// Its value where a program gives none.
    pub default: Datum,
}

/// A type of messages.
#[derive(Debug)]
pub struct MessageType {
    name: String,
    pub(super) fields: Vec<MessageField>,
    /// The keywords of the fields.
    pub(super) keywords: Arc<[Datum]>,
    pub(super) constants: Vec<MessageConstant>,
    /// Whether it is `builtin_interfaces/msg/Time` or `Duration`, for which a number of seconds may stand.
    pub(super) is_time: bool,
    /// Least number of bytes of a message, alignment apart; at least 1.
    pub(super) least_size: usize,
    /// Number of elements of the fixed arrays, those of the parts included.
    fixed: usize,
    depth: usize,
    defaults: Datum,
    own: TypeDescription,
    /// Descriptions of the types of the parts.
    referenced: BTreeMap<String, TypeDescription>,
    hash: String,
}

impl MessageField {
    /// Creates a field; without a default in the definition it has the default of its type.
    pub(super) fn new(
        name: &str,
        element: Element,
        extent: FieldExtent,
        default: Option<Datum>,
    ) -> MessageField {
        let default = default.unwrap_or_else(|| complete::default_of(&element, extent));
        MessageField { name: name.to_owned(), keyword: keyword(name), element, extent, default }
    }

    /// Creates a field that is a message.
    pub(super) fn part(name: &str, message: &Arc<MessageType>) -> MessageField {
        MessageField::new(name, Element::Message(message.clone()), FieldExtent::One, None)
    }

    /// Creates a field that is a truth value.
    pub(super) fn truth(name: &str) -> MessageField {
        MessageField::new(name, Element::Scalar(Scalar::Bool), FieldExtent::One, None)
    }

    /// Creates a field that is the status of a goal.
    pub(super) fn status(name: &str) -> MessageField {
        MessageField::new(name, Element::Scalar(Scalar::Int8), FieldExtent::One, None)
    }

    /// Checks that the default of a field can be made.
    ///
    /// # Errors
    /// It has too many elements.
    pub(super) fn check_size(element: &Element, extent: FieldExtent) -> Result<(), DefinitionProblem> {
        let each = if let Element::Message(message) = element { message.fixed } else { 1 };
        match extent {
            FieldExtent::Fixed(count) if count.saturating_mul(each) > MAX_FIXED => {
                Err(DefinitionProblem::Large(MAX_FIXED))
            }
            _ => Ok(()),
        }
    }

    /// Returns least number of bytes, number of elements of fixed arrays, and depth.
    fn measures(&self) -> (usize, usize, usize) {
        let (size, fixed, depth) = match &self.element {
            Element::Scalar(scalar) => (scalar.size(), 1, 0),
            Element::Text { .. } => (4, 1, 0),
            Element::Message(message) => (message.least_size, message.fixed, message.depth),
        };
        match self.extent {
            FieldExtent::One => (size, fixed, depth),
            FieldExtent::Fixed(count) => (size.saturating_mul(count), fixed.saturating_mul(count), depth),
            FieldExtent::Sequence(_) => (4, 1, depth),
        }
    }

    /// Returns the type as definitions write it.
    pub fn type_text(&self) -> String {
        let mut text = match &self.element {
            Element::Scalar(scalar) => scalar.name().to_owned(),
            Element::Text { is_wide, most } => {
                let name = if *is_wide { "wstring" } else { "string" };
                most.map_or(name.to_owned(), |most| format!("{name}<={most}"))
            }
            Element::Message(message) => message.name.clone(),
        };
        match self.extent {
            FieldExtent::One => {}
            FieldExtent::Fixed(count) => _ = write!(text, "[{count}]"),
            FieldExtent::Sequence(None) => text.push_str("[]"),
            FieldExtent::Sequence(Some(most)) => _ = write!(text, "[<={most}]"),
        }
        text
    }
}

impl MessageType {
    /// Creates a type.
    ///
    /// # Errors
    /// It is too large or too deep.
    pub(super) fn new(
        name: String,
        fields: Vec<MessageField>,
        constants: Vec<MessageConstant>,
    ) -> Result<MessageType, DefinitionProblem> {
        let (mut least_size, mut fixed, mut depth) = (0_usize, 0_usize, 0);
        for field in &fields {
            let (size, elements, levels) = field.measures();
            least_size = least_size.saturating_add(size);
            fixed = fixed.saturating_add(elements);
            depth = depth.max(levels + 1);
        }
        if fixed > MAX_FIXED {
            return Err(DefinitionProblem::Large(MAX_FIXED));
        }
        if depth > MAX_DEPTH {
            return Err(DefinitionProblem::Deep(MAX_DEPTH));
        }
        let own = describe::individual(&name, &fields);
        let mut referenced = BTreeMap::new();
        for field in &fields {
            if let Element::Message(part) = &field.element {
                referenced.extend(part.referenced.clone());
                referenced.insert(part.name.clone(), part.own.clone());
            }
        }
        let hash = describe::hash(&own, &referenced);
        let defaults = complete::plist(fields.iter().map(|field| (&field.keyword, field.default.clone())));
        let keywords = fields.iter().map(|field| field.keyword.clone()).collect();
        let is_time = matches!(&*name, "builtin_interfaces/msg/Time" | "builtin_interfaces/msg/Duration");
        let least_size = least_size.max(1);
        Ok(MessageType {
            name,
            fields,
            keywords,
            constants,
            is_time,
            least_size,
            fixed,
            depth,
            defaults,
            own,
            referenced,
            hash,
        })
    }

    /// Returns whether a number of seconds may stand for a message: it is a time or a duration.
    pub fn is_time(&self) -> bool {
        self.is_time
    }

    /// Returns the full name, as `std_msgs/msg/String`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the name of the DDS type, as `std_msgs::msg::dds_::String_`.
    pub fn dds_name(&self) -> String {
        dds_name(&self.name)
    }

    /// Returns the hash of the type, as `RIHS01_` and 64 digits.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// Returns the fields, in their order.
    pub fn fields(&self) -> &[MessageField] {
        &self.fields
    }

    /// Returns the constants, in their order.
    pub fn constants(&self) -> &[MessageConstant] {
        &self.constants
    }

    /// Returns the message whose fields all have their defaults.
    pub fn defaults(&self) -> Datum {
        self.defaults.clone()
    }

    /// Returns the descriptions of this type and of the types of its parts.
    pub(super) fn descriptions(&self) -> BTreeMap<String, TypeDescription> {
        let mut all = self.referenced.clone();
        all.insert(self.name.clone(), self.own.clone());
        all
    }

    /// Returns the type as data: a property list with `:name`, `:hash`, `:fields`, a list of (keyword type
    /// default), and `:constants`, a list of (keyword value).
    pub fn description(&self) -> Datum {
        let field = |field: &MessageField| {
            let type_text = Datum::string(&field.type_text(), Span::default());
            list([field.keyword.clone(), type_text, field.default.clone()])
        };
        let constant = |constant: &MessageConstant| list([keyword(&constant.name), constant.value.clone()]);
        complete::plist([
            (&keyword("name"), Datum::string(&self.name, Span::default())),
            (&keyword("hash"), Datum::string(&self.hash, Span::default())),
            (&keyword("fields"), list(self.fields.iter().map(field))),
            (&keyword("constants"), list(self.constants.iter().map(constant))),
        ])
    }
}

/// A type of services.
#[derive(Debug)]
pub struct ServiceType {
    name: String,
    hash: String,
    /// The message that a client sends.
    pub request: Arc<MessageType>,
    /// The message that the server answers.
    pub response: Arc<MessageType>,
}

impl ServiceType {
    /// Creates a type; `info` is `service_msgs/msg/ServiceEventInfo`, a part of the event of every service.
    pub(super) fn new(
        name: String,
        request: Arc<MessageType>,
        response: Arc<MessageType>,
        info: &MessageType,
    ) -> ServiceType {
        let hash = describe::service_hash(&name, &request, &response, info);
        ServiceType { name, hash, request, response }
    }

    /// Returns the full name, as `std_srvs/srv/Trigger`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the name of the DDS type, as `std_srvs::srv::dds_::Trigger_`.
    pub fn dds_name(&self) -> String {
        dds_name(&self.name)
    }

    /// Returns the hash of the type.
    pub fn hash(&self) -> &str {
        &self.hash
    }
}

/// A type of actions, with the services and messages that an action consists of.
#[derive(Debug)]
pub struct ActionType {
    pub(super) name: String,
    /// The goal that a client gives.
    pub goal: Arc<MessageType>,
    /// The result of a goal.
    pub result: Arc<MessageType>,
    /// The feedback on a goal.
    pub feedback: Arc<MessageType>,
    /// The service `NAME_SendGoal`.
    pub send_goal: Arc<ServiceType>,
    /// The service `NAME_GetResult`.
    pub get_result: Arc<ServiceType>,
    /// The service `action_msgs/srv/CancelGoal`.
    pub cancel_goal: Arc<ServiceType>,
    /// The message `NAME_FeedbackMessage`: the id of a goal, and its feedback.
    pub feedback_message: Arc<MessageType>,
    /// The message `action_msgs/msg/GoalStatusArray`.
    pub status: Arc<MessageType>,
}

impl ActionType {
    /// Returns the full name, as `example_interfaces/action/Fibonacci`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the name of the DDS type.
    pub fn dds_name(&self) -> String {
        dds_name(&self.name)
    }
}

fn dds_name(name: &str) -> String {
    match name.rsplit_once('/') {
        Some((scope, base)) => format!("{}::dds_::{base}_", scope.replace('/', "::")),
        None => format!("dds_::{name}_"),
    }
}

fn list<I>(items: I) -> Datum
where
    I: IntoIterator<Item = Datum>,
    I::IntoIter: DoubleEndedIterator,
{
    Datum::list(items, Span::default())
}

/// Returns the keyword for a name of a definition: `:FRAME-ID` for `frame_id`.
pub fn keyword(name: &str) -> Datum {
    Datum::symbol(Symbol::keyword(&name.replace('_', "-").to_ascii_uppercase()), Span::default())
}
