//! A line at the terminal that says how far a long job is: erased when the job is over, and never seen where
//! standard error is not a terminal.

use std::io::{IsTerminal, Write};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time that a job takes before it is said how far it is.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two lines.
const PAUSE: Duration = Duration::from_millis(200);
/// Width of a terminal that does not say how wide it is.
const COLUMNS: usize = 80;

/// Whether standard error is a terminal that understands more than text.
fn is_screen() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("TERM").is_none_or(|name| name != "dumb")
}

/// Returns whether text on standard error has colours by default: it is a terminal, and the variable
/// `NO_COLOR` is not set.
pub fn wants_color() -> bool {
    is_screen() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// The line of one job.
pub struct StatusLine {
    /// Where it is shown, if it is, and whether there is one now.
    screen: Option<Mutex<(Box<dyn Write + Send>, bool)>>,
    columns: usize,
    patience: Duration,
    started: Instant,
}

impl StatusLine {
    /// Begins a job. It has no line if `is_quiet` or if standard error is not a terminal.
    pub fn new(is_quiet: bool) -> StatusLine {
        let screen: Box<dyn Write + Send> = Box::new(std::io::stderr());
        let screen = (!is_quiet && is_screen()).then(|| Mutex::new((screen, false)));
        StatusLine { screen, columns: columns(), patience: PATIENCE, started: Instant::now() }
    }

    /// Does the job, on this thread, while `line` is shown with the seconds that the job has taken.
    pub fn during<T>(&self, line: impl Fn() -> String + Sync, job: impl FnOnce() -> T) -> T {
        if self.screen.is_none() {
            return job();
        }
        std::thread::scope(|scope| {
            // Dropped when the job is over, also if it panics.
            let (_ends, over) = channel::<()>();
            let line = &line;
            scope.spawn(move || {
                let mut pause = self.patience;
                while over.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                    self.show(&format!("{}, {} s", line(), self.started.elapsed().as_secs()));
                    pause = PAUSE;
                }
                self.clear();
            });
            job()
        })
    }

    /// Shows a line in place of the last one.
    pub fn show(&self, line: &str) {
        let Some(screen) = &self.screen else { return };
        let (screen, is_shown) = &mut *screen.lock().unwrap_or_else(PoisonError::into_inner);
        // A line that is too long would go on in the next one, which is not erased. Control characters are
        // not part of it.
        let width = self.columns.saturating_sub(1);
        let line: String = line.chars().filter(|c| !c.is_control()).take(width).collect();
        // A terminal that does not take the line is not a reason to stop.
        _ = write!(screen, "\r\x1b[K{line}").and_then(|()| screen.flush());
        *is_shown = true;
    }

    /// Erases the line.
    pub fn clear(&self) {
        self.beneath(|| ());
    }

    /// Erases the line, and does something that writes to the terminal.
    pub fn beneath<T>(&self, write: impl FnOnce() -> T) -> T {
        let Some(screen) = &self.screen else { return write() };
        let (screen, is_shown) = &mut *screen.lock().unwrap_or_else(PoisonError::into_inner);
        if std::mem::take(is_shown) {
            _ = write!(screen, "\r\x1b[K").and_then(|()| screen.flush());
        }
        write()
    }
}

#[cfg(unix)]
fn columns() -> usize {
    let size = rustix::termios::tcgetwinsize(std::io::stderr()).ok();
    size.map(|size| usize::from(size.ws_col)).filter(|&columns| columns > 0).unwrap_or(COLUMNS)
}

#[cfg(not(unix))]
fn columns() -> usize {
    COLUMNS
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[derive(Clone, Default)]
    struct Paper(Arc<Mutex<Vec<u8>>>);

    impl Write for Paper {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().expect("nobody panics").write(bytes)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn line_on(screen: &Paper, columns: usize) -> StatusLine {
        StatusLine {
            screen: Some(Mutex::new((Box::new(screen.clone()), false))),
            columns,
            patience: Duration::ZERO,
            started: Instant::now(),
        }
    }

    fn text(screen: &Paper) -> String {
        String::from_utf8(screen.0.lock().expect("nobody panics").clone()).expect("it is text")
    }

    #[test]
    fn a_line_is_erased_before_anything_else_is_written() {
        let screen = Paper::default();
        let line = line_on(&screen, 8);
        line.clear();
        assert_eq!(text(&screen), "");
        line.show("12 of\x1b[2J 40 tests");
        assert_eq!(text(&screen), "\r\x1b[K12 of[2");
        let mut other = screen.clone();
        line.beneath(|| other.write_all(b"passed\n")).expect("it is written");
        assert_eq!(text(&screen), "\r\x1b[K12 of[2\r\x1b[Kpassed\n");
    }

    #[test]
    fn the_line_of_a_job_is_gone_when_the_job_is_over() {
        let screen = Paper::default();
        let line = line_on(&screen, 80);
        let value = line.during(
            || "compiling".into(),
            || {
                while text(&screen).is_empty() {
                    std::thread::yield_now();
                }
                5
            },
        );
        assert_eq!(value, 5);
        let text = text(&screen);
        assert!(text.starts_with("\r\x1b[Kcompiling, ") && text.ends_with("\r\x1b[K"), "{text:?}");
    }
}
