//! Constants of an image as data for the compiler, without making objects.

use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::file::{ConstantRecord, ModuleImage, SymbolHome};
use esl_bytecode::module::PoolIdx;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

/// Returns the datum that a constant describes; `None` for functions and classes, and for data that contain
/// them. Data refer to earlier constants only, so the walk ends.
pub(super) fn datum(image: &ModuleImage, packages: &[Arc<str>], index: PoolIdx) -> Option<Datum> {
    enum Todo {
        Visit(PoolIdx),
        Build(PoolIdx),
    }
    let span = Span::default();
    let mut todo = vec![Todo::Visit(index)];
    let mut made: Vec<Datum> = Vec::new();
    while let Some(next) = todo.pop() {
        match next {
            Todo::Visit(index) => {
                let kind = match image.constant(index).ok()? {
                    ConstantRecord::Nil => DatumKind::Nil,
                    ConstantRecord::True => DatumKind::Symbol(Symbol::cl("T")),
                    ConstantRecord::Symbol(number) => {
                        let record = image.symbol(number).ok()?;
                        DatumKind::Symbol(match record.home {
                            SymbolHome::Package(home) => {
                                Symbol::new(packages.get(home as usize)?, record.name)
                            }
                            // Each mention of it would be a different object.
                            SymbolHome::Uninterned(_) => return None,
                        })
                    }
                    ConstantRecord::Fixnum(value) => DatumKind::Integer(value.into()),
                    ConstantRecord::Integer(value) => DatumKind::Integer(value.into()),
                    ConstantRecord::Ratio(numerator, denominator) => DatumKind::Ratio(numerator, denominator),
                    ConstantRecord::Float(value) => DatumKind::Float(value),
                    ConstantRecord::Character(value) => DatumKind::Character(value),
                    ConstantRecord::String(text) => DatumKind::String(text.into()),
                    ConstantRecord::Cons(car, cdr) => {
                        todo.extend([Todo::Build(index), Todo::Visit(cdr), Todo::Visit(car)]);
                        continue;
                    }
                    ConstantRecord::Vector(items) => {
                        todo.push(Todo::Build(index));
                        todo.extend(items.iter().rev().map(Todo::Visit));
                        continue;
                    }
                    ConstantRecord::Array(..) | ConstantRecord::Function(_) | ConstantRecord::Class(_) => {
                        return None;
                    }
                };
                made.push(Datum::new(kind, span));
            }
            Todo::Build(index) => {
                let datum = match image.constant(index).ok()? {
                    ConstantRecord::Vector(items) => {
                        let items = made.split_off(made.len() - items.len());
                        Datum::new(DatumKind::Vector(items.into()), span)
                    }
                    _ => {
                        let (cdr, car) = (made.pop()?, made.pop()?);
                        Datum::cons(car, cdr, span)
                    }
                };
                made.push(datum);
            }
        }
    }
    made.pop()
}
