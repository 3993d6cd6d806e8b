//! The table of what SLIME asks for.

use crate::secrets::OperatorRole::{self, Command, Observe, Patch};

/// How a request of SLIME is answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SlimeAnswer {
    /// By the names that it gives, which are those of parts that SLIME wants loaded: they are there.
    Names,
    /// By nothing: it asks for something that is done anyway, or need not be.
    Nothing,
    /// By something that is not known.
    Unknown,
    /// By the name of the folder in which the machine runs.
    Folder,
    /// By the table of tasks.
    Tasks,
    /// Has the task in a row of that table aborted.
    AbortTask,
    /// Has the tasks in several rows aborted.
    AbortTasks,
    /// Calls the function with the task in a row of that table.
    OfTask(&'static str),
    /// By the value of this function of the library.
    Call(&'static str),
    /// By the value of this function, which evaluates something of the operator's: its failures are debugged.
    Evaluate(&'static str),
}

/// A request of SLIME.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlimeRequest {
    /// Its name, in lower case.
    pub(super) name: &'static str,
    /// The role that it needs.
    pub(super) role: OperatorRole,
    /// How it is answered.
    pub(super) answer: SlimeAnswer,
}

const fn row(name: &'static str, role: OperatorRole, answer: SlimeAnswer) -> SlimeRequest {
    SlimeRequest { name, role, answer }
}

use SlimeAnswer::{AbortTask, AbortTasks, Call, Evaluate, Folder, Names, Nothing, OfTask, Tasks, Unknown};

/// All requests.
pub(super) const REQUESTS: &[SlimeRequest] = &[
    // The session.
    row("swank:swank-require", Observe, Names),
    row("swank:init-presentations", Observe, Nothing),
    row("swank:buffer-first-change", Observe, Nothing),
    row("swank:update-indentation-information", Observe, Nothing),
    row("swank-repl:redirect-trace-output", Observe, Nothing),
    row("swank:clear-repl-results", Observe, Nothing),
    row("swank:fuzzy-completion-selected", Observe, Nothing),
    row("swank:default-directory", Observe, Folder),
    row("swank:xref", Observe, Unknown),
    row("swank:xrefs", Observe, Nothing),
    row("swank-repl:create-repl", Patch, Call("%SLIME-CONNECT")),
    row("swank:set-package", Patch, Call("%SLIME-SET-PACKAGE")),
    row("swank:list-all-package-names", Patch, Call("%SLIME-PACKAGES")),
    // Evaluating and compiling.
    row("swank-repl:listener-eval", Patch, Evaluate("%SLIME-LISTEN")),
    row("swank-repl:clear-repl-variables", Patch, Call("%SLIME-CLEAR-VARIABLES")),
    row("swank:interactive-eval", Patch, Evaluate("%SLIME-EVALUATE")),
    row("swank:interactive-eval-region", Patch, Evaluate("%SLIME-EVALUATE")),
    row("swank:pprint-eval", Patch, Evaluate("%SLIME-PRINT")),
    row("swank:eval-and-grab-output", Patch, Evaluate("%SLIME-GRAB")),
    row("swank:re-evaluate-defvar", Patch, Evaluate("%SLIME-SET-ANEW")),
    row("swank:compile-string-for-emacs", Patch, Evaluate("%SLIME-COMPILE-TEXT")),
    row("swank:compile-file-for-emacs", Patch, Evaluate("%SLIME-COMPILE-FILE")),
    row("swank:load-file", Patch, Evaluate("%SLIME-LOAD")),
    row("swank:swank-macroexpand-1", Patch, Call("%SLIME-EXPAND-1")),
    row("swank:swank-expand-1", Patch, Call("%SLIME-EXPAND-1")),
    row("swank:swank-macroexpand", Patch, Call("%SLIME-EXPAND")),
    row("swank:swank-expand", Patch, Call("%SLIME-EXPAND")),
    // Names.
    row("swank:simple-completions", Patch, Call("%SLIME-COMPLETE")),
    row("swank:completions", Patch, Call("%SLIME-COMPLETE")),
    row("swank:fuzzy-completions", Patch, Call("%SLIME-COMPLETE-FUZZILY")),
    row("swank:completions-for-keyword", Patch, Call("%SLIME-COMPLETE-NOTHING")),
    row("swank:completions-for-character", Patch, Call("%SLIME-COMPLETE-NOTHING")),
    row("swank:operator-arglist", Patch, Call("%SLIME-PARAMETERS")),
    row("swank:autodoc", Patch, Call("%SLIME-AUTODOC")),
    row("swank:describe-symbol", Patch, Call("%SLIME-DESCRIBE")),
    row("swank:describe-function", Patch, Call("%SLIME-DESCRIBE")),
    row("swank:describe-definition-for-emacs", Patch, Call("%SLIME-DESCRIBE")),
    row("swank:documentation-symbol", Patch, Call("%SLIME-DOCUMENTATION")),
    row("swank:apropos-list-for-emacs", Patch, Call("%SLIME-APROPOS")),
    row("swank:find-definitions-for-emacs", Patch, Call("%SLIME-DEFINITIONS")),
    row("swank:undefine-function", Patch, Call("%SLIME-UNDEFINE")),
    row("swank:swank-toggle-trace", Patch, Call("%SLIME-TOGGLE-TRACE")),
    row("swank:untrace-all", Patch, Call("%SLIME-UNTRACE-ALL")),
    // Tasks.
    row("swank:list-threads", Observe, Tasks),
    row("swank:quit-thread-browser", Observe, Nothing),
    row("swank:kill-nth-thread", Command, AbortTask),
    // This is how SLIME's list of tasks asks for it, and nothing else may be asked in this way.
    row("cl:mapc", Command, AbortTasks),
    row("swank:debug-nth-thread", Patch, OfTask("%SLIME-DEBUG-TASK")),
    // Failures.
    row("swank:debugger-info-for-emacs", Patch, Call("%SLIME-DEBUGGER-INFO")),
    row("swank:backtrace", Patch, Call("%SLIME-FRAMES")),
    row("swank:frame-source-location", Patch, Call("%SLIME-FRAME-PLACE")),
    row("swank:frame-locals-and-catch-tags", Patch, Call("%SLIME-FRAME-VARIABLES")),
    row("swank:invoke-nth-restart-for-emacs", Patch, Call("%SLIME-RESTART")),
    row("swank:sldb-abort", Patch, Call("%SLIME-ABORT")),
    row("swank:throw-to-toplevel", Patch, Call("%SLIME-ABORT")),
    row("swank:sldb-continue", Patch, Call("%SLIME-CONTINUE")),
    row("swank:sldb-return-from-frame", Patch, Call("%SLIME-RETURN-FROM-FRAME")),
    row("swank:eval-string-in-frame", Patch, Evaluate("%SLIME-EVALUATE-IN-FRAME")),
    row("swank:pprint-eval-string-in-frame", Patch, Evaluate("%SLIME-PRINT-IN-FRAME")),
    // The inspector.
    row("swank:init-inspector", Patch, Evaluate("%SLIME-INSPECT")),
    row("swank:inspect-nth-part", Patch, Call("%SLIME-INSPECT-PART")),
    row("swank:inspector-pop", Patch, Call("%SLIME-INSPECT-BACK")),
    row("swank:inspector-next", Patch, Call("%SLIME-INSPECT-FORTH")),
    row("swank:inspector-reinspect", Patch, Call("%SLIME-INSPECT-ANEW")),
    row("swank:inspector-toggle-verbose", Patch, Call("%SLIME-INSPECT-ANEW")),
    row("swank:inspector-range", Patch, Call("%SLIME-INSPECT-RANGE")),
    row("swank:inspector-call-nth-action", Patch, Call("%SLIME-INSPECTOR-ACTION")),
    row("swank:inspector-eval", Patch, Evaluate("%SLIME-EVALUATE-INSPECTED")),
    row("swank:describe-inspectee", Patch, Call("%SLIME-DESCRIBE-INSPECTED")),
    row("swank:pprint-inspector-part", Patch, Call("%SLIME-PRINT-INSPECTED")),
    row("swank:quit-inspector", Patch, Call("%SLIME-END-INSPECTING")),
    row("swank:inspect-current-condition", Patch, Call("%SLIME-INSPECT-CONDITION")),
    row("swank:inspect-frame-var", Patch, Call("%SLIME-INSPECT-VARIABLE")),
    row("swank:inspect-in-frame", Patch, Evaluate("%SLIME-INSPECT-IN-FRAME")),
];

impl SlimeRequest {
    /// Returns the request of a name in lower case.
    pub(super) fn named(name: &str) -> Option<SlimeRequest> {
        REQUESTS.iter().find(|request| request.name == name).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_function_is_in_the_library() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../stdlib/operators");
        let text: String = ["slime", "slime-names", "slime-debugger", "slime-inspector"]
            .into_iter()
            .map(|file| std::fs::read_to_string(folder.join(format!("{file}.esl"))).expect("it is there"))
            .collect();
        let mut names = std::collections::BTreeSet::new();
        for request in REQUESTS {
            assert!(names.insert(request.name), "{} is there twice", request.name);
            if let Call(function) | Evaluate(function) | OfTask(function) = request.answer {
                assert!(text.contains(&format!("(defun {} (", function.to_lowercase())), "{function}");
            }
        }
    }
}
