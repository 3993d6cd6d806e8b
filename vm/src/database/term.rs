//! Terms: the contents of facts. A term is one word; two terms are equal exactly when their objects are
//! `equal`.
//!
//! Numbers, characters and symbols are the same words as their values. Pairs, strings and numbers too large
//! for a word are stored once, outside of the heap, with a count of their holders; they are copies, so that a
//! program cannot change a fact by changing an object. Any other object stands for itself. So a database of
//! numbers, strings and named symbols, however large, gives the collector nothing to do; all other objects in
//! facts are in one hash table of the heap, which the collector marks as any other.
//!
//! A function that makes a term returns it held; the caller keeps it until [`Terms::release`].

use super::bucket::{Buckets, finish, mix};
use crate::describe::describe;
use crate::equality::{self, KeyTest};
use crate::heap::{AllocError, Heap};
use crate::table::{KeyComparison, Table};
use crate::value::Value;

/// Greatest number of pairs in a term.
pub(crate) const MAX_SIZE: u32 = 1 << 16;

/// A term, or in patterns a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Term(pub(super) Value);

impl Term {
    /// Marker of a missing term.
    pub(super) const UNBOUND: Term = Term(Value::UNBOUND);
    /// The empty list.
    pub(super) const NIL: Term = Term(Value::NIL);

    /// Returns the variable with this number.
    #[inline]
    pub(super) const fn variable(number: u32) -> Term {
        Term(Value::variable(number))
    }

    /// Returns the variable's number; `None` for a term.
    #[inline]
    pub(super) fn as_variable(self) -> Option<usize> {
        self.0.as_variable().map(|number| number as usize)
    }

    /// Returns the object that the term is the same word as.
    pub(super) fn as_atom(self) -> Option<Value> {
        self.0.as_term().is_none().then_some(self.0)
    }

    #[inline]
    pub(super) fn is_unbound(self) -> bool {
        self == Term::UNBOUND
    }

    /// Returns a word that identifies the term.
    #[inline]
    pub(super) fn bits(self) -> u64 {
        self.0.bits()
    }
}

/// The contents of a term of more than a word.
#[derive(Clone, Debug, PartialEq)]
enum TermData {
    Free,
    /// A pair: its halves, the number of pairs in it, and whether it is free of variables.
    Pair {
        car: Term,
        cdr: Term,
        size: u32,
        is_ground: bool,
    },
    Text(Box<[u32]>),
    Big(bool, Box<[u64]>),
    Ratio(Term, Term),
    Float(u64),
    /// Any other object.
    Object(Value),
}

#[derive(Clone, Debug)]
struct TermNode {
    data: TermData,
    holders: u32,
}

/// All terms of more than a word.
#[derive(Clone, Debug)]
pub(crate) struct Terms {
    nodes: Vec<TermNode>,
    buckets: Buckets,
    free: Vec<u32>,
    /// Nodes that had no holder at some time; [`Terms::sweep`] frees those that have none.
    unheld: Vec<u32>,
    /// Hash table in the heap of the objects in terms; `NIL` before the first.
    objects: Value,
    /// Bytes in use, approximately.
    pub(super) bytes: usize,
}

/// Bytes of a node without its contents.
const NODE_BYTES: usize = size_of::<TermNode>() + 16;

/// Why a term was not made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TermError {
    /// There is no room for the table of objects.
    Room(AllocError),
    /// The term would have more than [`MAX_SIZE`] pairs.
    TooLarge,
}

impl From<AllocError> for TermError {
    fn from(error: AllocError) -> TermError {
        TermError::Room(error)
    }
}

impl Default for Terms {
    fn default() -> Terms {
        Terms {
            nodes: Vec::new(),
            buckets: Buckets::default(),
            free: Vec::new(),
            unheld: Vec::new(),
            objects: Value::NIL,
            bytes: 0,
        }
    }
}

impl Terms {
    fn intern(&mut self, hash: u32, data: TermData) -> Term {
        if let Some(found) = self.buckets.find(hash, |other| self.nodes[other as usize].data == data) {
            self.nodes[found as usize].holders += 1;
            // A stored term holds its parts once, however often it is made.
            if let TermData::Pair { car, cdr, .. } | TermData::Ratio(car, cdr) = data {
                self.release(car);
                self.release(cdr);
            }
            return Term(Value::term(found));
        }
        self.bytes += NODE_BYTES + data.bytes();
        let node = TermNode { data, holders: 1 };
        let index = match self.free.pop() {
            Some(index) => {
                self.nodes[index as usize] = node;
                index
            }
            None => {
                self.nodes.push(node);
                (self.nodes.len() - 1) as u32
            }
        };
        self.buckets.add(index, hash);
        Term(Value::term(index))
    }

    /// Calls `visit` with words and objects that identify a term in another run, too.
    pub(super) fn visit_state(&self, term: Term, visit: &mut dyn FnMut(Result<u64, Value>)) {
        let mut open = vec![term];
        while let Some(term) = open.pop() {
            let Some(index) = term.0.as_term() else {
                visit(Err(term.0));
                continue;
            };
            match &self.nodes[index as usize].data {
                TermData::Pair { car, cdr, .. } => {
                    visit(Ok(1));
                    open.extend([*cdr, *car]);
                }
                TermData::Ratio(numerator, denominator) => {
                    visit(Ok(2));
                    open.extend([*denominator, *numerator]);
                }
                TermData::Text(characters) => {
                    visit(Ok(3 + 8 * characters.len() as u64));
                    characters.iter().for_each(|&c| visit(Ok(u64::from(c))));
                }
                TermData::Big(negative, limbs) => {
                    visit(Ok(4 + u64::from(*negative) + 8 * limbs.len() as u64));
                    limbs.iter().for_each(|&limb| visit(Ok(limb)));
                }
                TermData::Float(bits) => [6, *bits].into_iter().for_each(|word| visit(Ok(word))),
                TermData::Object(v) => visit(Err(*v)),
                TermData::Free => visit(Ok(7)),
            }
        }
    }

    /// Writes a term as a text, of which no more is written once it has so many characters.
    pub(super) fn write(&self, heap: &Heap, term: Term, most: usize, text: &mut String) {
        enum TermPiece {
            Term(Term),
            Rest(Term),
            Word(&'static str),
        }
        let mut open = vec![TermPiece::Term(term)];
        while let Some(piece) = open.pop() {
            if text.len() > most {
                text.push('…');
                return;
            }
            let term = match piece {
                TermPiece::Word(word) => {
                    text.push_str(word);
                    continue;
                }
                TermPiece::Rest(rest) if rest == Term::NIL => {
                    text.push(')');
                    continue;
                }
                TermPiece::Rest(rest) => match self.as_pair(rest) {
                    Some((car, cdr)) => {
                        text.push(' ');
                        open.extend([TermPiece::Rest(cdr), TermPiece::Term(car)]);
                        continue;
                    }
                    None => {
                        text.push_str(" . ");
                        open.push(TermPiece::Word(")"));
                        rest
                    }
                },
                TermPiece::Term(term) => term,
            };
            let Some(index) = term.0.as_term() else {
                text.push_str(&describe(heap, term.0));
                continue;
            };
            match &self.nodes[index as usize].data {
                TermData::Pair { car, cdr, .. } => {
                    text.push('(');
                    open.extend([TermPiece::Rest(*cdr), TermPiece::Term(*car)]);
                }
                TermData::Text(characters) => {
                    let shown = characters.iter().take(most);
                    let shown: String = shown
                        .map(|&code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER))
                        .collect();
                    text.push_str(&format!("{shown:?}"));
                }
                TermData::Float(bits) => text.push_str(&format!("{:?}", f64::from_bits(*bits))),
                TermData::Ratio(numerator, denominator) => {
                    open.extend([
                        TermPiece::Term(*denominator),
                        TermPiece::Word("/"),
                        TermPiece::Term(*numerator),
                    ]);
                }
                TermData::Big(..) => text.push_str("a large integer"),
                TermData::Object(v) => text.push_str(&describe(heap, *v)),
                TermData::Free => {}
            }
        }
    }

    /// Adds a holder to a term.
    pub(super) fn retain(&mut self, term: Term) {
        if let Some(index) = term.0.as_term() {
            self.nodes[index as usize].holders += 1;
        }
    }

    /// Removes a holder of a term.
    pub(super) fn release(&mut self, term: Term) {
        if let Some(index) = term.0.as_term() {
            let node = &mut self.nodes[index as usize];
            node.holders -= 1;
            if node.holders == 0 {
                self.unheld.push(index);
            }
        }
    }

    /// Returns the pair of two terms, whose holders become the pair's. Objects in them were counted when they
    /// became terms.
    ///
    /// # Errors
    /// [`TermError::TooLarge`]; the halves are released all the same.
    pub(super) fn pair(&mut self, car: Term, cdr: Term) -> Result<Term, TermError> {
        let size = 1 + self.size(car) + self.size(cdr);
        if size > MAX_SIZE {
            self.release(car);
            self.release(cdr);
            return Err(TermError::TooLarge);
        }
        let is_ground = self.is_ground(car) && self.is_ground(cdr);
        let hash = finish(mix(mix(2, car.bits()), cdr.bits()));
        Ok(self.intern(hash, TermData::Pair { car, cdr, size, is_ground }))
    }

    fn size(&self, term: Term) -> u32 {
        match term.0.as_term().map(|index| &self.nodes[index as usize].data) {
            Some(TermData::Pair { size, .. }) => *size,
            _ => 0,
        }
    }

    /// Returns the halves of a pair; `None` for any other term.
    #[inline]
    pub(super) fn as_pair(&self, term: Term) -> Option<(Term, Term)> {
        match self.nodes[term.0.as_term()? as usize].data {
            TermData::Pair { car, cdr, .. } => Some((car, cdr)),
            _ => None,
        }
    }

    /// Returns whether a term is free of variables.
    #[inline]
    pub(super) fn is_ground(&self, term: Term) -> bool {
        match term.0.as_term() {
            None => term.as_variable().is_none(),
            Some(index) => {
                !matches!(self.nodes[index as usize].data, TermData::Pair { is_ground: false, .. })
            }
        }
    }

    /// Returns the list of some terms, each of which gets another holder.
    pub(super) fn list(&mut self, items: &[Term], tail: Term) -> Result<Term, TermError> {
        let mut list = tail;
        self.retain(tail);
        for &item in items.iter().rev() {
            self.retain(item);
            list = self.pair(item, list)?;
        }
        Ok(list)
    }

    /// Frees up to `most` terms without holders.
    pub(super) fn sweep(&mut self, heap: &mut Heap, most: usize) {
        for _ in 0..most {
            let Some(index) = self.unheld.pop() else { return };
            let node = &mut self.nodes[index as usize];
            if node.holders > 0 || node.data == TermData::Free {
                continue;
            }
            let data = std::mem::replace(&mut node.data, TermData::Free);
            self.bytes -= NODE_BYTES + data.bytes();
            self.buckets.remove(index);
            self.free.push(index);
            match data {
                TermData::Pair { car, cdr, .. } | TermData::Ratio(car, cdr) => {
                    self.release(car);
                    self.release(cdr);
                }
                TermData::Object(v) => {
                    if let Some((table, hash, Some(entry))) = self.find_object(heap, v) {
                        table.delete(heap, entry, hash);
                    }
                }
                _ => {}
            }
        }
    }

    // ---- objects of the heap

    /// Returns whether an object is a symbol with a package, which is permanent.
    fn is_named(heap: &Heap, v: Value) -> bool {
        heap.symbol(v).is_some_and(|symbol| symbol.package.is_true())
    }

    fn find_object(&self, heap: &Heap, v: Value) -> Option<(Table, u32, Option<usize>)> {
        let table = Table::of(heap, self.objects)?;
        let hash = equality::hash(heap, KeyTest::Eq, v);
        // Comparison by identity needs no limit.
        let mut work = usize::MAX;
        let entry = table.find(heap, KeyTest::Eq, v, hash, &mut work).unwrap_or_default();
        Some((table, hash, entry.map(|(entry, _)| entry)))
    }

    fn object(&mut self, heap: &mut Heap, v: Value) -> Result<Term, AllocError> {
        let Some((table, hash, entry)) = self.find_object(heap, v) else { return Ok(Term::NIL) };
        if entry.is_none() {
            table.add(heap, hash, v, Value::T)?;
        }
        Ok(self.intern(hash, TermData::Object(v)))
    }

    /// Makes the table of objects if there is none yet; the caller keeps the returned object from being
    /// collected. Without the table, objects cannot become terms.
    pub(super) fn make_object_table(&mut self, heap: &mut Heap) -> Result<Option<Value>, AllocError> {
        if self.objects.is_true() {
            return Ok(None);
        }
        self.objects = Table::make(heap, KeyComparison::Native(KeyTest::Eq), 8, [Value::NIL; 2])?;
        Ok(Some(self.objects))
    }

    // ---- from values and to values

    /// Returns the term of an object other than a pair.
    pub(super) fn atom(&mut self, heap: &mut Heap, v: Value) -> Result<Term, AllocError> {
        if !v.is_address() {
            return Ok(Term(v));
        }
        if let Some(characters) = equality::characters_of(heap, v) {
            let hash =
                finish(characters.iter().fold(mix(3, characters.len() as u64), |h, &c| mix(h, c.into())));
            let data = TermData::Text(characters.into());
            return Ok(self.intern(hash, data));
        }
        if let Some(n) = heap.bignum(v) {
            let hash = finish(n.limbs.iter().fold(mix(4, n.negative.into()), |hash, &limb| mix(hash, limb)));
            let data = TermData::Big(n.negative, n.limbs.into());
            return Ok(self.intern(hash, data));
        }
        if let Some((numerator, denominator)) = heap.ratio(v) {
            let numerator = self.atom(heap, numerator)?;
            let denominator = self.atom(heap, denominator)?;
            let hash = finish(mix(mix(5, numerator.bits()), denominator.bits()));
            return Ok(self.intern(hash, TermData::Ratio(numerator, denominator)));
        }
        if let Some(x) = heap.as_double(v) {
            return Ok(self.intern(finish(mix(6, x.to_bits())), TermData::Float(x.to_bits())));
        }
        if Terms::is_named(heap, v) { Ok(Term(v)) } else { self.object(heap, v) }
    }

    /// Returns the object of a term. Adds the work done to `work`.
    ///
    /// # Errors
    /// As for every allocation.
    pub(super) fn value(&self, heap: &mut Heap, term: Term, work: &mut usize) -> Result<Value, AllocError> {
        match term.0.as_term() {
            None => Ok(term.0),
            Some(_) => self.compound_value(heap, term, work),
        }
    }

    fn compound_value(&self, heap: &mut Heap, term: Term, work: &mut usize) -> Result<Value, AllocError> {
        enum Open {
            Make(Term),
            Join,
        }
        let mut open = vec![Open::Make(term)];
        let mut made: Vec<Value> = Vec::new();
        while let Some(next) = open.pop() {
            *work += 1;
            match next {
                Open::Make(term) => match self.as_pair(term) {
                    Some((car, cdr)) => {
                        open.push(Open::Join);
                        open.push(Open::Make(cdr));
                        open.push(Open::Make(car));
                    }
                    None => made.push(self.atom_value(heap, term)?),
                },
                Open::Join => {
                    let (cdr, car) = (made.pop().unwrap_or(Value::NIL), made.pop().unwrap_or(Value::NIL));
                    made.push(heap.cons(car, cdr)?);
                }
            }
        }
        Ok(made.pop().unwrap_or(Value::NIL))
    }

    fn atom_value(&self, heap: &mut Heap, term: Term) -> Result<Value, AllocError> {
        let Some(index) = term.0.as_term() else { return Ok(term.0) };
        match &self.nodes[index as usize].data {
            TermData::Text(characters) => heap.alloc_string(characters),
            TermData::Big(negative, limbs) => heap.alloc_bignum(*negative, limbs),
            TermData::Ratio(numerator, denominator) => {
                let numerator = self.atom_value(heap, *numerator)?;
                let denominator = self.atom_value(heap, *denominator)?;
                heap.alloc_ratio(numerator, denominator)
            }
            TermData::Float(bits) => heap.float(f64::from_bits(*bits)),
            TermData::Object(v) => Ok(*v),
            TermData::Free | TermData::Pair { .. } => Ok(Value::NIL),
        }
    }

    // ---- patterns

    /// Returns a pattern with its variables replaced, if all of them have values. The caller does not hold
    /// the term; new pairs are appended to `made`, held.
    ///
    /// # Errors
    /// [`TermError::TooLarge`].
    pub(super) fn instantiate(
        &mut self,
        pattern: Term,
        bindings: &[Term],
        made: &mut Vec<Term>,
    ) -> Result<Option<Term>, TermError> {
        if let Some(variable) = pattern.as_variable() {
            let term = bindings[variable];
            return Ok(if term.is_unbound() { None } else { Some(term) });
        }
        if self.is_ground(pattern) {
            return Ok(Some(pattern));
        }
        self.rebuild(pattern, made, &mut |variable| {
            let term = bindings[variable];
            if term.is_unbound() { None } else { Some(term) }
        })
    }

    /// Returns a pattern with its variables replaced by `replace`; `None` if that returns `None` for one of
    /// them.
    pub(super) fn rebuild(
        &mut self,
        pattern: Term,
        made: &mut Vec<Term>,
        replace: &mut dyn FnMut(usize) -> Option<Term>,
    ) -> Result<Option<Term>, TermError> {
        enum Open {
            Make(Term),
            Join,
        }
        let mut open = vec![Open::Make(pattern)];
        let mut terms: Vec<Term> = Vec::new();
        while let Some(next) = open.pop() {
            match next {
                Open::Make(term) if self.is_ground(term) => terms.push(term),
                Open::Make(term) => match (term.as_variable(), self.as_pair(term)) {
                    (Some(variable), _) => match replace(variable) {
                        Some(term) => terms.push(term),
                        None => return Ok(None),
                    },
                    (None, Some((car, cdr))) => {
                        open.push(Open::Join);
                        open.push(Open::Make(cdr));
                        open.push(Open::Make(car));
                    }
                    (None, None) => terms.push(term),
                },
                Open::Join => {
                    let (cdr, car) = (terms.pop().unwrap_or(Term::NIL), terms.pop().unwrap_or(Term::NIL));
                    self.retain(car);
                    self.retain(cdr);
                    let pair = self.pair(car, cdr)?;
                    made.push(pair);
                    terms.push(pair);
                }
            }
        }
        Ok(terms.pop())
    }

    /// Matches a pattern with a ground term: binds variables in `bindings`, and appends them to `trail`.
    pub(super) fn matches(
        &self,
        pattern: Term,
        term: Term,
        bindings: &mut [Term],
        trail: &mut Vec<u32>,
    ) -> bool {
        if let Some(variable) = pattern.as_variable() {
            let bound = bindings[variable];
            if bound.is_unbound() {
                bindings[variable] = term;
                trail.push(variable as u32);
                return true;
            }
            return bound == term;
        }
        if self.is_ground(pattern) {
            return pattern == term;
        }
        let mut open = vec![(pattern, term)];
        while let Some((pattern, term)) = open.pop() {
            if let Some(variable) = pattern.as_variable() {
                let bound = bindings[variable];
                if bound.is_unbound() {
                    bindings[variable] = term;
                    trail.push(variable as u32);
                } else if bound != term {
                    return false;
                }
            } else if self.is_ground(pattern) {
                if pattern != term {
                    return false;
                }
            } else {
                let (Some(left), Some(right)) = (self.as_pair(pattern), self.as_pair(term)) else {
                    return false;
                };
                open.push((left.1, right.1));
                open.push((left.0, right.0));
            }
        }
        true
    }

    /// Calls `visit` with the number of each variable in a pattern, in textual order.
    pub(super) fn variables(&self, pattern: Term, visit: &mut dyn FnMut(usize)) {
        if let Some(variable) = pattern.as_variable() {
            return visit(variable);
        }
        if self.is_ground(pattern) {
            return;
        }
        let mut open = vec![pattern];
        while let Some(term) = open.pop() {
            if let Some(variable) = term.as_variable() {
                visit(variable);
            } else if !self.is_ground(term)
                && let Some((car, cdr)) = self.as_pair(term)
            {
                open.push(cdr);
                open.push(car);
            }
        }
    }

    /// Returns the number of stored terms.
    #[cfg(test)]
    pub(super) fn kept(&self) -> usize {
        self.nodes.len() - self.free.len()
    }
}

impl TermData {
    fn bytes(&self) -> usize {
        match self {
            TermData::Text(characters) => 4 * characters.len(),
            TermData::Big(_, limbs) => 8 * limbs.len(),
            _ => 0,
        }
    }
}
