//! Damage to messages.

/// Marsaglia's xorshift64.
pub struct XorShift(pub u64);

impl XorShift {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }
}

/// Changes some bytes, inserts pieces, removes or duplicates ranges, or truncates; every eighth time the
/// whole input is random.
pub fn mutate(input: &mut Vec<u8>, sound: &[Vec<u8>], pieces: &[&str], random: &mut XorShift) {
    input.clear();
    if random.below(8) == 0 {
        let length = random.below(200);
        for _ in 0..length {
            match random.below(4) {
                0 => input.extend_from_slice(pieces[random.below(pieces.len())].as_bytes()),
                1 => input.push(random.next() as u8),
                _ => input.push(b' ' + random.below(95) as u8),
            }
        }
        return;
    }
    input.extend_from_slice(&sound[random.below(sound.len())]);
    for _ in 0..1 + random.below(4) * random.below(2) {
        // The headers of binary messages hold lengths: half of the mutations are there.
        let range = if random.below(2) == 0 { input.len() } else { input.len().min(160) };
        if range == 0 {
            return;
        }
        let at = random.below(range);
        let end = input.len().min(at + 1 + random.below(24));
        match random.below(10) {
            0 => input[at] ^= 1 << random.below(8),
            1 => input[at] = 0xff,
            2 => input[at] = 0,
            3 => input[at] = random.next() as u8,
            4 => {
                let piece = pieces[random.below(pieces.len())].as_bytes();
                let end = if random.below(2) == 0 { at } else { end };
                input.splice(at..end, piece.iter().copied());
            }
            5 => input[at] = b'0' + random.below(10) as u8,
            6 => drop(input.drain(at..end)),
            7 => {
                let range = input[at..end].to_vec();
                input.splice(at..at, range);
            }
            8 => input.truncate(at),
            _ => {
                let word = input[at..end].len().min(4);
                let value = [0, 1, 0x7f80_0000, 0x7fc0_0000, 0x8000_0000, u32::MAX][random.below(6)];
                input[at..at + word].copy_from_slice(&u32::to_le_bytes(value)[..word]);
            }
        }
    }
}

/// The input as a literal that can be pasted into a test.
pub fn shown(input: &[u8]) -> String {
    format!("{} bytes: b\"{}\"", input.len(), input.escape_ascii())
}
