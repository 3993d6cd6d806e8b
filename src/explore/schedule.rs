//! Schedules as files: `eslvm explore` writes them, `eslvm run --schedule` runs a program by one.
//!
//! ```text
//! esl-schedule 1
//! program 5d2c01ff
//! grain changes
//! turn 100000
//! choices 0 1 0 0 2
//! ```

use std::fmt;

use super::{Grain, Settings};
use crate::program::Program;

/// First line of a file.
const HEADER: &str = "esl-schedule 1";

/// Most choices in a file.
const MOST_CHOICES: usize = 10_000_000;

/// A schedule of a program: which task goes on at each point.
///
/// ```
/// use esl::explore::{Schedule, Settings};
/// use esl::program::{Source, compile};
///
/// let program = compile(&[Source::new("one.esl", "(print 1)")]).program.expect("it compiles");
/// let schedule = Schedule::new(&program, &Settings::default(), vec![0, 1]);
/// let read = Schedule::parse(&schedule.to_string())?;
/// assert_eq!(read, schedule);
/// assert!(read.is_of(&program));
/// # Ok::<(), esl::explore::ScheduleError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Checksum of the program.
    program: u32,
    grain: Grain,
    turn: u32,
    choices: Vec<u32>,
}

/// Why a text is no schedule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ScheduleError {
    /// It does not begin as a schedule does.
    Header,
    /// A line, counted from 1, is not what is expected there.
    Line {
        /// Number of the line.
        line: usize,
        /// What is expected.
        expected: &'static str,
    },
}

impl fmt::Display for ScheduleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScheduleError::Header => write!(f, "its first line is not `{HEADER}`"),
            ScheduleError::Line { line, expected } => write!(f, "line {line}: expected {expected}"),
        }
    }
}

impl std::error::Error for ScheduleError {}

impl Schedule {
    /// Returns the schedule with these choices, which an exploration with these settings has found.
    pub fn new(program: &Program, settings: &Settings, choices: Vec<u32>) -> Schedule {
        Schedule { program: checksum(program), grain: settings.grain, turn: settings.turn, choices }
    }

    /// Parses the text of a file.
    ///
    /// # Errors
    /// [`ScheduleError`], if it is no schedule.
    pub fn parse(text: &str) -> Result<Schedule, ScheduleError> {
        let mut lines = text.lines();
        if lines.next() != Some(HEADER) {
            return Err(ScheduleError::Header);
        }
        let mut field = |line: usize, name: &str, expected: &'static str| {
            let text = lines.next().and_then(|text| text.strip_prefix(name));
            text.and_then(|text| text.strip_prefix(' ').or(text.is_empty().then_some("")))
                .ok_or(ScheduleError::Line { line, expected })
        };
        let program = field(2, "program", "`program` and a checksum")?;
        let program = u32::from_str_radix(program, 16)
            .map_err(|_| ScheduleError::Line { line: 2, expected: "a checksum in hexadecimal digits" })?;
        let grain = match field(3, "grain", "`grain changes` or `grain reads`")? {
            "changes" => Grain::Changes,
            "reads" => Grain::Reads,
            _ => return Err(ScheduleError::Line { line: 3, expected: "`changes` or `reads`" }),
        };
        let turn = field(4, "turn", "`turn` and a number of ticks")?;
        let turn = turn.parse().ok().filter(|&turn| turn > 0);
        let turn = turn.ok_or(ScheduleError::Line { line: 4, expected: "a number of ticks" })?;
        let words = field(5, "choices", "`choices` and numbers")?.split_ascii_whitespace();
        let choices = words.take(MOST_CHOICES).map(str::parse).collect::<Result<Vec<u32>, _>>();
        let choices = choices.map_err(|_| ScheduleError::Line { line: 5, expected: "numbers" })?;
        Ok(Schedule { program, grain, turn, choices })
    }

    /// Returns whether the schedule was found in this very program.
    pub fn is_of(&self, program: &Program) -> bool {
        self.program == checksum(program)
    }

    /// Returns the settings with which the choices lead to where they were found.
    pub fn settings(&self) -> Settings {
        Settings { grain: self.grain, turn: self.turn, ..Settings::default() }
    }

    /// Returns the choices.
    pub fn choices(&self) -> &[u32] {
        &self.choices
    }
}

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let grain = match self.grain {
            Grain::Changes => "changes",
            Grain::Reads => "reads",
        };
        write!(f, "{HEADER}\nprogram {:08x}\ngrain {grain}\nturn {}\nchoices", self.program, self.turn)?;
        self.choices.iter().try_for_each(|choice| write!(f, " {choice}"))?;
        writeln!(f)
    }
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
        let good = "esl-schedule 1\nprogram 00ff00ff\ngrain reads\nturn 500\nchoices 0 3\n";
        let schedule = Schedule::parse(good).expect("it is a schedule");
        assert_eq!((schedule.to_string().as_str(), schedule.choices()), (good, &[0, 3][..]));
        assert_eq!((schedule.settings().grain, schedule.settings().turn), (Grain::Reads, 500));
        let line = |text: &str| match Schedule::parse(text) {
            Err(ScheduleError::Line { line, .. }) => line,
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(Schedule::parse("(print 1)"), Err(ScheduleError::Header));
        assert_eq!(line("esl-schedule 1\n"), 2);
        assert_eq!(line(&good.replace("00ff00ff", "none")), 2);
        assert_eq!(line(&good.replace("reads", "all")), 3);
        assert_eq!(line(&good.replace("500", "0")), 4);
        assert_eq!(line(&good.replace("3", "x")), 5);
        assert_eq!(line(&good.replace("choices", "choice")), 5);
    }
}
