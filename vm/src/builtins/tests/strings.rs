use super::check;

#[test]
fn comparison() {
    for (form, expected) in [
        ("(%string= \"abc\" \"abc\")", "T"),
        ("(%string= 'abc \"ABC\")", "T"),
        ("(%string= \"abc\" \"xbcx\" 1 nil 1 3)", "T"),
        ("(%string= \"abc\" \"abc\" 4)", "type-error (4) (CONS (INTEGER 0 3) (INTEGER 4 3))"),
        ("(%string= 5 \"a\")", "type-error 5 (OR STRING SYMBOL CHARACTER)"),
        ("(%string-equal \"aB\" \"Ab\")", "T"),
        ("(%string-compare \"abc\" \"abd\" nil nil nil nil nil)", "-1 ; 2"),
        ("(%string-compare \"abd\" \"abc\" nil nil nil nil nil)", "1 ; 2"),
        ("(%string-compare \"ab\" \"abc\" nil nil nil nil nil)", "-1 ; 2"),
        ("(%string-compare \"a\" \"a\" nil nil nil nil nil)", "0 ; 1"),
        ("(%string-compare \"xab\" \"AB\" 1 nil nil nil t)", "0 ; 3"),
        ("(equal \"ab\" \"AB\")", "NIL"),
        ("(equalp \"ab\" \"AB\")", "T"),
        ("(equalp \"ab\" #(#\\A #\\b))", "T"),
    ] {
        check(form, expected);
    }
}

#[test]
fn fresh_strings() {
    for (form, expected) in [
        ("(string 'a)", "\"A\""),
        ("(string nil)", "\"NIL\""),
        ("(string #\\a)", "\"a\""),
        ("(string 5)", "type-error 5 (OR STRING SYMBOL CHARACTER)"),
        ("(%make-string 3 #\\x)", "\"xxx\""),
        ("(%make-string 2 5)", "type-error 5 CHARACTER"),
        ("(%string-upcase \"aé\" nil nil)", "\"AÉ\""),
        ("(%string-upcase \"abcd\" 1 3)", "\"aBCd\""),
        ("(%string-downcase 'abc nil nil)", "\"abc\""),
        ("(%string-capitalize \"hello wORLD-foo 3com o'neill\" nil nil)", "\"Hello World-Foo 3com O'Neill\""),
        ("(%nstring-upcase (%make-string 2 #\\a) 1 nil)", "\"aA\""),
        ("(%nstring-upcase 'a nil nil)", "type-error A STRING"),
        ("(string-trim \" x\" \" xax \")", "\"a\""),
        ("(string-left-trim \"a\" \"aab\")", "\"b\""),
        ("(string-right-trim '(#\\a) \"abaa\")", "\"ab\""),
        ("(string-trim #(#\\A) 'abca)", "\"BC\""),
        ("(string-trim \"a\" \"aaa\")", "\"\""),
        ("(string-trim 5 \"abc\")", "type-error 5 SEQUENCE"),
        ("(%string-concat \"ab\" \"\" \"c\")", "\"abc\""),
        ("(%string-concat \"ab\" 'c)", "slowly"),
        ("(%search-string \"na\" \"banana\" 0 nil nil)", "2"),
        ("(%search-string \"na\" \"banana\" 0 nil t)", "4"),
        ("(%search-string \"na\" \"banana\" 0 5 t)", "2"),
        ("(%search-string \"x\" \"banana\" 0 nil nil)", "NIL"),
        ("(%search-string \"\" \"ab\" 1 nil nil)", "1"),
        ("(%search-string \"\" \"ab\" 0 nil t)", "2"),
        ("(char \"abc\" 1)", "#\\b"),
        ("(char \"abc\" 3)", "type-error 3 index below 3"),
        ("(char 'abc 0)", "type-error ABC STRING"),
        ("(%set-char (%make-string 1 #\\a) 0 #\\b)", "#\\b"),
        ("(%symbol-name-string \"FOO-BAR\" 2 t)", "\"Foo-Bar\""),
        ("(%symbol-name-string \"FOO\" 1 t)", "\"foo\""),
        ("(%symbol-name-string \"Foo\" 1 nil)", "\"foo\""),
        ("(%symbol-name-string \"Foo\" 0 t)", "\"|Foo|\""),
    ] {
        check(form, expected);
    }
}

#[test]
fn hashes_agree_with_equality() {
    for (left, right) in [
        ("1", "1"),
        ("2^80", "2^80"),
        ("2/3", "2/3"),
        ("1e300", "1e300"),
        ("\"abc\"", "\"abc\""),
        ("'(1 (2 \"x\") #\\a)", "'(1 (2 \"x\") #\\a)"),
        ("(%make-array '(4) \"abcd\" 2 nil)", "\"ab\""),
    ] {
        check(&format!("(equal {left} {right})"), "T");
        check(&format!("(= (sxhash {left}) (sxhash {right}))"), "T");
    }
}
