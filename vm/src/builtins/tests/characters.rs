use super::check;

#[test]
fn classes_and_case() {
    for (form, expected) in [
        ("(char-code #\\a)", "97"),
        ("(char-code 5)", "type-error 5 CHARACTER"),
        ("(code-char 955)", "#\\λ"),
        ("(code-char 1114112)", "type-error 1114112 index below 1114112"),
        ("(char-upcase #\\a)", "#\\A"),
        ("(char-upcase #\\ß)", "#\\ß"),
        ("(char-downcase #\\É)", "#\\é"),
        ("(both-case-p #\\1)", "NIL"),
        ("(upper-case-p #\\A)", "T"),
        ("(alpha-char-p #\\1)", "NIL"),
        ("(alphanumericp #\\_)", "NIL"),
        ("(graphic-char-p #\\Newline)", "NIL"),
        ("(standard-char-p #\\é)", "NIL"),
        ("(digit-char-p #\\7 8)", "7"),
        ("(digit-char-p #\\8 8)", "NIL"),
        ("(digit-char-p #\\a 16)", "10"),
        ("(digit-char-p #\\a 37)", "type-error 37 (INTEGER 2 36)"),
        ("(digit-char 11 16)", "#\\B"),
        ("(digit-char 10)", "NIL"),
        ("(digit-char -1)", "type-error -1 UNSIGNED-BYTE"),
        ("(char-name #\\Space)", "\"Space\""),
        ("(char-name #\\a)", "NIL"),
        ("(name-char \"newline\")", "#\\Newline"),
        ("(name-char 'tab)", "#\\Tab"),
        ("(name-char \"foo\")", "NIL"),
        ("(character 'a)", "#\\A"),
        ("(character \"ab\")", "type-error \"ab\" (OR CHARACTER (STRING 1))"),
        ("(%character-escaped #\\a)", "\"#\\\\a\""),
        ("(%character-escaped #\\Newline)", "\"#\\\\Newline\""),
        ("(%character-escaped #\\Space)", "\"#\\\\ \""),
    ] {
        check(form, expected);
    }
}

#[test]
fn comparison() {
    for (form, expected) in [
        ("(char< #\\a #\\b #\\c)", "T"),
        ("(char< #\\b #\\a 5)", "type-error 5 CHARACTER"),
        ("(char/= #\\a #\\b #\\a)", "NIL"),
        ("(char/= #\\a #\\b #\\c)", "T"),
        ("(char-equal #\\a #\\A)", "T"),
        ("(char-not-equal #\\a #\\A)", "NIL"),
        ("(char-lessp #\\a #\\B)", "T"),
        ("(char>= #\\b #\\b #\\a)", "T"),
    ] {
        check(form, expected);
    }
}
