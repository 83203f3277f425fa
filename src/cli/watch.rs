mod lines;
mod selection;
mod tally;

use super::input::{Input, display_name, open_lists};
use super::messages::print;
#[cfg(feature = "render")]
use super::render;
use super::signals::SignalWatch;
use crate::error::{Error, Kind, Result};
use crate::net::{Client, ClientOptions, Token};
use crate::rt::{Metrics, Shutdown};
use crate::service::Summary;
use crate::wire::{QUEUE_MAX, Subscription};
use clap::ValueEnum;
use lightcast_core::light::LightList;
use lines::Lines;
use selection::Selection;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tally::Tally;

/// Show, record or render lists as they come: from a server, a file or standard input.
///
/// INPUT is the address of a `run --listen` (ws://HOST:PORT, the address of its page, or HOST:PORT), a file
/// of light lists (.jsonl, .json), or `-` for lists on standard input. A connection that breaks is made
/// again, as often as necessary.
///
/// Without --json, every second and at the end one line on standard error says what came: the last sequence
/// number, lights, error, lists a second and, of a server, kilobytes a second, the median and largest age,
/// and the lists that this client was too slow for. The age is the time since the capture, by the clocks
/// (UTC) of both machines; for a replay as fast as possible, since it was sent.
///
/// --json writes every list as one line, the very bytes that the server's own `run --output` writes where
/// lists come as JSON and nothing is joined; `--format binary` needs a tenth of the bytes and rounds.
/// --record writes these lines to a file. Both let lists wait at the server (--queue) so that none is lost in
/// a short delay. A file is read as fast as possible.
///
/// Examples:
///   lightcast watch ws://studio:7300
///   lightcast watch studio:7300 --json --lights 16 | jq .power
///   lightcast watch lights.jsonl --json --lights 16 > few.jsonl
///   lightcast watch studio:7300 --lights 72 --render --scene model.glb --ground
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Address of a server, a file of light lists, or `-` for standard input.
    #[arg(value_name = "INPUT")]
    input: PathBuf,

    /// At most this many lights, which the later ones join.
    #[arg(long, value_name = "N")]
    lights: Option<u32>,

    /// At most this many lists a second.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,

    /// The shortest prefix of the list whose error is under this.
    #[arg(long, value_name = "ERROR")]
    error: Option<f32>,

    /// Lists that wait at a server when this client is slow [default: 1, with --json and --record 64].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(QUEUE_MAX)))]
    queue: Option<u32>,

    /// How lists come from a server [default: binary, with --json and --record json].
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

    /// End after this many lists.
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
    let input = Input::of(&arguments.input)?;
    let is_server = matches!(input, Input::Server(_));
    if !is_server {
        arguments.check_without_server()?;
    }
    #[cfg(feature = "render")]
    if let Some(rest) = &arguments.render {
        let subscription = if is_server { Some(client_options(arguments)?) } else { None };
        return render::run(&render::Arguments::of_watch(arguments.input.as_os_str(), rest, subscription));
    }
    let why = match &input {
        Input::Server(_) => return watch_server(arguments),
        Input::Lists(path) => return watch_lists(arguments, path),
        Input::Panorama(_) => {
            "of one panorama no lists come; `lightcast lights` prints its list, and `lightcast render` shows it"
        }
        Input::Panoramas(_) => {
            "its lists have yet to be made; name it in a configuration, section [source], and let `lightcast run` make them"
        }
        Input::Configuration(_) => {
            "its lists have yet to be made; `lightcast run` makes them, and `lightcast render` shows them"
        }
    };
    Err(input.refused("watch", why))
}

impl Arguments {
    /// Refuses options that only a server can fulfil, and with --render those that `render` has itself.
    fn check_without_server(&self) -> Result<()> {
        let refused = |option: &str, why: &str| Err(Error::usage(why).at(option));
        for (option, is_given) in [
            ("--queue", self.queue.is_some()),
            ("--format", self.format.is_some()),
            ("--token-file", self.token_file.is_some()),
        ] {
            if is_given {
                return refused(option, "is for a server, and INPUT is none; leave it out");
            }
        }
        #[cfg(feature = "render")]
        if self.render.is_some() {
            for (option, is_given) in [
                ("--lights", self.lights.is_some()),
                ("--rate-hz", self.rate_hz.is_some()),
                ("--error", self.error.is_some()),
            ] {
                if is_given {
                    return refused(
                        option,
                        "before --render asks a server, and INPUT is none; `render` has --lights too",
                    );
                }
            }
        }
        Ok(())
    }
}

fn watch_server(arguments: &Arguments) -> Result<()> {
    let options = client_options(arguments)?;
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let mut lines = Lines::open(arguments.json, arguments.record.as_deref())?;
    let metrics = Metrics::new("client");
    let bytes = metrics.counter("bytes received");
    let tally = Arc::new(Mutex::new(Tally::new(!arguments.json)));
    let (counting, mut left) = (tally.clone(), arguments.count);
    let client = Client::start(options, &metrics, &shutdown, move |message| {
        counting.lock().unwrap_or_else(PoisonError::into_inner).add_message(message);
        let goes_on = lines.write(&message.list)?;
        left = left.map(|left| left - 1);
        Ok(goes_on && left != Some(0))
    })?;
    let lock = || tally.lock().unwrap_or_else(PoisonError::into_inner);
    let outcome = client.join(Duration::from_millis(100), || lock().tell_each_second(bytes.get()));
    lock().tell_rest(bytes.get());
    print(&Summary::of(vec![metrics]).to_string());
    outcome
}

/// Shows the lists of a file or of standard input, as fast as they can be read.
fn watch_lists(arguments: &Arguments, path: &Path) -> Result<()> {
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let mut file = open_lists(path, &shutdown)?;
    let wanted = subscription(arguments, 1).checked().map_err(|error| error.with_kind(Kind::Usage))?;
    let mut selection = Selection::new(wanted);
    if arguments.record.as_deref().is_some_and(|record| is_same_file(record, path)) {
        return Err(Error::usage("--record would overwrite the file that is read; name another").at(path));
    }
    let mut lines = Lines::open(arguments.json, arguments.record.as_deref())?;
    let (mut list, mut tally) = (LightList::default(), Tally::new(!arguments.json));
    let (mut left, mut is_empty) = (arguments.count.unwrap_or(u64::MAX), true);
    while left > 0 {
        match file.read(&mut list) {
            // A line that is cut off by a shutdown request is not an error.
            Ok(false) | Err(_) if shutdown.is_requested() => break,
            Ok(true) => is_empty = false,
            Ok(false) if is_empty => {
                return Err(Error::failed("holds no light list").at(display_name(path)));
            }
            Ok(false) => break,
            Err(error) => return Err(error),
        }
        if selection.take(&mut list) {
            tally.add(&list);
            left -= 1;
            if !lines.write(&list)? {
                break;
            }
        }
        tally.tell_each_second(0);
        if shutdown.is_requested() {
            break;
        }
    }
    tally.tell_rest(0);
    Ok(())
}

fn is_same_file(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}

fn client_options(arguments: &Arguments) -> Result<ClientOptions> {
    let keeps_all = arguments.json || arguments.record.is_some();
    let (queue, format) = if keeps_all { (QUEUE_MAX, Format::Json) } else { (1, Format::Binary) };
    let mut options = ClientOptions::new(&arguments.input.to_string_lossy())?;
    options.subscription = subscription(arguments, queue);
    options.is_binary = arguments.format.unwrap_or(format) == Format::Binary;
    options.token = arguments.token_file.as_deref().map(Token::load).transpose()?;
    Ok(options)
}

/// The subscription that these arguments describe.
fn subscription(arguments: &Arguments, queue: u32) -> Subscription {
    Subscription {
        lights: arguments.lights,
        rate_hz: arguments.rate_hz,
        error: arguments.error,
        queue: arguments.queue.unwrap_or(queue),
    }
}
