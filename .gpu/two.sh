# Trains on; the CPU computes the validation scenes meanwhile.
set -u
. /tmp/bin/env.sh
cd /tmp/repo
(CUDA_VISIBLE_DEVICES= RAYON_NUM_THREADS=$(( cores - 6 )) nice -n 19 timeout -s INT $(( ${1:-585} - 5 )) dempm dataset scenes/dataset/discs.toml -o /tmp/data-valid --only valid --device cpu >/tmp/valid.log 2>&1; echo "valid $? t=$SECONDS $(ls /tmp/data-valid/valid/*.h5 | wc -l)") &
go big ${1:-585}
wait
tail -c 300 /tmp/valid.log
