//! The splat on a graphics device, headless: Vulkan, Metal or DirectX 12 through wgpu.
//!
//! The curves are drawn here, on the CPU, and sent along with the records while the device adds up
//! those before. A workgroup is a tile of the picture and goes through all records that touch it, so
//! no two threads add to one pixel: on lavapipe, an atomic sum costs more than all the rest. One
//! sheet a colour, of lit tiles only.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use wgpu::util::{BufferInitDescriptor, DeviceExt};

use super::curves::Curves;
use super::record::{Record, SPOTS};
use super::sheet;
use super::{Latent, Tint};
use crate::error::{Error, Result};

/// The shader.
pub(super) const SHADER: &str = include_str!("../../shaders/splat.wgsl");

/// Edge of a tile.
pub(super) const TILE_PX: u32 = 64;

/// Bytes of a tile's counts.
const TILE_BYTES: u64 = (size_of::<u32>() as u64) * (TILE_PX as u64) * (TILE_PX as u64);

/// Most tiles of a sheet: no device takes fewer workgroups.
const TILES: u64 = 65_535;

/// Numbers along and across in one dispatch, or a few more: 4 MB.
const CHUNK: usize = 1 << 18;

/// Turns of all loops of one workgroup, at most: llvmpipe leaves every loop after 65,535 together.
const TURNS: u32 = 60_000;

/// Bytes that are read back at once.
const READ_BYTES: u64 = 256 * TILE_BYTES;

/// The part of a record that lies on a tile, as the shader reads it: `Record` in `splat.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Part {
    pub(super) place: u32,
    pub(super) columns: u32,
    pub(super) rows: u32,
    pub(super) along: u32,
    pub(super) across: u32,
    pub(super) shift: u32,
    pub(super) dither: u32,
    pub(super) unused: u32,
}

/// Parts of records and their curves, on the way to the device.
#[derive(Debug, Default)]
struct Chunk {
    /// With the place of their tile in the sheet.
    parts: Vec<(usize, Part)>,
    curves: Vec<[u32; SPOTS]>,
}

/// Tiles of the picture that have light, in order.
#[derive(Debug)]
struct Tiles {
    across: usize,
    lit: Vec<bool>,
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
        let part = Part { shift: 1, ..bytemuck::Zeroable::zeroed() };
        let sheet = gpu.sheet(1);
        gpu.dispatch(&mut Chunk { parts: vec![(0, part)], curves: vec![[0; SPOTS]] }, &sheet);
        gpu.read(&sheet, 1, |_| ())?;
        Ok(gpu)
    }

    /// Takes another shader.
    #[cfg(test)]
    pub(super) fn load(&mut self, shader: &str) {
        self.pipeline = pipeline(&self.device, shader);
    }

    /// Adds up the light: three planes of counts.
    pub(super) fn splat(&self, latent: &Latent) -> Result<Vec<u32>> {
        let [width, height] = latent.size_px.map(|px| px as usize);
        let most = (self.max_film_bytes / TILE_BYTES).min(TILES) as usize;
        if most == 0 {
            return Err(self.fail("a tile is too large for it".to_owned()));
        }
        let mut counts = vec![0; 3 * width * height];
        let mut planes: Vec<&mut [u32]> = counts.chunks_exact_mut(width * height).collect();
        for tint in &latent.tints {
            let tiles = Tiles::lit_by(tint, latent.size_px);
            let lit: Vec<usize> = (0..tiles.lit.len()).filter(|&tile| tiles.lit[tile]).collect();
            for lit in lit.chunks(most) {
                let sheet = self.add(tint, latent, lit)?;
                let mut lit = lit.iter();
                self.read(&sheet, lit.len(), |light| {
                    let size = TILE_PX as usize;
                    for (light, tile) in light.chunks_exact(size * size).zip(&mut lit) {
                        let [x, y] = [tile % tiles.across * size, tile / tiles.across * size];
                        let inside = [size.min(width - x), size.min(height - y)];
                        let to = [width, y * width + x];
                        sheet::count(light, [size, 0], tint.shares, &mut planes, to, inside);
                    }
                })?;
            }
        }
        Ok(counts)
    }

    /// The light of one colour on some tiles of the picture.
    fn add(&self, tint: &Tint, latent: &Latent, lit: &[usize]) -> Result<wgpu::Buffer> {
        let sheet = self.sheet(lit.len());
        pulp::Arch::new().dispatch(Draw {
            tint,
            latent,
            lit,
            send: |chunk: &mut Chunk| self.dispatch(chunk, &sheet),
        });
        Ok(sheet)
    }

    /// A dark sheet on the device.
    fn sheet(&self, tiles: usize) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sheet"),
            size: TILE_BYTES * tiles as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    }

    /// Lets the device add a chunk to a sheet.
    fn dispatch(&self, chunk: &mut Chunk, sheet: &wgpu::Buffer) {
        let filled = |label, contents: &[u8]| {
            self.device.create_buffer_init(&BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE,
            })
        };
        let (rounds, parts) = chunk.by_tile();
        let parts = filled("records", bytemuck::cast_slice(&parts));
        let curves = filled("curves", bytemuck::cast_slice(&chunk.curves));
        let mut encoder = self.device.create_command_encoder(&Default::default());
        for lists in &rounds {
            let on_device = filled("lists", bytemuck::cast_slice(lists));
            let entries = [&on_device, &parts, &curves, sheet];
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
            pass.dispatch_workgroups(u32::try_from(lists.len()).unwrap_or(u32::MAX), 1, 1);
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Waits for the device, and hands on so many tiles of a sheet, in order.
    fn read(&self, sheet: &wgpu::Buffer, tiles: usize, mut take: impl FnMut(&[u32])) -> Result<()> {
        let bytes = TILE_BYTES * tiles as u64;
        let out = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sheet out"),
            size: READ_BYTES.min(bytes),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut start = 0;
        while start < bytes {
            let part = READ_BYTES.min(bytes - start);
            let mut encoder = self.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(sheet, start, &out, 0, part);
            self.queue.submit([encoder.finish()]);
            self.map(&out, part, &mut take)?;
            start += part;
        }
        Ok(())
    }

    /// Waits for the device, and hands on what is in a buffer.
    fn map(&self, out: &wgpu::Buffer, bytes: u64, mut take: impl FnMut(&[u32])) -> Result<()> {
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
        take(bytemuck::cast_slice(&mapped));
        drop(mapped);
        out.unmap();
        Ok(())
    }

    fn fail(&self, what: String) -> Error {
        gpu_error(format!("{}: {what}", self.adapter), "use --backend cpu")
    }
}

impl Tiles {
    /// Those that a colour's records touch.
    fn lit_by(tint: &Tint, [width, height]: [u32; 2]) -> Self {
        let across = width.div_ceil(TILE_PX) as usize;
        let mut lit = vec![false; across * height.div_ceil(TILE_PX) as usize];
        for record in &tint.records {
            let [columns, rows] = record.inside(width, &(0..height)).map(tiles);
            for row in rows {
                lit[row * across + columns.start..row * across + columns.end].fill(true);
            }
        }
        Self { across, lit }
    }
}

/// The tiles along one axis that some pixels lie on.
#[inline(always)]
fn tiles(pixels: Range<u32>) -> Range<usize> {
    (pixels.start / TILE_PX) as usize..pixels.end.div_ceil(TILE_PX) as usize
}

/// Draws a colour's curves and sends them with its records' parts on some tiles, chunk by chunk.
struct Draw<'a, F> {
    tint: &'a Tint,
    latent: &'a Latent,
    lit: &'a [usize],
    send: F,
}

impl<F: FnMut(&mut Chunk)> pulp::NullaryFnOnce for Draw<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let [width, height] = self.latent.size_px;
        let across = width.div_ceil(TILE_PX) as usize;
        let mut places = vec![None; across * height.div_ceil(TILE_PX) as usize];
        self.lit.iter().enumerate().for_each(|(place, &tile)| places[tile] = Some(place));

        let (mut drawn, mut chunk) = (Curves::default(), Chunk::default());
        for record in &self.tint.records {
            let inside = record.inside(width, &(0..height));
            drawn.draw(record, self.latent.counts_per_lx_s());
            let curves = chunk.push_curves(record, &drawn);
            let [columns, rows] = inside.clone().map(tiles);
            for row in rows {
                for column in columns.clone() {
                    if let Some(place) = places[row * across + column] {
                        let part = part(record, drawn.shift, curves, &inside, [column, row], place);
                        chunk.parts.push((place, part));
                    }
                }
            }
            if chunk.curves.len() > CHUNK {
                (self.send)(&mut chunk);
                chunk.parts.clear();
                chunk.curves.clear();
            }
        }
        if !chunk.parts.is_empty() {
            (self.send)(&mut chunk);
        }
    }
}

/// The part of a record on a tile, which has a place in the sheet.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a sheet has fewer than 2^32 pixels")]
fn part(
    record: &Record,
    shift: u32,
    [along, across]: [u32; 2],
    inside: &[Range<u32>; 2],
    tile: [usize; 2],
    place: usize,
) -> Part {
    let corner = tile.map(|tile| tile as u32 * TILE_PX);
    let on_tile = |axis: usize| {
        let Range { start, end } = inside[axis];
        start.max(corner[axis])..end.min(corner[axis] + TILE_PX)
    };
    let [columns, rows] = [on_tile(0), on_tile(1)];
    let [i, j] = [columns.start - corner[0], rows.start - corner[1]];
    Part {
        place: (place as u32 * TILE_PX + j) * TILE_PX + i,
        columns: columns.end - columns.start,
        rows: rows.end - rows.start,
        along: along.wrapping_add(columns.start).wrapping_sub(record.x.cast_unsigned()),
        across: across.wrapping_add(rows.start).wrapping_sub(record.y.cast_unsigned()),
        shift,
        dither: record.dither_at(columns.start, rows.start),
        unused: 0,
    }
}

impl Chunk {
    /// Adds a record's curves along and across, and says where they begin.
    #[inline(always)]
    fn push_curves(&mut self, record: &Record, drawn: &Curves) -> [u32; 2] {
        let (width, height) = (record.width as usize, record.height as usize);
        let first = self.curves.len();
        self.curves.resize(first + width + height, [0; SPOTS]);
        let (along, across) = self.curves[first..].split_at_mut(width);
        for k in 0..record.spots as usize {
            for (to, from) in along.iter_mut().zip(drawn.along(k, 0)) {
                to[k] = *from;
            }
            let [high, low] = drawn.across(k, 0..height);
            for (to, (high, low)) in across.iter_mut().zip(high.iter().zip(low)) {
                to[k] = high << 16 | low;
            }
        }
        [first, first + width].map(|first| u32::try_from(first).unwrap_or(u32::MAX))
    }

    /// First and end of each tile's parts, in rounds that end before the device does, and the parts
    /// in that order.
    fn by_tile(&mut self) -> (Vec<Vec<[u32; 2]>>, Vec<Part>) {
        self.parts.sort_by_key(|&(place, _)| place);
        let (mut rounds, mut end): (Vec<Vec<[u32; 2]>>, _) = (Vec::new(), 0);
        for tile in self.parts.chunk_by(|a, b| a.0 == b.0) {
            let (mut start, mut turns, mut round) = (end, 0, 0);
            for (_, part) in tile {
                if turns + part.turns() > TURNS {
                    rounds.resize(rounds.len().max(round + 1), Vec::new());
                    rounds[round].push([start, end]);
                    (start, turns, round) = (end, 0, round + 1);
                }
                turns += part.turns();
                end += 1;
            }
            rounds.resize(rounds.len().max(round + 1), Vec::new());
            rounds[round].push([start, end]);
        }
        (rounds, self.parts.iter().map(|&(_, part)| part).collect())
    }
}

impl Part {
    /// Turns of the shader's loops, at most.
    fn turns(&self) -> u32 {
        2 + (self.columns / 16 + 1) * (self.rows + 2)
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

/// Error of a driver that panicked.
pub(super) fn driver_panicked() -> Error {
    gpu_error("its driver panicked".to_owned(), "use --backend cpu")
}

fn gpu_error(what: String, hint: &str) -> Error {
    Error::Gpu { what, hint: hint.into() }
}
