//! Keys that imply others: if a scene sets one of them, others take matching values in place of the
//! preset's, unless the scene sets them, too.

use toml::{Table, Value};

use super::Scene;
use noctograph_core::camera::Metering;
use noctograph_core::lamps::HEADLIGHTS;
use noctograph_picture::light::{Deck, RING, RingColor, RingEffect};
use noctograph_plan::PlanOptions;

/// A key that is set, the values that follow, and the function that gives the preset these values.
pub(super) struct Rule {
    pub when: &'static str,
    pub then: &'static str,
    pub apply: fn(&mut Scene, &mut [Table]),
}

pub(super) const RULES: [Rule; 4] = [
    Rule {
        when: "plan.style",
        then: "every other key of [plan] is that style's default",
        apply: |scene, layers| match last_name(layers, "plan.style") {
            Some("even") => scene.plan = PlanOptions::even(),
            Some(_) => scene.plan = PlanOptions::default(),
            None => {}
        },
    },
    Rule {
        when: "light.deck = \"color-led\"",
        then: "plan.lights = [\"color-led\"]: it has no headlights beside it",
        apply: |scene, layers| {
            let name = last_name(layers, "light.deck");
            let deck = Deck::ALL.iter().find(|deck| Some(deck.name()) == name);
            let channel = deck.map_or(HEADLIGHTS, |deck| deck.channel());
            if channel != HEADLIGHTS {
                scene.plan.lights = vec![channel.to_owned()];
            }
        },
    },
    Rule {
        when: "plan.lights = [\"ring\"] alone, without light.ring",
        then: "light.ring = \"solid\"",
        apply: solid_ring,
    },
    Rule {
        when: "camera.f_number or camera.iso, without camera.metering",
        then: "camera.metering = \"off\"",
        apply: |scene, layers| {
            let [f_number, iso, metering] = ["f_number", "iso", "metering"]
                .map(|key| last(layers, &format!("camera.{key}")).is_some());
            if (f_number || iso) && !metering {
                scene.camera.metering = Metering::Off;
            }
        },
    },
];

/// The first layer is the file. A ring that is chosen after it, for one run, shines whatever effect
/// the file has.
fn solid_ring(scene: &mut Scene, layers: &mut [Table]) {
    let Some(chosen) = layers.iter().rposition(|layer| value(layer, "plan.lights").is_some())
    else {
        return;
    };
    let lights = value(&layers[chosen], "plan.lights").and_then(Value::as_array);
    let is_ring =
        lights.is_some_and(|it| matches!(&**it, [lamp] if lamp.as_str() == Some(RING.name)));
    let meant = &layers[usize::from(chosen > 0)..];
    if !is_ring || last_name(meant, "light.ring").is_some() {
        return;
    }
    scene.light.ring = RingEffect::Solid(RingColor::default());
    if let Some(Value::Table(light)) = layers[0].get_mut("light") {
        light.remove("ring");
    }
}

/// The value that the last of some layers gives a dotted key.
fn last<'a>(layers: &'a [Table], key: &str) -> Option<&'a Value> {
    layers.iter().rev().find_map(|layer| value(layer, key))
}

fn value<'a>(layer: &'a Table, key: &str) -> Option<&'a Value> {
    let mut keys = key.split('.');
    let first = layer.get(keys.next()?);
    keys.fold(first, |value, key| value?.get(key))
}

/// The name that the last of some layers gives a choice, alone or as the `kind` of its table.
pub(super) fn last_name<'a>(layers: &'a [Table], key: &str) -> Option<&'a str> {
    layers.iter().rev().find_map(|layer| {
        let value = value(layer, key)?;
        value.as_str().or_else(|| value.get("kind")?.as_str())
    })
}
