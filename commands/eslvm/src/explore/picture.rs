//! A finding as a picture: the tasks side by side as lines downwards, a step a row, in SVG with colours for
//! light and dark screens. A line from step to step shows how the tasks take turns.

use std::fmt::Write;

use esl_testing::explore::{SourceForms, Switch};

use super::tell::{CELL, StepRow, StepRowKind, column_name, cut, seconds, tasks};

// Lengths in pixels.
/// Width of a character.
const CHARACTER: f64 = 7.3;
const ROW: f64 = 24.0;
const MARGIN: f64 = 18.0;
/// Distance from the top to the names of tasks, and to the first row.
const NAMES: f64 = 62.0;
const FIRST: f64 = 92.0;
/// Width of the column of times.
const TIMES: f64 = 70.0;
/// Distance from the line of a task to its texts, and from these to the next line.
const BESIDE: f64 = 14.0;
const GAP: f64 = 26.0;
/// Radius of the sign of a step.
const SIGN: f64 = 4.5;

/// Number of the colours of tasks, which are the classes `c0`, `c1` and so on.
const COLOURS: usize = 6;

/// Colours and fonts.
const STYLE: &str = "svg { --ground: #fff; --line: #b8bec6; --text: #222; --dim: #5f6b78; --bad: #c01818; \
--c0: #1f5fa8; --c1: #b3541e; --c2: #2c7a3f; --c3: #8a3d99; --c4: #6b5a00; --c5: #007480 }
@media (prefers-color-scheme: dark) { svg { --ground: #14171c; --line: #4a5462; --text: #dde4ec; --dim: #8b98a8; \
--bad: #ff6d61; --c0: #6fb1ff; --c1: #f0965a; --c2: #5fcf80; --c3: #d58ae6; --c4: #d6c04a; --c5: #4fd0dd } }
text { font: 12px monospace; white-space: pre; fill: var(--text); paint-order: stroke; stroke: var(--ground); stroke-width: 4px }
.title { font: bold 15px sans-serif } .name { font-weight: bold; fill: var(--own) } .dim { fill: var(--dim) }
.bad { fill: var(--bad) } .time { text-anchor: end; fill: var(--dim) }
.ground { fill: var(--ground) } .lane { stroke: var(--line) } .turn { fill: none; stroke: var(--dim); stroke-opacity: 0.6 }
.pass { stroke: var(--line); stroke-dasharray: 4 4 } .stop { stroke: var(--bad); stroke-width: 3 }
.step { fill: var(--own); stroke: var(--own); stroke-width: 1.5 } .read { fill: var(--ground) }
.c0 { --own: var(--c0) } .c1 { --own: var(--c1) } .c2 { --own: var(--c2) } .c3 { --own: var(--c3) }
.c4 { --own: var(--c4) } .c5 { --own: var(--c5) }";

/// A task of the picture.
struct Lane<'a> {
    task: &'a str,
    /// The place of its line, in pixels from the left.
    x: f64,
}

fn width(text: &str) -> f64 {
    text.chars().count() as f64 * CHARACTER
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns the lanes of tasks, and where the column of places begins.
fn lanes(rows: &[StepRow]) -> (Vec<Lane<'_>>, f64) {
    let mut x = MARGIN + TIMES + GAP;
    let lane = |task| {
        let texts = rows.iter().filter(|row| row.task == task).map(|row| width(&cut(&row.text, CELL)));
        let widest = texts.fold(width(&column_name(task)), f64::max);
        let lane = Lane { task, x };
        x += BESIDE + widest + GAP;
        lane
    };
    let lanes = tasks(rows).into_iter().map(lane).collect();
    (lanes, x)
}

/// Draws a finding: its title, its rows, and below them the lines of a report.
pub(super) fn draw<'a>(
    title: &str,
    rows: &[StepRow],
    report: impl Iterator<Item = &'a str>,
    forms: &mut SourceForms,
) -> String {
    let (lanes, places_at) = lanes(rows);
    let places: Vec<String> = rows.iter().map(|row| row.place(forms)).collect();
    let report: Vec<String> = report.map(|line| cut(line, 160)).collect();
    let widest =
        places.iter().map(|place| places_at + width(place)).fold(places_at + width("place"), f64::max);
    let widest = report.iter().map(|line| MARGIN + width(line)).fold(widest, f64::max);
    let wide = widest.max(MARGIN + width(title) * 1.1) + MARGIN;
    let bottom = FIRST + ROW * rows.len() as f64;
    let high = bottom + if report.is_empty() { 0.0 } else { 14.0 + 18.0 * report.len() as f64 } + MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{wide:.0}\" height=\"{high:.0}\" viewBox=\"0 0 {wide:.0} \
         {high:.0}\">\n<title>{0}</title>\n<style>{STYLE}</style>\n\
         <rect class=\"ground\" width=\"100%\" height=\"100%\"/>\n\
         <text class=\"title\" x=\"{MARGIN}\" y=\"30\">{0}</text>\n",
        escaped(title)
    );
    let mut put = |text: std::fmt::Arguments<'_>| {
        // A string takes all that is written to it.
        let _ = svg.write_fmt(text);
        svg.push('\n');
    };
    let text = |class: &str, x: f64, y: f64, text: &str| {
        format!("<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>", escaped(text))
    };
    put(format_args!("{}", text("time", MARGIN + TIMES, NAMES, "time")));
    put(format_args!("{}", text("dim", places_at, NAMES, "place")));
    for (number, Lane { task, x }) in lanes.iter().enumerate() {
        let class = format!("name c{}", number % COLOURS);
        put(format_args!("{}", text(&class, *x - SIGN, NAMES, &column_name(task))));
        put(format_args!("<path class=\"lane\" d=\"M{x:.1} {:.1}V{bottom:.1}\"/>", NAMES + 10.0));
    }
    let lane_of = |row: &StepRow| lanes.iter().position(|lane| lane.task == row.task);
    let y_of = |at: usize| FIRST + ROW * at as f64;
    let turns = rows.iter().enumerate().filter_map(|(at, row)| Some((lanes[lane_of(row)?].x, y_of(at))));
    let mut turns = turns.peekable();
    let mut path = String::new();
    while let Some((x, y)) = turns.next() {
        if path.is_empty() {
            path = format!("M{x:.1} {y:.1}");
        }
        // Between two rows, so that no line crosses a text.
        if let Some((next, below)) = turns.peek() {
            path += &format!("V{:.1}H{next:.1}V{below:.1}", y + ROW / 2.0);
        }
    }
    if path.contains('H') {
        put(format_args!("<path class=\"turn\" d=\"{path}\"/>"));
    }
    let mut told = None;
    for (at, (row, place)) in rows.iter().zip(&places).enumerate() {
        let y = y_of(at);
        if told != Some(row.time) {
            told = Some(row.time);
            put(format_args!("{}", text("time", MARGIN + TIMES, y + 4.0, &seconds(row.time).to_string())));
        }
        let Some(lane) = lane_of(row) else {
            let begin = MARGIN + TIMES + 10.0;
            put(format_args!("<path class=\"pass\" d=\"M{begin:.1} {y:.1}H{places_at:.1}\"/>"));
            put(format_args!("{}", text("dim", begin + GAP + BESIDE, y + 4.0, &row.text)));
            continue;
        };
        let (x, colour) = (lanes[lane].x, lane % COLOURS);
        let class = match &row.kind {
            StepRowKind::Switch(
                Switch::Preemption { .. } | Switch::Abort { .. } | Switch::Restart { .. },
            ) => {
                put(format_args!(
                    "<path class=\"stop\" d=\"M{:.1} {y:.1}H{:.1}\"/>",
                    x - 2.0 * SIGN,
                    x + 2.0 * SIGN
                ));
                "bad"
            }
            kind => {
                let is_read = matches!(kind, StepRowKind::Use { is_set: false, .. });
                let sign = if is_read { "step read" } else { "step" };
                put(format_args!(
                    "<circle class=\"{sign} c{colour}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{SIGN}\"/>"
                ));
                "does"
            }
        };
        put(format_args!("{}", text(class, x + BESIDE, y + 4.0, &cut(&row.text, CELL))));
        put(format_args!("{}", text("dim", places_at, y + 4.0, place)));
    }
    for (number, line) in report.iter().enumerate() {
        put(format_args!("{}", text("bad", MARGIN, bottom + 14.0 + 18.0 * number as f64, line)));
    }
    svg.push_str("</svg>\n");
    svg
}
