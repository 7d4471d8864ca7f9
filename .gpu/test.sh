# Draws a test set and looks at it once.
set -u
. /tmp/bin/env.sh
cd /tmp/repo
seed=$(od -An -N4 -tu4 /dev/urandom | tr -d ' '); seed=$(( seed % 100000000 )); echo "seed $seed" | tee $OUT/seed.txt
sed -i "s/^seed = 39921/seed = $seed/" scenes/dataset/discs-test*.toml
timeout -s INT 170 dempm dataset scenes/dataset/discs-test.toml -o /tmp/test --jobs 14 >/tmp/test.log 2>&1; echo "test $? $SECONDS $(ls /tmp/test/test/*.h5 | wc -l)"
for x in big old deep; do surrogate eval /tmp/m/$x.safetensors --data /tmp/test/test --truth -o /tmp/et/$x -q >/tmp/et-$x.log 2>&1 & done; wait
mkdir -p /tmp/first; cp $(ls /tmp/test/test/*.h5 | grep -v seed-) /tmp/first/
surrogate rollout /tmp/m/big.safetensors --scenes /tmp/first -o /tmp/pred -q >/dev/null 2>&1; cp /tmp/pred/rollouts.csv $OUT/
tar czf $OUT/et.tgz -C /tmp et; echo "t=$SECONDS"
