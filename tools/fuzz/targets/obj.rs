#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use lumel_fuzz::mutate::{Kind, mutated};

fuzz_target!(|bytes: &[u8]| lumel_fuzz::readers::obj(lumel_fuzz::folder(), bytes));

fuzz_mutator!(|data: &mut [u8], size: usize, longest: usize, seed: u32| {
    if seed % 2 == 0
        && let Some(new) = mutated(Kind::Text, &data[..size], longest, seed)
    {
        data[..new.len()].copy_from_slice(&new);
        return new.len();
    }
    fuzzer_mutate(data, size, longest)
});
