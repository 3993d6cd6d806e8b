//! Messages from definition to payload and back, and every way in which each of them can be wrong.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, IntoDatum};

use super::scalar::{boolean, float, vector};
use super::{MessageType, TypeFault, Types, complete, decode, encode, keyword};

/// Returns types with one of the test, `t/msg/T`, and `t/msg/Part`.
fn types(text: &str) -> Types {
    let types = Types::bundled();
    types.define("t/msg/Part", "int32 x 7\nstring<=3 name").expect("it is right");
    types.define("t/msg/T", text).expect("it is right");
    types
}

fn of_text(text: &str) -> std::sync::Arc<MessageType> {
    types(text).message("t/msg/T").expect("it is right")
}

/// Returns a property list of names and values.
fn message(fields: &[(&str, Datum)]) -> Datum {
    let items = fields.iter().flat_map(|(name, value)| [keyword(name), value.clone()]);
    Datum::list(items.collect::<Vec<_>>(), Span::default())
}

fn int(value: i128) -> Datum {
    Datum::integer(value, Span::default())
}

/// Returns a message as it is written by `encode` and read by `decode`; the text of a fault.
fn passed(text: &str, fields: &[(&str, Datum)]) -> String {
    let message_type = of_text(text);
    match encode(&message_type, &message(fields)) {
        Ok(payload) => {
            let read = decode(&message_type, &payload).map_err(|fault| fault.to_string());
            let completed = complete(&message_type, &message(fields)).map_err(|fault| fault.to_string());
            assert_eq!(read.clone().map(|read| read.to_string()), completed.map(|c| c.to_string()));
            read.map_or_else(|fault| fault, |read| read.to_string())
        }
        Err(fault) => fault.to_string(),
    }
}

/// Returns the fault of a payload, given without its header.
fn fault_of(text: &str, bytes: &[u8]) -> String {
    let payload = [&[0, 1, 0, 0], bytes].concat();
    decode(&of_text(text), &payload).map_or_else(|fault| fault.to_string(), |read| format!("read: {read}"))
}

#[test]
fn a_message_has_the_bytes_of_the_specification() {
    let string = Types::bundled().message("std_msgs/msg/String").expect("it is bundled");
    assert_eq!(string.dds_name(), "std_msgs::msg::dds_::String_");
    assert_eq!(string.hash(), "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18");
    let payload = encode(&string, &message(&[("data", "hello".into_datum())])).expect("it is right");
    assert_eq!(*payload, *b"\x00\x01\x00\x00\x06\x00\x00\x00hello\0");
    // Big-endian, and filled up to a multiple of four.
    let read = decode(&string, b"\x00\x00\x00\x00\x00\x00\x00\x02a\0\0\0").expect("it is right");
    assert_eq!(read.to_string(), "(:DATA \"a\")");
    let numbers = of_text("uint8 a\nfloat64 b\nint16[] c");
    let big =
        [0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0xff, 0xff, 1, 0];
    assert_eq!(decode(&numbers, &big).expect("it is right").to_string(), "(:A 9 :B 1.0 :C #(-1 256))");
    let fields = [("a", int(9)), ("b", float(1.0)), ("c", vector(vec![int(-1), int(256)]))];
    let little = encode(&numbers, &message(&fields)).expect("it is right");
    let expected =
        [0, 1, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f, 2, 0, 0, 0, 0xff, 0xff, 0, 1];
    assert_eq!(*little, expected);
    let wide = encode(&of_text("wstring a"), &message(&[("a", "a\u{1f916}".into_datum())])).expect("right");
    assert_eq!(*wide, [0, 1, 0, 0, 3, 0, 0, 0, 0x61, 0, 0, 0, 0x3e, 0xd8, 0, 0, 0x16, 0xdd, 0, 0]);
    let empty = encode(&of_text(""), &message(&[])).expect("it is right");
    assert_eq!(*empty, [0, 1, 0, 0, 0]);
}

#[test]
fn missing_fields_have_the_defaults_of_the_definition() {
    let text = "bool a true\nint8 b\nfloat32[2] c [0.5, 1]\nstring d \"x\"\nPart e\nPart[] f\nuint8[3] g";
    let all = "(:A T :B 0 :C #(0.5 1.0) :D \"x\" :E (:X 7 :NAME \"\") :F #() :G #(0 0 0))";
    assert_eq!(passed(text, &[]), all);
    assert_eq!(of_text(text).defaults().to_string(), all);
    let part = message(&[("name", "ab".into_datum())]);
    assert_eq!(
        passed(text, &[("f", Datum::list([part], Span::default())), ("a", boolean(false))]),
        "(:A NIL :B 0 :C #(0.5 1.0) :D \"x\" :E (:X 7 :NAME \"\") :F #((:X 7 :NAME \"ab\")) :G #(0 0 0))"
    );
}

#[test]
fn arrays_of_numbers_are_packed_and_may_be_given_as_any_sequence() {
    let kind = |text: &str| {
        let message_type = of_text(text);
        let values = Datum::list([int(1), int(2)], Span::default());
        let given = complete(&message_type, &message(&[("a", values)])).expect("it is right");
        let (_, rest) = given.as_cons().expect("a list");
        match rest.as_cons().map(|(value, _)| value.kind().clone()) {
            Some(DatumKind::Packed(PackedVector::Bytes(_))) => "bytes",
            Some(DatumKind::Packed(PackedVector::Floats(_))) => "floats",
            Some(DatumKind::Packed(PackedVector::Integers(_))) => "integers",
            _ => "data",
        }
    };
    for text in ["uint8[] a", "byte[2] a", "char[<=2] a"] {
        assert_eq!(kind(text), "bytes", "{text}");
    }
    for text in ["int8[] a", "uint64[] a", "int32[2] a"] {
        assert_eq!(kind(text), "integers", "{text}");
    }
    assert_eq!(kind("float32[] a"), "floats");
    let floats = || [0.1, 2.0].into_iter().collect::<std::sync::Arc<[f64]>>().into_datum();
    assert_eq!(passed("float32[] a", &[("a", floats())]), "(:A #(0.10000000149011612 2.0))");
    assert_eq!(passed("float64[] a", &[("a", floats())]), "(:A #(0.1 2.0))");
    let bytes = || Datum::bytes(vec![1, 200], Span::default());
    assert_eq!(passed("float64[] a", &[("a", bytes())]), "(:A #(1.0 200.0))");
    assert_eq!(
        passed("uint64[] a", &[("a", vector(vec![int(u64::MAX.into())]))]),
        format!("(:A #({}))", u64::MAX)
    );
    assert_eq!(passed("bool[] a", &[("a", vector(vec![boolean(true), boolean(false)]))]), "(:A #(T NIL))");
    assert_eq!(
        passed("int8[] a", &[("a", bytes())]),
        "`:a 1` of t/msg/T: expected int8, an integer from -128 to 127, got 200"
    );
}

#[test]
fn constants_stand_for_their_values() {
    let text = "uint8 IDLE=0\nuint8 MOVING_ON=3\nstring GREETING=hi\nuint8 state\nstring word\nPart part";
    let of = |name: &str, constant: &str| passed(text, &[(name, keyword(constant))]);
    assert_eq!(of("state", "moving_on"), "(:STATE 3 :WORD \"\" :PART (:X 7 :NAME \"\"))");
    assert_eq!(of("word", "greeting"), "(:STATE 0 :WORD \"hi\" :PART (:X 7 :NAME \"\"))");
    assert_eq!(
        of("state", "moving"),
        "`:state` of t/msg/T: `t/msg/T` does not define a constant `:moving` for this field; did you mean \
         `:moving-on`?"
    );
    let part = message(&[("x", keyword("moving_on"))]);
    assert_eq!(
        passed(text, &[("part", part)]),
        "`:part :x` of t/msg/T: expected int32, an integer from -2147483648 to 2147483647, got :MOVING-ON"
    );
}

#[test]
fn a_number_of_seconds_is_a_time() {
    let time = |value: Datum| passed("builtin_interfaces/Time a", &[("a", value)]);
    assert_eq!(time(float(1.5)), "(:A (:SEC 1 :NANOSEC 500000000))");
    assert_eq!(time(float(-0.25)), "(:A (:SEC -1 :NANOSEC 750000000))");
    assert_eq!(time(float(0.999_999_999_9)), "(:A (:SEC 1 :NANOSEC 0))");
    assert_eq!(time(int(7)), "(:A (:SEC 7 :NANOSEC 0))");
    let third = Datum::new(DatumKind::Ratio(1.into(), 3.into()), Span::default());
    assert_eq!(time(third), "(:A (:SEC 0 :NANOSEC 333333333))");
    let wrong = "`:a` of t/msg/T: expected a number of seconds that fits into int32, got ";
    assert_eq!(time(float(1e300)), format!("{wrong}1e300"));
    assert_eq!(time(float(f64::NAN)), format!("{wrong}NaN"));
    assert_eq!(time(int(1 << 31)), format!("{wrong}2147483648"));
}

#[test]
fn a_wrong_message_is_named_with_its_path() {
    let text =
        "int32 count\nfloat32 ratio\nbool on\nPart part\nPart[<=2] parts\nint8[2] pair\nstring<=2 word";
    let of = |name: &str, value: Datum| passed(text, &[(name, value)]);
    let part = |name: &str, value: Datum| message(&[(name, value)]);
    let cases = [
        (of("cuont", int(1)), "t/msg/T: `t/msg/T` does not have a field `:cuont`; did you mean `:count`?"),
        (of("xyzzy", int(1)), "t/msg/T: `t/msg/T` does not have a field `:xyzzy`"),
        (
            of("count", float(1.0)),
            "`:count` of t/msg/T: expected int32, an integer from -2147483648 to 2147483647, got 1.0",
        ),
        (
            of("count", int(1 << 31)),
            "`:count` of t/msg/T: expected int32, an integer from -2147483648 to 2147483647, got 2147483648",
        ),
        (
            of("ratio", float(1e39)),
            "`:ratio` of t/msg/T: expected float32, a real number in its range, got 1e39",
        ),
        (
            of("ratio", "1".into_datum()),
            "`:ratio` of t/msg/T: expected float32, a real number in its range, got \"1\"",
        ),
        (of("on", int(1)), "`:on` of t/msg/T: expected a boolean, T or NIL, got 1"),
        (
            of("part", int(1)),
            "`:part` of t/msg/T: expected a property list of the fields of t/msg/Part, got 1",
        ),
        (
            of("part", part("name", "abcd".into_datum())),
            "`:part :name` of t/msg/T: expected at most 3 bytes, got 4",
        ),
        (
            of("parts", vector(vec![message(&[]), part("x", "a".into_datum())])),
            "`:parts 1 :x` of t/msg/T: expected int32, an integer from -2147483648 to 2147483647, got \"a\"",
        ),
        (
            of("parts", vector(vec![message(&[]); 3])),
            "`:parts` of t/msg/T: expected at most 2 elements, got 3",
        ),
        (of("parts", int(3)), "`:parts` of t/msg/T: expected an array, t/msg/Part[<=2], got 3"),
        (of("pair", vector(vec![int(1)])), "`:pair` of t/msg/T: expected 2 elements, got 1"),
        (
            of("pair", Datum::cons(int(1), int(2), Span::default())),
            "`:pair` of t/msg/T: expected 2 elements, got 1",
        ),
        (passed(text, &[("count", int(1)), ("count", int(2))]), "t/msg/T: the field `:count` is given twice"),
    ];
    for (fault, expected) in cases {
        assert_eq!(fault, expected);
    }
    let odd = Datum::list([keyword("count")], Span::default());
    let fault = encode(&of_text(text), &odd).expect_err("it is wrong").to_string();
    assert_eq!(fault, "t/msg/T: expected a property list of the fields of t/msg/T, got (:COUNT)");
    let dotted = Datum::list_with_tail([int(1), int(2)], int(3), Span::default());
    let fault = passed(text, &[("pair", dotted)]);
    assert_eq!(fault, "`:pair` of t/msg/T: expected an array, int8[2], got (1 2 . 3)");
}

#[test]
fn a_malformed_payload_is_named_with_its_path() {
    let short = |needed: u64, left: u64| {
        format!("of t/msg/T: the payload is too short: needs {needed} more bytes, has {left}")
    };
    assert_eq!(fault_of("int32 a", &[1, 0]), format!("`:a` {}", short(4, 2)));
    assert_eq!(fault_of("uint8 a\nint64 b", &[1, 0]), format!("`:b` {}", short(15, 1)));
    assert_eq!(fault_of("int32[] a", &[0xff; 8]), format!("`:a` {}", short(4 * u64::from(u32::MAX), 4)));
    assert_eq!(fault_of("Part[] a", &[2, 0, 0, 0, 1, 0, 0, 0]), format!("`:a` {}", short(16, 4)));
    assert_eq!(fault_of("float64[3] a", &[0; 16]), format!("`:a` {}", short(24, 16)));
    assert_eq!(fault_of("string a", &[9, 0, 0, 0, 65, 0]), format!("`:a` {}", short(9, 2)));
    assert_eq!(fault_of("wstring a", &[2, 0, 0, 0, 65, 0, 0, 0]), format!("`:a` {}", short(8, 4)));
    assert_eq!(
        fault_of("string a", &[2, 0, 0, 0, 65, 66]),
        "`:a` of t/msg/T: the text does not end in a zero byte"
    );
    assert_eq!(
        fault_of("string a", &[2, 0, 0, 0, 0xff, 0]),
        "`:a` of t/msg/T: the text is not valid Unicode"
    );
    let surrogate = [1, 0, 0, 0, 0, 0xd8, 0, 0];
    assert_eq!(fault_of("wstring a", &surrogate), "`:a` of t/msg/T: the text is not valid Unicode");
    assert_eq!(
        fault_of("wstring a", &[1, 0, 0, 0, 0, 0, 1, 0]),
        "`:a` of t/msg/T: the text is not valid Unicode"
    );
    assert_eq!(fault_of("bool a", &[2]), "`:a` of t/msg/T: expected a boolean, 0 or 1, got 2");
    assert_eq!(fault_of("bool[2] a", &[1, 7]), "`:a 1` of t/msg/T: expected a boolean, 0 or 1, got 7");
    assert_eq!(
        fault_of("uint8[<=1] a", &[2, 0, 0, 0, 1, 1]),
        "`:a` of t/msg/T: expected at most 1 elements, got 2"
    );
    assert_eq!(fault_of("string<=1 a", b"\x03\0\0\0ab\0"), "`:a` of t/msg/T: expected at most 1, got 2");
    assert_eq!(fault_of("uint8 a", &[1; 5]), "t/msg/T: 4 bytes follow the message");
    assert_eq!(fault_of("uint8 a", &[1; 4]), "read: (:A 1)");
    assert_eq!(fault_of("string a", &[0; 4]), "read: (:A \"\")");
    assert_eq!(fault_of("", &[]), "t/msg/T: the payload is too short: needs 1 more bytes, has 0");
    let byte = of_text("uint8 a");
    let of_payload = |payload: &[u8]| decode(&byte, payload).expect_err("it is wrong").to_string();
    assert_eq!(of_payload(&[0, 1]), "t/msg/T: the payload is too short: needs 4 more bytes, has 2");
    assert_eq!(of_payload(&[0, 7, 0, 0, 1]), "t/msg/T: expected the encoding CDR (0 or 1), got 0x0007");
    let failure = HostFailure::from(decode(&byte, &[0, 1]).expect_err("it is wrong"));
    assert_eq!(failure.cause, "MALFORMED-PAYLOAD");
}

#[test]
fn a_payload_of_many_small_values_is_refused() {
    let many = of_text("std_msgs/Empty[] a");
    let count = 3_000_000_u32;
    let mut payload = vec![0, 1, 0, 0];
    payload.extend(count.to_le_bytes());
    payload.resize(payload.len() + count as usize, 0);
    let fault = decode(&many, &payload).expect_err("it has too many values").to_string();
    assert_eq!(fault, "`:a 1000000` of t/msg/T: the message has more than 1000000 values");
}

#[test]
fn a_wrong_type_is_named_with_the_place_that_asks_for_it() {
    let types = Types::bundled();
    let fault = |fault: TypeFault| (HostFailure::from(fault.clone()).cause, fault.to_string());
    let of_message = |name: &str| fault(types.message(name).expect_err("it is wrong")).1;
    let form = "is not the name of a type; expected the form `package/msg/Name`";
    assert_eq!(of_message("String"), format!("`String` {form}"));
    assert_eq!(of_message("../../etc/passwd"), format!("`../../etc/passwd` {form}"));
    assert_eq!(of_message("std_msgs/../String"), format!("`std_msgs/../String` {form}"));
    assert_eq!(
        of_message("std_msgs/Strng"),
        "unknown type `std_msgs/msg/Strng`; did you mean `example_interfaces/msg/String`?"
    );
    let define = |name: &str, text: &str| types.define(name, text).map_err(fault).err();
    assert_eq!(
        define("a/msg/A", "uint8 x\nuint9 y z"),
        Some((
            "INVALID-DEFINITION".to_owned(),
            "definition of `a/msg/A`, line 2: a message cannot have a value here".to_owned()
        ))
    );
    assert_eq!(define("a/msg/A", "\nB b"), None);
    let unknown = of_message("a/A");
    assert!(unknown.starts_with("unknown type `a/msg/B` in line 2 of `a/msg/A`"), "{unknown}");
    assert_eq!(define("a/msg/B", "A a"), None);
    assert_eq!(of_message("a/A"), "definition of `a/msg/B`, line 1: `a/msg/A` contains itself");
    assert_eq!(define("a/msg/B", "uint8[1048577] a"), None);
    assert_eq!(
        of_message("a/A"),
        "definition of `a/msg/B`, line 1: fixed arrays have more than 1048576 elements"
    );
    assert_eq!(
        define("a/srv/S", "uint8 a").map(|fault| fault.1).as_deref(),
        Some("definition of `a/srv/S`, line 1: expected 2 parts, separated by lines `---`, got 1")
    );
    assert_eq!(
        define("a/action/S", "uint8 a\n---\n---\nuint8").map(|fault| fault.1).as_deref(),
        Some(
            "definition of `a/action/S`, line 4: expected `type name`, `type name default` or `type NAME=value`, \
             got `uint8`"
        )
    );
}

#[test]
fn types_that_are_nested_too_deeply_are_refused() {
    let types = Types::bundled();
    for level in 0..1000 {
        types.define(&format!("deep/msg/L{level}"), &format!("L{} next", level + 1)).expect("it is right");
    }
    types.define("deep/msg/L1000", "uint8 a").expect("it is right");
    let fault = types.message("deep/L0").expect_err("it is too deep").to_string();
    assert!(fault.ends_with("types are nested in more than 64 levels"), "{fault}");
    assert!(types.message("deep/L940").is_ok());
    // Each level has sixteen of the next one.
    for level in 0..8 {
        types
            .define(&format!("wide/msg/L{level}"), &format!("L{}[16] next", level + 1))
            .expect("it is right");
    }
    types.define("wide/msg/L8", "uint8 a").expect("it is right");
    let fault = types.message("wide/L0").expect_err("it is too large").to_string();
    assert!(fault.ends_with("fixed arrays have more than 1048576 elements"), "{fault}");
}

#[test]
fn a_definition_may_come_with_those_that_it_names() {
    let types = Types::bundled();
    let line = "=".repeat(80);
    let text = format!("B b\n{line}\nMSG: a/B\nc/C c\n{line}\nMSG: c/C\nuint8 x 4\n");
    types.define("a/msg/A", &text).expect("it is right");
    let message_type = types.message("a/A").expect("it is known");
    assert_eq!(message_type.defaults().to_string(), "(:B (:C (:X 4)))");
}

#[test]
fn definitions_are_found_in_folders_first() {
    let folder = std::env::temp_dir().join(format!("esl-definitions-{}", std::process::id()));
    let messages = folder.join("share/std_msgs/msg");
    std::fs::create_dir_all(&messages).expect("a folder");
    std::fs::write(messages.join("String.msg"), "string data \"from a folder\"\n").expect("a file");
    let types = Types::with_folders(vec![folder.clone()]);
    let found = types.message("std_msgs/String").map(|found| found.defaults().to_string());
    let bundled = types.message("std_msgs/Bool").map(|found| found.defaults().to_string());
    std::fs::remove_dir_all(&folder).expect("it is there");
    assert_eq!(found.as_deref(), Ok("(:DATA \"from a folder\")"));
    assert_eq!(bundled.as_deref(), Ok("(:DATA NIL)"));
}

#[test]
fn services_and_actions_consist_of_messages() {
    let types = Types::bundled();
    let service = types.service("example_interfaces/AddTwoInts").expect("it is bundled");
    assert_eq!(service.name(), "example_interfaces/srv/AddTwoInts");
    assert_eq!(service.dds_name(), "example_interfaces::srv::dds_::AddTwoInts_");
    assert_eq!(service.request.defaults().to_string(), "(:A 0 :B 0)");
    let request = types.message("example_interfaces/srv/AddTwoInts_Request").expect("it is a part");
    assert_eq!(request.hash(), service.request.hash());
    assert_eq!(service.hash(), "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a");
    let action = types.action("example_interfaces/action/Fibonacci").expect("it is bundled");
    assert_eq!(action.send_goal.dds_name(), "example_interfaces::action::dds_::Fibonacci_SendGoal_");
    assert_eq!(action.send_goal.request.fields()[1].name, "goal");
    assert_eq!(action.get_result.response.defaults().to_string(), "(:STATUS 0 :RESULT (:SEQUENCE #()))");
    assert_eq!(action.feedback_message.name(), "example_interfaces/action/Fibonacci_FeedbackMessage");
    assert_eq!(action.cancel_goal.name(), "action_msgs/srv/CancelGoal");
    assert_eq!(action.status.name(), "action_msgs/msg/GoalStatusArray");
    let goal = types.message("example_interfaces/action/Fibonacci_Goal").expect("it is a part");
    assert_eq!(goal.defaults().to_string(), "(:ORDER 0)");
    let part = |name: &str| types.message(&format!("example_interfaces/action/Fibonacci_{name}"));
    for name in ["Feedback", "FeedbackMessage", "SendGoal_Request", "GetResult_Response"] {
        let full = format!("example_interfaces/action/Fibonacci_{name}");
        assert_eq!(part(name).as_ref().map(|part| part.name()), Ok(&*full));
    }
    assert!(part("Other").is_err());
    let service = |name: &str| types.service(&format!("example_interfaces/action/Fibonacci_{name}"));
    assert_eq!(service("SendGoal").as_ref().map(|service| service.hash()), Ok(action.send_goal.hash()));
    assert_eq!(service("GetResult").as_ref().map(|service| service.hash()), Ok(action.get_result.hash()));
    assert!(service("Other").is_err());
}
