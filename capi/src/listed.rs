//! Values that C lists, as arguments or as items.

use esl::Data;

use crate::border::{elements, look_within};
use crate::failure::Fault;
use crate::value::esl_value;

/// Copies the values that C lists.
///
/// # Safety
/// `values` is null, or points to `count` values.
pub(crate) unsafe fn values(values: *const *const esl_value, count: usize) -> Result<Vec<Data>, Fault> {
    // SAFETY: each pointer is null, or to what C holds and lends.
    Ok(unsafe { copies(values, count) }?.collect())
}

/// Returns copies of the values that C lists, each made when it is asked for.
///
/// # Safety
/// As for [`values`], until the last copy is made.
pub(crate) unsafe fn copies<'a>(
    values: *const *const esl_value,
    count: usize,
) -> Result<impl Iterator<Item = Data> + 'a, Fault> {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let values: &'a [*const esl_value] = unsafe { elements(values, count, "values") }?;
    for &value in values {
        // SAFETY: each pointer is null, or to what C holds and lends.
        unsafe { look_within(value) }?;
    }
    // SAFETY: none of the pointers is null, as was found just now.
    Ok(values.iter().map(|&value| unsafe { &*value }.0.clone()))
}
