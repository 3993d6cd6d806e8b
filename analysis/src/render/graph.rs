//! The program as a picture: sources of failures on the left, clauses that take them in the middle, tasks on
//! the right, and an arrow from each failure to each place that takes it. Three layers in the order of the
//! text, in SVG.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::text::end_of;
use crate::table::{CauseRow, FailureTable};
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

/// Colours of causes: dark enough for text on white.
const COLOURS: [&str; 8] =
    ["#1f5fa8", "#b3541e", "#2c7a3f", "#8a3d99", "#a8323a", "#6b5a00", "#007480", "#5a4fcf"];
const ENDS: &str = "#c01818";

/// A line of a box.
struct BoxLine {
    text: String,
    colour: String,
}

/// A box with a title, a note and lines.
struct GraphBox {
    title: String,
    note: String,
    lines: Vec<BoxLine>,
    y: usize,
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
    boxes: Vec<GraphBox>,
    x: usize,
    width: usize,
}

impl Layer {
    fn new(heading: &'static str, boxes: Vec<GraphBox>) -> Layer {
        let width = boxes.iter().map(GraphBox::width).max().unwrap_or(0);
        Layer { heading, boxes, x: 0, width: width.max(heading.len() * 9) }
    }

    /// Puts the boxes below each other.
    fn place(&mut self, x: usize) {
        self.x = x;
        let mut y = MARGIN + HEADING;
        for one in &mut self.boxes {
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
}

impl FailureSources {
    fn new(table: &FailureTable) -> FailureSources {
        let clauses = table.clauses.iter().flat_map(|clause| &clause.causes);
        let tasks = table.tasks.iter().flat_map(|task| &task.causes);
        let mut found: BTreeMap<(&crate::table::CodePlace, &str), Vec<&str>> = BTreeMap::new();
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
        for ((_, function), causes) in found {
            let place = functions.iter().position(|(known, _)| known == function).unwrap_or_else(|| {
                functions.push((function.to_string(), Vec::new()));
                functions.len() - 1
            });
            for cause in causes {
                let next = colours.len() % COLOURS.len();
                colours.entry(cause.to_string()).or_insert(next);
                if !functions[place].1.iter().any(|known| known == cause) {
                    functions[place].1.push(cause.to_string());
                }
            }
        }
        FailureSources { functions, colours }
    }

    fn colour(&self, cause: &str) -> String {
        COLOURS[self.colours.get(cause).copied().unwrap_or_default()].to_string()
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

    fn layer(&self) -> Layer {
        let line = |cause: &String| BoxLine { text: cause.clone(), colour: self.colour(cause) };
        let one = |(name, causes): &(String, Vec<String>)| GraphBox {
            title: name.clone(),
            note: String::new(),
            lines: causes.iter().map(line).collect(),
            y: 0,
        };
        Layer::new("can fail", self.functions.iter().map(one).collect())
    }
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
            boxes.push(GraphBox { title, note: String::new(), lines: Vec::new(), y: 0 });
            boxes.len() - 1
        });
        let line = boxes[place].lines.len();
        let text = cut(&format!("{}  {}", clause.wanted, short_answer(&clause.answer)));
        let colour = match sources.colours.contains_key(&clause.wanted) {
            true => sources.colour(&clause.wanted),
            false => "#222".to_string(),
        };
        boxes[place].lines.push(BoxLine { text, colour });
        for row in &clause.causes {
            for from in sources.places(row) {
                arrows.push(GraphArrow { from, to: (place, line), colour: sources.colour(&row.cause) });
            }
        }
    }
    (Layer::new("recovers (↑: if in vain, outward)", boxes), arrows)
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
            lines.push(BoxLine { text: row.cause.clone(), colour: ENDS.into() });
        }
        let (text, colour) = match task.causes.is_empty() {
            true => ("no failure ends it", "#2c7a3f"),
            false => (end_of(task), ENDS),
        };
        lines.push(BoxLine { text: cut(text), colour: colour.into() });
        boxes.push(GraphBox { title: task.name.clone(), note, lines, y: 0 });
    }
    (Layer::new("tasks", boxes), arrows)
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
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn draw_layer(svg: &mut String, layer: &Layer) {
    // Writing to a text does not fail.
    _ = writeln!(
        svg,
        "<text class=\"heading\" x=\"{}\" y=\"{}\">{}</text>",
        layer.x,
        MARGIN + 12,
        layer.heading
    );
    for one in &layer.boxes {
        let (x, y) = (layer.x, one.y);
        _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" rx=\"4\"/>",
            layer.width,
            one.height()
        );
        _ = writeln!(
            svg,
            "<text class=\"title\" x=\"{}\" y=\"{}\">{}</text>",
            x + 8,
            y + 16,
            escaped(&one.title)
        );
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
        for line in &one.lines {
            let text = escaped(&line.text);
            _ = writeln!(svg, "<text x=\"{}\" y=\"{at}\" fill=\"{}\">{text}</text>", x + 8, line.colour);
            at += LINE;
        }
    }
}

fn draw_arrows(svg: &mut String, arrows: &[GraphArrow], from: &Layer, to: &Layer, class: &str) {
    for arrow in arrows {
        let (x, y) = (from.x + from.width, from.boxes[arrow.from.0].middle(arrow.from.1));
        let (end_x, end_y) = (to.x - 6, to.boxes[arrow.to.0].middle(arrow.to.1));
        let bend = BETWEEN * 2 / 3;
        let colour = &arrow.colour;
        _ = writeln!(
            svg,
            "<path class=\"{class}\" stroke=\"{colour}\" d=\"M{x} {y} C{} {y} {} {end_y} {end_x} {end_y}\"/>\
             <path fill=\"{colour}\" d=\"M{} {end_y} l-7 -4 v8 z\"/>",
            x + bend,
            end_x - bend,
            end_x + 6,
        );
    }
}

/// Returns the picture of a table.
pub(super) fn render(table: &FailureTable, title: &str) -> String {
    let mut sources = FailureSources::new(table);
    let (mut middle, arrows) = clauses(table, &sources);
    middle.place(0);
    order(&mut sources, &arrows, &middle);
    let mut left = sources.layer();
    let (mut middle, taken) = clauses(table, &sources);
    let (mut right, ends) = tasks(table, &sources);
    left.place(MARGIN);
    middle.place(left.x + left.width + BETWEEN);
    right.place(middle.x + middle.width + BETWEEN);
    let width = right.x + right.width + MARGIN;
    let height = left.bottom().max(middle.bottom()).max(right.bottom()) + MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
         {height}\">\n<title>{}</title>\n<style>text {{ font: 11.5px monospace; white-space: pre }} \
         .title {{ font-weight: bold; font-size: 12.5px }} .heading {{ font: bold 14px sans-serif; fill: #444 }} \
         .note {{ fill: #666 }} rect {{ fill: #fff; fill-opacity: 0.92; stroke: #999 }} \
         path {{ fill-opacity: 1 }} .takes {{ fill: none; stroke-width: 1.4; stroke-opacity: 0.75 }} \
         .ends {{ fill: none; stroke-width: 1.2; stroke-opacity: 0.5; stroke-dasharray: 5 3 }}</style>\n\
         <rect x=\"0\" y=\"0\" width=\"{width}\" height=\"{height}\" style=\"stroke: none; fill-opacity: 1\"/>\n",
        escaped(title)
    );
    draw_arrows(&mut svg, &ends, &left, &right, "ends");
    draw_arrows(&mut svg, &taken, &left, &middle, "takes");
    for layer in [&left, &middle, &right] {
        draw_layer(&mut svg, layer);
    }
    svg.push_str("</svg>\n");
    svg
}
