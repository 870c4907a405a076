#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumel_fuzz::readers::picture(
    lumel_fuzz::folder(),
    bytes
));
