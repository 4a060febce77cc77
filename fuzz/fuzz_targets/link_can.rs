#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    hapt_fuzz::judged(hapt_fuzz::target("link_can"), bytes);
});
