use super::{check, check_all, evaluate};
use crate::vm::Vm;

#[test]
fn functions_of_any_number_of_arguments() {
    for (form, expected) in [
        ("(+)", "0"),
        ("(*)", "1"),
        ("(+ 1/2 1/2)", "1"),
        ("(+ 1 2.5 1/2)", "4.0"),
        ("(- 5)", "-5"),
        ("(- 10 1 2)", "7"),
        ("(/ 2)", "1/2"),
        ("(/ 12 2 3)", "2"),
        ("(* 2 0.1)", "0.2"),
        ("(- 0.0)", "-0.0"),
        ("(+ 'a)", "type-error A NUMBER"),
        ("(+ 1 'a)", "type-error A NUMBER"),
        ("(max 1 2.0)", "2.0"),
        ("(max 1.0 2)", "2"),
        ("(max 1 1.0)", "1"),
        ("(min 1.0 1)", "1.0"),
        ("(max 'a)", "type-error A REAL"),
        ("(< 1 2 3)", "T"),
        ("(< 1 3 2)", "NIL"),
        ("(< 1 0 'a)", "type-error A REAL"),
        ("(>= 3 3 2)", "T"),
        ("(/= 1 2 1)", "NIL"),
        ("(/= 1 2 3)", "T"),
        ("(= 1 1.0 1)", "T"),
        ("(= 1 'a)", "type-error A NUMBER"),
        ("(1+ 1/2)", "3/2"),
        ("(1- 2^62)", "4611686018427387903"),
        ("(logand)", "-1"),
        ("(logior 5 -8)", "-3"),
        ("(logxor 1 2 4)", "7"),
        ("(logeqv)", "-1"),
        ("(logeqv 5)", "5"),
        ("(logeqv 5 3)", "-7"),
        ("(gcd)", "0"),
        ("(gcd 12 -18)", "6"),
        ("(lcm)", "1"),
        ("(lcm 4 6)", "12"),
        ("(lcm 4 0 6)", "0"),
        ("(gcd 1.0 2)", "type-error 1.0 INTEGER"),
    ] {
        check(form, expected);
    }
}

#[test]
fn functions_of_one_number() {
    for (form, expected) in [
        ("(zerop -0.0)", "T"),
        ("(minusp -0.0)", "NIL"),
        ("(plusp 1/2)", "T"),
        ("(plusp 'a)", "type-error A REAL"),
        ("(zerop 'a)", "type-error A NUMBER"),
        ("(abs -1/2)", "1/2"),
        ("(abs -0.0)", "0.0"),
        ("(signum -2.5)", "-1.0"),
        ("(signum -0.0)", "-0.0"),
        ("(signum -2/3)", "-1"),
        ("(evenp 0)", "T"),
        ("(oddp 2^70)", "NIL"),
        ("(evenp 1.0)", "type-error 1.0 INTEGER"),
        ("(numerator 6/4)", "3"),
        ("(denominator 5)", "1"),
        ("(rational 0.5)", "1/2"),
        ("(rational 0.1)", "3602879701896397/36028797018963968"),
        ("(rationalize 0.1)", "1/10"),
        ("(rationalize -2.75)", "-11/4"),
        ("(float 1/3)", "0.3333333333333333"),
        ("(float 1.5 2)", "type-error 2 FLOAT"),
        ("(sqrt 16)", "4.0"),
        ("(sqrt -1)", "slowly"),
        ("(isqrt 17)", "4"),
        ("(isqrt 2^201)", "1792728671193156477399422023278"),
        ("(isqrt -1)", "type-error -1 UNSIGNED-BYTE"),
        ("(exp 0)", "1.0"),
        ("(exp 1000)", "floating-point-overflow"),
        ("(log 8 2)", "3.0"),
        ("(log 1000 10)", "3.0"),
        ("(log 2^2000)", "1386.2943611198907"),
        ("(log 0)", "division-by-zero"),
        ("(log -1)", "slowly"),
        ("(atan 1 -1)", "2.356194490192345"),
        ("(acos 2)", "slowly"),
        ("(integer-length -8)", "3"),
        ("(logcount -1)", "0"),
        ("(lognot 5)", "-6"),
    ] {
        check(form, expected);
    }
}

#[test]
fn powers() {
    for (form, expected) in [
        ("(expt 2 100)", "1267650600228229401496703205376"),
        ("(expt 2 -2)", "1/4"),
        ("(expt 0 0)", "1"),
        ("(expt 0 -1)", "division-by-zero"),
        ("(expt -2 3)", "-8"),
        ("(expt -1 2^100)", "1"),
        ("(expt 2/3 -3)", "27/8"),
        ("(expt 2.0 3)", "8.0"),
        ("(expt 4 1/2)", "2.0"),
        ("(expt -8 1/3)", "slowly"),
        ("(expt 10.0 400)", "floating-point-overflow"),
        ("(expt 2 2^70)", "arithmetic-error"),
        ("(integer-length (expt 2 4000000))", "4000001"),
        ("(expt 2 4194304)", "arithmetic-error"),
        ("(expt 10 100000)", "slowly"),
        ("(expt 'a 2)", "type-error A NUMBER"),
    ] {
        check(form, expected);
    }
}

#[test]
fn division_and_bits() {
    for (form, expected) in [
        ("(floor -7 2)", "-4 ; 1"),
        ("(round 5 2)", "2 ; 1"),
        ("(truncate 7.5)", "7 ; 0.5"),
        ("(ceiling 7/2)", "4 ; -1/2"),
        ("(ffloor 7 2)", "3.0 ; 1"),
        ("(mod -7 2)", "1"),
        ("(rem -7 2)", "-1"),
        ("(mod 1 0)", "division-by-zero"),
        ("(floor 'a)", "type-error A REAL"),
        ("(ash -5 -1)", "-3"),
        ("(ash 1 70)", "1180591620717411303424"),
        ("(ash 0 2^100)", "0"),
        ("(ash 1 2^100)", "arithmetic-error"),
        ("(ash -5 (- 2^100))", "-1"),
        ("(logbitp 70 -1)", "T"),
        ("(logbitp -1 5)", "type-error -1 UNSIGNED-BYTE"),
        ("(logtest 5 2)", "NIL"),
        ("(%ldb 8 4 43981)", "188"),
        ("(%ldb 100 4 -1)", "1267650600228229401496703205375"),
        ("(%dpb 15 4 4 0)", "240"),
        ("(%dpb 0 4 4 -1)", "-241"),
    ] {
        check(form, expected);
    }
}

#[test]
fn parts_of_floats() {
    for (form, expected) in [
        ("(decode-float -1.5)", "0.75 ; 1 ; -1.0"),
        ("(decode-float 0.0)", "0.0 ; 0 ; 1.0"),
        ("(integer-decode-float 1.5)", "6755399441055744 ; -52 ; 1"),
        ("(integer-decode-float -0.0)", "0 ; 0 ; -1"),
        ("(scale-float 1.5 2)", "6.0"),
        ("(scale-float 1.0 5000)", "floating-point-overflow"),
        ("(float-sign -1.0 2.5)", "-2.5"),
        ("(float-precision 0.0)", "0"),
        ("(float-digits 1)", "type-error 1 FLOAT"),
    ] {
        check(form, expected);
    }
}

#[test]
fn numbers_as_text() {
    for (form, expected) in [
        ("(%integer-string -255 16)", "\"-FF\""),
        ("(%integer-string 2^100 10)", "\"1267650600228229401496703205376\""),
        ("(%integer-string 5 37)", "type-error 37 (INTEGER 2 36)"),
        ("(%integer-string 2^100000 10)", "slowly"),
        ("(%float-string 1e7)", "\"1.0e7\""),
        ("(%float-string 9999999.0)", "\"9999999.0\""),
        ("(%float-string 0.001)", "\"0.001\""),
        ("(%float-string 0.0001)", "\"1.0e-4\""),
        ("(%float-string -0.0)", "\"-0.0\""),
        ("(%float-string 1e22)", "\"1.0e22\""),
        ("(%float-digits 3.14159)", "1 ; \"314159\""),
        ("(%float-digits 3.14159 -2)", "1 ; \"314\""),
        ("(%float-digits 0.25 -1)", "0 ; \"3\""),
        ("(%float-digits 99.99 -1)", "3 ; \"1\""),
        ("(%parse-integer \" 42 \" nil nil 10 nil)", "42 ; 4"),
        ("(%parse-integer \"12x\" nil nil 10 t)", "12 ; 2"),
        ("(%parse-integer \"ff\" nil nil 16 nil)", "255 ; 2"),
        ("(%parse-integer \"xx-7yy\" 2 4 10 nil)", "-7 ; 4"),
        ("(%parse-integer \"4 2\" nil nil 10 nil)", "parse-error: junk in string \"4 2\""),
        ("(%parse-integer \"\" nil nil 10 nil)", "parse-error: no digits in string \"\""),
        ("(%parse-integer \"\" nil nil 10 t)", "NIL ; 0"),
        ("(%parse-integer \" - 12\" nil nil 10 t)", "NIL ; 2"),
        ("(%parse-integer \"12\" 3 nil 10 nil)", "type-error (3) (CONS (INTEGER 0 2) (INTEGER 3 2))"),
        (
            "(%parse-integer \"123456789012345678901234567890\" nil nil 10 nil)",
            "123456789012345678901234567890 ; 30",
        ),
    ] {
        check(form, expected);
    }
}

#[test]
fn large_numbers_are_left_to_the_twin_or_refused() {
    for (form, expected) in [
        ("(* 2^2000000 2^2000000)", "slowly"),
        ("(* 2^4000000 2^4000000)", "arithmetic-error"),
        ("(/ (1+ 2^60000) (1+ 2^59999))", "slowly"),
        ("(floor 2^2000000 (1+ 2^1000000))", "slowly"),
        ("(gcd (1+ 2^100000) (1+ 2^90000))", "slowly"),
        ("(isqrt 2^100000)", "slowly"),
        ("(= 2^4000000 2^4000000)", "T"),
        ("(< 2^3999999 2^4000000)", "T"),
        ("(logand 2^4000000 (1- 2^4000000))", "0"),
    ] {
        check(form, expected);
    }
    // Steps of reduction end at the divisor.
    check("(%gcd-step 12 18)", "6 ; 0");
    let mut vm = Vm::for_tests();
    let form = "(* 2^64 (%gcd-step (* 2^100 3) (* 2^90 9)))";
    assert_eq!(evaluate(&mut vm, form), evaluate(&mut vm, "(* 2^154 3)"));
}

#[test]
fn random_numbers_come_from_the_state_alone() {
    check_all(&[
        ("(%make-random-state 42)", "<Some(RandomState)>"),
        ("(%make-random-state $0)", "<Some(RandomState)>"),
        ("(eql (%random 2^100 $0) (%random 2^100 $1))", "T"),
        ("(= (%random 1.0 $0) (%random 1.0 $1))", "T"),
        ("(eql (%random 2^60 $0) (%random 2^60 $0))", "NIL"),
        ("(random-state-p $0)", "T"),
        ("(%random 0 $0)", "type-error 0 (OR (INTEGER 1) (FLOAT (0)))"),
        ("(%random 1/2 $0)", "type-error 1/2 (OR (INTEGER 1) (FLOAT (0)))"),
        ("(%random 5 6)", "type-error 6 RANDOM-STATE"),
    ]);
    let mut vm = Vm::for_tests();
    for _ in 0..200 {
        let drawn = evaluate(&mut vm, "(%random 3 (%make-random-state nil))");
        assert!(["0", "1", "2"].contains(&drawn.as_str()));
    }
}
