//! The constant pool (V13).

use num_bigint::BigInt;
use num_integer::Integer;

use super::error::{Fault, FaultPlace, VerifyError};
use crate::module::{Constant, FunctionNumber, Module, PoolIdx};

/// The largest numerator or denominator whose ratio is checked for lowest terms: 8192 bits.
///
/// The check takes time in proportion to the square, which a file could make long at little cost.
pub const MAX_RATIO_BITS: u64 = 8192;

/// Checks all constants.
pub(super) fn verify(module: &Module) -> Result<(), VerifyError> {
    for (index, constant) in module.constants.iter().enumerate() {
        let index = PoolIdx(index as u32);
        verify_constant(module, index, constant)
            .map_err(|fault| VerifyError { place: FaultPlace::Constant(index), fault })?;
    }
    Ok(())
}

fn verify_constant(module: &Module, own: PoolIdx, constant: &Constant) -> Result<(), Fault> {
    match constant {
        Constant::Symbol(symbol) | Constant::Class(symbol) => {
            if symbol.is_cl("NIL") || symbol.is_cl("T") {
                return Err(Fault::StandardSymbol);
            }
        }
        Constant::Ratio(numerator, denominator) => verify_ratio(numerator, denominator)?,
        Constant::Cons(car, cdr) => verify_items(module, own, &[*car, *cdr])?,
        Constant::Vector(items) => verify_items(module, own, items)?,
        Constant::Array(dimensions, items) => {
            let size =
                dimensions.iter().try_fold(1_usize, |size, &dimension| size.checked_mul(dimension as usize));
            // A product that is zero in the end may overflow on the way.
            let size = if dimensions.contains(&0) { Some(0) } else { size };
            if dimensions.len() == 1 || size != Some(items.len()) {
                return Err(Fault::Array);
            }
            verify_items(module, own, items)?;
        }
        Constant::Function(number) => {
            function(module, *number)?;
        }
        Constant::Nil
        | Constant::True
        | Constant::Integer(_)
        | Constant::Float(_)
        | Constant::Character(_)
        | Constant::String(_)
        | Constant::Object(_) => {}
    }
    Ok(())
}

fn verify_ratio(numerator: &BigInt, denominator: &BigInt) -> Result<(), Fault> {
    let one = BigInt::from(1);
    let small = numerator.bits() <= MAX_RATIO_BITS && denominator.bits() <= MAX_RATIO_BITS;
    if small && *denominator > one && numerator.gcd(denominator) == one { Ok(()) } else { Err(Fault::Ratio) }
}

fn verify_items(module: &Module, own: PoolIdx, items: &[PoolIdx]) -> Result<(), Fault> {
    items.iter().try_for_each(|&item| {
        if item >= own {
            return Err(Fault::PoolIndex(item));
        }
        verify_data(module, item)
    })
}

/// Checks that a constant is something that a program may get hold of.
pub(super) fn verify_data(module: &Module, index: PoolIdx) -> Result<(), Fault> {
    let data = match constant(module, index)? {
        Constant::Class(_) => false,
        Constant::Function(number) => function(module, *number)?.captures.is_empty(),
        _ => true,
    };
    if data { Ok(()) } else { Err(Fault::NotData) }
}

/// Returns the constant `index`, if there is one.
pub(super) fn constant(module: &Module, index: PoolIdx) -> Result<&Constant, Fault> {
    module.constants.get(index.0 as usize).ok_or(Fault::PoolIndex(index))
}

/// Returns the function `number`, if there is one.
pub(super) fn function(
    module: &Module,
    number: FunctionNumber,
) -> Result<&crate::module::ModuleFunction, Fault> {
    module.functions.get(number.0 as usize).ok_or(Fault::FunctionNumber(number))
}
