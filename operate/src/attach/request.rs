//! The requests of a session, and the role that each needs.

use crate::secrets::OperatorRole;

/// Defines [`SessionRequest`], with the name of each request, and the role that it needs.
macro_rules! requests {
    ($( $(#[doc = $doc:literal])* $variant:ident = $role:ident $($name:literal)|+ ; )*) => {
        /// Something that may be asked in a session.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum SessionRequest {
            $( $(#[doc = $doc])* $variant, )*
        }

        impl SessionRequest {
            /// All requests.
            #[cfg(test)]
            pub(super) const ALL: &[SessionRequest] = &[$( SessionRequest::$variant, )*];

            /// Returns the request of a name in lower case.
            pub(super) fn named(name: &str) -> Option<SessionRequest> {
                match name {
                    $( $($name)|+ => Some(SessionRequest::$variant), )*
                    _ => None,
                }
            }

            /// Returns the role that it needs.
            pub(super) fn role(self) -> OperatorRole {
                match self {
                    $( SessionRequest::$variant => OperatorRole::$role, )*
                }
            }

            /// Returns its first name.
            #[cfg(test)]
            pub(super) fn name(self) -> &'static str {
                match self {
                    $( SessionRequest::$variant => [$($name),+][0], )*
                }
            }
        }
    };
}

requests! {
    /// The description of the machine, and the role of the session.
    Connect = Observe "swank:connection-info";
    /// The tree of tasks, as a text.
    Tasks = Observe "esl:tasks";
    /// The activity of a task, and its frames, as a text.
    Backtrace = Observe "esl:backtrace";
    /// Facts, as a text.
    Facts = Observe "esl:facts";
    /// Relations, locks and inputs, as a text.
    Data = Observe "esl:data";
    /// The latest failures, as a text.
    Failures = Observe "esl:failures";
    /// Has a task aborted.
    Abort = Command "esl:abort";
    /// Has a task, with those that it has made, stand still.
    Suspend = Command "esl:suspend";
    /// Has a task go on.
    Resume = Command "esl:resume";
    /// Has no task run.
    Pause = Command "esl:pause";
    /// Has tasks run again.
    Continue = Command "esl:continue";
    /// Signals an input with data.
    Signal = Command "esl:signal";
    /// Narrows the rights of what is evaluated: pairs of a right and what it is for, or "" for all.
    Narrow = Patch "esl:rights";
    /// Evaluates forms.
    Evaluate = Patch "esl:evaluate";
    /// Writes the value of a form after each change.
    Watch = Patch "esl:watch";
    /// Completes a name.
    Complete = Patch "esl:complete";
    /// Makes definitions in one step.
    Change = Patch "esl:patch";
    /// Takes the newest patch back.
    Undo = Patch "esl:undo-patch";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_table() {
        for &request in SessionRequest::ALL {
            assert_eq!(SessionRequest::named(request.name()), Some(request));
        }
        assert_eq!(SessionRequest::named("esl:reboot"), None);
    }
}
