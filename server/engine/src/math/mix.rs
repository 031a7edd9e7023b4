//! A hash for tables of bits and indices that no stranger fills in order to slow us down: many times as fast as the default one.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A table by that hash.
pub type Mixed<K, V> = HashMap<K, V, BuildHasherDefault<Mix>>;

/// Multiply and fold (128-bit products, as in wyhash).
#[derive(Clone, Copy, Debug, Default)]
pub struct Mix(u64);

impl Hasher for Mix {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }
    fn write_u64(&mut self, word: u64) {
        let wide = u128::from(self.0 ^ word ^ 0x2d35_8dcc_aa6c_78a5)
            * u128::from(0x8bb8_4b93_962e_acc9_u64 ^ self.0.rotate_left(32));
        self.0 = (wide as u64) ^ ((wide >> 64) as u64);
    }
    fn write_u32(&mut self, word: u32) {
        self.write_u64(u64::from(word));
    }
    fn write_usize(&mut self, word: usize) {
        self.write_u64(word as u64);
    }
    fn finish(&self) -> u64 {
        self.0
    }
}
