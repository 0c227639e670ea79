import sys,csv
sys.argv=['x']
src=open('/work/wt/reader/examples/readings/fit.py').read();src=src[:src.index('def main')]
exec(src)
import json
path=__import__('os').environ.get('V','v1.tsv')
rows=list(csv.DictReader(open('/work/wt/reader/examples/readings/readings.tsv'),delimiter='\t'))
V=read_verdicts(path)
R=[]
for r in rows:
    v=V.get(r['photo'])
    if not v: continue
    a,b=same(r['a'],r['expected']),same(r['b'],r['expected'])
    p=np.exp(v['ln']); lg=np.clip(np.log(p/np.maximum(1-p,5e-4)),-9,8)
    rl=np.clip(np.log((1-v['rival_p']+1e-4)/(v['rival_p']+1e-4)),-9,9)
    R.append({**r,**v,'both':a and b,'sure':a and b and r['a_sure']=='sure'==r['b_sure'],'accuracy':np.mean([character_accuracy(r[x],r['expected']) for x in 'ab']),
      'f':dict(worst=v['worst'],mean=v['mean'],wl=lg.min(),ml=lg.mean(),rl=rl,n=len(p))})
ch=[r for r in R if r['half']=='choose'];te=[r for r in R if r['half']=='test']
for names in (['worst','mean'],['wl','ml'],['wl','ml','rl'],['wl','ml','rl','worst','mean'],['ml','rl','n'],['wl','ml','rl','n','mean']):
    X=lambda rs:np.array([[r['f'][n] for n in names] for r in rs])
    y=np.array([float(r['sure']) for r in ch]);w=logistic(X(ch),y,np.ones(len(ch)))
    out=[]
    for rs in (ch,te):
        p=1/(1+np.exp(-np.column_stack([np.ones(len(rs)),X(rs)])@w)); s=np.array([r['sure'] for r in rs]);b=np.array([r['both'] for r in rs])
        out.append('AUC both %.3f sure %.3f Brier %.3f rho %.2f max %.2f low %d/%d'%(auc(p,b),auc(p,s),np.mean((p-s)**2),spearman(p,np.array([r['accuracy'] for r in rs])),p.max(),(p[s]<.3).sum(),s.sum()))
    print(names,np.round(w,2),'\n   choose',out[0],'\n   test  ',out[1])
