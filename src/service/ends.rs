use super::RecordOptions;
use crate::error::Result;
use crate::net::Board;
use crate::rt::stage::Stage;
use crate::rt::{Metrics, link};
use lightcast_core::image::PolarMap;
use lightcast_core::light::LightList;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

/// The recipients of what a service captures and makes. Each has a link of its own, which is made only on
/// request.
///
/// Where links are live or clients are served, none of them blocks the service: files lack what they were too
/// slow for, which is counted, and all others get the newest. A replay without clients waits for all of them
/// except the window.
#[derive(Default)]
pub struct Ends {
    /// The frames as they are captured. A failure, for instance a full disk, ends only the recording, and is
    /// reported at the end.
    pub recording: Option<RecordOptions>,
    /// All maps that lights are made of, for display; the link is the caller's.
    pub maps: Option<link::Sender<PolarMap>>,
    /// All lists, for instance for a window; the link is the caller's.
    pub lists: Option<link::Sender<LightList>>,
    /// All lists and the newest map, for the clients of a server. The board never blocks.
    pub board: Option<Arc<Board>>,
    /// All lists as JSON lines.
    pub output: Option<Output>,
    /// Pictures of some maps with their lights.
    pub pictures: Option<Pictures>,
    /// Other readers of all lists, such as a renderer.
    pub readers: Vec<ListReader>,
}

impl Ends {
    /// Whether any recipient wants light lists; otherwise none are made.
    pub(super) fn want_lists(&self) -> bool {
        let Self { recording: _, maps: _, lists, board, output, pictures, readers } = self;
        lists.is_some() || board.is_some() || output.is_some() || pictures.is_some() || !readers.is_empty()
    }
}

/// Where light lists are written.
pub struct Output {
    /// Its name in messages: a path, or "standard output".
    pub name: String,
    /// Opens it once nothing else can fail: a start that fails does not touch an existing file.
    pub open: Box<dyn FnOnce() -> Result<Box<dyn Write + Send>>>,
}

impl Output {
    /// An output that is open already, called `name` in messages.
    pub fn new(name: impl Into<String>, writer: impl Write + Send + 'static) -> Self {
        Self { name: name.into(), open: Box::new(|| Ok(Box::new(writer))) }
    }
}

/// Pictures of some maps with their lights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pictures {
    /// Where they go; made if it does not exist.
    pub folder: PathBuf,
    /// The first map in every block of this many sequence numbers is drawn; at least 1.
    pub every: u64,
}

/// A stage that reads all lists, on a thread of its own.
pub struct ListReader {
    pub(super) metrics: Arc<Metrics>,
    pub(super) stage: Box<dyn Stage<Input = LightList, Output = ()>>,
}

impl ListReader {
    /// `name` is that of the thread and of the stage in the summary.
    pub fn new(name: &'static str, stage: impl Stage<Input = LightList, Output = ()> + 'static) -> Self {
        Self { metrics: Metrics::new(name), stage: Box::new(stage) }
    }
}
