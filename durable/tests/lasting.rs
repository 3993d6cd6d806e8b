//! Calls that last: the next process makes them again, and their objects stand in for those of the program.

use std::path::Path;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

use esl::host::{HostFailure, HostHandle, HostObject, HostRows, Inbox};
use esl::program::Source;
use esl_durable::{DurableEnding, DurableEngine, DurableOptions, DurableSettings, SnapshotEvery};

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
        let name = format!("esl-lasting-{}-{snapshots:?}", std::process::id());
        let folder = std::env::temp_dir().join(name.replace(['(', ')'], ""));
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
