//! Kernels that take their places early. Without a GPU these tests say so and pass, unless
//! `DEMPM_REQUIRE_GPU=1`.

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaFunction, DevicePtr, LaunchConfig};
use gpu::{Device, Error, Launch, argument};

const LEN: usize = 10_000;
const SOURCE: &str = r#"
extern "C" __global__ void turn(const unsigned* from, unsigned* to, unsigned n) {
    await_turn();
    const unsigned k = blockIdx.x * blockDim.x + threadIdx.x;
    if (k < n) to[k] = 3 * from[(k + n / 2 + 1) % n] + k;
}
"#;

/// The CPU's `turn`.
fn turned(from: &[u32]) -> Vec<u32> {
    let n = from.len();
    let of = |k: usize| from[(k + n / 2 + 1) % n].wrapping_mul(3).wrapping_add(k as u32);
    (0..n).map(of).collect()
}

/// Each kernel reads what other blocks of the one before have written.
#[test]
fn every_kernel_sees_the_work_of_the_one_before() {
    let Some(device) = gpu::for_tests() else { return };
    let kernel = device.module("turn.cu", SOURCE, &[]).unwrap().load_function("turn").unwrap();
    let start: Vec<u32> = (0..LEN as u32).collect();
    let buffers = [device.upload(&start).unwrap(), device.zeros::<u32>(LEN).unwrap()];
    let stream = device.stream();
    let addresses = [&buffers[0], &buffers[1]].map(|buffer| buffer.device_ptr(stream).0);
    let there_and_back = || {
        turn(&device, &kernel, addresses).unwrap();
        turn(&device, &kernel, [addresses[1], addresses[0]]).unwrap();
    };
    (0..100).for_each(|_| there_and_back());
    // The same in a graph.
    stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL).unwrap();
    (0..50).for_each(|_| there_and_back());
    let graph = stream.end_capture(CUgraphInstantiate_flags(0)).unwrap().unwrap();
    graph.launch().unwrap();
    graph.launch().unwrap();
    let found = stream.clone_dtoh(&buffers[0]).unwrap();
    let expected = (0..400).fold(start, |numbers, _| turned(&numbers));
    assert_eq!(found, expected);
}

fn turn(device: &Device, kernel: &CudaFunction, [from, to]: [u64; 2]) -> Result<(), Error> {
    let config = LaunchConfig {
        grid_dim: (LEN.div_ceil(64) as u32, 1, 1),
        block_dim: (64, 1, 1),
        shared_mem_bytes: 0,
    };
    let n = LEN as u32;
    let arguments = [argument(&from), argument(&to), argument(&n)];
    // SAFETY: the arguments of `turn`; both buffers have LEN entries.
    let how = Launch { early: true, urgent: true };
    unsafe { device.launch(how, device.stream(), kernel, config, &arguments) }
}
