//! Random programs are lowered, verified, and do what the tree says; so they do when everything is divided or
//! spilled.

use proptest::prelude::*;

use super::{generate, interpreter, model, module_of, notation, spilled_module_of};
use crate::core::{Core, LambdaId};
use crate::lower::split;
use esl_bytecode::disasm;
use esl_bytecode::module::Module;

/// Runs a program in both ways, if the model ends soon enough.
fn check(text: &str) {
    check_made(text, &|core, text| module_of(core, text));
}

/// The same, with the module that `make` makes of the program.
fn check_made(text: &str, make: &dyn Fn(&mut Core, &str) -> Module) {
    // The handler is outside of the function, so that the program itself is in tail position.
    let text = format!(
        "(progn (setq *a* 1) (setq *b* 2) (handler-case (apply (lambda () {text}) nil) (error (c) (note c))))"
    );
    let mut core = notation::core_in_big_stack(&text);
    let Some(expected) = model::run(&core, 20_000) else { return };
    let module = make(&mut core, &text);
    let found = std::panic::catch_unwind(|| interpreter::run(&module, 2_000_000));
    match found {
        Ok(found) if found.as_ref() == Some(&expected) => {}
        Ok(found) => panic!("expected {expected:?}\nfound {found:?}\n{text}\n{}", disasm::module(&module)),
        Err(_) => {
            panic!("the interpreter panics, expected {expected:?}\n{text}\n{}", disasm::module(&module))
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(ProptestConfig::default().cases * 2))]
    #[test]
    fn programs_do_what_the_tree_says(choices in proptest::collection::vec(any::<u8>(), 0..300)) {
        check(&generate::program(&choices));
    }

    #[test]
    fn divided_programs_do_the_same(choices in proptest::collection::vec(any::<u8>(), 0..300)) {
        check_made(&generate::program(&choices), &|core, text| {
            let all: Vec<LambdaId> = (0..core.lambdas.len()).map(|index| LambdaId(index as u32)).collect();
            split::split(core, &all, split::TINY);
            module_of(core, text)
        });
    }

    #[test]
    fn variables_on_the_heap_do_the_same(choices in proptest::collection::vec(any::<u8>(), 0..300)) {
        check_made(&generate::program(&choices), &|core, text| spilled_module_of(core, text));
    }
}

#[test]
fn values_that_change_while_others_are_computed() {
    for text in [
        "(labels ((f (k a b) (if (< 0 k) (f (- k 1) b (+ a b)) (list a b)))) (f 3 1 2))",
        "(labels ((f (k a b) (if (< 0 k) (f (- k 1) (lambda () (list a b)) a) (apply a nil)))) (f 3 1 2))",
        "(labels ((f (k a) (if (< 0 k) (f (- k 1) (progn (setq k 7) (note k) a)) (list k a)))) (f 1 2))",
        "(let ((a 1) (b 2)) (let ((c b) (d a)) (progn (setq a c) (setq b d) (list a b))))",
        "(let ((a 1)) (list a (setq a 2) a (+ a (setq a 3)) (+ (setq a 4) a)))",
        "(let ((a 1)) (let ((b a)) (setq a 2) (list a b)))",
        "(let ((a 1)) (+ a (progn (apply (lambda () (setq a 5)) nil) 1) a))",
        "(let ((f (lambda (x y) (list x y))) (a 1)) (funcall f a (progn (setq f 3) (setq a 4))))",
        "(let ((f (lambda (x) (note x)))) (funcall f 1))",
        "(let ((a '(1 2)) (b 2)) (let* ((x (cdr a))) (setq b (list b a)) (setq a x) nil) (list a b))",
        "(labels ((f (k a b) (let ((c a) (d k)) (if (< 0 k) (f (- k 1) b (list c d a)) (list a b c))))) (f 3 1 2))",
        "(labels ((f (k a) (let ((c a)) (if (< 0 k) (f (- k 1) (note (+ c k))) (note (f c a)))))) (if t 1 (f 3 1)))",
        "(let () (note 1) (let* () 2))",
        "(let ((f (lambda () 1))) (let ((g (lambda () (setq f (lambda (x) 2)) 3))) (setq f (lambda (x) 4)) (funcall f (apply g nil))))",
        "(let ((x (note 1))) (let ((y (note x))) (if (< y 2) (note 3) 4)))",
        "(let ((x (two 1))) x)",
        "(let* ((a 1) (x (two a)) (y (list x))) (values y))",
        "(let ((a 1)) (let ((x (setq a 2))) (+ x a)))",
    ] {
        check(text);
    }
}
