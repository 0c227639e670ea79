import sys,csv,json,subprocess,os,random,pickle
sys.path.insert(0,'PROJECT/')
import numpy as np
import fit as F
E='PROJECT/'
def run(folder, truth, tag):
    root=f'/tmp/fit_{tag}'; os.makedirs(root,exist_ok=True)
    for n in('photos','scenes'):
        if not os.path.lexists(f'{root}/{n}'): os.symlink(f'{folder}/{n}',f'{root}/{n}')
    json.dump(truth,open(f'{root}/truth.json','w'))
    out=subprocess.run(['nice','-n','-15',E,'verdicts',root],capture_output=True,text=True).stdout
    return parse(out)
def parse(out):
    cur=[];res={}
    for l in out.splitlines():
        f=l.split('\t')
        if f[0]=='VIEW':
            lp=np.array([float(x) for x in f[6].split(',')]) if f[6] else np.array([0.])
            p=np.exp(lp); lo=np.clip(np.log(np.maximum(p,1e-9)/np.maximum(1-p,5e-4)),-9,8)
            cur.append(dict(m=lo.mean(),worst=lo.min(),same=-float(f[3]),other=-float(f[4]),pairs=max(float(f[7]),-4.2),R=float(f[2])))
            continue
        res[f[0]]=dict(word=f[1],p=float(f[2]),read=f[4],rival=f[5],rp=float(f[6]),views=cur); cur=[]
    return res
if __name__=='__main__':
    readings=list(csv.DictReader(open('PROJECT/.tsv'),delimiter='\t'))
    exp={r['photo']:{'expected':r['expected']} for r in readings if r['expected']}
    wr={r['photo']:F.wrong_word(r['photo'],r['expected']) for r in readings if r['kind']=='photo'}
    wr={k:{'expected':v} for k,v in wr.items() if v}
    a=run('/tmp/rd',exp,'own'); b=run('/tmp/rd',wr,'wrong')
    # letter too many / too few on readings photos
    L={}
    for r in readings:
        if r['kind']!='photo' : continue
        w=r['expected']; rng=random.Random('len '+r['photo'])
        kind=next((k for k in F.KINDS if w[0] in k),None)
        if len(w)>2 and rng.random()<.5:
            at=rng.choice([0,len(w)//2,len(w)-1]); t=w[:at]+w[at+1:]
        else:
            at=rng.choice([0,len(w)//2,len(w)]); k=next((k for k in F.KINDS if w[min(at,len(w)-1)] in k),F.KINDS[0]); t=w[:at]+rng.choice(k)+w[at:]
        L[r['photo']]={'expected':t}
    c=run('/tmp/rd',L,'length')
    pickle.dump((readings,a,b,c),open('/tmp/fit.pkl','wb'))
    print(len(a),len(b),len(c))
