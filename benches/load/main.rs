//! `make load`: a thousand clients on this machine at 25 lists per second of 300 lights, a hundred of which
//! stop reading for a while. The server is `lightcast run --listen` as users start it, in a process of its
//! own; the clients are this one.
//!
//! Arguments: number of clients (1000), seconds of each of the three phases (10), `json` for lists as JSON.
#![expect(clippy::unwrap_used, reason = "nobody is there to go on for")]

mod clients;
mod server;

use clients::{Clients, Figures};
use lightcast_core::math::percentile;
use server::Server;
use std::fmt::Write as _;
use std::time::Duration;

/// One client in ten stops reading in the second phase.
const STALLED: usize = 10;

fn main() {
    // `cargo bench` adds an argument of its own, `cargo test --benches` another one; this program should run
    // only under the former.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if arguments.iter().any(|argument| argument == "--test") {
        return;
    }
    let number = |at: usize, default| arguments.get(at).map_or(default, |text| text.parse().unwrap());
    let (count, seconds) = (number(0, 1000), number(1, 10));
    let is_binary = arguments.get(2).is_none_or(|text| text != "json");
    let phase = Duration::from_secs(seconds as u64);
    server::allow_many_connections();

    let server = Server::start(count + 10);
    let idle = server.measure(Duration::from_secs(5));
    let clients = Clients::start(server.address(), count, count / STALLED, is_binary);
    // Waits until all are connected and have got their first lists, which all come at the same time.
    clients.wait_for_all();
    clients.pause(Duration::from_secs(2));

    let kind = if is_binary { "bytes" } else { "JSON" };
    println!(
        "{count} clients, 300 lights, 25 lists/s, as {kind}; {} stall in the second phase\n",
        count / STALLED
    );
    println!(
        "{:<22} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11} {:>9} {:>8}",
        "", "lists/s", "lost", "p50 ms", "p99 ms", "max ms", "us a list*", "cpu %", "MB"
    );
    let mut rows = Vec::new();
    for name in ["all read", "a tenth stalls", "all read again"] {
        clients.stall(name == "a tenth stalls");
        clients.take_figures();
        let used = server.measure(phase);
        let figures = clients.take_figures();
        print_row(name, &figures, &used, &idle, phase);
        rows.push((figures, used));
    }
    println!(
        "\n* of the server's processor time for one list to one client, less what it takes without clients ({:.1} % of one\n  \
         processor). Ages: from capture to decoded at the client, of those who never stall. MB: resident, most of the phase.",
        100.0 * idle.processor_s / idle.wall_s
    );
    let back = &rows[2].0;
    println!(
        "\nthe stalled learned of {} lost lists in all when they read again ({:.0} each; {:.0} lists were sent meanwhile)",
        back.stalled_lost,
        back.stalled_lost as f64 / (count / STALLED) as f64,
        25.0 * phase.as_secs_f64()
    );
    println!("\n{}", bandwidth(&server, back.message_bytes));
    clients.stop();
    server.stop();
}

fn print_row(name: &str, figures: &Figures, used: &server::Use, idle: &server::Use, phase: Duration) {
    let mut ages_ms: Vec<f64> = figures.ages_ns.iter().map(|&age_ns| age_ns as f64 * 1e-6).collect();
    ages_ms.sort_unstable_by(f64::total_cmp);
    let lists = ages_ms.len() + figures.stalled_lists;
    let extra_s = used.processor_s - idle.processor_s * used.wall_s / idle.wall_s;
    println!(
        "{name:<22} {:>9.0} {:>9} {:>9.2} {:>9.2} {:>9.2} {:>11.2} {:>9.1} {:>8.1}",
        lists as f64 / phase.as_secs_f64(),
        figures.lost,
        percentile(&ages_ms, 0.5),
        percentile(&ages_ms, 0.99),
        percentile(&ages_ms, 1.0),
        1e6 * extra_s / lists as f64,
        100.0 * used.processor_s / used.wall_s,
        used.resident_mb
    );
}

/// The bytes of a second of lists, beside those of a second of the maps that they stand for.
fn bandwidth(server: &Server, message_bytes: usize) -> String {
    let map = server.map();
    let rate_kb = |bytes: usize| bytes as f64 * 25.0 * 1e-3;
    let mut text =
        format!("{:<34} {:>12} {:>12}\n", "25 a second, of 300 lights or of", "bytes each", "kB/s");
    let json = server.list_json_bytes();
    for (name, bytes) in [
        ("lists as these clients get them", message_bytes),
        ("lists as JSON", json),
        ("the map of 360 x 90 as half floats", 360 * 90 * 3 * 2),
        ("the map as OpenEXR (float, ZIP)", map.exr_bytes),
        ("the map as OpenEXR (half, ZIP)", map.half_exr_bytes),
        ("the map as JPEG (8 bits, q 90)", map.jpeg_bytes),
    ] {
        writeln!(text, "{name:<34} {bytes:>12} {:>12.0}", rate_kb(bytes)).unwrap();
    }
    text
}
