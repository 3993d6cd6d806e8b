//! The host of a durable run: the journal first, then the outside.
//!
//! It has two hosts. While there are records, a [`ReplayHost`] answers by them, and nothing leaves. From the
//! first question on that no record answers, a [`RecordingHost`] asks the outside, and notes each answer.
//! Between the two, the program's input `*resumed*` is signalled, and interrupted calls fail.
//!
//! Guarantees: before an effect leaves, all answers that the program has had are in the journal, and so is
//! the intent of the effect. A call that may not be made twice is made once, or fails with
//! `:interrupted-by-restart`.

mod effects;

use std::collections::{BTreeMap, HashSet};

use esl_bytecode::datum::Datum;
use esl_host::{
    ActionId, Awaited, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, Inbox, Incoming,
    Input, News, NotedRecord, Output, Permit, ProcessSignal, QuestionHash, Recorder, RecordingHost,
    RepeatedCall, ReplayHost, Right, Rights, RunCheck, Wake, WriteMode,
};

use esl_replay::JournalGeneration;

use super::control::{DurableControl, Resumed};
use super::error::DurableError;
use super::file_effect::{FileSize, complete_deletion, complete_request, complete_write, size_of};
use super::interruption::{
    ended_operations, interrupted, last_question, news_of, open_call, refused, resumed_message, senders,
};
use super::lasting::LastingCalls;
use super::log::JournalLog;
use super::resume::Resumption;
use super::upgrade::{Upgrade, UpgradeFailure};

/// The host of a durable run.
pub struct DurableHost<H> {
    past: ReplayHost,
    live: RecordingHost<H, JournalLog>,
    log: JournalLog,
    control: DurableControl,
    lasting: LastingCalls,
    inbox: Inbox,
    /// The process that is about to begin, until it has begun.
    resumption: Option<Resumption>,
    /// News for the machine when the run goes on: of the restart, and arrivals during the replay.
    early: Vec<Incoming>,
    /// Operations that have ended by the journal.
    ended: HashSet<u64>,
    /// Operations that have not, by number, with the news of each one that is not begun again.
    open: BTreeMap<u64, Option<News>>,
    /// Whether the last record is the intent of a call that fails.
    interrupts: bool,
    /// Number of senders that are gone.
    lost: usize,
    /// The upgrade that is to be made when the run goes on.
    upgrade: Option<Upgrade>,
    /// The upgrade whose call is among the news for the machine, or under way.
    upgrading: Option<Upgrade>,
}

impl<H: Host> DurableHost<H> {
    /// Creates the host of a run that goes on after `records`, or begins if there is no `resumption`.
    pub(crate) fn new(
        host: H,
        log: JournalLog,
        (control, lasting): (DurableControl, LastingCalls),
        records: std::sync::Arc<[NotedRecord]>,
        start: Option<&JournalGeneration>,
        resumption: Option<Resumption>,
        upgrade: Option<Upgrade>,
    ) -> DurableHost<H> {
        let inbox = host.inbox();
        control.set_inbox(inbox.clone());
        let ended = ended_operations(&records);
        let lost = senders(&records, start.map_or(0, |start| start.senders as usize));
        // Answers to questions of earlier processes are those of a replay.
        inbox.number_questions_above(last_question(&records, start.map_or(0, |start| start.asked)));
        let early = (0..lost).map(|_| Incoming::SenderLeft).collect();
        let open = start.map_or(&[][..], |start| &start.open).iter();
        let open = open.filter(|call| !ended.contains(&call.number));
        let open = open.map(|call| (call.number, news_of(call, log.has_saved(call.number)))).collect();
        inbox.set_state_keeper(log.state_keeper());
        let past = match start {
            Some(_) => ReplayHost::preparing(records),
            None => ReplayHost::new(records),
        };
        let past = past.with_screen(|_, _| ()).with_inbox(inbox.clone());
        control.set_past(past.clone());
        let live = RecordingHost::with_recorder(host, log.clone());
        DurableHost {
            past,
            live,
            log,
            control,
            lasting,
            inbox,
            resumption,
            early,
            ended,
            open,
            interrupts: false,
            lost,
            upgrade,
            upgrading: None,
        }
    }

    /// Returns whether no record answers the next question. The replay of a run that has diverged never ends.
    fn is_live(&self) -> bool {
        self.resumption.is_none()
            || (self.past.is_at_end() && !self.past.has_diverged() && !self.past.is_preparing())
    }

    /// Goes on with the outside, if no record answers the next question. Returns whether none does.
    fn enter(&mut self) -> bool {
        if !self.is_live() {
            return false;
        }
        let Some(resumption) = self.resumption.take() else {
            self.note_standing();
            return true;
        };
        self.live.go_on(self.past.not_due());
        let (life, downtime) = resumption.begin(self.live.host_mut().monotonic());
        self.log.note_life(life);
        // The upgrade is made before the program is told of its restart.
        let mut first = self.upgrade.take().map_or(Vec::new(), |upgrade| self.begin_upgrade(upgrade));
        if resumption.is_told() {
            // Those of this process come later.
            first.push(Incoming::Unattended);
            first.push(resumed_message(&life, downtime));
        }
        // Nothing is interrupted or gone in a rehearsal: the rest comes by the script.
        if self.control.is_rehearsal() {
            (self.open, self.early) = (BTreeMap::new(), self.early.split_off(self.lost));
        }
        let mut interrupted = usize::from(self.interrupts);
        for (number, news) in std::mem::take(&mut self.open) {
            if let Some(news) = news {
                interrupted += 1;
                first.push(Incoming::Operation { number, news });
            }
        }
        self.log.forget_ended(&self.ended);
        // No program of a copy runs on.
        let again = if self.control.is_copy() { 0 } else { self.lasting.begin_again(&self.inbox) };
        self.control.note_resumed(Resumed { life, downtime, interrupted, lost: self.lost, again });
        first.append(&mut self.early);
        self.early = first;
        self.inbox.ring();
        true
    }

    /// Notes where the run stands, for a snapshot.
    fn note_standing(&self) {
        let is_settled = self.early.is_empty() && self.upgrade.is_none() && self.upgrading.is_none();
        self.control.note_standing(is_settled, self.live.not_due());
    }

    /// Asks the machine for an upgrade. Returns the arrivals by which it is asked.
    fn begin_upgrade(&mut self, upgrade: Upgrade) -> Vec<Incoming> {
        let (call, asked) = upgrade.ask(&self.inbox);
        self.control.begin_upgrade(call);
        // There is no answer yet: the inbox is rung when it comes.
        let outcome = self.control.hear_upgrade(&self.inbox);
        debug_assert!(outcome.is_none(), "the machine has not been asked yet");
        self.upgrading = Some(upgrade);
        asked
    }

    /// Deals with the end of an upgrade. Returns whether the machine is to come back.
    fn end_upgrade(&mut self) -> bool {
        let Some(outcome) = self.control.hear_upgrade(&self.inbox) else { return false };
        let upgrade = self.upgrading.take();
        if let (Err(UpgradeFailure(reason)), Some(upgrade)) = (&outcome, upgrade) {
            self.log.return_to(upgrade.before);
            self.log.fail(DurableError::NotUpgraded(reason.clone()));
        }
        self.control.is_copy() || outcome.is_err()
    }

    /// As [`DurableHost::enter`], where the last record is the intent of a call that is not made again.
    fn interrupts(&mut self) -> bool {
        self.interrupts = self.is_live();
        self.enter()
    }

    /// Rings the inbox once the records are at their end, since the news of the restart come through it.
    fn ring_at_end(&self) {
        if self.past.is_at_end() {
            self.inbox.ring();
        }
    }
}

/// Asks the host whose turn it is.
macro_rules! ask {
    ($self:ident, $host:ident => $question:expr) => {
        if $self.enter() {
            let $host = &mut $self.live;
            $question
        } else {
            let $host = &mut $self.past;
            let answer = $question;
            $self.ring_at_end();
            answer
        }
    };
}

impl<H: Host> DurableHost<H> {
    /// Makes a call of a function that returns at once, or takes its answer from the records.
    fn make_call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        if self.enter() {
            return self.call_outside(call, function);
        }
        let question = QuestionHash::of_call(call.name, call.arguments);
        match self.past.take_intent(question) {
            Some(_) if call.effect.may_be_repeated() && self.enter() => self.call_outside(call, function),
            Some(intent) if self.interrupts() => {
                self.live.answer_call(call, Err(interrupted(call, Some(intent.action))))
            }
            _ => ask!(self, host => host.call(call, function)),
        }
    }

    /// Begins an operation, or leaves it to the records.
    fn begin_call(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        if self.enter() {
            return self.begin_outside(call, function);
        }
        if let (Some(intent), Some(number)) = (self.past.expect_intent(call), call.operation)
            && !self.ended.contains(&number)
        {
            let open = open_call(call, number, intent.action);
            let news = news_of(&open, self.log.has_saved(number));
            self.log.note_open(open);
            if news.is_none() {
                function(call.arguments, Some(intent.action));
            }
            self.open.insert(number, news);
        }
        self.ring_at_end();
    }
}

impl<H: Host> Host for DurableHost<H> {
    fn monotonic(&mut self) -> u64 {
        ask!(self, host => host.monotonic())
    }

    fn wall_clock(&mut self) -> i64 {
        ask!(self, host => host.wall_clock())
    }

    fn processor_time(&mut self) -> u64 {
        ask!(self, host => host.processor_time())
    }

    fn due(&mut self, deadline: u64) -> Option<u64> {
        if self.enter() && !self.early.is_empty() {
            // The news of the restart come first.
            self.live.answer_not_due();
            return None;
        }
        let due = ask!(self, host => host.due(deadline));
        if due.is_none() && self.is_live() {
            self.note_standing();
        }
        due
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        ask!(self, host => host.wait(deadline, awaited))
    }

    fn stopwatch(&mut self) -> u64 {
        self.live.stopwatch()
    }

    fn is_virtual(&self) -> bool {
        let answer = if self.is_live() { self.live.is_virtual() } else { self.past.is_virtual() };
        if !self.is_live() {
            self.ring_at_end();
        }
        answer
    }

    fn advance(&mut self, nanoseconds: u64) {
        if self.enter() {
            self.live.advance(nanoseconds);
        }
    }

    fn seed(&mut self) -> u64 {
        ask!(self, host => host.seed())
    }

    fn arguments(&mut self) -> Vec<String> {
        ask!(self, host => host.arguments())
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        if !self.enter() {
            return ask!(self, host => host.write(output, bytes));
        }
        if !self.log.commit_for_output() {
            return Err(refused());
        }
        let answer = self.live.write(output, bytes);
        self.log.write();
        answer
    }

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        if !self.enter() {
            return ask!(self, host => host.write_ready(output, bytes));
        }
        if !self.log.commit_for_output() {
            return Err(refused());
        }
        let answer = self.live.write_ready(output, bytes);
        self.log.write();
        answer
    }

    fn read_input(&mut self) -> Input {
        ask!(self, host => host.read_input())
    }

    fn is_interactive(&mut self) -> bool {
        ask!(self, host => host.is_interactive())
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        let (FileRequest::Rename(..) | FileRequest::MakeFolders(_)) = request else {
            return ask!(self, host => host.request_of_files(request));
        };
        let question = QuestionHash::of_request(&request);
        if !self.enter() {
            let intent = self.past.take_intent(question);
            if intent.is_none() || !self.enter() {
                return ask!(self, host => host.request_of_files(request));
            }
            let answer = complete_request(self.live.host_mut(), request);
            return self.live.answer_request(question, answer);
        }
        if self.intend(question, None, 0).is_none() {
            return Err(refused());
        }
        let answer = self.live.request_of_files(request);
        self.log.write();
        answer
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        ask!(self, host => host.permit(right, object, narrowed))
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        ask!(self, host => host.read_file(path))
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        let question = QuestionHash::of_write_file(path, bytes, mode);
        if !self.enter() {
            match self.past.take_intent(question) {
                Some(intent) if self.enter() => {
                    let before = FileSize(intent.before);
                    let answer = complete_write(self.live.host_mut(), path, bytes, mode, before);
                    return self.live.answer_write(question, answer);
                }
                _ => return ask!(self, host => host.write_file(path, bytes, mode)),
            }
        }
        let before = size_of(path);
        self.change_file(question, before, |live| live.write_file(path, bytes, mode))
    }

    fn file_exists(&mut self, path: &str) -> bool {
        ask!(self, host => host.file_exists(path))
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        let question = QuestionHash::of_path(path);
        if !self.enter() {
            match self.past.take_intent(question) {
                Some(intent) if self.enter() => {
                    let before = FileSize(intent.before);
                    let answer = complete_deletion(self.live.host_mut(), path, before);
                    return self.live.answer_write(question, answer);
                }
                _ => return ask!(self, host => host.delete_file(path)),
            }
        }
        let before = size_of(path);
        self.change_file(question, before, |live| live.delete_file(path))
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let answer = self.make_call(call, function);
        self.lasting.hear_call(call, &answer);
        answer
    }

    fn next_repeated(&mut self) -> Option<RepeatedCall> {
        if self.is_live() { self.lasting.next() } else { None }
    }

    fn permits_repeated(&mut self, right: Right, object: &str) -> bool {
        matches!(self.live.host_mut().permit(right, object, &[]), Permit::Granted(_))
    }

    fn answer_repeated(&mut self, answer: Result<Datum, HostFailure>) {
        let answer = answer.as_ref().map(std::slice::from_ref);
        self.lasting.answer(answer, &self.inbox, &self.control);
    }

    fn begin(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        self.begin_call(call, function);
        self.lasting.hear_begin(call);
    }

    fn inbox(&self) -> Inbox {
        self.inbox.clone()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        if self.log.has_failed() {
            // The signal cuts the end of the run short, if that is where it is.
            return vec![Incoming::Signal(ProcessSignal::Interrupt), Incoming::Stop];
        }
        if self.control.comes_back() && self.is_live() && self.upgrade.is_none() && self.upgrading.is_none() {
            // The program is not told of a restart.
            return vec![Incoming::Stop];
        }
        let comes_back = self.end_upgrade();
        if self.log.has_failed() {
            return vec![Incoming::Signal(ProcessSignal::Interrupt), Incoming::Stop];
        }
        let is_asked = self.control.takes_pause();
        let pauses = is_asked && self.control.may_pause();
        if pauses {
            self.control.note_time(self.live.host_mut().monotonic());
        }
        let mut contents = if self.enter() {
            if !self.early.is_empty() {
                if let Some(upgrade) = &self.upgrading {
                    self.log.begin_upgrade(upgrade.program.clone());
                }
                let come = self.inbox.take();
                std::mem::take(&mut self.early).into_iter().chain(come).for_each(|one| self.inbox.put(one));
            }
            self.lasting.take_news(&self.inbox, &self.control);
            let contents = self.live.poll(round);
            // An arrival, such as the outcome of an effect, cannot be had a second time.
            if !contents.is_empty() {
                self.log.write();
            }
            self.note_standing();
            contents
        } else {
            self.early.extend(self.inbox.take());
            let contents = self.past.poll(round);
            self.ring_at_end();
            contents
        };
        self.lasting.hear_news(&contents);
        if is_asked && !pauses {
            // The next round begins with the snapshot. The look into the inbox has quietened it.
            self.inbox.ring();
        }
        if pauses || comes_back {
            contents.push(Incoming::Stop);
        } else if contents.is_empty() && self.is_live() && self.control.takes_interruption() {
            contents.push(Incoming::Interlude);
        }
        contents
    }

    fn check(&mut self, check: RunCheck) {
        ask!(self, host => host.check(check));
    }

    fn broken_output_status(&self) -> u8 {
        if self.is_live() { self.live.broken_output_status() } else { self.past.broken_output_status() }
    }

    fn hear_of_refusal(&mut self) {
        self.log.break_off();
    }
}
