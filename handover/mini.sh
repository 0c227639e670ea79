#!/bin/bash
# weights from a checkpoint, then the mini crate
cd /work/wt/reader/examples/readings && /tmp/readings/venv/bin/python -c "
import pickle,net,sys
p,s=pickle.load(open('$1','rb'))
open('/work/wt/reader/src/score/weights.bin','wb').write(net.integers(p,s))"
cd /tmp/readings/mini
python3 - <<'P'
import re
s=open('/work/wt/reader/src/settings.rs').read()
k=s.index('#[cfg(test)]') if '#[cfg(test)]' in s else len(s)
open('/tmp/readings/mini/src/settings.rs','w').write(s[:k])
s=open('/work/wt/reader/examples/readings/main.rs').read()
s=s.replace('use noctograph::','use noctoscore::').replace('use noctoscore::scene::Scene;\n','''
#[derive(Clone, Default, serde::Deserialize)]
#[serde(default)]
struct Scene { word: String, letters: noctoscore::letters::LetterOptions, camera: noctoscore::camera::CameraOptions, score: noctoscore::score::ScoreOptions }
impl Scene { fn read(p: &Path) -> Result<Self> { Ok(toml::from_str(&std::fs::read_to_string(p).unwrap()).unwrap()) } }
''')
open('/tmp/readings/mini/src/bin/readings.rs','w').write(s)
P
cargo build --release --offline --target-dir /work/wt/reader/target 2>&1 | grep -E "^error|Finished" -A 6
