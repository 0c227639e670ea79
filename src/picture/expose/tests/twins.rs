//! Tests that both backends produce the same bits, and that the shader has the same constants and
//! structs as the Rust code.

use crate::light::LightTraceData;
use wgpu::naga;

use super::super::curves::LOW_BITS;
use super::super::gpu::{Gpu, Prepared, SHADER};
use super::super::gpu_tiles::{Part, TILE_PX};
use super::super::record::DITHER;
use super::*;

/// Returns the device, if any. Panics without a device if `NOCTOGRAPH_REQUIRE_GPU` is set.
fn device() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            let required = std::env::var_os("NOCTOGRAPH_REQUIRE_GPU").is_some();
            assert!(!required, "NOCTOGRAPH_REQUIRE_GPU is set, but: {e}");
            println!("skipped: no adapter ({e})");
            None
        }
    }
}

/// Returns the counts of an image that a device adds up.
fn splat(gpu: &Gpu, latent: &Latent) -> Result<Vec<u32>> {
    Ok(gpu.splat(latent, Prepared::new(latent))?.counts)
}

/// Returns the counts of an image that the processor adds up.
fn by_processor(latent: &Latent) -> Vec<u32> {
    latent.with_glow(cpu::splat(2, latent)).counts
}

#[test]
fn both_backends_leave_the_same_bits() {
    let Some(gpu) = device() else { return };
    for (name, latent) in scenes() {
        let on_gpu = splat(&gpu, &latent).expect("splat");
        let on_cpu = by_processor(&latent);
        let lit = on_cpu.iter().filter(|&&count| count > 0).count();
        assert!(latent.tints.is_empty() || lit > 100, "{name}: {lit} counts are lit");
        let differ = on_cpu.iter().zip(&on_gpu).filter(|(a, b)| a != b).count();
        assert!(differ == 0 && on_cpu.len() == on_gpu.len(), "{name}: {differ} counts differ");
    }
}

#[test]
fn sheets_of_few_tiles_leave_the_same_bits_as_one() {
    let Some(mut gpu) = device() else { return };
    let tile_bytes = 4 * u64::from(TILE_PX) * u64::from(TILE_PX);
    gpu.max_tiles_bytes = 7 * tile_bytes;
    for (name, latent) in scenes() {
        let on_gpu = splat(&gpu, &latent).expect("splat");
        assert!(on_gpu == by_processor(&latent), "{name}: sheets differ");
    }
    gpu.max_tiles_bytes = tile_bytes - 1;
    let refused = splat(&gpu, &scenes()[5].1).expect_err("not even a tile fits");
    assert!(matches!(refused, Error::Gpu { .. }), "{refused}");
}

#[test]
fn more_records_than_one_dispatch_holds_are_all_exposed() {
    let Some(gpu) = device() else { return };
    let (_, mut hover) = scenes().remove(3);
    let whole = hover.tints[0].records[0];
    let dim = Record { light_lx_s: 1e-4 * whole.light_lx_s, ..whole };
    // Records that cover a whole box, only its last row, and only its last column.
    let row = Record { y: 1 - dim.height.cast_signed(), ..dim };
    let column = Record { x: 1 - dim.width.cast_signed(), ..dim };
    for record in [dim, row, column] {
        hover.tints[0].records = vec![record; 40_000];
        let on_cpu = by_processor(&hover);
        assert!(on_cpu.iter().any(|&count| count > 1 << 12), "there is light");
        assert!(splat(&gpu, &hover).expect("splat") == on_cpu, "counts of {record:?} differ");
    }
}

#[test]
fn every_mutation_of_the_shader_is_noticed() {
    let Some(mut gpu) = device() else { return };
    let mutations = [
        ("DITHER_X: u32 = 0xC13FA9A9u", "DITHER_X: u32 = 0xC13FA9A8u"),
        ("index = list.x", "index = list.x + 1u"),
        ("index < list.y", "index + 1u < list.y"),
        ("% THREADS; i < record.columns", "% THREADS; i + 1u < record.columns"),
        (
            "if next < record.columns {\n                    let",
            "if next + 1u < record.columns {\n                    let",
        ),
        ("dither + THREADS * DITHER_X", "dither"),
        ("j < record.rows", "j + 1u < record.rows"),
        ("place += TILE_PX", "place += TILE_PX + 1u"),
        ("dither += DITHER_Y", "dither -= DITHER_Y"),
        ("across & vec4u(0xffffu)", "across & vec4u(0xfffeu)"),
        ("low.x + low.y + low.z + low.w", "low.x + low.y + low.z"),
        ("+ high.w", ""),
        ("+ (rest >> LOW_BITS)", ""),
        ("(dither >> (32u - shift))", "0u"),
    ];
    let scenes = scenes();
    for (from, to) in mutations {
        let mutant = SHADER.replace(from, to);
        assert_ne!(mutant, SHADER, "`{from}` is in the shader");
        gpu.load(&mutant);
        let noticed = scenes
            .iter()
            .any(|(_, latent)| splat(&gpu, latent).expect("splat") != by_processor(latent));
        assert!(noticed, "`{to}` for `{from}` went unnoticed");
    }
}

#[test]
fn a_shader_that_does_not_compile_is_an_error_of_the_device() {
    let Some(mut gpu) = device() else { return };
    let broken = SHADER.replace("let list =", "let list +");
    gpu.load(&broken);
    let refused = splat(&gpu, &scenes()[0].1).expect_err("broken shader");
    assert!(matches!(refused, Error::Gpu { .. }), "{refused}");
    gpu.load(SHADER);
    assert!(splat(&gpu, &scenes()[0].1).is_ok(), "the device is still well");
}

#[test]
fn the_chosen_backend_is_used_and_leaves_the_same_film() {
    let trace = LightTrace::made(LightTraceData { lamps: vec![figure(800)] });
    let exposed = |backend| expose(&trace, &camera(320, 200), &ExposeOptions::default(), backend);
    let on_cpu = exposed(BackendChoice::Cpu).expect("film");
    assert_eq!((on_cpu.backend, &*on_cpu.adapter), (Backend::Cpu, "CPU"), "cpu");
    let auto = exposed(BackendChoice::Auto).expect("film");
    assert_eq!(auto.film, on_cpu.film, "auto");
    match exposed(BackendChoice::Wgpu) {
        Ok(on_gpu) => {
            assert_eq!(on_gpu.film.sha256(), on_cpu.film.sha256(), "wgpu");
            assert_eq!(auto.backend, Backend::Wgpu, "auto takes the device");
            let next = Developer::start(BackendChoice::Wgpu);
            let device = next.device.lock().unwrap();
            assert!(device.gpu.is_some() && device.opening.is_none(), "the device was kept");
        }
        Err(e) => assert!(e.hint().contains("processor"), "{e}"),
    }
}

/// Returns the shader, parsed and validated without a device.
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
    let constant = |wanted: &str| {
        let (_, constant) =
            module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(wanted)).expect(wanted);
        match module.global_expressions[constant.init] {
            naga::Expression::Literal(naga::Literal::U32(value)) => i64::from(value),
            naga::Expression::Literal(naga::Literal::I32(value)) => i64::from(value),
            ref other => panic!("{wanted} is {other:?}"),
        }
    };
    assert_eq!(constant("LOW_BITS"), i64::from(LOW_BITS));
    assert_eq!(constant("TILE_PX"), i64::from(TILE_PX));
    assert_eq!([constant("DITHER_X"), constant("DITHER_Y")], DITHER.map(i64::from));
}

#[test]
fn a_record_lies_in_memory_as_the_shader_reads_it() {
    let (module, layouter) = module();
    let (handle, ty) =
        module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Record")).expect("Record");
    let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("no struct") };
    assert_eq!(*span as usize, size_of::<Part>(), "size");
    assert_eq!(layouter[handle].size as usize, size_of::<Part>(), "stride");
    macro_rules! offsets {
        ($($field:ident),*) => { [$((stringify!($field), std::mem::offset_of!(Part, $field))),*] };
    }
    let wanted = offsets!(place, columns, rows, along, across, shift, dither, unused);
    let actual: Vec<_> =
        members.iter().map(|m| (m.name.as_deref().expect("name"), m.offset as usize)).collect();
    assert_eq!(actual, wanted, "names and offsets");
}
