import subprocess,os,sys,shutil,tempfile
from concurrent.futures import ThreadPoolExecutor
B='PROJECT/'
words=open('/tmp/words200.txt').read().split()
def one(a):
    i,w=a
    n=f'w{i:03}'
    if os.path.exists(f'/tmp/pt/photos/{n}.png'): return
    with tempfile.TemporaryDirectory() as d:
        r=subprocess.run([B,'preview',w,'--seed',str(i),'--size','1280x720','-o',d],capture_output=True,text=True)
        if not os.path.exists(d+'/photo.png'): print(w,r.stderr); return
        shutil.copy(d+'/photo.png',f'/tmp/pt/photos/{n}.png'); shutil.copy(d+'/scene.toml',f'/tmp/pt/scenes/{n}.toml')
        print(n,w,r.stdout.splitlines()[0],flush=True)
with ThreadPoolExecutor(2) as ex: list(ex.map(one,enumerate(words)))
