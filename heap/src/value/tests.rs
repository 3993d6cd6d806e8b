use super::*;

#[test]
fn fixnums_hold_62_bits() {
    for n in [0, 1, -1, 42, Value::FIXNUM_MIN, Value::FIXNUM_MAX] {
        let v = Value::fixnum(n).unwrap();
        assert_eq!(v.as_fixnum(), Some(n));
        assert!(v.is_fixnum() && v.as_double().is_none() && !v.is_address() && v.as_handle().is_none());
    }
    assert_eq!(Value::fixnum(Value::FIXNUM_MIN - 1), None);
    assert_eq!(Value::fixnum(Value::FIXNUM_MAX + 1), None);
    assert_eq!(Value::small(-7).as_fixnum(), Some(-7));
    assert_eq!(Value::small(-7).as_index(), None);
    assert_eq!(Value::index(7).as_index(), Some(7));
}

#[test]
fn doubles_in_the_window_need_no_box() {
    // 2^-255 and 2^257, spelt out because `powi` need not be exact.
    let (least, beyond) = (f64::from_bits(768 << 52), f64::from_bits(1280 << 52));
    let greatest = f64::from_bits(beyond.to_bits() - 1);
    for x in [1.0, -1.0, 0.1, -1e70, 3.5e-70, least, -least, greatest, -greatest] {
        let v = Value::double(x).unwrap();
        assert!(v.is_windowed_double() && !v.is_fixnum(), "{x}");
        assert_eq!(v.as_double().map(f64::to_bits), Some(x.to_bits()));
    }
    let below = f64::from_bits(least.to_bits() - 1);
    for x in [below, -below, beyond, -beyond, f64::MIN_POSITIVE, f64::MAX, f64::MIN, f64::from_bits(1)] {
        assert_eq!(Value::double(x), None, "{x}");
    }
}

#[test]
fn special_doubles_are_constants() {
    for x in [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY] {
        let v = Value::double(x).unwrap();
        assert!(!v.is_windowed_double());
        assert_eq!(v.as_double().map(f64::to_bits), Some(x.to_bits()));
    }
    assert_ne!(Value::double(0.0), Value::double(-0.0));
    assert_eq!(Value::double(f64::NAN), Some(Value::NAN));
    assert_eq!(Value::double(f64::from_bits(f64::NAN.to_bits() ^ 1 << 63 ^ 5)), Some(Value::NAN));
    assert!(Value::NAN.as_double().unwrap().is_nan());
}

#[test]
fn every_exponent_survives() {
    for exponent in 0..2048u64 {
        for sign in [0, 1u64 << 63] {
            for mantissa in [0, 1, (1 << 52) - 1] {
                let x = f64::from_bits(sign | exponent << 52 | mantissa);
                match Value::double(x).map(|v| v.as_double().unwrap()) {
                    Some(back) if x.is_nan() => assert!(back.is_nan()),
                    Some(back) => assert_eq!(back.to_bits(), x.to_bits()),
                    None => assert!(!(768..1280).contains(&exponent), "{x} is in the window"),
                }
            }
        }
    }
}

#[test]
fn constants_differ_and_are_nothing_else() {
    let all = [
        Value::NIL,
        Value::T,
        Value::UNBOUND,
        Value::UNSUPPLIED,
        Value::EOF,
        Value::POSITIVE_ZERO,
        Value::NEGATIVE_ZERO,
        Value::INFINITY,
        Value::NEGATIVE_INFINITY,
        Value::NAN,
        Value::POISON,
        Value::character(0).unwrap(),
    ];
    for (i, a) in all.iter().enumerate() {
        assert!(!a.is_fixnum() && !a.is_windowed_double() && !a.is_address() && a.as_handle().is_none());
        assert!(all[..i].iter().all(|b| a != b));
    }
    assert!(Value::NIL.is_nil() && Value::NIL.is_list() && !Value::NIL.is_true() && Value::T.is_true());
    assert_eq!(Value::from(true), Value::T);
}

#[test]
fn characters_hold_21_bits() {
    for code in [0, 'a' as u32, 0xD800, 0x10_FFFF] {
        assert_eq!(Value::character(code).unwrap().as_character(), Some(code));
    }
    assert_eq!(Value::character(0x11_0000), None);
    assert_eq!(Value::NIL.as_character(), None);
}

#[test]
fn handles_hold_index_and_generation() {
    for (index, generation) in [(0, 0), (u32::MAX, Value::GENERATION_LIMIT - 1), (7, 3)] {
        let v = Value::handle(index, generation).unwrap();
        assert_eq!(v.as_handle(), Some((index, generation)));
        assert!(!v.is_address() && !v.is_fixnum() && !v.is_windowed_double());
    }
    assert_eq!(Value::handle(0, Value::GENERATION_LIMIT), None);
}
