//! Random programs, generated from a grammar and a seed, for the comparison with another implementation.
//! Together they use every operator. See `differential/README.md`.
//!
//! Guarantees: a grammar and a seed yield the same programs on every machine.

use std::collections::BTreeMap;

use crate::fault::{LineFault, WrongLine};

/// A part of a template.
#[derive(Clone, Debug, PartialEq, Eq)]
enum TemplatePart {
    /// Literal text.
    Text(String),
    /// A place for an expression of this type.
    Hole(String),
    /// A place for the number of the program.
    Number,
}

/// A template for expressions of one type.
#[derive(Clone, Debug)]
struct Template {
    kind: String,
    parts: Vec<TemplatePart>,
    uses: u32,
}

impl Template {
    fn is_leaf(&self) -> bool {
        !self.parts.iter().any(|part| matches!(part, TemplatePart::Hole(_)))
    }
}

/// Type of the templates that are whole programs, with definitions before the form.
const WHOLE: &str = "top";

/// Depth to which templates are nested.
const DEPTH: u32 = 3;

/// The templates, with the number of uses of each.
#[derive(Debug)]
pub struct Grammar {
    templates: Vec<Template>,
    by_type: BTreeMap<String, Vec<usize>>,
    state: u64,
}

impl Grammar {
    /// Reads a grammar: lines `type| template`; a line that begins with `#` is a comment.
    ///
    /// # Errors
    /// The line and its fault.
    pub fn parse(text: &str, seed: u64) -> Result<Grammar, WrongLine> {
        let mut grammar = Grammar { templates: Vec::new(), by_type: BTreeMap::new(), state: seed };
        // Lines of the templates.
        let mut numbers = Vec::new();
        for (index, line) in text.lines().enumerate() {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let (kind, template) =
                line.split_once("| ").ok_or_else(|| LineFault::NoTemplate.on(index + 1))?;
            numbers.push(index + 1);
            let number = grammar.templates.len();
            grammar.by_type.entry(kind.to_string()).or_default().push(number);
            grammar.templates.push(Template {
                kind: kind.to_string(),
                parts: parse_template(template),
                uses: 0,
            });
        }
        for (template, line) in grammar.templates.iter().zip(numbers) {
            for part in &template.parts {
                if let TemplatePart::Hole(kind) = part
                    && !grammar.by_type.contains_key(kind)
                {
                    return Err(LineFault::NoTemplateOf(kind.clone()).on(line));
                }
            }
        }
        Ok(grammar)
    }

    /// Returns the programs, one for each template that has holes, is a whole program or is a call, in order.
    pub fn programs(&mut self) -> Vec<String> {
        let is_root = |template: &Template| {
            template.kind != "fn" && !template.is_leaf() || template.kind == WHOLE || is_call(template)
        };
        let roots: Vec<usize> =
            (0..self.templates.len()).filter(|&index| is_root(&self.templates[index])).collect();
        let mut programs = Vec::with_capacity(roots.len());
        for (number, root) in roots.into_iter().enumerate() {
            let number = number + 1;
            let mut text = String::new();
            self.fill(root, number, DEPTH, &mut text);
            programs.push(whole(&text, number, self.templates[root].kind == WHOLE));
        }
        programs
    }

    fn fill(&mut self, template: usize, number: usize, depth: u32, text: &mut String) {
        self.templates[template].uses += 1;
        for part in self.templates[template].parts.clone() {
            match part {
                TemplatePart::Text(part) => text.push_str(&part),
                TemplatePart::Number => text.push_str(&number.to_string()),
                TemplatePart::Hole(kind) => {
                    let chosen = self.choose(&kind, depth);
                    self.fill(chosen, number, depth.saturating_sub(1), text);
                }
            }
        }
    }

    /// Chooses one of the least used templates of a type. At depth 0 it chooses a leaf, if the type has any;
    /// above, it prefers leaves in a third of the cases.
    fn choose(&mut self, kind: &str, depth: u32) -> usize {
        let all = self.by_type[kind].clone();
        let wants_leaf = depth == 0 || self.random(3) == 0;
        let (leaves, others): (Vec<usize>, Vec<usize>) =
            all.into_iter().partition(|&index| self.templates[index].is_leaf());
        let candidates = match (leaves.is_empty(), others.is_empty()) {
            (false, false) if wants_leaf => leaves,
            (_, false) if !wants_leaf || leaves.is_empty() => others,
            _ => leaves,
        };
        let least = candidates.iter().map(|&index| self.templates[index].uses).min().unwrap_or(0);
        let rare: Vec<usize> =
            candidates.into_iter().filter(|&index| self.templates[index].uses <= least + 1).collect();
        let chosen = self.random(rare.len() as u64) as usize;
        rare[chosen]
    }

    /// Returns a random number below `limit`, by the generator SplitMix64.
    fn random(&mut self, limit: u64) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % limit.max(1)
    }
}

fn is_call(template: &Template) -> bool {
    // The content of a string is not a form, and the printed form of a function cannot be compared.
    !["datum", "fn", "pred"].contains(&&*template.kind)
        && matches!(&template.parts[..], [TemplatePart::Text(text)] if text.starts_with('('))
}

fn parse_template(template: &str) -> Vec<TemplatePart> {
    let mut parts = Vec::new();
    let mut text = String::new();
    let mut rest = template;
    while let Some(c) = rest.chars().next() {
        let hole = rest.strip_prefix('<').and_then(|inside| inside.split_once('>'));
        let is_name = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase());
        match hole {
            Some((kind, after)) if is_name(kind) => {
                parts.push(TemplatePart::Text(std::mem::take(&mut text)));
                parts.push(TemplatePart::Hole(kind.to_string()));
                rest = after;
                continue;
            }
            _ if c == '@' && text.ends_with(|c: char| c.is_ascii_alphabetic() || c == '*') => {
                parts.push(TemplatePart::Text(std::mem::take(&mut text)));
                parts.push(TemplatePart::Number);
            }
            _ => text.push(c),
        }
        rest = &rest[c.len_utf8()..];
    }
    parts.push(TemplatePart::Text(text));
    parts.retain(|part| *part != TemplatePart::Text(String::new()));
    parts
}

/// Returns a program: the definitions, then the form to be answered.
fn whole(text: &str, number: usize, has_definitions: bool) -> String {
    let mut program = format!(";;; {number}\n");
    let mut forms = if has_definitions { progn_forms(text) } else { vec![text] };
    let last = forms.pop().unwrap_or(text);
    for form in forms {
        program.push_str(form);
        program.push('\n');
    }
    program.push_str(&format!("(answer {number} {last})\n"));
    program
}

/// Returns the forms in `(progn form…)`.
fn progn_forms(text: &str) -> Vec<&str> {
    let inside = text.strip_prefix("(progn ").and_then(|text| text.strip_suffix(')')).unwrap_or(text);
    let (mut forms, mut start, mut depth, mut in_string) = (Vec::new(), 0, 0_u32, false);
    let bytes = inside.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'\\' => at += 1,
            b'"' => in_string = !in_string,
            b'(' if !in_string => depth += 1,
            b')' if !in_string => depth = depth.saturating_sub(1),
            b' ' if !in_string && depth == 0 => {
                forms.push(&inside[start..at]);
                start = at + 1;
            }
            _ => {}
        }
        at += 1;
    }
    forms.push(&inside[start..]);
    forms
}

/// Returns the answers in the output of a run, by program number.
pub fn answers(output: &str) -> BTreeMap<usize, String> {
    let mut answers = BTreeMap::new();
    let mut number = 0;
    for line in output.lines() {
        match line.strip_prefix(";;; ").and_then(|number| number.parse().ok()) {
            Some(next) => number = next,
            None => {
                let answer: &mut String = answers.entry(number).or_default();
                answer.push_str(line);
                answer.push('\n');
            }
        }
    }
    answers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn templates_are_filled() {
        let text =
            "# numbers\nint| 1\nint| (+ <int> <int>)\ntop| (progn (defun f@ (x) (< x \"(\")) (f@ <int>))\n";
        let programs = Grammar::parse(text, 1).expect("it is a grammar").programs();
        assert_eq!(programs.len(), 2);
        assert!(programs[0].starts_with(";;; 1\n(answer 1 (+ "), "{}", programs[0]);
        assert!(
            programs[1].starts_with(";;; 2\n(defun f2 (x) (< x \"(\"))\n(answer 2 (f2 "),
            "{}",
            programs[1]
        );
        assert!(Grammar::parse("int| <nothing>", 1).is_err());
    }

    #[test]
    fn answers_are_separated() {
        let found = answers(";;; 1\n5\n;;; 3\nprints \"a\nb\"\nNIL\n");
        let expected = [(1, "5\n".to_string()), (3, "prints \"a\nb\"\nNIL\n".to_string())];
        assert_eq!(found, expected.into());
    }
}
