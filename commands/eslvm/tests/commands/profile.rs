//! Profiles of runs: the sum of their ticks is that of the run, and the run stays the same.

use esl_conformance::folder::Folder;
use esl_conformance::process::run;

use crate::eslvm;

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
    let row = profiled.errors.lines().find(|line| line.ends_with("  SPIN")).expect("there is a row");
    let [own, all, time, all_time, _] = row.split_whitespace().collect::<Vec<_>>()[..] else {
        panic!("{row}")
    };
    assert!(own == all && time == all_time && time.parse::<f64>().is_ok_and(|time| time > 0.0), "{row}");

    let text = std::fs::read_to_string(&lines).expect("it was written");
    let rows: Vec<(&str, u64)> = text
        .lines()
        .map(|line| line.rsplit_once(' ').expect("it ends with a number"))
        .map(|(stack, ticks)| (stack, ticks.parse().expect("it is a number")))
        .collect();
    let sum = |word: &str| {
        rows.iter().filter(|(stack, _)| stack.contains(word)).map(|(_, ticks)| ticks).sum::<u64>()
    };
    assert_eq!(sum(""), ticks_of(&plain.errors), "{text}");
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
    for (number, unit) in [(0, "none"), (1, "nanoseconds")] {
        let profile = &data["profiles"][number];
        let weights = profile["weights"].as_array().expect("a list");
        let sum: u64 = weights.iter().filter_map(|weight| weight.as_u64()).sum();
        assert_eq!((profile["unit"].as_str(), profile["endValue"].as_u64()), (Some(unit), Some(sum)));
        assert!(sum > 0, "{unit}");
    }
    let time = folder.join("time.svg");
    let arguments = ["run", "--profile", &time, "--profile-unit", "time", &program];
    assert_eq!(run(&mut eslvm(&arguments), "").status, Some(0));
    let drawing = std::fs::read_to_string(time).expect("it was written");
    assert!(drawing.contains("Time of the run") && drawing.contains(" ns,"), "{drawing}");
    let refused = run(&mut eslvm(&["run", "--profile", &program, &program]), "");
    assert_eq!(refused.status, Some(2), "the program itself is not overwritten");
}
