//! Conditions that have to become true, on schedules that end and on those that go on for ever.

use esl::program::Ended;
use esl_testing::explore::{Exploration, Fairness, Grain, Settings, explore, name_of_condition};

use super::{Behaviour, compile};

/// Explores a program at all grains that see variables. Returns the names of the conditions that never become
/// true on a schedule that goes on for ever, and the exploration with points left out.
fn explored(text: &str, fairness: Fairness) -> (Vec<String>, Exploration<Behaviour>) {
    let program = compile(text);
    let explored = |grain, reduce| {
        let settings = Settings { grain, reduce, fairness, output: false, ..Settings::default() };
        let found = explore(&program, &settings).expect("it can start");
        assert!(found.limit.is_none(), "{text}: {found:?}");
        let name = |unmet| name_of_condition(&program, &settings, unmet, &|_| Ok(())).expect("it can start");
        let mut names: Vec<String> = found.unmet.iter().map(name).collect();
        names.sort_unstable();
        (names, found)
    };
    let (names, found) = explored(Grain::Variables, true);
    for (grain, reduce) in [(Grain::Variables, false), (Grain::Ticks, false)] {
        let (others, other) = explored(grain, reduce);
        let kinds = |found: &Exploration<Behaviour>| (found.endless.is_some(), found.livelock.is_some());
        assert_eq!((&others, kinds(&other)), (&names, kinds(&found)), "{text}: {grain:?}, {reduce}");
    }
    (names, found)
}

#[test]
fn what_leads_to_something_is_followed_by_it() {
    let text = |client: &str, server: &str| {
        format!(
            "(defvar *asked* nil)
             (defvar *served* nil)
             (leads-to served *asked* *served*)
             (task-net (client {client}) (server {server}))"
        )
    };
    let ended = |found: &Exploration<Behaviour>| -> Vec<Ended> {
        found.endings.iter().map(|ending| ending.what.ended).collect()
    };
    let (ask, serve) = ("(setq *asked* t)", "(setq *served* t)");
    let (unmet, found) = explored(&text(ask, serve), Fairness::Weak);
    assert_eq!((ended(&found), unmet), (vec![Ended::Normally(0)], vec![]));
    let choosing = format!("(when (choose t nil) {serve})");
    let (unmet, found) = explored(&text(ask, &choosing), Fairness::Weak);
    assert_eq!((ended(&found), unmet), (vec![Ended::Normally(0), Ended::Normally(1)], vec![]));
    let expected =
        "SERVED does not hold: its first form was true, and its second form never was from then on.";
    assert!(found.endings[1].what.errors.contains(expected), "{found:?}");
    // True only for a while, and perhaps too early.
    let briefly = |act: &str, name: &str| format!("{act} (sleep 0) (setq {name} nil)");
    let both = text(&briefly(ask, "*asked*"), &briefly(serve, "*served*"));
    let (_, found) = explored(&both, Fairness::Weak);
    assert_eq!(ended(&found).len(), 2, "{found:?}");
}

/// Tasks that go on for ever; one of them wants its turn.
fn turns(server: &str) -> String {
    format!(
        "(defvar *turn* 0)
         (defvar *asked* nil)
         (leads-to served *asked* (= *turn* 2))
         (eventually asked *asked*)
         (task-net
           (one (loop (setq *turn* 1) (sleep 0)))
           (two (setq *asked* t))
           {server})"
    )
}

#[test]
fn a_fair_cycle_without_what_has_to_come_is_found() {
    let (unmet, found) = explored(&turns(""), Fairness::Weak);
    assert_eq!(unmet, ["SERVED"]);
    assert!(found.endless.is_some(), "{found:?}");
    // A server gets its turn at some time, if only the schedule is fair.
    let server = turns("(server (loop (setq *turn* 2) (sleep 0)))");
    let (unmet, _) = explored(&server, Fairness::Weak);
    assert_eq!(unmet, [""; 0]);
    let (unmet, _) = explored(&server, Fairness::None);
    assert_eq!(unmet, ["ASKED", "SERVED"]);
    // A server that waits for another one need not get its turn.
    let (unmet, _) =
        explored(&turns("(server (loop (if (= *turn* 0) (setq *turn* 2) (sleep 0))))"), Fairness::Weak);
    assert_eq!(unmet, ["SERVED"]);
}

#[test]
fn unfair_cycles_count_if_all_do() {
    let text = "(defvar *stop* nil) (spawn (setq *stop* t)) (loop until *stop* do (sleep 0))";
    let (_, found) = explored(text, Fairness::Weak);
    assert!(found.has_cycle && found.livelock.is_none(), "{found:?}");
    let (_, found) = explored(text, Fairness::None);
    assert!(found.livelock.is_some(), "{found:?}");
}
