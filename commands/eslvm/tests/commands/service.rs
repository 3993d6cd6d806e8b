//! A run as a service of systemd, of which the test has the socket.

use std::os::unix::net::UnixDatagram;

use esl_conformance::folder::Folder;
use esl_conformance::process::{PATIENCE, finish, start};

use crate::eslvm;

/// The socket of a service manager.
struct Manager(UnixDatagram);

impl Manager {
    fn new(folder: &Folder) -> Manager {
        let socket = UnixDatagram::bind(folder.join("notify")).expect("a socket can be made");
        socket.set_read_timeout(Some(PATIENCE)).expect("it can be set");
        Manager(socket)
    }

    fn news(&self) -> String {
        let mut bytes = [0; 1000];
        let length = self.0.recv(&mut bytes).expect("the run tells something");
        String::from_utf8(bytes[..length].into()).expect("it is text")
    }
}

#[test]
fn a_manager_hears_of_the_beginning_and_the_end() {
    let folder =
        Folder::with("service", &[("rover.esl", "(read-line *standard-input* nil) (princ \"over\")")]);
    let manager = Manager::new(&folder);
    let program = folder.join("rover.esl");
    let mut command = eslvm(&["run", &program]);
    let mut child = start(command.env("NOTIFY_SOCKET", folder.join("notify")).env_remove("WATCHDOG_USEC"));
    let ready = manager.news();
    assert_eq!(ready, format!("READY=1\nSTATUS=rover.esl runs\nMAINPID={}", child.id()));
    drop(child.stdin.take());
    assert_eq!(manager.news(), "STOPPING=1");
    let finished = finish(child);
    assert_eq!((finished.status, &*finished.output), (Some(0), "over"), "{}", finished.errors);
}

#[test]
fn a_manager_hears_that_the_machine_lives_as_long_as_it_does() {
    // It waits, then computes, then waits for its input.
    let text = "(sleep 0.3)
                (let ((end (+ (now) 0.3))) (loop while (< (now) end)))
                (read-line *standard-input* nil)";
    let folder = Folder::with("service-watched", &[("rover.esl", text)]);
    let manager = Manager::new(&folder);
    let program = folder.join("rover.esl");
    let mut command = eslvm(&["run", &program]);
    command.env("NOTIFY_SOCKET", folder.join("notify")).env("WATCHDOG_USEC", "60000");
    let mut child = start(command.env_remove("WATCHDOG_PID"));
    assert!(manager.news().starts_with("READY=1\n"));
    for _ in 0..10 {
        assert_eq!(manager.news(), "WATCHDOG=1");
    }
    drop(child.stdin.take());
    // Other signs of life come before the end.
    while manager.news() != "STOPPING=1" {}
    assert_eq!(finish(child).status, Some(0));
}

#[test]
fn a_manager_that_cannot_be_reached_is_an_error() {
    let folder = Folder::with("service-gone", &[("rover.esl", "(princ \"runs\")")]);
    let mut command = eslvm(&["run", &folder.join("rover.esl")]);
    let finished = finish(start(command.env("NOTIFY_SOCKET", folder.join("gone"))));
    assert_eq!((finished.status, &*finished.output), (Some(2), ""));
    assert!(finished.errors.contains("the service manager that NOTIFY_SOCKET names cannot be told: "));
}
