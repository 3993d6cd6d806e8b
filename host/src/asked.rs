//! A host whose questions are counted into a canary: which they are, in their order, with their arguments.
//! Answers are not; whatever they change in the run shows in what follows.

use esl_bytecode::datum::{Datum, DatumKind};

use super::{
    ActionId, Awaited, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, HostState, Inbox,
    Incoming, Input, Output, Permit, RepeatedCall, ReplayState, Right, Rights, RunCheck, Wake, WriteMode,
};
use crate::canary::Canary;

/// Questions to a host.
#[derive(Clone, Copy)]
enum AskedQuestion {
    Monotonic = 1,
    WallClock,
    Due,
    Wait,
    Advance,
    Seed,
    Arguments,
    Write,
    ReadInput,
    IsInteractive,
    ReadFile,
    WriteFile,
    FileExists,
    DeleteFile,
    Call,
    Begin,
    Permit,
    RequestOfFiles,
    ProcessorTime,
}

/// A machine's host, and the canary of the questions that it was asked.
pub struct Asked {
    host: Box<dyn Host + Send>,
    canary: Canary,
}

impl Asked {
    /// Counts the questions to `host` from here on.
    pub fn new(host: Box<dyn Host + Send>) -> Asked {
        Asked { host, canary: Canary::default() }
    }

    /// Returns a state, with the canary, for [`Asked::restore_all`]; `None` if the host has none.
    pub fn save_all(&self) -> Option<(HostState, Canary)> {
        Some((self.host.save()?, self.canary))
    }

    /// Returns to a state. Returns whether the host did.
    pub fn restore_all(&mut self, (state, canary): &(HostState, Canary)) -> bool {
        self.canary = *canary;
        self.host.restore(state)
    }

    /// Goes on with a canary.
    pub fn set_canary(&mut self, canary: Canary) {
        self.canary = canary;
    }

    /// Returns the canary of the questions so far.
    #[inline]
    pub fn canary(&self) -> Canary {
        self.canary
    }

    #[inline]
    fn note(&mut self, question: AskedQuestion) {
        self.canary.mix(question as u64);
    }

    #[inline]
    fn note_word(&mut self, question: AskedQuestion, word: u64) {
        self.note(question);
        self.canary.mix(word);
    }

    fn note_bytes(&mut self, question: AskedQuestion, bytes: &[u8]) {
        self.note(question);
        self.canary.mix_bytes(bytes);
    }

    fn note_call(&mut self, question: AskedQuestion, call: HostCall<'_>) {
        self.note_bytes(question, call.name.as_bytes());
        call.arguments.iter().for_each(|argument| self.mix_datum(argument));
    }

    /// Mixes in a datum: its parts in the order of its text, rare ones as their text.
    fn mix_datum(&mut self, datum: &Datum) {
        let mut rest = Vec::new();
        let mut next = Some(datum);
        while let Some(datum) = next.take().or_else(|| rest.pop()) {
            match datum.kind() {
                DatumKind::Cons(car, cdr) => {
                    self.canary.mix(9);
                    rest.push(cdr);
                    next = Some(car);
                }
                DatumKind::Vector(items) => {
                    self.canary.mix(10);
                    self.canary.mix(items.len() as u64);
                    rest.extend(items.iter().rev());
                }
                kind => self.mix_atom(datum, kind),
            }
        }
    }

    /// Mixes in a datum of this kind, which is not compound.
    fn mix_atom(&mut self, datum: &Datum, kind: &DatumKind) {
        match kind {
            DatumKind::Nil => self.canary.mix(0),
            DatumKind::String(text) => {
                self.canary.mix(1);
                self.canary.mix_bytes(text.as_bytes());
            }
            DatumKind::Integer(number) if let Ok(number) = i64::try_from(number) => {
                self.canary.mix(2);
                self.canary.mix(number as u64);
            }
            DatumKind::Symbol(symbol) if let Some(package) = symbol.package() => {
                self.canary.mix(3);
                self.canary.mix_bytes(package.as_bytes());
                self.canary.mix_bytes(symbol.name().as_bytes());
            }
            DatumKind::Opaque(opaque) => {
                self.canary.mix(4);
                self.canary.mix_bytes(opaque.kind().as_bytes());
                self.canary.mix_bytes(opaque.text().as_bytes());
            }
            DatumKind::Packed(vector) => {
                self.canary.mix(6);
                self.canary.mix_bytes(&vector.to_le_bytes());
            }
            DatumKind::Float(number) => {
                self.canary.mix(7);
                // All values that are not numbers are written alike.
                let number = if number.is_nan() { f64::NAN } else { *number };
                self.canary.mix(number.to_bits());
            }
            DatumKind::Character(character) => {
                self.canary.mix(8);
                self.canary.mix(u64::from(u32::from(*character)));
            }
            _ => {
                self.canary.mix(5);
                self.canary.mix_bytes(datum.to_string().as_bytes());
            }
        }
    }
}

impl Host for Asked {
    #[inline]
    fn monotonic(&mut self) -> u64 {
        self.note(AskedQuestion::Monotonic);
        self.host.monotonic()
    }

    fn wall_clock(&mut self) -> i64 {
        self.note(AskedQuestion::WallClock);
        self.host.wall_clock()
    }

    fn processor_time(&mut self) -> u64 {
        self.note(AskedQuestion::ProcessorTime);
        self.host.processor_time()
    }

    #[inline]
    fn due(&mut self, deadline: u64) -> Option<u64> {
        self.note_word(AskedQuestion::Due, deadline);
        self.host.due(deadline)
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        let wake = self.host.wait(deadline, awaited);
        // Inspections are not part of the run, which waits on.
        if wake != Wake::Inspection {
            self.note_word(AskedQuestion::Wait, deadline.unwrap_or(u64::MAX));
        }
        wake
    }

    #[inline]
    fn stopwatch(&mut self) -> u64 {
        // No question of the run's.
        self.host.stopwatch()
    }

    #[inline]
    fn is_virtual(&self) -> bool {
        self.host.is_virtual()
    }

    #[inline]
    fn advance(&mut self, nanoseconds: u64) {
        self.note_word(AskedQuestion::Advance, nanoseconds);
        self.host.advance(nanoseconds);
    }

    fn seed(&mut self) -> u64 {
        self.note(AskedQuestion::Seed);
        self.host.seed()
    }

    fn arguments(&mut self) -> Vec<String> {
        self.note(AskedQuestion::Arguments);
        self.host.arguments()
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        self.note_word(AskedQuestion::Write, output as u64);
        self.canary.mix_bytes(bytes);
        self.host.write(output, bytes)
    }

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        self.note_word(AskedQuestion::Write, output as u64);
        self.canary.mix_bytes(bytes);
        self.host.write_ready(output, bytes)
    }

    fn read_input(&mut self) -> Input {
        self.note(AskedQuestion::ReadInput);
        self.host.read_input()
    }

    fn is_interactive(&mut self) -> bool {
        self.note(AskedQuestion::IsInteractive);
        self.host.is_interactive()
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        self.note_bytes(AskedQuestion::RequestOfFiles, format!("{request:?}").as_bytes());
        self.host.request_of_files(request)
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        self.note_bytes(AskedQuestion::Permit, object.as_bytes());
        self.canary.mix(right as u64);
        self.host.permit(right, object, narrowed)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        self.note_bytes(AskedQuestion::ReadFile, path.as_bytes());
        self.host.read_file(path)
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        self.note_bytes(AskedQuestion::WriteFile, path.as_bytes());
        self.canary.mix(mode as u64);
        self.canary.mix_bytes(bytes);
        self.host.write_file(path, bytes, mode)
    }

    fn file_exists(&mut self, path: &str) -> bool {
        self.note_bytes(AskedQuestion::FileExists, path.as_bytes());
        self.host.file_exists(path)
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        self.note_bytes(AskedQuestion::DeleteFile, path.as_bytes());
        self.host.delete_file(path)
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        self.note_call(AskedQuestion::Call, call);
        self.host.call(call, function)
    }

    fn begin(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        self.note_call(AskedQuestion::Begin, call);
        self.host.begin(call, function);
    }

    fn inbox(&self) -> Inbox {
        self.host.inbox()
    }

    #[inline]
    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        self.host.poll(round)
    }

    fn replay_state(&self) -> ReplayState {
        self.host.replay_state()
    }

    fn broken_output_status(&self) -> u8 {
        self.host.broken_output_status()
    }

    fn hear_of_refusal(&mut self) {
        self.host.hear_of_refusal();
    }

    #[inline]
    fn check(&mut self, check: RunCheck) {
        // No question of the run's.
        self.host.check(check);
    }

    fn next_repeated(&mut self) -> Option<RepeatedCall> {
        self.host.next_repeated()
    }

    fn permits_repeated(&mut self, right: Right, object: &str) -> bool {
        self.host.permits_repeated(right, object)
    }

    fn answer_repeated(&mut self, answer: Result<Datum, HostFailure>) {
        self.host.answer_repeated(answer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VirtualHost;
    use esl_bytecode::span::Span;

    fn atom(kind: DatumKind) -> Datum {
        Datum::new(kind, Span::default())
    }

    fn int(number: i64) -> Datum {
        Datum::integer(number, Span::default())
    }

    fn list(items: Vec<Datum>) -> Datum {
        Datum::list(items, Span::default())
    }

    fn begin_with(host: &mut Asked, argument: Datum) {
        begin(host, "b", &[argument]);
    }

    fn begin(host: &mut Asked, name: &str, arguments: &[Datum]) {
        let call = HostCall { name, arguments, effect: crate::CallEffect::Once, operation: Some(1) };
        host.begin(call, &mut |_, _| {});
    }

    #[test]
    fn questions_and_arguments_count() {
        let canary = |ask: fn(&mut Asked)| {
            let mut asked = Asked::new(Box::new(VirtualHost::new()));
            ask(&mut asked);
            asked.canary().value()
        };
        let found = [
            canary(|_| {}),
            canary(|host| _ = host.monotonic()),
            canary(|host| _ = host.wall_clock()),
            canary(|host| _ = host.processor_time()),
            canary(|host| _ = host.write(Output::Standard, b"a")),
            canary(|host| _ = host.write(Output::Standard, b"b")),
            canary(|host| _ = host.write(Output::Error, b"a")),
            canary(|host| _ = host.write_file("a", b"b", WriteMode::Replace)),
            canary(|host| _ = host.write_file("a", b"b", WriteMode::Append)),
            canary(|host| _ = host.file_exists("a")),
            canary(|host| _ = host.delete_file("a")),
            canary(|host| _ = host.permit(Right::Read, "a", &[])),
            canary(|host| _ = host.permit(Right::Write, "a", &[])),
            canary(|host| begin(host, "a", &[])),
            canary(|host| begin(host, "b", &[])),
            canary(|host| begin(host, "b", &[Datum::nil(Span::default())])),
            canary(|host| begin(host, "b", &[Datum::integer(0, Span::default())])),
            canary(|host| begin(host, "b", &[Datum::integer(-1, Span::default())])),
            canary(|host| begin(host, "b", &[Datum::string("", Span::default())])),
            canary(|host| begin(host, "b", &[Datum::string("-1", Span::default())])),
            canary(|host| begin_with(host, atom(DatumKind::Float(-1.0)))),
            canary(|host| begin_with(host, atom(DatumKind::Float(1.0)))),
            canary(|host| begin_with(host, atom(DatumKind::Character('a')))),
            canary(|host| begin_with(host, atom(DatumKind::Vector([].into())))),
            // ((1) 2), ((1 2)), (1 (2)), (1 2) and (1 . 2)
            canary(|host| begin_with(host, list(vec![list(vec![int(1)]), int(2)]))),
            canary(|host| begin_with(host, list(vec![list(vec![int(1), int(2)])]))),
            canary(|host| begin_with(host, list(vec![int(1), list(vec![int(2)])]))),
            canary(|host| begin_with(host, list(vec![int(1), int(2)]))),
            canary(|host| begin_with(host, Datum::cons(int(1), int(2), Span::default()))),
            canary(|host| begin_with(host, atom(DatumKind::Vector([int(1), int(2)].into())))),
        ];
        for (i, one) in found.iter().enumerate() {
            assert!(!found[i + 1..].contains(one), "question {i}");
        }
        assert_eq!(canary(|host| _ = host.stopwatch()), canary(|_| {}), "no question of the run's");
    }
}
