//! Takes bytes as what comes over a connection to the listener for operators, with and without the framing of
//! its packets, and to the monitor: no panic, no more memory than a small multiple of them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    esl_operate::noise::understand(bytes);
    // A fuzzer seldom finds lengths: here lines become packets.
    let mut framed = Vec::new();
    for line in bytes.split(|&byte| byte == b'\n') {
        framed.extend_from_slice(format!("{:06x}", line.len()).as_bytes());
        framed.extend_from_slice(line);
    }
    esl_operate::noise::understand(&framed);
});
