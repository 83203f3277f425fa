//! A headless browser, driven by the tests.

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use lightcast::rt::Shutdown;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A test that waits longer than this would wait for ever; the machine may be busy with other work.
const PATIENCE: Duration = Duration::from_secs(90);

/// Waits a little.
pub fn pause() {
    Shutdown::new().wait(Duration::from_millis(50));
}

/// Ends the process when the test does, whatever its outcome.
pub struct Guard(pub Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A driver with its browsers, all in one process group: a browser outlives a driver that is killed.
struct Driver {
    group: u32,
    _child: Guard,
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = Command::new("kill").args(["-KILL", "--", &format!("-{}", self.group)]).status();
    }
}

/// A session with one tab, over the W3C WebDriver protocol: JSON over HTTP.
pub struct Browser {
    port: u16,
    session: String,
    _driver: Driver,
    _profile: TempDir,
}

/// The driver and its port; the error says why there is none.
fn driver() -> Result<(Driver, u16), &'static str> {
    let version = Command::new("chromium").arg("--version").stderr(Stdio::null()).output();
    if !version.is_ok_and(|output| output.status.success()) {
        return Err("there is no chromium");
    }
    let child = Command::new("chromedriver")
        .arg("--port=0")
        .process_group(0)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut child = Guard(child.map_err(|_| "there is no chromedriver")?);
    let mut lines = BufReader::new(child.0.stdout.take().unwrap()).lines();
    let driver = Driver { group: child.0.id(), _child: child };
    let port = lines.find_map(|line| {
        let line = line.unwrap();
        line.split_once("started successfully on port ")?.1.trim_end_matches('.').parse().ok()
    });
    // Nothing else is read from it: it writes no more.
    Ok((driver, port.expect("chromedriver says its port")))
}

impl Browser {
    /// Starts a browser; the error says why there is none.
    pub fn start() -> Result<Self, &'static str> {
        let (driver, port) = driver()?;
        let profile = tempfile::tempdir().unwrap();
        let folder = format!("--user-data-dir={}", profile.path().display());
        let arguments = [
            "--headless",
            "--no-sandbox",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            "--hide-scrollbars",
            &folder,
        ];
        let capabilities = json!({
            "browserName": "chrome",
            "goog:chromeOptions": { "args": arguments },
            "goog:loggingPrefs": { "browser": "ALL" },
        });
        let mut browser = Self { port, session: String::new(), _driver: driver, _profile: profile };
        let session = json!({ "capabilities": { "alwaysMatch": capabilities } });
        let begun = browser.request("POST", "/session", Some(&session));
        browser.session = begun["sessionId"].as_str().unwrap().to_owned();
        Ok(browser)
    }

    /// Sends a request to the driver; returns the `value` of its answer.
    #[track_caller]
    fn request(&self, method: &str, path: &str, body: Option<&Value>) -> Value {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let body = body.map(Value::to_string).unwrap_or_default();
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n",
            self.port,
            body.len()
        );
        stream.write_all((head + &body).as_bytes()).unwrap();
        let mut reader = BufReader::new(stream);
        let (mut status, mut length) = (String::new(), 0);
        reader.read_line(&mut status).unwrap();
        loop {
            let mut line = String::new();
            reader.read_line(&mut line).unwrap();
            match line.trim_end().split_once(':') {
                Some((name, value)) if name.eq_ignore_ascii_case("content-length") => {
                    length = value.trim().parse().unwrap();
                }
                Some(_) => {}
                None => break,
            }
        }
        let mut answer = vec![0; length];
        reader.read_exact(&mut answer).unwrap();
        let mut answer: Value = serde_json::from_slice(&answer).unwrap();
        assert!(status.contains(" 200 "), "{method} {path}: {status}{answer}");
        answer["value"].take()
    }

    /// Sends a command to the session.
    #[track_caller]
    fn post(&self, path: &str, body: &Value) -> Value {
        self.request("POST", &format!("/session/{}/{path}", self.session), Some(body))
    }

    /// Opens a page.
    pub fn open(&self, url: &str) {
        self.post("url", &json!({ "url": url }));
    }

    /// Loads the page again.
    pub fn reload(&self) {
        self.post("refresh", &json!({}));
    }

    /// The path of the element with this id.
    fn element(&self, id: &str) -> String {
        let found = self.post("element", &json!({ "using": "css selector", "value": format!("#{id}") }));
        let (_, reference) = found.as_object().unwrap().iter().next().unwrap();
        format!("element/{}", reference.as_str().unwrap())
    }

    /// Presses keys with the element with this id in focus.
    pub fn press(&self, id: &str, keys: &str) {
        self.post(&format!("{}/value", self.element(id)), &json!({ "text": keys }));
    }

    /// Clears the field with this id.
    pub fn clear(&self, id: &str) {
        self.post(&format!("{}/clear", self.element(id)), &json!({}));
    }

    /// Runs a script that gets `arguments` and a function to call with its result, which is returned.
    pub fn run(&self, script: &str, arguments: &Value) -> Value {
        self.post("execute/async", &json!({ "script": script, "args": arguments }))
    }

    /// Shows the page on a screen of this size, in CSS pixels.
    pub fn resize(&self, width: u32, height: u32, is_phone: bool) {
        let metrics = json!({
            "width": width, "height": height, "deviceScaleFactor": if is_phone { 2 } else { 1 }, "mobile": is_phone,
        });
        let body = json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": metrics });
        self.post("goog/cdp/execute", &body);
    }

    /// The value of a JavaScript expression.
    pub fn value(&self, expression: &str) -> Value {
        self.post("execute/sync", &json!({ "script": format!("return {expression}"), "args": [] }))
    }

    /// Waits until a JavaScript expression is true.
    pub fn until(&self, expression: &str) {
        let start = Instant::now();
        while self.value(&format!("Boolean({expression})")) != json!(true) {
            if start.elapsed() > PATIENCE {
                let body = self.value("document.body.innerText");
                let data = self.value("JSON.stringify(document.body.dataset)");
                panic!("not so: {expression}\n{data}\n{body}");
            }
            pause();
        }
    }

    /// The errors on the console since the last call.
    pub fn errors(&self) -> Vec<String> {
        let entries = self.post("se/log", &json!({ "type": "browser" }));
        let entries = entries.as_array().unwrap().iter();
        entries.filter(|entry| entry["level"] == "SEVERE").map(|entry| entry["message"].to_string()).collect()
    }

    /// Saves a screenshot of the page, and returns it.
    pub fn picture(&self, file: &Path) -> image::RgbImage {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        let encoded = self.request("GET", &format!("/session/{}/screenshot", self.session), None);
        let png = BASE64_STANDARD.decode(encoded.as_str().unwrap()).unwrap();
        std::fs::write(file, &png).unwrap();
        image::load_from_memory(&png).unwrap().into_rgb8()
    }
}
