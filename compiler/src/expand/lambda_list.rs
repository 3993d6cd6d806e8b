//! Lambda lists: ordinary ones, those of macros, and those of `destructuring-bind`.
//!
//! One parser reads all three. Where an ordinary lambda list has a variable, the other two may have a
//! pattern, which is a lambda list itself; [`super::destructure`] takes patterns apart.

use esl_bytecode::compile::Arity;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::{Checked, plain, quoted, span_of};
use crate::diagnostic::code;

/// Kind of a lambda list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LambdaListKind {
    /// Of a function.
    Ordinary,
    /// Of a macro: with `&whole`, `&environment`, `&body`, patterns, a dotted end.
    Macro,
    /// Of `destructuring-bind`, or a pattern: as of a macro, without `&environment`.
    Pattern,
}

/// An optional parameter.
#[derive(Clone, Debug)]
pub(super) struct OptionalSpec {
    /// Variable or pattern.
    pub(super) variable: Datum,
    /// Form of the default.
    pub(super) default: Datum,
    /// Variable that says whether there was an argument.
    pub(super) supplied: Option<Datum>,
}

/// A key parameter.
#[derive(Clone, Debug)]
pub(super) struct KeySpec {
    /// Symbol that selects it.
    pub(super) key: Symbol,
    /// Variable, default and supplied-p.
    pub(super) optional: OptionalSpec,
}

/// A lambda list taken apart.
#[derive(Clone, Debug, Default)]
pub(super) struct LambdaList {
    /// Variable or pattern after `&whole`.
    pub(super) whole: Option<Datum>,
    /// Variable after `&environment`.
    pub(super) environment: Option<Datum>,
    /// Required parameters.
    pub(super) required: Vec<Datum>,
    /// Optional parameters.
    pub(super) optional: Vec<OptionalSpec>,
    /// Rest parameter.
    pub(super) rest: Option<Datum>,
    /// Key parameters; `None` without `&key`.
    pub(super) keys: Option<Vec<KeySpec>>,
    /// Whether other keys are allowed.
    pub(super) allow_other_keys: bool,
    /// Auxiliary variables and the forms of their values.
    pub(super) aux: Vec<(Datum, Datum)>,
}

/// Section of a lambda list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum ParameterSection {
    Required,
    Optional,
    Rest,
    AfterRest,
    Key,
    AfterKey,
    Aux,
}

impl LambdaList {
    /// Parses a lambda list. `span` is the place of data without a place of their own.
    pub(super) fn parse(list: &Datum, kind: LambdaListKind, span: Span) -> Checked<LambdaList> {
        Parser { kind, span, section: ParameterSection::Required, parsed: LambdaList::default() }.parse(list)
    }

    /// Returns how many arguments a function of this lambda list takes.
    pub(super) fn arity(&self) -> Arity {
        let min = self.required.len() as u32;
        let is_open = self.rest.is_some() || self.keys.is_some();
        Arity { min, max: (!is_open).then(|| min + self.optional.len() as u32) }
    }
}

struct Parser {
    kind: LambdaListKind,
    span: Span,
    section: ParameterSection,
    parsed: LambdaList,
}

impl Parser {
    fn parse(mut self, list: &Datum) -> Checked<LambdaList> {
        let is_list = matches!(list.kind(), DatumKind::Cons(..) | DatumKind::Nil);
        if !is_list && (self.kind != LambdaListKind::Pattern || list.as_symbol().is_none()) {
            let fault = self.wrong(list, &format!("a lambda list is a list, not {}", quoted(list)));
            let name = list.as_symbol().map(plain).unwrap_or_default();
            let name = name.trim_start_matches('[').trim_end_matches(']');
            let is_name = !name.is_empty() && !name.starts_with(':');
            return Err(if is_name { Box::new(fault.help(format!("write `({name})`"))) } else { fault });
        }
        let mut elements = list.elements();
        while let Some(item) = elements.next() {
            match item.as_symbol().filter(|symbol| symbol.name().starts_with('&') && symbol.name().len() > 1)
            {
                Some(keyword) => {
                    let keyword = keyword.clone();
                    let follower = if matches!(keyword.name(), "&WHOLE" | "&ENVIRONMENT") {
                        elements.next()
                    } else {
                        None
                    };
                    self.keyword(&keyword, item, follower)?;
                }
                None => self.parameter(item)?,
            }
        }
        let tail = elements.tail();
        if !tail.is_nil() {
            if self.kind == LambdaListKind::Ordinary
                || self.parsed.rest.is_some()
                || self.section > ParameterSection::Optional
            {
                return Err(self.wrong(tail, "expected `)` at the end of a lambda list, found a dot"));
            }
            self.variable(tail)?;
            self.parsed.rest = Some(tail.clone());
        }
        if self.section == ParameterSection::Rest {
            let keyword = list.elements().last().unwrap_or(list);
            return Err(self.wrong(keyword, "`&rest` needs the name of a variable after it"));
        }
        Ok(self.parsed)
    }

    fn keyword(&mut self, keyword: &Symbol, item: &Datum, follower: Option<&Datum>) -> Checked {
        let name = keyword.name();
        let goes_on = |section| self.section < section && self.section != ParameterSection::Rest;
        let next = match name {
            "&OPTIONAL" if goes_on(ParameterSection::Optional) => ParameterSection::Optional,
            "&REST" if goes_on(ParameterSection::Rest) => ParameterSection::Rest,
            "&BODY" if goes_on(ParameterSection::Rest) && self.kind != LambdaListKind::Ordinary => {
                ParameterSection::Rest
            }
            "&KEY" if goes_on(ParameterSection::Key) => ParameterSection::Key,
            "&ALLOW-OTHER-KEYS" if self.section == ParameterSection::Key => ParameterSection::AfterKey,
            "&AUX" if goes_on(ParameterSection::Aux) => ParameterSection::Aux,
            "&WHOLE" if self.kind != LambdaListKind::Ordinary && self.is_fresh() => {
                let Some(variable) = follower else {
                    return Err(self.wrong(item, "`&whole` needs the name of a variable after it"));
                };
                self.variable(variable)?;
                self.parsed.whole = Some(variable.clone());
                return Ok(());
            }
            "&ENVIRONMENT" if self.kind == LambdaListKind::Macro && self.parsed.environment.is_none() => {
                match follower.filter(|variable| variable.as_symbol().is_some()) {
                    Some(variable) => self.parsed.environment = Some(variable.clone()),
                    None => {
                        return Err(self.wrong(item, "`&environment` needs the name of a variable after it"));
                    }
                }
                return Ok(());
            }
            "&OPTIONAL" | "&REST" | "&BODY" | "&KEY" | "&ALLOW-OTHER-KEYS" | "&AUX" | "&WHOLE"
            | "&ENVIRONMENT" => {
                let message = format!("`{}` cannot stand here in a lambda list", plain(keyword));
                return Err(self.wrong(item, &message).with_order(self.kind));
            }
            _ => {
                let message = format!("unknown lambda list keyword `{}`", plain(keyword));
                return Err(self.wrong(item, &message).with_order(self.kind));
            }
        };
        match next {
            ParameterSection::Key => self.parsed.keys = Some(Vec::new()),
            ParameterSection::AfterKey => self.parsed.allow_other_keys = true,
            _ => {}
        }
        self.section = next;
        Ok(())
    }

    /// Whether nothing has been parsed.
    fn is_fresh(&self) -> bool {
        self.section == ParameterSection::Required
            && self.parsed.required.is_empty()
            && self.parsed.whole.is_none()
            && self.parsed.environment.is_none()
    }

    fn parameter(&mut self, item: &Datum) -> Checked {
        match self.section {
            ParameterSection::Required => {
                self.variable(item)?;
                self.parsed.required.push(item.clone());
            }
            ParameterSection::Optional => {
                let optional = self.optional(item)?;
                self.parsed.optional.push(optional);
            }
            ParameterSection::Rest => {
                self.variable(item)?;
                self.parsed.rest = Some(item.clone());
                self.section = ParameterSection::AfterRest;
            }
            ParameterSection::Key => {
                let key = self.key(item)?;
                self.parsed.keys.get_or_insert_default().push(key);
            }
            ParameterSection::Aux => {
                let OptionalSpec { variable, default, supplied } = self.optional(item)?;
                if let Some(extra) = supplied {
                    return Err(self.wrong(&extra, "an `&aux` variable takes a value only"));
                }
                self.parsed.aux.push((variable, default));
            }
            ParameterSection::AfterRest => return Err(self.wrong(item, "only one name can follow `&rest`")),
            ParameterSection::AfterKey => {
                return Err(self.wrong(item, "no name can follow `&allow-other-keys`"));
            }
        }
        Ok(())
    }

    /// `name`, `(name)`, `(name default)` or `(name default supplied)`
    fn optional(&mut self, item: &Datum) -> Checked<OptionalSpec> {
        let Some((variable, rest)) = item.as_cons() else {
            self.variable(item)?;
            return Ok(OptionalSpec {
                variable: item.clone(),
                default: Datum::nil(item.span()),
                supplied: None,
            });
        };
        self.variable(variable)?;
        self.with_default(variable.clone(), rest, item)
    }

    fn with_default(&mut self, variable: Datum, rest: &Datum, item: &Datum) -> Checked<OptionalSpec> {
        let rest = rest.as_list();
        let (default, supplied) = match rest.as_deref() {
            Some([]) => (Datum::nil(item.span()), None),
            Some([default]) => ((*default).clone(), None),
            Some([default, supplied]) => {
                if supplied.as_symbol().is_none() {
                    return Err(
                        self.wrong(supplied, "the third part of a parameter is the name of a variable")
                    );
                }
                ((*default).clone(), Some((*supplied).clone()))
            }
            _ => {
                let message = "a parameter is a name, or a list of a name, a default and a variable";
                return Err(self.wrong(item, message));
            }
        };
        Ok(OptionalSpec { variable, default, supplied })
    }

    /// As [`Parser::optional`], or with `(key name)` in place of the name.
    fn key(&mut self, item: &Datum) -> Checked<KeySpec> {
        if let Some((head, rest)) = item.as_cons()
            && head.as_cons().is_some()
        {
            let pair = head.as_list();
            let Some([key, variable]) = pair.as_deref() else {
                return Err(self.wrong(head, "a key and its variable are written `((:key name) default)`"));
            };
            let Some(symbol) = key.as_symbol() else {
                return Err(self.wrong(key, "a key is a symbol"));
            };
            self.variable(variable)?;
            let optional = self.with_default((*variable).clone(), rest, item)?;
            return Ok(KeySpec { key: symbol.clone(), optional });
        }
        let optional = self.optional(item)?;
        match optional.variable.as_symbol() {
            Some(symbol) => Ok(KeySpec { key: Symbol::keyword(symbol.name()), optional }),
            None => Err(self.wrong(item, "a key parameter is a name, or begins with `(:key name)`")),
        }
    }

    /// Checks that `item` can receive an argument.
    fn variable(&self, item: &Datum) -> Checked {
        let is_pattern = self.kind != LambdaListKind::Ordinary
            && matches!(item.kind(), DatumKind::Cons(..) | DatumKind::Nil);
        if item.as_symbol().is_some() || is_pattern {
            return Ok(());
        }
        Err(self.wrong(item, &format!("a parameter is a name, not {}", quoted(item))))
    }

    fn wrong(&self, item: &Datum, message: &str) -> Box<Diagnostic> {
        Box::new(code::MALFORMED_LAMBDA_LIST.at(span_of(item, self.span), message))
    }
}

trait WithOrder {
    fn with_order(self, kind: LambdaListKind) -> Self;
}

impl WithOrder for Box<Diagnostic> {
    /// Adds the order of the keywords.
    fn with_order(self, kind: LambdaListKind) -> Self {
        let order = match kind {
            LambdaListKind::Ordinary => "`&optional`, `&rest`, `&key`, `&allow-other-keys`, `&aux`",
            LambdaListKind::Macro | LambdaListKind::Pattern => {
                "`&whole`, `&optional`, `&rest` or `&body`, `&key`, `&allow-other-keys`, `&aux`"
            }
        };
        Box::new((*self).help(format!("the keywords are, in this order: {order}")))
    }
}
