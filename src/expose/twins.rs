//! The two backends leave the same bits; and the shader is what the Rust side takes it for.

use wgpu::naga;

use super::cpu::WEIGHT_BITS;
use super::gpu::{Gpu, SHADER};
use super::record::{DITHER, Record};
use super::tables::{BELL_BITS, NODE_BITS};
use super::tests::{camera, figure, lamp};
use super::*;

/// The device; `None` without one, which is a failure where `NOCTOGRAPH_REQUIRE_GPU` is 1.
fn device() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            let required = std::env::var("NOCTOGRAPH_REQUIRE_GPU").is_ok_and(|v| v == "1");
            assert!(!required, "NOCTOGRAPH_REQUIRE_GPU is 1, but: {e}");
            println!("skipped: no adapter ({e})");
            None
        }
    }
}

/// Records of a trace, at the finest scale.
fn records(lamps: Vec<crate::light::Lamp>, camera: &Camera, tolerance_px: f64) -> Vec<Record> {
    let stamps = stamps(&LightTrace { lamps }, camera, tolerance_px).expect("stamps");
    let scale = scale::finest_scale_log2(&stamps, 0.0, [camera.width_px, camera.height_px]);
    stamps.iter().map(|stamp| stamp.record(scale)).collect()
}

/// Scenes by name: pictures, and what is on them.
pub(super) fn scenes() -> Vec<(&'static str, [u32; 2], Vec<Record>)> {
    // Splitmix64, a throw of 0 to 1: random hops, hovers and streaks across every border.
    let mut state = 7_u64;
    let mut throw = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    };
    let mut hops = lamp((0..400).map(|i| {
        let place = [3.4 * (throw() - 0.5), 1.0 + 4.0 * throw(), 2.2 * (throw() - 0.5)];
        (f64::from(i) * 0.01, place)
    }));
    hops.emitter.rgb = [0.3, 1.1, 2.2];
    let mut red = figure(1500);
    red.emitter.rgb = [4.7, 0.0, 0.0];
    let hover = lamp([(0.0, [0.2, 3.0, 0.1]), (9.0, [0.2, 3.0, 0.1])]);
    let corner = lamp([(0.0, [-1.54, 3.0, 0.96]), (9.0, [-1.54, 3.0, 0.96])]);
    let slow = lamp((0..300).map(|i| (f64::from(i) * 0.004, [f64::from(i) * 1e-4, 3.0, 0.0])));

    let vga = camera(640, 400);
    let soft = Camera { blur_m: 900e-6, ..camera(640, 400) };
    let tall = camera(97, 1500);
    vec![
        ("random hops", [640, 400], records(vec![hops.clone()], &vga, 0.005)),
        ("random hops, soft lens", [640, 400], records(vec![hops.clone()], &soft, 0.0)),
        ("figures", [640, 400], records(vec![red, figure(1500)], &vga, 0.005)),
        ("hover, corner, slow", [640, 400], records(vec![hover, corner, slow], &vga, 0.0)),
        ("tall picture", [97, 1500], records(vec![hops], &tall, 0.005)),
        ("nothing", [33, 17], Vec::new()),
    ]
}

#[test]
fn both_backends_leave_the_same_bits() {
    let Some(gpu) = device() else { return };
    for (name, size_px, records) in scenes() {
        let on_gpu = gpu.splat(&records, size_px).expect("splat");
        let on_cpu = cpu::splat(2, &records, size_px);
        let lit = on_cpu.iter().filter(|&&count| count > 0).count();
        assert!(records.is_empty() || lit > 100, "{name}: {lit} counts are lit");
        let differ = on_cpu.iter().zip(&on_gpu).filter(|(a, b)| a != b).count();
        assert!(differ == 0 && on_cpu.len() == on_gpu.len(), "{name}: {differ} counts differ");
    }
}

#[test]
fn bands_of_rows_leave_the_same_bits_as_the_whole() {
    let Some(mut gpu) = device() else { return };
    gpu.max_film_bytes = 12 * 640 * 37;
    for (name, size_px, records) in scenes() {
        let on_gpu = gpu.splat(&records, size_px).expect("splat");
        assert!(on_gpu == cpu::splat(2, &records, size_px), "{name}: bands differ");
    }
    gpu.max_film_bytes = 12 * 32;
    let refused = gpu.splat(&[], [33, 17]).expect_err("not even a row fits");
    assert!(matches!(refused, Error::Gpu { .. }), "{refused}");
}

#[test]
fn more_records_than_one_dispatch_holds_are_all_exposed() {
    let Some(gpu) = device() else { return };
    let spot = Record { width: 3, height: 2, ..scenes()[3].2[0] };
    let spot = Record { amplitude: [0, 1 << 20, 0], shift: 1, ..spot };
    let many = vec![spot; (1 << 20) + (1 << 15) + 5];
    let on_gpu = gpu.splat(&many, [640, 400]).expect("splat");
    assert!(on_gpu == cpu::splat(2, &many, [640, 400]), "counts differ");
}

#[test]
fn every_mutation_of_the_shader_is_noticed() {
    let Some(mut gpu) = device() else { return };
    let mutations = [
        ("DITHER_X: u32 = 0xC13FA9A9u", "DITHER_X: u32 = 0xC13FA9A8u"),
        ("i32(i) * record.step", "i32(i) * record.step + 1"),
        ("low < b.low", "low > b.low"),
        ("Wide(0u, 1u << 31u)", "Wide(0u, 0u)"),
        ("Wide(2u, 0u)", "Wide(0u, 0u)"),
        ("(1u << (NODE_BITS - 1u))) >> NODE_BITS", "0u) >> NODE_BITS"),
        ("record.blue, up", "record.green, up"),
        ("k < record.spots", "k + 1u < record.spots"),
        ("up << shift", "0u"),
        ("film[place], counts", "film[place], counts & 0xfffffffeu"),
        ("pixel < pixels", "pixel + 1u < pixels"),
    ];
    let scenes = scenes();
    for (from, to) in mutations {
        let mutant = SHADER.replace(from, to);
        assert_ne!(mutant, SHADER, "`{from}` is in the shader");
        gpu.load(&mutant);
        let noticed = scenes.iter().any(|(_, size_px, records)| {
            gpu.splat(records, *size_px).expect("splat") != cpu::splat(2, records, *size_px)
        });
        assert!(noticed, "`{to}` for `{from}` went unnoticed");
    }
}

#[test]
fn a_shader_that_does_not_compile_is_an_error_of_the_device() {
    let Some(mut gpu) = device() else { return };
    let broken = SHADER.replace("let plane =", "let plane +");
    gpu.load(&broken);
    let refused = gpu.splat(&[], [33, 17]).expect_err("broken shader");
    assert!(matches!(refused, Error::Gpu { .. }), "{refused}");
    gpu.load(SHADER);
    assert!(gpu.splat(&[], [33, 17]).is_ok(), "the device is still well");
}

#[test]
fn the_chosen_backend_is_used_and_leaves_the_same_film() {
    let trace = LightTrace { lamps: vec![figure(800)] };
    let exposed = |backend| {
        expose(&trace, &camera(320, 200), &ExposeOptions { backend, ..Default::default() })
    };
    let on_cpu = exposed(BackendChoice::Cpu).expect("film");
    assert_eq!((on_cpu.backend, &*on_cpu.adapter), (Backend::Cpu, "CPU"), "cpu");
    let auto = exposed(BackendChoice::Auto).expect("film");
    assert_eq!(auto.film, on_cpu.film, "auto");
    match exposed(BackendChoice::Wgpu) {
        Ok(on_gpu) => {
            assert_eq!(on_gpu.film.sha256(), on_cpu.film.sha256(), "wgpu");
            assert_eq!(auto.backend, Backend::Wgpu, "auto takes the device");
        }
        Err(e) => assert!(e.hint().contains("--backend cpu"), "{e}"),
    }
}

/// The shader, parsed and validated; this needs no device.
fn module() -> (naga::Module, naga::proc::Layouter) {
    let module = naga::front::wgsl::parse_str(SHADER).expect("WGSL");
    let flags = naga::valid::ValidationFlags::all();
    let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
    validator.validate(&module).expect("valid shader");
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).expect("layout");
    (module, layouter)
}

#[test]
fn the_shader_is_valid_and_uses_no_floating_point() {
    let (module, _) = module();
    for (_, ty) in module.types.iter() {
        let scalar = ty.inner.scalar();
        let float = scalar.is_some_and(|s| s.kind == naga::ScalarKind::Float);
        assert!(!float, "{ty:?} is a floating-point type");
    }
}

#[test]
fn constants_of_the_shader_equal_those_of_the_cpu() {
    let (module, _) = module();
    let found = |wanted: &str| {
        let named = |(_, c): &(_, &naga::Constant)| c.name.as_deref() == Some(wanted);
        let (_, constant) = module.constants.iter().find(named).expect(wanted);
        match module.global_expressions[constant.init] {
            naga::Expression::Literal(naga::Literal::U32(value)) => i64::from(value),
            naga::Expression::Literal(naga::Literal::I32(value)) => i64::from(value),
            ref other => panic!("{wanted} is {other:?}"),
        }
    };
    assert_eq!(found("NODE_BITS"), i64::from(NODE_BITS));
    assert_eq!(found("BELL_BITS"), i64::from(BELL_BITS));
    assert_eq!(found("WEIGHT_BITS"), i64::from(WEIGHT_BITS));
    assert_eq!([found("DITHER_X"), found("DITHER_Y")], DITHER.map(i64::from));
}

#[test]
fn a_record_lies_in_memory_as_the_shader_reads_it() {
    let (module, layouter) = module();
    let named = |(_, ty): &(_, &naga::Type)| ty.name.as_deref() == Some("Record");
    let (handle, ty) = module.types.iter().find(named).expect("Record");
    let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("no struct") };
    assert_eq!(*span as usize, size_of::<Record>(), "size");
    assert_eq!(layouter[handle].size as usize, size_of::<Record>(), "stride");
    macro_rules! offsets {
        ($($field:ident),*) => { [$((stringify!($field), std::mem::offset_of!(Record, $field))),*] };
    }
    let amplitude = std::mem::offset_of!(Record, amplitude);
    let mut wanted = Vec::from(offsets!(u, v, share, x, y, width, height, step, spots));
    wanted.extend([("red", amplitude), ("green", amplitude + 4), ("blue", amplitude + 8)]);
    wanted.extend(offsets!(shift, dither, unused));
    let found: Vec<_> =
        members.iter().map(|m| (m.name.as_deref().expect("name"), m.offset as usize)).collect();
    assert_eq!(found, wanted, "names and offsets");
}
