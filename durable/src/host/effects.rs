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

    /// Returns whether arguments have an object that is gone: in a rehearsal, none is.
    fn is_gone(&self, arguments: &[Datum]) -> bool {
        has_gone_object(arguments) && !self.control.is_rehearsal()
    }

    /// Makes a call of a function that returns at once.
    pub(super) fn call_outside(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let stand_in = self.lasting.stand_in(call.arguments);
        if self.is_gone(stand_in.as_deref().unwrap_or(call.arguments)) {
            let is_done = call.effect.is_done_by_restart();
            let answer = if is_done { Ok(Datum::nil(Span::default())) } else { Err(interrupted(call, None)) };
            return self.live.answer_call(call, answer);
        }
        // The journal has the arguments as the program has given them.
        let function = &mut |given: &[Datum]| function(stand_in.as_deref().unwrap_or(given));
        match call.effect {
            // It opens nothing outside: operations do.
            CallEffect::Local | CallEffect::Lasts => return self.live.call(call, function),
            // The close is an effect on the other end.
            CallEffect::Closes | CallEffect::Releases if !self.log.commit() => return Err(refused_call()),
            CallEffect::Closes | CallEffect::Releases => return self.live.call(call, function),
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
        let stand_in = self.lasting.stand_in(call.arguments);
        if self.is_gone(stand_in.as_deref().unwrap_or(call.arguments)) {
            return self.inbox.put(Incoming::Operation { number, news: after_restart(call, None) });
        }
        let begin = &mut |given: &[Datum], _| function(stand_in.as_deref().unwrap_or(given), Some(action));
        self.live.begin(call, begin);
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
