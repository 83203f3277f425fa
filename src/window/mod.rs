//! A window that shows a scene under static lights or live lists: orbit camera, keys, an inset with the map
//! and its lights, timings in the title.
//!
//! One thread, which must be the main one, owns the window and the device. It never waits for lists: it draws
//! the newest one, and the link counts how many were skipped. While nothing visible changes, every frame adds
//! a sample to the picture, until it has enough samples and nothing more is drawn.

mod command;
mod feed;
mod inset;
mod open_window;
mod orbit;
mod pointer;
mod quality;
mod screen;
mod title;

pub use command::KEYS;
pub use feed::LightSource;

use crate::error::{Error, Result};
use crate::gpu::Backend;
use crate::render::budget::BudgetOptions;
use crate::render::{Look, Options, Renderer};
use crate::rt::Shutdown;
use crate::scene::{Camera, Scene};
use command::Command;
use lightcast_core::image::PolarMap;
use open_window::OpenWindow;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

/// What the window shows, and how.
pub struct Settings {
    /// Name of the scene in the title.
    pub name: String,
    /// Graphics interface.
    pub backend: Backend,
    /// Initial size of the window, and what the renderer reserves.
    pub options: Options,
    /// Samples per pixel while something moves.
    pub samples: u32,
    /// How lights and shadow maps adapt to the frame time; `None`: they are fixed by `options`.
    pub budget: Option<BudgetOptions>,
    /// Initial time of the scene's animation. It advances with real time under static lights, and with the
    /// capture times of live lists.
    pub time_s: f64,
    /// Background, exposure and tone mapping.
    pub look: Look,
    /// The map on which the inset shows the lights.
    pub map: PolarMap,
}

/// The first camera, from a renderer that knows the scene.
pub type FirstCamera<'a> = Box<dyn FnOnce(&Renderer) -> Result<Camera> + 'a>;

/// A connection to the display. A process can have one.
pub struct Display(EventLoop<()>);

/// Interval at which lists and requests to end are polled while nothing is drawn.
const WATCH: Duration = Duration::from_millis(10);

impl Display {
    /// Connects to the display that the environment names.
    ///
    /// # Errors
    /// Kind `Usage` where there is none.
    pub fn open() -> Result<Self> {
        let none = "there is no display to open a window on; give --output to draw into files";
        // This is checked first, because winit's error would not say which variable is missing.
        let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        if cfg!(target_os = "linux") && !is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY") {
            return Err(Error::usage(format!("{none} (DISPLAY is not set)")));
        }
        EventLoop::new().map(Self).map_err(|error| Error::usage(none).because(error))
    }

    /// Shows a window until it is closed or `shutdown` is requested.
    ///
    /// # Errors
    /// Those of the device, of the renderer for the scene, and of `camera`; when the display is lost.
    pub fn show(
        self,
        settings: Settings,
        scene: Scene,
        source: LightSource,
        camera: FirstCamera,
        shutdown: &Shutdown,
    ) -> Result<()> {
        let start = Start { settings, scene, source, camera };
        let mut app = App { start: Some(start), open: None, outcome: Ok(()), shutdown };
        let ran = self.0.run_app(&mut app);
        app.outcome?;
        ran.map_err(|error| Error::failed("the display was lost").because(error))
    }
}

struct Start<'a> {
    settings: Settings,
    scene: Scene,
    source: LightSource,
    camera: FirstCamera<'a>,
}

/// The handler of the display's events.
struct App<'a> {
    /// `Some` until the window is open.
    start: Option<Start<'a>>,
    open: Option<OpenWindow>,
    outcome: Result<()>,
    shutdown: &'a Shutdown,
}

impl App<'_> {
    fn end_on_error(&mut self, event_loop: &ActiveEventLoop, outcome: Result<()>) {
        if outcome.is_err() {
            if self.outcome.is_ok() {
                self.outcome = outcome;
            }
            event_loop.exit();
        }
    }
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(start) = self.start.take() {
            match OpenWindow::open(event_loop, start.settings, start.scene, start.source, start.camera) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.end_on_error(event_loop, Err(error)),
            }
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let outcome = match event {
            WindowEvent::CloseRequested => {
                event_loop.exit();
                Ok(())
            }
            WindowEvent::Resized(size) => open.resize([size.width, size.height]),
            WindowEvent::RedrawRequested => open.draw(Instant::now()),
            WindowEvent::KeyboardInput { event, .. } if event.state == ElementState::Pressed => {
                match Command::of(&event.logical_key) {
                    Some(Command::Close) => {
                        event_loop.exit();
                        Ok(())
                    }
                    // A held key would toggle freezing many times a second.
                    Some(command) if !event.repeat => open.obey(command),
                    _ => Ok(()),
                }
            }
            event => {
                open.point(&event);
                Ok(())
            }
        };
        self.end_on_error(event_loop, outcome);
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if self.shutdown.is_requested() {
            event_loop.exit();
            return;
        }
        let now = Instant::now();
        if let Some(open) = &mut self.open {
            open.watch(now);
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(now + WATCH));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // The surface must be dropped before the display.
        self.open = None;
    }
}
