//! Durable runs on disks that fail, forget and are changed.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl::program::{self, Program, Source, compile};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_durable::{
    Disk, Downtime, Durability, DurableError, DurableOptions, DurableRun, RealDisk, SnapshotEvery,
};
use esl_host::{CallEffect, HostFunction, HostOperation, RealHost, Rights};
use esl_replay::{RunJournal, RunSetup};
use esl_vm::vm::{Config, Vm};

/// A program whose device performs actions, and whose last line does not depend on its processes.
const AGENT: &str = r#"
(esl::%define-host-function act (name) "Performs an action." t)
(esl::%define-host-function asked (name) "Returns whether it was performed." t)
(define-input *resumed*)
(defvar *total* 0)
(defun once (name)
  (with-recovery-procedures
      (((:interrupted-by-restart operation arguments id)
         (unless (and (eq operation :act) (equal arguments (list name)) (= (length id) 32))
           (fail :wrong-arguments operation arguments id))
         (if (asked name) (abort name) (retry))))
    (act name)))
(task-net
  (one (dotimes (i 3)
         (once (format nil "one-~d" i))
         (incf *total* (random 100))
         (sleep 1)))
  (two (dotimes (i 2)
         (sleep 0.5)
         (once (format nil "two-~d" i))
         (princ "two ")
         (assert (list 'done i)))))
(format t "over ~d ~a ~a~%" *total* (now) (length (db-query '(done ?i))))
"#;

/// The file of a disk in memory.
#[derive(Clone, Default)]
struct MemoryDisk(Arc<Mutex<MemoryFile>>);

#[derive(Clone, Debug, Default)]
struct MemoryFile {
    bytes: Option<Vec<u8>>,
    synced: usize,
    /// Calls that succeed before one that does not.
    left: Option<u64>,
    /// The part of the failing call that takes place all the same.
    does: Doing,
    calls: u64,
    syncs_after_failure: u64,
}

/// The part of a failing call that takes place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Doing {
    #[default]
    Nothing,
    Half,
    All,
}

impl MemoryDisk {
    fn lock(&self) -> MutexGuard<'_, MemoryFile> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fail_after(&self, calls: u64, does: Doing) {
        let mut file = self.lock();
        (file.left, file.does) = (Some(calls), does);
    }

    fn mend(&self) {
        self.lock().left = None;
    }

    /// Loses what was not synced, sector by sector.
    fn lose_power(&self, seed: u64) {
        let mut file = self.lock();
        let synced = file.synced;
        let Some(bytes) = &mut file.bytes else { return };
        let mut state = seed | 1;
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let length = synced + usize::try_from(next()).unwrap_or(0) % (bytes.len() - synced + 1);
        bytes.truncate(length);
        for sector in synced / 512..length.div_ceil(512) {
            let (start, end) = ((sector * 512).max(synced), ((sector + 1) * 512).min(length));
            if start < end && next() % 2 == 0 {
                bytes[start..end].fill(0);
            }
        }
    }
}

impl MemoryFile {
    /// Counts a call. Returns what it does, and whether it fails.
    fn call(&mut self) -> (Doing, bool) {
        self.calls += 1;
        match &mut self.left {
            None => (Doing::All, false),
            Some(0) => {
                // The first call that fails may do something; later ones do not.
                (std::mem::take(&mut self.does), true)
            }
            Some(left) => {
                *left -= 1;
                (Doing::All, false)
            }
        }
    }
}

fn answer(fails: bool) -> io::Result<()> {
    if fails { Err(io::ErrorKind::StorageFull.into()) } else { Ok(()) }
}

impl Disk for MemoryDisk {
    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        Ok(self.lock().bytes.clone())
    }

    fn create(&mut self, contents: &[u8]) -> io::Result<()> {
        let mut file = self.lock();
        let (does, fails) = file.call();
        if does == Doing::All {
            (file.bytes, file.synced) = (Some(contents.to_vec()), contents.len());
        }
        answer(fails)
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        let mut file = self.lock();
        let (does, fails) = file.call();
        let length = usize::try_from(length).expect("it fits");
        if does == Doing::All
            && let Some(bytes) = &mut file.bytes
        {
            bytes.truncate(length);
            file.synced = length;
        }
        answer(fails)
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut file = self.lock();
        let (does, fails) = file.call();
        let count = match does {
            Doing::Nothing => 0,
            Doing::Half => bytes.len() / 2,
            Doing::All => bytes.len(),
        };
        file.bytes.as_mut().expect("it was created").extend_from_slice(&bytes[..count]);
        answer(fails)
    }

    fn sync(&mut self) -> io::Result<()> {
        let mut file = self.lock();
        if file.left == Some(0) && file.does == Doing::Nothing {
            file.syncs_after_failure += 1;
        }
        let (does, fails) = file.call();
        if does == Doing::All {
            file.synced = file.bytes.as_ref().map_or(0, Vec::len);
        }
        answer(fails)
    }
}

/// Returns the name of the action that an operation is to perform.
fn name_of(operation: &HostOperation) -> String {
    match operation.arguments().first().map(Datum::kind) {
        Some(DatumKind::String(name)) => name.to_string(),
        other => panic!("{other:?} is not a name"),
    }
}

/// The device: how often each action was performed, and for each identity of a call.
#[derive(Clone, Default)]
struct Device(Arc<Mutex<Performed>>);

#[derive(Default)]
struct Performed {
    actions: BTreeMap<String, u32>,
    calls: BTreeMap<String, u32>,
}

impl Device {
    fn lock(&self) -> MutexGuard<'_, Performed> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn give_to(&self, machine: &mut Vm) {
        let device = self.clone();
        let act = HostFunction::Operation(Box::new(move |operation| {
            let id = operation.action().expect("a durable run names its calls").to_string();
            let mut performed = device.lock();
            *performed.actions.entry(name_of(&operation)).or_default() += 1;
            *performed.calls.entry(id).or_default() += 1;
            operation.complete(Vec::new());
        }));
        machine.add_function_with("ACT", act, &[], CallEffect::Once);
        let device = self.clone();
        let asked = HostFunction::Operation(Box::new(move |operation| {
            let is_performed = device.lock().actions.contains_key(&name_of(&operation));
            let number = Datum::integer(i64::from(is_performed), Span::default());
            let nil = Datum::nil(Span::default());
            operation.complete(vec![if is_performed { number } else { nil }]);
        }));
        machine.add_function_with("ASKED", asked, &[], CallEffect::Idempotent);
    }
}

fn compiled(text: &str) -> Program {
    compile(&[Source::new("agent.esl", text)]).program.expect("it compiles")
}

/// Runs a program in one process of a durable run under virtual time. Returns its status and its output.
fn life(
    disk: impl Disk + 'static,
    program: &Program,
    durability: Durability,
    device: &Device,
) -> Result<(u8, String), DurableError> {
    let snapshots = SnapshotEvery::Never;
    let options =
        DurableOptions { durability, downtime: Downtime::Stops, snapshots, hosted: None, from_facts: false };
    let run = DurableRun::on(Box::new(disk), options)?;
    if let Some(status) = run.ended() {
        return Ok((status, String::new()));
    }
    let output = Arc::new(Mutex::new(Vec::new()));
    let kept = output.clone();
    let screen = move |bytes: &[u8]| {
        kept.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(())
    };
    let host = RealHost::new(Vec::new()).with_rights(Rights::all()).with_screen(Box::new(screen));
    let host = run.host(host.with_virtual_time().with_elapsed(run.elapsed()));
    let mut machine = program::machine(Config::DEFAULT, Box::new(host)).expect("there is room");
    device.give_to(&mut machine);
    run.begin(program, &RunSetup::default(), &machine)?;
    let main = program::begin(&mut machine, program).expect("there is room");
    let outcome = machine.run(u64::MAX);
    run.check()?;
    run.control().begin_end();
    let summary = program::finish(&mut machine, main, outcome);
    run.check()?;
    run.end(&machine, summary.ended.exit_status())?;
    let output = output.lock().unwrap_or_else(PoisonError::into_inner);
    Ok((summary.ended.exit_status(), String::from_utf8_lossy(&output).into_owned()))
}

/// Returns what the program has printed at its end.
fn last(output: &str) -> &str {
    output.split_once("over ").map_or("", |(_, rest)| rest)
}

/// Returns the journal of a whole run, its last line, and the number of calls to the disk.
fn whole(program: &Program, durability: Durability) -> (Vec<u8>, String, u64) {
    let (disk, device) = (MemoryDisk::default(), Device::default());
    let (status, output) = life(disk.clone(), program, durability, &device).expect("it runs");
    assert_eq!(status, 0, "{output}");
    assert_eq!(device.lock().actions.len(), 5);
    let file = disk.lock().clone();
    (file.bytes.expect("it was written"), last(&output).to_owned(), file.calls)
}

#[test]
fn a_run_whose_disk_fails_at_any_call_stops_and_goes_on() {
    let program = compiled(AGENT);
    for durability in [Durability::Process, Durability::Power] {
        let (_, line, calls) = whole(&program, durability);
        for call in 0..calls {
            for does in [Doing::Nothing, Doing::Half, Doing::All] {
                let (disk, device) = (MemoryDisk::default(), Device::default());
                disk.fail_after(call, does);
                let error = life(disk.clone(), &program, durability, &device).expect_err("the disk fails");
                assert!(matches!(error, DurableError::NotWritten(_)), "{error}");
                // A system that has dropped data once does not write them at a second try.
                assert!(disk.lock().syncs_after_failure < 2);
                disk.mend();
                if durability == Durability::Power {
                    disk.lose_power(call * 3 + does as u64 + 1);
                }
                let ended = life(disk, &program, durability, &device);
                let (status, output) = ended.unwrap_or_else(|error| panic!("call {call} {does:?}: {error}"));
                // All was over but for the note of it.
                let is_over = last(&output).is_empty();
                assert!(status == 0 && (is_over || last(&output) == line), "{call} {does:?}: {output}");
                assert!(!is_over || call + 8 > calls, "{call} {does:?}: {output}");
                let performed = device.lock();
                assert!(performed.actions.values().all(|&count| count == 1), "{:?}", performed.actions);
                assert!(performed.calls.values().all(|&count| count == 1), "{:?}", performed.calls);
                assert_eq!(performed.actions.len(), 5, "{:?}", performed.actions);
            }
        }
    }
}

#[test]
fn a_journal_that_is_cut_off_anywhere_goes_on() {
    let program = compiled(AGENT);
    let (bytes, line, _) = whole(&program, Durability::Process);
    let beginning = journal_length_of_beginning(&bytes);
    for length in (beginning..bytes.len()).step_by(7) {
        let disk = MemoryDisk::default();
        disk.lock().bytes = Some(bytes[..length].to_vec());
        // The device has performed all that the whole run has: what is cut off here has left.
        let device = Device::default();
        for name in ["one-0", "one-1", "one-2", "two-0", "two-1"] {
            device.lock().actions.insert(name.into(), 0);
        }
        let (status, output) = life(disk, &program, Durability::Process, &device).expect("it goes on");
        let is_over = last(&output).is_empty() && length + 200 > bytes.len();
        assert!(status == 0 && (is_over || last(&output) == line), "{length}: {output}");
        assert!(device.lock().actions.values().all(|&count| count < 2));
    }
}

/// Returns the length of the header of a journal and the first life.
fn journal_length_of_beginning(bytes: &[u8]) -> usize {
    (1..bytes.len())
        .find(|&length| {
            RunJournal::read(&bytes[..length])
                .is_ok_and(|journal| journal.lives.len() == 1 && journal.length == length)
        })
        .expect("there is a beginning")
}

#[test]
fn an_upgrade_is_whole_or_not_there() {
    let program = compiled(AGENT);
    let (bytes, ..) = whole(&program, Durability::Process);
    let records = RunJournal::read(&bytes).expect("it is whole").recorded.records;
    let beginning = journal_length_of_beginning(&bytes);
    let mut writer = RunJournal::read(&bytes[..beginning]).expect("it is whole").writer;
    writer.add(&records[0]);
    let upgraded = program.to_bytes().expect("it can be written");
    let mut journal = bytes[..beginning].to_vec();
    journal.extend(writer.take_upgrade(beginning as u64, &upgraded));
    let found = RunJournal::read(&journal).expect("it is whole");
    assert_eq!((found.upgrades.len(), found.recorded.records.len()), (1, 1));
    assert_eq!((found.upgrades[0].life, &found.upgrades[0].program), (1, &upgraded));
    let has_neither = |bytes: &[u8]| match RunJournal::read(bytes) {
        Ok(found) => found.upgrades.is_empty() && found.recorded.records.is_empty(),
        Err(_) => true,
    };
    for length in (beginning..journal.len()).step_by(5) {
        assert!(has_neither(&journal[..length]), "{length}");
        let mut flipped = journal.clone();
        flipped[length] ^= 16;
        assert!(has_neither(&flipped), "byte {length}");
    }
}

#[test]
fn a_bit_that_is_flipped_is_found() {
    let program = compiled(AGENT);
    for durability in [Durability::Process, Durability::Power] {
        let (bytes, ..) = whole(&program, durability);
        for bit in (0..bytes.len() * 8).step_by(11) {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(RunJournal::read(&flipped).is_err(), "bit {bit} of {}", bytes.len() * 8);
        }
    }
}

#[test]
fn no_journal_is_too_strange() {
    let program = compiled(AGENT);
    let (bytes, ..) = whole(&program, Durability::Power);
    let mut state = 1_u64;
    let mut next = |limit: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        usize::try_from(state >> 33).unwrap_or(0) % limit
    };
    let (mut read, mut refused) = (0, 0);
    for _ in 0..10_000 {
        let mut strange = bytes.clone();
        for _ in 0..=next(3) {
            let (at, length) = (next(strange.len().max(1)), next(64));
            let end = (at + length).min(strange.len());
            match next(5) {
                0 => strange.truncate(at.max(1)),
                _ if strange.is_empty() => break,
                1 => strange[at] = next(256) as u8,
                2 => strange[at..end].fill(0),
                3 => drop(strange.drain(at..end)),
                _ => {
                    let copied = strange[at..end].to_vec();
                    let to = next(strange.len());
                    drop(strange.splice(to..to, copied));
                }
            }
        }
        match RunJournal::read(&strange) {
            Ok(_) => read += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(read > 100 && refused > 1000, "{read} {refused}");
}

#[test]
fn another_program_is_refused_by_what_has_changed() {
    let (disk, device) = (MemoryDisk::default(), Device::default());
    disk.fail_after(6, Doing::Nothing);
    let program = compiled(AGENT);
    life(disk.clone(), &program, Durability::Process, &device).expect_err("the disk fails");
    disk.mend();
    let other = compiled(&AGENT.replace("(retry)", "(abort nil)"));
    let error = life(disk, &other, Durability::Process, &device).expect_err("it is another program");
    assert!(error.to_string().contains("another program: changed functions: ONCE; "), "{error}");
}

/// Prints the cost of a step, and the time that it takes to go on after so many.
#[test]
#[ignore = "figures, for a person"]
#[allow(clippy::print_stderr, reason = "figures, for a person")]
fn figures_of_steps() {
    let folder = std::env::temp_dir().join(format!("esl-durable-figures-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("there is room");
    let steps = |count: u64| {
        let text = "(esl::%define-host-function act (name) \"Performs an action.\" t)
             (dotimes (i COUNT) (act \"step\"))";
        compiled(&text.replace("COUNT", &count.to_string()))
    };
    for (durability, count) in [(Durability::Process, 20_000), (Durability::Power, 2_000)] {
        let mut took = Vec::new();
        for durable in [false, true] {
            let path = folder.join(format!("{durability:?}-{durable}"));
            let started = std::time::Instant::now();
            if durable {
                let disk = RealDisk::new(path.clone());
                life(disk, &steps(count), durability, &Device::default()).expect("it runs");
                let bytes = std::fs::metadata(&path).expect("it is there").len();
                eprintln!("{durability:?}: {} bytes a step", bytes / count);
            } else {
                let disk = MemoryDisk::default();
                life(disk, &steps(count), Durability::Process, &Device::default()).expect("it runs");
            }
            took.push(started.elapsed());
        }
        let of = |took: std::time::Duration| took.as_secs_f64() / count as f64 * 1e6;
        eprintln!(
            "{durability:?}: {:.2} µs a step, {:.2} µs with a disk in memory",
            of(took[1]),
            of(took[0])
        );
    }
    for count in [100_u64, 1_000, 10_000, 50_000] {
        let (disk, device) = (MemoryDisk::default(), Device::default());
        let program = steps(count);
        life(disk.clone(), &program, Durability::Process, &device).expect("it runs");
        let bytes = {
            let mut file = disk.lock();
            let bytes = file.bytes.as_mut().expect("it was written");
            // Without its end it is a run that was killed.
            let length = bytes.len() - 20;
            bytes.truncate(length);
            length
        };
        let started = std::time::Instant::now();
        life(disk, &program, Durability::Process, &device).expect("it goes on");
        eprintln!(
            "resume after {count} steps, {bytes} bytes: {:.1} ms",
            started.elapsed().as_secs_f64() * 1e3
        );
    }
    drop(std::fs::remove_dir_all(folder));
}
