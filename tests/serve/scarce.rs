//! A service for which something runs out: file handles, the disk, its folder.

use crate::connection::{connect, get, next_json, wait_until};
use crate::program::Running;
use crate::recording::{Recording, lists, names};
use rustix::process::{Pid, Resource, Rlimit, prlimit};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use tokio_tungstenite::tungstenite::WebSocket;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

/// A replay of `count` frames without an end.
fn endless(count: u64) -> Recording {
    let recording = Recording::new(count);
    recording.configure("pace = \"real-time\"\nrepeat = true");
    recording
}

/// The same command under a limit of the shell's.
fn limited(limit: &str, command: &Command) -> Command {
    let mut limited = Command::new("sh");
    limited.args(["-c", &format!("ulimit {limit} && exec \"$@\""), "sh"]).arg(command.get_program());
    limited.args(command.get_args()).env_remove("RUST_LOG").stderr(Stdio::piped());
    limited
}

fn client(running: &Running) -> WebSocket<TcpStream> {
    // It may wait for the processor, among other tests.
    let mut request = format!("ws://{}/ws?queue=64", running.address).into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", "lightcast.v1.json".parse().unwrap());
    connect(request, running.address).unwrap()
}

/// Takes that many lists; returns how many were lost before them.
fn lost(socket: &mut WebSocket<TcpStream>, count: usize) -> u64 {
    (0..count).map(|_| next_json(socket)["stream"]["lost"].as_u64().unwrap()).sum()
}

/// A value of `/metrics` by its name and labels, 0 where it is not there.
fn metric(running: &Running, name: &str) -> f64 {
    let text = get(running.address, "/metrics", &[]).1;
    let line = text.lines().find(|line| line.starts_with(name));
    line.map_or(0.0, |line| line.rsplit(' ').next().unwrap().parse().unwrap())
}

fn bad_frames(running: &Running, stage: &str) -> f64 {
    metric(running, &format!("lightcast_stage_bad_frames_total{{stage=\"{stage}\"}}"))
}

#[test]
fn connections_never_take_the_handles_of_files() {
    let recording = endless(20);
    let mut command = recording.command();
    let folder = recording.path().join("frames");
    command.args(["--listen", "127.0.0.1:0", "--record"]).arg(&folder);
    let mut running = Running::start(&mut limited("-n 64", &command));
    assert!(running.said().contains("clients_max = 256, but the limit of open files leaves room for 24"));
    let mut listens = client(&running);
    let idle: Vec<_> = (0..60).map(|_| TcpStream::connect(running.address).unwrap()).collect();
    assert_eq!(lost(&mut listens, 50), 0);
    drop(idle);
    wait_until(|| get(running.address, "/readyz", &[]).0 == 200);
    assert_eq!((bad_frames(&running, "source"), bad_frames(&running, "record")), (0.0, 0.0));
    // More streams than there is room for are told so.
    let streams: Vec<_> = (0..24).map(|_| client_or_refusal(&running)).collect();
    assert_eq!(streams.iter().filter(|stream| stream.is_ok()).count(), 23);
    assert!(streams[23].as_ref().unwrap_err().contains("503"), "{streams:?}");
    assert_eq!(lost(&mut listens, 1), 0);
    running.signal("TERM");
    assert_eq!(running.child.wait().unwrap().code(), Some(0), "{}", running.said());
    assert!(names(&folder).len() > 50);
}

fn client_or_refusal(running: &Running) -> Result<WebSocket<TcpStream>, String> {
    let mut request = format!("ws://{}/ws", running.address).into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", "lightcast.v1.bin".parse().unwrap());
    connect(request, running.address).map_err(|error| error.to_string())
}

#[test]
fn a_lack_of_handles_is_waited_out_and_loses_no_frame() {
    let recording = endless(20);
    let folder = recording.path().join("frames");
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--record"]).arg(&folder);
    let mut running = Running::start(&mut command);
    let mut listens = client(&running);
    next_json(&mut listens);
    let pid = Pid::from_child(&running.child);
    // The program has raised its limit to the highest, which this process was started with too.
    let maximum = rustix::process::getrlimit(Resource::Nofile).maximum;
    let most = prlimit(Some(pid), Resource::Nofile, Rlimit { current: Some(3), maximum });
    running.wait_for("Too many open files");
    running.wait_for("trying again");
    prlimit(Some(pid), Resource::Nofile, most.unwrap()).unwrap();
    running.wait_for("source: goes on");
    let sequence = |list: &serde_json::Value| list["sequence"].as_u64().unwrap();
    let mut last = sequence(&next_json(&mut listens));
    for _ in 0..30 {
        let next = sequence(&next_json(&mut listens));
        assert_eq!(next, last + 1);
        last = next;
    }
    assert_eq!((bad_frames(&running, "source"), bad_frames(&running, "record")), (0.0, 0.0));
    assert!(metric(&running, "lightcast_stage_events_total{stage=\"source\",event=\"waits for what") > 0.0);
    running.signal("TERM");
    assert_eq!(running.child.wait().unwrap().code(), Some(0), "{}", running.said());
    let sidecar = std::fs::read_to_string(folder.join("recording.json")).unwrap();
    assert!(sidecar.contains("\"is_complete\": true"), "{sidecar}");
}

#[test]
fn a_folder_that_is_away_for_a_while_is_waited_for() {
    let recording = endless(10);
    let [folder, away] = ["frames", "away"].map(|name| recording.path().join(name));
    std::fs::create_dir(&folder).unwrap();
    for number in 0..10 {
        let file = recording.file(number);
        std::fs::rename(&file, folder.join(file.file_name().unwrap())).unwrap();
    }
    let text = std::fs::read_to_string(recording.configuration()).unwrap();
    std::fs::write(recording.configuration(), text.replace("sky.####", "frames/sky.####")).unwrap();
    let mut running = Running::start(recording.command().args(["--listen", "127.0.0.1:0"]));
    let mut listens = client(&running);
    let sequence = |list: &serde_json::Value| list["sequence"].as_u64().unwrap();
    // The filter's delay of 4 frames lies between a frame and its list.
    let before = (0..10).map(|_| sequence(&next_json(&mut listens))).last().unwrap();
    let started = std::time::Instant::now();
    std::fs::rename(&folder, &away).unwrap();
    running.wait_for("none of its 10 files can be used for now; trying again");
    running.wait_for("none of its 10 files can be used for now; trying again");
    std::fs::rename(&away, &folder).unwrap();
    let frames = (started.elapsed().as_secs_f64() * 25.0) as u64;
    running.wait_for("source: goes on");
    let mut after = before;
    // The filter still had some lists.
    while after < before + 15 {
        after = sequence(&next_json(&mut listens));
    }
    assert!(after <= before + frames + 8, "{before} {after}: bad frames take their time");
    let received = std::time::Instant::now();
    assert_eq!((0..26).map(|_| sequence(&next_json(&mut listens))).last().unwrap(), after + 26);
    assert!(received.elapsed().as_secs_f64() > 0.8, "nothing is made up for: {:?}", received.elapsed());
    let bad = bad_frames(&running, "source");
    assert!(bad >= 20.0 && bad <= frames as f64 + 5.0, "{bad} in the time of {frames}");
    running.end();
}

/// Waits for the reload to be over.
fn reload(running: &mut Running) {
    running.signal("HUP");
    running.wait_for("taken anew");
}

fn lines(path: &std::path::Path) -> Vec<serde_json::Value> {
    lists(&std::fs::read(path).unwrap())
}

#[test]
fn an_output_is_gone_on_with_rotated_and_kept_from_a_second_writer() {
    let recording = endless(10);
    let (path, old) = (recording.path().join("lists"), recording.path().join("lists.1"));
    std::fs::write(&path, "{\"of\":\"yesterday\"}\n{\"cut\":").unwrap();
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output"]).arg(&path);
    let mut running = Running::start(&mut command);
    let mut listens = client(&running);
    (0..5).for_each(|_| drop(next_json(&mut listens)));
    let second = command.output().unwrap();
    let told = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(second.status.code() == Some(1) && told.contains("another program writes to it"), "{told}");
    std::fs::rename(&path, &old).unwrap();
    // Also where the configuration is not taken.
    let good = std::fs::read(recording.configuration()).unwrap();
    std::fs::write(recording.configuration(), "nonsense").unwrap();
    running.signal("HUP");
    running.wait_for("the configuration is not taken, the old one stays");
    wait_until(|| path.exists() && lines(&path).len() > 2);
    std::fs::write(recording.configuration(), good).unwrap();
    let before = lines(&path).len();
    running.signal("HUP");
    running.wait_for("is as before");
    wait_until(|| lines(&path).len() > before + 2);
    running.end();
    let text = std::fs::read_to_string(&old).unwrap();
    assert!(text.starts_with("{\"of\":\"yesterday\"}\n{\"cut\":\n{\"version\":1,"), "{text}");
    assert!(text.ends_with("}\n"), "the file that was rotated ends with a whole line");
    let sequences =
        |path| lines(path).iter().map(|list| list["sequence"].as_u64().unwrap()).collect::<Vec<_>>();
    let (first, last) = (text.lines().last().unwrap().to_owned(), sequences(&path));
    let first: serde_json::Value = serde_json::from_str(&first).unwrap();
    assert_eq!(first["sequence"].as_u64().unwrap() + 1, last[0], "no list is lost between the two files");
}

/// Rotated every hour, a day of a service: what `logrotate` does, without the hours between.
#[test]
fn no_list_is_lost_or_cut_in_a_day_of_rotations_and_the_service_goes_on() {
    let recording = endless(10);
    let path = recording.path().join("lists");
    let rotated = |hour: u64| recording.path().join(format!("lists.{hour}"));
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output"]).arg(&path);
    let mut running = Running::start(&mut command);
    for hour in 0..24 {
        wait_until(|| path.exists() && !std::fs::read(&path).unwrap().is_empty());
        std::fs::rename(&path, rotated(hour)).unwrap();
        running.signal("HUP");
        running.wait_for("is as before");
    }
    wait_until(|| path.exists() && !std::fs::read(&path).unwrap().is_empty());
    let said = running.end();
    assert!(!said.contains("taken anew"), "{said}");
    let all = (0..24).map(rotated).chain([path]).flat_map(|path| lines(&path));
    let sequences: Vec<u64> = all.map(|list| list["sequence"].as_u64().unwrap()).collect();
    assert!(
        sequences.len() >= 25 && sequences.iter().copied().eq(0..sequences.len() as u64),
        "{sequences:?}"
    );
}

#[test]
fn a_full_disk_ends_one_output_and_says_so() {
    let recording = endless(10);
    let pictures = recording.path().join("pictures");
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output", "/dev/full", "--picture-every", "2", "--pictures"]);
    let mut running = Running::start(command.arg(&pictures));
    running.wait_for("publish has ended, all else goes on");
    let mut listens = client(&running);
    wait_until(|| !names(&pictures).is_empty());
    std::fs::remove_dir_all(&pictures).unwrap();
    std::fs::write(&pictures, "a file in place of the folder").unwrap();
    running.wait_for("picture has ended, all else goes on");
    assert_eq!(lost(&mut listens, 20), 0);
    for stage in ["publish", "picture"] {
        let name = format!("lightcast_stage_events_total{{stage=\"{stage}\",event=\"ended alone\"}}");
        assert_eq!(metric(&running, &name), 1.0, "{stage}");
    }
    running.signal("TERM");
    assert_eq!(running.child.wait().unwrap().code(), Some(1), "what was not written is told in the end");
}

#[test]
fn wrong_tokens_are_told_in_sum_and_a_token_that_is_dropped_is_warned_of() {
    let recording = endless(10);
    std::fs::write(recording.path().join("token"), "0123456789abcdef").unwrap();
    let text = std::fs::read_to_string(recording.configuration()).unwrap();
    std::fs::write(recording.configuration(), text.clone() + "[server]\ntoken_file = \"token\"\n").unwrap();
    let mut running = Running::start(recording.command().args(["--listen", "0.0.0.0:0"]));
    running.address.set_ip(std::net::Ipv4Addr::LOCALHOST.into());
    for _ in 0..200 {
        assert_eq!(get(running.address, "/lights", &[("Authorization", "Bearer wrong")]).0, 401);
    }
    assert!(running.wait_for("without the token").contains("1 requests without the token"));
    assert!(running.wait_for("without the token").contains("199 more requests without the token"));
    assert!(!running.said().contains("whoever reaches it gets in"));
    std::fs::write(recording.configuration(), text).unwrap();
    reload(&mut running);
    running.wait_for("whoever reaches it gets in");
    running.end();
}

#[test]
fn what_a_reload_cannot_have_leaves_the_old_service_running() {
    let recording = endless(20);
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0"]);
    let mut running = Running::start(&mut limited("-v 2500000", &command));
    let mut listens = client(&running);
    let good = std::fs::read_to_string(recording.configuration()).unwrap();
    for (bad, told) in [
        (
            good.replace("columns = 90\nrows = 23", "columns = 16384\nrows = 4096"),
            "the limit of the address space",
        ),
        (good.clone() + "[filter]\ndelay_s = 6.0\n", "1.76 s are enough"),
        (good.clone() + "[server]\ntoken_file = \"/dev/zero\"\n", "this one has 65537"),
    ] {
        std::fs::write(recording.configuration(), bad).unwrap();
        running.signal("HUP");
        let line = running.wait_for("the configuration is not taken, the old one stays");
        assert!(line.contains(told), "{line}");
    }
    let (configuration, pipe) = (recording.configuration(), recording.path().join("pipe"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    std::fs::rename(&pipe, &configuration).unwrap();
    running.signal("HUP");
    assert_eq!(lost(&mut listens, 100), 0, "lists flow meanwhile");
    let line = running.wait_for("the configuration is not taken, the old one stays");
    assert!(line.contains("a pipe into which nobody writes"), "{line}");
    // While it is waited for, the first signal ends the program.
    running.signal("HUP");
    (0..10).for_each(|_| drop(next_json(&mut listens)));
    let signalled = std::time::Instant::now();
    running.signal("TERM");
    assert_eq!(running.child.wait().unwrap().code(), Some(0), "{}", running.said());
    assert!(signalled.elapsed().as_secs() < 4, "{:?}", signalled.elapsed());
}

#[test]
fn a_page_that_is_refused_is_told_once_with_what_lets_it_in() {
    let recording = endless(10);
    let mut running = Running::start(recording.command().args(["--listen", "127.0.0.1:0"]));
    for _ in 0..3 {
        for origin in ["https://evil.example", "http://other.example:8080"] {
            assert_eq!(get(running.address, "/lights", &[("Origin", origin)]).0, 403);
        }
    }
    assert_eq!(get(running.address, "/lights", &[("Host", "evil.example")]).0, 403);
    running.wait_for("set [server] origins = [\"https://evil.example\"]");
    running.wait_for("set [server] origins = [\"http://other.example:8080\"]");
    running.wait_for("requests to the name \"evil.example\" are refused");
    assert_eq!(running.end().matches("are refused; to let them connect").count(), 2);
}
