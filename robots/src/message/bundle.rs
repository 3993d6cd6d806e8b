//! The definitions that come with ESL: the common interfaces of ROS 2, packed into one text by the build
//! step.

use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A line of [`MARK`] and the name of a type, then the lines of its definition, for each.
const BUNDLE: &str = include_str!(concat!(env!("OUT_DIR"), "/definitions.txt"));

/// The beginning of a line that names a type.
const MARK: &str = "=== ";

/// Returns the definitions, by name, as `std_msgs/msg/String`.
pub(super) fn definitions() -> &'static BTreeMap<&'static str, &'static str> {
    static DEFINITIONS: OnceLock<BTreeMap<&str, &str>> = OnceLock::new();
    DEFINITIONS.get_or_init(|| {
        let parts = BUNDLE.strip_prefix(MARK).into_iter().flat_map(|text| text.split("\n=== "));
        // A definition may be empty.
        parts.map(|part| part.split_once('\n').unwrap_or((part, ""))).collect()
    })
}
