//! Lists for the renderer: from every kind of input they arrive on a link, made by threads that end together.

use super::Arguments;
use crate::cli::input::{Input, open_lists};
use crate::cli::messages::print;
use crate::config::{Config, Links, Pace};
use crate::error::{Error, Result};
use crate::net::{Client, ClientOptions};
use crate::rt::link::{self, Receiver, Sender};
use crate::rt::{Clock, Metrics, Shutdown, Threads};
use crate::service::{Ends, Service, Summary};
use crate::wire::{self, ListFile};
use lightcast_core::image::{PolarMap, PolarShape};
use lightcast_core::light::LightList;
use std::sync::Arc;
use std::time::Duration;

/// Lists with lights below this height make the inset show the whole sphere.
const HORIZON: f32 = -1e-3;

/// Lists of a file that wait for the renderer.
const LISTS_AHEAD: usize = 2;

/// The reader of the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reader {
    /// Pictures in files: of all lists that a file or a replay has, as fast as they are drawn.
    Files,
    /// A window: always the newest, at the pace at which they were captured.
    Window,
}

/// The origin of lists, opened and checked, before it is started.
pub(super) struct Origin {
    kind: Kind,
    reader: Reader,
    /// Ends the threads; it is requested when they have failed.
    ending: Shutdown,
}

enum Kind {
    /// The file after its first list, and that list.
    File(ListFile, Box<LightList>),
    Configuration(Box<Config>),
    Server(ClientOptions),
}

/// Lists as they come.
pub(super) struct Lists {
    pub link: Receiver<LightList>,
    /// The maps that they are made of, where these are known.
    pub maps: Option<Receiver<PolarMap>>,
    /// The extent of the lights.
    pub shape: PolarShape,
    /// How many there are, where that is known.
    pub count: Option<u64>,
}

/// The threads that make lists.
pub(super) struct Making {
    threads: Running,
    ending: Shutdown,
}

enum Running {
    File(Threads),
    Service(Service),
    Client(Client, Arc<Metrics>),
}

impl Origin {
    /// Opens an input that is no panorama. For a window, the input from a server ends with `closing`, so that
    /// a refusal closes the window; others end by themselves, and the window stays open.
    ///
    /// # Errors
    /// What cannot be opened or holds no list; kind `Usage` for panoramas.
    pub fn open(arguments: &Arguments, input: &Input, reader: Reader, closing: &Shutdown) -> Result<Self> {
        let (closing, own) = (closing.clone(), Shutdown::new());
        let ending = if reader == Reader::Files { closing.clone() } else { own };
        let (kind, ending) = match input {
            Input::Lists(path) => {
                let mut file = open_lists(path, &ending)?;
                let mut first = Box::<LightList>::default();
                if !file.read(&mut first)? {
                    return Err(Error::failed("holds no light list").at(input.name()));
                }
                (Kind::File(file, first), ending)
            }
            Input::Configuration(path) => (Kind::Configuration(Box::new(Config::load(path)?)), ending),
            Input::Server(address) => {
                let options = match &arguments.subscription {
                    Some(options) => options.clone(),
                    None => ClientOptions::new(address)?,
                };
                (Kind::Server(options), closing)
            }
            Input::Panorama(_) | Input::Panoramas(_) => {
                return Err(input.refused("render", "no lists come of it"));
            }
        };
        Ok(Self { kind, reader, ending })
    }

    /// Starts the threads.
    ///
    /// # Errors
    /// Those of the system; those of a service that cannot start.
    pub fn start(self) -> Result<(Lists, Making)> {
        let Self { kind, reader, ending } = self;
        let (lists, threads) = match kind {
            Kind::File(file, first) => start_file(file, *first, reader, &ending)?,
            Kind::Configuration(config) => start_service(*config, reader, &ending)?,
            Kind::Server(options) => start_client(options, &ending)?,
        };
        Ok((lists, Making { threads, ending }))
    }
}

impl Making {
    /// Ends the threads that make the lists, and prints the summary of these and of their `reader`.
    ///
    /// # Errors
    /// The first error that the lists ended with.
    pub fn finish(self, reader: Arc<Metrics>) -> Result<()> {
        self.ending.request();
        let wait = Duration::from_millis(100);
        let (summary, outcome) = match self.threads {
            Running::File(threads) => (Summary::of(vec![reader]), threads.join(wait, || ())),
            Running::Service(service) => (service.summary().with(reader), service.join(wait, || ())),
            Running::Client(client, received) => {
                (Summary::of(vec![received, reader]), client.join(wait, || ()))
            }
        };
        print(&summary.to_string());
        outcome
    }
}

fn start_file(
    file: ListFile,
    first: LightList,
    reader: Reader,
    ending: &Shutdown,
) -> Result<(Lists, Running)> {
    let is_upper = first.lights.iter().all(|light| light.direction[1] > HORIZON);
    let shape = if is_upper { PolarShape::hemisphere(4, 1) } else { PolarShape::sphere(4, 2) };
    let (sender, link) = match reader {
        Reader::Files => link::bounded(LISTS_AHEAD, ending, LightList::default),
        Reader::Window => link::latest(ending, LightList::default),
    };
    let (mut threads, end) = (Threads::new(ending), ending.clone());
    threads.spawn("lists", move || play(file, first, sender, reader == Reader::Window, &end))?;
    Ok((Lists { link, maps: None, shape, count: None }, Running::File(threads)))
}

fn start_service(mut config: Config, reader: Reader, ending: &Shutdown) -> Result<(Lists, Running)> {
    let mut ends = Ends::default();
    let (link, maps) = match reader {
        Reader::Files => {
            let (sender, link) = match config.links {
                Links::Live => link::latest(ending, LightList::default),
                Links::Replay => link::bounded(LISTS_AHEAD, ending, LightList::default),
            };
            ends.lists = Some(sender);
            (link, None)
        }
        Reader::Window => {
            // Lists can be made faster than anybody could watch them.
            config.pace = Pace::RealTime;
            let (sender, link) = link::latest(ending, LightList::default);
            let (maps_in, maps) = link::latest(ending, || PolarMap::black(config.map));
            (ends.lists, ends.maps) = (Some(sender), Some(maps_in));
            (link, Some(maps))
        }
    };
    let service = Service::start(&config, ends, ending)?;
    let lists = Lists { link, maps, shape: config.map, count: service.frame_count() };
    Ok((lists, Running::Service(service)))
}

fn start_client(options: ClientOptions, ending: &Shutdown) -> Result<(Lists, Running)> {
    let (sender, link) = link::latest(ending, LightList::default);
    let received = Metrics::new("client");
    let client = Client::start(options, &received, ending, pass_on(sender, ending))?;
    // The shape of the server's map is not known yet; a sphere has room for every light.
    let lists = Lists { link, maps: None, shape: PolarShape::sphere(4, 2), count: None };
    Ok((lists, Running::Client(client, received)))
}

/// Passes on `list` and all that follow it in `file`; if they are `paced`, each one when as much time has
/// passed as between its capture and that of the first. Times that run backwards cause no wait.
fn play(
    mut file: ListFile,
    mut list: LightList,
    mut sender: Sender<LightList>,
    paced: bool,
    end: &Shutdown,
) -> Result<()> {
    let clock = Clock::real();
    let first_ns = list.stamp.capture_time_ns;
    loop {
        let due_ns = list.stamp.capture_time_ns.saturating_sub(first_ns);
        if paced && !clock.wait_until(due_ns, end) {
            return Ok(());
        }
        let sent = sender.take().and_then(|mut copy| {
            copy.copy_from(&list);
            sender.send(copy)
        });
        if sent.is_err() {
            return Ok(());
        }
        match file.read(&mut list) {
            Ok(true) => {}
            // A line that is cut off because the reader has ended is not an error.
            Err(_) if end.is_requested() => return Ok(()),
            outcome => return outcome.map(|_| ()),
        }
    }
}

/// Hands on what a client receives until `closing` is requested.
fn pass_on(
    mut lists: Sender<LightList>,
    closing: &Shutdown,
) -> impl FnMut(&wire::Message) -> Result<bool> + Send + 'static {
    let closing = closing.clone();
    move |message| {
        let sent = lists.take().and_then(|mut list| {
            list.copy_from(&message.list);
            lists.send(list)
        });
        Ok(sent.is_ok() && !closing.is_requested())
    }
}
