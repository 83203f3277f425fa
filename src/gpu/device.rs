use crate::error::{Error, Result};
use std::sync::{Arc, Mutex, PoisonError};

/// Which graphics interface to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// Vulkan; a software adapter (lavapipe) serves where there is no GPU.
    #[default]
    Vulkan,
    /// OpenGL ES, only when requested by name: some of its drivers lack features that the renderer needs and
    /// do not report it.
    Gl,
}

/// An open device and its queue. Errors that the driver reports asynchronously (validation, memory, a lost
/// device) are kept, and [`check`](Self::check) returns the first.
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Name, driver and kind of the adapter.
    pub info: wgpu::AdapterInfo,
    /// `None` for the noop device.
    adapter: Option<wgpu::Adapter>,
    fault: Fault,
}

#[derive(Clone, Default)]
struct Fault(Arc<Mutex<Option<String>>>);

impl Fault {
    /// Keeps the first error, from which later ones usually follow.
    fn set(&self, message: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
    }

    fn get(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Types of bindings for [`Gpu::bind_group_layout`].
pub const UNIFORM: wgpu::BindingType = buffer(wgpu::BufferBindingType::Uniform);
/// An array that shaders write to.
pub const READ_WRITE: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: false });
/// An array that shaders read.
pub const READ_ONLY: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: true });

const fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

impl Gpu {
    /// An instance, with which surfaces are created before [`Self::open`].
    pub fn instance(backend: Backend) -> wgpu::Instance {
        let backends = match backend {
            Backend::Vulkan => wgpu::Backends::VULKAN,
            Backend::Gl => {
                tracing::warn!(
                    "OpenGL is only meant for trials: some drivers draw wrong pictures without an error"
                );
                wgpu::Backends::GL
            }
        };
        wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        })
    }

    /// Opens the fastest adapter of `instance` that can draw to `surface` if one is given.
    ///
    /// # Errors
    /// When there is no adapter, or it refuses a device.
    pub fn open(instance: &wgpu::Instance, surface: Option<&wgpu::Surface>) -> Result<Self> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|error| {
            Error::failed(
                "there is no graphics adapter; install a Vulkan driver (Debian and Ubuntu without a GPU: \
                 mesa-vulkan-drivers, a software one)",
            )
            .because(error)
        })?;
        // Timestamps are only for measurement and optional. Everything else is guaranteed by WebGPU, except
        // that the limits are the adapter's own: large scenes and atlases need more than the guaranteed ones.
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("lightcast"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::failed("cannot be opened").because(error).at(&info.name))?;
        Ok(Self { adapter: Some(adapter), ..Self::new(device, queue, info) })
    }

    /// A device that validates everything and computes nothing: layouts and bindings can be tested without a
    /// driver.
    pub fn noop() -> Self {
        let (device, queue) = wgpu::Device::noop(&wgpu::DeviceDescriptor::default());
        let info = device.adapter_info();
        Self::new(device, queue, info)
    }

    fn new(device: wgpu::Device, queue: wgpu::Queue, info: wgpu::AdapterInfo) -> Self {
        let fault = Fault::default();
        let (lost, failed) = (fault.clone(), fault.clone());
        device.set_device_lost_callback(move |reason, message| {
            lost.set(format!(
                "the graphics device was lost; start again, and if that happens again, ask for less (a smaller \
                 picture, fewer lights and shadow maps) or update its driver ({reason:?}): {message}"
            ));
        });
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| failed.set(error.to_string())));
        Self { device, queue, info, adapter: None, fault }
    }

    /// The 8-bit sRGB format that `surface` supports with this device.
    ///
    /// # Errors
    /// When it supports none.
    pub fn surface_format(&self, surface: &wgpu::Surface) -> Result<wgpu::TextureFormat> {
        use wgpu::TextureFormat::{Bgra8UnormSrgb, Rgba8UnormSrgb};
        let formats = self.adapter.as_ref().map(|adapter| surface.get_capabilities(adapter).formats);
        let is_srgb8 = |format: &wgpu::TextureFormat| [Bgra8UnormSrgb, Rgba8UnormSrgb].contains(format);
        formats.unwrap_or_default().into_iter().find(is_srgb8).ok_or_else(|| {
            Error::failed("the window takes no pictures of 8-bit sRGB; give --output to draw into files")
                .at(&self.info.name)
        })
    }

    /// Checks that the driver has reported no error so far.
    ///
    /// # Errors
    /// The first error: a lost device, out of memory, an invalid call.
    pub fn check(&self) -> Result<()> {
        match self.fault.get() {
            Some(message) => Err(Error::failed(message).at(&self.info.name)),
            None => Ok(()),
        }
    }

    /// Waits until all submitted work is done.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn wait(&self) -> Result<()> {
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        polled.map_err(|error| Error::failed("the graphics device does not answer").because(error))?;
        Ok(())
    }

    /// A shader module; several sources are concatenated, since WGSL has no includes.
    pub fn shader(&self, label: &str, sources: &[&str]) -> wgpu::ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(sources.concat().into()),
        })
    }

    /// A pipeline that draws triangles without vertex buffers, with the entry points `vertex` and `fragment`,
    /// to one target of `format`; its bindings are derived from the shader.
    pub fn screen_pipeline(
        &self,
        label: &str,
        source: &str,
        format: wgpu::TextureFormat,
    ) -> wgpu::RenderPipeline {
        let module = self.shader(label, &[source]);
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(label),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// A compute pipeline with the one entry point `main`; without a `layout` its bindings are derived from
    /// the shader.
    pub fn compute_pipeline(
        &self,
        label: &str,
        sources: &[&str],
        constants: &[(&str, f64)],
        layout: Option<&wgpu::PipelineLayout>,
    ) -> wgpu::ComputePipeline {
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout,
            module: &self.shader(label, sources),
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        })
    }

    /// A layout that several pipelines share: bindings by number, with the stages that read them.
    pub fn bind_group_layout(
        &self,
        bindings: &[(u32, wgpu::ShaderStages, wgpu::BindingType)],
    ) -> wgpu::BindGroupLayout {
        let entries: Vec<wgpu::BindGroupLayoutEntry> = bindings
            .iter()
            .map(|&(binding, visibility, ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility,
                ty,
                count: None,
            })
            .collect();
        self.device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
    }

    /// A pipeline layout with these groups, starting with group 0.
    pub fn pipeline_layout(&self, groups: &[&wgpu::BindGroupLayout]) -> wgpu::PipelineLayout {
        let groups: Vec<Option<&wgpu::BindGroupLayout>> = groups.iter().copied().map(Some).collect();
        self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &groups,
            immediate_size: 0,
        })
    }

    /// A bind group for group `index` of a pipeline: resources by binding number.
    pub fn bind_group(
        &self,
        layout: &wgpu::BindGroupLayout,
        resources: &[(u32, wgpu::BindingResource)],
    ) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry> = resources
            .iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }
}

#[cfg(test)]
impl Gpu {
    /// The adapter for a test, or `None` after reporting that the test is skipped.
    pub(crate) fn for_test() -> Option<Self> {
        match Self::open(&Self::instance(Backend::Vulkan), None) {
            Ok(gpu) => Some(gpu),
            Err(error) => {
                lightcast_core::test_data::say_skipped(&error.to_string());
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_device_is_an_error_that_says_so() {
        let Some(gpu) = Gpu::for_test() else { return };
        gpu.wait().unwrap();
        gpu.device.destroy();
        let _ = gpu.device.poll(wgpu::PollType::wait_indefinitely());
        let error = gpu.wait().unwrap_err().to_string();
        assert!(error.contains("was lost; start again"), "{error}");
    }

    #[test]
    fn a_wrong_call_is_kept_and_told() {
        let gpu = Gpu::noop();
        assert!(gpu.check().is_ok());
        let _ = gpu.shader("wrong", &["fn main( {"]);
        assert!(gpu.check().unwrap_err().to_string().contains("wrong"));
    }
}
