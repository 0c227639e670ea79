import pickle,sys
sys.path.insert(0,'PROJECT/')
import numpy as np, fit as F
readings,own,wrong,length=pickle.load(open('/tmp/fit.pkl','rb'))
R={r['photo']:r for r in readings}
def rows(d):
    out=[]
    for k,v in d.items():
        r=R[k]; 
        right=[F.same(r[x],v['word']) for x in 'ab']; sure=[r[x+'_sure']=='sure' for x in 'ab']
        acc=np.mean([F.character_accuracy(r[x],v['word']) for x in 'ab'])
        out.append(dict(v,half=r['half'],both=all(right),sure=all(right) and all(sure),accuracy=acc,kind=r['kind']))
    return out
O,W,L=rows(own),rows(wrong),rows(length)
fin=lambda x:np.clip(x,-30,30)
def feat(v,mode):
    r=min(v['same'],v['other'])
    c=lambda x,lo=9:float(np.clip(x,-lo,9))
    if mode=='A': return [v['m'],c(r),v['pairs']]
    if mode=='B': return [v['m'],c(v['same']),c(v['other']),v['pairs']]
    if mode=='C': return [v['m'],c(r),min(v['other'],0) and max(min(v['other'],0),-9),v['pairs']]
    if mode=='D': return [v['m'],c(r),max(min(v['other'],0),-9),v['pairs'],v['pairs']*v['m']]
    if mode=='E': return [v['m'],c(r),v['pairs'],v['pairs']*v['m']]
def val(row,w,mode):
    zs=[w[0]+np.dot(w[1:],feat(v,mode)) for v in row['views']]
    if not zs: return 0.,None
    i=int(np.argmax(zs)); return 1/(1+np.exp(-zs[i])),row['views'][i]
def cap(p,v):
    if v is None: return 0.
    r=min(v['same'],v['other']); s=1/(1+np.exp(-fin(r)))
    return min(p,s) if s<.5 else p
def show(name,w,mode,half,capped):
    def pr(rs): return np.array([ (cap(*val(r,w,mode)) if capped else val(r,w,mode)[0]) for r in rs])
    o=[r for r in O if r['half']==half]; p=pr(o); both=np.array([r['both'] for r in o]); sure=np.array([r['sure'] for r in o])
    leg=np.array([ (lambda pv: pv[0]>=.7 and pv[1] is not None and min(pv[1]['same'],pv[1]['other'])>=0)(val(r,w,mode)) for r in o])
    def negs(rs):
        rs=[r for r in rs if r['half']==half and not r['both']]
        return sum((lambda pv: pv[0]>=.7 and pv[1] is not None and min(pv[1]['same'],pv[1]['other'])>=0)(val(r,w,mode)) for r in rs),len(rs)
    bins=[f"{p[m].mean():.2f}->{both[m].mean():.2f}({m.sum()})" for lo in np.arange(0,1,.2) for m in [(p>=lo)&(p<lo+.2+1e-9*(lo>.7))] if m.any()]
    print(f"{name} {half} cap={capped}: AUC {F.auc(p,both):.3f} {F.auc(p,sure):.3f} Brier {np.mean((p-both)**2):.3f} rank {F.spearman(p,np.array([r['accuracy'] for r in o])):.2f} sure<.3 {(p[sure]<.3).sum()}/{sure.sum()} leg {leg.sum()} not both {(leg&~both).sum()} wrong {negs(W)} len {negs(L)} right {np.mean([F.same(r['read'],r['word']) for r in o]):.3f}",' '.join(bins))
def fit(mode,clean,wl=.3,iters=4):
    w=None
    for it in range(iters):
        X=[];Y=[];S=[]
        for rs,wt,half in ((O,1.,'choose'),(W,.3,'choose'),(L,wl,'choose')):
            for r in rs:
                if r['half']!=half or not r['views']: continue
                v=val(r,w,mode)[1] if w is not None else max(r['views'],key=lambda v:v['R'])
                X.append(feat(v,mode)); Y.append(float(r['both'])); S.append(wt)
        for r in clean:
            v=val(r,w,mode)[1] if w is not None else max(r['views'],key=lambda v:v['R'])
            X.append(feat(v,mode)); Y.append(1.); S.append(62/max(len(clean),1))
        w=F.logistic(np.array(X),np.array(Y),np.array(S))
    return w
if __name__=='__main__':
    try: clean=pickle.load(open('/tmp/clean.pkl','rb'))
    except Exception: clean=[]
    w0=np.array([2.631,.312,.229,1.141])
    for half in('choose','test'):
        for c in(False,True): show('shipped',w0,'A',half,c)
    for mode in 'ABCDE':
        w=fit(mode,clean); print(mode,np.round(w,3))
        for half in('choose','test'):
            for c in(False,True): show(mode,w,mode,half,c)
