//! Benchmarks of the steps before a program runs: reading, compiling, loading and verifying a file. The unit
//! of throughput is a line of the program.
#![allow(missing_docs, reason = "criterion's macros create undocumented functions")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_bytecode::compile::{Compile, drive};
use esl_compiler::diagnostic::Sources;
use esl_compiler::reader::{BareEnvironment, Reader};
use esl_compiler::session::Compiler;

/// A typical program.
const PLANT: &str = include_str!("../../examples/plant.esl");

fn frontend(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frontend");
    group.throughput(Throughput::Elements(PLANT.lines().count() as u64));
    let source = Sources::new().add("plant.esl", None);

    group.bench_function("read", |bencher| {
        bencher.iter(|| {
            let mut environment = BareEnvironment::new();
            let mut reader = Reader::new(source, PLANT);
            let mut count = 0;
            while let Some(datum) = reader.next(&mut environment) {
                black_box(datum.is_ok());
                count += 1;
            }
            count
        });
    });

    let host = || Box::new(VirtualHost::new());
    let mut machine =
        program::machine(esl::Config::default(), host()).expect("there is room for the library");
    group.bench_function("compile", |bencher| {
        bencher.iter(|| {
            machine.begin_unit();
            let mut compilation = Compiler::for_source(source).compile_text("plant.esl", PLANT);
            let (module, _) = drive(&mut *compilation, &mut machine);
            module.expect("the example compiles")
        });
    });

    let compiled = program::compile(&[Source::new("plant.esl", PLANT)]);
    let bytes = compiled.program.expect("the example compiles").to_bytes().expect("it can be written");
    group.bench_function("load_file", |bencher| {
        bencher.iter(|| Program::from_bytes(black_box(&bytes)).expect("it is sound"));
    });
    group.finish();
}

criterion_group!(benches, frontend);
criterion_main!(benches);
