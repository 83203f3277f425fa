//! How many WebSocket frames a client may send. Messages are no measure: one may have frames without end.

use crate::wire::DEMAND_MAX_BYTES;

/// Frames that a client may send at once, and how many more in a second; more is a flood.
const BURST: f64 = 20.0;
const FRAMES_PER_SECOND: f64 = 4.0;
/// Longest frame that is allowed, with its head: as many bytes for every frame, wherever frames begin and end.
const FRAME_MAX_BYTES: f64 = DEMAND_MAX_BYTES as f64 + 14.0;

/// Counts the frames that a client sends.
#[derive(Debug)]
pub(super) struct Frames {
    heads: Heads,
    frames: Allowance,
    bytes: Allowance,
    is_told: bool,
}

impl Frames {
    pub fn new(now_ns: i64) -> Self {
        let frames = Allowance { most: BURST, per_second: FRAMES_PER_SECOND, left: BURST, at_ns: now_ns };
        Self { heads: Heads::default(), frames, bytes: frames.times(FRAME_MAX_BYTES), is_told: false }
    }

    /// Counts the frames that begin in these bytes, which came at this time.
    pub fn count(&mut self, bytes: &[u8], now_ns: i64) {
        self.frames.take(self.heads.count(bytes) as f64, now_ns);
        self.bytes.take(bytes.len() as f64, now_ns);
    }

    /// Whether the client has sent too much; true once, so that what it sends meanwhile can be read and dropped,
    /// and it gets to read why it is disconnected.
    pub fn is_new_flood(&mut self) -> bool {
        let is_flood = self.frames.left < 0.0 || self.bytes.left < 0.0;
        is_flood && !std::mem::replace(&mut self.is_told, is_flood)
    }
}

/// How much may come at once, and how much more in a second.
#[derive(Clone, Copy, Debug)]
struct Allowance {
    most: f64,
    per_second: f64,
    /// Below 0: more has come.
    left: f64,
    at_ns: i64,
}

impl Allowance {
    fn times(self, factor: f64) -> Self {
        let [most, per_second, left] = [self.most, self.per_second, self.left].map(|value| value * factor);
        Self { most, per_second, left, ..self }
    }

    fn take(&mut self, count: f64, now_ns: i64) {
        let since_s = (now_ns - self.at_ns).max(0) as f64 * 1e-9;
        self.left = (self.left + since_s * self.per_second).min(self.most) - count;
        self.at_ns = now_ns;
    }
}

/// Finds the heads of masked frames in a stream of bytes.
#[derive(Debug, Default)]
struct Heads {
    /// Bytes of the head so far, and how many there are.
    head: [u8; 10],
    length: usize,
    /// Bytes of masks and payloads to pass over.
    rest: u64,
}

impl Heads {
    /// How many frames begin in these bytes; one whose head is cut counts with its last byte.
    fn count(&mut self, mut bytes: &[u8]) -> u64 {
        let mut count = 0;
        while let Some((&byte, others)) = bytes.split_first() {
            if self.rest > 0 {
                let passed = self.rest.min(bytes.len() as u64);
                self.rest -= passed;
                bytes = &bytes[passed as usize..];
                continue;
            }
            bytes = others;
            self.head[self.length] = byte;
            self.length += 1;
            if let Some(rest) = payload(&self.head[..self.length]) {
                (self.rest, self.length) = (rest, 0);
                count += 1;
            }
        }
        count
    }
}

/// The bytes of mask and payload that follow this head; `None` where it is cut.
fn payload(head: &[u8]) -> Option<u64> {
    let (second, more) = (*head.get(1)?, &head[2..]);
    let mask = if second & 0x80 == 0 { 0 } else { 4 };
    let length = match second & 0x7f {
        126 => u64::from(u16::from_be_bytes(more.try_into().ok()?)),
        127 => u64::from_be_bytes(more.try_into().ok()?),
        length => u64::from(length),
    };
    Some(length.saturating_add(mask))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn frames_are_found_however_their_bytes_arrive() {
        let frame = |first: u8, payload: usize| {
            let mut bytes = vec![first];
            match payload {
                0..126 => bytes.push(0x80 | payload as u8),
                126..65_536 => bytes.extend([&[0xfe], &(payload as u16).to_be_bytes()[..]].concat()),
                _ => bytes.extend([&[0xff], &(payload as u64).to_be_bytes()[..]].concat()),
            }
            bytes.extend(vec![0x81; 4 + payload]);
            bytes
        };
        let stream =
            [frame(1, 3), frame(0, 0), frame(0, 300), frame(0x89, 125), frame(0x80, 70_000)].concat();
        for step in [1, 2, 3, 7, 1000, stream.len()] {
            let mut heads = Heads::default();
            assert_eq!(stream.chunks(step).map(|bytes| heads.count(bytes)).sum::<u64>(), 5, "{step}");
            assert_eq!((heads.rest, heads.length), (0, 0));
        }
    }

    #[test]
    fn a_burst_is_let_through_a_flood_is_told_once() {
        let mut frames = Frames::new(0);
        let empty_continuation = [0, 0x80, 1, 2, 3, 4];
        for second in 0..100 {
            (0..3).for_each(|_| frames.count(&empty_continuation, second * SECOND_NS));
            assert!(!frames.is_new_flood());
        }
        (0..30).for_each(|_| frames.count(&empty_continuation, 100 * SECOND_NS));
        assert!(frames.is_new_flood());
        assert!(!frames.is_new_flood());
    }

    #[test]
    fn bytes_without_frames_are_a_flood_too() {
        let mut frames = Frames::new(0);
        // A frame that claims to be endless.
        frames.count(&[0x82, 0xff, 0x7f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff], 0);
        frames.count(&vec![0; 80_000], 0);
        assert!(!frames.is_new_flood());
        frames.count(&vec![0; 8_000], 0);
        assert!(frames.is_new_flood());
    }
}
