//! Canaries of forty programs, as they were when the epoch of the machine's behaviour was counted last.
//!
//! Records of runs hold answers by the order of questions and by rounds, so a machine that takes other turns
//! cannot replay them. Its tables and library say themselves that they have changed. Of the rest, ticks,
//! paces and orders, the canaries say it: when they change, `EXECUTION_EPOCH` has to.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, ExecutionIdentity, Source};
use esl_vm::run::RunOutcome;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// Runs a program in portions of `ticks`, and returns its canary and strict fingerprint at the end.
fn course(name: &str, ticks: u64) -> (u64, u128) {
    let path = root().join("programs").join(format!("{name}.esl"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let program = program::compile(&[Source::new(name, text)]).program.expect("it compiles");
    let config = Config { memory: 64 << 20, ..Config::default() };
    let mut machine = program::machine(config, Box::new(VirtualHost::new())).expect("it has room");
    program::begin(&mut machine, &program).expect("it can start");
    while machine.run(ticks) == RunOutcome::TicksUsed {}
    (machine.canary(), machine.fingerprint())
}

#[test]
fn canaries_change_with_the_epoch_only() {
    let path = root().join("golden/canaries.txt");
    let golden = std::fs::read_to_string(&path).expect("the file is there");
    let rows: Vec<(&str, &str)> = golden.lines().filter_map(|line| line.split_once(' ')).collect();
    let (head, rows) = rows.split_at(1);
    assert_eq!((head[0].0, rows.len()), ("identity", 40));

    let now = ExecutionIdentity::current().to_string();
    let mut text = format!("identity {now}\n");
    let mut changed = Vec::new();
    for (name, canary) in rows {
        let (found, _) = course(name, u64::MAX);
        writeln!(text, "{name} {found:016x}").expect("a string takes it");
        if format!("{found:016x}") != *canary {
            changed.push(*name);
        }
    }
    if std::env::var_os("ESL_BLESS").is_some() {
        assert!(
            changed.is_empty() || head[0].1 != now,
            "the machine takes other turns: count EXECUTION_EPOCH in vm/src/lib.rs, then bless again"
        );
        return std::fs::write(&path, text).expect("the file can be written");
    }
    // With another library or compiler, other turns are expected, and old records are refused anyway.
    assert!(
        changed.is_empty() || head[0].1 != now,
        "the canaries of {} programs have changed ({}): records of runs do not replay. If that is meant, count \
         EXECUTION_EPOCH in vm/src/lib.rs and run this test with ESL_BLESS=1",
        changed.len(),
        changed[0],
    );
    if head[0].1 != now {
        let stale =
            format!("{} is of another library; {} canaries differ: bless it", path.display(), changed.len());
        writeln!(std::io::stderr(), "{stale}").expect("there is an error output");
    }
}

#[test]
fn a_second_machine_agrees_in_the_strict_fingerprint_whatever_the_portions() {
    for name in ["tasks/the_task_net_of_the_paper_prints_1_2_3_4", "database/rules_derive_facts"] {
        let whole = course(name, u64::MAX);
        for ticks in [1, 777, 2000] {
            assert_eq!(course(name, ticks), whole, "{name} in portions of {ticks}");
        }
    }
}
