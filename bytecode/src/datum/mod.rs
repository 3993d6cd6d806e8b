//! Data as source text denotes it: what the reader makes, macros transform and modules keep as constants.
//!
//! A [`Datum`] is an immutable tree (or graph: sub-data may be shared) in which every node carries the
//! [`Span`] that it was read from. Sharing is identity: the same node reached twice denotes one object of the
//! running program.
//!
//! Guarantees: dropping a datum takes no native stack in proportion to its depth.
//! Not here: reading text (the compiler's `reader`), objects of a running program (the virtual machine).

mod display;
#[cfg(test)]
mod tests;

use std::any::Any;
use std::fmt;
use std::sync::Arc;

use bytes::Bytes;
use num_bigint::BigInt;

use crate::integer::Integer;
use crate::packed::PackedVector;
use crate::properties::{PropertyList, PropertyValue};
use crate::span::Span;
use crate::symbol::Symbol;

/// An object of the running program that occurs in a form given to `eval` or returned by a macro: an index
/// into a table that the compile-time host keeps for the length of one compilation. It cannot be written to a
/// file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId(pub u32);

/// Contents of a datum.
#[derive(Clone, Debug)]
pub enum DatumKind {
    /// `NIL`, the empty list. A datum is never the *symbol* `NIL`.
    Nil,
    /// A symbol other than `NIL`.
    Symbol(Symbol),
    /// An integer of any size.
    Integer(Integer),
    /// A ratio in lowest terms with a denominator above 1.
    Ratio(BigInt, BigInt),
    /// A double float.
    Float(f64),
    /// A character.
    Character(char),
    /// A literal string.
    String(Arc<str>),
    /// A pair.
    Cons(Datum, Datum),
    /// A simple vector.
    Vector(Arc<[Datum]>),
    /// An array of a rank other than 1, its elements in row-major order.
    Array(Arc<[u32]>, Arc<[Datum]>),
    /// A vector of numbers, from or for the host. No text denotes it.
    Packed(PackedVector),
    /// A hash table, from or for the host: its keys, each followed by its value. The program compares the
    /// keys by `equal`; of equal keys, the last one counts. No text denotes it.
    Table(Arc<[Datum]>),
    /// Some object of the running program.
    Object(ObjectId),
    /// Something of the embedder's.
    Opaque(OpaqueDatum),
    /// A call that is made once the text has been read and that its value replaces, such as `#.form`: a list
    /// of the name of a macro of the library and its arguments. The macro returns `(quote datum)`.
    Call(Datum),
}

/// Something of the embedder's that programs hold, hand on and compare without looking into it: the name of
/// its type, how it is told from others of that type when it is printed, and itself. Two are equal if they
/// are the same thing.
#[derive(Clone)]
pub struct OpaqueDatum {
    kind: Arc<str>,
    text: Arc<str>,
    value: Arc<dyn Any + Send + Sync>,
}

impl OpaqueDatum {
    /// Creates a datum for a value.
    pub fn new(kind: &str, text: &str, value: Arc<dyn Any + Send + Sync>) -> OpaqueDatum {
        OpaqueDatum { kind: kind.into(), text: text.into(), value }
    }

    /// Creates a datum for an object of a program that no data stands for, such as a task,
    /// with a short text that describes it. It does not lead back to the object.
    pub fn of_program(text: &str) -> OpaqueDatum {
        OpaqueDatum { kind: "".into(), text: text.into(), value: Arc::new(ProgramObject) }
    }

    /// Returns whether it stands for an object of a program.
    pub fn is_of_program(&self) -> bool {
        self.value.is::<ProgramObject>()
    }

    /// Returns the name of its type.
    pub fn kind(&self) -> &str {
        &self.kind
    }

    /// Returns what tells it from others of its type, for people; may be empty.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the value.
    pub fn value(&self) -> &Arc<dyn Any + Send + Sync> {
        &self.value
    }

    /// Returns a number that tells the value from all others alive.
    pub fn identity(&self) -> usize {
        Arc::as_ptr(&self.value).cast::<()>().addr()
    }
}

/// Value of the datum of an object of a program.
struct ProgramObject;

impl PartialEq for OpaqueDatum {
    fn eq(&self, other: &OpaqueDatum) -> bool {
        self.identity() == other.identity()
    }
}

impl fmt::Debug for OpaqueDatum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for OpaqueDatum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_of_program() {
            return f.write_str(&self.text);
        }
        let space = if self.text.is_empty() { "" } else { " " };
        write!(f, "#<{}{space}{}>", self.kind, self.text)
    }
}

/// Contents of a node.
#[derive(Debug)]
enum NodeContents {
    Plain(DatumKind),
    /// A list, which is made if it is asked for.
    Properties(PropertyList),
}

#[derive(Debug)]
struct DatumNode {
    kind: NodeContents,
    span: Span,
    /// [`HAS_CALLS`], [`HAS_OBJECTS`]
    contents: u8,
}

/// A node is or contains a [`DatumKind::Call`].
const HAS_CALLS: u8 = 1;
/// A node is or contains a [`DatumKind::Object`].
const HAS_OBJECTS: u8 = 2;

/// Returns what a node of this kind contains.
fn contents(kind: &DatumKind) -> u8 {
    let of_items = |items: &[Datum]| items.iter().fold(0, |all, item| all | item.0.contents);
    match kind {
        DatumKind::Cons(car, cdr) => car.0.contents | cdr.0.contents,
        DatumKind::Vector(items) | DatumKind::Array(_, items) | DatumKind::Table(items) => of_items(items),
        DatumKind::Call(call) => HAS_CALLS | call.0.contents,
        DatumKind::Object(_) => HAS_OBJECTS,
        _ => 0,
    }
}

/// A datum: a reference to a shared, immutable node. Cloning is cheap.
#[derive(Clone)]
pub struct Datum(Arc<DatumNode>);

impl Datum {
    /// Returns a datum of the given kind.
    pub fn new(kind: DatumKind, span: Span) -> Datum {
        let contents = contents(&kind);
        Datum(Arc::new(DatumNode { kind: NodeContents::Plain(kind), span, contents }))
    }

    /// Returns a property list of `keys`, symbols, and as many `values`.
    pub fn properties(keys: Arc<[Datum]>, values: Vec<PropertyValue>) -> Datum {
        let span = Span::default();
        if keys.is_empty() {
            return Datum::nil(span);
        }
        let properties = PropertyList::new(keys, values);
        let contents = properties.data().fold(0, |all, datum| all | datum.0.contents);
        Datum(Arc::new(DatumNode { kind: NodeContents::Properties(properties), span, contents }))
    }

    /// Becomes a datum of the given kind that was written nowhere. Its node is used again if nothing else
    /// refers to it, so that what passes many numbers needs no memory for each of them.
    pub fn put(&mut self, kind: DatumKind) {
        let span = Span::default();
        let Some(node) = Arc::get_mut(&mut self.0) else {
            *self = Datum::new(kind, span);
            return;
        };
        node.span = span;
        match (&mut node.kind, kind) {
            (NodeContents::Plain(DatumKind::Integer(old)), DatumKind::Integer(new)) => *old = new,
            (old, new) => {
                node.contents = contents(&new);
                *old = NodeContents::Plain(new);
            }
        }
    }

    /// As [`Datum::new`], of a kind that may be the symbol `COMMON-LISP:NIL`.
    pub fn of_kind(kind: DatumKind, span: Span) -> Datum {
        match kind {
            DatumKind::Symbol(symbol) => Datum::symbol(symbol, span),
            kind => Datum::new(kind, span),
        }
    }

    /// Returns the empty list.
    pub fn nil(span: Span) -> Datum {
        Datum::new(DatumKind::Nil, span)
    }

    /// Returns a symbol; `COMMON-LISP:NIL` becomes the empty list.
    pub fn symbol(symbol: Symbol, span: Span) -> Datum {
        if symbol.is_cl("NIL") { Datum::nil(span) } else { Datum::new(DatumKind::Symbol(symbol), span) }
    }

    /// Returns an integer.
    pub fn integer(value: impl Into<Integer>, span: Span) -> Datum {
        Datum::new(DatumKind::Integer(value.into()), span)
    }

    /// Returns a string.
    pub fn string(value: &str, span: Span) -> Datum {
        Datum::new(DatumKind::String(value.into()), span)
    }

    /// Returns a vector of bytes.
    pub fn bytes(value: impl Into<Bytes>, span: Span) -> Datum {
        Datum::new(DatumKind::Packed(PackedVector::Bytes(value.into())), span)
    }

    /// Returns a pair.
    pub fn cons(car: Datum, cdr: Datum, span: Span) -> Datum {
        Datum::new(DatumKind::Cons(car, cdr), span)
    }

    /// Returns a proper list of `items`.
    pub fn list<I>(items: I, span: Span) -> Datum
    where
        I: IntoIterator<Item = Datum>,
        I::IntoIter: DoubleEndedIterator,
    {
        Datum::list_with_tail(items, Datum::nil(span), span)
    }

    /// Returns a list of `items` that ends in `tail`.
    pub fn list_with_tail<I>(items: I, tail: Datum, span: Span) -> Datum
    where
        I: IntoIterator<Item = Datum>,
        I::IntoIter: DoubleEndedIterator,
    {
        items.into_iter().rev().fold(tail, |rest, item| Datum::cons(item, rest, span))
    }

    /// Returns the contents.
    pub fn kind(&self) -> &DatumKind {
        let mut datum = self;
        loop {
            match &datum.0.kind {
                NodeContents::Plain(kind) => return kind,
                NodeContents::Properties(properties) => datum = properties.list(),
            }
        }
    }

    /// Returns the property list that this is, if nobody has asked for its parts as data: the program gets
    /// the same list either way.
    pub fn as_properties(&self) -> Option<&PropertyList> {
        match &self.0.kind {
            NodeContents::Properties(properties) if !properties.has_list() => Some(properties),
            _ => None,
        }
    }

    /// Returns the contents of what is not a property list.
    fn plain_kind(&self) -> Option<&DatumKind> {
        match &self.0.kind {
            NodeContents::Plain(kind) => Some(kind),
            NodeContents::Properties(_) => None,
        }
    }

    /// Returns whether it consists of other data.
    pub fn is_compound(&self) -> bool {
        matches!(
            self.plain_kind(),
            None | Some(
                DatumKind::Cons(..)
                    | DatumKind::Vector(_)
                    | DatumKind::Array(..)
                    | DatumKind::Table(_)
                    | DatumKind::Call(_)
            )
        )
    }

    /// Where it was written.
    pub fn span(&self) -> Span {
        self.0.span
    }

    /// Returns whether both are the same node.
    pub fn is_same(&self, other: &Datum) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Returns an address that tells nodes apart for as long as they are alive.
    pub fn identity(&self) -> usize {
        Arc::as_ptr(&self.0).addr()
    }

    /// Returns whether anything else refers to this node too. `false` means that it occurs once in the datum
    /// around it, unless it is an element of a slice that two vectors share.
    pub fn is_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }

    /// Returns whether this is or contains a call that is still to be made.
    pub fn has_calls(&self) -> bool {
        self.0.contents & HAS_CALLS != 0
    }

    /// Returns whether this is or contains an object of the running program.
    pub fn has_objects(&self) -> bool {
        self.0.contents & HAS_OBJECTS != 0
    }

    /// Returns whether this is `NIL`.
    pub fn is_nil(&self) -> bool {
        matches!(self.plain_kind(), Some(DatumKind::Nil))
    }

    /// Returns the symbol that this is, `NIL` apart.
    pub fn as_symbol(&self) -> Option<&Symbol> {
        match self.plain_kind() {
            Some(DatumKind::Symbol(symbol)) => Some(symbol),
            _ => None,
        }
    }

    /// Returns the halves of a pair.
    pub fn as_cons(&self) -> Option<(&Datum, &Datum)> {
        match self.kind() {
            DatumKind::Cons(car, cdr) => Some((car, cdr)),
            _ => None,
        }
    }

    /// Returns the elements of a list, in order. Stops at the first tail that is not a pair;
    /// [`Elements::tail`] gives it.
    pub fn elements(&self) -> Elements<'_> {
        Elements { rest: self }
    }

    /// Returns the elements of a proper list; `None` if this is not one.
    pub fn as_list(&self) -> Option<Vec<&Datum>> {
        let mut elements = self.elements();
        let items: Vec<&Datum> = elements.by_ref().collect();
        elements.tail().is_nil().then_some(items)
    }
}

/// Iterator over the elements of a list; see [`Datum::elements`].
#[derive(Clone, Debug)]
pub struct Elements<'a> {
    rest: &'a Datum,
}

impl<'a> Elements<'a> {
    /// Rest of the list; at the end, the list's last `cdr`.
    pub fn tail(&self) -> &'a Datum {
        self.rest
    }
}

impl<'a> Iterator for Elements<'a> {
    type Item = &'a Datum;

    fn next(&mut self) -> Option<&'a Datum> {
        let (car, cdr) = self.rest.as_cons()?;
        self.rest = cdr;
        Some(car)
    }
}

impl Drop for DatumNode {
    /// Takes children apart on an explicit stack: a tree may be deeper than the native stack is long.
    fn drop(&mut self) {
        let mut orphans: Vec<Datum> = Vec::new();
        release(&mut self.kind, &mut orphans);
        while let Some(Datum(node)) = orphans.pop() {
            if let Some(mut node) = Arc::into_inner(node) {
                release(&mut node.kind, &mut orphans);
            }
        }
    }
}

/// Data that are given up, to be freed in parts: freeing takes nearly as long as making.
#[derive(Default)]
pub struct DatumRemains(Vec<Datum>);

impl DatumRemains {
    /// Adds a datum.
    pub fn add(&mut self, datum: Datum) {
        self.0.push(datum);
    }

    /// Frees at most `allowed` nodes, and returns how many it could have freed beyond those that there were.
    pub fn free(&mut self, allowed: usize) -> usize {
        let mut left = allowed;
        while left > 0
            && let Some(Datum(node)) = self.0.pop()
        {
            left -= 1;
            if let Some(mut node) = Arc::into_inner(node) {
                release(&mut node.kind, &mut self.0);
            }
        }
        left
    }
}

/// Moves the children of a node that is about to go to `orphans`, leaving the node flat.
fn release(kind: &mut NodeContents, orphans: &mut Vec<Datum>) {
    use DatumKind::{Array, Call, Cons, Table, Vector};
    let kind = match kind {
        NodeContents::Plain(kind) => kind,
        NodeContents::Properties(properties) => return orphans.extend(properties.take_data()),
    };
    if !matches!(kind, Cons(..) | Vector(_) | Array(..) | Table(_) | Call(_)) {
        return;
    }
    match std::mem::replace(kind, DatumKind::Nil) {
        DatumKind::Cons(car, cdr) => orphans.extend([cdr, car]),
        DatumKind::Call(call) => orphans.push(call),
        DatumKind::Vector(mut items) | DatumKind::Array(_, mut items) | DatumKind::Table(mut items) => {
            // A shared slice is left to its last owner.
            if let Some(items) = Arc::get_mut(&mut items) {
                let hole = Datum::nil(Span::default());
                orphans.extend(items.iter_mut().map(|item| std::mem::replace(item, hole.clone())));
            }
        }
        _ => unreachable!("only compound data reach this match"),
    }
}

impl fmt::Debug for Datum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
