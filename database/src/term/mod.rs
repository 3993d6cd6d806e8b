//! Terms: the contents of facts. A term is one word; two terms are equal exactly when their objects are
//! `equal`.
//!
//! Numbers, characters and symbols are the same words as their values. Pairs, strings, bit vectors, pathnames
//! and numbers too large for a word are stored once, outside of the heap, with a count of their holders; they
//! are copies, so that a program cannot change a fact by changing an object. Any other object stands for
//! itself. So a database of numbers, strings and named symbols, however large, gives the collector nothing to
//! do; all other objects in facts are in one hash table of the heap, which the collector marks as any other.
//!
//! A function that makes a term returns it held; the caller keeps it until [`Terms::release`].

mod convert;
mod pattern;

use esl_heap::Value;
use esl_heap::heap::{AllocError, Heap};
use esl_heap::{stored, stored_enum};

use super::bucket::{Buckets, finish, mix};

/// Greatest number of pairs in a term.
pub(crate) const MAX_SIZE: u32 = 1 << 16;

/// A term, or in patterns a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Term(pub(super) Value);

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
    Bits(Box<[u8]>),
    Big(bool, Box<[u64]>),
    Ratio(Term, Term),
    Complex(Term, Term),
    Float(u64),
    /// A structure that `equal` compares by its slots: its class, and the list of its slots. Patterns do not
    /// look into it.
    Record(Term, Term),
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
    /// Work done for the contents of terms since the last [`Terms::take_work`].
    work: usize,
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
            work: 0,
        }
    }
}

impl Terms {
    fn intern(&mut self, hash: u32, data: TermData) -> Term {
        if let Some(found) = self.buckets.find(hash, |other| self.nodes[other as usize].data == data) {
            self.nodes[found as usize].holders += 1;
            self.work += data.work();
            // A stored term holds its parts once, however often it is made.
            if let Some((left, right)) = data.parts() {
                self.release(left);
                self.release(right);
            }
            return Term(Value::term(found));
        }
        self.bytes += NODE_BYTES + data.bytes();
        self.work += data.work();
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

    /// Returns the work done for the contents of terms, such as the characters of strings, since the last
    /// call.
    pub(super) fn take_work(&mut self) -> usize {
        std::mem::take(&mut self.work)
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
                data @ (TermData::Pair { .. }
                | TermData::Ratio(..)
                | TermData::Complex(..)
                | TermData::Record(..)) => {
                    visit(Ok(match data {
                        TermData::Pair { .. } => 1,
                        TermData::Ratio(..) => 2,
                        TermData::Complex(..) => 8,
                        _ => 9,
                    }));
                    open.extend(data.parts().into_iter().flat_map(|(left, right)| [right, left]));
                }
                TermData::Bits(bits) => {
                    visit(Ok(5 + 8 * bits.len() as u64));
                    bits.iter().for_each(|&bit| visit(Ok(u64::from(bit))));
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
            Some(TermData::Record(_, slots)) => self.size(*slots),
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

    /// Returns the class and the list of the slots of a structure that is compared by them.
    fn as_record(&self, term: Term) -> Option<(Term, Term)> {
        match self.nodes[term.0.as_term()? as usize].data {
            TermData::Record(class, slots) => Some((class, slots)),
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
            if let Some((left, right)) = data.parts() {
                self.release(left);
                self.release(right);
            }
            if let TermData::Object(v) = data
                && let Some((table, hash, Some(entry))) = self.find_object(heap, v)
            {
                table.delete(heap, entry, hash);
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
    /// Returns the two terms that this holds.
    fn parts(&self) -> Option<(Term, Term)> {
        match *self {
            TermData::Pair { car: left, cdr: right, .. }
            | TermData::Ratio(left, right)
            | TermData::Complex(left, right)
            | TermData::Record(left, right) => Some((left, right)),
            _ => None,
        }
    }

    /// Returns the work of copying or comparing its contents.
    fn work(&self) -> usize {
        self.bytes() / 16
    }

    fn bytes(&self) -> usize {
        match self {
            TermData::Text(characters) => 4 * characters.len(),
            TermData::Bits(bits) => bits.len(),
            TermData::Big(_, limbs) => 8 * limbs.len(),
            _ => 0,
        }
    }
}

stored! { Term { 0 } }
stored_enum! { TermData {
    Free = 0, Pair { car, cdr, size, is_ground } = 1, Text(text) = 2, Bits(bits) = 3, Big(is_negative, limbs) = 4,
    Ratio(over, under) = 5, Complex(real, imaginary) = 6, Float(bits) = 7, Record(class, slots) = 8,
    Object(object) = 9,
} }
stored! { TermNode { data, holders } }
stored! { Terms { nodes, buckets, free, unheld, objects, bytes, work } }
