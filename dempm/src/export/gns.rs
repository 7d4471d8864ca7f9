//! `.npz` files for geoelements/gns: one array `gns_data` of Python objects, a tuple (positions,
//! particle types, material property) a trajectory, as `gns/data_loader.py` reads it.
//!
//! Trajectories of a set differ in their numbers of points and frames, which only an array of
//! objects can hold, and numpy stores that as a pickle: <https://docs.python.org/3/library/pickle>,
//! opcodes in `pickletools.py`.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use files::{OutputFile, write_atomically};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::error::ExportError;
use super::npy::npy_header;
use super::particles::{Kind, Particles};

/// Sand among the particle types of the GNS data sets.
const SAND: i64 = 6;
/// `KINEMATIC_PARTICLE_ID` of `gns/train.py`: rollouts take the positions of these particles from the data.
const KINEMATIC: i64 = 3;

/// Writes the trajectories of a split to `path` with the suffix `.npz`, each with its friction if
/// `with_friction`.
pub(super) fn write(
    trajectories: &[Particles],
    path: &Path,
    with_friction: bool,
) -> Result<(), ExportError> {
    let path = path.with_extension("npz");
    let at = ExportError::at(&path);
    write_atomically(&path, |temporary| {
        let mut file = OutputFile::create(temporary).map_err(&at)?;
        let mut archive = ZipWriter::new(BufWriter::new(&mut file));
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .large_file(true);
        archive.start_file("gns_data.npy", options).map_err(io::Error::from).map_err(&at)?;
        archive.write_all(&npy_header("|O", &[trajectories.len()])).map_err(&at)?;
        let mut pickle = Pickle(archive);
        pickle.begin().map_err(&at)?;
        pickle.begin_array(&[trajectories.len()], Element::Object).map_err(&at)?;
        pickle.raw(EMPTY_LIST).map_err(&at)?;
        pickle.raw(MARK).map_err(&at)?;
        for trajectory in trajectories {
            write_tuple(trajectory, with_friction, &mut pickle, &at)?;
        }
        pickle.raw(APPENDS).map_err(&at)?;
        pickle.end_array().map_err(&at)?;
        pickle.raw(STOP).map_err(&at)?;
        let mut file = pickle.0.finish().map_err(io::Error::from).map_err(&at)?;
        file.flush().map_err(&at)
    })
}

/// (positions, particle types) or (positions, particle types, material property)
fn write_tuple<W: Write>(
    particles: &Particles,
    with_friction: bool,
    pickle: &mut Pickle<W>,
    at: &impl Fn(io::Error) -> ExportError,
) -> Result<(), ExportError> {
    let (frames, count) = (particles.trajectory.frames(), particles.count());
    pickle.raw(MARK).map_err(at)?;
    pickle.begin_array(&[frames, count, 2], Element::F32).map_err(at)?;
    for frame in 0..frames {
        let positions = particles.positions(frame)?;
        let bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
        pickle.raw(&bytes).map_err(at)?;
    }
    pickle.end_array().map_err(at)?;
    let kind = |kind: &Kind| if *kind == Kind::Material { SAND } else { KINEMATIC };
    let kinds: Vec<u8> = particles.kinds.iter().flat_map(|k| kind(k).to_le_bytes()).collect();
    pickle.array(&[count], Element::I64, &kinds).map_err(at)?;
    if with_friction && let Some(friction) = particles.friction() {
        let values = (friction as f32).to_le_bytes().repeat(count);
        pickle.array(&[count], Element::F32, &values).map_err(at)?;
    }
    pickle.raw(TUPLE).map_err(at)
}

const MARK: &[u8] = b"(";
const TUPLE: &[u8] = b"t";
const EMPTY_LIST: &[u8] = b"]";
const APPENDS: &[u8] = b"e";
const REDUCE: &[u8] = b"R";
const BUILD: &[u8] = b"b";
const NONE: &[u8] = b"N";
const STOP: &[u8] = b".";

/// Type of an array's elements.
#[derive(Clone, Copy)]
enum Element {
    F32,
    I64,
    Object,
}

impl Element {
    /// Bytes of a number; 0 for an object.
    fn size(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::I64 => 8,
            Self::Object => 0,
        }
    }
}

/// A pickle of protocol 4, written as `ndarray.__reduce__` describes arrays.
struct Pickle<W: Write>(W);

impl<W: Write> Pickle<W> {
    fn raw(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn begin(&mut self) -> io::Result<()> {
        self.raw(b"\x80\x04")
    }

    fn integer(&mut self, value: i32) -> io::Result<()> {
        self.raw(b"J")?;
        self.raw(&value.to_le_bytes())
    }

    /// At most 255 bytes.
    fn text(&mut self, text: &str) -> io::Result<()> {
        self.raw(&[0x8c, text.len() as u8])?;
        self.raw(text.as_bytes())
    }

    fn boolean(&mut self, value: bool) -> io::Result<()> {
        self.raw(if value { b"\x88" } else { b"\x89" })
    }

    /// A class or function by its module and name.
    fn global(&mut self, module: &str, name: &str) -> io::Result<()> {
        self.raw(format!("c{module}\n{name}\n").as_bytes())
    }

    /// An array of `bytes` in C order.
    fn array(&mut self, shape: &[usize], element: Element, bytes: &[u8]) -> io::Result<()> {
        self.begin_array(shape, element)?;
        self.raw(bytes)?;
        self.end_array()
    }

    /// Announces `length` bytes, which follow.
    fn begin_bytes(&mut self, length: usize) -> io::Result<()> {
        self.raw(&[0x8e])?;
        self.raw(&(length as u64).to_le_bytes())
    }

    /// `_reconstruct(ndarray, (0,), b'b')` and the state that begins with `(1, shape, dtype, False`. The
    /// elements follow, of numbers as that many bytes.
    fn begin_array(&mut self, shape: &[usize], element: Element) -> io::Result<()> {
        // This name is kept by all versions of numpy for the sake of old pickles.
        self.global("numpy.core.multiarray", "_reconstruct")?;
        self.raw(MARK)?;
        self.global("numpy", "ndarray")?;
        self.raw(MARK)?;
        self.integer(0)?;
        self.raw(TUPLE)?;
        self.raw(b"C\x01b")?;
        self.raw(TUPLE)?;
        self.raw(REDUCE)?;

        self.raw(MARK)?;
        self.integer(1)?;
        self.raw(MARK)?;
        for size in shape {
            let size = i32::try_from(*size).map_err(io::Error::other)?;
            self.integer(size)?;
        }
        self.raw(TUPLE)?;
        self.element_type(element)?;
        // C order.
        self.boolean(false)?;
        match element.size() {
            0 => Ok(()),
            size => self.begin_bytes(size * shape.iter().product::<usize>()),
        }
    }

    fn end_array(&mut self) -> io::Result<()> {
        self.raw(TUPLE)?;
        self.raw(BUILD)
    }

    /// `dtype(name, False, True)` with its state: version, byte order, no subtype, no fields,
    /// default size and alignment, flags.
    fn element_type(&mut self, element: Element) -> io::Result<()> {
        let (name, order, flags) = match element {
            Element::F32 => ("f4", "<", 0),
            Element::I64 => ("i8", "<", 0),
            Element::Object => ("O8", "|", 63),
        };
        self.global("numpy", "dtype")?;
        self.raw(MARK)?;
        self.text(name)?;
        self.boolean(false)?;
        self.boolean(true)?;
        self.raw(TUPLE)?;
        self.raw(REDUCE)?;
        self.raw(MARK)?;
        self.integer(3)?;
        self.text(order)?;
        (0..3).try_for_each(|_| self.raw(NONE))?;
        self.integer(-1)?;
        self.integer(-1)?;
        self.integer(flags)?;
        self.raw(TUPLE)?;
        self.raw(BUILD)
    }
}
