export CUDA_PATH=/usr/local/cuda XDG_CACHE_HOME=/tmp/cache PATH=/tmp/bin:$PATH NCCL_NVLS_ENABLE=0
gpus=$(nvidia-smi -L | wc -l); cores=$(nproc)
fill() { sed "s/@STEPS/$2/; s/@BATCH/$3/; s/@RATE/$4/; s/@PUSH/$5/" /tmp/bin/muon.toml > /tmp/$1.toml; }
# Trains $1 on all GPUs for $2 seconds.
train() {
  for rank in $(seq 0 $(( gpus - 1 ))); do
    [ $gpus -gt 1 ] && export RANK=$rank LOCAL_RANK=$rank WORLD_SIZE=$gpus MASTER_ADDR=127.0.0.1 MASTER_PORT=${PORT:-29500}
    timeout -s INT $2 surrogate train /tmp/$1.toml --data /tmp/data -o /tmp/net/$1 --resume >>/tmp/$1.$rank.log 2>&1 & pids="${pids:-} $!"
  done
  wait $pids; pids=
  unset RANK LOCAL_RANK WORLD_SIZE MASTER_ADDR MASTER_PORT
}
# Trains until $2 seconds of this script and saves the weights.
go() {
  train $1 $(( $2 - SECONDS )); tail -1 /tmp/net/$1/log.csv; tail -c 200 /tmp/$1.0.log
  cp /tmp/net/$1/last.safetensors /tmp/net/$1/log.csv $OUT/; echo "t=$SECONDS"
}
