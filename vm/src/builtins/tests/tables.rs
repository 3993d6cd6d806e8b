use super::{check, check_all};

#[test]
fn tests_of_the_machine() {
    check_all(&[
        ("(%make-hash-table 1 0 nil nil)", "<Some(HashTable)>"),
        ("(%puthash \"a\" $0 1)", "1"),
        ("(gethash \"a\" $0)", "NIL ; NIL"),
        ("(%puthash 2^80 $0 'big)", "BIG"),
        ("(gethash 2^80 $0)", "BIG ; T"),
        ("(hash-table-count $0)", "2"),
        ("(gethash 1 $0 'default)", "DEFAULT ; NIL"),
        ("(remhash 2^80 $0)", "T"),
        ("(remhash 2^80 $0)", "NIL"),
        ("(%puthash nil $0 nil)", "NIL"),
        ("(gethash nil $0)", "NIL ; T"),
        ("(clrhash $0)", "<Some(HashTable)>"),
        ("(hash-table-count $0)", "0"),
        ("(%hash-table-test $0)", "1 ; NIL ; NIL"),
    ]);
    check_all(&[
        ("(%make-hash-table 2 0 nil nil)", "<Some(HashTable)>"),
        ("(%puthash (list 1 \"a\") $0 'x)", "X"),
        ("(gethash '(1 \"a\") $0)", "X ; T"),
        ("(gethash '(1 \"A\") $0)", "NIL ; NIL"),
    ]);
    check_all(&[
        ("(%make-hash-table 3 0 nil nil)", "<Some(HashTable)>"),
        ("(%puthash \"A\" $0 1)", "1"),
        ("(%puthash 1.0 $0 2)", "2"),
        ("(%puthash #(1 (2)) $0 3)", "3"),
        ("(gethash \"a\" $0)", "1 ; T"),
        ("(gethash 1 $0)", "2 ; T"),
        ("(gethash #(1.0 (2.0)) $0)", "3 ; T"),
        ("(gethash '#(#\\a) $0)", "1 ; T"),
    ]);
    check("(gethash 1 5)", "type-error 5 HASH-TABLE");
}

#[test]
fn iteration_is_in_the_order_of_insertion_and_allows_removal() {
    check_all(&[
        ("(%make-hash-table 1 0 nil nil)", "<Some(HashTable)>"),
        ("(list (%puthash 'a $0 1) (%puthash 'b $0 2) (%puthash 'c $0 3))", "(1 2 3)"),
        ("(%table-next $0 0)", "1 ; A ; 1"),
        ("(remhash 'b $0)", "T"),
        ("(%table-next $0 1)", "3 ; C ; 3"),
        ("(%table-next $0 3)", "NIL ; NIL ; NIL"),
        ("(%puthash 'd $0 4)", "4"),
        ("(%table-next $0 1)", "2 ; D ; 4"),
        ("(%table-skip $0 1)", "1"),
    ]);
}

#[test]
fn what_a_program_compares_is_left_to_the_twin() {
    check_all(&[
        ("(%make-hash-table 4 0 'test 'hash)", "<Some(HashTable)>"),
        ("(gethash 1 $0)", "slowly"),
        ("(%puthash 1 $0 2)", "slowly"),
        ("(%add-to-value 1 $0 0 1)", "slowly"),
        ("(remhash 1 $0)", "slowly"),
        ("(%table-add $0 7 'a 1 (%table-serial $0))", "T"),
        ("(%table-add $0 7 'b 2 (%table-serial $0))", "T"),
        ("(%table-serial $0)", "2"),
        ("(%table-add $0 8 'c 3 $7)", "T"),
        ("(%table-add $0 8 'd 4 $7)", "NIL"),
        ("(%table-candidates $0 7)", "((0 . A) (1 . B))"),
        ("(%table-candidates $0 2^100)", "NIL"),
        ("(%table-value $0 1 'b)", "2 ; T"),
        ("(%table-value $0 1 'a)", "NIL ; NIL"),
        ("(%set-table-value $0 0 'a 'x)", "T"),
        ("(%table-value $0 0 'a)", "X ; T"),
        ("(%table-delete $0 1 'a 7)", "NIL"),
        ("(%table-delete $0 1 'b 8)", "NIL"),
        ("(%table-delete $0 1 'b 7)", "T"),
        ("(%table-candidates $0 7)", "((0 . A))"),
        ("(hash-table-count $0)", "2"),
        ("(%hash-table-test $0)", "4 ; TEST ; HASH"),
    ]);
}

#[test]
fn keys_that_take_long_to_compare_are_left_to_the_twin() {
    check_all(&[
        ("(%make-list 4096 1)", "(1 1 1 1 1 1 1 1 ...)"),
        ("(list* 1 1 $0)", "(1 1 1 1 1 1 1 1 ...)"),
        ("(list* 1 1 $0)", "(1 1 1 1 1 1 1 1 ...)"),
        ("(%make-hash-table 2 0 nil nil)", "<Some(HashTable)>"),
        ("(%puthash $1 $3 'x)", "X"),
        ("(gethash $1 $3)", "X ; T"),
        // A tail in common needs no comparison.
        ("(gethash $2 $3)", "X ; T"),
        ("(list* 1 (%make-list 4096 1))", "(1 1 1 1 1 1 1 1 ...)"),
        ("(gethash $7 $3)", "slowly"),
    ]);
}
