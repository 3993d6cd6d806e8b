//! Calls that last: the next process makes them again, and their objects stand in for those of the program.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use esl::host::{HostFailure, HostHandle, HostObject, HostRows, Inbox, RealHost};
use esl::program::{self, Source, compile};
use esl_durable::{
    Disk, Downtime, DurableControl, DurableEnding, DurableEngine, DurableError, DurableOptions, DurableRun,
    DurableSettings, Rehearsal, SnapshotEvery, rehearse,
};
use esl_host::{CallEffect, HostFunction, HostOperation};
use esl_replay::RunSetup;
use esl_vm::vm::Config;

const PROGRAM: &str = "
(define-input order)
(defvar *side* (open-door \"side\"))
(defvar *front* (open-door \"front\"))
(defvar *room* (enter *front* \"kitchen\"))
(dolist (colour '(\"red\" \"blue\" \"red\"))
  (paint *side* colour))
(loop
  (case (wait-for-event order)
    (1 (handler-case (knock *front* *room*)
         (failure (failure) (tell (string (failure-cause failure))))))
    (2 (shut *front*) (tell \"shut\"))
    (3 (exit 3))))";

/// A door of the host, with its name.
struct Door(String);

impl HostObject for Door {
    const KIND: &'static str = "DOOR";
}

/// A room of the host, which is entered by a door.
struct Room(String);

impl HostObject for Room {
    const KIND: &'static str = "ROOM";
}

fn rows(inbox: &Inbox, told: Sender<String>) -> HostRows {
    static MADE: AtomicI64 = AtomicI64::new(0);
    let mut rows = HostRows::new(inbox);
    let say = told.clone();
    rows.at_once("OPEN-DOOR", ["name"], "Opens a door.", move |name: String| {
        say.send(format!("open {name}")).ok();
        Ok(HostHandle::new(MADE.fetch_add(1, Ordering::Relaxed), Door(name)))
    })
    .lasts();
    let say = told.clone();
    rows.at_once("ENTER", ["door", "name"], "Enters a room.", move |door: HostHandle<Door>, name: String| {
        say.send(format!("enter {name} by {}", door.0)).ok();
        Ok(HostHandle::new(MADE.fetch_add(1, Ordering::Relaxed), Room(name)))
    })
    .lasts();
    let say = told.clone();
    let paint = move |door: HostHandle<Door>, colour: String| {
        say.send(format!("paint {} {colour}", door.0)).ok();
        Ok(())
    };
    rows.at_once("PAINT", ["door", "colour"], "Paints a door.", paint).lasts();
    let say = told.clone();
    let knock = move |door: HostHandle<Door>, room: HostHandle<Room>| {
        say.send(format!("knock at {} of {}", door.0, room.0)).ok();
        Ok(())
    };
    rows.at_once("KNOCK", ["door", "room"], "Knocks.", knock);
    rows.at_once("SHUT", ["door"], "Shuts a door.", |_: HostHandle<Door>| Ok::<_, HostFailure>(())).closes();
    rows.at_once("TELL", ["text"], "Tells a text.", move |text: String| {
        told.send(text).ok();
        Ok(())
    });
    rows
}

/// Returns the place for a run, without what a process of the same number has left there.
fn fresh_folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("esl-{name}-{}", std::process::id()));
    drop(std::fs::remove_dir_all(&folder));
    folder
}

/// Runs the program in one process until the orders are carried out. Returns what the host was told.
fn process(folder: &Path, snapshots: SnapshotEvery, orders: &[i64]) -> Vec<String> {
    let (told, heard): (_, Receiver<String>) = channel();
    let durable = DurableOptions { snapshots, ..DurableOptions::default() };
    let settings = DurableSettings { durable, ..DurableSettings::default() };
    let source = Source::new("doors.esl", PROGRAM);
    let engine =
        DurableEngine::open(folder, &[source], settings, |inbox| rows(inbox, told)).expect("it can begin");
    let (handle, control) = (engine.handle(), engine.control());
    let running = std::thread::spawn(move || engine.run());
    let mut all = Vec::new();
    for &order in orders {
        while handle.try_signal("order", [order.into()]).is_err() {
            std::thread::yield_now();
        }
        // Each order but the last one tells of itself once.
        let mut is_done = order == 3;
        while !is_done {
            let text = heard.recv().expect("the run goes on");
            is_done = !["open", "enter", "paint"].iter().any(|word| text.starts_with(word));
            all.push(text);
        }
    }
    if !orders.contains(&3) {
        control.pause();
    }
    let ended = running.join().expect("it does not panic").expect("nothing is wrong");
    let expected = if orders.contains(&3) { DurableEnding::Ended(3) } else { DurableEnding::Paused };
    assert_eq!(ended, expected);
    all.extend(heard.try_iter());
    all
}

#[test]
fn calls_that_last_are_made_again_until_they_are_closed() {
    for snapshots in [SnapshotEvery::Never, SnapshotEvery::Bytes(1)] {
        let folder = fresh_folder("lasting");
        let open = ["open side", "open front", "enter kitchen by front"];
        let knock = "knock at front of kitchen";
        let all = |more: &[&'static str]| [&open, more].concat();
        let (red, blue) = ("paint side red", "paint side blue");
        assert_eq!(process(&folder, snapshots, &[1]), all(&[red, blue, red, knock]), "{snapshots:?}");
        // Of two equal calls that make nothing, the last one counts.
        assert_eq!(process(&folder, snapshots, &[1, 1]), all(&[blue, red, knock, knock]), "{snapshots:?}");
        assert_eq!(process(&folder, snapshots, &[1, 2]), all(&[blue, red, knock, "shut"]), "{snapshots:?}");
        // The room is closed with its door.
        let gone = ["open side", blue, red, "INTERRUPTED-BY-RESTART"];
        assert_eq!(process(&folder, snapshots, &[1, 3]), gone, "{snapshots:?}");
        std::fs::remove_dir_all(folder).expect("it is ours");
    }
}

/// Has another version of the program take the last stretch of the run of a folder.
fn rehearsed(folder: &Path, text: &str, back: Duration) -> Rehearsal {
    let form = |row: &esl::host::HostRow| {
        let (name, parameters, text) = (row.name, row.parameters.join(" "), row.documentation);
        format!("(esl::%define-host-function {name} ({parameters}) \"{text}\" NIL)\n")
    };
    let forms: String = rows(&Inbox::new(), channel().0).iter().map(form).collect();
    let sources = [Source::new("functions of the host", forms), Source::new("doors.esl", text)];
    let compiled = compile(&sources);
    let program = compiled.program.expect("it compiles");
    rehearse(folder, &program, &compiled.sources, back).expect("it runs").expect("it is another program")
}

#[test]
fn another_program_takes_the_past_of_a_run() {
    let folder = fresh_folder("rehearsed");
    let knock = "knock at front of kitchen";
    let heard = process(&folder, SnapshotEvery::Never, &[1, 1, 2]);
    assert!(heard.ends_with(&[knock, knock, "shut"].map(String::from)), "{heard:?}");
    // It announces itself, and leaves the door open.
    let with = |reaction: &str| PROGRAM.replace("(2 (shut *front*) (tell \"shut\"))", reaction);
    let text = with("(2 (handler-case (tell \"open\") (failure () nil)))");
    let whole = rehearsed(&folder, &text, Duration::from_secs(3600));
    assert!(whole.upgrade.is_none() && whole.ended.is_none() && whole.errors.is_empty(), "{whole:?}");
    assert_eq!((whole.arrivals, whole.alike, whole.others, whole.left_out), (3, 8, 1, 2), "{whole:?}");
    assert_eq!(whole.named[0].1, "(TELL \"open\")");
    let failing = rehearsed(&folder, &with("(2 (tell \"open\"))"), Duration::from_secs(3600));
    assert!(failing.ended == Some(1) && failing.errors.contains(":NOT-IN-THIS-WORLD"), "{failing:?}");
    let again = process(&folder, SnapshotEvery::Never, &[1]);
    assert_eq!(again.last().map(String::as_str), Some("INTERRUPTED-BY-RESTART"));
    let late = rehearsed(&folder, &text, Duration::from_millis(1));
    let upgrade = late.upgrade.expect("the run has begun before");
    assert!(upgrade.left_out.len() == 1 && upgrade.definitions == 0, "{upgrade:?}");
    std::fs::remove_dir_all(folder).expect("it is ours");
}

/// A file in memory. Its second part says whether all writes fail.
#[derive(Clone, Default)]
struct SmallDisk(Arc<Mutex<(Vec<u8>, bool)>>);

impl SmallDisk {
    fn lock(&self) -> MutexGuard<'_, (Vec<u8>, bool)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Vec<u8>)) -> io::Result<()> {
        let (bytes, fails) = &mut *self.lock();
        if *fails {
            return Err(io::ErrorKind::StorageFull.into());
        }
        change(bytes);
        Ok(())
    }
}

impl Disk for SmallDisk {
    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        Ok(Some(self.lock().0.clone()).filter(|bytes| !bytes.is_empty()))
    }

    fn create(&mut self, contents: &[u8]) -> io::Result<()> {
        self.change(|bytes| *bytes = contents.to_vec())
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.change(|bytes| bytes.truncate(usize::try_from(length).expect("it fits")))
    }

    fn append(&mut self, added: &[u8]) -> io::Result<()> {
        self.change(|bytes| bytes.extend_from_slice(added))
    }

    fn sync(&mut self) -> io::Result<()> {
        self.change(|_| ())
    }
}

/// The states that an operation has found and saved.
type Saved = Arc<Mutex<Vec<(Option<Vec<u8>>, bool, bool)>>>;

/// Runs a program whose operation saves two states, the second of which the disk may refuse.
fn saving_life(disk: &SmallDisk, is_refused: bool, saved: &Saved) -> Result<u8, DurableError> {
    let options = DurableOptions { downtime: Downtime::Stops, ..DurableOptions::default() };
    let run = DurableRun::on(Box::new(disk.clone()), options)?;
    let host = RealHost::new(Vec::new()).with_virtual_time().with_elapsed(run.elapsed());
    let mut machine = program::machine(Config::DEFAULT, Box::new(run.host(host))).expect("there is room");
    let (disk, saved, held) = (disk.clone(), saved.clone(), Mutex::new(None));
    let hold = HostFunction::Operation(Box::new(move |operation: HostOperation| {
        let found = operation.restore();
        let first = operation.save(b"one");
        if is_refused {
            disk.lock().1 = true;
        }
        let second = operation.save(b"two");
        saved.lock().unwrap_or_else(PoisonError::into_inner).push((found, first, second));
        if second {
            operation.complete(Vec::new());
        } else {
            // It stays under way until the process ends.
            *held.lock().unwrap_or_else(PoisonError::into_inner) = Some(operation);
        }
    }));
    machine.add_function_with("HOLD", hold, &[], CallEffect::Once);
    let source = Source::new("hold.esl", "(esl::%define-host-function hold () \"Holds.\" t) (hold)");
    let program = compile(&[source]).program.expect("it compiles");
    run.begin(&program, &RunSetup::default(), &machine)?;
    let main = program::begin(&mut machine, &program).expect("there is room");
    let outcome = machine.run(u64::MAX);
    run.check()?;
    run.control().begin_end();
    let summary = program::finish(&mut machine, main, outcome);
    run.end(&machine, summary.ended.exit_status())?;
    Ok(summary.ended.exit_status())
}

#[test]
fn a_state_that_cannot_be_kept_is_refused() {
    let (disk, saved) = (SmallDisk::default(), Saved::default());
    let error = saving_life(&disk, true, &saved).expect_err("the disk fails");
    assert!(matches!(error, DurableError::NotWritten(_)), "{error}");
    disk.lock().1 = false;
    assert_eq!(saving_life(&disk, false, &saved).expect("it goes on"), 0);
    let saved = saved.lock().unwrap_or_else(PoisonError::into_inner);
    assert_eq!(*saved, [(None, true, false), (Some(b"one".to_vec()), true, true)]);
}

/// A disk on which each snapshot is asked for in vain, and pauses the run meanwhile.
struct PausingDisk(SmallDisk, Arc<OnceLock<DurableControl>>, Arc<AtomicI64>);

impl Disk for PausingDisk {
    fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        self.0.read()
    }

    fn create(&mut self, contents: &[u8]) -> io::Result<()> {
        self.0.create(contents)
    }

    fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.0.truncate(length)
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.append(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.sync()
    }

    fn begin_generation(&mut self, _number: u64, _contents: &[u8]) -> io::Result<()> {
        self.2.fetch_add(1, Ordering::Relaxed);
        self.1.get().map(DurableControl::pause);
        Err(io::ErrorKind::StorageFull.into())
    }

    fn remove_generation(&mut self, _number: u64) -> io::Result<()> {
        Ok(())
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_pause_during_a_snapshot_and_a_long_operation_that_saves() {
    let (control, asked) = (Arc::<OnceLock<DurableControl>>::default(), Arc::<AtomicI64>::default());
    let disk = PausingDisk(SmallDisk::default(), control.clone(), asked.clone());
    let options = DurableOptions { snapshots: SnapshotEvery::Bytes(100_000), ..DurableOptions::default() };
    let run = DurableRun::on(Box::new(disk), options).expect("it is new");
    control.set(run.control()).ok().expect("it was not set");
    let host = RealHost::new(Vec::new()).with_elapsed(run.elapsed());
    let config = run.config(Config::DEFAULT);
    let mut machine = program::machine(config, Box::new(run.host(host))).expect("there is room");
    // The program waits for the operation alone, which saves states for ever.
    let hold = HostFunction::Operation(Box::new(move |operation: HostOperation| {
        std::thread::spawn(move || while operation.save(&[7; 10_000]) && !operation.is_cancelled() {});
    }));
    machine.add_function_with("HOLD", hold, &[], CallEffect::Once);
    let source = Source::new("hold.esl", "(esl::%define-host-function hold () \"Holds.\" t) (hold)");
    let program = compile(&[source]).program.expect("it compiles");
    run.begin(&program, &RunSetup::default(), &machine).expect("there is room");
    program::begin(&mut machine, &program).expect("there is room");
    run.take_snapshots(&mut machine);
    machine.run(u64::MAX);
    assert!(run.control().begin_end(), "it was paused");
    run.pause(&machine).expect("there is room");
    assert!((1..=2).contains(&asked.load(Ordering::Relaxed)));
}
