//! Chunks of datasets, packed on all cores: HDF5 itself packs one at a time in the whole program.

use std::mem::size_of;

use bytemuck::NoUninit;
use hdf5::{Dataset, h5check};
use hdf5_sys::LOCK;
use hdf5_sys::h5d::H5Dwrite_chunk;
use hdf5_sys::h5p::H5P_DEFAULT;
use libdeflater::{CompressionLvl, Compressor};

use super::storage::DEFLATE_LEVEL;

/// One frame of a dataset of [`create_growing`](super::storage::create_growing).
pub(super) struct Values<'a> {
    pub dataset: &'static str,
    pub frame: usize,
    /// Size of a number, bytes.
    size: usize,
    bytes: &'a [u8],
}

/// One frame of a dataset as it lies in the file.
pub(super) struct Chunk {
    pub dataset: &'static str,
    pub frame: usize,
    bytes: Vec<u8>,
}

impl<'a> Values<'a> {
    /// The numbers of a frame in C order; they convert to f64, so that rows of them are refused.
    pub fn new<T: NoUninit + Into<f64>>(
        dataset: &'static str,
        frame: usize,
        values: &'a [T],
    ) -> Self {
        Self { dataset, frame, size: size_of::<T>(), bytes: bytemuck::cast_slice(values) }
    }

    /// Shuffles, deflates and adds the checksum, as HDF5's filters of these names. `None` without values: a
    /// chunk of them is never read.
    pub fn pack(&self) -> Option<Chunk> {
        if self.bytes.is_empty() {
            return None;
        }
        let level = CompressionLvl::new(i32::from(DEFLATE_LEVEL)).expect("within 0 to 12");
        let mut compressor = Compressor::new(level);
        let shuffled = shuffled(self.bytes, self.size);
        let mut bytes = vec![0; compressor.zlib_compress_bound(shuffled.len())];
        let length =
            compressor.zlib_compress(&shuffled, &mut bytes).expect("room for the worst case");
        bytes.truncate(length);
        let sum = fletcher32(&bytes);
        bytes.extend(sum.to_le_bytes());
        Some(Chunk { dataset: self.dataset, frame: self.frame, bytes })
    }
}

impl Chunk {
    /// Writes it to its dataset, which must be long enough: HDF5 would not notice.
    pub fn write(&self, dataset: &Dataset) -> hdf5::Result<()> {
        let frames = dataset.shape().first().copied().unwrap_or(0);
        if self.frame >= frames {
            return Err(format!("frame {} of {frames}", self.frame).into());
        }
        let mut offset = vec![0; dataset.ndim()];
        offset[0] = self.frame as u64;
        let _lock = LOCK.lock();
        // SAFETY: HDF5 is locked, the dataset is open, there is an offset for each of its dimensions within
        // its shape, and the buffer has the stated size.
        h5check(unsafe {
            H5Dwrite_chunk(
                dataset.id(),
                H5P_DEFAULT,
                0,
                offset.as_ptr(),
                self.bytes.len(),
                self.bytes.as_ptr().cast(),
            )
        })?;
        Ok(())
    }
}

/// All first bytes of the numbers, then all second ones, and so on.
fn shuffled(bytes: &[u8], size: usize) -> Vec<u8> {
    let mut shuffled = vec![0; bytes.len()];
    for (place, group) in shuffled.chunks_exact_mut(bytes.len() / size).enumerate() {
        for (byte, number) in group.iter_mut().zip(bytes.chunks_exact(size)) {
            *byte = number[place];
        }
    }
    shuffled
}

/// Fletcher's checksum over big-endian words of 16 bits, the last one filled up with zero, from sums that
/// begin at zero (`H5_checksum_fletcher32`).
fn fletcher32(bytes: &[u8]) -> u32 {
    /// Words after which sums of 32 bits could overflow.
    const BLOCK: usize = 360;
    let fold = |sum: u32| (sum & 0xffff) + (sum >> 16);
    let (mut first, mut second) = (0_u32, 0_u32);
    for block in bytes.chunks(2 * BLOCK) {
        for word in block.chunks(2) {
            let low = word.get(1).copied().unwrap_or(0);
            first += u32::from(u16::from_be_bytes([word[0], low]));
            second += first;
        }
        (first, second) = (fold(first), fold(second));
    }
    fold(second) << 16 | fold(first)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::meaning;
    use super::super::storage::{create_growing, read_frame, set_frames};
    use super::*;

    #[test]
    fn shuffle_groups_bytes_of_equal_significance() {
        assert_eq!(shuffled(&[1, 2, 3, 4, 5, 6], 2), [1, 3, 5, 2, 4, 6]);
        assert_eq!(shuffled(&[1, 2, 3], 1), [1, 2, 3]);
    }

    /// Words 0x0102, 0x0304 and 0x0500: the sums are 0x0906, and 0x0102 + 0x0406 + 0x0906 = 0x0e0e.
    #[test]
    fn fletcher_sums_words_and_their_sums() {
        assert_eq!(fletcher32(&[1, 2, 3, 4, 5]), 0x0e0e_0906);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// HDF5 checks the sum, inflates and unshuffles what it reads. Few different values pack well, many
        /// grow when they are deflated.
        #[test]
        fn hdf5_reads_what_was_packed(
            values in proptest::collection::vec((0..40_u32, any::<f64>()), 1..2000),
            alike in any::<bool>(),
        ) {
            let values: Vec<[f64; 2]> = values
                .iter()
                .map(|&(few, any)| if alike { [few.into(), 1.0] } else { [any, f64::from(few)] })
                .collect();
            let folder = tempfile::tempdir().unwrap();
            let file = hdf5::File::create(folder.path().join("chunks.h5")).unwrap();
            let inner = [values.len(), 2];
            let dataset = create_growing::<f64>(&file, "position", &inner, meaning::TIME).unwrap();
            set_frames(&dataset, 3).unwrap();
            for frame in [0, 2] {
                Values::new("position", frame, values.as_flattened()).pack().unwrap().write(&dataset).unwrap();
            }
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            for (frame, expected) in [(0, values.clone()), (1, vec![[0.0; 2]; values.len()]), (2, values)] {
                let read = read_frame::<f64>(&dataset, frame).unwrap();
                prop_assert_eq!(bits(&read), bits(expected.as_flattened()));
            }
        }
    }

    #[test]
    fn a_frame_beyond_the_end_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = hdf5::File::create(folder.path().join("chunks.h5")).unwrap();
        let dataset = create_growing::<f32>(&file, "density", &[2], meaning::TIME).unwrap();
        set_frames(&dataset, 1).unwrap();
        let chunk = |frame| Values::new("density", frame, &[1.0_f32, 2.0]).pack().unwrap();
        assert!(chunk(0).write(&dataset).is_ok());
        assert!(chunk(1).write(&dataset).is_err());
        assert!(Values::new::<f32>("density", 0, &[]).pack().is_none());
    }
}
