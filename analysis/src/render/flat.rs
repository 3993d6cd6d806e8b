//! The table as lines of cells: CSV, Markdown, HTML.

use std::fmt::Write;

use super::text::{end_of, origins};
use crate::row::FailureTable;

/// Lines of cells; the first has the headings.
pub(super) type CellLines = Vec<Vec<String>>;

/// Returns a line for each failure of a task, a clause and a function.
pub(super) fn rows(table: &FailureTable) -> CellLines {
    let head = ["kind", "item", "place", "cause", "begins in", "then"];
    let mut lines = vec![head.map(String::from).to_vec()];
    for task in &table.tasks {
        for row in &task.causes {
            let place = if task.place.source.is_empty() { String::new() } else { task.place.to_string() };
            let cells = ["task", &task.name, &place, &row.cause, &origins(row), end_of(task)];
            lines.push(cells.map(String::from).to_vec());
        }
    }
    for clause in &table.clauses {
        for row in &clause.causes {
            let item = format!("{} in {}", clause.wanted, clause.function);
            let cells =
                ["clause", &item, &clause.place.to_string(), &row.cause, &origins(row), &clause.answer];
            lines.push(cells.map(String::from).to_vec());
        }
    }
    for function in &table.functions {
        for row in &function.causes {
            let place = function.place.to_string();
            let cells = ["function", &function.name, &place, &row.cause, &origins(row), "leaves it"];
            lines.push(cells.map(String::from).to_vec());
        }
    }
    lines
}

/// Returns lines as CSV (RFC 4180).
pub(super) fn csv(lines: &CellLines) -> String {
    let cell = |text: &String| {
        if text.contains([',', '"', '\n', '\r']) {
            format!("\"{}\"", text.replace('"', "\"\""))
        } else {
            text.clone()
        }
    };
    lines.iter().map(|line| line.iter().map(cell).collect::<Vec<_>>().join(",") + "\r\n").collect()
}

/// Returns a text as a cell of a table of Markdown, which is one line.
pub fn markdown_cell(text: &str) -> String {
    let mut cell = String::new();
    for line in text.replace("\r\n", "\n").split(['\n', '\r']) {
        if !cell.is_empty() {
            cell += "<br>";
        }
        for c in line.chars() {
            match c {
                '\\' | '|' => cell.extend(['\\', c]),
                '&' => cell += "&amp;",
                '<' => cell += "&lt;",
                other => cell.push(other),
            }
        }
    }
    cell
}

/// Returns lines as a table of Markdown.
pub(super) fn markdown(lines: &CellLines) -> String {
    let mut text = String::new();
    for (index, line) in lines.iter().enumerate() {
        let cells: Vec<String> = line.iter().map(|cell| markdown_cell(cell)).collect();
        // Writing to a text does not fail.
        _ = writeln!(text, "| {} |", cells.join(" | "));
        if index == 0 {
            _ = writeln!(text, "|{}", " --- |".repeat(line.len()));
        }
    }
    text
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns lines as a page.
pub(super) fn html(title: &str, lines: &CellLines) -> String {
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n<style>\
         body {{ font: 14px sans-serif; margin: 2em }}\ntable {{ border-collapse: collapse }}\n\
         th, td {{ border: 1px solid #bbb; padding: 3px 8px; text-align: left; vertical-align: top }}\n\
         th {{ background: #eee }}\n</style></head>\n<body><h1>{0}</h1>\n<table>\n",
        escaped(title)
    );
    for (index, line) in lines.iter().enumerate() {
        let tag = if index == 0 { "th" } else { "td" };
        let cells: String = line.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
        _ = writeln!(text, "<tr>{cells}</tr>");
    }
    text.push_str("</table>\n</body></html>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_markdown_is_one_line() {
        let lines = vec![vec!["a".into(), "b".into()], vec!["|x\\||".into(), "one\r\ntwo\n<b>&amp;".into()]];
        assert_eq!(
            markdown(&lines),
            "| a | b |\n| --- | --- |\n| \\|x\\\\\\|\\| | one<br>two<br>&lt;b>&amp;amp; |\n"
        );
    }
}
