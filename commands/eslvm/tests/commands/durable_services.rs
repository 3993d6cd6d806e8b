//! Servers, clients and subscriptions of durable runs, which the next process opens again.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use esl_conformance::process;

use crate::durable::Agent;
use crate::eslvm;
use crate::examples::free_port;
use crate::mqtt::{start_broker_at, with_broker};
use crate::operate::request;

/// Returns the answer to a request, which waits until somebody listens.
fn answer(port: u16) -> String {
    let address = format!("127.0.0.1:{port}");
    let begun = Instant::now();
    while TcpStream::connect(&address).is_err() {
        assert!(begun.elapsed() < process::PATIENCE, "nobody listens");
        std::thread::sleep(Duration::from_millis(5));
    }
    let text = request(&address, "GET", "/", "", "");
    text.rsplit("\r\n").next().unwrap_or_default().to_owned()
}

#[test]
fn a_server_listens_again_in_the_next_process() {
    let port = free_port();
    let text = format!(
        "(require :http)
(defvar *count* 0)
(http:with-server ({port})
  (:get \"/\" () (format nil \"~d\" (incf *count*))))"
    );
    let agent = Agent::new("durable-server", &text);
    // From the journal, and from a snapshot.
    for (options, answers) in
        [(&[][..], ["1", "2"]), (&["--snapshot-every", "1ms"], ["3", "4"]), (&[], ["5", "6"])]
    {
        let mut all = vec!["--allow-net"];
        all.extend(options);
        let running = agent.start(&all);
        assert_eq!([answer(port), answer(port)], answers);
        running.send("-KILL");
        let (_, errors) = running.end();
        assert_eq!(errors.contains("opened again"), answers[0] != "1", "{errors}");
    }
    // Without the right, the run goes on, and says why nobody listens.
    let mut child = agent.command(&[]).spawn().expect("the command is there");
    let lines = BufReader::new(child.stderr.take().expect("it is a pipe")).lines();
    let mut lines = lines.map_while(Result::ok);
    let refused = "a call of %HTTP-LISTEN from an earlier process has failed in this one: NOT-PERMITTED";
    assert!(lines.any(|line| line.contains(refused)));
    drop(child.kill());
    drop(child.wait());
}

#[test]
fn a_client_of_a_broker_connects_and_subscribes_again() {
    let Some((folder, broker, port)) = with_broker("durable-mqtt", "") else { return };
    let text = format!(
        "(require :mqtt)
(defvar *sum* 0)
(mqtt:with-client (client \"127.0.0.1\" {port})
  (let ((numbers (mqtt:subscribe client \"number\" :qos 1)) (others (mqtt:subscribe client \"other\")))
    (format t \"begun~%\")
    (finish-output)
    (loop
      (incf *sum* (parse-integer (nth-value 1 (wait-for-event numbers))))
      (mqtt:publish client \"sum\" (format nil \"~d\" *sum*) :qos 1 :retain t)
      (format t \"sum ~d~%\" *sum*)
      (finish-output))))"
    );
    let agent = Agent::new("durable-client", &text);
    // The broker keeps a message for those that subscribe again.
    let publish = |number: &str| {
        let text = format!(
            "(require :mqtt)
(mqtt:with-client (client \"127.0.0.1\" {port})
  (mqtt:publish client \"number\" \"{number}\" :qos 1 :retain t))"
        );
        folder.file("publish.esl", text);
        let mut command = eslvm(&["run", "--allow-net", "publish.esl"]);
        let done = process::run(command.current_dir(folder.path()), "");
        assert_eq!((done.status, &*done.errors), (Some(0), ""));
    };
    let mut running = agent.start(&["--allow-net"]);
    running.wait_for("begun");
    publish("5");
    running.wait_for("sum 5");
    running.send("-KILL");
    running.end();
    publish("7");
    let mut running = agent.start(&["--allow-net", "--snapshot-every", "1ms"]);
    running.wait_for("sum 12");
    publish("30");
    running.wait_for("sum 42");
    running.send("-KILL");
    running.end();
    // While there is no broker, it is tried again.
    drop(broker);
    let mut child = agent.command(&["--allow-net"]).spawn().expect("the command is there");
    let mut lines = BufReader::new(child.stderr.take().expect("it is a pipe")).lines().map_while(Result::ok);
    let refused = "a call of %MQTT-OPEN from an earlier process has failed in this one: CONNECTION-REFUSED";
    assert!(lines.any(|line| line.contains(refused)));
    let _broker = start_broker_at(&folder, port);
    publish("100");
    let mut lines = BufReader::new(child.stdout.take().expect("it is a pipe")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line == "sum 142"));
    drop(child.kill());
    drop(child.wait());
}

/// Runs an agent that says `heard` for each message, in two processes: the first is killed behind a message.
/// In each one `speak` begins to speak, until its value is dropped.
fn hears_again<T>(name: &str, text: &str, speak: impl Fn() -> T) {
    let agent = Agent::new(name, text);
    for options in [&["--allow-net=127.0.0.1"][..], &["--allow-net=127.0.0.1", "--snapshot-every", "1ms"]] {
        let mut running = agent.start(options);
        let speaker = speak();
        running.wait_for("heard");
        running.send("-KILL");
        drop(speaker);
        running.end();
    }
}

/// A program that speaks until this is dropped.
struct Speaker(std::process::Child);

impl Speaker {
    fn of(folder: &esl_conformance::folder::Folder, text: &str) -> Speaker {
        folder.file("speaker.esl", text);
        let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "speaker.esl"]);
        let command = command.current_dir(folder.path()).stdout(std::process::Stdio::null());
        Speaker(command.stderr(std::process::Stdio::null()).spawn().expect("the command is there"))
    }
}

impl Drop for Speaker {
    fn drop(&mut self) {
        drop((self.0.kill(), self.0.wait()));
    }
}

#[test]
fn a_subscription_of_zenoh_is_made_again() {
    let (folder, port) = (esl_conformance::folder::Folder::new("durable-zenoh-speaker"), free_port());
    let text = format!(
        "(require :zenoh)
(zenoh:with-session (session :listen \"tcp/127.0.0.1:{port}\" :mode :router)
  (let ((lights (zenoh:subscribe session \"room/*/light\")))
    (loop (wait-for-event lights) (format t \"heard~%\") (finish-output))))"
    );
    let speaker = format!(
        "(require :zenoh)
(zenoh:with-session (session :connect \"tcp/127.0.0.1:{port}\" :timeout 20)
  (loop (zenoh:put session \"room/1/light\" \"on\") (sleep 0.02)))"
    );
    hears_again("durable-zenoh", &text, || Speaker::of(&folder, &speaker));
}

#[test]
fn a_subscription_of_ros_is_made_again() {
    let (folder, port) = (esl_conformance::folder::Folder::new("durable-ros-speaker"), free_port());
    let text = format!(
        "(require :ros)
(ros:with-node (node \"listener\" :listen \"tcp/127.0.0.1:{port}\" :mode :router)
  (let ((ticks (ros:subscribe node \"/tick\" \"std_msgs/msg/String\")))
    (loop (wait-for-event ticks) (format t \"heard~%\") (finish-output))))"
    );
    let speaker = format!(
        "(require :ros)
(ros:with-node (node \"speaker\" :connect \"tcp/127.0.0.1:{port}\" :timeout 20)
  (let ((ticks (ros:advertise node \"/tick\" \"std_msgs/msg/String\")))
    (loop (ros:publish ticks :data \"tick\") (sleep 0.02))))"
    );
    hears_again("durable-ros", &text, || Speaker::of(&folder, &speaker));
}

#[test]
fn a_subscription_of_mavlink_is_made_again() {
    let port = free_port();
    let text = format!(
        "(require :mavlink)
(mavlink:with-link (copter \"udpin:127.0.0.1:{port}\")
  (let ((beats (mavlink:subscribe copter :heartbeat :system :any)))
    (loop (wait-for-event beats) (format t \"heard~%\") (finish-output))))"
    );
    // A datagram is lost before the link is open.
    hears_again("durable-mavlink", &text, || {
        let (stop, stopped) = std::sync::mpsc::channel::<()>();
        std::thread::spawn(move || {
            let socket = std::net::UdpSocket::bind("127.0.0.1:0").expect("there is a port");
            for sequence in (0..=u8::MAX).cycle() {
                // Until a link is there, the system may tell that nobody listens.
                drop(socket.send_to(&crate::mavlink::heartbeat(1, sequence), ("127.0.0.1", port)));
                if stopped.recv_timeout(Duration::from_millis(20)) != Err(RecvTimeoutError::Timeout) {
                    return;
                }
            }
        });
        stop
    });
}
