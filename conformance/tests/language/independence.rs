//! Checks that the machines of a process share no state and can move between threads while they run.

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_vm::run::RunOutcome;
use esl_vm::vm::Vm;

/// Uses tasks, an event, facts, a global variable, random numbers and output.
const PROGRAM: &str = "
    (defvar *n* 0)
    (defvar *bump* (make-event 'bump))
    (dolist (name '(a b c))
      (let ((name name))
        (spawn (dotimes (i 200) (incf *n*) (assert (list 'turn name i)) (signal *bump* name) (sleep 0.01)))))
    (spawn (dotimes (i 50) (wait-for-event *bump*)))
    (sleep 10)
    (print (list *n* (length (db-query '(turn a ?i))) (random 1000000) (intern \"FRESH\") (now)))
    (print (length (list-tasks)))";

fn machine(program: &Program, seed: u64) -> (Vm, esl::host::Captured) {
    let host = VirtualHost::new();
    let captured = host.captured();
    let config = Config { seed, ..Config::default() };
    let mut machine = program::machine(config, Box::new(host)).expect("there is room for the library");
    program::begin(&mut machine, program).expect("it can start");
    (machine, captured)
}

fn is_send<T: Send>() {}

#[test]
fn interleaved_machines_do_what_each_does_alone() {
    is_send::<Vm>();
    is_send::<esl::Engine>();
    let compiled = program::compile(&[Source::new("program", PROGRAM)]);
    let program = compiled.program.expect("it compiles");
    let alone: Vec<(String, u64)> = (0..4)
        .map(|seed| {
            let (mut machine, captured) = machine(&program, seed);
            assert_eq!(machine.run(u64::MAX), RunOutcome::Done);
            machine.flush();
            (captured.output(), machine.ticks())
        })
        .collect();
    assert!(alone[0].0.contains("(600 200 "), "{}", alone[0].0);

    // Interleave the machines, a few ticks at a time, each step in a thread of its own.
    let mut machines: Vec<_> = (0..4).map(|seed| (machine(&program, seed), false)).collect();
    while machines.iter().any(|(_, is_done)| !is_done) {
        machines = machines
            .into_iter()
            .map(|((mut machine, captured), _)| {
                let thread = std::thread::spawn(move || {
                    let is_done = machine.run(20_000) != RunOutcome::TicksUsed;
                    machine.flush();
                    (machine, is_done)
                });
                let (machine, is_done) = thread.join().expect("it does not panic");
                ((machine, captured), is_done)
            })
            .collect();
    }
    for (((_, captured), _), (output, _)) in machines.iter().zip(&alone) {
        assert_eq!(captured.output(), *output);
    }

    // Run all machines at the same time.
    let threads: Vec<_> = (0..4)
        .map(|seed| {
            let (mut machine, captured) = machine(&program, seed);
            std::thread::spawn(move || {
                machine.run(u64::MAX);
                machine.flush();
                (captured.output(), machine.ticks())
            })
        })
        .collect();
    for (thread, expected) in threads.into_iter().zip(&alone) {
        assert_eq!(thread.join().expect("it does not panic"), *expected);
    }
}
