//! Forms of ESL as a flat list, and their text.
//!
//! Guarantees: parts come before the forms that contain them; the text takes time in proportion to its
//! length, without native recursion. Lines are broken where a person would; the formatter indents them.

/// Index of a form.
pub(crate) type FormId = usize;

/// Widest text of a form on one line, less its depth.
const WIDTH: usize = 88;

/// Width of a form that cannot stand on one line.
const BROKEN: usize = 1 << 20;

/// Operators whose forms take several lines.
const BROKEN_OPERATORS: [&str; 15] = [
    "bt:round-robin",
    "bt:sequence-with-memory",
    "bt:ticking",
    "bt:with-outcome",
    "bt:with-recovery",
    "cond",
    "define-mock",
    "defun",
    "or-parallel",
    "pursue",
    "ros:with-node",
    "task-net",
    "try-in-order",
    "with-guardian",
    "with-recovery-procedures",
];

#[derive(Clone, Debug)]
enum Content {
    Atom(String),
    List(Vec<FormId>),
    /// Comments before a form.
    Commented(Vec<String>, FormId),
}

#[derive(Clone, Debug)]
struct EslForm {
    content: Content,
    /// Items on the line of the parenthesis, if the list takes several lines.
    head: usize,
    width: usize,
    depth: usize,
    /// Number of atoms.
    size: usize,
}

/// A step of printing.
enum LayoutStep<'a> {
    EslForm(FormId, usize),
    Text(&'a str),
    Line,
}

/// All forms of a program.
#[derive(Debug, Default)]
pub(crate) struct Forms {
    forms: Vec<EslForm>,
}

impl Forms {
    fn push(&mut self, form: EslForm) -> FormId {
        self.forms.push(form);
        self.forms.len() - 1
    }

    pub(crate) fn atom(&mut self, text: impl Into<String>) -> FormId {
        let text = text.into();
        let width = text.chars().count();
        self.push(EslForm { content: Content::Atom(text), head: 0, width, depth: 0, size: 1 })
    }

    /// Makes a list, of which `head` items stand on the first line.
    pub(crate) fn list(&mut self, head: usize, items: impl IntoIterator<Item = FormId>) -> FormId {
        let items: Vec<FormId> = items.into_iter().collect();
        let parts = || items.iter().filter_map(|&item| self.forms.get(item));
        let width = parts().map(|form| form.width + 1).sum::<usize>() + 1;
        let depth = parts().map(|form| form.depth).max().unwrap_or(0) + 1;
        let size = parts().map(|form| form.size).sum();
        self.push(EslForm { content: Content::List(items), head, width: width.min(BROKEN), depth, size })
    }

    /// Makes a list that begins with a symbol.
    pub(crate) fn call(
        &mut self,
        operator: &str,
        head: usize,
        rest: impl IntoIterator<Item = FormId>,
    ) -> FormId {
        let is_broken = BROKEN_OPERATORS.contains(&operator);
        let operator = self.atom(operator);
        let form = self.list(head, std::iter::once(operator).chain(rest));
        if is_broken {
            self.forms[form].width = BROKEN;
        }
        form
    }

    /// Makes a list of atoms.
    pub(crate) fn atoms(&mut self, atoms: &[&str]) -> FormId {
        let items: Vec<FormId> = atoms.iter().map(|&text| self.atom(text)).collect();
        self.list(usize::MAX, items)
    }

    /// Puts comments before a form.
    pub(crate) fn commented(&mut self, comments: Vec<String>, form: FormId) -> FormId {
        if comments.is_empty() {
            return form;
        }
        let EslForm { depth, size, .. } = self.forms[form];
        self.push(EslForm {
            content: Content::Commented(comments, form),
            head: 0,
            width: BROKEN,
            depth,
            size,
        })
    }

    /// Returns the text of an atom.
    pub(crate) fn text_of(&self, form: FormId) -> Option<&str> {
        match &self.forms[form].content {
            Content::Atom(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the items of a list.
    pub(crate) fn items(&self, form: FormId) -> &[FormId] {
        match &self.forms[form].content {
            Content::List(items) => items,
            _ => &[],
        }
    }

    /// Returns the arguments of a list of this operator.
    pub(crate) fn arguments_of(&self, operator: &str, form: FormId) -> Option<&[FormId]> {
        let (first, rest) = self.items(form).split_first()?;
        (self.text_of(*first) == Some(operator)).then_some(rest)
    }

    /// Returns the argument of a list of this operator and one argument.
    pub(crate) fn argument_of(&self, operator: &str, form: FormId) -> Option<FormId> {
        match self.arguments_of(operator, form) {
            Some(&[argument]) => Some(argument),
            _ => None,
        }
    }

    pub(crate) fn depth(&self, form: FormId) -> usize {
        self.forms[form].depth
    }

    pub(crate) fn size(&self, form: FormId) -> usize {
        self.forms[form].size
    }

    /// Returns the atoms of a form.
    pub(crate) fn all_atoms(&self, form: FormId) -> Vec<&str> {
        let mut atoms = Vec::new();
        let mut waiting = vec![form];
        while let Some(form) = waiting.pop() {
            match &self.forms[form].content {
                Content::Atom(text) => atoms.push(&**text),
                Content::List(items) => waiting.extend(items),
                Content::Commented(_, form) => waiting.push(*form),
            }
        }
        atoms
    }

    /// Adds the text of a form.
    pub(crate) fn print(&self, form: FormId, text: &mut String) {
        let mut steps = vec![LayoutStep::EslForm(form, 0)];
        while let Some(step) = steps.pop() {
            match step {
                LayoutStep::Text(part) => text.push_str(part),
                LayoutStep::Line => text.push('\n'),
                LayoutStep::EslForm(form, depth) => self.print_one(form, depth, &mut steps, text),
            }
        }
        text.push('\n');
    }

    fn print_one<'a>(&'a self, id: FormId, depth: usize, steps: &mut Vec<LayoutStep<'a>>, text: &mut String) {
        let form = &self.forms[id];
        match &form.content {
            Content::Atom(atom) => text.push_str(atom),
            Content::Commented(comments, form) => {
                if !text.is_empty() && !text.ends_with('\n') {
                    text.push('\n');
                }
                for comment in comments {
                    text.push_str("; ");
                    text.push_str(comment);
                    text.push('\n');
                }
                steps.push(LayoutStep::EslForm(*form, depth));
            }
            Content::List(items) => {
                text.push('(');
                let is_flat = form.width + 2 * depth.min(20) <= WIDTH;
                let mut parts = Vec::new();
                for (at, &item) in items.iter().enumerate() {
                    if at > 0 {
                        // A value follows its keyword on the same line.
                        let follows = at > 1 && at >= form.head && self.is_keyword(items[at - 1]);
                        let is_beside = is_flat || at < form.head || follows && !self.is_keyword(item);
                        parts.push(if is_beside { LayoutStep::Text(" ") } else { LayoutStep::Line });
                    }
                    parts.push(LayoutStep::EslForm(item, depth + 1));
                }
                steps.push(LayoutStep::Text(")"));
                steps.extend(parts.into_iter().rev());
            }
        }
    }

    fn is_keyword(&self, form: FormId) -> bool {
        self.text_of(form).is_some_and(|text| text.starts_with(':'))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_take_several_lines() {
        let mut forms = Forms::default();
        let arguments: Vec<FormId> =
            (0..6).flat_map(|n| [forms.atom(format!(":a-long-keyword-{n}")), forms.atom("12")]).collect();
        let call = forms.call("move", 1, arguments);
        let comment = forms.commented(vec!["A comment".into()], call);
        let test = forms.atoms(&["ready", "t"]);
        let form = forms.call("when", 2, [test, comment]);
        let mut text = String::new();
        forms.print(form, &mut text);
        assert!(
            text.starts_with(
                "(when (ready t)\n; A comment\n(move\n:a-long-keyword-0 12\n:a-long-keyword-1 12\n"
            ),
            "{text}"
        );
        assert!(text.ends_with("12))\n"));
    }

    #[test]
    fn depth_takes_no_native_stack() {
        let mut forms = Forms::default();
        let mut form = forms.atom("x");
        for _ in 0..200_000 {
            form = forms.call("f", 2, [form]);
        }
        let mut text = String::new();
        forms.print(form, &mut text);
        assert!(text.ends_with("))\n"));
        assert_eq!((forms.depth(form), forms.all_atoms(form).len()), (200_000, 200_001));
    }
}
