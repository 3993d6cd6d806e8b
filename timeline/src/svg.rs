//! A short run as one drawing: a row for each task with its activities as bars, signals as arrows, failures,
//! recoveries and ends as signs, and collections as bands behind the rows.
//!
//! The drawing is made when the run is over, so the number of its items is bounded. A longer run is drawn up
//! to where that number is reached, and the drawing says so.

use std::collections::HashMap;
use std::fmt::Write as _;

use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;

use super::covered::Covered;

/// Most bars, arrows, signs and bands in a drawing.
const ITEMS: usize = 20_000;
/// Most rows in a drawing.
const ROWS: usize = 100;

// Lengths in pixels.
const WIDTH: f64 = 1200.0;
/// Width of the names of tasks, at least and at most.
const NAMES: (f64, f64) = (90.0, 360.0);
const RIGHT: f64 = 30.0;
const TOP: f64 = 64.0;
const ROW: f64 = 36.0;
/// Distance from the top of a row, which is left to texts, to its bars.
const BAR: f64 = 14.0;
const BAR_HEIGHT: f64 = 16.0;
/// Width of a character of the texts in bars and above them.
const CHARACTER: f64 = 5.6;
/// Width of a character of a name.
const NAME_CHARACTER: f64 = 7.0;
/// Half of the width of a sign.
const SIGN: f64 = 6.0;

/// Activity of a task, drawn as a bar.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Activity {
    Runs,
    Ready,
    Waits(String),
    IsSuspended(String),
}

struct Bar {
    state: Activity,
    begin: u64,
    end: u64,
}

/// Event in the life of a task, drawn as a sign.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sign {
    Signals,
    Fails,
    Recovers,
    IsToEnd,
    Ends(&'static str),
}

struct TaskRow {
    name: String,
    bars: Vec<Bar>,
    /// Activity that has not ended, and its begin.
    open: Option<(Activity, u64)>,
    marks: Vec<(u64, Sign, String)>,
}

/// A run, as far as it will be drawn.
#[derive(Default)]
pub struct Drawing {
    rows: Vec<TaskRow>,
    /// Row of each task that has one.
    row_of: HashMap<u64, usize>,
    /// Signals: time, rows of the two tasks, name of the event.
    arrows: Vec<(u64, usize, usize, String)>,
    collections: Vec<(u64, u64)>,
    collects_since: Option<u64>,
    items: usize,
    /// Time at which [`ITEMS`] was reached.
    full_at: Option<u64>,
    hidden_rows: usize,
    latest: u64,
}

impl Drawing {
    /// Creates an empty drawing.
    pub fn new() -> Drawing {
        Drawing::default()
    }

    fn change(&mut self, time: u64, task: u64, state: Option<Activity>) {
        let Some(row) = self.row_of.get(&task).and_then(|&row| self.rows.get_mut(row)) else { return };
        if row.open.as_ref().map(|(open, _)| open) == state.as_ref() {
            return;
        }
        if let Some((open, begin)) = row.open.take()
            // A task that is ready for no time gets no bar.
            && (open != Activity::Ready || begin < time)
        {
            row.bars.push(Bar { state: open, begin, end: time });
            self.items += 1;
        }
        row.open = state.map(|state| (state, time));
    }

    fn mark(&mut self, time: u64, task: u64, sign: Sign, text: String) {
        if let Some(row) = self.row_of.get(&task).and_then(|&row| self.rows.get_mut(row)) {
            row.marks.push((time, sign, text));
            self.items += 1;
        }
    }
}

impl Observer for Drawing {
    fn see(&mut self, time: u64, TaskNumber(task): TaskNumber, seen: Seen<'_>) {
        if self.full_at.is_some() {
            return;
        }
        self.latest = time;
        if self.items >= ITEMS {
            self.full_at = Some(time);
            return;
        }
        match seen {
            // Tasks of the library are not shown.
            Seen::Begins { is_hidden: true, .. } => {}
            Seen::Begins { name, .. } => {
                if self.rows.len() < ROWS {
                    self.row_of.insert(task, self.rows.len());
                    self.rows.push(TaskRow {
                        name: name.into(),
                        bars: Vec::new(),
                        open: None,
                        marks: Vec::new(),
                    });
                } else {
                    self.hidden_rows += 1;
                }
            }
            Seen::IsNamed(name) => {
                if let Some(row) = self.row_of.get(&task).and_then(|&row| self.rows.get_mut(row)) {
                    row.name = name.into();
                }
            }
            Seen::Runs => self.change(time, task, Some(Activity::Runs)),
            Seen::IsReady => self.change(time, task, Some(Activity::Ready)),
            Seen::Waits(reason) => self.change(time, task, Some(Activity::Waits(reason.into()))),
            Seen::IsSuspended(reason) => self.change(time, task, Some(Activity::IsSuspended(reason.into()))),
            Seen::IsToEnd => self.mark(time, task, Sign::IsToEnd, "abort requested".into()),
            Seen::Ends(how) => {
                self.change(time, task, None);
                let how = ["succeeded", "failed", "aborted"].into_iter().find(|known| *known == how);
                self.mark(time, task, Sign::Ends(how.unwrap_or("ended")), how.unwrap_or("ended").into());
                // The row stays; nothing more comes under this number.
                self.row_of.remove(&task);
            }
            Seen::Signals(event) => self.mark(time, task, Sign::Signals, format!("signals {event}")),
            Seen::IsWokenBy { task: by, event } => {
                if let (Some(&from), Some(&to)) = (self.row_of.get(&by.0), self.row_of.get(&task))
                    && from != to
                {
                    self.arrows.push((time, from, to, event.into()));
                    self.items += 1;
                }
            }
            Seen::Fails(cause) => self.mark(time, task, Sign::Fails, format!("fails {cause}")),
            Seen::Recovers(cause) => self.mark(time, task, Sign::Recovers, format!("recovers {cause}")),
            Seen::CollectionBegins => self.collects_since = Some(time),
            Seen::CollectionEnds => {
                if let Some(begin) = self.collects_since.take() {
                    self.collections.push((begin, time));
                    self.items += 1;
                }
            }
            Seen::PauseBegins | Seen::PauseEnds | Seen::Changes { .. } => {}
        }
    }
}

/// Maps times to pixels.
struct Scale {
    begin: u64,
    length: f64,
    /// Where the bars begin, to the right of the names.
    left: f64,
}

impl Scale {
    fn x(&self, time: u64) -> f64 {
        let part = time.saturating_sub(self.begin) as f64 / self.length;
        self.left + (WIDTH - self.left - RIGHT) * part
    }

    /// Returns the distance of the lines of the axis in nanoseconds: 1, 2 or 5 times a power of ten.
    fn step(&self) -> u64 {
        let wanted = (self.length / 9.0).max(1.0);
        let power = 10f64.powf(wanted.log10().floor());
        let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * power >= wanted);
        (factor.unwrap_or(10.0) * power) as u64
    }
}

/// Writes a time in the unit that suits the steps of the axis.
fn in_words(time: u64, step: u64) -> String {
    let (unit, name) = match step {
        0..1_000 => (1, "ns"),
        1_000..1_000_000 => (1_000, "µs"),
        1_000_000..1_000_000_000 => (1_000_000, "ms"),
        _ => (1_000_000_000, "s"),
    };
    format!("{} {name}", time / unit)
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Returns as much of a name as fits into `width`.
fn fit(name: &str, width: f64) -> String {
    let room = (width / NAME_CHARACTER).max(1.0) as usize;
    if name.chars().count() <= room {
        name.into()
    } else {
        name.chars().take(room - 1).chain(['…']).collect()
    }
}

/// Returns the name of a task as it stands before its row.
fn name_of_row(row: &TaskRow) -> &str {
    row.name.strip_prefix("task ").unwrap_or(&row.name)
}

const STYLE: &str = "text{font:11px sans-serif;fill:#333}.s{font-size:10px;fill:#555}.n{text-anchor:end;font-weight:bold}\
.g{stroke:#e4e7eb}.r{fill:#2f7d5b}.y{fill:#e7b04b}.w{fill:#dde3ea}.u{fill:#b9a3d4}.c{fill:#f3e3f5}.a{stroke:#3b6fb5;stroke-width:1.2}\
.h{fill:#3b6fb5}.f{fill:#c33}.v{fill:#2f7d5b;stroke:#fff}.x{stroke:#c33;stroke-width:2}.o{stroke:#d9822b;stroke-width:2}\
.e{stroke:#2f7d5b;stroke-width:2}.t{fill:#c33}";

impl Drawing {
    /// Returns the drawing as the text of an SVG file.
    pub fn draw(&mut self) -> String {
        let end = self.latest;
        for row in &mut self.rows {
            if let Some((state, begin)) = row.open.take() {
                row.bars.push(Bar { state, begin, end });
            }
        }
        self.collections.extend(self.collects_since.take().map(|begin| (begin, end)));
        let begin =
            self.rows.iter().filter_map(|row| row.bars.first()).map(|bar| bar.begin).min().unwrap_or(0);
        let longest = self.rows.iter().map(|row| name_of_row(row).chars().count()).max().unwrap_or(0);
        let left = (longest as f64 * NAME_CHARACTER + 18.0).clamp(NAMES.0, NAMES.1);
        let scale = Scale { begin, length: (end.saturating_sub(begin)).max(1) as f64, left };
        let covered = self.covered(&scale);
        let bottom = TOP + ROW * self.rows.len().max(1) as f64 + 6.0;
        let notes = self.notes();
        let height = bottom + 24.0 + 16.0 * notes.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\">\n\
             <style>{STYLE}</style>\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n"
        );
        legend(&mut svg);
        for &(begin, end) in &self.collections {
            let (x, width) = (scale.x(begin), (scale.x(end) - scale.x(begin)).max(2.0));
            let height = bottom - TOP;
            _ = writeln!(
                svg,
                "<rect class=\"c\" x=\"{x:.1}\" y=\"{TOP}\" width=\"{width:.1}\" height=\"{height}\"><title>collection</title></rect>"
            );
        }
        axis(&mut svg, &scale, end, bottom);
        for (index, row) in self.rows.iter().enumerate() {
            draw_bars(&mut svg, &scale, index, row, &covered[index]);
        }
        for (time, from, to, event) in &self.arrows {
            draw_arrow(&mut svg, scale.x(*time), *from, *to, event);
        }
        for (index, row) in self.rows.iter().enumerate() {
            draw_marks(&mut svg, &scale, index, row, &covered[index]);
        }
        for (index, note) in notes.iter().enumerate() {
            let y = bottom + 18.0 + 16.0 * index as f64;
            _ = writeln!(svg, "<text x=\"{left}\" y=\"{y}\" class=\"s\">{}</text>", escape(note));
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// Returns what covers texts in each row.
    fn covered(&self, scale: &Scale) -> Vec<Covered> {
        let mut covered = vec![Covered::default(); self.rows.len()];
        for (row, covered) in self.rows.iter().zip(&mut covered) {
            for (time, sign, _) in &row.marks {
                let x = scale.x(*time) + aside(*sign);
                if *sign != Sign::Signals {
                    covered.bars.push((x - SIGN, x + SIGN));
                }
            }
            let runs = row.bars.iter().filter(|bar| bar.state == Activity::Runs);
            covered.bars.extend(runs.map(|bar| {
                let x = scale.x(bar.begin);
                (x, scale.x(bar.end).max(x + 2.0))
            }));
        }
        for &(time, from, to, _) in &self.arrows {
            let x = scale.x(time);
            let (upper, lower) = (from.min(to), from.max(to));
            for (row, covered) in covered.iter_mut().enumerate().take(lower + 1).skip(upper + 1) {
                covered.above.push(x);
                if row < lower {
                    covered.bars.push((x - 1.0, x + 1.0));
                }
            }
        }
        covered
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(time) = self.full_at {
            notes.push(format!(
                "Only the beginning of the run is shown, up to {:.6} s; a trace (--timeline FILE.json) has all of it.",
                time as f64 / 1e9
            ));
        }
        if self.hidden_rows > 0 {
            notes.push(format!(
                "{} more tasks are not shown; a trace (--timeline FILE.json) has them.",
                self.hidden_rows
            ));
        }
        notes
    }
}

fn legend(svg: &mut String) {
    let mut x = NAMES.0;
    let bars = [("r", "runs"), ("y", "is ready"), ("w", "waits"), ("u", "is suspended"), ("c", "collection")];
    for (class, text) in bars {
        _ = write!(svg, "<rect class=\"{class}\" x=\"{x}\" y=\"14\" width=\"14\" height=\"12\"/>");
        _ = writeln!(svg, "<text x=\"{}\" y=\"24\">{text}</text>", x + 19.0);
        x += 38.0 + 6.5 * text.len() as f64;
    }
    let signs = [
        (Sign::Fails, "fails"),
        (Sign::Recovers, "recovers"),
        (Sign::IsToEnd, "abort requested"),
        (Sign::Ends("succeeded"), "succeeded"),
        (Sign::Ends("failed"), "failed"),
        (Sign::Ends("aborted"), "aborted"),
    ];
    for (sign, text) in signs {
        draw_sign(svg, sign, x + 6.0, 12.0);
        _ = writeln!(svg, "<text x=\"{}\" y=\"24\">{text}</text>", x + 16.0);
        x += 28.0 + 6.5 * text.len() as f64;
    }
    _ = write!(svg, "<line class=\"a\" x1=\"{x}\" y1=\"12\" x2=\"{x}\" y2=\"22\"/>");
    _ = write!(svg, "<path class=\"h\" d=\"M{x} 28l-3.5 -7h7z\"/>");
    _ = writeln!(svg, "<text x=\"{}\" y=\"24\">signal</text>", x + 9.0);
}

fn axis(svg: &mut String, scale: &Scale, end: u64, bottom: f64) {
    let step = scale.step();
    let mut time = scale.begin.div_ceil(step) * step;
    while time <= end {
        let x = scale.x(time);
        _ = write!(svg, "<line class=\"g\" x1=\"{x:.1}\" y1=\"{TOP}\" x2=\"{x:.1}\" y2=\"{bottom}\"/>");
        let words = in_words(time, step);
        _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{words}</text>", TOP - 8.0);
        time += step;
    }
}

/// Returns the y of the upper edge of a row's bars.
fn top_of_bars(row: usize) -> f64 {
    TOP + ROW * row as f64 + BAR
}

fn draw_bars(svg: &mut String, scale: &Scale, index: usize, row: &TaskRow, covered: &Covered) {
    let y = top_of_bars(index);
    let (x, text_y) = (scale.left - 8.0, y + 12.0);
    let (name, title) = (escape(&fit(name_of_row(row), scale.left - 12.0)), escape(&row.name));
    _ = writeln!(svg, "<text class=\"n\" x=\"{x}\" y=\"{text_y}\">{name}<title>{title}</title></text>");
    // Bars of running are widened so as to be seen, and are drawn over the others.
    for runs in [false, true] {
        let mut last = f64::NEG_INFINITY;
        for bar in row.bars.iter().filter(|bar| (bar.state == Activity::Runs) == runs) {
            let (x, right) = (scale.x(bar.begin), scale.x(bar.end));
            let width = (right - x).max(if runs { 2.0 } else { 0.5 });
            if right < last + 0.2 {
                continue;
            }
            last = x + width;
            let (class, title) = match &bar.state {
                Activity::Runs => ("r", "runs".to_string()),
                Activity::Ready => ("y", "is ready".to_string()),
                Activity::Waits(reason) => ("w", format!("waits for {reason}")),
                Activity::IsSuspended(reason) => ("u", format!("waits for {reason}")),
            };
            let (begin, end) = (bar.begin as f64 / 1e6, bar.end as f64 / 1e6);
            _ = writeln!(
                svg,
                "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y}\" width=\"{width:.1}\" height=\"{BAR_HEIGHT}\"><title>{}, {begin:.3} to {end:.3} ms</title></rect>",
                escape(&title)
            );
            // A text that does not fit, or that something would cover, is left out: the bar has it as its
            // title.
            if let Activity::Waits(reason) | Activity::IsSuspended(reason) = &bar.state {
                let text_width = CHARACTER * reason.chars().count() as f64;
                if let Some(x) = covered.place_in_bar(x + 4.0, right - 2.0, text_width) {
                    let text = escape(reason);
                    _ = writeln!(svg, "<text class=\"s\" x=\"{x:.1}\" y=\"{text_y}\">{text}</text>");
                }
            }
        }
    }
}

fn draw_arrow(svg: &mut String, x: f64, from: usize, to: usize, event: &str) {
    let is_down = to > from;
    let start = top_of_bars(from) + if is_down { BAR_HEIGHT } else { 0.0 };
    let end = top_of_bars(to) + if is_down { 0.0 } else { BAR_HEIGHT };
    let back = if is_down { -7.0 } else { 7.0 };
    let stop = end + back;
    _ = writeln!(
        svg,
        "<g><title>{}</title><line class=\"a\" x1=\"{x:.1}\" y1=\"{start}\" x2=\"{x:.1}\" y2=\"{stop}\"/>\
         <path class=\"h\" d=\"M{x:.1} {end}l-3.5 {back}h7z\"/></g>",
        escape(event)
    );
}

/// Returns how far to the right of its time a sign stands: a recovery stands beside its failure.
fn aside(sign: Sign) -> f64 {
    if sign == Sign::Recovers { 10.0 } else { 0.0 }
}

/// Draws a sign on the bar whose upper edge is at `y`.
fn draw_sign(svg: &mut String, sign: Sign, x: f64, y: f64) {
    let middle = y + BAR_HEIGHT / 2.0;
    _ = match sign {
        Sign::Signals => Ok(()),
        Sign::Fails => write!(svg, "<path class=\"f\" d=\"M{x:.1} {}l-5 9h10z\"/>", middle - 5.0),
        Sign::Recovers => write!(svg, "<circle class=\"v\" cx=\"{x:.1}\" cy=\"{middle}\" r=\"5\"/>"),
        Sign::IsToEnd => {
            write!(
                svg,
                "<line class=\"o\" stroke-dasharray=\"3 2\" x1=\"{x:.1}\" y1=\"{y}\" x2=\"{x:.1}\" y2=\"{}\"/>",
                y + BAR_HEIGHT
            )
        }
        Sign::Ends("failed") => {
            write!(svg, "<path class=\"x\" d=\"M{:.1} {}l8 8m0 -8l-8 8\"/>", x - 4.0, middle - 4.0)
        }
        Sign::Ends(how) => {
            let class = if how == "aborted" { "o" } else { "e" };
            write!(
                svg,
                "<line class=\"{class}\" x1=\"{x:.1}\" y1=\"{}\" x2=\"{x:.1}\" y2=\"{}\"/>",
                y - 2.0,
                y + BAR_HEIGHT + 2.0
            )
        }
    };
}

fn draw_marks(svg: &mut String, scale: &Scale, index: usize, row: &TaskRow, covered: &Covered) {
    let y = top_of_bars(index);
    // Texts stand above the bars, where the text before leaves room.
    let mut free = 0.0;
    let mut last: Option<(Sign, f64)> = None;
    for (time, sign, text) in &row.marks {
        let x = scale.x(*time);
        if last.is_some_and(|(other, at)| other == *sign && x < at + 1.0) {
            continue;
        }
        last = Some((*sign, x));
        draw_sign(svg, *sign, x + aside(*sign), y);
        let width = CHARACTER * text.chars().count() as f64;
        // Other signs explain themselves, and arrows show what a net and the end of a task signal.
        let has_text = match sign {
            Sign::Fails | Sign::Recovers => true,
            Sign::Signals => text != "signals an event" && !text.ends_with(&row.name),
            Sign::IsToEnd | Sign::Ends(_) => false,
        };
        // Beside the arrow of its own signal.
        let text_x = (x + 3.0).min(WIDTH - width - 4.0);
        if has_text && text_x >= free && covered.is_free_above(text_x, width) {
            let class = if *sign == Sign::Fails { "s t" } else { "s" };
            _ = writeln!(
                svg,
                "<text class=\"{class}\" x=\"{text_x:.1}\" y=\"{}\">{}</text>",
                y - 3.0,
                escape(text)
            );
            free = text_x + width + 6.0;
        }
    }
}
