//! The splat on a graphics device, headless: Vulkan, Metal or DirectX 12 through wgpu.
//!
//! One workgroup a record. Pictures that do not fit the device's largest storage binding (128 MiB
//! on lavapipe, a little more than 4K) are exposed in bands of rows.

use std::sync::{Arc, Mutex};

use wgpu::util::{BufferInitDescriptor, DeviceExt};

use super::record::Record;
use super::tables::BELL;
use crate::error::{Error, Result};

/// The shader.
pub(super) const SHADER: &str = include_str!("../../shaders/splat.wgsl");

/// Records in one dispatch, at most: as many as fit the smallest storage binding (128 MiB).
const CHUNK: usize = 1 << 20;

/// Bytes that are read back at once: the film is then in memory twice, not three times.
const READ_BYTES: u64 = 1 << 22;

/// Workgroups along x: no device has fewer than 65535.
const GROUPS_X: u32 = 1 << 15;

/// Bytes of one pixel of the film.
const PIXEL_BYTES: u64 = 3 * size_of::<u32>() as u64;

/// What the shader knows of its film: `Params` in `splat.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Params {
    width: u32,
    first_row: u32,
    rows: u32,
    records: u32,
}

/// An open graphics device.
#[derive(Debug)]
pub(super) struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    /// Name and driver.
    pub(super) adapter: String,
    /// Largest film, or band of a film, in bytes.
    pub(super) max_film_bytes: u64,
    /// What the device complained about first.
    complaint: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the system's default device; [`Error::Gpu`] where there is none.
    pub(super) fn open() -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Instance::enabled_backend_features(),
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let options = wgpu::RequestAdapterOptions::default();
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|e| {
            gpu_error(
                format!("none found ({e})"),
                "install a Vulkan driver (Debian: mesa-vulkan-drivers) or use --backend cpu",
            )
        })?;
        let about = adapter.get_info();
        let name = [about.name, about.driver_info].join(", ");
        let limits = adapter.limits();
        let max_film_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("expose"),
            required_limits: limits,
            ..Default::default()
        }))
        .map_err(|e| gpu_error(format!("{name}: {e}"), "use --backend cpu"))?;

        let complaint = Arc::new(Mutex::new(None));
        let first = Arc::clone(&complaint);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            if let Ok(mut first) = first.lock() {
                first.get_or_insert(e.to_string());
            }
        }));
        let pipeline = pipeline(&device, SHADER);
        Ok(Self { device, queue, pipeline, adapter: name, max_film_bytes, complaint })
    }

    /// Opens a device and lets it splat nothing: a driver compiles the shader when it is first used,
    /// which takes longer than most films.
    pub(super) fn ready() -> Result<Self> {
        let gpu = Self::open()?;
        let nothing = Record { width: 1, height: 1, shift: 1, ..bytemuck::Zeroable::zeroed() };
        gpu.splat(&[nothing], [1, 1])?;
        Ok(gpu)
    }

    /// Takes another shader.
    #[cfg(test)]
    pub(super) fn load(&mut self, shader: &str) {
        self.pipeline = pipeline(&self.device, shader);
    }

    /// Adds up the records' light: three planes of counts.
    pub(super) fn splat(&self, records: &[Record], size_px: [u32; 2]) -> Result<Vec<u32>> {
        let [width, height] = size_px;
        let fitting = self.max_film_bytes / (PIXEL_BYTES * u64::from(width));
        let max_rows = u32::try_from(fitting).unwrap_or(u32::MAX).min(height);
        if max_rows == 0 {
            return Err(self.fail(format!("a row of {width} px is too long for it")));
        }

        let plane = width as usize * height as usize;
        let mut counts = Vec::new();
        for first_row in (0..height).step_by(max_rows as usize) {
            let rows = max_rows.min(height - first_row);
            let band = self.splat_band(records, [width, first_row, rows])?;
            if rows == height {
                return Ok(band);
            }
            counts.resize(3 * plane, 0);
            let first = first_row as usize * width as usize;
            let length = rows as usize * width as usize;
            for (to, from) in counts.chunks_exact_mut(plane).zip(band.chunks_exact(length)) {
                to[first..first + length].copy_from_slice(from);
            }
        }
        Ok(counts)
    }

    /// The film of some rows of the picture.
    fn splat_band(
        &self,
        records: &[Record],
        [width, first_row, rows]: [u32; 3],
    ) -> Result<Vec<u32>> {
        let film_bytes = PIXEL_BYTES * u64::from(width) * u64::from(rows);
        let buffer = |label, size, usage| {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let film =
            buffer("film", film_bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let out = buffer("film out", film_bytes.min(READ_BYTES), read);
        let filled = |label, contents: &[u8], usage| {
            self.device.create_buffer_init(&BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let bell = filled("bell", bytemuck::cast_slice(&BELL[..]), storage);

        let touches = |r: &&Record| r.y < first_row + rows && first_row < r.y + r.height;
        let touching: Vec<Record> = records.iter().filter(touches).copied().collect();
        let mut encoder = self.device.create_command_encoder(&Default::default());
        for chunk in touching.chunks(CHUNK) {
            let n = u32::try_from(chunk.len()).unwrap_or(u32::MAX);
            let params = Params { width, first_row, rows, records: n };
            let params = filled("params", bytemuck::bytes_of(&params), wgpu::BufferUsages::UNIFORM);
            let records = filled("records", bytemuck::cast_slice(chunk), storage);
            let entries = [&params, &records, &bell, &film];
            let entries = std::array::from_fn::<_, 4, _>(|i| wgpu::BindGroupEntry {
                binding: [0, 1, 2, 3][i],
                resource: entries[i].as_entire_binding(),
            });
            let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("splat"),
                layout: &self.pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups(n.min(GROUPS_X), n.div_ceil(GROUPS_X), 1);
        }
        self.queue.submit([encoder.finish()]);
        let mut counts = Vec::with_capacity(3 * width as usize * rows as usize);
        let mut start = 0;
        while start < film_bytes {
            let bytes = READ_BYTES.min(film_bytes - start);
            let mut encoder = self.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(&film, start, &out, 0, bytes);
            self.queue.submit([encoder.finish()]);
            self.read(&out, bytes, &mut counts)?;
            start += bytes;
        }
        Ok(counts)
    }

    /// Waits for the device, and takes what it wrote.
    fn read(&self, out: &wgpu::Buffer, bytes: u64, counts: &mut Vec<u32>) -> Result<()> {
        let (sender, receiver) = std::sync::mpsc::channel();
        out.map_async(wgpu::MapMode::Read, ..bytes, move |mapped| {
            // The receiver is gone only after an error that is reported already.
            let _ = sender.send(mapped);
        });
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        if let Some(complaint) = self.complaint.lock().ok().and_then(|mut c| c.take()) {
            return Err(self.fail(complaint));
        }
        waited.map_err(|e| self.fail(e.to_string()))?;
        receiver
            .recv()
            .map_err(|e| self.fail(e.to_string()))?
            .map_err(|e| self.fail(e.to_string()))?;
        let mapped = out.get_mapped_range(..bytes).map_err(|e| self.fail(e.to_string()))?;
        let start = counts.len();
        counts.resize(start + mapped.len() / size_of::<u32>(), 0);
        bytemuck::cast_slice_mut(&mut counts[start..]).copy_from_slice(&mapped);
        drop(mapped);
        out.unmap();
        Ok(())
    }

    fn fail(&self, what: String) -> Error {
        gpu_error(format!("{}: {what}", self.adapter), "use --backend cpu")
    }
}

fn pipeline(device: &wgpu::Device, shader: &str) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("splat"),
        source: wgpu::ShaderSource::Wgsl(shader.into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("splat"),
        layout: None,
        module: &module,
        entry_point: Some("splat"),
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    })
}

/// A driver that panicked.
pub(super) fn gave_up() -> Error {
    gpu_error("its driver gave up".to_owned(), "use --backend cpu")
}

fn gpu_error(what: String, hint: &str) -> Error {
    Error::Gpu { what, hint: hint.into() }
}
