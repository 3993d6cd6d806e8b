//! Effects that leave: the intent first, then the call, then its outcome.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{
    ActionId, CallEffect, Host, HostCall, HostError, HostFailure, Incoming, Intent, News, QuestionHash,
    RecordingHost, has_gone_object,
};

use super::DurableHost;
use crate::file_effect::FileSize;
use crate::interruption::{after_restart, interrupted, open_call, refused, refused_call};
use crate::log::JournalLog;

impl<H: Host> DurableHost<H> {
    /// Notes that an effect is about to leave, and makes all safe before it. Returns its identity; `None` if
    /// it may not leave.
    pub(super) fn intend(
        &mut self,
        question: QuestionHash,
        operation: Option<u64>,
        before: u64,
    ) -> Option<ActionId> {
        let action = self.log.next_action();
        self.live.note_intent(question, Intent { action, operation, before });
        self.log.commit().then_some(action)
    }

    /// Makes a call of a function that returns at once.
    pub(super) fn call_outside(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        if has_gone_object(call.arguments) {
            let answer = match call.effect {
                CallEffect::Closes => Ok(Datum::nil(Span::default())),
                _ => Err(interrupted(call, None)),
            };
            return self.live.answer_call(call, answer);
        }
        match call.effect {
            CallEffect::Local => return self.live.call(call, function),
            // The close is an effect on the other end.
            CallEffect::Closes if !self.log.commit() => return Err(refused_call()),
            CallEffect::Closes => return self.live.call(call, function),
            CallEffect::Idempotent | CallEffect::Once => {}
        }
        let question = QuestionHash::of_call(call.name, call.arguments);
        if self.intend(question, None, 0).is_none() {
            return Err(refused_call());
        }
        let answer = self.live.call(call, function);
        self.log.write();
        answer
    }

    /// Begins an operation.
    pub(super) fn begin_outside(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum], Option<ActionId>),
    ) {
        let number = call.operation.unwrap_or(0);
        let question = QuestionHash::of_call(call.name, call.arguments);
        let Some(action) = self.intend(question, call.operation, 0) else {
            return self.inbox.put(Incoming::Operation { number, news: News::Failed(refused_call()) });
        };
        self.log.note_open(open_call(call, number, action));
        if has_gone_object(call.arguments) {
            return self.inbox.put(Incoming::Operation { number, news: after_restart(call, None) });
        }
        self.live.begin(call, &mut |arguments, _| function(arguments, Some(action)));
    }

    /// Changes a file by the outside.
    pub(super) fn change_file(
        &mut self,
        question: QuestionHash,
        before: FileSize,
        change: impl FnOnce(&mut RecordingHost<H, JournalLog>) -> Result<(), HostError>,
    ) -> Result<(), HostError> {
        if self.intend(question, None, before.0).is_none() {
            return Err(refused());
        }
        let answer = change(&mut self.live);
        self.log.write();
        answer
    }
}
