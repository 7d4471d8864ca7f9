set -u
mkdir -p /tmp/bin /tmp/repo /tmp/m; cp -r .gpu/. /tmp/bin/; (cd /tmp/bin; xz -dc -T0 bin.tar.xz | tar x; chmod +x dempm surrogate unit)
cp -r scenes models configs surrogate tests docs Cargo.toml /tmp/repo/
. /tmp/bin/env.sh
cd /tmp/repo/surrogate; echo "unpacked t=$SECONDS gpus $gpus cores $cores"
DEMPM_REQUIRE_GPU=1 timeout 60 unit muon 2>&1 | tail -4; echo "t=$SECONDS"
cd /tmp/repo
jobs=14
more() { only=(); while read -r n; do only+=(--only "$n"); done < /tmp/bin/$1; timeout -s INT $2 dempm dataset scenes/dataset/discs.toml -o /tmp/data --resume "${only[@]}" --jobs $jobs >/tmp/data-$1.log 2>&1; echo "$1 $? t=$SECONDS $(ls /tmp/data/train/*.h5 | wc -l)"; }
end=$(( SECONDS + ${DATA:-400} ))
more small.txt 230
[ $gpus = 1 ] && more middle.txt $(( end - SECONDS )) || more large.txt $(( end - SECONDS ))
for f in /tmp/data/train/*.ckpt; do [ -e "$f" ] && rm -f "$f" "${f%.ckpt}"; done; rm -f /tmp/data/train/*.lock
for c in at-rest boxes falls sprays plate; do echo -n "$c $(ls /tmp/data/train/$c*.h5 | wc -l), "; done; echo "data t=$SECONDS"; du -sh /tmp/data
began=$SECONDS
fill p0 3000 4 8e-4 100000; PORT=29400 train p0 40
cat /tmp/net/p0/log.csv; tail -c 300 /tmp/p0.0.log; wall=$(( SECONDS - began ))
# 860 s of training; pushforward, in the second half, makes steps 1.6 times as long.
steps=$(python3 -c "print(int(3000/($wall-${LOAD:-9})*${TRAIN:-830}/1.3/1000)*1000)"); echo "wall $wall steps $steps t=$SECONDS"
fill big $steps 4 8e-4 $(( steps / 2 )); cp /tmp/big.toml $OUT/
go big 588
