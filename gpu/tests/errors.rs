//! Messages of failures. Without a GPU, all tests but the first are skipped, unless
//! `DEMPM_REQUIRE_GPU=1`.

use std::process::Command;

use gpu::{Device, Error, Function, Launch, Pointer, kernel};

#[test]
fn without_a_gpu_the_cause_is_named() {
    let Err(error) = Device::new(0) else { return };
    let text = error.to_string();
    let causes = ["libcuda.so", "no usable GPU", "update the driver", "LD_LIBRARY_PATH"];
    assert!(causes.iter().any(|cause| text.contains(cause)), "{text}");
}

#[test]
fn a_gpu_that_is_not_there_is_an_error() {
    let Some(_) = gpu::for_tests() else { return };
    let count = Device::count();
    let error = Device::new(4096).unwrap_err();
    assert!(
        matches!(error, Error::NoSuchDevice { ordinal: 4096, count: c } if c == count),
        "{error}"
    );
}

#[test]
fn too_little_memory_is_said_in_numbers() {
    let Some(device) = gpu::for_tests() else { return };
    let (_, total) = device.context().mem_get_info().unwrap();
    for refused in [device.reserve(total + 1), device.zeros::<u8>(total + 1).map(drop)] {
        let Err(Error::OutOfMemory { needed, available }) = refused else {
            panic!("more than there is: {refused:?}")
        };
        assert!(needed == total + 1 && available <= total);
    }
    // Nothing is lost by it.
    let zeros = device.zeros::<u8>(1000).unwrap();
    assert_eq!(device.stream().clone_dtoh(&zeros).unwrap(), [0; 1000]);
}

const CHILD: &str = "DEMPM_TEST_ILLEGAL_ACCESS";
const WRONG: &str = r#"
extern "C" __global__ void wrong(unsigned* there) { there[1ull << 40] = 1; }
"#;

kernel! {
    struct Wrong: wrong {
        there: Pointer<u32>,
    }
}

/// Not a test of its own: the process that [`an_illegal_access_ends_a_run`] starts, since it leaves
/// the GPU of no use to whoever did it.
#[test]
fn access_what_is_not_there() {
    if std::env::var_os(CHILD).is_none() {
        return;
    }
    let device = Device::new(0).unwrap();
    let module = device.module("wrong.cu", WRONG, &[]).unwrap();
    let kernel = Function::<Wrong>::load(&device, &module).unwrap();
    let (numbers, stream) = (device.zeros::<u32>(1000).unwrap(), device.stream());
    let arguments = Wrong { there: Pointer::to(&numbers, stream) };
    // SAFETY: it goes beyond the array: in this process nothing else does work.
    unsafe { kernel.launch(stream, Launch::blocks(1, 1), &arguments) }.unwrap();
    let copied = device.stream().clone_dtoh(&numbers).map_err(Error::from);
    let synchronised = device.stream().synchronize().map_err(Error::from);
    let error = copied.map(drop).and(synchronised).unwrap_err();
    eprintln!("{error}");
}

#[test]
fn an_illegal_access_ends_a_run() {
    let Some(_) = gpu::for_tests() else { return };
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "access_what_is_not_there", "--nocapture"])
        .env(CHILD, "1")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains(&Error::IllegalAccess.to_string()), "{said}");
}
