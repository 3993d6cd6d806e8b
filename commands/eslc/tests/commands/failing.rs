//! `eslc failures`: tables, the ways of a cause, declarations that do not hold, failure modes and effects.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslc;

const MISSION: &str = "(declaim (fails drive :stuck :late))
(defun drive (metres)
  (when (> metres 3) (fail :stuck metres))
  (when (< metres 0) (fail :lost)))
(deftest drives (check-failure :stuck (drive 5)))
(with-recovery-procedures ((:stuck (abort))) (drive 2))
";

/// Runs `eslc` in a folder. Returns its status, its output and its errors.
fn run(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String, String) {
    let finished = process::run(eslc(arguments).current_dir(folder.path()), "");
    (finished.status, finished.output, finished.errors)
}

#[test]
fn possible_failures_are_listed() {
    let folder = Folder::with("failing", &[("mission.esl", MISSION)]);
    let (status, output, errors) = run(&folder, &["failures", "mission.esl"]);
    assert_eq!(status, Some(3), "{errors}");
    assert!(errors.contains("error[undeclared-failure]: `drive` may fail with :lost"), "{errors}");
    assert!(errors.contains("warning[declared-never]: `drive` declares :late"), "{errors}");
    assert!(
        output.starts_with("task main: a failure ends the run\n  ends by\n    :lost  from drive"),
        "{output}"
    );
    for (options, said) in [
        (&["--explain", ":stuck"][..], "taken by the clause for :stuck at mission.esl:6:"),
        (&["--all"], ":type-error"),
        (&["--format", "json"], "\"cause\": \":lost\""),
        (&["--format", "csv"], "kind,item,place,cause,begins in,then\r\ntask,main,,:lost,"),
        (&["--format", "md"], "| task | main |  | :lost | drive (mission.esl:4) | ends the run |"),
        (&["--format", "html"], "<td>:lost</td>"),
        (&["--fmea", "--format", "csv"], "drive,:lost,mission.esl:4,leaves drive,none,none,ends the run"),
    ] {
        let (_, output, errors) = run(&folder, &[&["failures"], options, &["mission.esl"]].concat());
        assert!(output.contains(said), "{options:?}: {output}{errors}");
    }
}

#[test]
fn ways_are_those_of_a_cause_and_of_all_below_it() {
    let text = "(define-cause :device ()) (define-cause :motor (:device)) (define-cause :|Dead End| ())
(defun drive () (fail :motor))
(defun look (why) (fail why))
(defun turn () (fail :|Dead End|))
(defun far () (elsewhere))
(declaim (fails known-elsewhere :device))
(with-recovery-procedures ((:device (abort))) (drive))
(look (read)) (turn) (far) (known-elsewhere) (+ 1 (read))
";
    let folder = Folder::with("failing-ways", &[("mission.esl", text)]);
    for (cause, said) in [
        (":device", "begins at mission.esl:2:17, in drive, as :motor\n"),
        (":motor", "begins at mission.esl:2:17, in drive\n"),
        ("motor", ":motor\n  begins at mission.esl:2:17, in drive\n"),
        (":|Dead End|", "begins at mission.esl:4:16, in turn\n"),
        ("any", "begins at mission.esl:3:19, in look, as any (a computed cause)\n"),
        ("any", "begins at mission.esl:5:15, in far, as unknown (elsewhere declares no failures)\n"),
        ("unknown", "begins at mission.esl:5:15, in far, as unknown (elsewhere declares no failures)\n"),
        (":type-error", "programming errors have no ways here; `eslc failures --all` lists them\n"),
        (":lost", "no place in this program fails with it\n"),
    ] {
        let (_, output, errors) = run(&folder, &["failures", "--explain", cause, "mission.esl"]);
        assert!(output.contains(said), "{cause}: {said}\n{output}{errors}");
    }
    let (status, _, errors) =
        run(&folder, &["failures", "--explain", ":motor", "--format", "json", "mission.esl"]);
    assert_eq!(status, Some(2));
    assert!(errors.contains("cannot be used with"), "{errors}");
}

#[test]
fn the_picture_shows_failures_clauses_and_goals() {
    let goal = "(defun there (metres) (> metres 1))
(defun near (metres) (with-recovery-procedures ((:lost (abort))) (drive metres)))
(to-achieve (there metres) ((< metres 3) (near metres)) (t (drive metres)))
(defun go-there (metres) (achieve (there metres)))\n";
    let text = format!("{MISSION}{goal}");
    let folder = Folder::with("failing-graph", &[("mission.esl", &text)]);
    let (status, output, errors) = run(&folder, &["graph", "mission.esl"]);
    assert_eq!(status, Some(0), "{errors}");
    assert!(output.starts_with("<svg ") && output.ends_with("</svg>\n"), "{output}");
    assert!(output.contains(">:lost</text>") && output.contains("class=\"arrow takes "), "{output}");
    for said in [
        ">(there metres)</text>",
        ">in go-there</text>",
        ">(&lt; metres 3): near</text>",
        ">otherwise: drive</text>",
    ] {
        assert!(output.contains(said), "{said}: {output}");
    }
    assert_eq!(output.matches("class=\"arrow calls").count(), 1, "the one from the goal to `near`: {output}");
}

#[test]
fn rights_are_listed_with_those_that_are_not_known() {
    let text = "(require :sockets)
        (require :process)
        (require :http)
        (defun talk (port)
          (sockets:with-socket (link (sockets:connect \"127.0.0.1\" port)) (read-line link)))
        (defun ask (host) (http:get (format nil \"http://~a/\" host)))
        (process:run-program '(\"calibrate\" \"--fast\"))
        (http:get \"https://lab/state\")
        (with-open-file (log \"/var/log/rover\" :direction :output) (print (talk 7) log))
        (with-open-file (log \"notes.txt\") (read-line log))
        (probe-file \"/a\n--allow-all\") (probe-file \"/a,/etc\") (rename-file \"new.txt\" \"/var/old.txt\")
        (directory \"/var/run/*.pid\") (directory \"*.esl\") (truename \"/var/link\")
        (open \"/var/lock\" :if-does-not-exist :create) (sockets:listen \"::1\" 80)";
    let folder = Folder::with("failing-rights", &[("rover.esl", text)]);
    let (status, output, errors) = run(&folder, &["rights", "rover.esl"]);
    let expected = "--allow-net=127.0.0.1\n--allow-net=[::1]:80\n--allow-net=lab:443\n--allow-read=/var/link\n\
                    --allow-read=/var/lock\n--allow-read=/var/run/\n--allow-run=calibrate\n--allow-write=/var/lock\n\
                    --allow-write=/var/log/rover\n--allow-write=/var/old.txt\n\
                    # not known: --allow-net, for http:get at rover.esl:6:27\n\
                    # not known: --allow-read, for probe-file at rover.esl:11:9\n\
                    # not known: --allow-read, for probe-file at rover.esl:12:15\n";
    assert_eq!((status, output.as_str()), (Some(0), expected), "{errors}");
}

#[test]
fn rights_of_functions_by_name_and_of_other_paths_are_listed() {
    let text = "(mapcar 'probe-file (list \"/a\"))
        (sort (list \"/a\") #'< :key 'file-write-date)
        (eval '(delete-file \"/a\"))
        (print (list 'open 'truename))
        (ensure-directories-exist \"/log/today/rover.txt\")
        (rename-file \"/log/old.txt\" \"new.txt\")
        (with-open-file (log \"/log/kept\" :direction :output :if-exists :rename) (print 1 log))
        (with-open-file (log \"/log/plain\" :direction :output :if-exists :append) (print 1 log))
        (with-open-file (log \"/log/read\" :if-exists :rename) (print (read-line log)))
        (defun note (answer)
          (with-open-file (log \"/log/notes\" :direction :output :if-exists answer) (print 1 log)))";
    let folder = Folder::with("failing-rights-named", &[("rover.esl", text)]);
    let (status, output, errors) = run(&folder, &["rights", "rover.esl"]);
    let expected = "--allow-read=/log/read\n--allow-write=/log/kept\n--allow-write=/log/kept.bak\n\
                    --allow-write=/log/new.txt\n--allow-write=/log/notes\n--allow-write=/log/old.txt\n\
                    --allow-write=/log/plain\n--allow-write=/log/today/\n\
                    # not known: --allow-read, for file-write-date at rover.esl:2:9\n\
                    # not known: --allow-read, for probe-file at rover.esl:1:1\n\
                    # not known: --allow-write, for delete-file at rover.esl:3:9\n\
                    # not known: --allow-write, for open at rover.esl:11:11\n";
    assert_eq!((status, output.as_str()), (Some(0), expected), "{errors}");
}

#[test]
fn rights_of_agents_are_those_to_their_fleet_or_its_endpoints() {
    let text = "(require :fleet)
        (defun by-command () (fleet:join () (sleep 1)))
        (defun of-fleet () (fleet:join ('a :fleet \"Plant\" :leases \"http://10.0.0.2:2379\") (sleep 1)))
        (defun by-itself (port)
          (fleet:join ('b :connect '(\"tcp/base:7447\" \"tls/spare:7448\") :listen \"unixsock-stream//run/z\")
            (fleet:agents))
          (fleet:join ('c :connect (format nil \"tcp/base:~d\" port)) (fleet:agents))
          (fleet:join ('d :config \"/etc/zenoh.json5\") (fleet:agents)))
        (defun scout () (zenoh:with-session (s :scouting t :listen \"udp/0.0.0.0:7447\") s))";
    let folder = Folder::with("failing-fleet-rights", &[("rover.esl", text)]);
    let (status, output, errors) = run(&folder, &["rights", "rover.esl"]);
    let expected = "--allow-fleet=esl\n--allow-fleet=plant\n--allow-net=0.0.0.0:7447\n--allow-net=10.0.0.2:2379\n\
                    --allow-net=224.0.0.224:7446\n--allow-net=base:7447\n--allow-net=spare:7448\n\
                    --allow-read=/etc/zenoh.json5\n--allow-read=/run/z\n--allow-write=/run/z\n\
                    # not known: --allow-net, for fleet:join at rover.esl:7:11\n\
                    # not known: --allow-net, for fleet:join at rover.esl:8:11\n";
    assert_eq!((status, output.as_str()), (Some(0), expected), "{errors}");
}

#[test]
fn severities_and_notes_are_carried_over() {
    let notes = "item,failure mode,severity,notes\ndrive,:lost,1,look at it\ndrive,:gone,2,old\n";
    let folder = Folder::with("failing-notes", &[("mission.esl", MISSION), ("notes.csv", notes)]);
    let arguments = ["failures", "--fmea", "--format", "csv", "--notes", "notes.csv", "mission.esl"];
    let (_, output, errors) = run(&folder, &arguments);
    assert!(output.contains(",1,look at it\r\n"), "{output}{errors}");
    assert!(output.contains("drive,:gone,,,,,,,2,stale: no longer in the program; old\r\n"), "{output}");
}

#[test]
fn notes_that_cannot_be_read_are_not_lost() {
    let notes = "item,failure mode,notes\ndrive,:lost,look at it\n";
    let folder = Folder::with("failing-no-notes", &[("mission.esl", MISSION), ("notes.csv", notes)]);
    let arguments = ["failures", "--fmea", "--format", "csv", "--notes", "notes.csv", "mission.esl"];
    let (status, output, errors) = run(&folder, &arguments);
    assert_eq!((status, output.as_str()), (Some(2), ""), "{errors}");
    assert!(
        errors.contains("--notes notes.csv: its first line does not have the columns `item`"),
        "{errors}"
    );
}

#[test]
fn effects_are_those_of_the_code_in_which_failures_begin() {
    let text = "(define-cause :dark ()) (define-cause :cold ())
(define-mock look () (fail :dark))
(deftest looks (is (eq 1 1)) (fail :cold))
(spawn (:name watch) (fail :dark))
(with-recovery-procedures ((:cold (abort))) (fail :cold))
(defun read-it () (ignore-errors (fail :cold)) (handler-case (fail :cold) (failure () 2)))
(read-it)
(fail :dark)
";
    let folder = Folder::with("failing-effects", &[("mission.esl", text)]);
    let (_, output, errors) = run(&folder, &["failures", "--fmea", "--format", "csv", "mission.esl"]);
    for said in [
        "look,:dark,mission.esl:2,leaves look,",
        "(test looks),:cold,mission.esl:3,fails the test,none,none,fails the test,",
        "the top level,:dark,\"mission.esl:4, mission.esl:8\",ends the run; ends the task,none,none,",
        "read-it,:cold,\"mission.esl:6, mission.esl:6\",leaves read-it,failure in read-it,",
        "the top level,:cold,mission.esl:5,is taken inside,:cold in the top level,",
    ] {
        assert!(output.contains(said), "{said}\n{output}{errors}");
    }
}

#[test]
fn the_arm_has_the_failures_of_its_parts() {
    let example = esl_conformance::root().join("examples/manipulator/scripted.esl");
    let example = example.to_string_lossy().into_owned();
    let folder = Folder::new("failing-arm");
    let (status, output, errors) = run(&folder, &["failures", "--format", "csv", &example]);
    assert_eq!(status, Some(0), "{errors}");
    let causes = |function: &str| -> Vec<&str> {
        let rows = output.lines().filter_map(|line| line.strip_prefix("function,"));
        let rows = rows.filter_map(|row| row.strip_prefix(function)?.strip_prefix(','));
        rows.filter_map(|row| row.split(',').nth(1)).collect()
    };
    // A hanging camera is reset three times. A rejected goal is a motion that has failed.
    assert!(causes("look").contains(&":camera-silent") && !causes("look").contains(&":timeout"), "{output}");
    assert!(
        causes("move").contains(&":motion-failed") && !causes("move").contains(&":goal-rejected"),
        "{output}"
    );
    assert!(causes("reach").contains(&":out-of-reach"), "{output}");
    assert!(
        causes("bring-turned").contains(&":missed") && causes("bring-turned").contains(&":grip-lost"),
        "{output}"
    );
    assert_eq!(causes("bring"), [":all-failed"], "{output}");
    assert_eq!(causes("clear-table"), Vec::<&str>::new(), "{output}");
    assert!(
        causes("work").contains(&":motion-failed") && !causes("work").contains(&":battery-low"),
        "{output}"
    );
    assert!(causes("note").is_empty(), "{output}");
    // Failures of the module begin where the program calls it.
    let (_, lines, _) = run(&folder, &["failures", "--fmea", "--format", "csv", &example]);
    assert!(lines.contains("\r\nmove,:motion-failed,"), "{lines}");
    assert!(!lines.contains("%ros-call"), "{lines}");
}
