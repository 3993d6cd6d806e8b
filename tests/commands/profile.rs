//! Profiles of runs: the sum of their ticks is that of the run, and the run stays the same.

use esl_conformance::process::run;

use crate::eslvm;
use crate::folder::Folder;

const PROGRAM: &str = "(defun spin (n)\n  (let ((sum 0))\n    (dotimes (i n sum)\n      (incf sum i))))\n\
    (defun much () (list (spin 90000)))\n\
    (defun little () (list (spin 10000)))\n\
    (task-net (a (much)) (b (little)))\n\
    (print (now))\n";

#[test]
fn a_profile_has_all_ticks_of_the_run_by_task_function_and_line() {
    let folder = Folder::with("profile", &[("spin.esl", PROGRAM)]);
    let (program, lines) = (folder.join("spin.esl"), folder.join("spin.folded"));
    let plain = run(&mut eslvm(&["run", "--clock", "virtual", "--stats", &program]), "");
    let arguments = ["run", "--clock", "virtual", "--stats=functions", "--profile", &lines, &program];
    let profiled = run(&mut eslvm(&arguments), "");
    assert_eq!((profiled.status, &profiled.output), (Some(0), &plain.output));
    let ticks_of = |errors: &str| {
        let line =
            errors.lines().find(|line| line.starts_with("ticks ")).expect("there are figures").to_owned();
        line.split_whitespace().nth(1).and_then(|ticks| ticks.parse::<u64>().ok()).expect("it is a number")
    };
    assert_eq!(ticks_of(&plain.errors), ticks_of(&profiled.errors), "the run is the same");
    assert!(profiled.errors.lines().any(|line| line.ends_with("  SPIN")), "{}", profiled.errors);

    let text = std::fs::read_to_string(&lines).expect("it was written");
    let rows: Vec<(&str, u64)> = text
        .lines()
        .map(|line| line.rsplit_once(' ').expect("it ends with a number"))
        .map(|(stack, ticks)| (stack, ticks.parse().expect("it is a number")))
        .collect();
    let sum = |word: &str| {
        rows.iter().filter(|(stack, _)| stack.contains(word)).map(|(_, ticks)| ticks).sum::<u64>()
    };
    // What is cleaned up after the end of the program is not part of it.
    assert!(sum("") <= ticks_of(&plain.errors) && sum("") * 100 > ticks_of(&plain.errors) * 99, "{text}");
    assert!(sum("SPIN") > 90_000 && sum("MUCH;SPIN") > 5 * sum("LITTLE;SPIN"), "{text}");
    assert!(rows.iter().any(|(stack, _)| stack.contains("SPIN;") && stack.contains("spin.esl:")), "{text}");
}

#[test]
fn profiles_have_the_form_that_their_name_asks_for() {
    let folder = Folder::with("profile_forms", &[("spin.esl", PROGRAM)]);
    let (program, drawing, data) =
        (folder.join("spin.esl"), folder.join("spin.svg"), folder.join("spin.json"));
    for file in [&drawing, &data] {
        assert_eq!(run(&mut eslvm(&["run", "--profile", file, &program]), "").status, Some(0));
    }
    let drawing = std::fs::read_to_string(drawing).expect("it was written");
    assert!(drawing.contains("<svg") && drawing.contains("SPIN"), "{drawing}");
    let data = std::fs::read_to_string(data).expect("it was written");
    let data: serde_json::Value = serde_json::from_str(&data).expect("it is JSON");
    let profile = &data["profiles"][0];
    let sum: u64 =
        profile["weights"].as_array().expect("a list").iter().filter_map(|weight| weight.as_u64()).sum();
    assert_eq!(Some(sum), profile["endValue"].as_u64());
    let refused = run(&mut eslvm(&["run", "--profile", &program, &program]), "");
    assert_eq!(refused.status, Some(2), "the program itself is not overwritten");
}
