use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::*;

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
enum Mode {
    Idle,
    Drive(f64),
    Between(u8, u8),
    TurnTo { heading_deg: i32, fast: bool },
}

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct Report {
    name: String,
    initial: char,
    modes: Vec<Mode>,
    parent: Option<Box<Report>>,
    counts: BTreeMap<String, Vec<u64>>,
    pair: (i8, bool),
    unit: (),
}

fn report() -> Report {
    Report {
        name: "left".into(),
        initial: 'l',
        modes: vec![
            Mode::Idle,
            Mode::Drive(1.5),
            Mode::Between(1, 2),
            Mode::TurnTo { heading_deg: -90, fast: true },
        ],
        parent: None,
        counts: [("a".to_owned(), vec![1, u64::MAX]), ("b".to_owned(), vec![])].into(),
        pair: (-1, false),
        unit: (),
    }
}

#[test]
fn structures_survive_the_way_to_data_and_back() {
    let report = Report { parent: Some(Box::new(report())), ..report() };
    let data = Data::from_structure(&report).expect("it is plain");
    assert_eq!(data.to_structure::<Report>(), Ok(report));
}

#[test]
fn structures_are_lists_that_programs_read() {
    let data = Data::from_structure(&report()).expect("it is plain").to_string();
    assert_eq!(
        data,
        "(:NAME \"left\" :INITIAL #\\l :MODES (:IDLE (:DRIVE 1.5) (:BETWEEN 1 2) (:TURN-TO :HEADING-DEG -90 :FAST \
         T)) :PARENT NIL :COUNTS ((\"a\" 1 18446744073709551615) (\"b\")) :PAIR (-1 NIL) :UNIT NIL)"
    );
}

#[test]
fn association_lists_and_what_is_wrong() {
    #[derive(Debug, Deserialize, PartialEq)]
    struct Point {
        x_m: f64,
        y_m: Option<f64>,
    }
    let key = |name: &str| Data::Keyword(name.into());
    let one = Data::list([Data::DottedList(vec![Data::Symbol("X-M".into())], Box::new(Data::Integer(3)))]);
    assert_eq!(one.to_structure(), Ok(Point { x_m: 3.0, y_m: None }));
    let wrong = |data: &Data| data.to_structure::<Point>().expect_err("it is wrong").to_string();
    assert_eq!(wrong(&Data::list([key("X-M"), "far".into()])), "expected a number, found \"far\"");
    assert_eq!(wrong(&Data::list([key("Y-M"), 1_i64.into()])), "missing field `x_m`");
    assert_eq!(
        wrong(&Data::list([key("X-M")])),
        "expected a property list, an association list or a hash table, found (:X-M)"
    );
    let mode = |data: Data| data.to_structure::<Mode>();
    assert_eq!(mode(Data::Symbol("IDLE".into())), Ok(Mode::Idle));
    assert!(mode(Data::list([key("DRIVE")])).is_err() && mode(key("FLY")).is_err());
    assert!(mode(Data::list([key("IDLE"), 1_i64.into()])).is_err());
}

/// Bytes that are serialized as such.
#[derive(Debug, PartialEq)]
struct Image(Vec<u8>);

impl Serialize for Image {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de> Deserialize<'de> for Image {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Image, D::Error> {
        struct ImageVisitor;

        impl serde::de::Visitor<'_> for ImageVisitor {
            type Value = Image;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("bytes")
            }

            fn visit_bytes<E>(self, bytes: &[u8]) -> Result<Image, E> {
                Ok(Image(bytes.to_vec()))
            }
        }

        deserializer.deserialize_bytes(ImageVisitor)
    }
}

#[test]
fn bytes_and_vectors_of_numbers_are_read_as_such() {
    let image = Image(vec![0, 255]);
    let data = Data::from_structure(&image).expect("it is plain");
    assert_eq!(data, Data::bytes(vec![0, 255]));
    assert_eq!(data.to_structure::<Image>(), Ok(image));
    assert_eq!(data.to_structure::<Vec<u16>>(), Ok(vec![0, 255]));
    assert_eq!(Data::floats([0.5, 2.0]).to_structure::<Vec<f32>>(), Ok(vec![0.5, 2.0]));
    assert!(Data::floats([0.5]).to_structure::<Vec<u8>>().is_err());
}
