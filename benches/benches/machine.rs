//! Benchmarks of the machine: the interpreter, the collector, start-up, and exploration.
#![allow(missing_docs, reason = "criterion's macros create undocumented functions")]

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl::{Config, Engine};
use esl_bytecode::datum::Datum;
use esl_testing::explore::{Grain, Settings, explore};
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskResult};
use esl_vm::vm::Vm;

fn engine(definitions: &str) -> Engine {
    let config = Config { memory: 1 << 30, ..Config::default() };
    let mut engine =
        Engine::with(config, Box::new(VirtualHost::new())).expect("there is room for the library");
    engine.eval(definitions).expect("the definitions are sound");
    engine
}

/// Measures typical operations of programs; each call takes about a millisecond.
fn interpreter(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("interpreter");
    for (name, definitions, call) in [
        ("calls", "(defun f (n) (if (< n 2) n (+ (f (- n 1)) (f (- n 2)))))", "(f 20)"),
        (
            "floats",
            "(defun f (n) (let ((x 0.5)) (dotimes (i n x) (setq x (* 3.7 x (- 1.0 x))))))",
            "(f 20000)",
        ),
        (
            "lists",
            "(defun f (n)
               (let ((sum 0))
                 (dolist (x (mapcar (lambda (x) (* x 2)) (loop for i below n collect i)) sum)
                   (incf sum x))))",
            "(f 5000)",
        ),
        (
            "tables",
            "(defun f (n) (let ((table (make-hash-table)))
               (dotimes (i n) (incf (gethash (mod i 100) table 0)))
               (gethash 7 table)))",
            "(f 5000)",
        ),
    ] {
        let mut engine = engine(definitions);
        group.bench_function(name, |bencher| bencher.iter(|| engine.eval(call).expect("it runs")));
    }
    group.finish();
}

/// Builds and drops trees beside live data. The unit of throughput is an allocated byte.
fn collector(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("collector");
    group
        .sample_size(10)
        .sampling_mode(SamplingMode::Flat)
        .measurement_time(Duration::from_secs(2))
        .warm_up_time(Duration::from_secs(1));
    for (name, live) in [("allocate_with_1_MB_live", 1_000_000), ("allocate_with_100_MB_live", 100_000_000)] {
        let mut engine = engine(DEFINITIONS);
        engine.eval(&format!("(defvar *live* (tree {}))", live / CONS_BYTES)).expect("there is room");
        group.throughput(Throughput::Bytes(CONSES * CONS_BYTES));
        group.bench_function(name, |bencher| {
            bencher.iter(|| engine.eval(&format!("(churn {CONSES})")).expect("it runs"));
        });
    }
    let config = Config { memory: 1 << 30, ..Config::default() };
    let mut machine =
        program::machine(config, Box::new(VirtualHost::new())).expect("there is room for the library");
    begin(&mut machine, DEFINITIONS);
    begin(&mut machine, &format!("(defvar *live* (tree {}))", 100_000_000 / CONS_BYTES));
    machine.run(u64::MAX);
    group.throughput(Throughput::Elements(1));
    // The duration of a whole cycle says nothing about pauses: the time of an iteration is the longest step
    // in it.
    group.bench_function("longest_step_with_100_MB_live", |bencher| {
        bencher.iter_custom(|iterations| (0..iterations).map(|_| longest_step(&mut machine)).sum());
    });
    group.finish();
}

/// Bytes of a cons.
const CONS_BYTES: u64 = 16;
/// Conses allocated by one iteration.
const CONSES: u64 = 500_000;

const DEFINITIONS: &str = "
(defun tree (n)
  (if (< n 2)
      (list n)
      (let ((half (floor (- n 1) 2)))
        (cons (tree half) (tree (- n 1 half))))))
(defun churn (n)
  (let ((kept nil))
    (dotimes (i n)
      (setq kept (if (= (mod i 1000) 0) nil (cons i kept))))))";

/// Returns the CPU time of this thread, which excludes time taken by other processes.
#[cfg(unix)]
fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

#[cfg(not(unix))]
fn thread_time() -> Duration {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed()
}

/// Begins a task that evaluates a text.
fn begin(machine: &mut Vm, text: &str) -> TaskId {
    let text = machine.import(&Datum::string(text, Default::default())).expect("there is room");
    machine.spawn_library("%EVAL-TEXT", &[text]).expect("the library has it")
}

/// Returns the longest step of a program that allocates enough for two whole cycles, run in steps of one
/// slice. Each step is a slice of the program with a collector turn in it.
fn longest_step(machine: &mut Vm) -> Duration {
    let cycles = machine.heap_stats().cycles;
    let id = begin(machine, "(churn 100000000)");
    let mut longest = Duration::ZERO;
    while machine.heap_stats().cycles < cycles + 2 {
        let start = thread_time();
        let outcome = machine.run(2000);
        longest = longest.max(thread_time() - start);
        assert_eq!(outcome, RunOutcome::TicksUsed, "the program is endless");
    }
    machine.abort(id);
    while machine.result(id) == TaskResult::Running {
        machine.run(2000);
    }
    machine.forget(id);
    longest
}

/// Measures the creation of a machine with the library, and a minimal program in it.
fn startup(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("startup");
    let host = || Box::new(VirtualHost::new());
    group.bench_function("machine", |bencher| {
        bencher.iter(|| program::machine(Config::default(), host()).expect("there is room for the library"));
    });
    let hello = include_str!("../programs/hello.esl");
    let compiled = program::compile(&[Source::new("hello.esl", hello)]);
    let bytes = compiled.program.expect("it compiles").to_bytes().expect("it can be written");
    group.bench_function("hello", |bencher| {
        bencher.iter(|| {
            let program = Program::from_bytes(black_box(&bytes)).expect("it is sound");
            program::run(&program, Config::default(), host()).expect("it runs")
        });
    });
    group.finish();
}

/// Two tasks that want different values of a property, and a change from outside: the case model-checked in
/// 1997.
const TWO_TASKS: &str = "
  (define-property power (device))
  (to-achieve (power device value)
    (t (assert (list 'power device value))))
  (defun want (value)
    (with-recovery-procedures ((:property-lock-unavailable (abort :unavailable))
                               (:maintained-property-violation (abort :violated)))
      (with-maintained-property (power 'camera value)
        (sleep 0)
        (power 'camera))))
  (spawn (want :on))
  (spawn (want :off))
  (assert '(power camera :broken))";

/// Explores the first states of a program, with snapshots and by a new machine for each run. The unit of
/// throughput is a state.
fn exploration(criterion: &mut Criterion) {
    const STATES: usize = 3000;
    let compiled = program::compile(&[Source::new("two-tasks.esl", TWO_TASKS)]);
    let program = compiled.program.expect("it compiles");
    let mut group = criterion.benchmark_group("exploration");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(STATES as u64));
    for (name, snapshots) in [("snapshots", true), ("new machines", false)] {
        let settings = Settings {
            grain: Grain::Changes,
            states: STATES,
            snapshots,
            output: false,
            ..Settings::default()
        };
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let found = explore(&program, &settings).expect("it can start");
                assert_eq!(found.states, STATES);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, interpreter, collector, startup, exploration);
criterion_main!(benches);
