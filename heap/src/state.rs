//! The list of all state: what each field of the machine means for a run.
//!
//! [`list_state!`](crate::list_state) lists the fields of a struct, in any module that sees them. It takes
//! the struct apart without `..`, so a new field does not compile until the list gives it a [`FieldRole`]. A
//! field that consists of listed structs has the role `Parts`, which compiles only if they are listed too. So
//! [`Listed::FIELDS`] of a struct is a tree of everything that it owns.
//!
//! Guarantees: the tree is complete. Code that compares, saves or copies a machine can be checked against it.

/// Meaning of a field for a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldRole {
    /// State of the run: two machines that differ here may behave differently.
    Run,
    /// Follows from other fields, and is kept to save time.
    Derived,
    /// Belongs to the process: an address, a handle, a cache. Another one in its place makes no difference to
    /// the run.
    Process,
    /// Made of structs that are listed themselves; these are their fields.
    Parts(&'static [Field]),
}

/// A field of a listed struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name in the source.
    pub name: &'static str,
    /// Meaning for a run.
    pub role: FieldRole,
}

/// A struct whose fields are all listed by [`list_state!`](crate::list_state).
pub trait Listed {
    /// Fields, in the order of the list.
    const FIELDS: &'static [Field];
}

impl<T: Listed> Listed for Option<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed> Listed for Vec<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed> Listed for std::ptr::NonNull<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed, const N: usize> Listed for [T; N] {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed + ?Sized> Listed for Box<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

/// Returns the role of a field that consists of listed structs.
pub const fn parts_of<Owner, Part: Listed>(_field: fn(&Owner) -> &Part) -> FieldRole {
    FieldRole::Parts(Part::FIELDS)
}

/// Lists the fields of a struct: `list_state! { Pacing { floor: Run, threshold: Run } }`.
///
/// The words are those of [`FieldRole`](crate::state::FieldRole).
#[macro_export]
macro_rules! list_state {
    ($owner:ident { $( $field:tt : $role:ident ),* $(,)? }) => {
        impl $crate::state::Listed for $owner {
            const FIELDS: &'static [$crate::state::Field] = {
                // A field that is not listed is an error here.
                let _ = |whole: &$owner| {
                    let $owner { $( $field: _ ),* } = whole;
                };
                &[ $( $crate::state::Field {
                    name: stringify!($field),
                    role: $crate::list_state!(@role $owner $field $role),
                } ),* ]
            };
        }
    };
    (@role $owner:ident $field:tt Parts) => { $crate::state::parts_of(|whole: &$owner| &whole.$field) };
    (@role $owner:ident $field:tt $role:ident) => { $crate::state::FieldRole::$role };
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Inner {
        count: u32,
        _address: usize,
    }

    struct Outer {
        inner: Vec<Option<Inner>>,
        total: u32,
    }

    struct Single(Inner);

    list_state! { Inner { count: Run, _address: Process } }
    list_state! { Outer { inner: Parts, total: Derived } }
    list_state! { Single { 0: Parts } }

    #[test]
    fn a_list_is_a_tree_of_fields() {
        let inner: &[Field] = &[
            Field { name: "count", role: FieldRole::Run },
            Field { name: "_address", role: FieldRole::Process },
        ];
        assert_eq!(Inner::FIELDS, inner);
        assert_eq!(Outer::FIELDS[0], Field { name: "inner", role: FieldRole::Parts(inner) });
        assert_eq!(Outer::FIELDS[1], Field { name: "total", role: FieldRole::Derived });
        assert_eq!(Single::FIELDS, [Field { name: "0", role: FieldRole::Parts(inner) }]);
        let whole = Outer { inner: vec![Some(Inner { count: 1, _address: 0 })], total: 1 };
        assert_eq!(whole.inner.iter().flatten().map(|inner| inner.count).sum::<u32>(), whole.total);
        assert_eq!(Single(Inner { count: 2, _address: 0 }).0.count, 2);
    }
}
