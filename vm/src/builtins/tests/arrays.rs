use super::{check, check_all};

#[test]
fn elements() {
    for (form, expected) in [
        ("(vector 1 2)", "#(1 2)"),
        ("(aref #(1 2) 1)", "2"),
        ("(aref #(1 2) 2)", "type-error 2 index below 2"),
        ("(aref #(1 2) 1.0)", "type-error 1.0 index below 2"),
        ("(aref '(1) 0)", "type-error (1) ARRAY"),
        ("(aref #(1 2) 0 0)", "error: wrong number of subscripts, 2, for an array of rank 1"),
        ("(aref \"abc\" 1)", "#\\b"),
        ("(svref \"abc\" 0)", "type-error \"abc\" SIMPLE-VECTOR"),
        ("(svref #(1) 3)", "type-error 3 index below 1"),
        ("(%set-aref (%make-string 2 #\\a) 0 5)", "type-error 5 CHARACTER"),
        ("(row-major-aref #(1 2) 1)", "2"),
        ("(array-dimensions #(1 2))", "(2)"),
        ("(array-dimensions 5)", "type-error 5 ARRAY"),
        ("(array-rank \"ab\")", "1"),
        ("(array-dimension #(1 2) 1)", "type-error 1 index below 1"),
        ("(array-in-bounds-p #(1 2) 2)", "NIL"),
        ("(array-in-bounds-p #(1 2) 1)", "T"),
        ("(fill-pointer #(1 2))", "type-error #(1 2) (AND VECTOR (SATISFIES ARRAY-HAS-FILL-POINTER-P))"),
        ("(%make-vector 2 'x)", "#(X X)"),
        ("(elt '(1 2) 5)", "type-error 5 index below 2"),
        ("(elt #(1 2) 2)", "type-error 2 index below 2"),
        ("(elt 5 0)", "type-error 5 SEQUENCE"),
        ("(elt '(1 2 . 3) 5)", "type-error 3 LIST"),
        ("(%set-elt (list 1 2) 1 'x)", "X"),
    ] {
        check(form, expected);
    }
}

#[test]
fn sequences() {
    for (form, expected) in [
        ("(length '(1 2))", "2"),
        ("(length \"abc\")", "3"),
        ("(length '(1 . 2))", "type-error 2 LIST"),
        ("(length 5)", "type-error 5 SEQUENCE"),
        ("(reverse '(1 2 3))", "(3 2 1)"),
        ("(reverse #(1 2 3))", "#(3 2 1)"),
        ("(reverse \"abc\")", "\"cba\""),
        ("(reverse '(1 . 2))", "type-error 2 LIST"),
        ("(nreverse (list 1 2 3))", "(3 2 1)"),
        ("(nreverse (vector 1 2 3 4))", "#(4 3 2 1)"),
        ("(subseq '(1 2 3) 1)", "(2 3)"),
        ("(subseq '(1 2 3) 1 2)", "(2)"),
        ("(subseq \"abc\" 1 1)", "\"\""),
        ("(subseq \"abc\" 2 9)", "type-error (2 . 9) (CONS (INTEGER 0 3) (INTEGER 2 3))"),
        ("(subseq '(1 2 3) 2 1)", "type-error (2 . 1) (CONS (INTEGER 0 3) (INTEGER 2 3))"),
        ("(subseq '(1 2 3) 4)", "type-error (4) (CONS (INTEGER 0 3) (INTEGER 4 3))"),
        ("(copy-seq #(1 2))", "#(1 2)"),
        ("(copy-seq 5)", "type-error 5 SEQUENCE"),
        ("(%fill (vector 1 2 3) 'x 1 nil)", "#(1 X X)"),
        ("(%replace (vector 1 2 3 4) #(8 9) 1 nil 0 nil)", "#(1 8 9 4)"),
        ("(%replace (vector 1 2) \"ab\" 0 nil 0 nil)", "#(#\\a #\\b)"),
        ("(%replace (%make-string 2 #\\x) #(1) 0 nil 0 nil)", "type-error 1 CHARACTER"),
        ("(%list-vector '(1 2))", "#(1 2)"),
        ("(%list-string '(#\\a #\\b))", "\"ab\""),
        ("(%list-string '(1))", "type-error 1 CHARACTER"),
        ("(%vector-list \"abc\" 1 nil)", "(#\\b #\\c)"),
        ("(%position-eql #\\a \"banana\" 0 nil t)", "5"),
        ("(%position-eql #\\a \"banana\" 2 nil nil)", "3"),
        ("(%position-eql 2 '(1 2 2) 0 nil nil)", "1"),
        ("(%position-eql 2 '(1 2 2) 0 nil t)", "2"),
        ("(%position-eql 5 #(1 2) 0 nil nil)", "NIL"),
        ("(%position-equal \"b\" #(\"a\" \"b\") 0 nil nil)", "1"),
        ("(%count-eql 1 #(1 2 1) 0 nil)", "2"),
        ("(%count-eql 1 '(1 2 1) 1 nil)", "1"),
    ] {
        check(form, expected);
    }
    check_all(&[
        ("(vector 1 2 3 4 5)", "#(1 2 3 4 5)"),
        ("(%replace $0 $0 1 nil 0 4)", "#(1 1 2 3 4)"),
        ("(%replace $0 $0 0 nil 1 nil)", "#(1 2 3 4 4)"),
    ]);
}

#[test]
fn fill_pointers_bound_sequences_but_not_aref() {
    check_all(&[
        ("(%make-array '(3) (vector 1 2 3) 2 nil)", "#(1 2)"),
        ("(length $0)", "2"),
        ("(aref $0 2)", "3"),
        ("(elt $0 2)", "type-error 2 index below 2"),
        ("(array-total-size $0)", "3"),
        ("(vector-push 'a $0)", "2"),
        ("(vector-push 'b $0)", "NIL"),
        ("(vector-push-extend 'c $0)", "3"),
        ("(array-total-size $0)", "6"),
        ("(vector-push-extend 'd $0 1)", "4"),
        ("(identity $0)", "#(1 2 A C D)"),
        ("(vector-pop $0)", "D"),
        ("(%set-fill-pointer $0 0)", "0"),
        ("(vector-pop $0)", "error: the vector is empty, so nothing can be popped"),
        ("(%set-fill-pointer $0 7)", "type-error 7 index below 7"),
        ("(array-has-fill-pointer-p $0)", "T"),
        ("(adjustable-array-p $0)", "NIL"),
        ("(reverse $0)", "#()"),
    ]);
    check_all(&[
        ("(%make-array '(2) (%make-string 2 #\\x) 0 t)", "\"\""),
        ("(vector-push-extend #\\a $0)", "0"),
        ("(vector-push-extend #\\b $0)", "1"),
        ("(vector-push-extend #\\c $0)", "2"),
        ("(stringp $0)", "T"),
        ("(simple-string-p $0)", "NIL"),
        ("(equal $0 \"abc\")", "T"),
        ("(%string= $0 \"abc\")", "T"),
        ("(vector-push-extend 5 $0)", "type-error 5 CHARACTER"),
        ("(char $0 3)", "#\\Nul"),
        ("(%string-upcase $0 nil nil)", "\"ABC\""),
    ]);
}

#[test]
fn arrays_of_several_dimensions() {
    check_all(&[
        ("(%make-array '(2 3) (vector 1 2 3 4 5 6) nil nil)", "<Some(Array)>"),
        ("(aref $0 1 2)", "6"),
        ("(aref $0 2 0)", "type-error 2 index below 2"),
        ("(aref $0 0)", "error: wrong number of subscripts, 1, for an array of rank 2"),
        ("(%set-aref $0 0 1 'x)", "X"),
        ("(row-major-aref $0 1)", "X"),
        ("(array-row-major-index $0 1 0)", "3"),
        ("(array-dimensions $0)", "(2 3)"),
        ("(array-rank $0)", "2"),
        ("(%array-data $0)", "#(1 X 3 4 5 6)"),
        ("(vectorp $0)", "NIL"),
        ("(length $0)", "type-error <Some(Array)> SEQUENCE"),
        ("(%adjust-array $0 '(1 2) (vector 'a 'b) nil)", "<Some(Array)>"),
        ("(aref $0 0 1)", "B"),
        (
            "(%make-array '(2 2) (vector 1) nil nil)",
            "error: the dimensions do not suit the number of elements",
        ),
        ("(%make-array '(2 2) (vector 1 2 3 4) 1 nil)", "error: only vectors can have fill pointers"),
        ("(%make-array nil (vector 5) nil nil)", "<Some(Array)>"),
        ("(aref $16)", "5"),
    ]);
}
