//! Our side of `make bench-peers`: a server on standard input and output for `compare.py`, which times its
//! peers and this program in turns, so that both meet the same noise. One request and one answer a line, as
//! JSON:
//!
//! - `{"case": ...}` ([`Case`]) prepares a piece of work, does it once, leaves its result in a file, and
//!   answers `{"bytes": n}`: what one step streams, where that is known;
//! - `{"repeat": n}` does it n times and answers `{"seconds": [...]}`, the thread's processor time for each.
//!
//! Arrays are files of little-endian numbers without a header, as `numpy.fromfile` reads them.

mod arrays;
mod camera;
mod cases;
mod distribution;
#[path = "../steps/stream.rs"]
mod stream;
mod work;

use cases::{Case, prepare};
use rustix::time::{ClockId, clock_gettime};
use serde::Deserialize;
use std::error::Error;
use std::io::{BufRead, Write};
use work::Work;

#[derive(Deserialize)]
#[serde(untagged)]
enum Request {
    Repeat { repeat: usize },
    Prepare(Case),
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut work: Option<Work> = None;
    for line in std::io::stdin().lock().lines() {
        let answer = match serde_json::from_str(&line?)? {
            Request::Prepare(case) => {
                let (bytes, prepared) = prepare(case)?;
                work = Some(prepared);
                serde_json::json!({ "bytes": bytes })
            }
            Request::Repeat { repeat } => {
                let work = work.as_mut().ok_or("repeat what? no case has been prepared")?;
                let mut seconds = Vec::with_capacity(repeat);
                for _ in 0..repeat {
                    let start = processor_s();
                    work()?;
                    seconds.push(processor_s() - start);
                }
                serde_json::json!({ "seconds": seconds })
            }
        };
        let mut output = std::io::stdout().lock();
        writeln!(output, "{answer}")?;
        output.flush()?;
    }
    Ok(())
}

fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
