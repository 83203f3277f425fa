use super::{Gpu, read_buffer};
use crate::error::Result;

/// Times of passes in nanoseconds, in the order in which they were requested.
pub type PassTimes = Vec<(&'static str, u64)>;

/// Measures passes on the GPU with timestamp queries. On a device without them it measures nothing.
///
/// Mesa's lavapipe 22.3 writes compute timestamps when the commands are recorded, not when they run; use the
/// time of the whole frame as a check there.
pub struct Timer {
    queries: Option<Queries>,
    names: Vec<&'static str>,
}

struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    period_ns: f32,
}

/// Most passes that are measured in one frame.
const PASSES: u32 = 64;

impl Timer {
    /// A timer for the passes of one frame.
    pub fn new(gpu: &Gpu) -> Self {
        let queries = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| Queries {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES,
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pass times"),
                size: u64::from(2 * PASSES * wgpu::QUERY_SIZE),
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            period_ns: gpu.queue.get_timestamp_period(),
        });
        Self { queries, names: Vec::new() }
    }

    fn next(&mut self, name: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        let queries = self.queries.as_ref()?;
        let index = u32::try_from(self.names.len()).ok().filter(|&index| index < PASSES)?;
        self.names.push(name);
        Some((&queries.set, 2 * index))
    }

    /// Timestamp writes for the descriptor of a compute pass called `name`.
    pub fn compute(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.next(name).map(|(query_set, index)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(index),
            end_of_pass_write_index: Some(index + 1),
        })
    }

    /// Timestamp writes for the descriptor of a render pass called `name`.
    pub fn render(&mut self, name: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.next(name).map(|(query_set, index)| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(index),
            end_of_pass_write_index: Some(index + 1),
        })
    }

    /// Records the end of the frame.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let (Some(queries), false) = (&self.queries, self.names.is_empty()) {
            encoder.resolve_query_set(&queries.set, 0..2 * self.names.len() as u32, &queries.resolved, 0);
        }
    }

    /// Waits for the frame and starts the next one. Returns the time of every pass, summed over passes of the
    /// same name.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn read(&mut self, gpu: &Gpu) -> Result<PassTimes> {
        let mut times = PassTimes::new();
        if let (Some(queries), false) = (&self.queries, self.names.is_empty()) {
            let mut ticks: Vec<[u64; 2]> = Vec::new();
            read_buffer(gpu, &queries.resolved, self.names.len(), &mut ticks)?;
            for (&name, [start, end]) in self.names.iter().zip(ticks) {
                let time_ns = (end.saturating_sub(start) as f64 * f64::from(queries.period_ns)) as u64;
                match times.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, sum_ns)) => *sum_ns += time_ns,
                    None => times.push((name, time_ns)),
                }
            }
        }
        self.names.clear();
        Ok(times)
    }

    /// Starts the next frame without reading.
    pub fn restart(&mut self) {
        self.names.clear();
    }
}
