//! Random schedules: they find what the corpus has, are repeated by their choices, and come to no ending that
//! an exploration does not find.

use std::collections::BTreeSet;

use esl::program::Ended;
use esl_testing::explore::{
    RandomFound, RandomSettings, Settings, explore, explore_randomly, follow, grains,
};

use super::{compile, corpus, generated, oracle};

fn random(text: &str, random: RandomSettings) -> (Settings, RandomFound) {
    let program = compile(text);
    let grain = *grains(&program, None).last().expect("there is a grain");
    let settings = Settings { grain, ..Settings::default() };
    let found = explore_randomly(&program, &settings, random, RandomFound::default(), &|_| Ok(()), &|_| true)
        .expect("it can start");
    (settings, found)
}

const FEW: RandomSettings = RandomSettings { count: 150, seed: 1, depth: 3, jobs: 1, covers: false };

#[test]
fn most_faults_of_the_corpus_are_found_by_random_schedules() {
    let programs = corpus::programs(".wrong.esl");
    let mut missed = Vec::new();
    for (file, text) in &programs {
        let (settings, found) = random(text, FEW);
        let bad = found.endings.iter().find(|ending| ending.what.ended != Ended::Normally(0));
        let Some(bad) = bad else {
            missed.push(file.clone());
            continue;
        };
        let again = follow(&compile(text), &settings, &bad.choices).expect("it can start");
        assert_eq!(again, bad.what, "{}", file.display());
    }
    assert!(missed.len() * 5 <= programs.len(), "{missed:#?}");
}

#[test]
fn a_seed_means_one_schedule_in_whatever_series() {
    let (_, text) = corpus::programs("variable-update.wrong.esl").remove(0);
    let ends = |found: &RandomFound| -> Vec<_> {
        found.endings.iter().map(|ending| (ending.choices.clone(), ending.runs)).collect()
    };
    let (_, one) = random(&text, FEW);
    let (_, three) = random(&text, RandomSettings { jobs: 3, ..FEW });
    assert_eq!(ends(&one), ends(&three));
    // The second half of the seeds has what the whole has beyond the first half.
    let halves = [1, 76].map(|seed| random(&text, RandomSettings { seed, count: 75, ..FEW }).1);
    let runs = |found: &RandomFound| found.endings.iter().map(|ending| ending.runs).sum::<usize>();
    assert_eq!((runs(&one), halves.iter().map(runs).sum()), (150, 150));
    let least = one.least_probability(3);
    let (tasks, steps) = (one.tasks as f64, one.steps.max(one.assumed_steps) as f64);
    assert!(
        (least - 1.0 / (tasks * steps * steps)).abs() < 1e-12 && one.tasks == 3,
        "{least} {tasks} {steps}"
    );
}

#[test]
fn random_schedules_end_as_an_exploration_says() {
    for number in 0..oracle::variable("ESL_ORACLE_RANDOM", 12) {
        let text = generated::program(number).text();
        let (settings, found) = random(&text, RandomSettings { count: 60, ..FEW });
        let all = explore(&compile(&text), &Settings { states: 40_000, ..settings }).expect("it can start");
        if all.limit.is_some() {
            continue;
        }
        let known: BTreeSet<_> = oracle::ends(&all.endings);
        let random = oracle::ends(&found.endings);
        assert!(random.is_subset(&known), "program {number}: {random:?}\n{known:?}\n{text}");
    }
}
