//! The program as a picture: sources of failures on the left, clauses that take them and goals in the middle,
//! tasks on the right, and an arrow from each failure to each place that takes it. Three layers in the order
//! of the text, in SVG, with colours for light and dark screens.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::text::end_of;
use crate::row::{CauseRow, FailureTable};
use crate::value::TaskKind;

/// Width of a character, and heights of a line and of a title, in pixels.
const CHARACTER: usize = 7;
const LINE: usize = 17;
const TITLE: usize = 22;
/// Space between boxes, and around the picture.
const GAP: usize = 14;
const MARGIN: usize = 20;
/// Space between two layers, for arrows.
const BETWEEN: usize = 130;
/// Height of the headings of layers.
const HEADING: usize = 34;
/// Most characters of a line.
const MOST_CHARACTERS: usize = 58;

/// Number of the colours of causes, which are the classes `c0`, `c1` and so on.
const COLOURS: usize = 8;
/// Classes of other colours: of ends by failure, of plain texts, of ends without failure.
const ENDS: &str = "bad";
const PLAIN: &str = "plain";
const GOOD: &str = "good";

/// Colours and fonts. Texts are dark enough for white, and light enough for black.
const STYLE: &str = "svg { --ground: #fff; --box: #fff; --line: #999; --text: #222; --dim: #666; \
--c0: #1f5fa8; --c1: #b3541e; --c2: #2c7a3f; --c3: #8a3d99; --c4: #a8323a; --c5: #6b5a00; --c6: #007480; --c7: #5a4fcf; \
--bad: #c01818; --good: #2c7a3f }
@media (prefers-color-scheme: dark) { svg { --ground: #14171c; --box: #1b2027; \
--line: #4a5462; --text: #dde4ec; --dim: #8b98a8; --c0: #6fb1ff; --c1: #f0965a; --c2: #5fcf80; --c3: #d58ae6; --c4: #ff8088; --c5: #d6c04a; \
--c6: #4fd0dd; --c7: #a59cff; --bad: #ff6d61; --good: #5fcf80 } }
text { font: 11.5px monospace; white-space: pre; fill: var(--text) }
.title { font-weight: bold; font-size: 12.5px } .heading { font: bold 14px sans-serif; fill: var(--dim) }
text.note { fill: var(--dim) } rect { fill: var(--box); fill-opacity: 0.92; stroke: var(--line) }
rect.ground { fill: var(--ground); fill-opacity: 1; stroke: none }
.c0 { --own: var(--c0) } .c1 { --own: var(--c1) } .c2 { --own: var(--c2) } .c3 { --own: var(--c3) }
.c4 { --own: var(--c4) } .c5 { --own: var(--c5) } .c6 { --own: var(--c6) } .c7 { --own: var(--c7) }
.bad { --own: var(--bad) } .good { --own: var(--good) } .plain { --own: var(--text) }
.calls { --own: var(--dim) }
text.c0, text.c1, text.c2, text.c3, text.c4, text.c5, text.c6, text.c7, text.bad, text.good,
.tip { fill: var(--own) }
.arrow { fill: none; stroke: var(--own) } .takes { stroke-width: 1.4; stroke-opacity: 0.75 }
.ends { stroke-width: 1.2; stroke-opacity: 0.5; stroke-dasharray: 5 3 }
.calls { stroke-width: 1.2; stroke-opacity: 0.7; stroke-dasharray: 1 3 }
.lit > rect { stroke: var(--good); stroke-width: 2.5 } .count { font-weight: bold }
.path.arrow { stroke-width: 3.5; stroke-opacity: 1 } text.path { font-weight: bold; text-decoration: underline }";

/// A line of a box.
#[derive(Default)]
struct BoxLine {
    text: String,
    colour: String,
    /// Places where its failures begin.
    places: Vec<String>,
}

/// A box with a title, a note and lines.
struct GraphBox {
    title: String,
    note: String,
    lines: Vec<BoxLine>,
    y: usize,
    /// Source, first and last line of its function.
    range: String,
}

impl GraphBox {
    fn height(&self) -> usize {
        TITLE + usize::from(!self.note.is_empty()) * LINE + self.lines.len() * LINE + 6
    }

    /// Returns the height of the middle of a line.
    fn middle(&self, line: usize) -> usize {
        let note = usize::from(!self.note.is_empty()) * LINE;
        self.y + TITLE + note + line * LINE + LINE / 2
    }

    fn width(&self) -> usize {
        let lines = self.lines.iter().map(|line| line.text.chars().count());
        let longest = lines.chain([self.title.chars().count() + 2, self.note.chars().count()]).max();
        longest.unwrap_or_default() * CHARACTER + 20
    }
}

/// A layer of boxes.
struct Layer {
    heading: &'static str,
    /// Word for its boxes in the picture.
    word: &'static str,
    boxes: Vec<GraphBox>,
    /// Heading above the boxes from a place on.
    second: Option<(usize, &'static str)>,
    x: usize,
    width: usize,
}

impl Layer {
    fn new(heading: &'static str, word: &'static str, boxes: Vec<GraphBox>) -> Layer {
        let width = boxes.iter().map(GraphBox::width).max().unwrap_or(0);
        Layer { heading, word, boxes, second: None, x: 0, width: width.max(heading.len() * 9) }
    }

    /// Puts the boxes below each other.
    fn place(&mut self, x: usize) {
        self.x = x;
        let mut y = MARGIN + HEADING;
        for (place, one) in self.boxes.iter_mut().enumerate() {
            if self.second.is_some_and(|(first, _)| first == place) {
                y += HEADING;
            }
            one.y = y;
            y += one.height() + GAP;
        }
    }

    fn bottom(&self) -> usize {
        self.boxes.last().map_or(MARGIN + HEADING, |last| last.y + last.height())
    }
}

/// An arrow: places of a box and of a line in the layer where it begins, and in the one where it ends.
struct GraphArrow {
    from: (usize, usize),
    to: (usize, usize),
    colour: String,
}

/// The causes that begin in each function, in the order of the text.
struct FailureSources {
    functions: Vec<(String, Vec<String>)>,
    colours: BTreeMap<String, usize>,
    /// Places where the failures of each function and cause begin.
    begins: BTreeMap<(String, String), Vec<String>>,
}

impl FailureSources {
    fn new(table: &FailureTable) -> FailureSources {
        let clauses = table.clauses.iter().flat_map(|clause| &clause.causes);
        let tasks = table.tasks.iter().flat_map(|task| &task.causes);
        let mut found: BTreeMap<(&crate::row::CodePlace, &str), Vec<&str>> = BTreeMap::new();
        for row in clauses.chain(tasks) {
            for origin in &row.origins {
                let causes = found.entry((&origin.place, &origin.function)).or_default();
                if !causes.contains(&row.cause.as_str()) {
                    causes.push(&row.cause);
                }
            }
        }
        let mut functions: Vec<(String, Vec<String>)> = Vec::new();
        let mut colours = BTreeMap::new();
        let mut begins: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
        for ((origin, function), causes) in found {
            let place = functions.iter().position(|(known, _)| known == function).unwrap_or_else(|| {
                functions.push((function.to_string(), Vec::new()));
                functions.len() - 1
            });
            for cause in causes {
                let key = (function.to_string(), cause.to_string());
                begins.entry(key).or_default().push(origin.to_string());
                let next = colours.len() % COLOURS;
                colours.entry(cause.to_string()).or_insert(next);
                if !functions[place].1.iter().any(|known| known == cause) {
                    functions[place].1.push(cause.to_string());
                }
            }
        }
        FailureSources { functions, colours, begins }
    }

    fn colour(&self, cause: &str) -> String {
        format!("c{}", self.colours.get(cause).copied().unwrap_or_default())
    }

    /// Returns the places of the failures of a row: of the function, and of the cause in it.
    fn places(&self, row: &CauseRow) -> Vec<(usize, usize)> {
        let mut places = Vec::new();
        for origin in &row.origins {
            let function = self.functions.iter().position(|(name, _)| *name == origin.function);
            let cause = function.and_then(|place| {
                let causes = &self.functions[place].1;
                Some((place, causes.iter().position(|cause| *cause == row.cause)?))
            });
            places.extend(cause.filter(|place| !places.contains(place)));
        }
        places
    }

    fn layer(&self, table: &FailureTable) -> Layer {
        let line = |name: &String, cause: &String| BoxLine {
            text: cause.clone(),
            colour: self.colour(cause),
            places: self.begins.get(&(name.clone(), cause.clone())).cloned().unwrap_or_default(),
        };
        let one = |(name, causes): &(String, Vec<String>)| GraphBox {
            title: name.clone(),
            note: String::new(),
            lines: causes.iter().map(|cause| line(name, cause)).collect(),
            y: 0,
            range: range_of(table, name),
        };
        Layer::new("can fail", "source", self.functions.iter().map(one).collect())
    }
}

/// Returns the source, the first and the last line of a function, or an empty text if it is not one.
fn range_of(table: &FailureTable, name: &str) -> String {
    let function = table.functions.iter().find(|row| row.name == name);
    function.map_or(String::new(), |row| format!("{}:{}:{}", row.place.source, row.place.line, row.last_line))
}

/// Returns the answer of a clause in a few words.
fn short_answer(answer: &str) -> String {
    answer
        .replace("begins again after a pause, at most", "again, with pauses,")
        .replace("begins again, at most", "again,")
        .replace("begins again after a pause", "again, with pauses")
        .replace("begins again", "again")
        .replace("goes on after the call", "goes on")
        .replace(", and goes on in the clause", "")
        .replace("; then outward", " ↑")
}

fn cut(text: &str) -> String {
    if text.chars().count() <= MOST_CHARACTERS {
        return text.to_string();
    }
    text.chars().take(MOST_CHARACTERS - 1).chain(['…']).collect()
}

/// Returns the layer of clauses, by their functions, and the arrows to them.
fn clauses(table: &FailureTable, sources: &FailureSources) -> (Layer, Vec<GraphArrow>) {
    let mut boxes: Vec<GraphBox> = Vec::new();
    let mut arrows = Vec::new();
    for clause in table.clauses.iter().filter(|clause| !clause.causes.is_empty()) {
        let place = boxes.iter().position(|one| one.title == clause.function).unwrap_or_else(|| {
            let title = clause.function.clone();
            let range = range_of(table, &title);
            boxes.push(GraphBox { title, note: String::new(), lines: Vec::new(), y: 0, range });
            boxes.len() - 1
        });
        let line = boxes[place].lines.len();
        let text = cut(&format!("{}  {}", clause.wanted, short_answer(&clause.answer)));
        let colour = match sources.colours.contains_key(&clause.wanted) {
            true => sources.colour(&clause.wanted),
            false => PLAIN.to_string(),
        };
        boxes[place].lines.push(BoxLine { text, colour, ..BoxLine::default() });
        for row in &clause.causes {
            for from in sources.places(row) {
                arrows.push(GraphArrow { from, to: (place, line), colour: sources.colour(&row.cause) });
            }
        }
    }
    (Layer::new("recovers (↑: if in vain, outward)", "form", boxes), arrows)
}

/// Returns the layer of tasks, and the arrows of failures that end them.
fn tasks(table: &FailureTable, sources: &FailureSources) -> (Layer, Vec<GraphArrow>) {
    let mut boxes: Vec<GraphBox> = Vec::new();
    let mut arrows = Vec::new();
    let is_shown = |kind: TaskKind| !matches!(kind, TaskKind::Mock | TaskKind::World | TaskKind::Host);
    for task in table.tasks.iter().filter(|task| is_shown(task.kind)) {
        let mut functions: Vec<&str> = Vec::new();
        for clause in &task.clauses {
            let function = table.clauses[*clause].function.as_str();
            if !functions.contains(&function) {
                functions.push(function);
            }
        }
        let note = match functions.is_empty() {
            true => String::new(),
            false => cut(&format!("recovers in {}", functions.join(", "))),
        };
        let mut lines = Vec::new();
        for row in &task.causes {
            let to = (boxes.len(), lines.len());
            for from in sources.places(row) {
                arrows.push(GraphArrow { from, to, colour: ENDS.into() });
            }
            lines.push(BoxLine { text: row.cause.clone(), colour: ENDS.into(), ..BoxLine::default() });
        }
        let (text, colour) = match task.causes.is_empty() {
            true => ("no failure ends it", GOOD),
            false => (end_of(task), ENDS),
        };
        lines.push(BoxLine { text: cut(text), colour: colour.into(), ..BoxLine::default() });
        boxes.push(GraphBox { title: task.name.clone(), note, lines, y: 0, range: String::new() });
    }
    (Layer::new("tasks", "task", boxes), arrows)
}

/// Adds the goals below the clauses. Returns the arrows from their methods to the functions of the clauses.
fn goals(table: &FailureTable, clauses: &mut Layer) -> Vec<GraphArrow> {
    let mut arrows = Vec::new();
    let first = clauses.boxes.len();
    for goal in &table.goals {
        let mut lines = Vec::new();
        for method in &goal.methods {
            for called in &method.calls {
                if let Some(place) = clauses.boxes[..first].iter().position(|one| one.title == *called) {
                    let from = (clauses.boxes.len(), lines.len());
                    arrows.push(GraphArrow { from, to: (place, 0), colour: "calls".into() });
                }
            }
            let text = cut(&format!("{}: {}", method.test, method.calls.join(", ")));
            lines.push(BoxLine { text, colour: PLAIN.into(), ..BoxLine::default() });
        }
        let note = match goal.pursued_in.is_empty() {
            true => String::new(),
            false => cut(&format!("in {}", goal.pursued_in.join(", "))),
        };
        clauses.boxes.push(GraphBox { title: goal.title.clone(), note, lines, y: 0, range: String::new() });
    }
    if !table.goals.is_empty() {
        clauses.second = Some((first, "goals and their methods"));
        clauses.width = clauses.boxes.iter().map(GraphBox::width).max().unwrap_or(0);
    }
    arrows
}

/// Orders the boxes of the first layer by the heights to which their arrows lead.
fn order(sources: &mut FailureSources, arrows: &[GraphArrow], clauses: &Layer) {
    let height = |place: usize| {
        let ends: Vec<usize> = arrows
            .iter()
            .filter(|arrow| arrow.from.0 == place)
            .map(|arrow| clauses.boxes[arrow.to.0].middle(arrow.to.1))
            .collect();
        ends.iter().sum::<usize>().checked_div(ends.len()).unwrap_or(usize::MAX)
    };
    let mut heights: Vec<(usize, usize)> =
        (0..sources.functions.len()).map(|place| (height(place), place)).collect();
    heights.sort_unstable();
    let functions = std::mem::take(&mut sources.functions);
    sources.functions = heights.into_iter().map(|(_, place)| functions[place].clone()).collect();
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn draw_heading(svg: &mut String, x: usize, y: usize, heading: &str) {
    // Writing to a text does not fail.
    _ = writeln!(svg, "<text class=\"heading\" x=\"{x}\" y=\"{y}\">{heading}</text>");
}

fn draw_layer(svg: &mut String, layer: &Layer) {
    draw_heading(svg, layer.x, MARGIN + 12, layer.heading);
    for (place, one) in layer.boxes.iter().enumerate() {
        let (x, y) = (layer.x, one.y);
        if let Some((_, heading)) = layer.second.filter(|(first, _)| *first == place) {
            draw_heading(svg, x, y - GAP - 6, heading);
        }
        let (width, height) = (layer.width, one.height());
        // The monitor finds boxes and lines by these attributes.
        let is_goal = layer.second.is_some_and(|(first, _)| place >= first);
        let word = if is_goal { "goal" } else { layer.word };
        _ = writeln!(
            svg,
            "<g class=\"{word}\" data-name=\"{}\" data-range=\"{}\">",
            escaped(&one.title),
            escaped(&one.range)
        );
        _ = writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"4\"/>");
        let title = escaped(&one.title);
        _ = writeln!(svg, "<text class=\"title\" x=\"{}\" y=\"{}\">{title}</text>", x + 8, y + 16);
        let mut at = y + TITLE + 12;
        if !one.note.is_empty() {
            _ = writeln!(
                svg,
                "<text class=\"note\" x=\"{}\" y=\"{at}\">{}</text>",
                x + 8,
                escaped(&one.note)
            );
            at += LINE;
        }
        for (number, line) in one.lines.iter().enumerate() {
            let text = escaped(&line.text);
            let begins = match line.places.is_empty() {
                true => String::new(),
                false => format!(" data-begins=\"{}\"", escaped(&line.places.join(" "))),
            };
            _ = writeln!(
                svg,
                "<text class=\"{}\" data-line=\"{word}.{place}.{number}\"{begins} x=\"{}\" y=\"{at}\">{text}</text>",
                line.colour,
                x + 8
            );
            at += LINE;
        }
        svg.push_str("</g>\n");
    }
}

fn draw_arrows(svg: &mut String, arrows: &[GraphArrow], from: &Layer, to: &Layer, class: &str) {
    for arrow in arrows {
        let (y, end_y) =
            (from.boxes[arrow.from.0].middle(arrow.from.1), to.boxes[arrow.to.0].middle(arrow.to.1));
        let bend = BETWEEN * 2 / 3;
        let colour = &arrow.colour;
        // An arrow inside of a layer goes around on the right.
        let x = from.x + from.width;
        let (second, end, tip) = match from.x < to.x {
            true => (to.x - 6 - bend, to.x - 6, format!("M{} {end_y} l-7 -4 v8 z", to.x)),
            false => (x + bend, x + 6, format!("M{x} {end_y} l7 -4 v8 z")),
        };
        let first = x + bend;
        _ = writeln!(
            svg,
            "<path class=\"arrow {class} {colour}\" data-from=\"{}.{}.{}\" data-to=\"{}.{}.{}\" d=\"M{x} {y} C{first} {y} {second} {end_y} {end} {end_y}\"/>\
             <path class=\"tip {colour}\" d=\"{tip}\"/>",
            from.word, arrow.from.0, arrow.from.1, to.word, arrow.to.0, arrow.to.1
        );
    }
}

/// Returns the picture of a table.
pub(super) fn render(table: &FailureTable, title: &str) -> String {
    let mut sources = FailureSources::new(table);
    let (mut middle, arrows) = clauses(table, &sources);
    middle.place(0);
    order(&mut sources, &arrows, &middle);
    let mut left = sources.layer(table);
    let (mut middle, taken) = clauses(table, &sources);
    let (mut right, ends) = tasks(table, &sources);
    let methods = goals(table, &mut middle);
    left.place(MARGIN);
    middle.place(left.x + left.width + BETWEEN);
    right.place(middle.x + middle.width + BETWEEN);
    let width = right.x + right.width + MARGIN;
    let height = left.bottom().max(middle.bottom()).max(right.bottom()) + MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
         {height}\">\n<title>{}</title>\n<style>{STYLE}</style>\n\
         <rect class=\"ground\" width=\"{width}\" height=\"{height}\"/>\n",
        escaped(title)
    );
    draw_arrows(&mut svg, &methods, &middle, &middle, "calls");
    draw_arrows(&mut svg, &ends, &left, &right, "ends");
    draw_arrows(&mut svg, &taken, &left, &middle, "takes");
    for layer in [&left, &middle, &right] {
        draw_layer(&mut svg, layer);
    }
    svg.push_str("</svg>\n");
    svg
}
