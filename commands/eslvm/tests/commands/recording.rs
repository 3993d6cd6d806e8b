//! Recording a run that talks to the outside, and replaying it without.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use esl::Config;
use esl::host::{Host, RealHost, RecordingHost, ReplayHost, Right, Rights};
use esl::module_path::ModulePath;
use esl::program::{self, Ended, Modules};
use esl_command::ProgramFile;

use crate::eslvm;
use crate::examples::{example, start_simulator};

/// Runs the executive in this process. Returns how it ends, its canary and its ticks.
fn fly(host: impl FnOnce(&ModulePath) -> Box<dyn Host + Send>) -> (Ended, u64, u64) {
    let file = example("spacecraft/simulated.esl");
    let path = ModulePath::new([file.as_path()], &[]);
    let Ok(ProgramFile::Source(source)) = esl_command::read_program(Path::new(&file)) else {
        panic!("it is a source")
    };
    let program = program::compile_with(&[source], &path, Modules::Inside).program.expect("it compiles");
    let mut machine = program::machine(Config::default(), host(&path)).expect("there is room");
    esl_world::install_operations(&mut machine);
    program::set_module_path(&mut machine, &path).expect("there is room");
    let summary = program::run_in(&mut machine, &program).expect("it can be begun");
    (summary.ended, machine.canary(), summary.ticks)
}

/// The connection, its telemetry and the orders are all in the record: nothing is connected to when it is
/// replayed, and the run is the same to the tick.
#[test]
fn a_recorded_flight_is_replayed_without_the_spacecraft() {
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "--speed", "10"]);
    command.arg(example("spacecraft/stand-in.esl")).arg("0");
    let (mut simulator, _output, port) = start_simulator(&mut command);
    let said = Arc::new(Mutex::new(Vec::new()));
    let mut recording = None;
    let flown = fly(|path| {
        let said = said.clone();
        let screen = move |bytes: &[u8]| {
            said.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
            Ok(())
        };
        let host = RealHost::new(vec![port, "crater".into()])
            .with_rights(path.with_rights(Rights::none().with(Right::Net, "127.0.0.1")))
            .with_speed(10.0)
            .with_screen(Box::new(screen));
        let host = RecordingHost::new(host);
        recording = Some(host.recording());
        Box::new(host)
    });
    simulator.kill().expect("it runs");
    simulator.wait().expect("it ends");
    let said = String::from_utf8(said.lock().unwrap_or_else(PoisonError::into_inner).clone());
    let said = said.expect("it is text");
    assert!(said.ends_with("pointing at SUN\n"), "{said}");
    let replay = ReplayHost::new(recording.expect("it was made").to_records());
    let again = fly(|_| Box::new(replay.clone()));
    assert_eq!(again, flown);
    assert_eq!(flown.0, Ended::Normally(0));
    assert!(replay.is_at_end() && !replay.has_diverged());
    assert_eq!(replay.captured().output(), said);
}
