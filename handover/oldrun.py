import json,subprocess,math
t=json.load(open('/tmp/readings/truth.json'))
import random
names=[k for k in random.Random(4).sample(sorted(t),400) if t[k]['half']=='test' and t[k]['expected']]
out=open('/tmp/readings/old.tsv','w')
for k in names:
    r=subprocess.run(['nice','-n','19','/tmp/base/target/release/noctograph','score',f'photos/{k}.png',t[k]['expected'],'--scene',f'scenes_old/{k}.toml','--json'],capture_output=True,text=True,cwd='/tmp/readings')
    try: v=json.loads(r.stdout)
    except Exception: continue
    ln=','.join('%.3f'%math.log(max(l['p'],1e-9)) for l in v['letters'])
    out.write('\t'.join([k,t[k]['expected'],'%.4f'%v['probability'],ln,v['read'],'-','0','0','0',(v['second_opinion'] or '').replace('\n','/')])+'\n'); out.flush()
