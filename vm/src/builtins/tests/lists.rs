use super::{check, check_all};

#[test]
fn parts_and_joins() {
    for (form, expected) in [
        ("(car nil)", "NIL"),
        ("(car 5)", "type-error 5 LIST"),
        ("(cdr '(1 . 2))", "2"),
        ("(caddr '(1 2 3))", "3"),
        ("(cdadr '(1 (2 3)))", "(3)"),
        ("(caar '(1))", "type-error 1 LIST"),
        ("(third '(1 . 2))", "type-error 2 LIST"),
        ("(tenth '(1 2 3 4 5 6 7 8 9 10))", "10"),
        ("(rplaca nil 1)", "type-error NIL CONS"),
        ("(endp nil)", "T"),
        ("(endp 5)", "type-error 5 LIST"),
        ("(nth 9 '(1))", "NIL"),
        ("(nth 1 '(1 . 2))", "type-error 2 LIST"),
        ("(nth -1 '(1))", "type-error -1 UNSIGNED-BYTE"),
        ("(nthcdr 1 '(1 . 2))", "2"),
        ("(nthcdr 2^100 '(1))", "NIL"),
        ("(last '(1 2 . 3))", "(2 . 3)"),
        ("(last '(1 2 3) 0)", "NIL"),
        ("(last '(1 2 3) 2)", "(2 3)"),
        ("(last '(1 2 . 3) 0)", "3"),
        ("(last 5)", "type-error 5 LIST"),
        ("(butlast '(1 2 . 3))", "(1)"),
        ("(butlast '(1 2 3) 5)", "NIL"),
        ("(nbutlast (list 1 2 3))", "(1 2)"),
        ("(list* 1 2 '(3))", "(1 2 3)"),
        ("(list* 1)", "1"),
        ("(%make-list 3 'a)", "(A A A)"),
        ("(acons 1 2 5)", "((1 . 2) . 5)"),
        ("(append)", "NIL"),
        ("(append nil 1)", "1"),
        ("(append '(1) 2)", "(1 . 2)"),
        ("(append '(1) '(2) nil)", "(1 2)"),
        ("(append '(1 . 2) '(3))", "type-error 2 LIST"),
        ("(nconc)", "NIL"),
        ("(nconc nil (list 1) nil (list 2))", "(1 2)"),
        ("(nconc (list 1) 2)", "(1 . 2)"),
        ("(nconc (list* 1 2) (list 3))", "(1 3)"),
        ("(nconc 1 (list 1))", "type-error 1 LIST"),
        ("(revappend '(1 2) '(3))", "(2 1 3)"),
        ("(nreconc (list 1 2) 3)", "(2 1 . 3)"),
        ("(copy-list '(1 2 . 3))", "(1 2 . 3)"),
        ("(copy-alist '(1 (2 . 3) nil))", "(1 (2 . 3) NIL)"),
        ("(copy-tree '(1 (2 (3 . 4)) . 5))", "(1 (2 (3 . 4)) . 5)"),
        ("(copy-tree 5)", "5"),
        ("(ldiff '(1 2 3) nil)", "(1 2 3)"),
        ("(ldiff '(1 2 . 3) 3)", "(1 2)"),
        ("(tailp nil '(1))", "T"),
        ("(tailp 2 '(1 . 2))", "T"),
        ("(pairlis '(a b) '(1 2) '((c . 3)))", "((B . 2) (A . 1) (C . 3))"),
        ("(pairlis '(1 2) '(3))", "error: the lists of keys and data differ in length"),
    ] {
        check(form, expected);
    }
}

#[test]
fn copies_share_nothing_they_should_not() {
    check_all(&[
        ("(list 1 (list 2) 3)", "(1 (2) 3)"),
        ("(copy-list $0)", "(1 (2) 3)"),
        ("(copy-tree $0)", "(1 (2) 3)"),
        ("(%set-car (cadr $0) 'x)", "X"),
        ("(values $0 $1 $2)", "(1 (X) 3) ; (1 (X) 3) ; (1 (2) 3)"),
        ("(cddr $0)", "(3)"),
        ("(tailp $5 $0)", "T"),
        ("(ldiff $0 $5)", "(1 (X))"),
        ("(append $0 $5)", "(1 (X) 3 3)"),
        ("(eq (cdddr $8) $5)", "T"),
    ]);
}

#[test]
fn searches() {
    for (form, expected) in [
        ("(%member-eql 2 '(1 2 3))", "(2 3)"),
        ("(%member-eql 2.0 '(1 2 3))", "NIL"),
        ("(%member-equal \"b\" '(\"a\" \"b\"))", "(\"b\")"),
        ("(%member-eql 1 5)", "type-error 5 LIST"),
        ("(%member-eql 1 '(2 . 3))", "type-error 3 LIST"),
        ("(%assoc-eql 'b '((a . 1) nil (b . 2)))", "(B . 2)"),
        ("(%assoc-eql 1 '(2))", "type-error 2 LIST"),
        ("(%assoc-equal '(1) '(((1) . x)))", "((1) . X)"),
        ("(%rassoc-eql 2 '((a . 1) (b . 2)))", "(B . 2)"),
        ("(%adjoin-eql 2 '(1 2))", "(1 2)"),
        ("(%adjoin-eql 3 '(1 2))", "(3 1 2)"),
        ("(getf '(a 1 b 2) 'b)", "2"),
        ("(getf '(a nil) 'a 'd)", "NIL"),
        ("(getf nil 'a 'd)", "D"),
        ("(getf '(b) 'a)", "type-error NIL CONS"),
        ("(%putf (list 'a 1) 'a 2)", "(A 2)"),
        ("(%putf (list 'a 1) 'b 2)", "(B 2 A 1)"),
        ("(%remf (list 'a 1 'b 2) 'a)", "(B 2) ; T"),
        ("(%remf (list 'a 1 'b 2 'c 3) 'b)", "(A 1 C 3) ; T"),
        ("(%remf (list 'a 1) 'b)", "(A 1) ; NIL"),
        ("(get-properties '(a 1 b 2) '(c b))", "B ; 2 ; (B 2)"),
        ("(get-properties '(a 1) '(c))", "NIL ; NIL ; NIL"),
        ("(%remove-eql 1 '(1 2 1 3))", "(2 3)"),
    ] {
        check(form, expected);
    }
}

#[test]
fn circular_and_long_lists_are_left_to_the_twin() {
    for form in [
        "(length $2)",
        "(list-length $2)",
        "(nth 100000 $2)",
        "(last $2)",
        "(copy-list $2)",
        "(append $2 nil)",
        "(reverse $2)",
        "(nreverse $2)",
        "(%member-eql 5 $2)",
        "(getf $2 5)",
        "(copy-tree $2)",
        "(equal $2 $5)",
        "(nconc $2 nil)",
        "(%list-vector $2)",
        "(subseq $2 0)",
        "(%position-eql 7 $2 0 nil nil)",
        "(butlast $2)",
    ] {
        check_all(
            &[
                ("(list 1 1)", "(1 1)"),
                ("(last $0)", "(1)"),
                ("(nconc $1 $0)", "slowly"),
                ("(%set-cdr $1 $0)", "slowly"),
            ][..2],
        );
        let mut vm = crate::vm::Vm::for_tests();
        let circle = |vm: &mut crate::vm::Vm| {
            let end = vm.heap.cons(crate::value::Value::small(1), crate::value::Value::NIL).unwrap();
            let start = vm.heap.cons(crate::value::Value::small(1), end).unwrap();
            vm.heap.set_cdr(end, start);
            start
        };
        let nil = crate::value::Value::NIL;
        let earlier = [nil, nil, circle(&mut vm), nil, nil, circle(&mut vm)];
        let result = super::Evaluator { vm: &mut vm, earlier: &earlier }.run(form);
        assert_eq!(result, Err(crate::raise::Exit::Slowly), "{form}");
        // Nothing has happened to the list.
        let ring = earlier[2];
        let next = vm.heap.cdr(ring).unwrap();
        assert_eq!(vm.heap.cdr(next), Some(ring), "{form}");
    }
    check("(length (%make-list 4096 1))", "4096");
    check("(length (cons 1 (%make-list 4096 1)))", "slowly");
    check("(%make-list 5000 1)", "slowly");
}
