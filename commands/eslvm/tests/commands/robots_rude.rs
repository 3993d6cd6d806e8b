//! A node of ESL beside peers that break the rules: signs of life that do not fit, payloads that are not
//! messages, services that never answer, and floods.
#![cfg(target_os = "linux")]

use esl_conformance::folder::Folder;

use crate::examples::free_port;
use crate::robots::{Running, python, start_peer, start_program};

const PROGRAM: &str = "(require :ros)
;; A whole line at once, for a test that reads it.
(defun say (value) (format t \"~s~%\" value) (finish-output))
(defmacro cause (form) `(handler-case ,form (failure (f) (failure-cause f))))
(ros:with-node (node \"executive\" :listen (format nil \"tcp/127.0.0.1:~a\" (first (command-line-arguments)))
                               :mode :router)
  (let ((chatter (ros:subscribe node \"/chatter\" \"std_msgs/msg/String\" :qos '(:depth 10)))
        (image (ros:subscribe node \"/image\" \"std_msgs/msg/String\" :qos '(:depth 5)))
        (hashes '(\"RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18\"
                  \"RIHS01_0000000000000000000000000000000000000000000000000000000000000001\")))
    (spawn (:daemon t)
      (loop (multiple-value-bind (kind text name) (wait-for-event (ros:node-events node))
              (say (list kind name (count-if (lambda (hash) (search hash text)) hashes))))))
    (sleep 0)
    (say :ready)
    (loop
      (let ((word (read-line *standard-input*)))
        (cond ((string= word \"take\")
               (say (ros:field (wait-for-event chatter :timeout 60) :data)))
              ((string= word \"call\")
               (ros:wait-for-server node \"/garbage\" :timeout 60)
               (say (list (cause (with-timeout 0.5
                                   (ros:call-service node \"/silent\" \"std_srvs/srv/Trigger\")))
                          (cause (ros:call-service node \"/garbage\" \"std_srvs/srv/Trigger\")))))
              ((string= word \"count\")
               (wait-until (plusp (ros:publishers node \"/t2999\")) :timeout 60)
               (say (ros:publishers node \"/t7\")))
              (t
               (say (list (length (ros:field (wait-for-event image :timeout 60) :data))
                          (plusp (+ (input-dropped image) (ros:lost node image)))))))))))";

#[test]
fn peers_that_break_the_rules_are_named_once_and_stop_nothing() {
    let Some(python) = python() else { return };
    let folder = Folder::new("ros-rude");
    let port = free_port();
    let mut program = start_program(&folder, PROGRAM, port, &["--memory", "64m"]);
    assert_eq!(program.line(), ":READY");
    let mut peer = start_peer(&python, "rude.py", port);
    let tell = |peer: &mut Running, word: &str| {
        peer.tell(word);
        peer.until(|line| line == format!("done {word}"));
    };
    for (word, event) in [
        ("hash", "(:TYPE-MISMATCH \"/chatter\" 2)"),
        ("type", "(:TYPE-MISMATCH \"/chatter\" 0)"),
        ("qos", "(:INCOMPATIBLE-QOS \"/chatter\" 0)"),
        ("twin", "(:DUPLICATE-NODE \"/executive\" 0)"),
    ] {
        tell(&mut peer, word);
        assert_eq!(program.line(), event, "{word}");
    }
    // Of 1,800 payloads that are not messages, one is told, and the message behind them comes.
    tell(&mut peer, "garbage");
    program.tell("take");
    let lines = [program.line(), program.line()];
    assert!(lines.contains(&"(:MALFORMED-PAYLOAD \"/chatter\" 0)".into()), "{lines:?}");
    assert!(lines.contains(&"\"behind\"".into()), "{lines:?}");
    tell(&mut peer, "serve");
    program.tell("call");
    assert_eq!(program.line(), "(:TIMEOUT :MALFORMED-PAYLOAD)");
    tell(&mut peer, "signs");
    program.tell("count");
    assert_eq!(program.line(), "1");
    // Messages of a megabyte, of which nobody takes one meanwhile.
    tell(&mut peer, "flood");
    program.tell("take");
    assert_eq!(program.line(), "\"flooded\"");
    program.tell("image");
    assert_eq!(program.line(), "(1000000 T)");
    let memory = super::most_memory(&program.child).expect("the process runs");
    assert!(memory < 400, "{memory} MB");
}
