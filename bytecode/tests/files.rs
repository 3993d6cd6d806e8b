//! Files: what was written is what is read, and no bytes do any harm.

mod support;

use esl_bytecode::file::{self, ImageBytes, ModuleImage};
use esl_bytecode::module::{FunctionNumber, Module, PoolIdx};
use esl_bytecode::verify::verify;
use proptest::prelude::*;
use support::{Random, any_module, module_with_random_code};

/// Takes `bytes` for a file in every way there is. Only that this ends without a panic matters, and that no
/// module that passes the verifier is printed with a panic.
fn use_as_file(bytes: &[u8]) {
    if let Ok(module) = file::read(bytes) {
        let _ = verify(&module);
        esl_bytecode::disasm::module(&module);
    }
    if let Ok(image) = ModuleImage::open_trusted(ImageBytes::Shared(bytes.into())) {
        let _ = (image.sources(), image.packages(), image.toplevel(), image.to_module());
        image.symbols().for_each(drop);
        let _ = image.symbol(image.symbol_count() as u32);
        for index in 0..=image.constant_count().min(100) as u32 {
            let _ = image.constant(PoolIdx(index));
        }
        for number in 0..=image.function_count().min(100) as u32 {
            let _ = image.function(FunctionNumber(number));
        }
    }
}

fn module(seed: u64) -> Module {
    let random = &mut Random(seed);
    if random.once_in(2) { any_module(random) } else { module_with_random_code(random) }
}

proptest! {
    #[test]
    fn reading_undoes_writing(seed: u64) {
        let module = module(seed);
        let bytes = file::write(&module).unwrap();
        prop_assert_eq!(file::read(&bytes), Ok(module));
    }

    #[test]
    fn linking_keeps_what_modules_are(seed: u64, count in 0..4_u64) {
        let modules: Vec<Module> = (0..count).map(|i| module_with_random_code(&mut Random(seed ^ i))).collect();
        let all_pass = modules.iter().all(|module| verify(module).is_ok());
        let linked = esl_bytecode::link::link(modules.clone());
        prop_assert_eq!(verify(&linked).is_ok(), all_pass);
        prop_assert_eq!(linked.functions.len(), modules.iter().map(|module| module.functions.len()).sum::<usize>());
        if let [only] = &modules[..] {
            prop_assert_eq!(&linked, only);
        }
    }

    #[test]
    fn every_flipped_bit_is_found(seed: u64, at: prop::sample::Index, bit in 0..8_u32) {
        let mut bytes = file::write(&module(seed)).unwrap();
        let at = at.index(bytes.len());
        bytes[at] ^= 1_u8 << bit;
        prop_assert!(file::read(&bytes).is_err());
        use_as_file(&bytes);
    }

    #[test]
    fn every_truncation_is_found(seed: u64, at: prop::sample::Index) {
        let bytes = file::write(&module(seed)).unwrap();
        let short = &bytes[..at.index(bytes.len())];
        prop_assert!(file::read(short).is_err());
        use_as_file(short);
    }

    #[test]
    fn random_bytes_do_no_harm(bytes: Vec<u8>, seed: u64) {
        use_as_file(&bytes);
        // Behind a valid header they get further.
        let mut file = file::write(&module(seed)).unwrap();
        let length = bytes.len().min(file.len() - HEADER);
        let start = file.len() - length;
        file[start..].copy_from_slice(&bytes[..length]);
        use_as_file(&seal(file));
    }

    #[test]
    fn damaged_content_with_right_checksums_does_no_harm(
        seed: u64,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = file::write(&module(seed)).unwrap();
        for (at, byte) in changes {
            let at = HEADER + at.index(bytes.len() - HEADER);
            bytes[at] = if byte < 128 { byte % 8 } else { byte };
        }
        use_as_file(&seal(bytes));
    }
}

/// Length of the header, and where its section table begins, as the format describes it.
const HEADER: usize = 132;
const TABLE: usize = 32;

/// Replaces all checksums by right ones.
fn seal(mut bytes: Vec<u8>) -> Vec<u8> {
    for entry in (TABLE..HEADER - 4).step_by(16) {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (offset, length) = (word(entry + 4), word(entry + 8));
        let checksum = crc32fast::hash(&bytes[offset..offset + length]);
        bytes[entry + 12..entry + 16].copy_from_slice(&checksum.to_le_bytes());
    }
    let checksum = crc32fast::hash(&bytes[..HEADER - 4]);
    bytes[HEADER - 4..HEADER].copy_from_slice(&checksum.to_le_bytes());
    bytes
}
