//! Snapshots of machines, restored in other machines: the run goes on as it would have, to the tick.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use esl::program::{self, Program, Source, compile};
use esl_host::{CallEffect, HostFunction, RecordingHost, ReplayHost, RunCheck, VirtualHost};
use esl_replay::{Beginning, RunSetup, beginning, prepare_recorded};
use esl_vm::heap::range_start;
use esl_vm::stored::MachineState;
use esl_vm::vm::{Config, Vm};

/// A program with tasks, waits, cleanups, recovery procedures, facts, tables, operations and much garbage.
const AGENT: &str = r#"
(esl::%define-host-function look-up (name) "Returns nothing." t)
(define-input *resumed*)
(defstruct place (name nil) (links nil))
(defvar *total* 0)
(defvar *table* (make-hash-table :test #'equal))
(defvar *big* (make-array 40000 :initial-element 0))
(defvar *done* (make-event 'done))
(define-rule (linked ?a ?b) (link ?a ?b))
(define-rule (linked ?a ?c) (and (link ?a ?b) (linked ?b ?c)))
(defun build (n)
  (let ((*total* n) (list nil))
    (dotimes (i n)
      (push (make-place :name (format nil "place-~d" i) :links list) list)
      (setf (gethash (list i 'key) *table*) (expt 7 (mod i 60)))
      (setf (aref *big* (mod (* i 37) 40000)) (list i (/ i 7) (* i 1.5d0)))
      (when (> (hash-table-count *table*) 200) (clrhash *table*)))
    (length list)))
(defun risky (i)
  (with-recovery-procedures ((:flaky (abort (list 'recovered i))))
    (unwind-protect (if (oddp i) (fail :flaky i) i)
      (sleep 0.01)
      (assert (list 'tidied i)))))
(task-net
  (one (dotimes (i 12) (build 900) (incf *total*) (sleep 0.05)))
  (two (dotimes (i 6)
         (assert (list 'link i (1+ i)))
         (assert (list 'result (risky i)))
         (princ (length (db-query (list 'linked 0 '?x))))))
  (three (with-input-from-string (in "one two three")
           (dotimes (i 3) (assert (list 'read (read in))) (sleep 0.03)))
         (signal *done* 1 2 3))
  (four (multiple-value-bind (a b c) (wait-for-event *done*) (format t "~a ~a ~a" a b c)))
  (five (with-recovery-procedures ((t (abort nil))) (look-up "thing"))))
(format t "over ~d ~a ~d~%" *total* (now) (length (db-query '(result ?x))))
"#;

/// A run that was recorded.
struct RecordedRun {
    program: Program,
    beginning: Beginning,
    records: Arc<[esl_host::NotedRecord]>,
    status: u8,
    check: RunCheck,
    rounds: u64,
}

fn give_functions(machine: &mut Vm) {
    // The operation ends when the machine hears of it, which is at once.
    let complete = HostFunction::Operation(Box::new(|operation| operation.complete(Vec::new())));
    machine.add_function_with("LOOK-UP", complete, &[], CallEffect::Idempotent);
}

/// Records a run in a virtual world; `None` if it does not end in time.
fn record(text: &str, name: &str, slice: u32) -> Option<RecordedRun> {
    let program = compile(&[Source::new(name, text)]).program?;
    let config = Config { slice, budget: Some(3_000_000), memory: 64 << 20, ..Config::DEFAULT };
    let host = RecordingHost::new(VirtualHost::new());
    let recording = host.recording();
    let mut machine = program::machine(config.clone(), Box::new(host)).ok()?;
    give_functions(&mut machine);
    let setup = RunSetup { config, ..RunSetup::default() };
    let beginning = beginning(&program, &setup, &machine).ok()?;
    let rounds = Arc::new(Mutex::new(0_u64));
    let counted = rounds.clone();
    program::set_module_folders(&mut machine, &[]).ok()?;
    let main = program::begin(&mut machine, &program).ok()?;
    machine.on_round(move |_| *counted.lock().unwrap_or_else(PoisonError::into_inner) += 1);
    let outcome = machine.run(u64::MAX);
    let summary = program::finish(&mut machine, main, outcome);
    let rounds = *rounds.lock().unwrap_or_else(PoisonError::into_inner);
    let (status, check) = (summary.ended.exit_status(), machine.check());
    let records = recording.to_records().into();
    Some(RecordedRun { program, beginning, records, status, check, rounds })
}

/// A state that was stored, with the state of the host and the fingerprint at that time.
struct StoredAt {
    state: MachineState,
    fingerprint: u128,
    replayed: usize,
    not_due: u64,
    time: u64,
}

/// Runs the run again, and stores its state at these rounds. Returns the states.
fn store_at(run: &RecordedRun, range: usize, rounds: Vec<u64>) -> Vec<StoredAt> {
    let host = ReplayHost::new(run.records.clone()).with_screen(|_, _| ());
    let machine = prepare_recorded(&run.beginning, Some(range), Box::new(host.clone()));
    let mut machine = machine.expect("there is room");
    assert_eq!(machine.heap_range(), Some(range));
    let main = program::begin(&mut machine, &run.program).expect("there is room");
    let stored = Arc::new(Mutex::new(Vec::new()));
    let (kept, asked, mut round) = (stored.clone(), host.clone(), 0);
    machine.on_round(move |machine| {
        round += 1;
        if rounds.binary_search(&round).is_ok()
            && let Some(state) = machine.store_state()
        {
            let (replayed, not_due) = (asked.replayed(), asked.not_due());
            let (fingerprint, time) = (machine.fingerprint(), machine.last_time());
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            kept.push(StoredAt { state, fingerprint, replayed, not_due, time });
        }
    });
    let outcome = machine.run(u64::MAX);
    let summary = program::finish(&mut machine, main, outcome);
    assert_eq!(host.divergence().map(|divergence| divergence.to_string()), None);
    assert_eq!((summary.ended.exit_status(), machine.check()), (run.status, run.check));
    std::mem::take(&mut *stored.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Goes on from a state in a machine of its own, and checks that it comes to the end of the run.
fn go_on(run: &RecordedRun, range: usize, at: &StoredAt, name: &str) {
    let host = ReplayHost::preparing(&run.records[at.replayed..]).with_screen(|_, _| ());
    let machine = prepare_recorded(&run.beginning, Some(range), Box::new(host.clone()));
    let mut machine = machine.expect("there is room");
    assert_eq!(machine.heap_range(), Some(range), "{name}");
    assert!(machine.load_state(&at.state), "{name}");
    // The fingerprint comes later: it looks up names, which is noted.
    assert!(machine.store_state().as_ref() == Some(&at.state), "{name}: its state is another one");
    assert_eq!(machine.fingerprint(), at.fingerprint, "{name}");
    let main = machine.main_task().expect("the program has begun");
    host.start(at.not_due, at.time);
    let outcome = machine.run(u64::MAX);
    let summary = program::finish(&mut machine, main, outcome);
    assert_eq!(host.divergence().map(|divergence| divergence.to_string()), None, "{name}");
    assert_eq!((summary.ended.exit_status(), machine.check()), (run.status, run.check), "{name}");
}

/// Stores and restores a run at `count` of its rounds. Returns at how many that was possible.
fn check(text: &str, name: &str, slice: u32, count: u64, chance: u64) -> Option<usize> {
    let run = record(text, name, slice)?;
    let step = (run.rounds / count).max(1);
    let rounds: Vec<u64> = (1..=run.rounds).filter(|round| round % step == chance % step).collect();
    let range = range_start(chance).expect("the system has 64 bits");
    let stored = store_at(&run, range, rounds);
    stored.iter().for_each(|at| go_on(&run, range, at, name));
    Some(stored.len())
}

#[test]
#[cfg(target_os = "linux")]
fn a_machine_goes_on_from_a_state_as_it_would_have() {
    for (slice, count) in [(2000, 12), (7, 8), (1, 6)] {
        let stored = check(AGENT, "agent.esl", slice, count, 11 + u64::from(slice));
        assert!(stored.is_some_and(|stored| stored >= count as usize / 2), "{slice}: {stored:?}");
    }
}

/// The note that a spent account ends a slice was left to the slice after it, in another task too.
#[test]
#[cfg(target_os = "linux")]
fn a_slice_whose_account_is_spent_leaves_nothing_to_the_next() {
    let name = "coordination/a_quota_ends_what_exceeds_it.esl";
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../conformance/programs");
    let text = std::fs::read_to_string(folder.join(name)).expect("it is there");
    let run = record(&text, name, 1).expect("it ends");
    let range = range_start(4321).expect("the system has 64 bits");
    let stored = store_at(&run, range, (1070..1090).collect());
    assert!(stored.len() >= 10, "{}", stored.len());
    stored.iter().for_each(|at| go_on(&run, range, at, name));
}

#[test]
fn a_machine_without_a_range_has_no_state() {
    let mut machine = program::machine(Config::DEFAULT, Box::new(VirtualHost::new())).expect("there is room");
    assert!(machine.store_state().is_none());
}

fn programs(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("it is there")
        .map(|entry| entry.expect("it can be read").path())
        .collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            programs(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "esl") {
            found.push(path);
        }
    }
}

/// Stores and restores every so-manieth conformance program under these slices.
#[allow(clippy::print_stderr, reason = "figures, for a person")]
fn check_programs(every: usize, slices: &[u32], count: u64) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../conformance/programs");
    let mut found = Vec::new();
    programs(&folder, &mut found);
    let (mut checked, mut states) = (0, 0);
    for (number, path) in found.iter().enumerate().step_by(every) {
        let Ok(text) = std::fs::read_to_string(path) else { continue };
        let name = path.to_string_lossy();
        for &slice in slices {
            let stored = check(&text, &name, slice, count, 1000 + (number % 5000) as u64);
            checked += usize::from(stored.is_some());
            states += stored.unwrap_or(0);
        }
    }
    eprintln!("{checked} runs, {states} states");
    assert!(checked > 10 && states > checked);
}

#[test]
#[cfg(target_os = "linux")]
fn conformance_programs_go_on_from_their_states() {
    check_programs(61, &[7], 3);
}

#[test]
#[ignore = "all programs, which takes long"]
#[cfg(target_os = "linux")]
fn all_conformance_programs_go_on_from_their_states() {
    check_programs(1, &[1, 7, 2000], 4);
}
