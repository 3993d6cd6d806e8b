use std::collections::BTreeMap;

use serde::Deserialize;

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
        "expected a property list or an association list, found (:X-M)"
    );
    let mode = |data: Data| data.to_structure::<Mode>();
    assert_eq!(mode(Data::Symbol("IDLE".into())), Ok(Mode::Idle));
    assert!(mode(Data::list([key("DRIVE")])).is_err() && mode(key("FLY")).is_err());
    assert!(mode(Data::list([key("IDLE"), 1_i64.into()])).is_err());
}
