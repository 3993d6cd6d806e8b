//! Compiles and runs mutated conformance programs: texts with mixed-up tokens, and bytecode with changed
//! instructions. None may panic or hang, and none may pass the verifier and do harm.
//!
//! `PROPTEST_CASES=10000 cargo test -p esl-conformance --test language --features thorough,paranoid --
//! anything`
//! searches longer.

use std::sync::LazyLock;

use esl_bytecode::file;
use esl_bytecode::module::Module;
use esl_conformance::{anything, programs};
use proptest::prelude::*;
use proptest::sample::Index;

/// The texts of all conformance programs except those that are large on purpose.
static TEXTS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let limits = programs::folder().join("limits");
    let paths = programs::paths("").into_iter().filter(|path| !path.starts_with(&limits));
    paths.map(|path| std::fs::read_to_string(path).expect("a program is text")).collect()
});

fn text_at(index: &Index) -> &'static str {
    &TEXTS[index.index(TEXTS.len())]
}

/// Returns the tokens of a text without comments: parentheses, quotes, strings, and words between blanks.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = match first {
            ';' => rest.find('\n').unwrap_or(rest.len()),
            '"' => rest[1..].find('"').map_or(rest.len(), |end| end + 2),
            '(' | ')' | '\'' | '`' | ',' => 1,
            _ => rest.find(|c: char| c.is_whitespace() || "()'`,;\"".contains(c)).unwrap_or(rest.len()),
        };
        if first != ';' {
            tokens.push(&rest[..length]);
        }
        rest = rest[length..].trim_start();
    }
    tokens
}

/// A change of a program's tokens.
#[derive(Clone, Debug)]
enum TokenMutation {
    Delete(Index),
    Repeat(Index),
    Swap(Index, Index),
    /// Replaces a token by a token of another program.
    Replace(Index, Index, Index),
    /// Replaces a token by a form of another program.
    Graft(Index, Index, Index),
    Wrap(Index),
}

fn token_mutation() -> impl Strategy<Value = TokenMutation> {
    let index = any::<Index>;
    prop_oneof![
        index().prop_map(TokenMutation::Delete),
        index().prop_map(TokenMutation::Repeat),
        (index(), index()).prop_map(|(a, b)| TokenMutation::Swap(a, b)),
        (index(), index(), index()).prop_map(|(at, text, token)| TokenMutation::Replace(at, text, token)),
        (index(), index(), index()).prop_map(|(at, text, token)| TokenMutation::Graft(at, text, token)),
        index().prop_map(TokenMutation::Wrap),
    ]
}

/// Returns the position after the form that begins at `start`.
fn end_of_form(tokens: &[&str], start: usize) -> usize {
    let mut depth = 0_usize;
    for (position, &token) in tokens.iter().enumerate().skip(start) {
        match token {
            "(" => depth += 1,
            ")" => depth = depth.saturating_sub(1),
            "'" | "`" | "," => continue,
            _ => {}
        }
        if depth == 0 {
            return position + 1;
        }
    }
    tokens.len()
}

fn mix(text: &Index, mutations: &[TokenMutation]) -> String {
    let mut mixed = tokens(text_at(text));
    for mutation in mutations {
        if mixed.is_empty() {
            break;
        }
        let size = mixed.len();
        match mutation {
            TokenMutation::Delete(at) => _ = mixed.remove(at.index(size)),
            TokenMutation::Repeat(at) => {
                let start = at.index(size);
                let form = mixed[start..end_of_form(&mixed, start)].to_vec();
                mixed.splice(start..start, form);
            }
            TokenMutation::Swap(a, b) => mixed.swap(a.index(size), b.index(size)),
            TokenMutation::Replace(at, text, token) => {
                let other = tokens(text_at(text));
                mixed[at.index(size)] = other[token.index(other.len())];
            }
            TokenMutation::Graft(at, text, token) => {
                let other = tokens(text_at(text));
                let start = token.index(other.len());
                let form = other[start..end_of_form(&other, start)].to_vec();
                let at = at.index(size);
                mixed.splice(at..=at, form);
            }
            TokenMutation::Wrap(at) => {
                let start = at.index(size);
                let end = end_of_form(&mixed, start);
                mixed.insert(end, ")");
                mixed.insert(start, "(");
            }
        }
    }
    mixed.join(" ")
}

/// A change of a module: which function, what kind of change, where, and the new value.
type ModuleMutation = (Index, u8, Index, u32);

fn mutate(module: &mut Module, (function, what, at, to): &ModuleMutation) {
    if module.functions.is_empty() {
        return;
    }
    let pool = module.constants.len().max(1) as u32;
    let count = module.functions.len();
    let function = &mut module.functions[function.index(count)];
    if function.code.is_empty() {
        return;
    }
    let words = function.code.len();
    let at_word = at.index(words);
    match what {
        // Sets a byte of an instruction word, then arms that increment, decrement or flip one.
        0..=3 => {
            let shift = 8 * u32::from(what % 4);
            function.code[at_word] = function.code[at_word] & !(0xff << shift) | (to & 0xff) << shift;
        }
        4 => function.code[at_word] = function.code[at_word].wrapping_add(1 << (8 * (to % 4))),
        5 => function.code[at_word] = function.code[at_word].wrapping_sub(1 << (8 * (to % 4))),
        6 => function.code[at_word] ^= 1 << (to % 32),
        7 => function.code.swap(at_word, *to as usize % words),
        8 => _ = function.code.remove(at_word),
        9 => function.code.insert(at_word, function.code[*to as usize % words]),
        10 => function.registers = (to % 256) as u8,
        11 => function.parameters.required = (to % 4) as u8,
        12 => _ = function.captures.pop(),
        13 if !function.constants.is_empty() => {
            let place = at.index(function.constants.len());
            function.constants[place].0 = to % pool;
        }
        14 => module.constants.swap(at.index(pool as usize), (to % pool) as usize),
        _ => {
            if let Some(number) = module.toplevel.first_mut() {
                number.0 = to % (count as u32 + 1);
            }
        }
    }
}

fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(100)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn mixed_up_programs_compile_and_run_without_harm(
        text in any::<Index>(),
        mutations in prop::collection::vec(token_mutation(), 1..8),
    ) {
        if let Some(module) = anything::compile(&mix(&text, &mutations)) {
            prop_assert!(anything::run(&module));
        }
    }

    /// As the fuzz target does. A failure may depend on earlier texts of the list.
    #[test]
    #[ignore = "run with --ignored, and PROPTEST_CASES for longer"]
    fn one_machine_serves_many_programs(texts in prop::collection::vec(any::<Index>(), 1..20)) {
        for text in texts {
            anything::compile_and_run(text_at(&text));
        }
    }

    #[test]
    fn the_verifier_lets_nothing_harmful_through(
        text in any::<Index>(),
        mutations in prop::collection::vec((any::<Index>(), 0..16_u8, any::<Index>(), any::<u32>()), 1..4),
    ) {
        if let Some(mut module) = anything::compile(text_at(&text)) {
            mutations.iter().for_each(|mutation| mutate(&mut module, mutation));
            anything::run(&module);
        }
    }

    #[test]
    fn files_with_right_checksums_run_or_are_refused(
        text in any::<Index>(),
        bytes in prop::collection::vec((any::<Index>(), any::<u8>()), 0..4),
    ) {
        if let Some(module) = anything::compile(text_at(&text)) {
            let mut file = esl_bytecode::file::write(&module).expect("it can be written");
            for (at, byte) in bytes {
                let at = at.index(file.len());
                file[at] = byte;
            }
            anything::run_file(&anything::with_checksums(&file));
        }
    }

    #[test]
    fn bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        anything::read(&bytes);
        anything::run_file(&bytes);
    }
}

#[cfg(feature = "native")]
proptest! {
    // Machine code is made of all that runs, which takes its time.
    #![proptest_config(ProptestConfig { cases: cases() / 8, max_shrink_iters: 50, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytecode_runs_alike_in_both_tiers(
        text in any::<Index>(),
        mutations in prop::collection::vec((any::<Index>(), 0..16_u8, any::<Index>(), any::<u32>()), 0..3),
        slice in prop::sample::select(vec![1_u32, 20, 2000]),
    ) {
        if let Some(mut module) = anything::compile(text_at(&text)) {
            mutations.iter().for_each(|mutation| mutate(&mut module, mutation));
            anything::run_in_tiers(&module, slice);
        }
    }
}

#[test]
fn damage_of_a_file_is_hidden_from_all_checksums() {
    let module =
        anything::compile("(defun f (x) (list x \"text\" 'name)) (print (f 1))").expect("it compiles");
    let file = file::write(&module).expect("it can be written");
    assert_eq!(anything::with_checksums(&file), file);
    let mut damaged = file.clone();
    *damaged.last_mut().expect("it has sections") ^= 1;
    assert_ne!(anything::with_checksums(&damaged)[..damaged.len() - 1], file[..file.len() - 1]);
}
