//! The builtin of a name: a table of all of them in order, made when the machine is compiled.

use esl_bytecode::builtin::{BUILTINS, Builtin, Visibility};
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol};

/// Numbers of the builtins, ordered by package and name.
const BUILTINS_BY_NAME: [u16; BUILTINS.len()] = sorted_builtins();

const fn sorted_builtins() -> [u16; BUILTINS.len()] {
    let mut numbers = [0; BUILTINS.len()];
    let mut gap = 1;
    let mut at = 0;
    while at < numbers.len() {
        numbers[at] = at as u16;
        at += 1;
        if gap < numbers.len() / 3 {
            gap = gap * 3 + 1;
        }
    }
    // Shell sort is short, and the compiler runs it only once.
    while gap > 0 {
        let mut at = gap;
        while at < numbers.len() {
            let number = numbers[at];
            let mut hole = at;
            while hole >= gap && is_before(number, numbers[hole - gap]) {
                numbers[hole] = numbers[hole - gap];
                hole -= gap;
            }
            numbers[hole] = number;
            at += 1;
        }
        gap /= 3;
    }
    numbers
}

const fn is_before(a: u16, b: u16) -> bool {
    let (a, b) = (&BUILTINS[a as usize], &BUILTINS[b as usize]);
    let (a_is_cl, b_is_cl) = (matches!(a.visibility, Visibility::Cl), matches!(b.visibility, Visibility::Cl));
    if a_is_cl != b_is_cl {
        return a_is_cl;
    }
    let (a, b) = (a.name.as_bytes(), b.name.as_bytes());
    let mut at = 0;
    while at < a.len() && at < b.len() {
        if a[at] != b[at] {
            return a[at] < b[at];
        }
        at += 1;
    }
    a.len() < b.len()
}

/// Returns the builtin that `symbol` names.
pub(crate) fn find_builtin(symbol: &Symbol) -> Option<Builtin> {
    let is_cl = symbol.is_in(CL_PACKAGE);
    if !is_cl && !symbol.is_in(ESL_PACKAGE) {
        return None;
    }
    let key = (!is_cl, symbol.name());
    let of = |&number: &u16| {
        let info = &BUILTINS[usize::from(number)];
        (info.visibility != Visibility::Cl, info.name)
    };
    let at = BUILTINS_BY_NAME.binary_search_by(|number| of(number).cmp(&key)).ok()?;
    Builtin::from_number(u32::from(BUILTINS_BY_NAME[at]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_builtin_is_found_by_its_name() {
        for info in BUILTINS {
            let symbol = Symbol::new(&info.package().into(), info.name);
            assert_eq!(find_builtin(&symbol), Some(info.builtin));
        }
        assert_eq!(find_builtin(&Symbol::keyword("CAR")), None);
    }
}
