# Trains on until $1; validation; with TEST=1 a test set.
set -u
. /tmp/bin/env.sh
cd /tmp/repo
[ "${1:-0}" -gt 0 ] && go big $1
[ "$(ls /tmp/data-valid/valid/*.h5 2>/dev/null | wc -l)" -ge 42 ] && ! ls /tmp/data-valid/valid/*.ckpt 2>/dev/null || timeout -s INT 75 dempm dataset scenes/dataset/discs.toml -o /tmp/data-valid --resume --only valid --jobs 14 >/tmp/valid.log 2>&1; echo "valid t=$SECONDS $(ls /tmp/data-valid/valid/*.h5 | wc -l)"
cp /tmp/net/big/last.safetensors /tmp/m/big.safetensors; cp models/tgnns-discs.safetensors /tmp/m/old.safetensors; cp models/tgnns-discs-deep.safetensors /tmp/m/deep.safetensors
for x in big deep old; do surrogate eval /tmp/m/$x.safetensors --data /tmp/data-valid/valid -o /tmp/ev/$x -q >/tmp/ev-$x.log 2>&1 & done; wait
python3 /tmp/bin/classes.py | tee $OUT/classes.txt; tar czf $OUT/ev.tgz -C /tmp ev; echo "t=$SECONDS"
surrogate calibrate-error /tmp/m/big.safetensors --data /tmp/data-valid/valid >$OUT/calibrate.txt 2>&1; tail -1 $OUT/calibrate.txt
cp /tmp/m/big.safetensors $OUT/; echo "t=$SECONDS"
[ -n "${TEST:-}" ] && bash /tmp/bin/test.sh
