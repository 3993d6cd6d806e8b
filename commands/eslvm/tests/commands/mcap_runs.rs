//! Runs as files of MCAP: `eslvm run --mcap` beside `eslvm replay --mcap`.
#![cfg(unix)]

use esl_conformance::folder::Folder;

use crate::mcap::{lines, run};

/// Two nodes that talk.
const TALK: &str = "(require :ros)
(ros:with-node (a \"a\" :listen (first (command-line-arguments)) :mode :router)
  (ros:with-node (b \"b\" :connect (first (command-line-arguments)))
    (ros:define-message \"own_msgs/msg/Word\" \"string text\")
    (let ((input (ros:subscribe b \"/words\" \"own_msgs/msg/Word\" :qos '(:depth 100)))
          (publisher (ros:advertise a \"/words\" \"own_msgs/msg/Word\")))
      (ros:wait-for-subscriber a \"/words\" :timeout 60)
      (dotimes (i 3)
        (ros:publish publisher :text (format nil \"word ~d\" i))
        (format t \"~a~%\" (ros:field (wait-for-event input :timeout 60) :text))))))
(require :time)
(time:unix)
(define-cause :tired ())
(handler-case (fail :tired) (failure () (assert '(rested ann))))";

/// Prints the channels, the words and the seconds of files.
const SHOW: &str = "(require :mcap)
(dolist (path (command-line-arguments))
  (mcap:with-file (file path)
    (format t \"~s~%\" (sort (mapcar (lambda (channel)
                                       (list (getf channel :topic) (getf channel :type)
                                             (if (search \"/esl/\" (getf channel :topic)) 0 (getf channel :count))))
                                     (mcap:channels file))
                             #'string< :key #'first))
    (mcap:do-messages ((message topic) file :topics '(\"/words\"))
      (format t \"~a \" (getf message :text)))
    (format t \"~%~d~%\" (floor (getf (mcap:info file) :start) 1000))))";

#[test]
fn a_recorded_run_becomes_a_file_afterwards() {
    let folder = Folder::with("mcap-replay", &[("main.esl", TALK), ("show.esl", SHOW)]);
    let address = format!("tcp/127.0.0.1:{}", crate::examples::free_port());
    let options =
        ["run", "--allow-net=127.0.0.1", "--mcap", "run.mcap", "--record", "run.eslj", "main.esl", &address];
    let done = run(&folder, &options);
    assert_eq!(
        (done.status, lines(&done.output)),
        (Some(0), vec!["word 0", "word 1", "word 2"]),
        "{}",
        done.errors
    );
    let again = run(&folder, &["replay", "--mcap", "replay.mcap", "run.eslj"]);
    assert_eq!((again.status, &again.output), (Some(0), &done.output), "{}", again.errors);
    let shown = run(&folder, &["run", "show.esl", "run.mcap", "replay.mcap"]);
    let shown = lines(&shown.output);
    assert_eq!((shown.len(), &shown[..3]), (6, &shown[3..]), "{shown:?}");
    assert!(shown[0].contains("(\"/words\" \"own_msgs/msg/Word\" 6)"), "{}", shown[0]);
    for topic in [
        "/esl/facts/rested",
        "/esl/failures",
        "/esl/inputs/words",
        "/esl/log",
        "/esl/operations",
        "/esl/tasks",
    ] {
        assert!(shown[0].contains(topic), "{topic}: {}", shown[0]);
    }
    let refused = run(&folder, &["replay", "--mcap", "run.eslj", "run.eslj"]);
    assert_eq!(refused.status, Some(2), "{}", refused.errors);
    let refused = run(&folder, &["replay", "--mcap", "none/a.mcap", "run.eslj"]);
    assert!(refused.errors.contains("none/a.mcap cannot be written"), "{}", refused.errors);
}
