//! Queries and facts as written by a program, as terms.
//!
//! ```text
//! formula   (and formula*)  (or formula*)  (not formula)  (test function variable*)  pattern
//! pattern   (term term* [. variable])
//! ```
//!
//! The library has replaced the form of a test by a function. The words are recognized by name in any
//! package, since programs use names such as `test` themselves. A variable is a symbol whose name begins with
//! `?`; each `?` alone is a different variable.

use esl_heap::{stored, stored_enum};
use std::collections::{BTreeMap, BTreeSet};

use esl_heap::Value;
use esl_heap::heap::{AllocError, Heap};
use smallvec::SmallVec;

use super::term::{MAX_SIZE, Term, TermError, Terms};

/// Greatest depth of formulas within formulas.
const MOST_NESTED: usize = 100;
/// Greatest number of atoms and pairs in a query.
const MOST_PARTS: usize = 1 << 13;

/// Why a query or a fact was refused.
#[derive(Clone, Debug, PartialEq)]
pub enum FormulaError {
    /// There is no room.
    Room(AllocError),
    /// The fact has variables.
    Variable(Value),
    /// The value is not what was expected; the text names what was.
    Malformed(Value, &'static str),
}

impl From<AllocError> for FormulaError {
    fn from(error: AllocError) -> FormulaError {
        FormulaError::Room(error)
    }
}

/// A pattern of facts.
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    /// Position among the generators of its query, in the order of the text.
    pub(super) rank: usize,
    pub(super) functor: Term,
    pub(super) arguments: SmallVec<[Term; 6]>,
    /// Pattern for the list of all further arguments; `NIL` for none.
    pub(super) tail: Term,
    /// Position of the first argument that is a variable and stands before, too; else the number of
    /// arguments.
    pub(super) first_repeated: usize,
}

impl Pattern {
    /// Returns the bytes that the pattern takes outside of itself.
    pub(super) fn bytes_beside(&self) -> usize {
        if self.arguments.spilled() { self.arguments.capacity() * size_of::<Term>() } else { 0 }
    }

    pub(super) fn new(rank: usize, functor: Term, arguments: SmallVec<[Term; 6]>, tail: Term) -> Pattern {
        let mut seen = BTreeSet::new();
        let is_repeated = |argument: &Term| argument.as_variable().is_some_and(|one| !seen.insert(one));
        let first_repeated = arguments.iter().position(is_repeated).unwrap_or(arguments.len());
        Pattern { rank, functor, arguments, tail, first_repeated }
    }
}

/// A condition computed by the program.
#[derive(Clone, Debug)]
pub(super) struct TestForm {
    pub(super) function: Term,
    /// Numbers of the variables that the condition uses.
    pub(super) variables: Vec<u32>,
}

/// The question of a query, or the body of a rule.
#[derive(Clone, Debug)]
pub(super) enum Formula {
    Pattern(Pattern),
    And(Vec<Formula>),
    /// Alternatives, the rank of the disjunction, and the rank after those in it.
    Or(Vec<Formula>, usize, usize),
    Not(Box<Formula>),
    Test(TestForm),
}

impl Formula {
    /// Returns the bytes that the formula takes outside of itself, approximately.
    pub(super) fn bytes_beside(&self) -> usize {
        let inside = |formula: &Formula| size_of::<Formula>() + formula.bytes_beside();
        match self {
            Formula::Pattern(pattern) => pattern.bytes_beside(),
            Formula::And(parts) | Formula::Or(parts, ..) => parts.iter().map(inside).sum(),
            Formula::Not(part) => inside(part),
            Formula::Test(_) => 0,
        }
    }
}

/// Returns `None` unless `v` is a logical variable, else whether it has no name.
#[inline]
fn variable_name(heap: &Heap, v: Value) -> Option<bool> {
    let name = heap.string(heap.symbol(v)?.name)?;
    if name.first() == Some(&u32::from(b'?')) { Some(name.len() == 1) } else { None }
}

/// Returns the term of a symbol, held, if the symbol is a variable.
type OfSymbol<'a> = dyn FnMut(&mut Terms, &mut Heap, Value) -> Result<Option<Term>, FormulaError> + 'a;

/// Returns whether the term of an object is made of those of its parts.
fn is_compound(heap: &Heap, v: Value) -> bool {
    v.is_cons() || heap.value_slots(v).is_some()
}

/// Returns the term of an object, held; `symbol` supplies the terms of variables.
fn convert(
    terms: &mut Terms,
    heap: &mut Heap,
    v: Value,
    parts: &mut usize,
    symbol: &mut OfSymbol<'_>,
) -> Result<Term, FormulaError> {
    enum Open {
        Make(Value),
        Join,
        /// Make a slot, in which no symbol is a variable.
        MakeSlot(Value),
        /// Make a structure of this class of the list of its slots.
        Record(Value),
    }
    let mut atom = |terms: &mut Terms, heap: &mut Heap, v: Value| match symbol(terms, heap, v)? {
        Some(term) => Ok(term),
        None => terms.atom(heap, v).map_err(FormulaError::Room),
    };
    if !is_compound(heap, v) {
        return atom(terms, heap, v);
    }
    let mut made: Vec<Term> = Vec::new();
    let mut open = vec![Open::Make(v)];
    let mut walk = || -> Result<(), FormulaError> {
        while let Some(next) = open.pop() {
            match next {
                Open::Make(part) | Open::MakeSlot(part) => {
                    let is_slot = matches!(next, Open::MakeSlot(_));
                    let make = if is_slot { Open::MakeSlot } else { Open::Make };
                    let spend = |parts: &mut usize, count| {
                        let left = parts.checked_sub(count).ok_or(FormulaError::Malformed(v, TOO_LARGE))?;
                        *parts = left;
                        Ok::<_, FormulaError>(())
                    };
                    if let Some(pair) = heap.as_cons(part) {
                        spend(parts, 1)?;
                        open.push(Open::Join);
                        open.push(make(pair.cdr));
                        open.push(make(pair.car));
                    } else if let (Some(class), Some(slots)) =
                        (heap.structure_class(part), heap.value_slots(part))
                    {
                        spend(parts, slots.len() + 1)?;
                        open.push(Open::Record(class));
                        open.extend(slots.iter().map(|_| Open::Join));
                        open.push(Open::MakeSlot(Value::NIL));
                        open.extend(slots.iter().rev().map(|&slot| Open::MakeSlot(slot)));
                    } else if is_slot {
                        made.push(terms.atom(heap, part)?);
                    } else {
                        made.push(atom(terms, heap, part)?);
                    }
                }
                Open::Record(class) => {
                    let slots = made.pop().unwrap_or(Term::NIL);
                    made.push(terms.record(heap, class, slots)?);
                }
                Open::Join => {
                    let (cdr, car) = (made.pop().unwrap_or(Term::NIL), made.pop().unwrap_or(Term::NIL));
                    made.push(terms.pair(car, cdr).map_err(|error| formula_error(error, v))?);
                }
            }
        }
        Ok(())
    };
    match walk() {
        Ok(()) => Ok(made.pop().unwrap_or(Term::NIL)),
        Err(error) => {
            for term in made {
                terms.release(term);
            }
            Err(error)
        }
    }
}

const TOO_LARGE: &str = "a smaller term";

fn formula_error(error: TermError, v: Value) -> FormulaError {
    match error {
        TermError::Room(error) => FormulaError::Room(error),
        TermError::TooLarge => FormulaError::Malformed(v, TOO_LARGE),
    }
}

/// Appends the terms of a fact to `cells`, each held: its functor and its arguments. Adds the work done to
/// `work`.
pub(super) fn fact(
    terms: &mut Terms,
    heap: &mut Heap,
    v: Value,
    cells: &mut Vec<Term>,
    work: &mut usize,
) -> Result<(), FormulaError> {
    let mut parts = MAX_SIZE as usize;
    let mut rest = v;
    let mut walk = || -> Result<(), FormulaError> {
        if !v.is_cons() {
            return Err(FormulaError::Malformed(v, "a fact, which is a list"));
        }
        while let Some(pair) = heap.as_cons(rest) {
            parts = parts.checked_sub(1).ok_or(FormulaError::Malformed(v, "a smaller fact"))?;
            rest = pair.cdr;
            if !pair.car.is_address() {
                cells.push(Term(pair.car));
                continue;
            }
            let term =
                convert(terms, heap, pair.car, &mut parts, &mut |_, heap, part| match part.is_address()
                    && variable_name(heap, part).is_some()
                {
                    true => Err(FormulaError::Variable(v)),
                    false => Ok(None),
                })?;
            cells.push(term);
        }
        match rest {
            Value::NIL => Ok(()),
            rest if variable_name(heap, rest).is_some() => Err(FormulaError::Variable(v)),
            _ => Err(FormulaError::Malformed(v, "a fact, which is a proper list")),
        }
    };
    let outcome = walk();
    *work += MAX_SIZE as usize - parts;
    if outcome.is_err() {
        for term in cells.drain(..) {
            terms.release(term);
        }
    }
    outcome
}

/// A parser of formulas from objects of the program.
pub(super) struct FormulaParser<'a> {
    pub(super) terms: &'a mut Terms,
    pub(super) heap: &'a mut Heap,
    /// Terms held by the formulas.
    pub(super) held: Vec<Term>,
    /// Names of the variables, by number; unbound for those without a name.
    pub(super) names: Vec<Term>,
    /// Number of patterns and alternatives.
    pub(super) ranks: usize,
    /// Terms of variables that have a value from outside.
    inherited: BTreeMap<u64, Term>,
    numbers: BTreeMap<u64, u32>,
    parts: usize,
    /// Number of atoms and pairs of the values from outside.
    inherited_parts: usize,
    query: Value,
}

impl<'a> FormulaParser<'a> {
    pub(super) fn new(terms: &'a mut Terms, heap: &'a mut Heap, query: Value) -> FormulaParser<'a> {
        FormulaParser {
            terms,
            heap,
            held: Vec::with_capacity(8),
            names: Vec::new(),
            ranks: 0,
            inherited: BTreeMap::new(),
            numbers: BTreeMap::new(),
            parts: MOST_PARTS,
            inherited_parts: 0,
            query,
        }
    }

    /// Binds variables to the values of an association list; the first one counts.
    pub(super) fn inherit(&mut self, bindings: Value) -> Result<(), FormulaError> {
        let mut rest = bindings;
        let mut parts = MAX_SIZE as usize;
        while let Some(pair) = self.heap.as_cons(rest) {
            parts = parts.checked_sub(1).ok_or(FormulaError::Malformed(bindings, "fewer bindings"))?;
            rest = pair.cdr;
            let Some(binding) = self.heap.as_cons(pair.car) else { continue };
            if self.inherited.contains_key(&binding.car.bits()) {
                continue;
            }
            let term = convert(self.terms, self.heap, binding.cdr, &mut parts, &mut |_, _, _| Ok(None))?;
            self.inherited_parts = MAX_SIZE as usize - parts;
            self.held.push(term);
            self.inherited.insert(binding.car.bits(), term);
        }
        Ok(())
    }

    /// Returns the number of atoms and pairs parsed so far.
    pub(super) fn work(&self) -> usize {
        MOST_PARTS - self.parts + self.inherited_parts
    }

    fn malformed<T>(&self, v: Value, expected: &'static str) -> Result<T, FormulaError> {
        Err(FormulaError::Malformed(v, expected))
    }

    fn spend(&mut self) -> Result<(), FormulaError> {
        self.parts =
            self.parts.checked_sub(1).ok_or(FormulaError::Malformed(self.query, "a smaller query"))?;
        Ok(())
    }

    fn variable(&mut self, v: Value, is_anonymous: bool) -> Result<Term, FormulaError> {
        if is_anonymous {
            self.names.push(Term::UNBOUND);
            return Ok(Term::variable(self.names.len() as u32 - 1));
        }
        if let Some(&term) = self.inherited.get(&v.bits()) {
            self.terms.retain(term);
            return Ok(term);
        }
        if let Some(&number) = self.numbers.get(&v.bits()) {
            return Ok(Term::variable(number));
        }
        let name = self.terms.atom(self.heap, v)?;
        self.held.push(name);
        let number = self.names.len() as u32;
        self.names.push(name);
        self.numbers.insert(v.bits(), number);
        Ok(Term::variable(number))
    }

    /// Returns the term of a part of a pattern; `held` holds it.
    fn term(&mut self, v: Value) -> Result<Term, FormulaError> {
        self.spend()?;
        let term = match is_compound(self.heap, v) {
            false => match variable_name(self.heap, v) {
                Some(is_anonymous) => self.variable(v, is_anonymous)?,
                None => self.terms.atom(self.heap, v)?,
            },
            true => self.compound(v)?,
        };
        self.held.push(term);
        Ok(term)
    }

    fn compound(&mut self, v: Value) -> Result<Term, FormulaError> {
        // Variables are found first, because the conversion borrows the terms exclusively.
        let mut open = vec![v];
        let mut known: BTreeMap<u64, Term> = BTreeMap::new();
        while let Some(part) = open.pop() {
            self.spend()?;
            if let Some(pair) = self.heap.as_cons(part) {
                open.push(pair.cdr);
                open.push(pair.car);
            } else if let Some(false) = variable_name(self.heap, part)
                && !known.contains_key(&part.bits())
            {
                let term = self.variable(part, false)?;
                known.insert(part.bits(), term);
            }
        }
        let FormulaParser { terms, heap, names, .. } = self;
        let mut parts = MOST_PARTS;
        let outcome =
            convert(terms, heap, v, &mut parts, &mut |terms, heap, part| match variable_name(heap, part) {
                Some(true) => {
                    names.push(Term::UNBOUND);
                    Ok(Some(Term::variable(names.len() as u32 - 1)))
                }
                Some(false) => Ok(known.get(&part.bits()).map(|&term| {
                    terms.retain(term);
                    term
                })),
                None => Ok(None),
            });
        for term in known.into_values() {
            terms.release(term);
        }
        outcome
    }

    /// Parses a pattern.
    pub(super) fn pattern(&mut self, v: Value) -> Result<Pattern, FormulaError> {
        let Some(pair) = self.heap.as_cons(v) else { return self.malformed(v, "a pattern, which is a list") };
        let rank = self.ranks;
        self.ranks += 1;
        let functor = self.term(pair.car)?;
        let mut arguments = SmallVec::new();
        let mut rest = pair.cdr;
        while let Some(pair) = self.heap.as_cons(rest) {
            arguments.push(self.term(pair.car)?);
            rest = pair.cdr;
        }
        let tail = self.term(rest)?;
        if tail != Term::NIL && tail.as_variable().is_none() {
            return self.malformed(v, "a pattern, which is a list with at most a variable after its dot");
        }
        Ok(Pattern::new(rank, functor, arguments, tail))
    }

    /// Returns the term of an object as it is, including its variables.
    pub(super) fn text(&mut self, v: Value) -> Result<Term, FormulaError> {
        let term = convert(self.terms, self.heap, v, &mut self.parts, &mut |_, _, _| Ok(None))?;
        self.held.push(term);
        Ok(term)
    }

    fn items(&mut self, v: Value) -> Result<Vec<Value>, FormulaError> {
        let mut items = Vec::new();
        let mut rest = v;
        while let Some(pair) = self.heap.as_cons(rest) {
            self.spend()?;
            items.push(pair.car);
            rest = pair.cdr;
        }
        if rest.is_true() { self.malformed(v, "a proper list") } else { Ok(items) }
    }

    fn word(&self, v: Value) -> Option<&'static str> {
        let name = self.heap.string(self.heap.symbol(v)?.name)?;
        let is = |word: &str| name.iter().copied().eq(word.bytes().map(u32::from));
        ["AND", "OR", "NOT", "TEST"].into_iter().find(|word| is(word))
    }

    /// Parses a formula.
    pub(super) fn formula(&mut self, v: Value, depth: usize) -> Result<Formula, FormulaError> {
        if depth > MOST_NESTED {
            return self.malformed(v, "fewer formulas within formulas");
        }
        let Some(pair) = self.heap.as_cons(v) else { return self.malformed(v, "a query, which is a list") };
        match self.word(pair.car) {
            Some("AND") => Ok(Formula::And(self.formulas(pair.cdr, depth)?)),
            Some("OR") => {
                let rank = self.ranks;
                self.ranks += 1;
                let alternatives = self.formulas(pair.cdr, depth)?;
                Ok(Formula::Or(alternatives, rank, self.ranks))
            }
            Some("NOT") => match self.formulas(pair.cdr, depth)?.pop() {
                Some(inside) if self.heap.cdr(pair.cdr) == Some(Value::NIL) => {
                    Ok(Formula::Not(Box::new(inside)))
                }
                _ => self.malformed(v, "(not query)"),
            },
            Some(_) => self.test(v, pair.cdr),
            None => Ok(Formula::Pattern(self.pattern(v)?)),
        }
    }

    fn formulas(&mut self, list: Value, depth: usize) -> Result<Vec<Formula>, FormulaError> {
        let items = self.items(list)?;
        items.into_iter().map(|item| self.formula(item, depth + 1)).collect()
    }

    fn test(&mut self, v: Value, parts: Value) -> Result<Formula, FormulaError> {
        let items = self.items(parts)?;
        let Some((&function, looks_at)) = items.split_first() else {
            return self.malformed(v, "(test form)");
        };
        let function = self.terms.atom(self.heap, function)?;
        self.held.push(function);
        let mut variables = Vec::new();
        for &item in looks_at {
            if variable_name(self.heap, item) != Some(false) {
                return self.malformed(v, "(test form)");
            }
            if let Some(number) = self.term(item)?.as_variable() {
                variables.push(number as u32);
            }
        }
        Ok(Formula::Test(TestForm { function, variables }))
    }
}

stored! { Pattern { rank, functor, arguments, tail, first_repeated } }
stored! { TestForm { function, variables } }
stored_enum! { Formula { Pattern(pattern) = 0, And(parts) = 1, Or(parts, first, last) = 2, Not(part) = 3, Test(form) = 4 } }
