// Splat: every record adds its light to tiles. Twin of src/expose/cpu.rs.
// reads   lists, records : of a tile, 32 bytes each (gpu.rs); curves : what they multiply (curves.rs)
// writes  tiles : counts of one color, tile after tile of 64 x 64 pixels
// thread  every 8th column of one tile, through all of its records; a workgroup is a tile
// repeats as all is integers, and no two threads add to one pixel

const LOW_BITS: u32 = 14u;
const DITHER_X: u32 = 0xC13FA9A9u;
const DITHER_Y: u32 = 0x91E10DA5u;
const TILE_PX: u32 = 64u;
const THREADS: u32 = 8u;

struct Record {
    // First pixel in the buffer.
    place: u32,
    columns: u32,
    rows: u32,
    // Where its curves begin: a number for each of four spots at every pixel.
    along: u32,
    across: u32,
    shift: u32,
    dither: u32,
    unused: u32,
}

// First and end of a tile's records.
@group(0) @binding(0) var<storage, read> lists: array<vec2u>;
@group(0) @binding(1) var<storage, read> records: array<Record>;
@group(0) @binding(2) var<storage, read> curves: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> tiles: array<u32>;

@compute @workgroup_size(THREADS)
fn splat(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let list = lists[group.x];
    for (var index = list.x; index < list.y; index++) {
        let record = records[index];
        // Two columns at a time, so that every number across is fetched half as often.
        for (var i = (thread - record.place) % THREADS; i < record.columns; i += 2u * THREADS) {
            let next = i + THREADS;
            let along = curves[record.along + i];
            var along_next = vec4u(0u);
            if next < record.columns {
                along_next = curves[record.along + next];
            }
            var place = record.place + i;
            var dither = record.dither + i * DITHER_X;
            for (var j = 0u; j < record.rows; j++) {
                let across = curves[record.across + j];
                tiles[place] += counts(along, across, dither, record.shift);
                if next < record.columns {
                    let dither_next = dither + THREADS * DITHER_X;
                    tiles[place + THREADS] += counts(along_next, across, dither_next, record.shift);
                }
                place += TILE_PX;
                dither += DITHER_Y;
            }
        }
    }
}

// What a pixel gets, rounded by a threshold.
fn counts(along: vec4u, across: vec4u, dither: u32, shift: u32) -> u32 {
    let high = along * (across >> vec4u(16u));
    let low = along * (across & vec4u(0xffffu));
    let rest = low.x + low.y + low.z + low.w;
    let sum = high.x + high.y + high.z + high.w + (rest >> LOW_BITS);
    return (sum + (dither >> (32u - shift))) >> shift;
}
