//! Bytes and vectors of numbers between Rust and a program.

use std::time::Instant;

use esl::data::Bytes;
use esl::{Data, Engine};

fn engine() -> Engine {
    let mut engine = Engine::new().expect("there is room");
    let define = |engine: &mut Engine, name: &str, data: Data| {
        engine.define(name, "()", "Data.", move |_| Ok(data.clone())).expect("it is a name");
    };
    let scan: Vec<f64> = (0..1080).map(|n| f64::from(n) / 8.0).collect();
    define(&mut engine, "SCAN", Data::from(&scan[..]));
    define(&mut engine, "SCAN-IN-PARTS", Data::Vector(scan.iter().copied().map(Data::Float).collect()));
    define(&mut engine, "IMAGE", Data::bytes(vec![200; 1_000_000]));
    define(&mut engine, "IMAGE-AS-TEXT", Data::String("\u{c8}".repeat(1_000_000)));
    engine.define("SAME", "(data)", "The data.", |call| call.get::<Data>("data")).expect("it is a name");
    engine
        .define("SUM", "(image)", "The sum of bytes.", |call| {
            let image: Bytes = call.get("image")?;
            Ok(image.iter().map(|&byte| i64::from(byte)).sum::<i64>())
        })
        .expect("it is a name");
    engine
        .define("SUM-OF-TEXT", "(image)", "The sum of codes.", |call| {
            let image: String = call.get("image")?;
            Ok(image.chars().map(|code| i64::from(u32::from(code))).sum::<i64>())
        })
        .expect("it is a name");
    engine
        .define("LENGTH-OF", "(scan)", "The number of floats.", |call| {
            Ok(call.get::<Vec<f64>>("scan")?.len() as i64)
        })
        .expect("it is a name");
    engine
}

#[test]
fn vectors_of_numbers_cross_the_border_as_wholes() {
    let mut engine = engine();
    let mut eval = |text: &str| engine.eval(text).map(|data| data.to_string()).map_err(|e| e.to_string());
    let mut check = |text: &str, expected: &str| assert_eq!(eval(text).as_deref(), Ok(expected), "{text}");
    check("(let ((scan (scan))) (list (length scan) (aref scan 8) (length-of scan)))", "(1080 1.0 1080)");
    check("(equalp (scan) (scan-in-parts))", "T");
    check("(list (sum (image)) (type-of (image)))", "(200000000 (SIMPLE-ARRAY (UNSIGNED-BYTE 8) (1000000)))");
    check("(sum #(1 2 255))", "258");
    check("(handler-case (sum #(1 256)) (type-error () 'refused))", "REFUSED");
    let bytes = "(make-array 2 :element-type '(unsigned-byte 8) :initial-contents '(0 255))";
    check(&format!("(let ((b {bytes})) (list b (equalp b (same b)) (eq b (same b))))"), "(#(0 255) T NIL)");
    check(
        "(same (list #(1.5 -0.0) #(1 2.0) #() #(1.5 1e300 -1e-300) (list (vector (vector 0.5)))))",
        "(#(1.5 -0.0) #(1 2.0) #() #(1.5 1e300 -1e-300) (#(#(0.5))))",
    );
    check(
        "(same (make-array 3 :element-type '(unsigned-byte 8) :fill-pointer 2 :initial-element 9))",
        "#(9 9)",
    );
    check("(list (sum #*101) (sum (make-array 5 :fill-pointer 2 :initial-element 200)))", "(2 400)");
    check("(same (make-array 3 :fill-pointer 2 :initial-element :x))", "#(:X :X)");
    let text = "(make-array 3 :element-type 'character :fill-pointer 2 :initial-element #\\a)";
    check(&format!("(list (same {text}) (same (list {text})))"), "(\"aa\" (\"aa\"))");
    check("(same (list (make-array 3 :adjustable t :initial-element '(a)) #()))", "(#((A) (A) (A)) #())");
    assert_eq!(engine.eval(bytes).expect("it is evaluated"), Data::bytes(vec![0, 255]));
    assert_eq!(engine.eval("(vector 0.5 2.0)").expect("it is evaluated"), Data::floats([0.5, 2.0]));
    let numbers = Data::Vector(vec![Data::Integer(1), Data::Float(2.0)]);
    assert_eq!(engine.eval("(vector 1 2.0)").expect("it is evaluated"), numbers);
}

/// A call is charged for what crosses, so that a program that moves much is preempted and bounded.
#[test]
fn what_crosses_is_charged_by_its_length() {
    let mut engine = engine();
    let mut ticks = |text: &str| {
        let before = engine.ticks();
        engine.eval(text).expect("it is evaluated");
        engine.ticks() - before
    };
    ticks("(progn (image) (scan) (same 1))");
    let mut calls = |form: &str| ticks(&format!("(dotimes (i 100) {form})"));
    let (nothing, image, scan) = (calls("(same 1)"), calls("(image)"), calls("(scan)"));
    assert!(image > nothing + 100 * 1_000_000 / 130, "{image} ticks for images, {nothing} for nothing");
    assert!(scan > nothing + 100 * 1080 / 18, "{scan} ticks for scans, {nothing} for nothing");
}

/// The figures of `docs/design/0014-one-row-for-a-function-of-the-host.md`.
#[test]
#[ignore = "prints figures, which depend on the machine: --ignored --nocapture"]
#[allow(clippy::print_stdout, reason = "it prints figures")]
fn figures_of_wholes_and_of_their_parts() {
    let mut engine = engine();
    let scans_out = "(let ((s (scan)) (v (vector 0 1.0))) (dotimes (i 100) (length-of s)) v)";
    let parts_out =
        "(let ((s (replace (make-array 1081 :initial-element 1) (scan)))) (dotimes (i 100) (length-of s)))";
    for (form, times) in [
        ("(scan)", 200),
        ("(scan-in-parts)", 200),
        ("(image)", 5),
        ("(image-as-text)", 5),
        (scans_out, 2),
        (parts_out, 2),
        ("(let ((i (image))) (dotimes (n 5) (sum i)))", 1),
        ("(let ((i (image-as-text))) (dotimes (n 5) (sum-of-text i)))", 1),
    ] {
        let text = format!("(dotimes (i {times}) {form})");
        engine.eval(&text).expect("it is evaluated");
        let start = Instant::now();
        engine.eval(&text).expect("it is evaluated");
        println!("{form}: {:?}", start.elapsed() / times);
    }
}
