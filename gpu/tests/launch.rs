//! Launches with programmatic dependent launch. Without a GPU they are skipped, unless
//! `DEMPM_REQUIRE_GPU=1`.

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use gpu::{ConstPointer, Device, Error, Function, Launch, Pointer, checks, kernel};

const LEN: usize = 10_000;
const SOURCE: &str = r#"
extern "C" __global__ void turn(const unsigned* from, unsigned* to, unsigned n) {
    await_turn();
    const unsigned k = blockIdx.x * blockDim.x + threadIdx.x;
    if (k < n) to[k] = 3 * from[(k + n / 2 + 1) % n] + k;
}
"#;

kernel! {
    /// Moves numbers by half the array, and changes them.
    struct Turn: turn {
        from: ConstPointer<u32>,
        to: Pointer<u32>,
        n: u32,
    }
}

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
    let module = device.module("turn.cu", &source(), &[]).unwrap();
    let kernel = Function::load(&device, &module).unwrap();
    let start: Vec<u32> = (0..LEN as u32).collect();
    let buffers = [device.upload(&start).unwrap(), device.zeros::<u32>(LEN).unwrap()];
    let stream = device.stream();
    let addresses = [&buffers[0], &buffers[1]].map(|buffer| Pointer::to(buffer, stream));
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

fn turn(
    device: &Device,
    kernel: &Function<Turn>,
    [from, to]: [Pointer<u32>; 2],
) -> Result<(), Error> {
    let launch = Launch::each(LEN, 64).early(true).urgent();
    let arguments = Turn { from: from.into(), to, n: LEN as u32 };
    // SAFETY: both buffers have LEN entries.
    unsafe { kernel.launch(device.stream(), launch, &arguments) }
}

fn source() -> String {
    format!("{SOURCE}{}", checks![Turn])
}

kernel! {
    struct Wrong: turn {
        from: ConstPointer<u32>,
        to: Pointer<u32>,
        n: i32,
    }
}

#[test]
fn parameters_are_checked() {
    if !gpu::nvrtc_for_tests() {
        return;
    }
    gpu::compile("turn.cu", &source(), "sm_80", &[]).unwrap();
    let wrong = format!("{SOURCE}{}", checks![Wrong]);
    let error = gpu::compile("turn.cu", &wrong, "sm_80", &[]).unwrap_err().to_string();
    assert!(error.contains("turn has other parameters in Rust"), "{error}");
}
