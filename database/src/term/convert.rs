//! From values to terms and back, and what a term looks like.

use esl_heap::Value;
use esl_heap::equality::{self, KeyTest};
use esl_heap::heap::layout::StructureObject;
use esl_heap::heap::{AllocError, Heap, Kind};
use esl_heap::table::{KeyComparison, Table};

use super::super::bucket::{finish, mix};
use super::super::{Describe, TermContents};
use super::{Term, TermData, Terms};

impl Terms {
    /// Returns whether an object is a symbol with a package, which is permanent.
    #[inline]
    fn is_named(heap: &Heap, v: Value) -> bool {
        heap.symbol(v).is_some_and(|symbol| symbol.package.is_true())
    }

    pub(super) fn find_object(&self, heap: &Heap, v: Value) -> Option<(Table, u32, Option<usize>)> {
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
    pub(crate) fn make_object_table(&mut self, heap: &mut Heap) -> Result<Option<Value>, AllocError> {
        if self.objects.is_true() {
            return Ok(None);
        }
        self.objects = Table::make(heap, KeyComparison::Native(KeyTest::Eq), 8, [Value::NIL; 2])?;
        Ok(Some(self.objects))
    }

    /// Returns the term of a structure that `equal` compares by its slots, of which `slots` is a list; their
    /// holder becomes the structure's.
    ///
    /// # Errors
    /// As for every allocation; the slots are released all the same.
    pub(crate) fn record(&mut self, heap: &mut Heap, class: Value, slots: Term) -> Result<Term, AllocError> {
        let class = match self.object(heap, class) {
            Ok(class) => class,
            Err(error) => {
                self.release(slots);
                return Err(error);
            }
        };
        let hash = finish(mix(mix(9, class.bits()), slots.bits()));
        Ok(self.intern(hash, TermData::Record(class, slots)))
    }

    /// Returns the term of an object other than a pair, and other than a structure that `equal` compares by
    /// its slots.
    pub(crate) fn atom(&mut self, heap: &mut Heap, v: Value) -> Result<Term, AllocError> {
        if !v.is_address() {
            return Ok(Term(v));
        }
        if Terms::is_named(heap, v) {
            return Ok(Term(v));
        }
        if let Some(characters) = equality::characters_of(heap, v) {
            let hash =
                finish(characters.iter().fold(mix(3, characters.len() as u64), |h, &c| mix(h, c.into())));
            let data = TermData::Text(characters.into());
            return Ok(self.intern(hash, data));
        }
        if let Some(bits) = equality::bits_of(heap, v) {
            let hash = finish(bits.iter().fold(mix(7, bits.len() as u64), |h, &bit| mix(h, bit.into())));
            let data = TermData::Bits(bits.into());
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
        if let Some((real, imaginary)) = heap.complex(v) {
            let real = self.atom(heap, real)?;
            let imaginary = self.atom(heap, imaginary)?;
            let hash = finish(mix(mix(8, real.bits()), imaginary.bits()));
            return Ok(self.intern(hash, TermData::Complex(real, imaginary)));
        }
        if let Some(x) = heap.as_double(v) {
            return Ok(self.intern(finish(mix(6, x.to_bits())), TermData::Float(x.to_bits())));
        }
        self.object(heap, v)
    }

    /// Returns the object of a term. Adds the work done to `work`.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn value(&self, heap: &mut Heap, term: Term, work: &mut usize) -> Result<Value, AllocError> {
        match term.0.as_term() {
            None => Ok(term.0),
            Some(_) => self.compound_value(heap, term, work),
        }
    }

    fn compound_value(&self, heap: &mut Heap, term: Term, work: &mut usize) -> Result<Value, AllocError> {
        enum Open {
            Make(Term),
            Join,
            /// Make a structure of this class.
            Record(Value),
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
                    None => match self.as_record(term) {
                        Some((class, slots)) => {
                            open.push(Open::Record(self.atom_value(heap, class)?));
                            open.push(Open::Make(slots));
                        }
                        None => {
                            if let Some(index) = term.0.as_term() {
                                *work += self.nodes[index as usize].data.work();
                            }
                            made.push(self.atom_value(heap, term)?);
                        }
                    },
                },
                Open::Join => {
                    let (cdr, car) = (made.pop().unwrap_or(Value::NIL), made.pop().unwrap_or(Value::NIL));
                    made.push(heap.cons(car, cdr)?);
                }
                Open::Record(class) => {
                    let mut slots = Vec::new();
                    let mut rest = made.pop().unwrap_or(Value::NIL);
                    while let Some(pair) = heap.as_cons(rest) {
                        slots.push(pair.car);
                        rest = pair.cdr;
                    }
                    let record = heap.alloc_structure(class, &slots)?;
                    heap.set_flags(record, Kind::Structure, StructureObject::VALUE);
                    made.push(record);
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
            TermData::Complex(real, imaginary) => {
                let real = self.atom_value(heap, *real)?;
                let imaginary = self.atom_value(heap, *imaginary)?;
                heap.alloc_complex(real, imaginary)
            }
            TermData::Bits(bits) => heap.alloc_bits(bits),
            TermData::Float(bits) => heap.float(f64::from_bits(*bits)),
            TermData::Object(v) => Ok(*v),
            TermData::Free | TermData::Pair { .. } | TermData::Record(..) => Ok(Value::NIL),
        }
    }

    /// Returns the contents of a term, as far as data stand for them.
    pub(crate) fn contents(&self, term: Term) -> TermContents<'_> {
        let Some(index) = term.0.as_term() else { return TermContents::Word(term.0) };
        match &self.nodes[index as usize].data {
            TermData::Pair { car, cdr, .. } => TermContents::Pair(*car, *cdr),
            TermData::Text(characters) => TermContents::Text(characters),
            TermData::Big(negative, limbs) => TermContents::Big(*negative, limbs),
            TermData::Ratio(numerator, denominator) => TermContents::Ratio(*numerator, *denominator),
            TermData::Float(bits) => TermContents::Float(f64::from_bits(*bits)),
            TermData::Object(object) => TermContents::Object(*object),
            TermData::Free | TermData::Bits(_) | TermData::Complex(..) | TermData::Record(..) => {
                TermContents::Other
            }
        }
    }

    /// Writes a term as a text, of which no more is written once it has so many characters. `describe` writes
    /// the objects in it.
    pub(crate) fn write(&self, heap: &Heap, describe: Describe, term: Term, most: usize, text: &mut String) {
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
                TermData::Bits(bits) => {
                    text.push_str("#*");
                    text.extend(bits.iter().take(most).map(|&bit| if bit == 0 { '0' } else { '1' }));
                }
                TermData::Complex(real, imaginary) => {
                    text.push_str("#C(");
                    open.extend([
                        TermPiece::Word(")"),
                        TermPiece::Term(*imaginary),
                        TermPiece::Word(" "),
                        TermPiece::Term(*real),
                    ]);
                }
                TermData::Record(class, slots) => {
                    text.push_str("#<");
                    open.extend([
                        TermPiece::Word(">"),
                        TermPiece::Term(*slots),
                        TermPiece::Word(" "),
                        TermPiece::Term(*class),
                    ]);
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
}
