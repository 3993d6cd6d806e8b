//! The facts of a run and its variables of `defdurable`, for another version of the machine.
//!
//! Both are plain data, whose text any version reads: numbers, characters, strings, symbols of packages, and
//! pairs, vectors, hash tables and structures of them. Nothing in the machine changes.
//!
//! A run that has begun from such a text may not have defined all of its variables and structures yet: what
//! waits for them is kept again.

use std::collections::BTreeMap;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_database::{Term, TermContents};
use num_bigint::{BigInt, Sign};

use crate::datum;
use crate::describe::describe;
use crate::value::Value;
use crate::vm::Vm;

/// Most parts of a value.
const PARTS: usize = 1_000_000;
/// The variable whose value are those of variables that are not defined yet: pairs of a name and a value.
const WAITING_VARIABLES: &str = "*%KEPT*";
/// The variable whose value are the facts whose structures are not defined yet.
const WAITING_FACTS: &str = "*%KEPT-FACTS*";
/// Name of the list that stands for a hash table: keys, each followed by its value.
const TABLE: &str = "%KEPT-TABLE";

/// The facts of a run, and its variables that outlive the version of the machine.
#[derive(Clone, Debug, Default)]
pub struct KeptData {
    /// The variables, with their values.
    pub variables: Vec<(Symbol, Datum)>,
    /// The facts, as lists.
    pub facts: Vec<Datum>,
    /// The variables and facts for which no text stands, with the reasons.
    pub left_out: Vec<String>,
}

/// The part of a value that keeps it from being plain data, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
struct NotPlain(String);

impl NotPlain {
    fn of(part: &str) -> NotPlain {
        NotPlain(part.into())
    }
}

/// A step of making a datum.
enum DatumStep<T> {
    Visit(T),
    Pair,
    Ratio,
    Items(usize),
    Table(usize),
}

impl Vm {
    /// Returns the number of facts.
    pub fn fact_count(&self) -> usize {
        self.database.fact_count()
    }

    /// Returns the facts of the run and the variables of `defdurable`, while no task runs.
    pub fn kept_data(&self) -> KeptData {
        let mut kept = KeptData::default();
        let cell = |name: Value| self.heap.symbol(name).map(|cell| (name, cell.value));
        let defined = self.listed_in("*%DURABLE-VARIABLES*").into_iter().filter_map(cell);
        let waiting = self.listed_in(WAITING_VARIABLES);
        let waiting = waiting.into_iter().filter_map(|entry| self.heap.as_cons(entry));
        for (name, value) in defined.chain(waiting.map(|entry| (entry.car, entry.cdr))) {
            let Some(name) = self.names.name_of(&self.heap, name) else { continue };
            match self.plain_value(value) {
                Ok(value) => kept.variables.push((name, value)),
                Err(NotPlain(part)) => kept.left_out.push(format!("variable {name}: it has {part}")),
            }
        }
        kept.variables.reverse();
        let mut without: BTreeMap<String, (usize, String)> = BTreeMap::new();
        self.database.each_fact(&mut |functor, arguments| {
            let mut parts = vec![functor];
            parts.extend_from_slice(arguments);
            let fact: Result<Vec<Datum>, NotPlain> =
                parts.iter().map(|&part| self.plain_term(part)).collect();
            match fact {
                Ok(fact) => kept.facts.push(Datum::list(fact, Span::default())),
                Err(NotPlain(part)) => {
                    let name = self.plain_term(functor).map_or("?".into(), |name| name.to_string());
                    without.entry(name).or_insert((0, part)).0 += 1;
                }
            }
        });
        let waiting = self.listed_in(WAITING_FACTS);
        kept.facts.extend(waiting.into_iter().filter_map(|fact| self.plain_value(fact).ok()));
        for (name, (count, part)) in without {
            let noun = if count == 1 { "fact" } else { "facts" };
            kept.left_out.push(format!("{count} {noun} {name}: with {part}"));
        }
        kept
    }

    /// Returns the items of the list that is the value of a variable of the library.
    fn listed_in(&self, variable: &str) -> Vec<Value> {
        let symbol = self.names.find(&Symbol::esl(variable));
        let mut rest =
            symbol.and_then(|symbol| self.heap.symbol(symbol)).map_or(Value::NIL, |cell| cell.value);
        let mut items = Vec::new();
        while let Some(pair) = self.heap.as_cons(rest) {
            items.push(pair.car);
            rest = pair.cdr;
        }
        items
    }

    /// Returns a value as plain data, or in words what keeps it from that.
    fn plain_value(&self, value: Value) -> Result<Datum, NotPlain> {
        if value == Value::UNBOUND {
            return Err(NotPlain::of("no value"));
        }
        let datum = datum::export_structures(&self.heap, &self.names, value, describe)
            .map_err(|_| NotPlain::of("too many parts, or itself as a part"))?;
        plain(&datum)
    }

    /// Returns a term of the database as plain data, or in words what keeps it from that.
    fn plain_term(&self, term: Term) -> Result<Datum, NotPlain> {
        let span = Span::default();
        let mut steps = vec![DatumStep::Visit(term)];
        let mut made: Vec<Datum> = Vec::new();
        while let Some(step) = steps.pop() {
            let datum = match step {
                DatumStep::Visit(term) => match self.database.contents(term) {
                    TermContents::Word(value) => self.plain_value(value)?,
                    TermContents::Text(codes) => {
                        let text: Option<String> = codes.iter().map(|&code| char::from_u32(code)).collect();
                        Datum::string(
                            &text.ok_or_else(|| NotPlain::of("a string with characters that no text has"))?,
                            span,
                        )
                    }
                    TermContents::Big(is_negative, limbs) => {
                        let bytes: Vec<u8> = limbs.iter().flat_map(|limb| limb.to_le_bytes()).collect();
                        let sign = if is_negative { Sign::Minus } else { Sign::Plus };
                        Datum::integer(BigInt::from_bytes_le(sign, &bytes), span)
                    }
                    TermContents::Float(number) if number.is_finite() => {
                        Datum::new(DatumKind::Float(number), span)
                    }
                    TermContents::Float(number) => return Err(NotPlain(format!("the float {number}"))),
                    TermContents::Pair(car, cdr) => {
                        steps.extend([DatumStep::Pair, DatumStep::Visit(cdr), DatumStep::Visit(car)]);
                        continue;
                    }
                    TermContents::Ratio(numerator, denominator) => {
                        let parts = [DatumStep::Visit(denominator), DatumStep::Visit(numerator)];
                        steps.push(DatumStep::Ratio);
                        steps.extend(parts);
                        continue;
                    }
                    TermContents::Object(object) => self.plain_value(object)?,
                    TermContents::Other => return Err(NotPlain::of("an object")),
                },
                step => join(&step, &mut made).ok_or_else(|| NotPlain::of("an object"))?,
            };
            made.push(datum);
        }
        made.pop().ok_or_else(|| NotPlain::of("an object"))
    }
}

/// Makes a compound datum of the latest parts.
fn join<T>(step: &DatumStep<T>, made: &mut Vec<Datum>) -> Option<Datum> {
    let span = Span::default();
    Some(match step {
        DatumStep::Visit(_) => return None,
        DatumStep::Pair => {
            let (cdr, car) = (made.pop()?, made.pop()?);
            Datum::cons(car, cdr, span)
        }
        DatumStep::Ratio => {
            let (denominator, numerator) = (made.pop()?, made.pop()?);
            let (DatumKind::Integer(numerator), DatumKind::Integer(denominator)) =
                (numerator.kind(), denominator.kind())
            else {
                return None;
            };
            Datum::new(DatumKind::Ratio(numerator.to_big(), denominator.to_big()), span)
        }
        DatumStep::Items(count) => {
            let items = made.split_off(made.len().checked_sub(*count)?);
            Datum::new(DatumKind::Vector(items.into()), span)
        }
        DatumStep::Table(count) => {
            let entries = made.split_off(made.len().checked_sub(*count)?);
            let entries = Datum::list(entries, span);
            Datum::cons(Datum::symbol(Symbol::esl(TABLE), span), entries, span)
        }
    })
}

/// Returns a datum as one that a text denotes, or in words what keeps it from that. Parts that are shared are
/// copied.
fn plain(datum: &Datum) -> Result<Datum, NotPlain> {
    let span = Span::default();
    let mut steps = vec![DatumStep::Visit(datum)];
    let mut made: Vec<Datum> = Vec::new();
    let mut left = PARTS;
    while let Some(step) = steps.pop() {
        let DatumStep::Visit(datum) = step else {
            let whole = join(&step, &mut made).ok_or_else(|| NotPlain::of("an object"))?;
            made.push(whole);
            continue;
        };
        left = left.checked_sub(1).ok_or_else(|| NotPlain::of("too many parts"))?;
        match datum.kind() {
            DatumKind::Cons(car, cdr) => {
                steps.extend([DatumStep::Pair, DatumStep::Visit(cdr), DatumStep::Visit(car)]);
            }
            DatumKind::Vector(items) => {
                steps.push(DatumStep::Items(items.len()));
                steps.extend(items.iter().rev().map(DatumStep::Visit));
            }
            DatumKind::Table(entries) => {
                steps.push(DatumStep::Table(entries.len()));
                steps.extend(entries.iter().rev().map(DatumStep::Visit));
            }
            DatumKind::Packed(PackedVector::Floats(floats))
                if floats.iter().all(|float| float.is_finite()) =>
            {
                let items = floats.iter().map(|&float| Datum::new(DatumKind::Float(float), span));
                made.push(Datum::new(DatumKind::Vector(items.collect()), span));
            }
            DatumKind::Float(number) if !number.is_finite() => {
                return Err(NotPlain(format!("the float {number}")));
            }
            DatumKind::Symbol(symbol) if symbol.package().is_none() => {
                return Err(NotPlain(format!("the symbol {symbol}, which is in no package")));
            }
            DatumKind::Nil
            | DatumKind::Symbol(_)
            | DatumKind::Integer(_)
            | DatumKind::Ratio(..)
            | DatumKind::Float(_)
            | DatumKind::Character(_)
            | DatumKind::String(_) => made.push(datum.clone()),
            DatumKind::Array(..) => return Err(NotPlain::of("an array of more than one dimension")),
            DatumKind::Packed(_) => return Err(NotPlain::of("a vector of bits, bytes or such floats")),
            DatumKind::Object(_) | DatumKind::Call(_) => return Err(NotPlain::of("an object")),
            DatumKind::Opaque(opaque) => return Err(NotPlain(format!("{opaque}"))),
        }
    }
    made.pop().ok_or_else(|| NotPlain::of("an object"))
}
