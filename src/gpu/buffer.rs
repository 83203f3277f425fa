use super::Gpu;
use crate::error::{Error, Result};
use bytemuck::{AnyBitPattern, NoUninit};
use std::marker::PhantomData;

/// A storage or uniform buffer of `T` that is written from the CPU and grows as needed.
pub struct Array<T> {
    buffer: wgpu::Buffer,
    usage: wgpu::BufferUsages,
    label: &'static str,
    /// Increases with every new buffer: bind groups that hold the old one must be recreated.
    generation: u64,
    elements: PhantomData<T>,
}

impl<T: NoUninit> Array<T> {
    /// A buffer for `capacity` (at least one) elements, zeroed.
    pub fn new(gpu: &Gpu, label: &'static str, usage: wgpu::BufferUsages, capacity: usize) -> Self {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Self {
            buffer: Self::make(gpu, label, usage, capacity),
            usage,
            label,
            generation: 0,
            elements: PhantomData,
        }
    }

    fn make(gpu: &Gpu, label: &str, usage: wgpu::BufferUsages, capacity: usize) -> wgpu::Buffer {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: (capacity.max(1) * size_of::<T>()) as u64,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Grows the buffer to `capacity` elements if needed; its contents may be lost.
    pub fn reserve(&mut self, gpu: &Gpu, capacity: usize) {
        if self.buffer.size() < (capacity * size_of::<T>()) as u64 {
            self.buffer = Self::make(gpu, self.label, self.usage, capacity.next_power_of_two());
            self.generation += 1;
        }
    }

    /// Replaces the first elements, growing the buffer if needed. The write is ordered with earlier and later
    /// submissions.
    pub fn write(&mut self, gpu: &Gpu, elements: &[T]) {
        self.reserve(gpu, elements.len());
        if !elements.is_empty() {
            gpu.queue.write_buffer(&self.buffer, 0, bytemuck::cast_slice(elements));
        }
    }

    /// The current buffer.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// The whole buffer, for a bind group.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        self.buffer.as_entire_binding()
    }

    /// How often the buffer was replaced by a larger one.
    pub fn generation(&self) -> u64 {
        self.generation
    }
}

/// Reads the first `count` elements of a buffer (usage `COPY_SRC`) after all submitted work is done.
///
/// # Errors
/// As [`Gpu::check`].
pub fn read_buffer<T: NoUninit + AnyBitPattern>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    count: usize,
    elements: &mut Vec<T>,
) -> Result<()> {
    let bytes = (count * size_of::<T>()) as u64;
    let staging = staging(gpu, bytes);
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
    gpu.queue.submit([encoder.finish()]);
    read_mapped(gpu, &staging, |view| {
        elements.clear();
        elements.extend_from_slice(bytemuck::cast_slice(view));
    })
}

/// Reads a 2D texture (usage `COPY_SRC`) of texels of type `T`, row-major, after all submitted work is done.
///
/// # Errors
/// As [`Gpu::check`].
pub fn read_texture<T: NoUninit + AnyBitPattern>(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    texels: &mut Vec<T>,
) -> Result<()> {
    let (width, height) = (texture.width() as usize, texture.height() as usize);
    let row = width * size_of::<T>();
    let pitch = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize);
    let staging = staging(gpu, (pitch * height) as u64);
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(pitch as u32), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &staging, layout },
        texture.size(),
    );
    gpu.queue.submit([encoder.finish()]);
    read_mapped(gpu, &staging, |view| {
        texels.clear();
        for line in view.chunks_exact(pitch) {
            texels.extend_from_slice(bytemuck::cast_slice(&line[..row]));
        }
    })
}

fn staging(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: bytes,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn read_mapped(gpu: &Gpu, staging: &wgpu::Buffer, take: impl FnOnce(&[u8])) -> Result<()> {
    // Whether mapping succeeded is found from the range below.
    staging.map_async(wgpu::MapMode::Read, .., |_| ());
    gpu.wait()?;
    let failed = |error| Error::failed("results cannot be read from the graphics device").because(error);
    take(&staging.get_mapped_range(..).map_err(failed)?);
    staging.unmap();
    Ok(())
}
