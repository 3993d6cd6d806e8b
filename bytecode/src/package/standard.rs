//! The packages that every program finds.

use super::{NameEntry, PackageId, Packages};
use crate::builtin::{BUILTINS, Visibility};
use crate::symbol::{CL_PACKAGE, CL_USER_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, USER_PACKAGE};

/// The external names of `COMMON-LISP`, sorted. All of the standard's, also those that ESL leaves out: so a
/// program cannot take one for a name of its own by mistake, and messages can say what to use instead.
pub const CL_NAMES: [&str; 978] = split(include_str!("common_lisp.txt"));

/// Names of `COMMON-LISP` that ESL gives a meaning of its own.
pub const TAKEN_OVER: [&str; 3] = ["SIGNAL", "ASSERT", "ABORT"];

impl PackageId {
    /// `COMMON-LISP`, also called `CL`.
    pub const CL: PackageId = PackageId(0);
    /// `KEYWORD`.
    pub const KEYWORD: PackageId = PackageId(1);
    /// `ESL`.
    pub const ESL: PackageId = PackageId(2);
    /// `ESL-USER`, also called `USER`.
    pub const USER: PackageId = PackageId(3);
    /// `COMMON-LISP-USER`, also called `CL-USER`.
    pub const CL_USER: PackageId = PackageId(4);
}

impl Packages {
    /// Returns the standard packages, with the names of Common Lisp and of the builtins.
    ///
    /// `ESL` uses `COMMON-LISP` and exports its names again, but for those that it takes over. So a package
    /// that uses only `ESL`, as `ESL-USER` does, has all of the language. `COMMON-LISP-USER` is for programs
    /// that say that they are in it: there the names that `ESL` takes over mean what they mean in Common
    /// Lisp.
    pub fn standard() -> Packages {
        let mut packages = Packages::empty();
        for (id, name, nickname) in [
            (PackageId::CL, CL_PACKAGE, Some("CL")),
            (PackageId::KEYWORD, KEYWORD_PACKAGE, None),
            (PackageId::ESL, ESL_PACKAGE, None),
            (PackageId::USER, USER_PACKAGE, Some("USER")),
            (PackageId::CL_USER, CL_USER_PACKAGE, Some("CL-USER")),
        ] {
            let added = packages.add(name.into(), nickname.map(Into::into).into_iter().collect());
            debug_assert_eq!(added, id);
        }
        packages.table[PackageId::CL].names = &CL_NAMES;
        packages.table[PackageId::ESL].uses = vec![PackageId::CL];
        packages.table[PackageId::ESL].exports_again = Some(PackageId::CL);
        packages.table[PackageId::USER].uses = vec![PackageId::ESL];
        packages.table[PackageId::CL_USER].uses = vec![PackageId::CL];
        for name in TAKEN_OVER {
            let entry = NameEntry { home: PackageId::ESL, external: true, shadowing: true, symbol: None };
            packages.table[PackageId::ESL].symbols.insert(name.into(), entry);
        }
        let of_esl = BUILTINS.iter().filter(|row| row.visibility != Visibility::Cl);
        packages.table[PackageId::ESL].symbols.reserve(of_esl.clone().count());
        for row in of_esl.filter(|row| !TAKEN_OVER.contains(&row.name)) {
            packages.register(PackageId::ESL, row.name, row.visibility == Visibility::Esl);
        }
        packages
    }
}

/// Returns the words of `text`.
const fn split<const N: usize>(text: &'static str) -> [&'static str; N] {
    let mut words = [""; N];
    let bytes = text.as_bytes();
    let mut found = 0;
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        while at < bytes.len() && !bytes[at].is_ascii_whitespace() {
            at += 1;
        }
        if at > start {
            words[found] = text.split_at(at).0.split_at(start).1;
            found += 1;
        }
        at += 1;
    }
    assert!(found == N);
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_are_sorted() {
        assert!(CL_NAMES.is_sorted());
        assert!(TAKEN_OVER.iter().all(|name| CL_NAMES.binary_search(name).is_ok()));
    }

    #[test]
    fn builtins_of_common_lisp_have_its_names() {
        let strange = BUILTINS
            .iter()
            .filter(|row| row.visibility == Visibility::Cl && CL_NAMES.binary_search(&row.name).is_err());
        assert_eq!(strange.map(|row| row.name).collect::<Vec<_>>(), [""; 0]);
    }
}
