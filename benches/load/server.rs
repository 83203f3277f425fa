//! The server: the program in a process of its own, and the resources that it uses.

use lightcast::files::{read, write_exr};
use lightcast_core::image::{Frame, Pixels};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

pub struct Server {
    child: Child,
    address: SocketAddr,
    /// Reads the program's messages, which would block it otherwise, and returns them at the end.
    listener: Option<JoinHandle<String>>,
    _folder: tempfile::TempDir,
}

/// The resources that a process used over some time.
#[derive(Clone, Copy)]
pub struct Use {
    pub wall_s: f64,
    pub processor_s: f64,
    /// The maximum.
    pub resident_mb: f64,
}

/// The newest map in several forms.
pub struct MapBytes {
    pub exr_bytes: usize,
    pub half_exr_bytes: usize,
    pub jpeg_bytes: usize,
}

/// Clock ticks a second in `/proc`: the kernel's USER_HZ, 100 on every machine that Linux is built for here.
const TICKS_HZ: f64 = 100.0;

/// Every client is an open file, here too.
pub fn allow_many_connections() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit }).unwrap();
}

impl Server {
    /// The bundled sequence in a loop, 300 lights a list.
    pub fn start(clients_max: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let text = fs::read_to_string(root.join("config/stream.toml")).unwrap();
        let replay = root.join("replay").display().to_string();
        let text = text.replace("../replay", &replay)
            + &format!("\n[lights]\ncount = 300\n\n[server]\nclients_max = {clients_max}\n");
        let path = folder.path().join("load.toml");
        fs::write(&path, text).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_lightcast"))
            .args(["run", "--listen", "127.0.0.1:0", "--config"])
            .arg(&path)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut messages = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("listening on http://") {
            line.clear();
            assert!(messages.read_line(&mut line).unwrap() > 0, "the server has ended");
        }
        let (_, rest) = line.split_once("http://").unwrap();
        let address = rest.split('/').next().unwrap().parse().unwrap();
        let listen = move || {
            let mut said = String::new();
            messages.read_to_string(&mut said).unwrap();
            said
        };
        let listener = Builder::new().name("messages".into()).spawn(listen).unwrap();
        Self { child, address, listener: Some(listener), _folder: folder }
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The resources that the process uses from now on, during `time`.
    pub fn measure(&self, time: Duration) -> Use {
        let (started, before_s) = (Instant::now(), self.processor_s());
        let mut resident_mb = 0.0_f64;
        while started.elapsed() < time {
            lightcast::rt::Shutdown::new().wait(Duration::from_millis(100));
            resident_mb = resident_mb.max(self.resident_mb());
        }
        Use {
            wall_s: started.elapsed().as_secs_f64(),
            processor_s: self.processor_s() - before_s,
            resident_mb,
        }
    }

    fn processor_s(&self) -> f64 {
        let text = fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap();
        // The name in parentheses may have spaces.
        let (_, rest) = text.rsplit_once(')').unwrap();
        let fields: Vec<&str> = rest.split_whitespace().collect();
        (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / TICKS_HZ
    }

    fn resident_mb(&self) -> f64 {
        let text = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = text.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
    }

    fn get(&self, path: &str) -> Vec<u8> {
        let mut stream = TcpStream::connect(self.address).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let head = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").unwrap();
        answer.split_off(head + 4)
    }

    pub fn list_json_bytes(&self) -> usize {
        self.get("/lights").len()
    }

    pub fn map(&self) -> MapBytes {
        let folder = tempfile::tempdir().unwrap();
        let exr = self.get("/map.exr");
        let path = folder.path().join("map.exr");
        fs::write(&path, &exr).unwrap();
        let mut frame = Frame::default();
        read(&path, &mut frame).unwrap();
        write_exr(&path, &frame, None, true).unwrap();
        let half_exr_bytes = fs::metadata(&path).unwrap().len() as usize;
        let png = folder.path().join("map.png");
        fs::write(&png, self.get("/map.png")).unwrap();
        read(&png, &mut frame).unwrap();
        let Pixels::Codes(codes) = &frame.pixels else { panic!("a PNG of radiance") };
        let rgb: Vec<u8> = codes.iter().map(|&code| code as u8).collect();
        let mut jpeg = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 90)
            .encode(&rgb, frame.width as u32, frame.height as u32, image::ExtendedColorType::Rgb8)
            .unwrap();
        MapBytes { exr_bytes: exr.len(), half_exr_bytes, jpeg_bytes: jpeg.len() }
    }

    pub fn stop(mut self) {
        Command::new("kill").args(["-TERM", &self.child.id().to_string()]).status().unwrap();
        let said = self.listener.take().unwrap().join().unwrap();
        assert!(self.child.wait().unwrap().success(), "{said}");
        let summary = said.lines().skip_while(|line| !line.starts_with("stage"));
        summary.for_each(|line| println!("{line}"));
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // This matters only where something has failed before.
        let _ = self.child.kill();
    }
}
