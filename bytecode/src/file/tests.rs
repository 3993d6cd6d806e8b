use super::*;
use crate::datum::ObjectId;
use crate::module::{
    Capture, CaptureSource, Constant, FunctionNumber, LineEntry, ModuleFunction, Parameters, PoolIdx,
    VariablePlace, VariableRange,
};
use crate::symbol::Symbol;
use num_bigint::BigInt;

/// Returns a module with one of everything.
fn sample() -> Module {
    let constants = vec![
        Constant::Nil,
        Constant::True,
        Constant::Symbol(Symbol::cl("CAR")),
        Constant::Symbol(Symbol::esl("ALERT")),
        Constant::Symbol(Symbol::keyword("NAME")),
        Constant::Symbol(Symbol::uninterned(7, "G")),
        Constant::Symbol(Symbol::cl("CAR")),
        Constant::Integer((-1).into()),
        Constant::Integer(i64::MIN.into()),
        Constant::Integer(BigInt::from(i64::MAX) + 1),
        Constant::Integer(-(BigInt::from(1) << 100_u32)),
        Constant::Ratio((-2).into(), 3.into()),
        Constant::Float(-0.0),
        Constant::Float(f64::INFINITY),
        Constant::Character('λ'),
        Constant::String("ein Satz: “λ”".into()),
        Constant::String("".into()),
        Constant::Cons(PoolIdx(2), PoolIdx(0)),
        Constant::Vector(vec![PoolIdx(1), PoolIdx(17)]),
        Constant::Vector(vec![]),
        Constant::Array(vec![2, 1], vec![PoolIdx(0), PoolIdx(1)]),
        Constant::Array(vec![], vec![PoolIdx(3)]),
        Constant::Function(FunctionNumber(1)),
        Constant::Class(Symbol::esl("POINT")),
    ];
    let full = ModuleFunction {
        name: Some(PoolIdx(2)),
        lambda_list: Some(PoolIdx(17)),
        documentation: Some(PoolIdx(15)),
        parameters: Parameters {
            required: 1,
            optional: 2,
            rest: true,
            keys: Some(vec![PoolIdx(4)]),
            allow_other_keys: true,
        },
        registers: 20,
        captures: vec![
            Capture::value(CaptureSource::Register(3)),
            Capture::boxed(CaptureSource::Capture(1)),
            Capture::value(CaptureSource::Later),
        ],
        constants: vec![PoolIdx(0), PoolIdx(22)],
        code: vec![0x73, 0xFFFF_FFFF, 0],
        lines: vec![
            LineEntry { pc: 0, source: 1, line: 300, column: 12 },
            LineEntry { pc: 2, source: 0, line: 1, column: u32::MAX },
        ],
        variables: vec![
            VariableRange { name: "λ".into(), place: VariablePlace::Capture(255), from: 0, to: 3 },
            VariableRange { name: "X".into(), place: VariablePlace::Register(0), from: 1, to: 3 },
            VariableRange { name: "λ".into(), place: VariablePlace::Register(249), from: 1, to: 2 },
        ],
    };
    Module {
        sources: vec!["a.esl".to_owned(), "b.esl".to_owned()],
        requires: vec!["c".to_owned()],
        constants,
        functions: vec![full, ModuleFunction::default()],
        toplevel: vec![FunctionNumber(1), FunctionNumber(1)],
    }
}

/// Replaces all checksums, so that a change of the content is seen by the decoder.
fn seal(file: &mut [u8]) {
    for section in 0..Section::ALL.len() {
        let entry = SECTION_TABLE + section * SECTION_ENTRY;
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
        let (offset, length) = (word(entry + 4), word(entry + 8));
        let checksum = crc32fast::hash(&file[offset..offset + length]);
        file[entry + 12..entry + 16].copy_from_slice(&checksum.to_le_bytes());
    }
    let header = HEADER_LENGTH - 4;
    let checksum = crc32fast::hash(&file[..header]);
    file[header..header + 4].copy_from_slice(&checksum.to_le_bytes());
}

/// Where a section begins.
fn start(file: &[u8], section: Section) -> usize {
    let entry = SECTION_TABLE + section.position() * SECTION_ENTRY;
    u32::from_le_bytes(file[entry + 4..entry + 8].try_into().unwrap()) as usize
}

#[track_caller]
fn check_refused(change: impl FnOnce(&mut Vec<u8>), expected: &str) {
    let mut file = write(&sample()).unwrap();
    change(&mut file);
    assert_eq!(read(&file).unwrap_err().to_string(), expected);
}

#[test]
fn a_module_survives_writing_and_reading() {
    let file = write(&sample()).unwrap();
    assert_eq!(read(&file), Ok(sample()));
    assert_eq!(read(&write(&Module::default()).unwrap()), Ok(Module::default()));
}

#[test]
fn the_checksum_of_a_header_tells_files_apart() {
    let file = write(&sample()).expect("it can be written");
    let mut other = sample();
    other.sources.push("other.esl".into());
    let other = write(&other).expect("it can be written");
    assert!(checksum(&file).is_some() && checksum(&file) == checksum(&file.clone()));
    assert_ne!(checksum(&file), checksum(&other));
    assert_eq!(checksum(&file[..HEADER_LENGTH - 1]), None);
}

#[test]
fn an_image_is_read_in_parts() {
    let module = sample();
    let file = write(&module).unwrap();
    let image = ModuleImage::open_trusted(ImageBytes::Shared(file.into())).unwrap();
    assert_eq!(image.sources(), Ok(module.sources.clone()));
    for (number, name) in module.sources.iter().enumerate() {
        assert_eq!(image.source(number as u32), Ok(Some(name.as_str())));
    }
    assert_eq!(image.source(module.sources.len() as u32), Ok(None));
    assert_eq!(image.requires(), Ok(module.requires.clone()));
    assert_eq!(image.packages().unwrap(), ["COMMON-LISP", "ESL", "KEYWORD"]);
    let symbols: Vec<_> = image.symbols().map(Result::unwrap).collect();
    assert_eq!(symbols.len(), image.symbol_count());
    assert_eq!(symbols[0], SymbolRecord { home: SymbolHome::Package(0), name: "CAR" });
    assert_eq!(symbols[3], SymbolRecord { home: SymbolHome::Uninterned(7), name: "G" });
    assert_eq!(image.constant_count(), module.constants.len());
    assert_eq!(image.constant(PoolIdx(6)), Ok(ConstantRecord::Symbol(0)));
    assert_eq!(image.constant(PoolIdx(15)), Ok(ConstantRecord::String("ein Satz: “λ”")));
    assert_eq!(image.constant(PoolIdx(23)), Ok(ConstantRecord::Class(4)));
    let Ok(ConstantRecord::Vector(items)) = image.constant(PoolIdx(18)) else { panic!("it is a vector") };
    assert_eq!(items.iter().collect::<Vec<_>>(), [1, 17].map(PoolIdx));
    assert!(image.constant(PoolIdx(24)).is_err());
    assert_eq!(image.function_count(), 2);
    let without = ModuleFunction { variables: Vec::new(), ..module.functions[0].clone() };
    assert_eq!(image.function(FunctionNumber(0)), Ok(without));
    assert_eq!(image.variables(FunctionNumber(0)).as_ref(), Ok(&module.functions[0].variables));
    assert_eq!(image.function(FunctionNumber(1)).as_ref(), Ok(&module.functions[1]));
    assert!(image.function(FunctionNumber(2)).is_err());
    assert_eq!(image.toplevel(), Ok(module.toplevel.clone()));
    assert_eq!(image.to_module(), Ok(module));
}

#[test]
fn an_object_cannot_be_written() {
    let module = Module { constants: vec![Constant::Object(ObjectId(0))], ..Module::default() };
    assert_eq!(write(&module), Err(WriteError::Object(PoolIdx(0))));
}

#[test]
fn files_of_others_are_told_apart_from_damaged_ones() {
    check_refused(|file| file.clear(), "not a compiled ESL file: its first bytes are others");
    check_refused(|file| file[4] = b'\n', "not a compiled ESL file: its first bytes are others");
    check_refused(
        |file| file[8] = 9,
        "compiled in format version 9, but this is a machine for version 3: compile it again",
    );
    check_refused(
        |file| file[16] ^= 1,
        "compiled by another version of eslc, with another table of opcodes: compile it again",
    );
    check_refused(
        |file| file[31] ^= 1,
        "compiled by another version of eslc, with another table of builtins: compile it again",
    );
}

#[test]
fn damage_is_found_and_placed() {
    check_refused(
        |file| *file.last_mut().unwrap() ^= 1,
        "damaged file: wrong checksum at byte 788 (names): compile it again",
    );
    check_refused(
        |file| file.truncate(700),
        "damaged file: sections are not in order, or not as long as the file at byte 80 (header): compile it again",
    );
    check_refused(
        |file| file.truncate(20),
        "damaged file: expected 8 more bytes, found 4 at byte 16 (header): compile it again",
    );
    let change = |section: Section, at: usize, byte: u8| {
        move |file: &mut Vec<u8>| {
            let start = start(file, section);
            file[start + at] = byte;
            seal(file);
        }
    };
    check_refused(
        change(Section::Sources, 3, 0xFF),
        "damaged file: expected 17112760328 more bytes, found 27 at byte 152 (sources): compile it again",
    );
}

#[test]
fn a_small_file_does_not_become_a_large_module() {
    // All constants share one record.
    let module = Module { constants: vec![Constant::String("x".into()); 2], ..Module::default() };
    let mut file = write(&module).unwrap();
    let offsets = start(&file, Section::Constants) + 4;
    file[offsets + 4..offsets + 8].fill(0);
    seal(&mut file);
    assert!(matches!(read(&file), Err(ReadError::Damaged { problem: Problem::Gap, .. })));
}
