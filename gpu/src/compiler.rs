//! Compiles CUDA C++ with NVRTC, with a cache on disk.

use std::ffi::{CStr, CString};
use std::hash::{DefaultHasher, Hash, Hasher};

use cudarc::nvrtc::{result, sys};
use files::{WriteError, read_sealed, seal, write_atomically};

use crate::ahead::{self, Threads};
use crate::cache_directory;
use crate::error::Error;
use crate::source::Source;

/// First part of every source.
const PRELUDE: &str = include_str!("await_turn.cuh");

/// Whether NVRTC can be loaded.
pub fn nvrtc_is_present() -> bool {
    // SAFETY: loads the library, whose initialisers have no preconditions, and unloads it.
    unsafe { sys::is_culib_present() }
}

/// Major and minor version of NVRTC.
pub(crate) fn nvrtc_version() -> Result<(i32, i32), Error> {
    if !nvrtc_is_present() {
        return Err(Error::NvrtcMissing);
    }
    let (mut major, mut minor) = (0, 0);
    // SAFETY: writes the two integers.
    unsafe { sys::nvrtcVersion(&raw mut major, &raw mut minor) }
        .result()
        .map_err(|_| Error::NvrtcMissing)?;
    Ok((major, minor))
}

/// Compiles `source` (file `name` in messages) to a cubin for an architecture such as `sm_90a`, with
/// preprocessor definitions `NAME=value`. The source may call `await_turn` (`await_turn.cuh`).
///
/// Needs no GPU.
///
/// # Errors
/// NVRTC is missing, or the source does not compile.
pub fn compile(
    name: &str,
    source: &str,
    architecture: &str,
    defines: &[String],
) -> Result<Vec<u8>, Error> {
    if !nvrtc_is_present() {
        return Err(Error::NvrtcMissing);
    }
    let fail = |log: String| Error::Compile {
        name: name.to_owned(),
        architecture: architecture.to_owned(),
        log,
    };
    let options: Vec<String> = [
        format!("--gpu-architecture={architecture}"),
        "--std=c++17".to_owned(),
        "--generate-line-info".to_owned(),
        // Denormal f32 are zero: without it every square root checks for them.
        "--ftz=true".to_owned(),
    ]
    .into_iter()
    .chain(defines.iter().map(|d| format!("--define-macro={d}")))
    .collect();
    let c_string =
        |s: &str| CString::new(s).map_err(|_| fail("the source holds a zero byte".into()));
    let source = format!("#line 1 \"await_turn.cuh\"\n{PRELUDE}#line 1 \"{name}\"\n{source}");
    let (c_source, c_name) = (c_string(&source)?, c_string(name)?);
    let program =
        result::create_program(&c_source, Some(&c_name)).map_err(|e| fail(format!("{e:?}")))?;

    // SAFETY: `program` lives until `destroy_program`, and so do the strings it refers to.
    let cubin = unsafe {
        match result::compile_program(program, &options) {
            Ok(()) => get_cubin(program).map_err(|e| fail(format!("{e:?}"))),
            Err(e) => Err(fail(result::get_program_log(program).map_or_else(
                |_| format!("{e:?}"),
                |log| CStr::from_ptr(log.as_ptr()).to_string_lossy().into_owned(),
            ))),
        }
    };
    // SAFETY: destroyed once, here.
    let _ = unsafe { result::destroy_program(program) };
    cubin
}

/// # Safety
/// `program` was compiled for a real architecture.
unsafe fn get_cubin(program: sys::nvrtcProgram) -> Result<Vec<u8>, result::NvrtcError> {
    let mut size = 0;
    // SAFETY: the buffer has the size that NVRTC asks for.
    unsafe {
        sys::nvrtcGetCUBINSize(program, &raw mut size).result()?;
        let mut cubin = vec![0_u8; size];
        sys::nvrtcGetCUBIN(program, cubin.as_mut_ptr().cast()).result()?;
        Ok(cubin)
    }
}

/// As [`compile`], with the cache, for a version of the `driver`.
pub(crate) fn compile_cached(
    name: &str,
    source: &str,
    architecture: &str,
    defines: &[String],
    driver: (i32, i32),
) -> Result<Vec<u8>, Error> {
    let key = key(source, architecture, defines, driver)?;
    ahead::take(key, || find_or_compile(name, source, architecture, defines, key))
}

/// Starts to compile sources side by side in `threads`; what is in the cache is read. [`compile_cached`] waits for them
/// and reports errors.
pub(crate) fn compile_ahead(
    threads: &Threads,
    sources: impl IntoIterator<Item = Source>,
    architecture: &str,
    driver: (i32, i32),
) {
    for Source { name, text, defines } in sources {
        if let Ok(key) = key(&text, architecture, &defines, driver) {
            let architecture = architecture.to_owned();
            ahead::start(threads, key, move || {
                find_or_compile(name, &text, &architecture, &defines, key)
            });
        }
    }
}

/// All that a compiled source depends on, the version of the `driver` included.
fn key(
    source: &str,
    architecture: &str,
    defines: &[String],
    driver: (i32, i32),
) -> Result<u64, Error> {
    let nvrtc = nvrtc_version()?;
    let mut hasher = DefaultHasher::new();
    (PRELUDE, source, architecture, defines, driver, nvrtc, env!("CARGO_PKG_VERSION"))
        .hash(&mut hasher);
    Ok(hasher.finish())
}

/// Reads a compiled source from the cache, or compiles it and adds it there.
fn find_or_compile(
    name: &str,
    source: &str,
    architecture: &str,
    defines: &[String],
    key: u64,
) -> Result<Vec<u8>, Error> {
    let file = cache_directory().map(|folder| {
        let stem = name.trim_end_matches(".cu");
        folder.join(format!("{stem}-{architecture}-{key:016x}.cubin"))
    });
    // A damaged one is compiled again.
    if let Some(cubin) = file.as_ref().and_then(|file| read_sealed(file).ok()) {
        return Ok(cubin);
    }
    let cubin = compile(name, source, architecture, defines)?;
    if let Some(file) = file {
        // Without a cache the next start compiles again.
        let _ = write_atomically::<_, WriteError>(&file, |temporary| {
            std::fs::write(temporary, seal(cubin.clone()))
                .map_err(WriteError::at(&file, "write it"))
        });
    }
    Ok(cubin)
}
