//! `eslvm explore`.

use std::path::{Path, PathBuf};

use esl::module_path::ModulePath;
use esl::program::{self, Modules};
use esl_command as command;
use esl_command::{NOT_COMPILED, ProgramFile};
use esl_compiler::diagnostic::{Format, Renderer};
use esl_testing::explore;

use super::options::{ExploreArguments, FairnessChoice, GrainChoice, TimersChoice};
use super::processors;
use super::program::compiling;
use crate::explore::{ExplorationOptions, run};

/// Explores the schedules of a program. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_explore(
    file: &Path,
    options: &ExploreArguments,
    library: &[PathBuf],
    is_quiet: bool,
) -> Result<u8, u8> {
    for output in
        [&options.timeline, &options.svg, &options.findings, &options.progress].into_iter().flatten()
    {
        command::refuse_overwriting(output, [file])?;
    }
    let path = ModulePath::new([file], library);
    let mut read = None;
    let program = match command::read_program(file)? {
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(source) => {
            let source = &*read.insert(source);
            let compile = || program::compile_with(std::slice::from_ref(source), &path, Modules::Inside);
            let compiled = compiling(file, is_quiet, compile);
            let color = command::wants_color();
            command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
            compiled.program.ok_or(NOT_COMPILED)?
        }
    };
    let grain = options.grain.map(|grain| match grain {
        GrainChoice::Changes => explore::Grain::Changes,
        GrainChoice::Reads => explore::Grain::Reads,
        GrainChoice::Variables => explore::Grain::Variables,
        GrainChoice::Ticks => explore::Grain::Ticks,
    });
    let settings = explore::Settings {
        timers: match options.timers {
            TimersChoice::Idle => explore::TimerGrain::Idle,
            TimersChoice::Any => explore::TimerGrain::Any,
        },
        memory: options.memory,
        states: usize::try_from(options.states).unwrap_or(usize::MAX),
        switches: options.switches,
        faults: options.faults,
        aborts: options.aborts,
        crashes: options.crashes,
        symmetry: options.symmetry,
        output: false,
        fairness: match options.fairness {
            FairnessChoice::Weak => explore::Fairness::Weak,
            FairnessChoice::None => explore::Fairness::None,
        },
        ..explore::Settings::default()
    };
    let with_points = || {
        let source = read.as_ref()?;
        program::compile_with_points(std::slice::from_ref(source), &path).program
    };
    let (time, json) = (options.time, options.json);
    let jobs = options.jobs.map_or_else(processors, usize::from);
    let random = options.random.map(|count| explore::RandomSettings {
        count,
        seed: options.seed.unwrap_or(1),
        depth: options.depth,
        jobs,
        covers: options.progress.is_some(),
    });
    let (strict, deny_fragile) = (options.strict || !options.deny.is_empty(), !options.deny.is_empty());
    let is_endless = options.endless;
    let options = ExplorationOptions {
        settings,
        grain,
        jobs,
        time,
        is_endless,
        timeline: options.timeline.clone(),
        svg: options.svg.clone(),
        findings: options.findings.clone(),
        progress: options.progress.clone(),
        strict,
        deny_fragile,
        random,
        json,
        is_quiet,
    };
    Ok(run(&program, &with_points, file, &path, &options))
}
