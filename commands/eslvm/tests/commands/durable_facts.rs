//! Runs that begin anew with the facts of one of another version of the machine.

use crate::durable::Agent;

/// Makes the journal of an agent one of another version of the format.
fn make_other_version(agent: &Agent) {
    let file = agent.folder.path().join("state/journal.eslj");
    let mut bytes = std::fs::read(&file).expect("it is there");
    bytes[8..12].copy_from_slice(&1_u32.to_le_bytes());
    std::fs::write(&file, bytes).expect("it is ours");
}

#[test]
fn a_run_of_another_version_begins_anew_from_its_facts() {
    let text = "(defpackage depot (:use :cl :esl))
(define-property battery (rover))
(defdurable *count* 0)
(defdurable *table* (make-hash-table))
(defdurable *task* nil)
(unless *begun-from-facts*
  (assert '(battery r1 7)))
(format t \"begins ~a ~a ~s ~a ~s~%\" (and *begun-from-facts* t) *count*
        (sort (mapcar #'prin1-to-string (db-query '(at ?a ?b))) #'string<) (battery 'r1)
        (gethash '(1/2 . \"k\") *table*))
(when *begun-from-facts* (exit 4))
(incf *count* (expt 10 30))
(setf (gethash '(1/2 . \"k\") *table*) (vector #\\a :key 1.5d0 'depot::|Place|))
(setq *task* (current-task))
(assert '(battery r1 5))
(assert '(at \"base; (1) \\\" |
\" (depot::x . nil)))
(assert (list 'holds (make-event 'e)))
(format t \"ready~%\")
(finish-output)
(sleep 100)";
    let expected = r##"begins T 1000000000000000000000000000000 ("((?A . \"base; (1) \\\" |
\") (?B DEPOT::X))") 5 #(#\a :KEY 1.5 DEPOT::|Place|)
"##;
    let agent = Agent::new("durable-facts", text);
    let mut running = agent.start(&[]);
    running.wait_for("ready");
    running.send("-KILL");
    running.end();
    make_other_version(&agent);
    let (status, _, errors) = agent.run(&["--from-facts"]);
    assert!(status == Some(6) && errors.contains("its folder has no facts"), "{errors}");
    std::fs::remove_dir_all(agent.folder.path().join("state")).expect("it is ours");
    let mut running = agent.start(&["--from-facts"]);
    running.wait_for("ready");
    running.send("-TERM");
    let (status, errors) = running.end();
    assert_eq!(status, Some(0), "{errors}");
    assert!(
        errors.contains("not kept for another version of the machine: variable *TASK*: it has"),
        "{errors}"
    );
    assert!(
        errors.contains("not kept for another version of the machine: 1 fact HOLDS: with #<event>"),
        "{errors}"
    );
    make_other_version(&agent);
    let (status, _, errors) = agent.run(&[]);
    assert!(status == Some(6) && errors.contains("type `--from-facts`"), "{errors}");
    // As if the process had been killed after its first step.
    let state = agent.folder.path().join("state");
    std::fs::copy(state.join("facts.esl"), state.join("begin.esl")).expect("it is ours");
    std::fs::remove_file(state.join("facts.esl")).expect("it is ours");
    let (status, output, errors) = agent.run(&[]);
    assert_eq!((status, &*output), (Some(4), expected), "{errors}");
    assert!(errors.contains("begins anew with 2 facts and 2 variables, as at its pause"), "{errors}");
    assert!(errors.contains("missing: variable *TASK*"), "{errors}");
    assert!(state.join("earlier/journal.eslj").exists() && !state.join("begin.esl").exists());
    let (status, output, errors) = agent.state(&[]);
    assert!(status == Some(0) && output.contains("verified"), "{output}{errors}");
    assert_eq!(agent.run(&["--from-facts"]).0, Some(4));
}

#[test]
fn structures_outlive_the_version_by_their_slots() {
    let text = "(defstruct wheel radius (parts (list 1)))
(defstruct axle wheels)
(defdurable *axle* (make-axle :wheels (vector (make-wheel :radius 1) (make-wheel :radius 2 :parts '(a . b)))))
(assert (list 'has 'r1 (make-wheel :radius 3)))
(assert (list 'knows 'r1 (list *axle*)))
(format t \"ready~%\")
(finish-output)
(sleep 100)";
    let agent = Agent::new("durable-structures", text);
    let mut running = agent.start(&[]);
    running.wait_for("ready");
    running.send("-TERM");
    let (status, errors) = running.end();
    assert!(status == Some(0) && !errors.contains("not kept"), "{errors}");
    make_other_version(&agent);
    let state = agent.folder.path().join("state");
    let begin_with = |text: &str| {
        agent.folder.file("agent.esl", text);
        let done = agent.run(&["--from-facts"]);
        let earlier = state.join("earlier");
        // As it was, for the next one.
        std::fs::remove_file(state.join("journal.eslj")).expect("it is there");
        for file in ["journal.eslj", "facts.esl"] {
            std::fs::rename(earlier.join(file), state.join(file)).expect("it is there");
        }
        done
    };
    let same = "(defstruct wheel radius (parts (list 1)))
(print (db-query '(has r1 ?w)))
(print (db-query '(knows r1 ?w)))
(defstruct axle wheels)
(defdurable *axle* nil)
(print *axle*)
(print (db-query '(knows r1 ?w)))
(exit 3)";
    let (status, output, errors) = begin_with(same);
    let axle = "#S(AXLE :WHEELS #(#S(WHEEL :RADIUS 1 :PARTS (1)) #S(WHEEL :RADIUS 2 :PARTS (A . B))))";
    let expected = format!("(((?W . #S(WHEEL :RADIUS 3 :PARTS (1)))))\nNIL\n{axle}\n(((?W {axle})))");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!((status, lines.join("\n")), (Some(3), expected), "{errors}");
    assert!(errors.contains("begins anew with 2 facts and 1 variable"), "{errors}");
    let other = "(defstruct axle wheels)
(defstruct wheel radius (pressure 2))
(define-upgrade (wheel) (old) (make-wheel :radius (list (wheel-radius old) (wheel-pressure old))))
(defdurable *axle* nil)
(print (svref (axle-wheels *axle*) 1))
(print (db-query '(has r1 ?w)))
(exit 3)";
    let (status, output, errors) = begin_with(other);
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let wheel = |radius| format!("#S(WHEEL :RADIUS ({radius} NIL) :PRESSURE 2)");
    assert_eq!(
        (status, lines.join("\n")),
        (Some(3), format!("{}\n(((?W . {})))", wheel(2), wheel(3))),
        "{errors}"
    );
    // The same slots, one of them of another type.
    let typed = "(defstruct axle (wheels #() :type vector))
(defstruct wheel (radius \"\" :type string) parts)
(define-upgrade (wheel) (old) (make-wheel :radius (princ-to-string (wheel-radius old))))
(defdurable *axle* nil)
(print (svref (axle-wheels *axle*) 1))
(exit 3)";
    let (status, output, errors) = begin_with(typed);
    assert_eq!((status, output.trim()), (Some(3), "#S(WHEEL :RADIUS \"2\" :PARTS NIL)"), "{errors}");
    for (definitions, reason) in [
        ("(defstruct axle wheels)", "has a structure WHEEL, which is not defined here"),
        (
            "(defstruct axle wheels) (defstruct wheel radius)",
            "has a structure WHEEL with other slots or types, (RADIUS PARTS)",
        ),
        (
            "(defstruct axle wheels) (defstruct wheel (radius \"\" :type string) parts)",
            "has a structure WHEEL with other slots or types, (RADIUS PARTS)",
        ),
    ] {
        let (status, _, errors) = begin_with(&format!("{definitions} (defdurable *axle* nil) (exit 3)"));
        assert!(status == Some(1) && errors.contains(reason), "{errors}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn the_facts_of_a_killed_run_are_those_of_its_last_snapshot() {
    let text = "(defdurable *count* 0)
(format t \"begins ~a~%\" *count*)
(when *begun-from-facts* (exit (if (> *count* 0) 4 5)))
(loop (incf *count*) (format t \"count ~d~%\" *count*) (finish-output) (sleep 0.002))";
    let agent = Agent::new("durable-facts-killed", text);
    let mut running = agent.start(&["--snapshot-every", "1ms"]);
    running.wait_for("count 3");
    while !agent.folder.path().join("state/facts.esl").exists() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    running.send("-KILL");
    running.end();
    for file in std::fs::read_dir(agent.folder.path().join("state")).expect("it is there") {
        let path = file.expect("it can be read").path();
        if path.extension().is_some_and(|extension| extension == "eslj") {
            let mut bytes = std::fs::read(&path).expect("it is there");
            bytes[8..12].copy_from_slice(&1_u32.to_le_bytes());
            std::fs::write(&path, bytes).expect("it is ours");
        }
    }
    let (status, _, errors) = agent.run(&["--from-facts"]);
    assert_eq!(status, Some(4), "{errors}");
    assert!(errors.contains("as at a snapshot, behind which it went on"), "{errors}");
}
