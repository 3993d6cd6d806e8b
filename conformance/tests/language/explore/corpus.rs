//! Explores the programs of `conformance/schedules`: pairs of programs of the same shape, one of which ends
//! badly under some schedule. Many are shaped like reported defects of robots, servers and schedulers; then
//! the program names the report.

use std::path::{Path, PathBuf};

use esl::program::Ended;
use esl_testing::explore::{ExplorationScope, Grain, Settings, explore, grains};

use super::{compile, outputs};

/// Returns the programs whose names end in this, in the order of their names.
pub(super) fn programs(ending: &str) -> Vec<(PathBuf, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("schedules");
    let files = std::fs::read_dir(folder).expect("the folder can be read");
    let mut files: Vec<PathBuf> = files.map(|file| file.expect("it has a name").path()).collect();
    files.retain(|file| file.to_string_lossy().ends_with(ending));
    files.sort_unstable();
    files.into_iter().map(|file| (file.clone(), std::fs::read_to_string(file).expect("it is text"))).collect()
}

/// Explores a program as `eslvm explore` does. Returns the last grain, whether some schedule ends badly, and
/// whether the exploration is complete.
fn verdict(text: &str) -> (Grain, bool, bool) {
    let program = compile(text);
    let mut last = None;
    for grain in grains(&program, None) {
        let settings = Settings { grain, ..Settings::default() };
        let found = explore(&program, &settings).expect("the program can start");
        let ends_badly = found.endings.iter().any(|ending| ending.what.ended != Ended::Normally(0));
        let is_complete = ExplorationScope::new(&program, &settings, &found).is_complete();
        last = Some((grain, ends_badly || found.endless.is_some(), is_complete));
        if ends_badly {
            break;
        }
    }
    last.expect("there is a grain")
}

#[test]
fn what_ends_badly_is_found() {
    let programs = programs(".wrong.esl");
    assert!(programs.len() >= 20, "{} programs", programs.len());
    for (file, text) in programs {
        let (grain, ends_badly, _) = verdict(&text);
        assert!(ends_badly, "{}: nothing is found at grain {}", file.display(), grain.name());
    }
}

#[test]
fn what_ends_well_is_called_complete() {
    let programs = programs(".right.esl");
    assert!(programs.len() >= 20, "{} programs", programs.len());
    for (file, text) in programs {
        let (grain, ends_badly, is_complete) = verdict(&text);
        let says = (ends_badly, is_complete);
        assert_eq!(says, (false, true), "{} at grain {}", file.display(), grain.name());
    }
}

#[test]
fn each_program_has_a_twin() {
    let names = |ending: &str| -> Vec<String> {
        let name = |file: &Path| file.file_name().expect("a file has a name").to_string_lossy().into_owned();
        let files = programs(ending);
        files.iter().map(|(file, _)| name(file).trim_end_matches(ending).to_owned()).collect()
    };
    assert_eq!(names(".wrong.esl"), names(".right.esl"));
}

#[test]
fn what_is_complete_ends_as_with_switches_at_all_ticks() {
    for (file, text) in programs(".right.esl") {
        let program = compile(&text);
        let explored =
            |grain| explore(&program, &Settings { grain, ..Settings::default() }).expect("it can start");
        let found = explored(Grain::Variables);
        let settings = Settings::default();
        // The largest take minutes at grain `ticks`.
        if found.states > 1000 || !ExplorationScope::new(&program, &settings, &found).is_complete() {
            continue;
        }
        assert_eq!(outputs(&found), outputs(&explored(Grain::Ticks)), "{}", file.display());
    }
}
