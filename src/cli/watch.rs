use super::messages::PROGRESS;
#[cfg(feature = "render")]
use super::render;
use super::signals::SignalWatch;
use crate::error::{Error, Result};
use crate::net::{Client, ClientOptions, Token};
use crate::rt::{Metrics, Shutdown, monotonic_ns, utc_from_monotonic_ns};
use crate::service::Summary;
use crate::wire::{Message, QUEUE_MAX, Subscription, write_list_line};
use clap::ValueEnum;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Show, record or render the lists that a server streams.
///
/// URL is the address of a `run --listen`: ws://HOST:PORT, the address of its page, or HOST:PORT. A connection that
/// breaks is made again, as often as it takes. Without --json, every second one line says what came: the last sequence
/// number, lights, error, lists and kilobytes a second, the median and largest age, and the lists that this client was
/// too slow for. The age is the time since the capture, by the clocks (UTC) of both machines; for a replay as fast as
/// it goes, since the sending.
///
/// --json writes every list as one line, the very bytes that the server's own `run --output` writes where lists come as
/// JSON and nothing is joined; `--format binary` needs a tenth of the bytes and rounds. --record writes these lines to a
/// file. Both let lists wait at the server (--queue) so that none is lost over a hiccup.
///
/// Examples:
///   lightcast watch ws://studio:7300
///   lightcast watch studio:7300 --json --lights 16 | jq .power
///   lightcast watch studio:7300 --lights 72 --render --scene model.glb --ground
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Address of the server.
    url: String,

    /// At most so many lights, which the later ones join.
    #[arg(long, value_name = "N")]
    lights: Option<u32>,

    /// At most so many lists a second.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,

    /// The shortest prefix of the list whose error is under this.
    #[arg(long, value_name = "ERROR")]
    error: Option<f32>,

    /// Lists that wait at the server when this client is slow [default: 1, with --json and --record 64].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(QUEUE_MAX)))]
    queue: Option<u32>,

    /// How lists come [default: binary, with --json and --record json].
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: Option<Format>,

    /// File whose first line is the server's token.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,

    /// Write the lists to standard output, one JSON object a line.
    #[arg(long)]
    json: bool,

    /// Write the lists to this file, one JSON object a line.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// End after so many lists.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,

    /// Light a scene with the stream; all that follows are options of `lightcast render`.
    #[cfg(feature = "render")]
    #[arg(long, value_name = "OPTIONS", num_args = 0.., allow_hyphen_values = true,
          conflicts_with_all = ["json", "record", "count"])]
    render: Option<Vec<std::ffi::OsString>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Json,
    Binary,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let options = client_options(arguments)?;
    #[cfg(feature = "render")]
    if let Some(rest) = &arguments.render {
        return render::run_stream(&render::Arguments::of_stream(&arguments.url, rest), options);
    }
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let mut lines = Lines::open(arguments)?;
    let (metrics, tally) = (Metrics::new("client"), Arc::new(Mutex::new(Tally::default())));
    let (counting, mut left) = (tally.clone(), arguments.count);
    let client = Client::start(options, &metrics, &shutdown, move |message| {
        counting.lock().unwrap_or_else(PoisonError::into_inner).add(message);
        let goes_on = lines.write(message)?;
        left = left.map(|left| left - 1);
        Ok(goes_on && left != Some(0))
    })?;
    let mut printed = Instant::now();
    let outcome = client.join(Duration::from_millis(100), || {
        let elapsed = printed.elapsed();
        if !arguments.json && elapsed >= Duration::from_secs(1) {
            printed += elapsed;
            let mut tally = tally.lock().unwrap_or_else(PoisonError::into_inner);
            if print(&tally, metrics.counter("bytes received").get(), elapsed).is_err() {
                shutdown.request();
            }
            tally.start_anew(metrics.counter("bytes received").get());
        }
    });
    let _ = write!(io::stderr(), "{}", Summary::of(vec![metrics]));
    outcome
}

fn client_options(arguments: &Arguments) -> Result<ClientOptions> {
    let keeps_all = arguments.json || arguments.record.is_some();
    let (queue, format) = if keeps_all { (QUEUE_MAX, Format::Json) } else { (1, Format::Binary) };
    let mut options = ClientOptions::new(&arguments.url)?;
    options.subscription = Subscription {
        lights: arguments.lights,
        rate_hz: arguments.rate_hz,
        error: arguments.error,
        queue: arguments.queue.unwrap_or(queue),
    };
    options.is_binary = arguments.format.unwrap_or(format) == Format::Binary;
    options.token = arguments.token_file.as_deref().map(Token::load).transpose()?;
    Ok(options)
}

/// Where lists go as lines of JSON.
struct Lines {
    /// To standard output.
    is_printed: bool,
    file: Option<(File, PathBuf)>,
    line: Vec<u8>,
}

impl Lines {
    fn open(arguments: &Arguments) -> Result<Self> {
        let file = arguments
            .record
            .as_ref()
            .map(|path| match File::create(path) {
                Ok(file) => Ok((file, path.clone())),
                Err(error) => Err(Error::failed("the file cannot be made").because(error).at(path.display())),
            })
            .transpose()?;
        Ok(Self { is_printed: arguments.json, file, line: Vec::new() })
    }

    /// False when nobody reads them any more.
    fn write(&mut self, message: &Message) -> Result<bool> {
        if !self.is_printed && self.file.is_none() {
            return Ok(true);
        }
        let place = || format!("list {}", message.list.stamp.sequence);
        self.line.clear();
        write_list_line(&message.list, &mut self.line)
            .map_err(|error| Error::failed("cannot be put into JSON").because(error).at(place()))?;
        if let Some((file, path)) = &mut self.file {
            file.write_all(&self.line).map_err(|error| {
                Error::failed("cannot be written").because(error).at(place()).at(path.display())
            })?;
        }
        if self.is_printed {
            let mut output = io::stdout().lock();
            match output.write_all(&self.line).and_then(|()| output.flush()) {
                Ok(()) => {}
                Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(false),
                Err(error) => {
                    return Err(Error::failed("cannot be written").because(error).at(place()));
                }
            }
        }
        Ok(true)
    }
}

/// What came since the last line that was printed.
#[derive(Default)]
struct Tally {
    lists: u64,
    bytes_before: u64,
    lost: u64,
    ages_ns: Vec<i64>,
    sequence: u64,
    light_count: usize,
    error: Option<f32>,
}

/// Ages that are kept of a second.
const AGES_MAX: usize = 10_000;

impl Tally {
    fn add(&mut self, message: &Message) {
        let Message { list, delivery } = message;
        self.lists += 1;
        self.lost += delivery.lost;
        (self.sequence, self.light_count, self.error) = (list.stamp.sequence, list.lights.len(), list.error);
        let now_ns = monotonic_ns().saturating_add(utc_from_monotonic_ns());
        if self.ages_ns.len() < AGES_MAX {
            self.ages_ns.push(now_ns.saturating_sub(delivery.capture_utc_ns.unwrap_or(delivery.sent_utc_ns)));
        }
    }

    fn start_anew(&mut self, bytes: u64) {
        let mut ages_ns = std::mem::take(&mut self.ages_ns);
        ages_ns.clear();
        *self = Self { ages_ns, bytes_before: bytes, ..Self::default() };
    }
}

fn print(tally: &Tally, bytes: u64, elapsed: Duration) -> io::Result<()> {
    let mut output = io::stdout().lock();
    if tally.lists == 0 {
        return PROGRESS.suspend(|| writeln!(output, "no list"));
    }
    let mut ages_ns = tally.ages_ns.clone();
    ages_ns.sort_unstable();
    let ms = |ns: Option<&i64>| ns.map_or(0.0, |ns| *ns as f64 * 1e-6);
    let seconds = elapsed.as_secs_f64();
    PROGRESS.suspend(|| {
        writeln!(
            output,
            "sequence {:>8}  {:>5} lights  error {}  {:>6.1} lists/s  {:>8.1} kB/s  age {:>7.1} ms, at most {:>7.1}  {} lost",
            tally.sequence,
            tally.light_count,
            tally.error.map_or("-".to_owned(), |error| format!("{error:.5}")),
            tally.lists as f64 / seconds,
            (bytes - tally.bytes_before) as f64 * 1e-3 / seconds,
            ms(ages_ns.get(ages_ns.len() / 2)),
            ms(ages_ns.last()),
            tally.lost,
        )
    })
}
