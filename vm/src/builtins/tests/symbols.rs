use super::{check, check_all};

#[test]
fn names_and_properties() {
    check_all(&[
        ("(symbol-name 'car)", "\"CAR\""),
        ("(symbol-name nil)", "\"NIL\""),
        ("(symbol-name 5)", "type-error 5 SYMBOL"),
        ("(package-name (symbol-package 'car))", "\"COMMON-LISP\""),
        ("(%put nil 'a 1)", "1"),
        ("(symbol-plist nil)", "(A 1)"),
        ("(get nil 'a)", "1"),
        ("(get nil 'b 'none)", "NONE"),
        ("(remprop nil 'a)", "T"),
        ("(remprop nil 'a)", "NIL"),
        ("(%set-symbol-plist t 5)", "type-error 5 LIST"),
    ]);
}

#[test]
fn values() {
    check_all(&[
        ("(boundp 'x)", "NIL"),
        ("(set 'x 5)", "5"),
        ("(symbol-value 'x)", "5"),
        ("(makunbound 'x)", "X"),
        ("(symbol-value 'x)", "unbound-variable X"),
        ("(symbol-value nil)", "NIL"),
        ("(set t 5)", "program-error: T is a constant and cannot be set"),
        ("(%define-constant 'k 5)", "K"),
        ("(%define-constant 'k 5)", "K"),
        ("(%define-constant 'k 6)", "program-error: K is a constant already, with the value 5"),
        ("(%constant-p 'k)", "T"),
        ("(%proclaim-special 'k)", "program-error: K is a constant and cannot be made a variable"),
        ("(%proclaim-special 'v)", "V"),
        ("(%special-p 'v)", "T"),
    ]);
}

#[test]
fn functions() {
    check_all(&[
        ("(fboundp 'car)", "T"),
        ("(fdefinition 'car)", "<Some(Function)>"),
        ("(%set-function 'first-of $1)", "FIRST-OF"),
        ("(%function-name (symbol-function 'first-of))", "CAR"),
        ("(%function-arity $1)", "1 ; 1"),
        ("(%function-arity (fdefinition 'list))", "0 ; NIL"),
        ("(%function-lambda-list $1)", "(LIST)"),
        ("(%function-documentation $1)", "\"The car of a pair, `NIL` of `NIL`.\""),
        ("(fmakunbound 'first-of)", "FIRST-OF"),
        ("(fboundp 'first-of)", "NIL"),
        ("(%function-cell 'car)", "CAR"),
        ("(%function-cell '(setf car))", "(SETF CAR)"),
        ("(%set-function $11 $1)", "(SETF CAR)"),
        ("(fboundp '(setf car))", "T"),
        ("(fboundp '(setf))", "type-error (SETF) (OR SYMBOL (CONS (EQL SETF) (CONS SYMBOL NULL)))"),
        ("(%set-macro 'first-of $1)", "FIRST-OF"),
        ("(macro-function 'first-of)", "<Some(Function)>"),
        ("(macro-function 'first-of '((first-of)))", "NIL"),
        ("(%set-function 'first-of 5)", "type-error 5 FUNCTION"),
    ]);
}

#[test]
fn fresh_symbols() {
    check_all(&[
        ("(make-symbol \"A\")", "A"),
        ("(symbol-package $0)", "NIL"),
        ("(gensym)", "G1"),
        ("(gensym \"X\")", "X2"),
        ("(gensym 7)", "G7"),
        ("(gensym)", "G3"),
        ("(gensym 'x)", "type-error X (OR STRING UNSIGNED-BYTE)"),
        ("(set '*gensym-counter* -1)", "-1"),
        ("(gensym)", "type-error -1 of *GENSYM-COUNTER* UNSIGNED-BYTE"),
    ]);
}

#[test]
fn packages() {
    check_all(&[
        ("(find-package \"CL\")", "<Some(Package)>"),
        ("(package-name $0)", "\"COMMON-LISP\""),
        ("(find-package \"NONE\")", "NIL"),
        ("(package-name \"NONE\")", "package-error: the package NONE does not exist"),
        ("(%make-package \"P\" '(\"PP\") '(\"CL\"))", "<Some(Package)>"),
        ("(package-nicknames 'p)", "(\"PP\")"),
        ("(package-use-list \"PP\")", "(<Some(Package)>)"),
        ("(intern \"FOO\" 'p)", "FOO ; NIL"),
        ("(intern \"FOO\" 'p)", "FOO ; INTERNAL"),
        ("(find-symbol \"CAR\" 'p)", "CAR ; INHERITED"),
        ("(find-symbol \"BAR\" 'p)", "NIL ; NIL"),
        ("(find-symbol \"NIL\" 'p)", "NIL ; INHERITED"),
        ("(%symbol-qualifier $7)", "\"P::\""),
        ("(export $7 'p)", "T"),
        ("(%symbol-qualifier $7)", "\"P:\""),
        ("(%external-symbols 'p)", "(FOO)"),
        ("(use-package 'p)", "T"),
        ("(%symbol-qualifier $7)", "NIL"),
        ("(shadow \"FOO\" \"COMMON-LISP\")", "program-error: the package `COMMON-LISP` cannot be changed"),
        ("(import $0 'p)", "type-error <Some(Package)> SYMBOL"),
        ("(%symbol-qualifier (make-symbol \"A\"))", "\"#:\""),
        ("(packagep $0)", "T"),
    ]);
}

#[test]
fn what_belongs_to_the_language_is_locked_once_it_is_sealed() {
    let mut vm = crate::vm::Vm::for_tests();
    assert_eq!(super::evaluate(&mut vm, "(%locked-p 'car)"), "NIL");
    vm.seal();
    assert_eq!(super::evaluate(&mut vm, "(%locked-p 'car)"), "T");
    let text = "program-error: CAR belongs to the language and cannot be redefined as a function";
    assert_eq!(super::evaluate(&mut vm, "(%set-function 'car (fdefinition 'cdr))"), text);
}

#[test]
fn structures() {
    check_all(&[
        ("(%make-class 'point nil '(x y) 'data)", "<Some(Class)>"),
        ("(%make-structure 'point 1 2)", "<Some(Structure)>"),
        ("(%slot 'point 1 $1)", "2"),
        ("(%slot 'point 2 $1)", "type-error <Some(Structure)> POINT"),
        ("(%slot 'point 0 5)", "type-error 5 POINT"),
        ("(%set-slot 'point 0 $1 7)", "7"),
        ("(%structure-ref $1 0)", "7"),
        ("(%structure-ref $1 2)", "type-error 2 index below 2"),
        ("(%structure-ref 5 0)", "type-error 5 STRUCTURE-OBJECT"),
        ("(copy-structure $1)", "<Some(Structure)>"),
        ("(%set-structure-ref $9 0 8)", "8"),
        ("(%structure-ref $1 0)", "7"),
        ("(%make-class 'point-3 '(point) '(x y z) nil)", "<Some(Class)>"),
        ("(%make-structure $12)", "<Some(Structure)>"),
        ("(%instance-p 'point $13)", "T"),
        ("(%instance-p 'point-3 $1)", "NIL"),
        ("(%subclass-p 'point-3 'point)", "T"),
        ("(%class-name (%class-of $13))", "POINT-3"),
        ("(%class-slots 'point-3)", "(X Y Z)"),
        ("(%class-data 'point)", "DATA"),
        ("(%make-structure 'point 1 2 3)", "program-error: POINT has 2 slots, but 3 values were given"),
        (
            "(%make-structure 'nowhere)",
            "program-error: the structure or condition type NOWHERE does not exist",
        ),
        ("(%find-class 'nowhere)", "NIL"),
        ("(%class-of 5)", "NIL"),
    ]);
    check("(%make-class 'a '(b) nil nil)", "program-error: the structure or condition type B does not exist");
}
