//! The symbols and keywords that the machine itself uses.

use esl_bytecode::symbol::Symbol;

use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::value::Value;

macro_rules! home {
    (cl, $name:literal) => {
        Symbol::cl($name)
    };
    (esl, $name:literal) => {
        Symbol::esl($name)
    };
    (keyword, $name:literal) => {
        Symbol::keyword($name)
    };
}

macro_rules! define_known {
    ($( $field:ident = $home:ident $name:literal ; )*) => {
        /// Well-known symbols, made together with the machine.
        #[derive(Clone, Copy, Debug)]
        #[allow(missing_docs, reason = "each is the symbol of its name")]
        pub(crate) struct Known {
            $( pub(crate) $field: Value, )*
        }

        esl_heap::stored! { Known { $( $field ),* } }

        impl Known {
            /// Placeholder until [`Known::intern`] has been called.
            pub(super) const NONE: Known = Known { $( $field: Value::NIL, )* };

            /// Makes all of them.
            pub(super) fn intern(names: &mut Names, heap: &mut Heap) -> Result<Known, AllocError> {
                Ok(Known { $( $field: names.intern(heap, &home!($home, $name))?, )* })
            }

            /// Calls `visit` with each.
            pub(super) fn visit(&self, visit: &mut dyn FnMut(Value)) {
                $( visit(self.$field); )*
            }
        }
    };
}

define_known! {
    package = cl "*PACKAGE*";
    gensym_counter = cl "*GENSYM-COUNTER*";
    read_base = cl "*READ-BASE*";
    readtable = cl "*READTABLE*";
    features = cl "*FEATURES*";
    quote = cl "QUOTE";
    standard_input = cl "*STANDARD-INPUT*";
    standard_output = cl "*STANDARD-OUTPUT*";
    error_output = cl "*ERROR-OUTPUT*";
    setf = cl "SETF";
    setf_cell = esl "%SETF-CELL";
    lambda = cl "LAMBDA";
    structure_object = cl "STRUCTURE-OBJECT";
    raise = esl "%RAISE";
    failure = esl "FAILURE";
    history = esl "%HISTORY";
    reserve = esl "%RESERVE";
    expander_text = esl "%EXPANDER-TEXT";
    macro_usage = esl "%MACRO-USAGE";
    release_held = esl "%RELEASE-HELD";
    allow_other_keys = keyword "ALLOW-OTHER-KEYS";
    stack_exhausted = keyword "STACK-EXHAUSTED";
    heap_exhausted = keyword "HEAP-EXHAUSTED";
    budget_exhausted = keyword "BUDGET-EXHAUSTED";
    timeout = keyword "TIMEOUT";
    event = esl "EVENT";
    operation = esl "OPERATION";
    fail_as_host = esl "%FAIL-AS-HOST";
    input = esl "INPUT";
    room = keyword "ROOM";
    on_signal = esl "ON-SIGNAL";
    task = esl "TASK";
    restarts = esl "*RESTARTS*";
    recoveries = esl "*RECOVERIES*";
    suspension_procedures = esl "*%SUSPENSION-PROCEDURES*";
    watches = esl "*%WATCHES*";
    task_end = keyword "TASK-END";
    succeeded = keyword "SUCCEEDED";
    failed = keyword "FAILED";
    granted = keyword "GRANTED";
    pending = keyword "PENDING";
    completed = keyword "COMPLETED";
    cancelled = keyword "CANCELLED";
    aborted = keyword "ABORTED";
    running = keyword "RUNNING";
    waiting = keyword "WAITING";
    suspended = keyword "SUSPENDED";
    // Properties under which the machine keeps data on a symbol.
    accessor = esl "%ACCESSOR";
    resource = esl "%RESOURCE";
    // Results and options that are keywords.
    cases = keyword "CASES";
    functions = keyword "FUNCTIONS";
    recovery = keyword "RECOVERY";
    cleanup = keyword "CLEANUP";
    internal = keyword "INTERNAL";
    service = keyword "SERVICE";
    external = keyword "EXTERNAL";
    inherited = keyword "INHERITED";
    locked = keyword "LOCKED";
    test = keyword "TEST";
    unfinished = keyword "UNFINISHED";
}
