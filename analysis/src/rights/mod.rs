//! The rights that a program needs: calls of functions that reach the outside, with the objects that these
//! calls name by constants, and the options of forms that open sessions of Zenoh.
//!
//! Each call in the text counts, whether or not it is ever made. A function that is passed as a value, or
//! whose object is computed, is listed as not known. Not here: rights of other modules for robots, and of
//! code that is made at run time.

mod constant;

use std::collections::BTreeSet;
use std::fmt::Write;

use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Callee, Core, NodeId, NodeKind};
use esl_compiler::diagnostic::Sources;

use crate::forms::symbols_inside;
use crate::library::function_positions;
use constant::{constant_name, constant_text, constant_texts, is_nil, keyword, program_of};

/// Object of a call: the positions of the arguments that name it.
#[derive(Clone, Copy)]
enum CallObject {
    /// A host and a port.
    Address(usize, usize),
    /// A URL.
    Url(usize),
    /// A path or a name.
    Text(usize),
    /// A pattern of paths, whose folder is read.
    Pattern(usize),
    /// A command: a list whose first element is the program.
    Command(usize),
    /// A path that is read, or written if the keyword `:direction` says so.
    File(usize),
    /// A path, the folder of which is meant.
    Folder(usize),
    /// A new name, which may be in the folder of the old one, and the old one.
    NewName(usize, usize),
    /// A path that gets `.bak` behind it, if the keyword `:if-exists` says so.
    Backup(usize),
}

/// Package and name of a function, the rights that it needs, and their object. A function that needs rights
/// to two objects has two rows.
type RightsRow = (&'static str, &'static str, &'static [&'static str], CallObject);

const ROWS: &[RightsRow] = &[
    ("SOCKETS", "CONNECT", &["net"], CallObject::Address(0, 1)),
    ("SOCKETS", "LISTEN", &["net"], CallObject::Address(0, 1)),
    ("SOCKETS", "UDP-OPEN", &["net"], CallObject::Address(0, 1)),
    ("SOCKETS", "UDP-SEND", &["net"], CallObject::Address(1, 2)),
    ("SOCKETS", "CONNECT-UNIX", &["read", "write"], CallObject::Text(0)),
    ("SOCKETS", "LISTEN-UNIX", &["read", "write"], CallObject::Text(0)),
    ("PROCESS", "RUN-PROGRAM", &["run"], CallObject::Command(0)),
    ("PROCESS", "LAUNCH-PROGRAM", &["run"], CallObject::Command(0)),
    ("HTTP", "REQUEST", &["net"], CallObject::Url(1)),
    ("HTTP", "GET", &["net"], CallObject::Url(0)),
    ("HTTP", "POST", &["net"], CallObject::Url(0)),
    ("HTTP", "PUT", &["net"], CallObject::Url(0)),
    ("HTTP", "DELETE", &["net"], CallObject::Url(0)),
    ("HTTP", "SERVE", &["net"], CallObject::Address(0, 1)),
    ("WS", "CALL-WITH-CONNECTION", &["net"], CallObject::Url(1)),
    ("MQTT", "CALL-WITH-CLIENT", &["net"], CallObject::Address(1, 2)),
    ("SERIAL", "OPEN-SERIAL-PORT", &["serial"], CallObject::Text(0)),
    ("OS", "GETENV", &["env"], CallObject::Text(0)),
    ("LOG", "TO-FILE", &["write"], CallObject::Text(0)),
    ("COMMON-LISP", "OPEN", &[], CallObject::File(0)),
    ("COMMON-LISP", "OPEN", &["write"], CallObject::Backup(0)),
    ("COMMON-LISP", "LOAD", &["read"], CallObject::Text(0)),
    ("COMMON-LISP", "PROBE-FILE", &["read"], CallObject::Text(0)),
    ("COMMON-LISP", "TRUENAME", &["read"], CallObject::Text(0)),
    ("COMMON-LISP", "DIRECTORY", &["read"], CallObject::Pattern(0)),
    ("COMMON-LISP", "FILE-WRITE-DATE", &["read"], CallObject::Text(0)),
    ("COMMON-LISP", "DELETE-FILE", &["write"], CallObject::Text(0)),
    ("COMMON-LISP", "RENAME-FILE", &["write"], CallObject::Text(0)),
    ("COMMON-LISP", "RENAME-FILE", &["write"], CallObject::NewName(1, 0)),
    ("COMMON-LISP", "ENSURE-DIRECTORIES-EXIST", &["write"], CallObject::Folder(0)),
    ("ESL", "WATCH-PATH", &["read"], CallObject::Text(0)),
];

/// Packages of modules whose rights are not known.
const OTHERS: [&str; 3] = ["ROS", "MAVLINK", "MCAP"];

/// A function that opens a session of Zenoh, whose options say where.
struct SessionRow {
    package: &'static str,
    name: &'static str,
    /// The form of which it is a part.
    form: &'static str,
    /// Position of the first option.
    options: usize,
    /// Whether the command says where if no option does.
    has_defaults: bool,
}

const SESSIONS: [SessionRow; 2] = [
    SessionRow {
        package: "ZENOH",
        name: "CALL-WITH-SESSION",
        form: "zenoh:with-session",
        options: 1,
        has_defaults: false,
    },
    SessionRow {
        package: "FLEET",
        name: "CALL-AS-AGENT",
        form: "fleet:join",
        options: 2,
        has_defaults: true,
    },
];

/// Address at which sessions of Zenoh find each other.
const SCOUTING: &str = "224.0.0.224:7446";
/// Name of a fleet that a program does not name.
const FLEET: &str = "esl";

/// The rights that a program needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeededRights {
    /// Flags of the commands, in order.
    pub flags: BTreeSet<String>,
    /// Texts about rights whose objects are not known.
    pub unknown: BTreeSet<String>,
}

impl NeededRights {
    /// Returns the rights as a file for `--rights`: a flag a line, and comments.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a text does not fail.
        self.flags.iter().for_each(|flag| _ = writeln!(text, "{flag}"));
        for line in &self.unknown {
            // The name of a file may have a line break, and what follows would be a flag.
            _ = writeln!(text, "# not known: {}", line.replace(char::is_control, " "));
        }
        text
    }
}

/// Returns whether an object can be the value of a flag, which is one line, and whose values have commas
/// between them.
fn is_value(object: &str) -> bool {
    !object.is_empty() && object.trim() == object && !object.contains(|c: char| c == ',' || c.is_control())
}

/// Returns the rights that a program needs, from its top-level forms and their sources.
pub fn needed_rights(cores: &[Core], sources: &Sources) -> NeededRights {
    let mut needed = NeededRights::default();
    for core in cores {
        for node in &core.nodes {
            let source = sources.name(node.span.source).unwrap_or_default();
            if source.starts_with(MODULE_SOURCES) {
                continue;
            }
            let place = || match sources.place(node.span) {
                Some(place) => format!("{source}:{}:{}", place.line, place.column),
                None => source.to_string(),
            };
            match &node.kind {
                NodeKind::Call(callee, arguments) => {
                    if let Some(symbol) = symbol_of(callee) {
                        add_call(core, &symbol, Some(arguments), &place, &mut needed);
                        for named in called_by_name(core, &symbol, arguments) {
                            add_call(core, &named, None, &place, &mut needed);
                        }
                    }
                }
                NodeKind::Apply(callee, _) => {
                    if let Some(symbol) = symbol_of(callee) {
                        add_call(core, &symbol, None, &place, &mut needed);
                    }
                }
                NodeKind::FunctionRef(symbol) => add_call(core, symbol, None, &place, &mut needed),
                NodeKind::BuiltinRef(builtin) => {
                    add_call(core, &builtin.symbol(), None, &place, &mut needed);
                }
                _ => {}
            }
        }
    }
    needed
}

/// Returns the symbols among the arguments of a call that are names of functions which it calls, such as
/// `'probe-file` in `(mapcar 'probe-file paths)`; those in a constant form for `eval`.
fn called_by_name(core: &Core, callee: &Symbol, arguments: &[NodeId]) -> Vec<Symbol> {
    let constant = |node: &NodeId| match &core.nodes[node.index()].kind {
        NodeKind::Constant(datum) => Some(datum),
        _ => None,
    };
    if callee.is_cl("EVAL") || callee.is_cl("COMPILE") {
        return arguments.iter().filter_map(constant).flat_map(symbols_inside).collect();
    }
    let is_library = callee.is_in("COMMON-LISP") || callee.is_in("ESL");
    let called = if is_library { function_positions(callee.name()) } else { &[] };
    let is_key = |node: &NodeId| {
        keyword(core, *node).is_some_and(|key| ["KEY", "TEST", "TEST-NOT"].contains(&key.name()))
    };
    let is_called =
        |position: usize| called.contains(&position) || position > 0 && is_key(&arguments[position - 1]);
    let symbol = |(position, node): (usize, &NodeId)| {
        constant(node)?.as_symbol().filter(|_| is_called(position)).cloned()
    };
    arguments.iter().enumerate().filter_map(symbol).collect()
}

fn symbol_of(callee: &Callee) -> Option<Symbol> {
    match callee {
        Callee::Global(symbol) => Some(symbol.clone()),
        Callee::Builtin(builtin) => Some(builtin.symbol()),
        Callee::Local(_) | Callee::Value(_) => None,
    }
}

/// Adds the rights of a call, or of a function whose arguments are not known.
fn add_call(
    core: &Core,
    symbol: &Symbol,
    arguments: Option<&Vec<NodeId>>,
    place: &dyn Fn() -> String,
    needed: &mut NeededRights,
) {
    if let Some(package) = OTHERS.iter().find(|package| symbol.is_in(package)) {
        let line = format!("rights of the module {}", package.to_lowercase());
        _ = needed.unknown.insert(line);
        return;
    }
    let session = SESSIONS.iter().find(|row| symbol.name() == row.name && symbol.is_in(row.package));
    if let Some(row) = session {
        add_session(core, row, arguments, place, needed);
        return;
    }
    for row in ROWS.iter().filter(|(package, name, ..)| symbol.name() == *name && symbol.is_in(package)) {
        add_row(core, row, arguments, place, needed);
    }
}

/// Adds the rights to one object of a call.
fn add_row(
    core: &Core,
    (package, name, rights, object): &RightsRow,
    arguments: Option<&Vec<NodeId>>,
    place: &dyn Fn() -> String,
    needed: &mut NeededRights,
) {
    let text = |position: usize| {
        let node = arguments?.get(position)?;
        constant_text(core, *node)
    };
    let (rights, found) = match *object {
        CallObject::Address(host, port) => {
            // An address of IPv6 has colons of its own.
            let bare = |host: &String| host.contains(':') && !host.starts_with('[');
            let host = text(host).map(|host| if bare(&host) { format!("[{host}]") } else { host });
            let address = host.map(|host| match text(port) {
                Some(port) => format!("{host}:{port}"),
                None => host,
            });
            (rights.to_vec(), address)
        }
        CallObject::Url(position) => (rights.to_vec(), text(position).and_then(|url| address_of(&url))),
        CallObject::Text(position) => (rights.to_vec(), text(position)),
        CallObject::Pattern(position) | CallObject::Folder(position) => {
            (rights.to_vec(), text(position).map(|path| folder_of(&path)))
        }
        CallObject::NewName(new, old) => {
            let beside = |name: String| match name.contains('/') {
                true => Some(name),
                false => text(old).map(|path| folder_of(&path) + &name),
            };
            (rights.to_vec(), text(new).and_then(beside))
        }
        CallObject::Backup(position) => match backup(core, arguments) {
            Backup::None => return,
            Backup::Perhaps => (rights.to_vec(), None),
            Backup::Made => (rights.to_vec(), text(position).map(|path| path + ".bak")),
        },
        CallObject::Command(position) => {
            let node = arguments.and_then(|arguments| arguments.get(position));
            (rights.to_vec(), node.and_then(|node| program_of(core, *node)))
        }
        CallObject::File(position) => (directions(core, arguments), text(position)),
    };
    for right in rights {
        match &found {
            Some(path) if matches!(right, "read" | "write") && is_below_here(path) => {}
            Some(object) if is_value(object) => {
                _ = needed.flags.insert(format!("--allow-{right}={object}"));
            }
            _ => {
                let function = match *package {
                    "COMMON-LISP" | "ESL" => name.to_lowercase(),
                    package => format!("{package}:{name}").to_lowercase(),
                };
                let line = format!("--allow-{right}, for {function} at {}", place());
                _ = needed.unknown.insert(line);
            }
        }
    }
}

/// Adds the rights of a call that opens a session of Zenoh.
fn add_session(
    core: &Core,
    row: &SessionRow,
    arguments: Option<&Vec<NodeId>>,
    place: &dyn Fn() -> String,
    needed: &mut NeededRights,
) {
    let options = arguments.map(|arguments| arguments.get(row.options..).unwrap_or_default());
    let option = |name: &str| {
        let (pairs, _) = options.unwrap_or_default().as_chunks::<2>();
        pairs
            .iter()
            .find(|[key, _]| keyword(core, *key).is_some_and(|key| key.name() == name))
            .map(|pair| pair[1])
    };
    let mut unknown = |right: &str| {
        let line = format!("--allow-{right}, for {} at {}", row.form, place());
        _ = needed.unknown.insert(line);
    };
    if options.is_none() {
        unknown("net");
        return;
    }
    let mut without_flag = Vec::new();
    let mut grant = |right: &'static str, object: &str| {
        if matches!(right, "read" | "write") && is_below_here(object) {
            return;
        }
        if is_value(object) {
            _ = needed.flags.insert(format!("--allow-{right}={object}"));
        } else {
            without_flag.push(right);
        }
    };
    for side in ["CONNECT", "LISTEN"] {
        let Some(node) = option(side) else { continue };
        let Some(endpoints) = constant_texts(core, node) else {
            unknown("net");
            continue;
        };
        for endpoint in endpoints {
            match endpoint.split_once('/') {
                Some(("unixsock-stream", path)) => {
                    grant("read", path);
                    grant("write", path);
                }
                Some((_, address)) => {
                    let end = address.find(['?', '#']).unwrap_or(address.len());
                    grant("net", &address[..end]);
                }
                None => {}
            }
        }
    }
    match option("CONFIG").map(|node| constant_text(core, node)) {
        None => {}
        // Its endpoints are not known.
        Some(path) => {
            path.iter().for_each(|path| grant("read", path));
            unknown("net");
        }
    }
    match option("SCOUTING") {
        None => {}
        Some(node) if is_nil(core, node) => {}
        Some(node) => grant("net", constant_text(core, node).as_deref().unwrap_or(SCOUTING)),
    }
    if let Some(node) = option("LEASES") {
        let urls = constant_texts(core, node);
        match urls.and_then(|urls| urls.iter().map(|url| address_of(url)).collect::<Option<Vec<_>>>()) {
            Some(addresses) => addresses.iter().for_each(|address| grant("net", address)),
            None => unknown("net"),
        }
    }
    let says_where =
        ["CONNECT", "LISTEN", "CONFIG", "SCOUTING"].into_iter().any(|name| option(name).is_some());
    if row.has_defaults && !says_where {
        match option("FLEET").map(|node| constant_name(core, node)) {
            None => grant("fleet", FLEET),
            Some(Some(fleet)) => grant("fleet", &fleet),
            Some(None) => unknown("fleet"),
        }
    }
    without_flag.into_iter().for_each(unknown);
}

/// Returns the rights for a call of `open`.
fn directions(core: &Core, arguments: Option<&Vec<NodeId>>) -> Vec<&'static str> {
    let Some(arguments) = arguments else { return vec!["read", "write"] };
    let keyword = |node: &NodeId| keyword(core, *node);
    let is_direction = |node: &NodeId| keyword(node).is_some_and(|key| key.name() == "DIRECTION");
    // One that is not there may be made.
    let is_creation = |node: &NodeId| keyword(node).is_some_and(|key| key.name() == "IF-DOES-NOT-EXIST");
    let makes = arguments.iter().position(is_creation).is_some_and(|position| {
        let answer = arguments.get(position + 1);
        !answer
            .is_some_and(|node| is_nil(core, *node) || keyword(node).is_some_and(|key| key.name() == "ERROR"))
    });
    let read = || if makes { vec!["read", "write"] } else { vec!["read"] };
    let Some(position) = arguments.iter().position(is_direction) else { return read() };
    let direction = arguments.get(position + 1).and_then(keyword);
    match direction.as_ref().map(Symbol::name) {
        Some("INPUT" | "PROBE") => read(),
        Some("OUTPUT") => vec!["write"],
        _ => vec!["read", "write"],
    }
}

/// Whether a call of `open` keeps the old file under another name.
enum Backup {
    None,
    Perhaps,
    Made,
}

fn backup(core: &Core, arguments: Option<&Vec<NodeId>>) -> Backup {
    let Some(arguments) = arguments else { return Backup::Perhaps };
    let is_answer = |node: &NodeId| keyword(core, *node).is_some_and(|key| key.name() == "IF-EXISTS");
    let Some(position) = arguments.iter().position(is_answer) else { return Backup::None };
    let answer = arguments.get(position + 1);
    match answer.and_then(|node| keyword(core, *node)).as_ref().map(Symbol::name) {
        _ if !directions(core, Some(arguments)).contains(&"write") => Backup::None,
        Some("RENAME" | "RENAME-AND-DELETE") => Backup::Made,
        Some(_) => Backup::None,
        None if answer.is_some_and(|node| is_nil(core, *node)) => Backup::None,
        None => Backup::Perhaps,
    }
}

/// Returns host and port of a URL.
fn address_of(url: &str) -> Option<String> {
    let (scheme, rest) = url.split_once("://")?;
    let end = rest.find(['/', '?', '#']).unwrap_or(rest.len());
    let host = rest[..end].rsplit('@').next()?;
    let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let port = if matches!(scheme, "https" | "wss") { 443 } else { 80 };
    Some(if has_port { host.to_string() } else { format!("{host}:{port}") })
}

/// Returns the folder of a pattern of paths, which is what is read.
fn folder_of(pattern: &str) -> String {
    pattern.rfind('/').map_or(String::new(), |end| pattern[..=end].to_string())
}

/// Returns whether a path is below the folder in which the program is started, which needs no right.
fn is_below_here(path: &str) -> bool {
    !path.starts_with(['/', '~']) && !path.split('/').any(|part| part == "..")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_and_paths_are_understood() {
        assert_eq!(address_of("http://lab/x?y").as_deref(), Some("lab:80"));
        assert_eq!(address_of("wss://u:p@lab:8443/x").as_deref(), Some("lab:8443"));
        assert_eq!(address_of("https://lab").as_deref(), Some("lab:443"));
        assert_eq!(address_of("lab"), None);
        assert_eq!(folder_of("/log/*.txt"), "/log/");
        assert!(is_value("/a b#c") && !["", " a", "a,b", "a\n--allow-all"].into_iter().any(is_value));
        assert!(is_below_here("log/today.txt") && !is_below_here("../x") && !is_below_here("/etc/x"));
    }
}
