//! Random programs in the notation: well formed, often sensible, and mostly ending.

use std::fmt::Write;

/// Writes a program as the choices say; without more choices everything becomes as small as it can be.
pub(super) fn program(choices: &[u8]) -> String {
    let mut generator = Generator { choices: choices.iter(), scope: Vec::new(), next: 0, loops: 0 };
    generator.form(0)
}

#[derive(Clone, PartialEq)]
enum Name {
    Variable(String),
    /// A loop's counter, which only the loop sets.
    Counter(String),
    Function(String, usize),
    Block(String),
    /// A tag ahead: going to it does not loop.
    Tag(String),
}

struct Generator<'a> {
    choices: std::slice::Iter<'a, u8>,
    scope: Vec<Name>,
    next: u32,
    loops: u32,
}

impl Generator<'_> {
    fn choose(&mut self, count: usize) -> usize {
        usize::from(self.choices.next().copied().unwrap_or(0)) % count
    }

    fn fresh(&mut self, letter: &str) -> String {
        self.next += 1;
        format!("{letter}{}", self.next)
    }

    fn pick<T>(&mut self, select: impl Fn(&Name) -> Option<T>) -> Option<T> {
        let mut known: Vec<T> = self.scope.iter().filter_map(select).collect();
        if known.is_empty() {
            return None;
        }
        // Mostly one of the newest, so that forms have to do with each other.
        let among = if self.choose(3) == 0 { known.len() } else { known.len().min(3) };
        let index = known.len() - 1 - self.choose(among);
        Some(known.swap_remove(index))
    }

    fn forms(&mut self, count: usize, depth: u32) -> String {
        (0..count).map(|_| format!(" {}", self.form(depth))).collect()
    }

    fn leaf(&mut self) -> String {
        match self.choose(8) {
            0 => "nil".to_string(),
            1 => "t".to_string(),
            2 => "*a*".to_string(),
            3 => format!("{}", self.choose(7) as i64 - 3),
            4 => "'(1 2)".to_string(),
            _ => self
                .pick(|name| match name {
                    Name::Variable(name) | Name::Counter(name) => Some(name.clone()),
                    _ => None,
                })
                .unwrap_or_else(|| "7".to_string()),
        }
    }

    fn with(&mut self, names: Vec<Name>, make: impl FnOnce(&mut Self) -> String) -> String {
        let height = self.scope.len();
        self.scope.extend(names);
        let text = make(self);
        self.scope.truncate(height);
        text
    }

    fn form(&mut self, depth: u32) -> String {
        if depth > 7 {
            return self.leaf();
        }
        let depth = depth + 1;
        match self.choose(45) {
            0..=3 => self.leaf(),
            4..=6 => {
                let operator =
                    ["+", "-", "*", "<", "=", ">", "<=", ">=", "eq", "eql", "cons", "list", "list*", "mod"];
                let operator = operator[self.choose(14)];
                format!("({operator}{})", self.forms(2, depth))
            }
            7 => {
                let operator =
                    ["car", "cdr", "not", "1+", "1-", "zerop", "consp", "atom", "integerp", "-", "identity"];
                let operator = operator[self.choose(11)];
                format!("({operator}{})", self.forms(1, depth))
            }
            8 => format!("(+{} {} {})", self.forms(1, depth), self.choose(5), self.leaf()),
            9 | 10 => format!("(note{})", self.forms(1, depth)),
            11 => {
                let count = self.choose(4);
                format!("(two{})", self.forms(count, depth))
            }
            12 | 13 => format!("(if{})", self.forms(3, depth)),
            14 => {
                let count = 2 + self.choose(2);
                format!("({}{})", ["and", "or"][self.choose(2)], self.forms(count, depth))
            }
            15 => {
                let count = self.choose(4);
                format!("(progn{})", self.forms(count, depth))
            }
            16..=18 => self.let_form(depth),
            43 => {
                let variable = self.pick(|name| match name {
                    Name::Variable(name) => Some(name.clone()),
                    _ => None,
                });
                let variable = variable.unwrap_or("*b*".to_string());
                format!(
                    "(list {variable}{} (setq {variable}{}) {variable})",
                    self.forms(1, depth),
                    self.forms(1, depth)
                )
            }
            19 | 20 => {
                let variable = self.pick(|name| match name {
                    Name::Variable(name) => Some(name.clone()),
                    _ => None,
                });
                format!("(setq {}{})", variable.unwrap_or("*b*".to_string()), self.forms(1, depth))
            }
            21 => {
                let name = self.fresh("b");
                let body = self.with(vec![Name::Block(name.clone())], |this| this.forms(2, depth));
                format!("(block {name}{body})")
            }
            22 | 23 => {
                let block = self.pick(|name| match name {
                    Name::Block(name) => Some(name.clone()),
                    _ => None,
                });
                match block {
                    Some(block) => format!("(return-from {block}{})", self.forms(1, depth)),
                    None => self.leaf(),
                }
            }
            24 | 25 => self.tagbody(depth),
            26 => {
                let tag = self.pick(|name| match name {
                    Name::Tag(name) => Some(name.clone()),
                    _ => None,
                });
                tag.map_or_else(|| self.leaf(), |tag| format!("(go {tag})"))
            }
            27 => format!("(catch 'k{})", self.forms(1, depth)),
            28 => format!("(throw 'k{})", self.forms(1, depth)),
            29 => format!("(unwind-protect{} (note 'cleanup){})", self.forms(1, depth), self.forms(1, depth)),
            30 => {
                let count = self.choose(4);
                format!("(values{})", self.forms(count, depth))
            }
            31 => {
                let names: Vec<String> = (0..self.choose(4)).map(|_| self.fresh("m")).collect();
                let form = self.form(depth);
                let bound = names.iter().cloned().map(Name::Variable).collect();
                let body = self.with(bound, |this| this.forms(1, depth));
                format!("(multiple-value-bind ({}) {form}{body})", names.join(" "))
            }
            32 => {
                let count = self.choose(3);
                format!("(multiple-value-call #list{})", self.forms(count, depth))
                    .replace("#list", "(function list)")
            }
            33 => format!("(multiple-value-prog1{})", self.forms(2, depth)),
            34 => {
                format!("(handler-case{} (error (c) (note c){}))", self.forms(1, depth), self.forms(1, depth))
            }
            35 => "(fail)".to_string(),
            36 => format!("(let ((*a*{})){})", self.forms(1, depth), self.forms(2, depth)),
            37 => {
                let lambda = self.lambda(depth);
                if self.choose(2) == 0 {
                    return format!("(let ((f {lambda})) (funcall f{}))", self.forms(1, depth));
                }
                format!("(funcall {lambda}{})", self.forms(1, depth))
            }
            38 => {
                let lambda = self.lambda(depth);
                format!("(apply {lambda} (list{}))", self.forms(1, depth))
            }
            39 | 40 => self.functions(depth),
            41 | 42 => {
                let function = self.pick(|name| match name {
                    Name::Function(name, count) => Some((name.clone(), *count)),
                    _ => None,
                });
                match function {
                    Some((name, _)) if self.choose(6) == 1 => format!("(apply (function {name}) '(1))"),
                    Some((name, count)) => {
                        format!("({name} {}{})", self.choose(4), self.forms(count - 1, depth))
                    }
                    None => format!("(floor{} 2)", self.forms(1, depth)),
                }
            }
            _ => format!("(progv '(*a* *c*) (list{}){})", self.forms(1, depth), self.forms(1, depth)),
        }
    }

    fn let_form(&mut self, depth: u32) -> String {
        let sequential = self.choose(2) == 1;
        let mut bindings = String::new();
        let mut bound = Vec::new();
        let height = self.scope.len();
        for _ in 0..=self.choose(3) {
            let name = self.fresh("x");
            let _ = write!(bindings, "({name} {})", self.form(depth));
            if sequential {
                self.scope.push(Name::Variable(name));
            } else {
                bound.push(Name::Variable(name));
            }
        }
        // Now and then an assignment in parallel, as `psetq` makes it.
        let psetq = if !sequential && bound.len() > 1 && self.choose(3) == 1 {
            let sets: Option<String> = bound
                .iter()
                .map(|name| {
                    let Name::Variable(name) = name else { return None };
                    let target = self.pick(|name| match name {
                        Name::Variable(name) => Some(name.clone()),
                        _ => None,
                    })?;
                    Some(format!("(setq {target} {name})"))
                })
                .collect();
            sets
        } else {
            None
        };
        if let Some(sets) = psetq {
            self.scope.truncate(height);
            if self.choose(2) == 0 {
                let direct = self.pick(|name| match name {
                    Name::Variable(name) => Some(name.clone()),
                    _ => None,
                });
                let direct =
                    direct.map_or(String::new(), |name| format!("(setq {name}{})", self.forms(1, depth + 3)));
                return format!("(let* ({bindings}) (progn {direct} {sets} {}))", self.leaf());
            }
            return format!("(let ({bindings}) (progn {sets} {}))", self.leaf());
        }
        self.scope.extend(bound);
        let body = self.forms(2, depth);
        self.scope.truncate(height);
        format!("(let{} ({bindings}){body})", if sequential { "*" } else { "" })
    }

    /// A counted loop, or a tagbody whose tags are ahead.
    fn tagbody(&mut self, depth: u32) -> String {
        if self.choose(2) == 0 && self.loops < 3 {
            let [counter, limit, top, end] = ["i", "n", "top", "end"].map(|letter| self.fresh(letter));
            self.loops += 1;
            let bound =
                vec![Name::Counter(counter.clone()), Name::Counter(limit.clone()), Name::Tag(end.clone())];
            let body = self.with(bound, |this| this.forms(1, depth));
            self.loops -= 1;
            let test = [
                format!("(if (< {counter} {limit}) nil (go {end}))"),
                format!("(if (>= {counter} {limit}) (go {end}))"),
                format!("(if (> {counter} {limit}) (go {end}))"),
                format!("(if (= {counter} {limit}) (go {end}))"),
            ];
            let test = &test[self.choose(4)];
            let start = self.choose(3);
            return format!(
                "(let (({counter} {start}) ({limit} 3)) (tagbody {top} {test}{body} (setq {counter} (+ {counter} 1)) (go {top}) {end}))"
            );
        }
        let tags = [self.fresh("t"), self.fresh("t")];
        let first = self.with(tags.iter().cloned().map(Name::Tag).collect(), |this| this.forms(2, depth));
        let second = self.with(vec![Name::Tag(tags[1].clone())], |this| this.forms(1, depth));
        format!("(tagbody{first} {}{second} {}{})", tags[0], tags[1], self.forms(1, depth))
            .replace(" nil", " (note nil)")
    }

    fn lambda(&mut self, depth: u32) -> String {
        let name = self.fresh("p");
        let bound = vec![Name::Variable(name.clone())];
        let body = self.with(bound, |this| this.forms(1, depth));
        match self.choose(5) {
            0 | 1 => format!("(lambda ({name}){body})"),
            2 => format!("(lambda (&optional ({name} 3)){body})"),
            3 => format!("(lambda (q &optional ({name} (note q) given)) (note given){body})"),
            _ => format!("(lambda (&rest {name}){body})"),
        }
    }

    /// Local functions; those of `labels` count down, so that they end.
    fn functions(&mut self, depth: u32) -> String {
        let names: Vec<(String, usize)> =
            (0..=self.choose(2)).map(|_| (self.fresh("f"), 1 + self.choose(3))).collect();
        let recursive = self.choose(2) == 1;
        let known: Vec<Name> =
            names.iter().map(|(name, count)| Name::Function(name.clone(), *count)).collect();
        let mut definitions = String::new();
        for (name, count) in &names {
            let parameter = self.fresh("k");
            let others: Vec<String> = (1..*count).map(|_| self.fresh("o")).collect();
            let mut bound: Vec<Name> = others.iter().cloned().map(Name::Variable).collect();
            bound.push(Name::Counter(parameter.clone()));
            let call = if recursive {
                let (other, count) = names[self.choose(names.len())].clone();
                let rest = self.with(bound.clone(), |this| {
                    (1..count)
                        .map(
                            |_| if this.choose(2) == 0 { this.forms(1, 8) } else { this.forms(1, depth + 2) },
                        )
                        .collect::<String>()
                });
                let call = format!("({other} (- {parameter} 1){rest})");
                match self.choose(4) {
                    0 => call,
                    1 => format!("(note {call})"),
                    2 => format!("(let ((z 1)) (setq z (+ z {parameter})) (note z) {call})"),
                    _ => {
                        bound.push(Name::Variable("z".to_string()));
                        let inner = self.with(bound.clone(), |this| this.forms(1, depth));
                        bound.pop();
                        format!("(let ((z (lambda () {parameter}))) {inner} (note (apply z nil)) {call})")
                    }
                }
            } else {
                parameter.clone()
            };
            let body = self.with(bound, |this| this.forms(1, depth));
            let guard = format!("(if (< 0 {parameter}) {call}{body})");
            let others: String = others.iter().map(|other| format!(" {other}")).collect();
            let _ = write!(definitions, "({name} ({parameter}{others}) {guard})");
        }
        let body = self.with(known, |this| this.forms(2, depth));
        format!("({} ({definitions}){body})", if recursive { "labels" } else { "flet" })
    }
}
