//! Programs run in both tiers: nothing of a run tells whether functions are interpreted or run as machine
//! code.
//!
//! A part of the conformance programs, and random functions of numbers in loops: with long slices, short
//! ones, and slices of one tick. With the variable `ESL_TIERS=all` of the environment all programs run, also
//! with a collection at each safepoint, and more random ones.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_conformance::{Expectations, Setting};
use esl_vm::vm::Tier;
use libtest_mimic::{Failed, Trial};

/// Programs about work that machine code does in a way of its own.
const ALWAYS: [&str; 5] = [
    "limits/a_clause_that_uses_up_the_reserve_is_not_tried_again.esl",
    "limits/endless_recursion_through_dynamic_state.esl",
    "stdlib/elements_of_two_dimensions.esl",
    "stdlib/tables_find_integers.esl",
    "stdlib/tables_find_keys_again.esl",
];

/// Random programs in each test of them.
const PROGRAMS: u64 = 8;

/// Small functions in a random program.
const SMALL: u64 = 6;

/// The part of a run that does not depend on how functions run.
#[derive(Debug, PartialEq)]
pub(super) struct TierOutcome {
    output: String,
    errors: String,
    ended: String,
    ticks: u64,
    turns: u64,
    canary: u64,
}

fn are_all_asked_for() -> bool {
    std::env::var("ESL_TIERS").is_ok_and(|which| which == "all")
}

/// Returns the tests: of these programs some and one of 24, unless all are asked for, and of random ones.
pub(super) fn trials(names: &[(String, PathBuf)]) -> Vec<Trial> {
    let is_chosen = |name: &str| {
        are_all_asked_for()
            || ALWAYS.contains(&name)
            || name.bytes().fold(0u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte.into())) % 24 == 0
    };
    let chosen = names.iter().filter(|(name, _)| is_chosen(name)).map(|(name, path)| {
        let (name, path) = (name.clone(), path.clone());
        Trial::test(format!("tiers {name}"), move || check_program(&name, &path))
    });
    let seeds = if are_all_asked_for() { 64 } else { 4 };
    let random = (0..seeds).map(|seed| {
        Trial::test(format!("tiers random numbers {seed}"), move || {
            (seed * PROGRAMS..(seed + 1) * PROGRAMS).try_for_each(check_random)
        })
    });
    chosen.chain(random).collect()
}

fn check_program(name: &str, path: &Path) -> Result<(), Failed> {
    let text = std::fs::read_to_string(path)?;
    let expected = Expectations::parse(&text)?;
    let Some(program) = program::compile(&[Source::new(name, text)]).program else { return Ok(()) };
    for slice in [None, Some(50), Some(1)] {
        if slice.is_some() && !expected.settings.contains(&Setting::Slice1) {
            continue;
        }
        let mut config = super::config(&expected.options, Setting::Default)?;
        config.slice = slice.unwrap_or(config.slice);
        compare(&program, &config)?;
    }
    // A collection takes time in proportion to the live data, and these programs keep much data alive.
    if are_all_asked_for() && expected.settings.contains(&Setting::GcStress) && !name.starts_with("limits") {
        compare(&program, &super::config(&expected.options, Setting::GcStress)?)?;
    }
    Ok(())
}

fn check_random(seed: u64) -> Result<(), Failed> {
    let text = RandomNumbers { state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1 }.program();
    let compiled = program::compile(&[Source::new("random.esl", text.clone())]);
    let Some(program) = compiled.program else {
        return Err(format!("{:#?}\n{text}", compiled.diagnostics).into());
    };
    for slice in [2000, 7] {
        let config = Config { slice, ..Config::default() };
        compare(&program, &config).map_err(|failed| format!("{}\n{text}", failed.message().unwrap_or("")))?;
    }
    Ok(())
}

/// Runs a program by the interpreter and as machine code. That which is made on a thread of its own comes at
/// times that differ from run to run, which shows no more.
pub(super) fn compare(program: &Program, config: &Config) -> Result<(), Failed> {
    let interpreted = run(program, config, Tier::Interpreter)?;
    let tiers = if are_all_asked_for() { &[Tier::Native, Tier::Auto][..] } else { &[Tier::Native] };
    for &tier in tiers {
        let native = run(program, config, tier)?;
        if interpreted != native {
            return Err(format!(
                "slice {}, collect always {}\ninterpreted {interpreted:#?}\n{tier:?} {native:#?}",
                config.slice, config.collect_always
            )
            .into());
        }
    }
    Ok(())
}

fn run(program: &Program, config: &Config, tier: Tier) -> Result<TierOutcome, Failed> {
    match run_anyhow(program, config, tier)? {
        (outcome, None) => Ok(outcome),
        (_, Some(reason)) => Err(format!("there is no machine code: {reason}").into()),
    }
}

/// Returns the outcome of a run, and why there was no machine code if there was none to be had.
pub(super) fn run_anyhow(
    program: &Program,
    config: &Config,
    tier: Tier,
) -> Result<(TierOutcome, Option<String>), Failed> {
    let host = VirtualHost::new();
    let captured = host.captured();
    let mut machine = program::machine(config.clone(), Box::new(host))?;
    machine.set_tier(tier);
    let summary = program::run_in(&mut machine, program)?;
    let refused = machine.tier().1.refused.clone();
    let outcome = TierOutcome {
        output: captured.output(),
        errors: captured.error(),
        ended: format!("{:?}", summary.ended),
        ticks: summary.ticks,
        turns: summary.turns,
        canary: machine.canary(),
    };
    Ok((outcome, refused))
}

/// Makes programs of functions that compute with numbers of all kinds in loops.
struct RandomNumbers {
    state: u64,
}

/// Constants: small and large fixnums, integers beyond them, ratios, doubles with and without a box, zeros.
const CONSTANTS: [&str; 22] = [
    "0",
    "1",
    "-1",
    "2",
    "3",
    "7",
    "-40",
    "1000000",
    "2305843009213693951",
    "-2305843009213693952",
    "100000000000000000000",
    "1/3",
    "-7/2",
    "0.0",
    "-0.0",
    "1.0",
    "0.5",
    "-2.25",
    "1.0e-300",
    "1.0e300",
    "3.0e-9",
    "123456.789",
];

impl RandomNumbers {
    fn below(&mut self, n: u64) -> u64 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        (self.state >> 33) % n
    }

    fn pick<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len() as u64) as usize]
    }

    /// Returns the body of a small function, which may call those before it.
    fn small(&mut self, number: u64) -> String {
        let (x, y) = (self.leaf(), self.leaf());
        let value = match self.below(7) {
            0 => format!("(* (- {x} {y}) 0.5)"),
            1 => format!("(if (< {x} {y}) (+ {x} 1) {y})"),
            2 => format!("(floor {x} 3)"),
            3 => format!("(max {x} {y})"),
            4 => format!("(let ((c (* {x} 1.5)) (d (+ {y} 0.25))) (+ (* c d) (- c d)))"),
            5 => format!("(values (+ {x} 0.5) {y})"),
            _ => format!("(sqrt (* {y} {y} 1.0))"),
        };
        match (number, self.below(3)) {
            (0, _) | (_, 0) => value,
            (_, 1) => format!("(g{} {x} {value})", self.below(number)),
            _ => format!("(+ 0.125 (g{} {value} {y}))", self.below(number)),
        }
    }

    /// Returns functions, and calls of them that print what they return or how they fail.
    fn program(mut self) -> String {
        let mut text = String::from(
            "(defun tame (v) (if (< -1000000000000000000000 v 1000000000000000000000) v 7))\n\
             (defun f0 (a b) (+ (* a 2) b))\n\
             (defun o0 (a &optional (b 2.5)) (- b a))\n\
             (defun o1 (a &rest others) (if others (+ a (car others)) (* a 0.5)))\n\
             (defun o2 (&key (by 3) of) (if of (* by of) (o0 by)))\n\
             (defun o3 (a &optional b) (if b (o1 b a 1) (o2 :by a)))\n\
             (defun o4 (f a b) (funcall f a b))\n\
             (defun o5 (f a b) (multiple-value-list (funcall f a b)))\n",
        );
        for number in 0..SMALL {
            let _ = writeln!(text, "(defun g{number} (a b) {})", self.small(number));
        }
        let (x, y, z, value) = (self.leaf(), self.leaf(), self.leaf(), self.small(SMALL));
        let _ = writeln!(text, "(defun r (a b n) (if (< n 1) {x} (tame (- (r {y} {value} (- n 1)) {z}))))");
        let _ = writeln!(text, "(defun q (a n) (if (< n 2) {x} (+ (q a (- n 1)) (* 0.5 (q {y} (- n 2))))))");
        for number in 1..=4 {
            let _ = writeln!(text, "(defun f{number} (a b)");
            let before = number - 1;
            let (x, y, s) = (self.leaf(), self.leaf(), self.constant());
            let _ = writeln!(text, "  (let ((x {x}) (y (f{before} b {y})) (s {s}) (i 0))");
            let turns = 3 + self.below(20);
            match self.below(3) {
                0 => _ = writeln!(text, "    (dotimes (i {turns})"),
                1 => _ = writeln!(text, "    (do ((i 0.0 (+ i 0.5))) ((> i {turns}))"),
                _ => _ = writeln!(text, "    (loop for i from {turns} downto 1 do (progn"),
            }
            let is_loop = text.trim_end().ends_with("progn");
            for _ in 0..1 + self.below(4) {
                let variable = self.pick(&["x", "y", "s"]);
                let (value, test) = (self.expression(3), self.test());
                let _ = match self.below(7) {
                    0 | 1 => writeln!(text, "      (setq {variable} (tame {value}))"),
                    // By one of those before it, lest it call itself.
                    2 => {
                        let (turn, number) = (self.below(20), self.below(SMALL));
                        let other = self.below(number + 1);
                        writeln!(
                            text,
                            "      (when (= i {turn}) (setf (symbol-function 'g{number}) #'g{other}))"
                        )
                    }
                    3 | 4 => writeln!(text, "      (when {test} (setq {variable} (tame {value})))"),
                    _ => writeln!(text, "      (incf {variable} {})", self.leaf()),
                };
            }
            let _ = writeln!(text, "      ){}\n    (+ (* 0 i) x y s)))", if is_loop { ")" } else { "" });
        }
        for _ in 0..12 {
            let _ = writeln!(
                text,
                "(print (handler-case (f{} {} {}) (error (e) (type-of e))))",
                1 + self.below(4),
                self.constant(),
                self.constant()
            );
        }
        text
    }

    fn constant(&mut self) -> &'static str {
        self.pick(&CONSTANTS)
    }

    /// Returns the name of a function of two numbers, most of them builtins.
    fn callee(&mut self) -> &'static str {
        self.pick(&["+", "-", "max", "floor", "truncate", "mod", "<", "values", "1+", "expt", "f0", "o0"])
    }

    fn leaf(&mut self) -> &'static str {
        if self.below(3) == 0 { self.constant() } else { self.pick(&["a", "b"]) }
    }

    fn test(&mut self) -> String {
        let operator = self.pick(&["<", "<=", ">", ">=", "=", "/=", "eql"]);
        format!("({operator} {} {})", self.expression(1), self.expression(1))
    }

    fn expression(&mut self, depth: u32) -> String {
        if depth == 0 {
            return match self.below(3) {
                0 => self.constant().into(),
                _ => self.pick(&["a", "b", "x", "y", "s", "i"]).into(),
            };
        }
        let (x, y) = (self.expression(depth - 1), self.expression(depth - 1));
        match self.below(18) {
            0 | 1 => format!("(+ {x} {y})"),
            2 => format!("(- {x} {y})"),
            3 => format!("(* {x} {y})"),
            4 => format!("(/ {x} {y})"),
            5 => format!("(+ {x} 1)"),
            6 => format!("(mod {x} 7)"),
            7 => format!("(floor {x} 3)"),
            8 => format!("(if {} {x} {y})", self.test()),
            9 => format!("(svref (vector {x} {y}) 1)"),
            10 => format!("(logand (floor {x}) 255)"),
            11 => format!("(f0 {x} {y})"),
            12 => format!("(o0 {x})"),
            13 => match self.below(12) {
                0 => format!("(o1 {x} {y} 3)"),
                1 => format!("(o1 {x})"),
                2 => format!("(o2 :of {x} :by {y})"),
                3 => format!("(o3 {x} {y})"),
                4 => format!("(o3 {x})"),
                5 | 6 => format!("(o4 #'{} {x} {y})", self.callee()),
                9 | 10 => format!("(r {x} {y} {})", self.below(8)),
                11 => format!("(q {x} {})", self.below(6)),
                7 => format!("(car (o5 #'{} {x} {y}))", self.callee()),
                _ => format!("(o0 {x} {y})"),
            },
            _ => format!("(g{} {x} {y})", self.below(SMALL)),
        }
    }
}
