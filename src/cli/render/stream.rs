//! `render` of a stream: lists from a server, in the place of those of a file.

use super::values::Target;
use super::{Arguments, Shown, camera, no_reference, numbered, renderer, samples, window};
use crate::cli::progress::Progress;
use crate::cli::signals::SignalWatch;
use crate::error::Result;
use crate::net::{Client, ClientOptions};
use crate::rt::link::{self, Sender};
use crate::rt::stage::{self as stages, Nowhere};
use crate::rt::{Clock, Metrics, Shutdown};
use crate::service::Summary;
use crate::stage::PictureWriter;
use crate::wire;
use lightcast_core::light::LightList;
use std::ffi::{OsStr, OsString};
use std::io::{self, Write as _};
use std::time::Duration;

/// [`run`](super::run), with lists from a server that is asked for what `options` say.
pub(in crate::cli) fn run_stream(arguments: &Arguments, options: ClientOptions) -> Result<()> {
    match &arguments.output {
        None => window::run_stream(arguments, options),
        Some(output) => render(arguments, &Target::of(output)?, options),
    }
}

impl Arguments {
    /// The arguments of `lightcast render URL REST...`; help, and a fault with what is wrong, end the program as they do
    /// there.
    pub(in crate::cli) fn of_stream(url: &str, rest: &[OsString]) -> Self {
        #[derive(clap::Parser)]
        #[command(name = "lightcast watch URL --render")]
        struct Line {
            #[command(flatten)]
            arguments: Arguments,
        }
        let line =
            [OsStr::new("render"), OsStr::new(url)].into_iter().chain(rest.iter().map(OsString::as_os_str));
        <Line as clap::Parser>::parse_from(line).arguments
    }
}

/// What a server that is the input is asked for.
pub(super) fn server(arguments: &Arguments) -> Result<ClientOptions> {
    ClientOptions::new(&arguments.input.to_string_lossy())
}

/// Hands on what a client receives; `closing` learns that it has ended.
pub(super) fn pass_on(
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

/// The client brings lists on its thread; this one renders them, the newest each time.
pub(super) fn render(arguments: &Arguments, target: &Target, options: ClientOptions) -> Result<()> {
    no_reference(arguments)?;
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let mut renderer = renderer(arguments)?;
    let camera = camera(arguments, &renderer)?;
    let (sender, mut lists) = link::latest(&shutdown, LightList::default);
    let (received, rendered) = (Metrics::new("client"), Metrics::new("render"));
    let client = Client::start(options, &received, &shutdown, pass_on(sender, &shutdown))?;
    let outcome = match target {
        Target::File { path, is_exr } => match lists.receive() {
            Some(list) => renderer
                .draw(&list.lights, &camera, samples(arguments))
                .and_then(|()| PictureWriter::default().write(&mut renderer, 0.0, path, *is_exr)),
            None => Ok(()),
        },
        Target::Folder(folder) => {
            let progress = Progress::of(None, "lists");
            let render = numbered(arguments, renderer, camera, folder)?;
            let shown = Shown { render, progress: progress.clone() };
            let outcome = stages::run(shown, lists, Nowhere, &Clock::real(), &shutdown, &rendered);
            progress.finish();
            outcome
        }
    };
    shutdown.request();
    let served = client.join(Duration::from_millis(100), || ());
    let _ = write!(io::stderr(), "{}", Summary::of(vec![received, rendered]));
    outcome.and(served)
}
