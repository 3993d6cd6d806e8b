//! The variables of frames, with their values, for surveys and reports.
//!
//! Only what is in scope at the place of a frame is shown, as far as the compiler has left it there. Texts of
//! values are short, and there are not too many of them, whatever the program has.

use esl_host::FrameVariable;

use super::tasks::place_text;
use crate::describe::{describe, function_name};
use crate::heap::Kind;
use crate::interp::frames::Frame;
use crate::value::Value;
use crate::vm::Vm;

/// Variables of a frame that are shown.
const SHOWN: usize = 30;
/// Characters of a value that are shown.
const CHARACTERS: usize = 200;

/// Returns names and values of the variables of a frame. Of several with the same name it is the one that the
/// program means there.
pub(crate) fn variables_of(vm: &Vm, frame: &Frame<'_>) -> Vec<(String, Value)> {
    let mut found: Vec<(String, Value)> = Vec::new();
    let Some(code) = vm.heap.function_code(frame.function) else { return found };
    for (name, place) in vm.names.variables_at(&vm.heap, code, frame.place()) {
        let Some(value) = frame.value_at(&vm.heap, place) else { continue };
        found.retain(|(other, _)| *other != name);
        // The box belongs to the machine.
        let value = if vm.heap.is(value, Kind::Box) { vm.heap.slot_or_nil(value, 0) } else { value };
        found.push((name, value));
    }
    found
}

/// Returns the variables of a frame as they are shown.
pub(crate) fn variable_rows(vm: &Vm, frame: &Frame<'_>) -> Vec<FrameVariable> {
    let row = |(name, value): (String, Value)| {
        let mut value = describe(&vm.heap, value);
        if let Some((end, _)) = value.char_indices().nth(CHARACTERS) {
            value.truncate(end);
            value.push('…');
        }
        FrameVariable { name, value }
    };
    variables_of(vm, frame).into_iter().take(SHOWN).map(row).collect()
}

/// Returns the report of a failure with the variables of its frames below their lines. `frames` are those of
/// the task that has failed; some that the report names may be gone.
pub(crate) fn with_variables<'a>(vm: &Vm, report: &str, frames: impl Iterator<Item = Frame<'a>>) -> String {
    let frames: Vec<Frame<'a>> = frames.take(FRAMES).collect();
    let lines: Vec<&str> = report.lines().collect();
    let mut rows: Vec<Vec<FrameVariable>> = vec![Vec::new(); lines.len()];
    // The report names the reason for a cleanup after it, and so failures of other tasks; the failure of a
    // task as which this one fails stands before. Those frames are gone.
    let is_past = |line: &&str| line.starts_with("  while cleaning up after ") || line.starts_with("In ");
    let end = lines.iter().skip(1).position(is_past).map_or(lines.len(), |at| at + 1);
    let begin = lines[..end].iter().rposition(|line| line.starts_with("  in task ")).map_or(0, |at| at + 1);
    if lines[begin..end].iter().all(|line| *line != CUT_OFF) && frames.len() < FRAMES {
        // The missing frames are the innermost ones, so report and stack are compared from outside.
        let mut outer = frames.len();
        for (index, line) in lines[..end].iter().enumerate().skip(begin).rev() {
            if let Some(found) = frames[..outer].iter().rposition(|frame| is_line_of(vm, line, frame)) {
                rows[index] = variable_rows(vm, &frames[found]);
                outer = found;
            }
        }
    } else {
        let mut inner = 0;
        for (index, line) in lines[..end].iter().enumerate().skip(begin) {
            if let Some(found) = frames[inner..].iter().position(|frame| is_line_of(vm, line, frame)) {
                inner += found + 1;
                rows[index] = variable_rows(vm, &frames[inner - 1]);
            }
        }
    }
    let mut text = String::new();
    for (line, variables) in lines.iter().zip(rows) {
        text.push_str(line);
        text.push('\n');
        text.push_str(&FrameVariable::lines(&variables));
    }
    text
}

/// Frames of a task that is ended by a failure at which is looked.
const FRAMES: usize = 100;
/// Line in place of the outer frames of a report that is cut off.
const CUT_OFF: &str = "  …";

/// Returns what reports call the function of a frame; see `%backtrace`.
fn reported_name(vm: &Vm, frame: &Frame<'_>) -> String {
    let code = vm.heap.function_code(frame.function).and_then(|code| vm.heap.code(code));
    if code.is_some_and(|code| code.name.is_true()) {
        return function_name(&vm.heap, frame.function);
    }
    let header = vm.heap.header(frame.function);
    let is_top_level = header.is_some_and(|header| header.aux == crate::names::load::TOP_LEVEL);
    if is_top_level { "top level" } else { "(LAMBDA)" }.into()
}

/// Returns whether a line of a report tells of a frame: of its place, or of its function if that has none.
fn is_line_of(vm: &Vm, line: &str, frame: &Frame<'_>) -> bool {
    let Some(line) = line.strip_prefix("  in ") else { return false };
    match place_text(vm, frame) {
        Some(place) => line.rsplit_once(", ").is_some_and(|(_, other)| other == place),
        None => reported_name(vm, frame) == line,
    }
}
