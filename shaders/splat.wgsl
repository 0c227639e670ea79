// Splat: every record adds its light to the film. Twin of src/expose/cpu.rs.
// reads   params, records : 96 bytes each (record.rs); bell : the curve (tables.rs)
// writes  film : counts, a plane for each color channel, row by row
// thread  every 64th pixel of one record's box, row by row; a workgroup is a record
// repeats as all is integers: sums have no order, products no rounding of the device's own

const NODE_BITS: u32 = 15u;
const BELL_BITS: u32 = 26u;
const WEIGHT_BITS: u32 = 22u;
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
    u: vec4i,
    v: vec4i,
    share: vec4u,
    x: u32,
    y: u32,
    width: u32,
    height: u32,
    step: i32,
    spots: u32,
    red: u32,
    green: u32,
    blue: u32,
    shift: u32,
    dither: u32,
    unused: u32,
}

// A number of 64 bits.
struct Wide {
    high: u32,
    low: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> records: array<Record>;
@group(0) @binding(2) var<storage, read> bell_nodes: array<u32>;
@group(0) @binding(3) var<storage, read_write> film: array<atomic<u32>>;

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
    let plane = params.width * params.rows;
    let pixels = record.width * (max(end, first) - first);
    for (var pixel = thread; pixel < pixels; pixel += THREADS) {
        let i = pixel % record.width;
        let row = first + pixel / record.width;
        let j = row - record.y;
        let weight = weight(record, i, j);
        if weight == 0u {
            continue;
        }
        let place = (row - params.first_row) * params.width + record.x + i;
        let dither = record.dither + i * DITHER_X + j * DITHER_Y;
        let up = dither >> (32u - WEIGHT_BITS);
        add(place, counts(weight, record.red, up, record.shift));
        add(place + plane, counts(weight, record.green, up, record.shift));
        add(place + 2u * plane, counts(weight, record.blue, up, record.shift));
    }
}

fn add(place: u32, counts: u32) {
    if counts != 0u {
        atomicAdd(&film[place], counts);
    }
}

// Share of a record's amplitude that the pixel of column i and row j gets, 2^22 for 1.
fn weight(record: Record, i: u32, j: u32) -> u32 {
    let along = curves(record.u + vec4i(i32(i) * record.step), record.spots);
    let across = curves(record.v + vec4i(i32(j) * record.step), record.spots);
    var sum = Wide(0u, 0u);
    for (var k = 0u; k < record.spots; k++) {
        // Curve times share, 2^30 for 1, rounded to nearest.
        let part = plus(times(across[k] << (31u - BELL_BITS), record.share[k]), Wide(0u, 1u << 31u));
        sum = plus(sum, times(along[k], part.high));
    }
    return right(plus(sum, Wide(2u, 0u)), BELL_BITS + 30u - WEIGHT_BITS);
}

// Amplitude times weight, rounded by a threshold.
fn counts(weight: u32, amplitude: u32, up: u32, shift: u32) -> u32 {
    let threshold = Wide(up >> (32u - shift), up << shift);
    return right(plus(times(weight, amplitude), threshold), WEIGHT_BITS + shift);
}

// The curve at each of some spots.
fn curves(x: vec4i, spots: u32) -> vec4u {
    var values = vec4u(0u);
    for (var k = 0u; k < spots; k++) {
        values[k] = bell(x[k]);
    }
    return values;
}

// exp(-x²/2).
fn bell(x: i32) -> u32 {
    let from_middle = u32(abs(x));
    let node = from_middle >> NODE_BITS;
    let a = bell_nodes[node];
    let b = bell_nodes[node + 1u];
    let part = from_middle & ((1u << NODE_BITS) - 1u);
    return a - (((a - b) * part + (1u << (NODE_BITS - 1u))) >> NODE_BITS);
}

fn times(a: u32, b: u32) -> Wide {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let left = (a >> 16u) * (b & 0xffffu);
    let right = (a & 0xffffu) * (b >> 16u);
    let middle = (low >> 16u) + (left & 0xffffu) + (right & 0xffffu);
    let high = (a >> 16u) * (b >> 16u) + (left >> 16u) + (right >> 16u) + (middle >> 16u);
    return Wide(high, (middle << 16u) | (low & 0xffffu));
}

fn plus(a: Wide, b: Wide) -> Wide {
    let low = a.low + b.low;
    return Wide(a.high + b.high + select(0u, 1u, low < b.low), low);
}

// A number without its last bits, of which there are 23 or more; it must fit.
fn right(a: Wide, bits: u32) -> u32 {
    return select((a.high << (32u - bits)) | (a.low >> bits), a.high >> (bits - 32u), bits >= 32u);
}
