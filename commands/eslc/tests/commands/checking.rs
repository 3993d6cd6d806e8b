//! `eslc check`: warnings that are denied or allowed, folders; and what to type in place of a wrong
//! subcommand.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslc, eslvm};

/// Runs `eslc` in a folder, and returns its status and what it writes to standard error.
fn run(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String) {
    let finished = process::run(eslc(arguments).current_dir(folder.path()), "");
    (finished.status, finished.errors)
}

const UNUSED: &str = "(defun drive (metres speed)\n  metres)\n";

#[test]
fn warnings_are_denied_and_allowed() {
    let folder =
        Folder::with("checking-warnings", &[("drive.esl", UNUSED), ("call.esl", "(no-such-function)")]);
    let (status, errors) = run(&folder, &["check", "drive.esl"]);
    assert_eq!(status, Some(0), "{errors}");
    assert!(errors.contains("warning[unused-variable]"), "{errors}");
    for (options, status, said) in [
        (&["--deny", "warnings"][..], 3, "error[unused-variable]"),
        (&["--deny", "unused-variable"], 3, "error[unused-variable]"),
        (&["--deny", "undefined-function"], 0, "warning[unused-variable]"),
        (&["--deny", "warnings", "--allow", "unused-variable"], 0, ""),
        (&["--allow", "unused-variable"], 0, ""),
        (&["--allow", "warnings"], 0, ""),
        (&["--deny", "unused-variabel"], 2, "did you mean `unused-variable`?"),
        (&["--allow", "unclosed-list"], 2, "the code of an error"),
        (&["--deny", "unused-variable", "--allow", "unused-variable"], 2, "both denied and allowed"),
    ] {
        let (found, errors) = run(&folder, &[&["check"], options, &["drive.esl"]].concat());
        assert_eq!(found, Some(status), "{options:?}: {errors}");
        assert!(errors.contains(said) && said.is_empty() == errors.is_empty(), "{options:?}: {errors}");
    }
    // Those of the analysis, too.
    folder.file("turn.esl", "(defun turn (angle)\n  (sin angle))\n(print (turn (list 1)))\n");
    for (options, status, said) in [
        (&[][..], 0, "warning[wrong-type]: `turn` needs a number as `angle`, and gets a list"),
        (&["--deny", "wrong-type"], 3, "error[wrong-type]"),
        (&["--allow", "wrong-type"], 0, ""),
    ] {
        let (found, errors) = run(&folder, &[&["check"], options, &["turn.esl"]].concat());
        assert_eq!(found, Some(status), "{options:?}: {errors}");
        assert!(errors.contains(said) && said.is_empty() == errors.is_empty(), "{options:?}: {errors}");
    }
    folder.file("turn.esl", "(with-allowed-warnings (wrong-type)\n  (print (sin (list 1))))\n");
    assert_eq!(run(&folder, &["check", "turn.esl"]), (Some(0), String::new()));
    // A program with denied warnings is not written.
    let (status, errors) = run(&folder, &["compile", "--deny", "warnings", "call.esl"]);
    assert_eq!(status, Some(3), "{errors}");
    assert!(!folder.path().join("call.eslb").exists());
}

#[test]
fn a_form_allows_warnings_in_its_place() {
    let folder = Folder::new("checking-allowed");
    let check = |text: &str| {
        folder.file("drive.esl", text);
        run(&folder, &["check", "--deny", "warnings", "drive.esl"])
    };
    let (status, errors) = check(&format!("(with-allowed-warnings (unused-variable) {UNUSED})\n(drive 1 2)"));
    assert_eq!((status, &*errors), (Some(0), ""));
    // A warning of the end of the compilation, in a function, beside one that is not allowed.
    let (status, errors) = check(
        "(defun one () (with-allowed-warnings (undefined-function) (open-the-door)))
         (defun two () (close-the-door))",
    );
    assert_eq!(status, Some(3), "{errors}");
    assert!(errors.contains("`close-the-door`") && !errors.contains("`open-the-door`"), "{errors}");
    // Of a warning about several places, those count at which it is not allowed.
    let (status, errors) = check(
        "(with-allowed-warnings (undefined-function) (open-the-door))\n(open-the-door)\n\
         (with-allowed-warnings (undefined-function) (open-the-door))",
    );
    assert_eq!(status, Some(3), "{errors}");
    assert!(errors.contains("drive.esl:2:2") && !errors.contains("and here"), "{errors}");
    for (codes, said) in [
        ("(no-such-warning)", "knows no warning `no-such-warning`"),
        ("(unclosed-list)", "cannot allow `unclosed-list`, which is an error"),
        ("(3)", "needs codes of warnings, not `3`"),
        ("unused-variable", "needs a list of codes before the forms"),
    ] {
        let (status, errors) = check(&format!("(with-allowed-warnings {codes} 1)"));
        assert_eq!(status, Some(3), "{errors}");
        assert!(errors.contains(said), "{codes}: {errors}");
    }
}

#[test]
fn the_sources_of_a_folder_are_checked_each_by_itself() {
    let folder = Folder::new("checking-folder");
    // Each defines the same function: as one program they would not be.
    folder.file("one.esl", "(require \"shared\") (defun run (x) 1)");
    folder.file("deep/two.esl", "(defun run () 2)");
    folder.file("shared.esl", UNUSED);
    for arguments in [&["check"][..], &["check", "."]] {
        let (status, errors) = run(&folder, arguments);
        assert_eq!(status, Some(0), "{errors}");
        // A module that another file requires is told of once.
        assert_eq!(errors.matches("`speed`").count(), 1, "{errors}");
        assert!(errors.contains("`x`"), "{errors}");
    }
    folder.file("deep/open.esl", "(print 1");
    assert_eq!(run(&folder, &["check", "deep"]).0, Some(3));
    std::fs::create_dir(folder.join("empty")).expect("it is made");
    let (status, errors) = run(&folder, &["check", "empty"]);
    assert_eq!(status, Some(2));
    assert!(errors.contains("no source (*.esl) is in empty"), "{errors}");
}

#[test]
fn a_wrong_subcommand_is_told_what_to_type() {
    let folder = Folder::with("checking-habits", &[("hello.esl", "(print 1)")]);
    let said = |command: &mut std::process::Command| {
        let finished = process::run(command.current_dir(folder.path()), "");
        assert_eq!(finished.status, Some(2), "{}", finished.errors);
        finished.errors
    };
    for (arguments, wanted) in [
        (&["hello.esl", "1"][..], "type `eslvm run hello.esl 1`"),
        (&["missing.esl"], "type `eslvm run missing.esl`"),
        (&["check", "hello.esl"], "type `eslc check hello.esl`"),
    ] {
        let errors = said(&mut eslvm(arguments));
        assert!(errors.contains(wanted), "{errors}");
    }
    for (arguments, wanted) in [
        (&["indent"][..], "type `eslc format`"),
        (&["hello.esl"], "type `eslc check hello.esl`"),
        (&["run", "hello.esl"], "type `eslvm run hello.esl`"),
    ] {
        let errors = said(&mut eslc(arguments));
        assert!(errors.contains(wanted), "{errors}");
    }
}

const MESSAGES: &str = r#"(require :ros)
(defun answer (node)
  (ros:with-service (node "/reset" "std_srvs/srv/SetBool") (request)
    (list :success (ros:field request :date))))
(defun drive (node)
  (let ((wheels (ros:advertise node "/cmd_vel" "geometry_msgs/msg/Twist"))
        (battery (ros:subscribe node "/battery" "sensor_msgs/msg/BatteryState"))
        (markers (ros:message "visualization_msgs/msg/MarkerArray")))
    (ros:publish wheels :linear '(:x 0.5 :w 1))
    (ros:publish wheels :linear (list :x 0.5) :turn 1)
    (print (ros:field (wait-for-event battery) :voltge))
    (let ((message (wait-for-event battery)))
      (print (ros:field message :header :stamp :seconds)))
    (print (ros:field markers :markers 0 :pose :place))
    (ros:call-service node "/reset" "std_srvs/srv/SetBool" :datum t)
    (ros:do-action node "/move" "nav2_msgs/action/NavigateToPose" :goal (list :position 1))
    ;; Right ones, and some of which nothing is known.
    (ros:publish wheels (list :angular '(:z 1)))
    (print (ros:field (wait-for-event battery) :cell-voltage 0))
    (print (ros:field (ros:field markers :markers 0) :pose :position :x))
    (print (handler-case (ros:message "std_msgs/msg/String" :text 1) (failure () nil)))
    (with-recovery-procedures ((:invalid-message (abort nil)))
      (ros:message "std_msgs/msg/String" :text 1))
    (ros:message "my_msgs/msg/Grip" :force 1)))
"#;

#[test]
fn values_of_fields_are_of_their_types() {
    let text = r#"(require :ros)
(defun drive (node name)
  (let ((wheels (ros:advertise node "/cmd_vel" "geometry_msgs/msg/Twist"))
        (text (concatenate 'string name "!")))
    (ros:publish wheels :linear '(:x "fast"))
    (ros:publish wheels :linear (list :x text :y 1))
    (ros:publish wheels :linear 3)
    (ros:message "std_msgs/msg/String" :data (length name))
    (ros:message "std_msgs/msg/Bool" :data 0)
    (ros:message "std_msgs/msg/UInt8" :data 1.5)
    (ros:message "sensor_msgs/msg/LaserScan" :ranges "none")
    ;; Right ones: constants of the type, seconds, lists and vectors, and some of which nothing is known.
    (ros:message "sensor_msgs/msg/BatteryState" :power-supply-status :power-supply-status-full)
    (ros:message "std_msgs/msg/Header" :stamp 2.5 :frame-id "map")
    (ros:message "sensor_msgs/msg/LaserScan" :ranges (list 1 2) :intensities #(1.0))
    (ros:message "std_msgs/msg/Bool" :data nil)
    (ros:publish wheels :linear (list :x (first name) :y 1/2))))
"#;
    let folder = Folder::with("checking-values", &[("drive.esl", text)]);
    let (status, errors) = run(&folder, &["check", "drive.esl"]);
    assert_eq!(status, Some(0), "{errors}");
    let found: Vec<&str> =
        errors.lines().filter_map(|line| line.strip_prefix("warning[wrong-type]: ")).collect();
    let expected = [
        "the field `:x` of `geometry_msgs/msg/Vector3` takes a real number or a symbol, and gets a string",
        "the field `:x` of `geometry_msgs/msg/Vector3` takes a real number or a symbol, and gets a string",
        "the field `:linear` of `geometry_msgs/msg/Twist` takes a list, and gets an integer",
        "the field `:data` of `std_msgs/msg/String` takes a string or a symbol, and gets an integer",
        "the field `:data` of `std_msgs/msg/Bool` takes a symbol, and gets an integer",
        "the field `:data` of `std_msgs/msg/UInt8` takes an integer or a symbol, and gets a float",
        "the field `:ranges` of `sensor_msgs/msg/LaserScan` takes an array or a list, and gets a string",
    ];
    assert_eq!(found, expected, "{errors}");
}

#[test]
fn fields_of_messages_are_those_of_their_types() {
    let folder = Folder::with("checking-messages", &[("drive.esl", MESSAGES)]);
    let (status, errors) = run(&folder, &["check", "drive.esl"]);
    assert_eq!(status, Some(0), "{errors}");
    let found: Vec<&str> =
        errors.lines().filter_map(|line| line.strip_prefix("warning[unknown-keyword]: ")).collect();
    let expected = [
        "`std_srvs/srv/SetBool_Request` has no field `:date`",
        "`geometry_msgs/msg/Vector3` has no field `:w`",
        "`geometry_msgs/msg/Twist` has no field `:turn`",
        "`sensor_msgs/msg/BatteryState` has no field `:voltge`",
        "`builtin_interfaces/msg/Time` has no field `:seconds`",
        "`geometry_msgs/msg/Pose` has no field `:place`",
        "`std_srvs/srv/SetBool_Request` has no field `:datum`",
        "`nav2_msgs/action/NavigateToPose_Goal` has no field `:position`",
    ];
    assert_eq!(found, expected, "{errors}");
    assert!(errors.contains("its fields are `:linear`, `:angular`"), "{errors}");
    // A type that the program defines has the fields that it says.
    let own = MESSAGES
        .replace("(require :ros)", "(require :ros)(ros:define-message \"geometry_msgs/msg/Twist\" \"\")");
    folder.file("drive.esl", &own);
    let (_, errors) = run(&folder, &["check", "drive.esl"]);
    assert!(!errors.contains("msg/Twist` has"), "{errors}");
    assert_eq!(errors.matches("has no field").count(), 6, "{errors}");
    // It may be any of them.
    let any = MESSAGES
        .replace("(require :ros)", "(require :ros)(mapc #'ros:define-message '(\"a/msg/B\") '(\"\"))");
    folder.file("drive.esl", &any);
    let (_, errors) = run(&folder, &["check", "drive.esl"]);
    assert!(!errors.contains("has no field"), "{errors}");
}
