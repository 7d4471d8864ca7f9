import csv,collections,os
for n in sorted(os.listdir('/tmp/ev')):
    try: rows=list(csv.DictReader(open(f'/tmp/ev/{n}/summary.csv')))
    except Exception as e: print(n,e); continue
    c=collections.defaultdict(list)
    for r in rows:
        k=r['case'].split('/')[-1].rsplit('-',1)[0]
        if r['case']!='mean': c[k].append(tuple(float(r[x] or 'nan') for x in ('distance_mean','distance_final')))
    f=lambda v:'%.3f (%.3f)'%tuple(sum(x[i] for x in v)/len(v) for i in (0,1))
    m=lambda v:sum(x[0] for x in v)/len(v)
    print('%-10s'%n,'all',f([x for v in c.values() for x in v]),{k:f(v) for k,v in c.items()})
    # the mean over classes of the distance relative to that of old without a rest speed is not known yet
    s=sum(m(v)/w for (k,v),w in ((kv,{'at-rest':.077,'boxes':.057,'falls':.307,'plate':.058,'sprays':.58}[kv[0]]) for kv in c.items()))
    print('   relative %.3f'%(s/5))
