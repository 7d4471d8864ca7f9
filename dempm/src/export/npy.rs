//! The header of numpy's `.npy` format, version 1.0.

/// The header, padded with spaces so that the data begin at a multiple of 64 bytes. `description` is
/// the element type as numpy writes it, such as `<f8`.
pub(super) fn npy_header(description: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: String = shape.iter().map(|size| format!("{size},")).collect();
    let mut text =
        format!("{{'descr': '{description}', 'fortran_order': False, 'shape': ({sizes}), }}");
    // 6 bytes of magic, 2 of version, 2 of length, the text and its final newline.
    let unpadded = 10 + text.len() + 1;
    text.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // At most a few hundred bytes, whatever the shape.
    header.extend_from_slice(&(text.len() as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    #[test]
    fn headers_are_aligned() {
        let header = super::npy_header("<f8", &[301, 2304, 2]);
        assert_eq!(header.len() % 64, 0);
        assert!(header.ends_with(b" \n"));
    }
}
