#![no_main]

libfuzzer_sys::fuzz_target!(
    // A panic that the reader catches is an answer; the hook of libFuzzer would end the process before.
    init: drop(std::panic::take_hook()),
    |bytes: &[u8]| (tests::fuzz::target("parquet").expect("a target").run)(bytes)
);
