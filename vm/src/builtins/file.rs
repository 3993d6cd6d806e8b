//! Files as wholes: folders, names, dates.

use esl_host::{FileAnswer, FileRequest, Host, HostError, Right};

use crate::builtins::expect::exactly;
use crate::builtins::outside::UNIX_EPOCH;
use crate::builtins::rights::demand;
use crate::builtins::stream::file_error;
use crate::builtins::symbol::text_of;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

/// Returns the path that `v` is, and the one that was permitted in its place.
fn permitted(vm: &mut Vm, v: Value, right: Right) -> Result<(String, String), Exit> {
    let Some(path) = text_of(&vm.heap, v) else { return vm.exchange.type_error(v, "STRING") };
    let permitted = demand(vm, right, &path)?;
    Ok((path, permitted))
}

/// Returns what comes of a request about the file `path`, which was to be `what`.
fn ask(vm: &mut Vm, what: &str, path: &str, request: FileRequest<'_>) -> Result<FileAnswer, Exit> {
    match vm.outside.host.request_of_files(request) {
        Ok(answer) => Ok(answer),
        Err(error) => file_error(&mut vm.exchange, what, path, &error),
    }
}

/// `(%list-folder path)`
pub(super) fn list_folder(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (path, permitted) = permitted(vm, arguments[0], Right::Read)?;
    let FileAnswer::Names(names) = ask(vm, "listed", &path, FileRequest::List(&permitted))? else {
        return Ok(Value::NIL);
    };
    vm.exchange.charge(names.len());
    let mut strings = Vec::new();
    for name in names {
        strings.push(vm.heap.alloc_str(&name)?);
    }
    Ok(vm.heap.list(&strings)?)
}

/// `(%true-name path)`
pub(super) fn true_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (path, permitted) = permitted(vm, arguments[0], Right::Read)?;
    match vm.outside.host.request_of_files(FileRequest::TrueName(&permitted)) {
        Ok(FileAnswer::Names(names)) => match names.first() {
            Some(name) => Ok(vm.heap.alloc_str(name)?),
            None => Ok(Value::NIL),
        },
        Ok(_) | Err(HostError::NotFound) => Ok(Value::NIL),
        Err(error) => file_error(&mut vm.exchange, "probed", &path, &error),
    }
}

/// `(%rename-file path new-path)`
pub(super) fn rename_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [from, to] = exactly(arguments);
    let (path, from) = permitted(vm, from, Right::Write)?;
    let (_, to) = permitted(vm, to, Right::Write)?;
    ask(vm, "renamed", &path, FileRequest::Rename(&from, &to))?;
    Ok(Value::T)
}

/// `(file-write-date path)`
pub(super) fn file_write_date(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (path, permitted) = permitted(vm, arguments[0], Right::Read)?;
    match ask(vm, "inspected", &path, FileRequest::Date(&permitted))? {
        FileAnswer::Date(seconds) => {
            Ok(Value::fixnum(seconds.saturating_add(UNIX_EPOCH)).unwrap_or(Value::NIL))
        }
        _ => Ok(Value::NIL),
    }
}

/// `(%make-folders path)`
pub(super) fn make_folders(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (path, permitted) = permitted(vm, arguments[0], Right::Write)?;
    let answer = ask(vm, "made", &path, FileRequest::MakeFolders(&permitted))?;
    Ok(Value::boolean(answer == FileAnswer::Done(true)))
}
