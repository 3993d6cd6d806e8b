//! The records of the library that the machine reads or makes: where each has its fields.
//!
//! The library defines them by `%define-record`, with a comment on each field. A row of this table repeats
//! the names, so that the machine finds a field by its name; the build of the library compares the two.

macro_rules! define_records {
    ($( $(#[doc = $doc:literal])* $record:ident { $( $field:ident ),* } )*) => {
        $(
            $(#[doc = $doc])*
            #[allow(dead_code, reason = "the machine uses some of the fields")]
            pub(crate) mod $record {
                #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "they become constants")]
                enum Field { $( $field, )* LENGTH }

                $( pub(crate) const $field: usize = Field::$field as usize; )*
                /// Number of fields.
                pub(crate) const LENGTH: usize = Field::LENGTH as usize;
            }
        )*

        /// The records, with the names of their fields in their order. In the library, the name of a
        /// record begins with `%`, and names have `-` in place of `_`.
        pub const RECORDS: &[(&str, &[&str])] =
            &[$( (stringify!($record), &[$( stringify!($field) ),*]) ),*];
    };
}

define_records! {
    /// A source that forms read: a fluent, or facts.
    source { EVENT, VALUE, SEEN, USERS, WATCHES, PATTERN, TABLE, KEY }

    /// The sources that a form has read.
    reads { TASK, SOURCES, MARKS, WATCH, ANY, FACTS }

    /// A resource.
    resource {
        NAME, HOLDERS, WAITERS, INNER, PREEMPTIBLE, YIELDS, CAPACITY, USED, LEAVING, NOTED, PLACE, OPEN,
        PROMISED, OWED
    }

    /// The part of a request that is for one resource.
    claim { NEXT, PREVIOUS, NEXT_BESIDE, PREVIOUS_BESIDE, REQUEST, RESOURCE, AMOUNT, PREEMPTIBLE }

    /// A request for resources.
    request { TASK, CLAIMS, SIZE, PRIORITY, EVENT, STATE, TAG, OUTER, INNER_P, PROMISED_P }

    /// A lock of a property.
    lock { KEY, VALUE, STATE, CAUSE, EVENT, SUBSCRIPTIONS, RESTORER }

    /// A task's entry in a lock.
    subscription { TASK, KEY, VALUE, LOCK, GUARD, PENDING, WAITS_P }

    /// A child of a supervisor.
    child { ID, FUNCTION, STARTER, RESTART, PAUSES, BACKOFF, TASK, BEGUN, DUE }

    /// The origin of a failure.
    history { FRAMES, RECOVERIES, ORIGIN, CAUSES }

    /// A frame of a backtrace.
    frame { FUNCTION, SOURCE, LINE, COLUMN, VARIABLES, LIBRARY_P, LEFT_P }
}
