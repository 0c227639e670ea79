import os,json,random,subprocess,sys,re
E='PROJECT/'
words=open('/tmp/words200.txt').read().split()
names=[l.strip() for l in open('/usr/share/dict/words')]
real={w.upper() for w in names if w.isalpha()}
def variants(i,w):
    rng=random.Random(f'pairs {i}')
    out=[]
    up=w.isupper() or w.isdigit() or not w.isalpha()
    letters='ABCDEFGHIJKLMNOPQRSTUVWXYZ' if not w.isdigit() else '0123456789'
    n=len(w)
    for kind,at in (('b',0),('m',n//2),('e',n-1)):
        if n>=2:
            out.append(('many-'+kind,w[:at]+w[at+1:]))
        ins={'b':0,'m':max(1,n//2),'e':n}[kind]
        cands=[c for c in letters]
        rng.shuffle(cands)
        # real words first
        cands.sort(key=lambda c:(w[:ins]+c+w[ins:]).upper() not in real)
        c=cands[0]
        if not w.isupper() and w.isalpha():
            c=c.lower()
        nw=w[:ins]+c+w[ins:]
        if not w.isupper() and w.isalpha() and ins==0: nw=nw.capitalize()
        out.append(('few-'+kind,nw))
    return out
pairs=[]
for i,w in enumerate(words):
    for k,t in variants(i,w):
        pairs.append((f'w{i:03}',w,k,t))
tags={}
import collections
res=collections.defaultdict(list); 
root='/tmp/ptv'; os.makedirs(root,exist_ok=True)
truth={}
for d in('photos','scenes'): os.makedirs(f'{root}/{d}',exist_ok=True)
for n,w,k,t in pairs+[(f'w{i:03}',w,'own',w) for i,w in enumerate(words)]:
    nm=f'{n}-{k}'
    for d,e in(('photos','png'),('scenes','toml')):
        q=f'{root}/{d}/{nm}.{e}'
        if not os.path.lexists(q): os.symlink(f'/tmp/pt/{d}/{n}.{e}',q)
    truth[nm]={'expected':t,'shown':w}
json.dump(truth,open(f'{root}/truth.json','w'))
r=subprocess.run([E,'verdicts',root],capture_output=True,text=True)
open('/tmp/pairs.out','w').write(r.stdout); open('/tmp/pairs.err','w').write(r.stderr)
print(len(r.stdout.splitlines()), r.stderr[:300])
bad=[]
for l in r.stdout.splitlines():
    f=l.split('\t')
    if f[0]=='VIEW': continue
    name,word,R,lp,read,rival,p=f[:7]; k=name.split('-',1)[1]
    res[k].append((float(R),float(p),name,word,read,rival))
for k,v in sorted(res.items()):
    leg=[x for x in v if x[0]>=.7 and x[1]<=.5]
    lo=sum(x[0]<=.5 for x in v)/len(v)
    print(k,len(v),'legible',len(leg),'<=0.5',round(lo,3),'mean',round(sum(x[0] for x in v)/len(v),3))
    if k!='own': 
        for x in leg[:30]: print('   ',x, words[int(x[2][1:4])])
    else:
        print('   >=.9', sum(x[0]>=.9 for x in v)); 
        for x in v:
            if not (x[0]>=.7 and x[1]<=.5): print('   ',x)
