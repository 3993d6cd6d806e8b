//! Schedules as files: `eslvm explore` writes them, `eslvm run --schedule` runs a program by one.
//!
//! ```text
//! esl-schedule 2
//! machine 1-03a7c55e
//! program 5d2c01ff
//! grain changes
//! timers idle aborts 1
//! turn 100000
//! choices 0 1 0 0 2
//! end
//! ```
//!
//! Behind the grain, `strict` means a program that is compiled with points; behind the timers, the number of
//! aborts by an operator is left out if there are none, and so is that of restarts, `crashes 1`. The machine
//! is the epoch of its behaviour and a checksum of its library: on another one, choices lead elsewhere.

use std::fmt;

use esl_vm::explore::{Grain, Settings, TimerGrain};

use super::{ExecutionIdentity, Program};

/// First line of a file.
const HEADER: &str = "esl-schedule 2";

/// Last line of a file, so that one that was cut off is noticed.
const END: &str = "end";

/// Most choices in a file.
const MOST_CHOICES: usize = 10_000_000;

/// A schedule of a program: which task goes on at each point.
///
/// ```
/// use esl::program::{Schedule, Settings, Source, compile};
///
/// let program = compile(&[Source::new("one.esl", "(print 1)")]).program.expect("it compiles");
/// let schedule = Schedule::new(&program, &Settings::default(), vec![0, 1]);
/// let read = Schedule::parse(&schedule.to_string())?;
/// assert_eq!(read, schedule);
/// assert!(read.is_of(&program));
/// # Ok::<(), esl::program::ScheduleError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Epoch of the machine's behaviour, and checksum of its library.
    machine: (u32, u32),
    /// Checksum of the program.
    program: u32,
    grain: Grain,
    /// Whether tasks stop at the points of the program, which is compiled with them.
    strict: bool,
    timers: TimerGrain,
    /// Most aborts by an operator.
    aborts: u32,
    /// Most restarts that interrupt calls.
    crashes: u32,
    turn: u32,
    choices: Vec<u32>,
}

/// Why a text is not a schedule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ScheduleError {
    /// It does not begin as a schedule does.
    Header,
    /// It is of another version.
    Version,
    /// A line, counted from 1, is not what is expected there.
    Line {
        /// Number of the line.
        line: usize,
        /// The expected contents.
        expected: &'static str,
    },
}

impl fmt::Display for ScheduleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScheduleError::Header => write!(f, "its first line is not `{HEADER}`"),
            ScheduleError::Version => f.write_str("another version of eslvm has written it: explore again"),
            ScheduleError::Line { line, expected } => write!(f, "line {line}: expected {expected}"),
        }
    }
}

impl std::error::Error for ScheduleError {}

impl Schedule {
    /// Returns the schedule with these choices, which an exploration with these settings has found.
    pub fn new(program: &Program, settings: &Settings, choices: Vec<u32>) -> Schedule {
        let Settings { grain, strict, timers, aborts, crashes, turn, .. } = *settings;
        let (machine, program) = (this_machine(), checksum(program));
        Schedule { machine, program, grain, strict, timers, aborts, crashes, turn, choices }
    }

    /// Parses the text of a file.
    ///
    /// # Errors
    /// [`ScheduleError`], if it is not a schedule.
    pub fn parse(text: &str) -> Result<Schedule, ScheduleError> {
        let mut lines = text.lines();
        match lines.next() {
            Some(HEADER) => {}
            Some(line) if line.starts_with("esl-schedule ") => return Err(ScheduleError::Version),
            _ => return Err(ScheduleError::Header),
        }
        let mut field = |line: usize, name: &str, expected: &'static str| {
            let text = lines.next().and_then(|text| text.strip_prefix(name));
            text.and_then(|text| text.strip_prefix(' ').or(text.is_empty().then_some("")))
                .ok_or(ScheduleError::Line { line, expected })
        };
        let wrong = |line, expected| ScheduleError::Line { line, expected };
        let hexadecimal = |text| u32::from_str_radix(text, 16).ok();
        let machine = field(2, "machine", "`machine`, a number and a checksum")?.split_once('-');
        let machine = machine.and_then(|(epoch, sum)| Some((epoch.parse().ok()?, hexadecimal(sum)?)));
        let machine = machine.ok_or(wrong(2, "a number, `-`, and a checksum in hexadecimal digits"))?;
        let program = hexadecimal(field(3, "program", "`program` and a checksum")?);
        let program = program.ok_or(wrong(3, "a checksum in hexadecimal digits"))?;
        let grain = field(4, "grain", "`grain`, and `changes`, `reads`, `variables` or `ticks`")?;
        let (grain, strict) = grain.strip_suffix(" strict").map_or((grain, false), |grain| (grain, true));
        let grain = Grain::from_name(grain).ok_or(wrong(4, "`changes`, `reads`, `variables` or `ticks`"))?;
        let timers = field(5, "timers", "`timers idle` or `timers any`")?;
        let (timers, crashes) = timers.split_once(" crashes ").unwrap_or((timers, "0"));
        let crashes = crashes.parse().map_err(|_| wrong(5, "`crashes` and a number"))?;
        let (timers, aborts) = timers.split_once(" aborts ").unwrap_or((timers, "0"));
        let timers = TimerGrain::from_name(timers).ok_or(wrong(5, "`idle` or `any`"))?;
        let aborts = aborts.parse().map_err(|_| wrong(5, "`aborts` and a number"))?;
        let turn = field(6, "turn", "`turn` and a number of ticks")?;
        let turn = turn.parse().ok().filter(|&turn| turn > 0).ok_or(wrong(6, "a number of ticks"))?;
        let words = field(7, "choices", "`choices` and numbers")?.split_ascii_whitespace();
        let choices = words.take(MOST_CHOICES).map(str::parse).collect::<Result<Vec<u32>, _>>();
        let choices = choices.map_err(|_| wrong(7, "numbers"))?;
        let is_whole = lines.next() == Some(END) && lines.next().is_none() && text.ends_with('\n');
        if !is_whole {
            return Err(wrong(8, "`end`, and nothing more"));
        }
        Ok(Schedule { machine, program, grain, strict, timers, aborts, crashes, turn, choices })
    }

    /// Returns whether the schedule was found by a machine that behaves as this one does.
    pub fn is_of_this_machine(&self) -> bool {
        self.machine == this_machine()
    }

    /// Returns whether the schedule was found in this very program.
    pub fn is_of(&self, program: &Program) -> bool {
        self.program == checksum(program)
    }

    /// Returns the settings with which the choices lead to where they were found.
    pub fn settings(&self) -> Settings {
        let Schedule { grain, strict, timers, aborts, crashes, turn, .. } = *self;
        Settings { grain, strict, timers, aborts, crashes, turn, ..Settings::default() }
    }

    /// Returns whether it is of the program as [`compile_with_points`](super::compile_with_points) compiles
    /// it.
    pub fn is_strict(&self) -> bool {
        self.strict
    }

    /// Returns the choices.
    pub fn choices(&self) -> &[u32] {
        &self.choices
    }
}

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (grain, timers) = (self.grain.name(), self.timers.name());
        let strict = if self.strict { " strict" } else { "" };
        let (epoch, library) = self.machine;
        write!(f, "{HEADER}\nmachine {epoch}-{library:08x}\nprogram {:08x}\n", self.program)?;
        write!(f, "grain {grain}{strict}\ntimers {timers}")?;
        if self.aborts > 0 {
            write!(f, " aborts {}", self.aborts)?;
        }
        if self.crashes > 0 {
            write!(f, " crashes {}", self.crashes)?;
        }
        write!(f, "\nturn {}\nchoices", self.turn)?;
        self.choices.iter().try_for_each(|choice| write!(f, " {choice}"))?;
        writeln!(f, "\n{END}")
    }
}

/// Returns the epoch of this machine's behaviour, and the checksum of its library.
fn this_machine() -> (u32, u32) {
    let identity = ExecutionIdentity::current();
    (identity.epoch, identity.library)
}

/// Returns the checksum of a program; 0 for one that no file can hold.
fn checksum(program: &Program) -> u32 {
    program.to_bytes().map_or(0, |bytes| crc32fast::hash(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_schedule_is_refused_with_its_line() {
        let good = "esl-schedule 2\nmachine 1-0000000a\nprogram 00ff00ff\ngrain reads\ntimers any\nturn 500\n\
                    choices 0 3\nend\n";
        let schedule = Schedule::parse(good).expect("it is a schedule");
        assert_eq!((schedule.to_string().as_str(), schedule.choices()), (good, &[0, 3][..]));
        let Settings { grain, timers, turn, .. } = schedule.settings();
        assert_eq!((grain, timers, turn), (Grain::Reads, TimerGrain::Any, 500));
        assert!(!schedule.is_of_this_machine() && !schedule.is_strict());
        let strict = good.replace("reads", "reads strict");
        let schedule = Schedule::parse(&strict).expect("it is a schedule");
        assert_eq!((schedule.to_string(), schedule.is_strict()), (strict, true));
        let aborts = good.replace("any", "any aborts 2");
        let schedule = Schedule::parse(&aborts).expect("it is a schedule");
        assert_eq!((schedule.to_string(), schedule.settings().aborts), (aborts, 2));
        let crashes = good.replace("any", "any aborts 2 crashes 1");
        let schedule = Schedule::parse(&crashes).expect("it is a schedule");
        assert_eq!((schedule.to_string(), schedule.settings().crashes), (crashes, 1));
        let line = |text: &str| match Schedule::parse(text) {
            Err(ScheduleError::Line { line, .. }) => line,
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(Schedule::parse("(print 1)"), Err(ScheduleError::Header));
        assert_eq!(Schedule::parse("esl-schedule 1\nprogram 00ff00ff\n"), Err(ScheduleError::Version));
        assert_eq!(line("esl-schedule 2\n"), 2);
        let wrong = [
            ("1-", "1/", 2),
            ("00ff00ff", "none", 3),
            ("reads", "all", 4),
            ("any", "some", 5),
            ("any", "any aborts", 5),
            ("any", "any crashes x", 5),
        ];
        let further = [("500", "0", 6), ("3", "x", 7), ("choices", "choice", 7), ("end", "", 8)];
        for (right, wrong, number) in wrong.into_iter().chain(further) {
            assert_eq!(line(&good.replace(right, wrong)), number, "{wrong}");
        }
        // Wherever it is cut off, that is noticed.
        for end in good.find('\n').unwrap_or(0) + 1..good.len() {
            assert!(Schedule::parse(&good[..end]).is_err(), "{}", &good[..end]);
        }
    }
}
