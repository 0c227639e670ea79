//! Draws records on a graphics device without a window: Vulkan, Metal or DirectX 12 through wgpu.
//!
//! The lit tiles of each color are in a buffer. The shader adds the parts of records to it without
//! atomic operations, which would take longer than everything else on lavapipe.

use std::sync::{Arc, Mutex};

use noctograph_core::parallel::prelude::*;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

use super::cpu::dark_counts;
use super::gpu_tiles::{Chunk, LitTile, Part, TILE_PX, chunks, fits_one_chunk, lit_tiles};
use super::record::SPOTS;
use super::tile;
use super::{FilmData, Latent};
use noctograph_core::error::{Error, Result};
use noctograph_core::parallel;

pub(super) const SHADER: &str = include_str!("../../../shaders/splat.wgsl");

/// Size of a tile's counts, in bytes.
const TILE_BYTES: u64 = (size_of::<u32>() as u64) * (TILE_PX as u64) * (TILE_PX as u64);

/// Maximum number of tiles in a buffer: they take 64 MiB, enough for 16 lit megapixels. Every
/// device supports this number of workgroups.
const MAX_TILES: u64 = 4096;

/// The part of the work on an image that needs no device, and is done while a device is opened.
#[derive(Debug)]
pub(super) struct Prepared {
    /// The film with the glow of the room, to which the light of the lamps is added.
    film: FilmData,
    lit: Vec<LitTile>,
    /// The records as a single chunk, or `None` if they are too many for one.
    chunk: Option<Chunk>,
}

impl Prepared {
    /// Prepares the work on an image.
    pub(super) fn new(latent: &Latent) -> Self {
        let lit = lit_tiles(latent);
        let first_row = lit.iter().map(|tile| tile.row).min().unwrap_or(0) * TILE_PX as usize;
        let (film, chunk) = parallel::join(
            || latent.with_glow(dark_counts(latent, first_row)),
            || {
                let mut chunk = None;
                if lit.len() as u64 <= MAX_TILES && fits_one_chunk(latent) {
                    chunks(latent, &lit, |only| chunk = Some(std::mem::take(only)));
                }
                chunk
            },
        );
        Self { film, lit, chunk }
    }
}

/// An open graphics device with the compiled shader.
#[derive(Debug)]
pub(super) struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    pub(super) adapter: String,
    pub(super) max_tiles_bytes: u64,
    /// True if the device's buffers are in the processor's memory and are read there.
    is_processor: bool,
    /// The first error that the device reported outside of a call.
    first_error: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the system's default device, or returns [`Error::Gpu`] if there is none.
    pub(super) fn open() -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Instance::enabled_backend_features(),
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let options = wgpu::RequestAdapterOptions::default();
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|e| {
            let hint = "install a Vulkan driver (Debian: mesa-vulkan-drivers) or choose the CPU";
            gpu_error(format!("none found ({e})"), hint)
        })?;
        let info = adapter.get_info();
        // The buffers of a software driver can be read without a copy.
        let mappable = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;
        let is_processor = info.device_type == wgpu::DeviceType::Cpu;
        let is_processor = is_processor && adapter.features().contains(mappable);
        let name = [info.name, info.driver_info].join(", ");
        // Requests the adapter's maximum limits, because the buffers are as large as possible.
        let limits = adapter.limits();
        let max_tiles_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("expose"),
            required_limits: limits,
            required_features: if is_processor { mappable } else { wgpu::Features::empty() },
            ..Default::default()
        }))
        .map_err(|e| gpu_error(format!("{name}: {e}"), "choose the CPU as the backend"))?;

        // This handler receives the errors of later calls. The first error names the cause.
        let first_error = Arc::new(Mutex::new(None));
        let handler_error = Arc::clone(&first_error);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            if let Ok(mut first_error) = handler_error.lock() {
                first_error.get_or_insert(e.to_string());
            }
        }));
        let pipeline = pipeline(&device, SHADER);
        let adapter = name;
        Ok(Self { device, queue, pipeline, adapter, max_tiles_bytes, is_processor, first_error })
    }

    /// Opens a device and submits a first run of the shader. A driver compiles the shader at its
    /// first use, which takes longer than exposing most films, and does so while the film's buffers
    /// are filled. Returns [`Error::Gpu`] if there is no device.
    pub(super) fn ready() -> Result<Self> {
        let gpu = Self::open()?;
        let part = Part { shift: 1, ..bytemuck::Zeroable::zeroed() };
        gpu.dispatch(&Chunk::of_part(part, [0; SPOTS]), &gpu.dark_tiles(1));
        Ok(gpu)
    }

    #[cfg(test)]
    pub(super) fn load(&mut self, shader: &str) {
        self.pipeline = pipeline(&self.device, shader);
    }

    /// Adds up the light of a latent image, and returns its film. Returns [`Error::Gpu`] if the
    /// device fails.
    pub(super) fn splat(&self, latent: &Latent, prepared: Prepared) -> Result<FilmData> {
        let Prepared { mut film, lit, mut chunk } = prepared;
        let max_tiles = (self.max_tiles_bytes / TILE_BYTES).min(MAX_TILES) as usize;
        if max_tiles == 0 {
            return Err(self.fail("a tile is too large for this device"));
        }
        // Sums the light of all colors on the device, and then adds the counts to the film. The
        // device is waited for once, unless the tiles exceed a buffer.
        let is_single = lit.len() <= max_tiles;
        for lit in lit.chunks(max_tiles) {
            let tiles = self.dark_tiles(lit.len());
            match chunk.take().filter(|_| is_single) {
                Some(chunk) => self.dispatch(&chunk, &tiles),
                None => chunks(latent, lit, |chunk| self.dispatch(chunk, &tiles)),
            }
            self.read(&tiles, lit.len(), |light| add(light, lit, latent, &mut film.counts))?;
        }
        Ok(film)
    }

    /// Creates a buffer with `n` dark tiles on the device, which clears it while the other buffers
    /// are filled.
    fn dark_tiles(&self, n: usize) -> wgpu::Buffer {
        let [mapped, copied] = [wgpu::BufferUsages::MAP_READ, wgpu::BufferUsages::COPY_SRC];
        let way_out = if self.is_processor { mapped } else { copied };
        let tiles = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("tiles"),
            size: TILE_BYTES * n as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | way_out,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&tiles, 0, None);
        self.queue.submit([encoder.finish()]);
        tiles
    }

    /// Submits a copy of `n` tiles to a new readable buffer, and returns this buffer.
    fn copied(&self, tiles: &wgpu::Buffer, n: usize) -> wgpu::Buffer {
        let size = TILE_BYTES * n as u64;
        let out = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("tiles out"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(tiles, 0, &out, 0, size);
        self.queue.submit([encoder.finish()]);
        out
    }

    /// Creates a buffer with the given contents on the device. A software driver's buffer is filled
    /// without a copy.
    fn filled(&self, label: &str, contents: &[u8]) -> wgpu::Buffer {
        let mapped = wgpu::BufferUsages::MAP_WRITE;
        let way_in = if self.is_processor { mapped } else { wgpu::BufferUsages::empty() };
        let usage = wgpu::BufferUsages::STORAGE | way_in;
        self.device.create_buffer_init(&BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    }

    /// Submits the work that adds a chunk to the tiles.
    fn dispatch(&self, chunk: &Chunk, tiles: &wgpu::Buffer) {
        let parts = self.filled("records", bytemuck::cast_slice(&chunk.sorted));
        let curves = self.filled("curves", bytemuck::cast_slice(&chunk.curves));
        let mut encoder = self.device.create_command_encoder(&Default::default());
        // Each pass waits for the previous one, so that no two workgroups add to the same tile.
        for lists in &chunk.rounds {
            let on_device = self.filled("lists", bytemuck::cast_slice(lists));
            let entries = [(0, &on_device), (1, &parts), (2, &curves), (3, tiles)];
            let entries = entries.map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            });
            let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("splat"),
                layout: &self.pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups(u32::try_from(lists.len()).unwrap_or(u32::MAX), 1, 1);
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Waits for the device, and calls `use_counts` with the counts of `n` tiles in order. Returns
    /// [`Error::Gpu`] if the device failed.
    fn read(&self, tiles: &wgpu::Buffer, n: usize, use_counts: impl FnOnce(&[u32])) -> Result<()> {
        let out = if self.is_processor { tiles.clone() } else { self.copied(tiles, n) };
        let (sender, receiver) = std::sync::mpsc::channel();
        out.map_async(wgpu::MapMode::Read, .., move |mapped| {
            // If the receiver no longer exists, an error was already reported.
            let _ = sender.send(mapped);
        });
        self.wait()?;
        receiver.recv().map_err(|e| self.fail(e))?.map_err(|e| self.fail(e))?;
        let mapped = out.get_mapped_range(..).map_err(|e| self.fail(e))?;
        use_counts(bytemuck::cast_slice(&mapped));
        Ok(())
    }

    /// Waits until the device has done all submitted work. Returns [`Error::Gpu`] if it failed.
    pub(super) fn wait(&self) -> Result<()> {
        // The error in the handler names the cause. Later errors are consequences of that one.
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        if let Some(first_error) = self.first_error.lock().ok().and_then(|mut e| e.take()) {
            return Err(self.fail(first_error));
        }
        polled.map(drop).map_err(|e| self.fail(e))
    }

    /// Returns an error of this device.
    fn fail(&self, what: impl std::fmt::Display) -> Error {
        gpu_error(format!("{}: {what}", self.adapter), "choose the CPU as the backend")
    }
}

/// Adds the light of tiles to the counts of three planes. The rows of tiles are processed in
/// parallel.
fn add(light: &[u32], lit: &[LitTile], latent: &Latent, counts: &mut [u32]) {
    let [width, height] = latent.size_px.map(|px| px as usize);
    let size = TILE_PX as usize;
    let (red, others) = counts.split_at_mut(width * height);
    let (green, blue) = others.split_at_mut(width * height);
    let [red, green, blue] = [red, green, blue].map(|plane| plane.par_chunks_mut(size * width));
    let rows = (red, green, blue).into_par_iter().enumerate();
    rows.for_each(|(row, (red, green, blue))| {
        let mut planes = [red, green, blue];
        let n_rows = size.min(height - row * size);
        let tiles = lit.iter().zip(light.chunks_exact(size * size));
        for (tile, light) in tiles.filter(|(tile, _)| tile.row == row) {
            let fractions = latent.tints[tile.tint].fractions;
            let x = tile.column * size;
            let inside = [size.min(width - x), n_rows];
            tile::count(light, [size, 0], fractions, &mut planes, [width, x], inside);
        }
    });
}

/// Compiles a shader in WGSL, whose entry point is `splat`.
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

/// Returns the error of a driver that panicked.
pub(super) fn driver_panicked() -> Error {
    gpu_error("its driver panicked".to_owned(), "choose the CPU as the backend")
}

fn gpu_error(what: String, hint: &str) -> Error {
    Error::Gpu { what, hint: hint.into() }
}
