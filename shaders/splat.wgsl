// Splat: every record adds its light to the film. Twin of src/expose/cpu.rs.
// reads   params, records : 64 bytes each (record.rs); step, bell : the curves (tables.rs)
// writes  film : counts, a plane for each color channel, row by row
// thread  every 64th pixel of one record's box; a workgroup is a record
// repeats as all is integers: sums have no order, products no rounding of the device's own

const REACH: i32 = 92274688;
const END: i32 = 134217728;
const NODE_BITS: u32 = 15u;
const STEP_BITS: u32 = 27u;
const BELL_BITS: u32 = 26u;
const DITHER_X: u32 = 0xC13FA9A9u;
const DITHER_Y: u32 = 0x91E10DA5u;
const THREADS: u32 = 64u;

struct Params {
    width: u32,
    // The band of the picture that the film holds.
    first_row: u32,
    rows: u32,
    records: u32,
}

struct Record {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
    u0: i32,
    ux: i32,
    uy: i32,
    v0: i32,
    vx: i32,
    vy: i32,
    length: i32,
    red: u32,
    green: u32,
    blue: u32,
    shift: u32,
    dither: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> records: array<Record>;
@group(0) @binding(2) var<storage, read> step_nodes: array<u32>;
@group(0) @binding(3) var<storage, read> bell_nodes: array<u32>;
@group(0) @binding(4) var<storage, read_write> film: array<atomic<u32>>;

@compute @workgroup_size(THREADS)
fn splat(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = group.y * groups.x + group.x;
    if index >= params.records {
        return;
    }
    let record = records[index];
    let first = max(record.y, params.first_row);
    let end = min(record.y + record.height, params.first_row + params.rows);
    if first >= end {
        return;
    }
    let plane = params.width * params.rows;
    let pixels = record.width * (end - first);
    for (var pixel = thread; pixel < pixels; pixel += THREADS) {
        let row = first + pixel / record.width;
        let i = i32(pixel % record.width);
        let j = i32(row - record.y);
        let weight = weight(record, i, j);
        if weight == 0u {
            continue;
        }
        let place = (row - params.first_row) * params.width + record.x + u32(i);
        let dither = record.dither + u32(i) * DITHER_X + u32(j) * DITHER_Y;
        let up = dither >> (32u - record.shift);
        add(place, (mul_hi(weight, record.red) + up) >> record.shift);
        add(place + plane, (mul_hi(weight, record.green) + up) >> record.shift);
        add(place + 2u * plane, (mul_hi(weight, record.blue) + up) >> record.shift);
    }
}

fn add(place: u32, counts: u32) {
    if counts != 0u {
        atomicAdd(&film[place], counts);
    }
}

// Share of a record's amplitude that a pixel gets, 2^31 for 1.
fn weight(record: Record, i: i32, j: i32) -> u32 {
    let u = record.u0 + i * record.ux + j * record.uy;
    let v = record.v0 + i * record.vx + j * record.vy;
    if abs(v) >= REACH {
        return 0u;
    }
    let across = bell(v) << (31u - BELL_BITS);
    if record.length == 0 {
        return mul_hi(bell(u) << (31u - BELL_BITS), across) << 1u;
    }
    let along = step_at(u) - step_at(u - record.length);
    return mul_hi(along << (31u - STEP_BITS), across) << 1u;
}

// Φ.
fn step_at(x: i32) -> u32 {
    let from_end = u32(clamp(x, -REACH, REACH) + END);
    let node = from_end >> NODE_BITS;
    let a = step_nodes[node];
    let b = step_nodes[node + 1u];
    return a + part(b - a, from_end);
}

// g.
fn bell(x: i32) -> u32 {
    let from_middle = u32(min(abs(x), REACH));
    let node = from_middle >> NODE_BITS;
    let a = bell_nodes[node];
    let b = bell_nodes[node + 1u];
    return a - part(a - b, from_middle);
}

// The part of the difference between two nodes at a coordinate between them.
fn part(difference: u32, x: u32) -> u32 {
    let fraction = x & ((1u << NODE_BITS) - 1u);
    return (difference * fraction + (1u << (NODE_BITS - 1u))) >> NODE_BITS;
}

// Product over 2^32, rounded to nearest.
fn mul_hi(a: u32, b: u32) -> u32 {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let left = (a >> 16u) * (b & 0xffffu);
    let right = (a & 0xffffu) * (b >> 16u);
    let middle = (low >> 16u) + (left & 0xffffu) + (right & 0xffffu);
    let high = (a >> 16u) * (b >> 16u) + (left >> 16u) + (right >> 16u) + (middle >> 16u);
    return high + ((middle >> 15u) & 1u);
}
