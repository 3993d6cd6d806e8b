//! The text of a type together with those of all types that it names, as recordings have it.

use std::fmt::Write as _;

use super::fault::TypeResult;
use super::message_type::{Element, MessageField, MessageType};
use super::types::Types;

impl Types {
    /// Returns the text of the definition of a message, and behind it those of the types that it names, each
    /// after a line of `=` and a line `MSG: package/Name`: a schema `ros2msg` of MCAP.
    ///
    /// # Errors
    /// There is no such type, or it is a part of a service or an action, which has no text of its own.
    pub fn joined_text(&self, name: &str) -> TypeResult<String> {
        let message = self.message(name)?;
        let mut text = self.text(message.name())?;
        let mut parts = Vec::new();
        add_parts(&message, &mut parts);
        for part in parts {
            let (separator, name) = ("=".repeat(80), short(&part));
            _ = write!(text, "\n{separator}\nMSG: {name}\n{}", self.text(&part)?);
        }
        Ok(text)
    }
}

impl MessageType {
    /// As [`Types::joined_text`], of a type whose text is not at hand: without comments, constants and
    /// defaults.
    pub fn text_of_fields(&self) -> String {
        let mut text = fields_of(self);
        let mut names = Vec::new();
        add_texts(self, &mut names, &mut text);
        text
    }
}

/// Returns a name without its middle part, as texts have it: `std_msgs/Header`. Parts of actions and services
/// are messages there, too.
fn short(name: &str) -> String {
    let kinds = ["/msg/", "/srv/", "/action/"];
    kinds.iter().fold(name.to_owned(), |name, kind| name.replacen(kind, "/", 1))
}

fn fields_of(message: &MessageType) -> String {
    let line = |field: &MessageField| format!("{} {}\n", short(&field.type_text()), field.name);
    message.fields().iter().map(line).collect()
}

/// Adds the texts of the types of a message's parts, each once.
fn add_texts(message: &MessageType, names: &mut Vec<String>, text: &mut String) {
    for field in message.fields() {
        if let Element::Message(part) = &field.element
            && !names.iter().any(|name| name == part.name())
        {
            names.push(part.name().to_owned());
            let (separator, name) = ("=".repeat(80), short(part.name()));
            _ = write!(text, "\n{separator}\nMSG: {name}\n{}", fields_of(part));
            add_texts(part, names, text);
        }
    }
}

/// Adds the names of the types of a message's parts, each once.
fn add_parts(message: &MessageType, names: &mut Vec<String>) {
    for field in message.fields() {
        if let Element::Message(part) = &field.element
            && !names.iter().any(|name| name == part.name())
        {
            names.push(part.name().to_owned());
            add_parts(part, names);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joined_text_defines_the_type_with_its_hash() {
        let bundled = Types::bundled();
        for name in ["sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "std_msgs/msg/Empty"] {
            let text = bundled.joined_text(name).expect("it is bundled");
            let types = Types::bundled();
            types.define(name, &text).expect("it is well-formed");
            let (known, defined) = (bundled.message(name).expect("known"), types.message(name));
            assert_eq!(known.hash(), defined.expect("defined").hash(), "{name}");
            types.define(name, &known.text_of_fields()).expect("it is well-formed");
            assert_eq!(types.message(name).expect("defined").hash(), known.hash(), "{name}");
        }
        // A part of an action is a message of its own in a text.
        let name = "example_interfaces/action/Fibonacci_FeedbackMessage";
        let text = bundled.message(name).expect("it is bundled").text_of_fields();
        assert!(text.contains("\nexample_interfaces/Fibonacci_Feedback feedback\n"), "{text}");
        assert!(text.contains("\nMSG: example_interfaces/Fibonacci_Feedback\nint32[] sequence\n"), "{text}");
        let text = bundled.joined_text("std_msgs/Header").expect("it is bundled");
        assert!(text.contains("\nMSG: builtin_interfaces/Time\n"), "{text}");
    }
}
