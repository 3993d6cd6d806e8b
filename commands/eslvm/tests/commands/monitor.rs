//! The monitor, as browsers see it that mean well, and as others do.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};

use esl_conformance::folder::Folder;
use esl_conformance::process::PATIENCE;
use serde_json::{Value, json};

use crate::operate::{Operated, request, until};

/// A program with tasks that wait for each other, a failure, and data; it waits for the end of its input.
const PROGRAM: &str = "
(define-property mode ())
(define-input news :capacity 2)
(define-resource arm)
(define-resource leg)
(defvar *seen* nil)
(spawn (:name 'left :daemon t) (with-resource (arm) (sleep 0.1) (with-resource (leg) (print 'never))))
(spawn (:name 'right :daemon t) (with-resource (leg) (sleep 0.1) (with-resource (arm) (print 'freed))))
(spawn (:name 'listener :daemon t) (loop (push (multiple-value-list (wait-for-event news)) *seen*)))
(spawn (:name 'slipper :daemon t) (fail :slip 3))
(assert '(mode calm))
(assert '(note \"<b>&\"))
(read-line *standard-input* nil)
(format t \"~s~%\" *seen*)";

/// Addresses of a monitor: of the server, and the tokens to observe and to command.
struct WatchedRun {
    run: Operated,
    address: String,
    observe: String,
    command: String,
}

fn watch(folder: &Folder, program: &str) -> WatchedRun {
    let mut run = Operated::start(folder, program, &["--monitor"]);
    let observe = run.said("; monitor, to observe: http://");
    let command = run.said("; monitor, to command: http://");
    let (address, observe) = observe.split_once("/#token=").expect("there is a token");
    let (_, command) = command.split_once("/#token=").expect("there is a token");
    WatchedRun { address: address.into(), observe: observe.into(), command: command.into(), run }
}

/// A viewer that receives events.
struct Viewer(BufReader<TcpStream>);

impl Viewer {
    fn come(address: &str, token: &str, name: &str) -> Viewer {
        let mut stream = TcpStream::connect(address).expect("the monitor listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
        let request = format!("GET /events?token={token}&viewer={name} HTTP/1.1\r\nHost: {address}\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("it is taken");
        Viewer(BufReader::new(stream))
    }

    /// Comes when those before have left room.
    fn come_in(address: &str, token: &str, name: &str) -> Viewer {
        let mut found = None;
        until("room for a viewer", || {
            let mut viewer = Viewer::come(address, token, name);
            let mut line = String::new();
            let is_in = viewer.0.read_line(&mut line).is_ok() && line.starts_with("HTTP/1.1 200");
            found = is_in.then_some(viewer);
            found.is_some()
        });
        found.expect("it has come in")
    }

    /// Takes an event. Returns false if there are no more.
    fn goes_on(&mut self) -> bool {
        let mut line = String::new();
        while self.0.read_line(&mut line).is_ok_and(|read| read > 0) {
            if line.starts_with("data: ") {
                return true;
            }
            line.clear();
        }
        false
    }

    /// Returns the next event.
    fn next(&mut self) -> Value {
        loop {
            let mut line = String::new();
            assert!(self.0.read_line(&mut line).expect("the events go on") > 0, "the events end");
            if let Some(text) = line.strip_prefix("data: ") {
                return serde_json::from_str(text).expect("it is JSON");
            }
        }
    }

    /// Returns the first event for which a condition is true.
    fn until(&mut self, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let mut found = Value::Null;
        until(what, || {
            found = self.next();
            holds(&found)
        });
        found
    }
}

fn post(address: &str, path: &str, token: &str, body: &str) -> String {
    let headers = format!("Origin: http://{address}\r\nAuthorization: Bearer {token}\r\n");
    request(address, "POST", path, &headers, body)
}

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or_default()
}

fn row<'a>(event: &'a Value, name: &str) -> Option<&'a Value> {
    event["rows"].as_array()?.iter().find(|row| row["name"] == name)
}

/// Pictures come only to those who look at them, one that cannot be drawn leaves the others, and a run that
/// deadlocks does so beside them.
#[test]
fn a_viewer_sees_the_pictures_of_the_program() {
    let program = "
(define-cause :no-map ())
(defvar *drawn* 0)
(define-picture map (format nil \"<svg id='~d'/>\" (incf *drawn*)))
(define-picture plan (fail :no-map))
(define-picture endless (loop))
(define-picture slow (sleep 1000))
(define-picture none nil)
(define-picture both (list \"<svg/>\" 3 \"<svg></svg>\"))
(read-line *standard-input* nil)
(print (plusp *drawn*))";
    let folder = Folder::new("monitor_pictures");
    let WatchedRun { run, address, observe, .. } = watch(&folder, program);
    let mut viewer = Viewer::come(&address, &observe, "one");
    assert!(viewer.next()["pictures"].is_null());
    let view = r#"{"viewer":"one","count":50,"pictures":true}"#;
    assert_eq!(status(&post(&address, "/view", &observe, view)), "200");
    let event = viewer.until("the pictures", |event| event["pictures"].is_array());
    let expected = json!([
        { "name": "map", "texts": ["<svg id='1'/>"], "failure": null },
        { "name": "plan", "texts": [], "failure": "A failure of cause :NO-MAP." },
        { "name": "endless", "texts": [], "failure": "A failure of cause :BUDGET-EXHAUSTED." },
        { "name": "slow", "texts": [], "failure": "A failure of cause :TIMEOUT." },
        { "name": "none", "texts": [], "failure": null },
        { "name": "both", "texts": ["<svg/>", "<svg></svg>"], "failure": null },
    ]);
    assert_eq!(event["pictures"], expected);
    viewer.until("a later picture", |event| event["pictures"][0]["texts"][0] == "<svg id='2'/>");
    drop(viewer);
    assert_eq!(run.finish().output.trim(), "T");
}

#[test]
fn a_viewer_sees_the_run_and_commands_it() {
    let folder = Folder::new("monitor_viewer");
    let WatchedRun { run, address, observe, command } = watch(&folder, PROGRAM);
    let mut viewer = Viewer::come(&address, &command, "one");
    let event = viewer.until("a circle of waits", |event| event["cycle"] == 2);
    let (left, right) =
        (row(&event, "task LEFT").expect("it is there"), row(&event, "task RIGHT").expect("it is there"));
    assert_eq!(left["holders"][0][0], right["n"]);
    assert!(left["cycle"] == true && event["role"] == "command", "{event}");
    assert!(event["relations"].as_array().is_some_and(|rows| rows.iter().any(|row| row["name"] == "MODE")));
    // Each viewer has a view of its own.
    let number = left["n"].as_u64().expect("it has a number");
    let view = format!(
        "{{\"viewer\":\"one\",\"text\":\"left\",\"from\":0,\"count\":50,\"task\":{number},\"relation\":\"NOTE\"}}"
    );
    assert_eq!(status(&post(&address, "/view", &command, &view)), "200");
    let event =
        viewer.until("the frames", |event| event["task"]["frames"].as_array().is_some_and(|f| !f.is_empty()));
    // The task, and the other one that waits for it.
    assert!(row(&event, "task LISTENER").is_none() && event["matching"] == 2, "{event}");
    assert_eq!(event["facts_shown"]["facts"][0], "(NOTE \"<b>&\")");
    let mut observer = Viewer::come(&address, &observe, "two");
    let event =
        observer.until("the failure", |event| !event["failures"].as_array().is_some_and(Vec::is_empty));
    assert!(
        event["failures"][0]["cause"] == ":SLIP" && event["failures"][0]["report"].is_string(),
        "{event}"
    );
    assert!(event["matching"].as_u64() > Some(2) && event["role"] == "observe", "{event}");
    // The role `observe` permits no commands.
    let abort = format!("{{\"action\":\"abort\",\"task\":{number}}}");
    assert_eq!(status(&post(&address, "/do", &observe, &abort)), "403");
    let signal =
        "{\"action\":\"signal\",\"input\":\"news\",\"data\":\"1 (\\\"x\\\" mode) 2.5 :not-known-here\"}";
    assert_eq!(status(&post(&address, "/do", &command, signal)), "409", "there is no such keyword yet");
    assert_eq!(status(&post(&address, "/do", &command, &signal.replace(":not-known-here", "nil"))), "200");
    for wrong in
        ["{\"action\":\"signal\",\"input\":\"none\"}", "{\"action\":\"abort\"}", "{\"action\":\"quit\"}", "7"]
    {
        assert_eq!(status(&post(&address, "/do", &command, wrong)), "409", "{wrong}");
    }
    let act = |action: &str| {
        post(&address, "/do", &command, &format!("{{\"action\":\"{action}\",\"task\":{number}}}"))
    };
    assert_eq!(status(&act("suspend")), "200");
    observer.until("a suspended task", |event| {
        row(event, "task LEFT").is_some_and(|row| row["state"] == "suspended")
    });
    assert_eq!(status(&act("resume")), "200");
    assert_eq!(status(&act("pause")), "200");
    observer.until("a pause", |event| event["paused"] == true);
    assert_eq!(status(&act("continue")), "200");
    assert_eq!(status(&act("abort")), "200");
    let event = observer.until("the end of the task", |event| row(event, "task LEFT").is_none());
    assert_eq!(event["cycle"], 0);
    assert_eq!(run.finish().output, "\nFREED ((1 (\"x\" MODE) 2.5 NIL))\n");
}

#[test]
fn others_are_turned_away() {
    let folder = Folder::new("monitor_others");
    let WatchedRun { run, address, observe, .. } = watch(&folder, "(read-line *standard-input* nil)");
    let page = request(&address, "GET", "/", "", "");
    assert_eq!(status(&page), "200");
    let (head, body) = page.split_once("\r\n\r\n").expect("it has a body");
    let nonce = body
        .split("<script nonce=\"")
        .nth(1)
        .and_then(|rest| rest.split('"').next())
        .expect("it has a script");
    assert!(
        head.contains(&format!("script-src 'nonce-{nonce}'")) && head.contains("default-src 'none'"),
        "{head}"
    );
    assert!(!body.contains("NONCE") && !body.contains("https://") && !page.contains(&observe));
    let events = |token: &str, viewer: &str, headers: &str| {
        let path = format!("/events?token={token}&viewer={viewer}");
        status(&request(&address, "GET", &path, headers, "")).to_string()
    };
    assert_eq!(events("", "v", ""), "401");
    assert_eq!(events(&observe[1..], "v", ""), "401");
    assert_eq!(events(&observe, "v", "Origin: http://evil.example\r\n"), "403");
    assert_eq!(events(&observe, "v", "Host: evil.example\r\n"), "421");
    assert_eq!(events(&observe, "v%20w", ""), "400");
    let do_it =
        |headers: &str, body: &str| status(&request(&address, "POST", "/do", headers, body)).to_string();
    let own = format!("Origin: http://{address}\r\n");
    let bearer = format!("Authorization: Bearer {observe}\r\n");
    assert_eq!(do_it(&bearer, "{}"), "403", "without an origin");
    assert_eq!(do_it(&format!("{bearer}Origin: http://evil.example\r\n"), "{}"), "403");
    assert_eq!(do_it(&own, "{}"), "401");
    assert_eq!(do_it(&format!("{own}Authorization: Bearer x\r\n"), "{}"), "401");
    assert_eq!(do_it(&format!("{own}{bearer}"), "{"), "400");
    assert_eq!(do_it(&format!("{own}{bearer}"), &"[".repeat(5000)), "400");
    assert_eq!(status(&request(&address, "DELETE", "/", "", "")), "405");
    assert_eq!(status(&request(&address, "GET", "/task/1", "", "")), "404");
    assert_eq!(run.end(), Some(0));
}

#[test]
fn viewers_come_and_go() {
    let folder = Folder::new("monitor_viewers");
    let WatchedRun { run, address, observe, .. } = watch(&folder, "(read-line *standard-input* nil)");
    // More than there is room for at a time: each leaves room for the next.
    for round in 0..40 {
        drop(Viewer::come_in(&address, &observe, &format!("v{round}")));
    }
    // A viewer whose connection is lost comes again under its name, whatever has become of the last one.
    for _ in 0..1000 {
        drop(Viewer::come(&address, &observe, "same"));
    }
    until("a viewer who is not taken for one of those before", || {
        let mut viewer = Viewer::come_in(&address, &observe, "same");
        (0..5).all(|_| viewer.goes_on())
    });
    // Viewers that stop reading do not keep others from being served.
    let stalled: Vec<Viewer> =
        (0..3).map(|i| Viewer::come_in(&address, &observe, &format!("s{i}"))).collect();
    let mut viewer = Viewer::come_in(&address, &observe, "last");
    for _ in 0..3 {
        assert_eq!(viewer.next()["standings"]["stream"], 1);
    }
    drop(stalled);
    assert_eq!(run.end(), Some(0));
}

/// A viewer whose browser takes nothing is let go, and its place is free; others see on.
#[test]
fn a_viewer_who_takes_nothing_is_let_go() {
    let folder = Folder::new("monitor_stalled");
    let program = "(defvar *never* (make-event))
        (dotimes (i 200)
          (spawn (:daemon t :name (intern (format nil \"~a~a\" (make-string 1000 :initial-element #\\n) i)))
            (wait-for-event *never*)))
        (read-line *standard-input* nil)";
    let WatchedRun { run, address, observe, .. } = watch(&folder, program);
    let mut viewer = Viewer::come(&address, &observe, "awake");
    viewer.until("all tasks", |event| event["total"] == 201);
    let stalled = Viewer::come_in(&address, &observe, "stalled");
    // Each change of a view sends an event at once, until the buffers of a connection that is not read are
    // full.
    let view = "{\"viewer\":\"stalled\",\"text\":\"\",\"from\":0,\"count\":120}";
    let gone = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            until("the end of a viewer who takes nothing", || {
                status(&post(&address, "/view", &observe, view)) == "409"
            });
            gone.store(true, Ordering::Relaxed);
        });
        let mut seen = 0;
        while !gone.load(Ordering::Relaxed) {
            assert!(viewer.goes_on(), "the other viewer is served");
            seen += 1;
        }
        assert!(seen > 3, "{seen} events");
    });
    drop(Viewer::come_in(&address, &observe, "stalled"));
    drop(stalled);
    assert_eq!(run.end(), Some(0));
}

#[test]
fn many_tasks_are_shown_by_windows() {
    let folder = Folder::new("monitor_many");
    let program = "(defvar *never* (make-event))
        (dotimes (i 20000) (spawn (:daemon t) (wait-for-event *never*)))
        (read-line *standard-input* nil)";
    let WatchedRun { run, address, observe, .. } = watch(&folder, program);
    let mut viewer = Viewer::come(&address, &observe, "one");
    let event = viewer.until("all tasks", |event| event["total"] == 20_001);
    assert!(event["rows"].as_array().is_some_and(|rows| rows.len() <= 120));
    let view = "{\"viewer\":\"one\",\"text\":\"\",\"from\":19990,\"count\":50}";
    assert_eq!(status(&post(&address, "/view", &observe, view)), "200");
    let event = viewer.until("the last rows", |event| event["from"] == 19_990);
    assert_eq!(event["rows"].as_array().map(Vec::len), Some(11));
    assert_eq!(run.end(), Some(0));
}
