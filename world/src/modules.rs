//! The modules' texts, and how a machine finds them.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_vm::embed::HostFunction;
use esl_vm::vm::Vm;

use crate::data::text_of;

/// The modules, by name.
const MODULES: &[(&str, &str)] = &[
    #[cfg(feature = "http")]
    ("http", include_str!("../modules/http.esl")),
    ("json", include_str!("../modules/json.esl")),
    ("log", include_str!("../modules/log.esl")),
    #[cfg(feature = "mqtt")]
    ("mqtt", include_str!("../modules/mqtt.esl")),
    ("os", include_str!("../modules/os.esl")),
    ("process", include_str!("../modules/process.esl")),
    #[cfg(feature = "serial")]
    ("serial", include_str!("../modules/serial.esl")),
    ("sockets", include_str!("../modules/sockets.esl")),
    ("time", include_str!("../modules/time.esl")),
];

/// Returns the text of the module of this name, in any case.
pub fn module(name: &str) -> Option<&'static str> {
    MODULES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|&(_, text)| text)
}

/// Returns the names of the modules.
pub fn module_names() -> impl Iterator<Item = &'static str> {
    MODULES.iter().map(|&(name, _)| name)
}

/// Has `require` find the modules when the program runs.
pub(crate) fn install(machine: &mut Vm) {
    let text = |arguments: &[Datum]| {
        let text = arguments.first().and_then(text_of).and_then(module);
        Ok(text.map_or_else(|| Datum::nil(Span::default()), |text| Datum::string(text, Span::default())))
    };
    machine.add_host_function("%MODULE-TEXT", HostFunction::AtOnce(Box::new(text)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_begin_with_a_package_of_their_name() {
        for (name, text) in MODULES {
            assert!(text.contains(&format!("(defpackage :{name}\n")), "{name}");
            assert!(module(&name.to_uppercase()).is_some());
        }
        assert!(module("none").is_none());
    }
}
