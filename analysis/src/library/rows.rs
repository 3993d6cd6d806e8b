//! The table of the library's functions with failures of their own, and lists of those that are special.

use crate::effect::mistake::{ARITHMETIC, CRITICAL, NAME, OF_CALLS, TYPE};

/// A function of the library.
pub(crate) struct LibraryRow {
    /// Causes with which it may fail by itself; `!` precedes names of condition types.
    pub(crate) causes: &'static [&'static str],
    /// Kinds of programming errors.
    pub(crate) mistakes: u8,
    /// Whether it calls functions that it is given, by name too.
    pub(crate) takes_functions: bool,
}

/// Functions with failures that are not programming errors.
const FAILING: &[(&str, &[&str])] = &[
    ("%CHECK-FAILED", &["!TYPE-ERROR"]),
    ("%FAIL-ALL", &[]),
    ("CHECKPOINT-WAIT", &["CHECKPOINT-UNREACHABLE"]),
    ("NEXT-BINDINGS", &["NO-MORE-BINDINGS"]),
    ("DELETE-FILE", &["!FILE-ERROR"]),
    ("DIRECTORY", &["!FILE-ERROR"]),
    ("ENSURE-DIRECTORIES-EXIST", &["!FILE-ERROR"]),
    ("FILE-WRITE-DATE", &["!FILE-ERROR"]),
    ("LOAD", &["!FILE-ERROR"]),
    ("OPEN", &["!FILE-ERROR"]),
    ("PROBE-FILE", &["!FILE-ERROR"]),
    ("RENAME-FILE", &["!FILE-ERROR"]),
    ("TRUENAME", &["!FILE-ERROR"]),
    ("READ", &["!END-OF-FILE", "!READER-ERROR"]),
    ("READ-FROM-STRING", &["!END-OF-FILE", "!READER-ERROR"]),
    ("READ-PRESERVING-WHITESPACE", &["!END-OF-FILE", "!READER-ERROR"]),
    ("READ-DELIMITED-LIST", &["!END-OF-FILE", "!READER-ERROR"]),
    ("YES-OR-NO-P", &["!END-OF-FILE"]),
    ("Y-OR-N-P", &["!END-OF-FILE"]),
];

/// Functions that call functions which they are given, also by their names.
const TAKING_FUNCTIONS: &[&str] = &[
    "APPLY",
    "FUNCALL",
    "MAPCAR",
    "MAPC",
    "MAPCAN",
    "MAPCON",
    "MAPL",
    "MAPLIST",
    "MAP",
    "MAP-INTO",
    "MAPHASH",
    "EVERY",
    "SOME",
    "NOTANY",
    "NOTEVERY",
    "REDUCE",
    "SORT",
    "STABLE-SORT",
    "MERGE",
    "FIND",
    "FIND-IF",
    "FIND-IF-NOT",
    "POSITION",
    "POSITION-IF",
    "POSITION-IF-NOT",
    "COUNT",
    "COUNT-IF",
    "COUNT-IF-NOT",
    "REMOVE",
    "REMOVE-IF",
    "REMOVE-IF-NOT",
    "DELETE",
    "DELETE-IF",
    "DELETE-IF-NOT",
    "REMOVE-DUPLICATES",
    "DELETE-DUPLICATES",
    "SUBSTITUTE",
    "SUBSTITUTE-IF",
    "SUBSTITUTE-IF-NOT",
    "NSUBSTITUTE",
    "NSUBSTITUTE-IF",
    "NSUBSTITUTE-IF-NOT",
    "MEMBER",
    "MEMBER-IF",
    "MEMBER-IF-NOT",
    "ASSOC",
    "ASSOC-IF",
    "ASSOC-IF-NOT",
    "RASSOC",
    "RASSOC-IF",
    "RASSOC-IF-NOT",
    "ADJOIN",
    "UNION",
    "NUNION",
    "INTERSECTION",
    "NINTERSECTION",
    "SET-DIFFERENCE",
    "NSET-DIFFERENCE",
    "SET-EXCLUSIVE-OR",
    "NSET-EXCLUSIVE-OR",
    "SUBSETP",
    "SUBST",
    "SUBST-IF",
    "SUBST-IF-NOT",
    "NSUBST",
    "NSUBST-IF",
    "NSUBST-IF-NOT",
    "SUBLIS",
    "NSUBLIS",
    "TREE-EQUAL",
    "SEARCH",
    "MISMATCH",
    "COMPLEMENT",
    "CALL-NEXT-METHOD",
    "%CALL-WITH-LIMIT",
    "%CALL-WITH-QUOTA",
    "%CALL-MAINTAINING",
    "%CALL-WITH-RESOURCES",
    "%CALL-WITH-FLEET-RESOURCES",
    "%CALL-WITH-QUERY-BINDINGS",
    "%CALL-GUARDED",
    "%SPAWN",
    "%SPAWN-NET",
    "%WHENEVER",
    "%WAIT-UNTIL",
    "%WAIT-UNTIL-CHANGED",
    "%WAIT-UNTIL-FOR",
    "%DERIVED-VALUE",
    "%MAP-LISTS",
    "%MAP-SEQUENCES",
];

/// Functions without failures.
const TOTAL: &[&str] = &[
    "ATOM",
    "CONS",
    "CONSP",
    "CURRENT-TASK",
    "EQ",
    "EQL",
    "EQUAL",
    "EQUALP",
    "IDENTITY",
    "INTEGERP",
    "KEYWORDP",
    "LIST",
    "LISTP",
    "MAKE-EVENT",
    "NOT",
    "NOW",
    "NULL",
    "NUMBERP",
    "STRINGP",
    "SYMBOLP",
    "TERPRI",
    "VALUES",
    "VECTOR",
    "VECTORP",
    "FUNCTIONP",
    "HASH-TABLE-P",
    "MAKE-HASH-TABLE",
    "PRINT",
    "PRINC",
    "PRIN1",
    "BOUNDP",
    "FBOUNDP",
    "%SET-FUNCTION",
    "%SET-FUNCTION-NAMED",
    "%SET-MACRO",
    "%PUT",
    "%SPAWN",
    "%SPAWN-NET",
    "%AWAIT-NET",
    "%END-NET",
    "%FAIL-FOR",
    "FAIL",
    "ERROR",
    "%FAIL-AS",
    "%FAIL-ALL",
    "%END-LIKE",
    "%TASK-VALUE",
    "%TASK-END",
    "%TELL-LOSSES",
    "%NEW-READS",
    "%WAIT-FOR-READS",
    "%RELEASE-FACTS",
    "%RELEASE-SOURCES",
    "%NOTED-VALUE",
    "%CALL-GUARDED",
    "%NOTE-CLEANUP",
    "%END-CRITICAL",
    "%DEFINE-CAUSE",
    "%DEFINE-PROPERTY",
    "%PROCLAIM-SPECIAL",
    "%PERFORM",
    "%BEGIN-MOCK",
    "%PROPERTY",
    "%MAKE-STRUCTURE",
    "%NOTE-RETRY",
    "GETHASH",
    "%PUTHASH",
    "%ENTER-MODULE",
    "%LEAVE-MODULE",
    "REQUIRE",
    "%PAUSE-BEFORE-RETRY",
    "%FIND-CLASS",
    "%CLASS-OF",
    "DB-QUERY",
    "%MAKE-SIGNALLED",
    "%FIND-ANSWERS",
    "%MAKE-CLASS",
    "%DEFINE-ACCESSOR",
    "EXPORT",
    "%DEFINE-TEST",
    "SIGNAL",
    "%DEADLINE",
    "%SLEEP-UNTIL",
    "%NEXT-TURN",
    "%ENSURE-GENERIC",
    "%ADD-METHOD",
    "TASK-STATUS",
    "%CHECK-REGISTERED",
    "%COMPILED-FOR",
];

/// Functions that divide, or compute another partial function.
const COMPUTING: &[&str] = &[
    "/",
    "MOD",
    "REM",
    "FLOOR",
    "CEILING",
    "TRUNCATE",
    "ROUND",
    "FFLOOR",
    "FCEILING",
    "FTRUNCATE",
    "FROUND",
    "EXPT",
    "LOG",
    "ATAN",
    "EXP",
    "SQRT",
    "*",
    "+",
    "-",
    "ASH",
    "GCD",
    "LCM",
    "RATIONALIZE",
    "FLOAT",
    "COERCE",
    "PARSE-FLOAT",
];

/// Functions of streams, which call the handlers of a stream that a program has made.
const OF_STREAMS: &[&str] = &[
    "READ-LINE",
    "READ-CHAR",
    "READ-CHAR-NO-HANG",
    "PEEK-CHAR",
    "READ-BYTE",
    "READ-SEQUENCE",
    "READ",
    "WRITE-STRING",
    "WRITE-LINE",
    "WRITE-CHAR",
    "WRITE-BYTE",
    "WRITE-SEQUENCE",
    "WRITE",
    "PRINT",
    "PRINC",
    "PRIN1",
    "FORMAT",
    "TERPRI",
    "FRESH-LINE",
    "FINISH-OUTPUT",
    "FORCE-OUTPUT",
    "CLEAR-OUTPUT",
    "CLOSE",
    "LISTEN",
    "UNREAD-CHAR",
];

/// Whether a function may call the handlers of a stream.
pub(crate) fn is_of_streams(name: &str) -> bool {
    OF_STREAMS.contains(&name)
}

/// Whether a function reaches the outside, for which a program needs a right, without being one of files.
pub(crate) fn needs_rights(name: &str) -> bool {
    matches!(name, "%CALL-HOST" | "%BEGIN-OPERATION" | "REQUIRE")
}

/// Whether a function calls functions that it is given.
fn takes_functions(name: &str) -> bool {
    TAKING_FUNCTIONS.contains(&name)
}

/// Returns the positions of the arguments that a function calls.
pub(crate) fn function_positions(name: &str) -> &'static [usize] {
    match name {
        "MAP"
        | "MAP-INTO"
        | "SORT"
        | "STABLE-SORT"
        | "SUBSTITUTE-IF"
        | "SUBSTITUTE-IF-NOT"
        | "NSUBSTITUTE-IF"
        | "SUBST-IF"
        | "NSUBST-IF"
        | "%CALL-WITH-QUOTA"
        | "%CALL-WITH-RESOURCES"
        | "%CALL-WITH-FLEET-RESOURCES" => &[1],
        "MERGE" => &[3],
        "%CALL-WITH-LIMIT" | "%CALL-MAINTAINING" | "%CALL-WITH-QUERY-BINDINGS" | "%CALL-IN-WORLD" => &[2],
        "%CALL-GUARDED" => &[0, 1, 2],
        "%WHENEVER" => &[0, 1],
        "%SPAWN-NET" => &[2, 3, 4, 5, 6, 7],
        "APPLY"
        | "FUNCALL"
        | "MAPCAR"
        | "MAPC"
        | "MAPCAN"
        | "MAPCON"
        | "MAPL"
        | "MAPLIST"
        | "MAPHASH"
        | "EVERY"
        | "SOME"
        | "NOTANY"
        | "NOTEVERY"
        | "REDUCE"
        | "FIND-IF"
        | "FIND-IF-NOT"
        | "POSITION-IF"
        | "POSITION-IF-NOT"
        | "COUNT-IF"
        | "COUNT-IF-NOT"
        | "REMOVE-IF"
        | "REMOVE-IF-NOT"
        | "DELETE-IF"
        | "DELETE-IF-NOT"
        | "MEMBER-IF"
        | "MEMBER-IF-NOT"
        | "ASSOC-IF"
        | "ASSOC-IF-NOT"
        | "RASSOC-IF"
        | "COMPLEMENT"
        | "%SPAWN"
        | "%WAIT-UNTIL"
        | "%WAIT-UNTIL-CHANGED"
        | "%WAIT-UNTIL-FOR" => &[0],
        "%DERIVED-VALUE" => &[1],
        _ => &[],
    }
}

/// Whether a function may wait, although it may have no failures.
pub(super) fn may_wait(name: &str) -> bool {
    name.contains("WAIT")
        || matches!(
            name,
            "SLEEP"
                | "%ACQUIRE"
                | "%CALL-WITH-RESOURCES"
                | "%CALL-WITH-FLEET-RESOURCES"
                | "%CALL-HOST"
                | "%CALL-MAINTAINING"
                | "%END-LIKE"
                | "%PERFORM"
                | "%PERFORM-EXCLUSIVELY"
                | "%SUPERVISE"
                | "%TASK-END"
                | "%TASK-VALUE"
                | "OPERATION-RESULT"
        )
}

/// Returns the row of a function.
pub(crate) fn find(name: &str) -> LibraryRow {
    let causes = FAILING.iter().find(|(known, _)| *known == name).map_or(&[][..], |(_, causes)| *causes);
    let mistakes = if name == "%BEGIN-CRITICAL" {
        CRITICAL
    } else if TOTAL.contains(&name) {
        0
    } else if COMPUTING.contains(&name) {
        TYPE | ARITHMETIC
    } else if matches!(name, "%LOGICAL-VALUE") {
        NAME
    } else {
        OF_CALLS
    };
    LibraryRow { causes, mistakes, takes_functions: takes_functions(name) }
}

/// Causes that functions of `forms` and `work` begin.
const OF_FORMS: &[&str] = &[
    "TIMEOUT",
    "BUDGET-EXHAUSTED",
    "QUOTA-EXHAUSTED",
    "NO-BINDINGS",
    "NO-APPLICABLE-METHOD",
    "CONDITION-NOT-ACHIEVED",
    "PROPERTY-LOCK-UNAVAILABLE",
    "MAINTAINED-PROPERTY-VIOLATION",
    "UNRECOVERABLE-PROPERTY-VIOLATION",
    "RESOURCE-DENIED",
    "RESOURCE-PREEMPTED",
    "RESTARTS-EXHAUSTED",
    "ALL-FAILED",
    "ABORTED",
    "CANCELLED",
    "INTERRUPTED-BY-RESTART",
    "OPERATION-BUSY",
    "SUPERSEDED",
    "LINE-TOO-LONG",
    "LEASE-LOST",
    "PERMISSION-DENIED",
    "NOT-IN-THIS-WORLD",
    "NO-SUCH-PARAMETER",
    "UNBOUND-LOGICAL-VARIABLE",
];

/// Returns the causes that functions of the library begin, without condition types.
pub(crate) fn all_causes() -> impl Iterator<Item = &'static str> {
    let rows = FAILING.iter().flat_map(|(_, causes)| causes.iter().copied());
    rows.filter(|cause| !cause.starts_with('!')).chain(OF_FORMS.iter().copied())
}
