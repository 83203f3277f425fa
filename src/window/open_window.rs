use super::command::{Command, KEYS};
use super::feed::{Feed, LightSource};
use super::inset::Inset;
use super::orbit::Orbit;
use super::pointer::Pointer;
use super::quality::{prefix_length, reserved, stepped};
use super::screen::Screen;
use super::title::{FrameTimes, Timings, Title};
use super::{FirstCamera, Settings};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::Renderer;
use crate::render::budget::{Budget, Quality};
use crate::render::refinement::{Refinement, Work};
use crate::scene::{Camera, Scene};
use crate::stage::PictureWriter;
use lightcast_core::light::{Light, Prefixes};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// Most samples per pixel in a static picture.
const MOST_SAMPLES: u32 = 64;
/// Time after a change during which the exposure may still adapt: five of its time constants.
const SETTLING: Duration = Duration::from_secs(2);
/// Time without a change after which a picture counts as static: longer than the interval between two lists.
const STILL: Duration = Duration::from_millis(500);
/// Interval between updates of the title, so that it can be read.
const TITLE_EVERY: Duration = Duration::from_millis(250);
/// Time until the next attempt where the window could not be drawn on.
const REST: Duration = Duration::from_millis(50);

/// The open window and everything shown in it.
pub(super) struct OpenWindow {
    // Declared first, so that the surface is dropped before the device and the window.
    screen: Screen,
    renderer: Renderer,
    window: Arc<Window>,
    size: [u32; 2],
    feed: Feed,
    inset: Inset,
    first_camera: Camera,
    orbit: Orbit,
    name: String,
    samples: u32,
    budget: Option<Budget>,
    /// Quality of a static picture: what was reserved, as reduced by the keys.
    most: Quality,
    /// Quality of the picture drawn last, and whether the budget has reduced it below `most`.
    quality: Quality,
    is_reduced: bool,
    /// The part of the list that the budget allows.
    shortened: Vec<Light>,
    prefixes: Prefixes,
    refinement: Refinement,
    frame_times: FrameTimes,
    writer: PictureWriter,
    pointer: Pointer,
    /// Time of the scene's animation.
    time_s: f64,
    is_frozen: bool,
    shows_inset: bool,
    /// Whether the inset shows different lights than the picture.
    is_inset_old: bool,
    shows_timings: bool,
    has_new_list: bool,
    has_moved: bool,
    /// Whether the screen is out of date although the picture is not.
    is_stale: bool,
    opened: Instant,
    has_drawn: bool,
    changed: Instant,
    last_frame: Instant,
    last_title: Option<Instant>,
    rests_until: Instant,
}

impl OpenWindow {
    pub fn open(
        event_loop: &ActiveEventLoop,
        settings: Settings,
        scene: Scene,
        source: LightSource,
        camera: FirstCamera,
    ) -> Result<Self> {
        let opened = Instant::now();
        let Settings { name, backend, options, samples, budget, time_s, look, map } = settings;
        let budget = budget.map(Budget::new).transpose()?;
        let attributes = Window::default_attributes()
            .with_title(Title { name: &name, ..Title::default() }.text())
            .with_inner_size(PhysicalSize::new(options.width_px, options.height_px));
        let window = event_loop
            .create_window(attributes)
            .map_err(|error| Error::failed("the window cannot be opened").because(error))?;
        let window = Arc::new(window);
        let (screen, gpu) = Screen::new(Gpu::instance(backend), window.clone())?;
        tracing::info!("{} ({:?}, {})", gpu.info.name, gpu.info.backend, gpu.info.driver_info);
        let mut renderer = Renderer::for_screen(gpu, scene, &options, screen.format())?;
        renderer.set_look(&look)?;
        renderer.pose(time_s);
        let first_camera = camera(&renderer)?;
        let quality = reserved(&renderer.options().directional);
        let inset = Inset::new(renderer.gpu(), map, options.directional.lights, screen.format());
        let mut open = Self {
            screen,
            renderer,
            window,
            size: [0; 2],
            feed: Feed::new(source),
            inset,
            first_camera,
            orbit: Orbit::new(&first_camera),
            name,
            samples: samples.max(1),
            budget,
            most: quality,
            quality,
            is_reduced: false,
            shortened: Vec::new(),
            prefixes: Prefixes::default(),
            refinement: Refinement::new(samples, MOST_SAMPLES),
            frame_times: FrameTimes::default(),
            writer: PictureWriter::default(),
            pointer: Pointer::default(),
            time_s,
            is_frozen: false,
            shows_inset: true,
            is_inset_old: true,
            shows_timings: true,
            has_new_list: false,
            has_moved: true,
            is_stale: false,
            opened,
            has_drawn: false,
            changed: opened,
            last_frame: opened,
            last_title: None,
            rests_until: opened,
        };
        let size = open.window.inner_size();
        open.resize([size.width, size.height])?;
        tracing::info!("window: {} x {} pixels; h prints the keys", size.width, size.height);
        Ok(open)
    }

    /// Adapts to the size of the window. Nothing is drawn on a window without pixels.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        let had = std::mem::replace(&mut self.size, size);
        if size == had || size.contains(&0) {
            return Ok(());
        }
        if self.renderer.size() != size.map(|side| side as usize) {
            self.renderer.resize(size[0], size[1])?;
        }
        self.screen.configure(self.renderer.gpu(), size);
        self.inset.resize(size);
        self.is_inset_old = true;
        self.has_moved = true;
        self.renderer.gpu().check()
    }

    /// Executes the command of a key, except closing.
    pub fn obey(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Freeze => self.is_frozen = !self.is_frozen,
            Command::Inset => self.shows_inset = !self.shows_inset,
            Command::Timings => {
                self.shows_timings = !self.shows_timings;
                self.log_times()?;
            }
            Command::Reset => {
                self.orbit = Orbit::new(&self.first_camera);
                self.has_moved = true;
            }
            Command::MoreLights | Command::FewerLights => {
                let is_more = command == Command::MoreLights;
                self.most =
                    stepped(self.most.lights, is_more, reserved(&self.renderer.options().directional));
                self.has_moved = true;
            }
            Command::Save => self.save()?,
            // The help is written directly to standard error, like messages: a logger would prefix every
            // line.
            Command::Help => eprint!("{KEYS}"),
            Command::Close => {}
        }
        self.is_stale = true;
        self.last_title = None;
        Ok(())
    }

    /// Handles the pointer: drags and the wheel.
    pub fn point(&mut self, event: &WindowEvent) {
        self.has_moved |= self.pointer.follow(event, &mut self.orbit, self.size[1]);
    }

    /// Takes a waiting list, and requests a frame if there is something to draw.
    pub fn watch(&mut self, now: Instant) {
        // A list that has been taken is always drawn; the next waits in the link, where a newer one may
        // overwrite it.
        if !self.is_frozen && !self.has_new_list {
            self.has_new_list = self.feed.poll(now);
        }
        if self.last_title.is_none_or(|last| now.duration_since(last) >= TITLE_EVERY) {
            self.last_title = Some(now);
            self.window.set_title(&self.title(now).text());
        }
        let has_work = self.is_stale
            || self.has_changed()
            || !self.refinement.is_done()
            || now.duration_since(self.changed) < SETTLING;
        if has_work && self.can_draw() && now >= self.rests_until {
            self.window.request_redraw();
        }
    }

    fn can_draw(&self) -> bool {
        self.feed.is_ready() && !self.size.contains(&0)
    }

    fn has_changed(&self) -> bool {
        self.has_new_list || self.has_moved || self.plays()
    }

    /// Whether the scene is animated in real time; under live lists it moves with them.
    fn plays(&self) -> bool {
        self.renderer.scene().is_animated() && !self.feed.is_live() && !self.is_frozen
    }

    /// Draws a frame.
    pub fn draw(&mut self, now: Instant) -> Result<()> {
        if !self.can_draw() {
            return Ok(());
        }
        let Some(texture) = self.screen.next(self.renderer.gpu(), self.size)? else {
            self.rests_until = now + REST;
            self.is_stale = true;
            return Ok(());
        };
        // The time spent waiting for the screen does not count as work.
        let start = Instant::now();
        let elapsed = start.duration_since(self.last_frame);
        self.last_frame = start;
        self.move_scene(elapsed);
        let has_changed = self.has_changed();
        if has_changed {
            self.changed = start;
        }
        self.is_inset_old |= self.has_new_list;
        if self.shows_inset && self.is_inset_old {
            self.is_inset_old = false;
            self.feed.poll_map(|map| self.inset.set_map(map));
            self.inset.update(self.renderer.gpu(), &self.feed.list().lights);
        }
        // Quality that the budget took from a moving picture is restored when it is static.
        let improves = self.is_reduced && !has_changed && start.duration_since(self.changed) >= STILL;
        let work = self.refinement.step(has_changed || improves);
        let camera = self.orbit.camera();
        match work {
            Work::Draw => {
                let mut lights = &self.feed.list().lights;
                let most = self.most;
                let budget = self.budget.as_ref().filter(|_| !improves);
                self.quality = budget.map_or(most, |budget| {
                    let Quality { lights, shadow_maps } = budget.quality();
                    Quality {
                        lights: lights.min(most.lights),
                        shadow_maps: shadow_maps.min(most.shadow_maps),
                    }
                });
                self.is_reduced = self.quality != most;
                self.renderer.set_quality(self.quality);
                if self.is_reduced {
                    let length = prefix_length(lights.len(), self.quality.lights, most.lights);
                    self.prefixes.prefix(lights, length, &mut self.shortened);
                    lights = &self.shortened;
                }
                self.renderer.draw(lights, &camera, self.samples)?;
            }
            Work::Refine { drawn } => self.renderer.refine(&camera, drawn)?,
            Work::Nothing => {}
        }
        let target = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.renderer.present(&target, if self.has_drawn { elapsed.as_secs_f64() } else { 0.0 })?;
        let gpu = self.renderer.gpu();
        if self.shows_inset {
            self.inset.draw(gpu, &target, self.size);
        }
        // This makes the time that of the work, and prevents queued frames from adding latency to dragging.
        gpu.wait()?;
        let time = start.elapsed();
        if work == Work::Draw && !improves && self.has_drawn {
            self.frame_times.add(time);
            if let Some(budget) = &mut self.budget {
                budget.step(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
            }
        }
        gpu.queue.present(texture);
        if self.has_new_list {
            self.feed.record(time);
        }
        (self.has_new_list, self.has_moved, self.is_stale) = (false, false, false);
        if !self.has_drawn {
            self.has_drawn = true;
            let passed_s = self.opened.elapsed().as_secs_f64();
            tracing::info!("window: first frame after {passed_s:.2} s");
        }
        Ok(())
    }

    fn move_scene(&mut self, elapsed: Duration) {
        if self.plays() {
            self.time_s += elapsed.as_secs_f64();
            self.renderer.pose(self.time_s);
        } else if self.has_new_list && self.renderer.scene().is_animated() {
            self.renderer.pose(self.time_s + self.feed.list().stamp.capture_time_ns as f64 * 1e-9);
        }
    }

    /// The current title.
    fn title(&self, now: Instant) -> Title<'_> {
        let quality = self.quality;
        let timings = Timings {
            frame_ns: self.frame_times.median_ns(),
            lights: quality.lights.min(self.feed.list().lights.len()),
            shadow_maps: quality.shadow_maps.min(self.feed.list().lights.len()),
            samples: self.refinement.drawn(),
            list: self.feed.state(now),
        };
        Title {
            name: &self.name,
            timings: self.shows_timings.then_some(timings),
            is_frozen: self.is_frozen,
            has_ended: self.feed.has_ended(),
        }
    }

    fn log_times(&mut self) -> Result<()> {
        let times: Vec<String> = self
            .renderer
            .read_times()?
            .into_iter()
            .map(|(name, time_ns)| format!("{name} {:.3} ms", time_ns as f64 * 1e-6))
            .collect();
        if times.is_empty() {
            tracing::info!(
                "window: no times of passes: none since they were last read, or the adapter does not measure"
            );
        } else {
            tracing::info!("window: last frame: {}", times.join(", "));
        }
        Ok(())
    }

    /// Saves the picture without the inset. A folder that cannot be written to is no reason to close the
    /// window.
    fn save(&mut self) -> Result<()> {
        if !self.has_drawn {
            return Ok(());
        }
        let numbered = |number: u32| PathBuf::from(format!("picture_{number}.png"));
        let Some(path) = (1..=u32::MAX).map(numbered).find(|path| !path.exists()) else { return Ok(()) };
        match self.writer.write(&mut self.renderer, 0.0, &path, false) {
            Ok(()) => {
                tracing::info!("window: saved {}", std::path::absolute(&path).unwrap_or(path).display());
            }
            Err(error) => {
                self.renderer.gpu().check()?;
                tracing::warn!("{error}");
            }
        }
        Ok(())
    }
}
