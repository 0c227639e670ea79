import tomllib,glob,json
def val(v):
    if isinstance(v,list): return '['+', '.join(val(x) for x in v)+']'
    return json.dumps(v) if isinstance(v,str) else repr(v)
for f in glob.glob('/tmp/readings/scenes/*.toml'):
    s=tomllib.load(open(f,'rb')); c=s['camera']
    if 'lens' in c: continue
    out=''
    if 'word' in s: out+=f"word = {json.dumps(s['word'])}\n"
    L=s['letters']
    if L.get('trace')=='centre-line': L['trace']='center-line'
    out+='[letters]\n'+''.join(f'{k} = {val(v)}\n' for k,v in L.items())
    out+='[camera]\n'+''.join(f'{k} = {val(c[k])}\n' for k in ('width_px','height_px','blur_m','shutter_close_s') if k in c)
    if c.get('framing')=='fixed': out+='[camera.framing]\nkind = "fixed"\n'+''.join(f'{k} = {val(c[k])}\n' for k in('position_m','target_m'))
    else: out+=f"[camera.framing]\nkind = \"word\"\nfill_frac = {c['fill_frac']}\n"
    out+='[camera.lens]\nkind = "custom"\n'+''.join(f'{k} = {val(c[k])}\n' for k in('focal_length_m','distortion') if k in c)
    open(f,'w').write(out)
