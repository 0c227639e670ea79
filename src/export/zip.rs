//! Writes zip archives without compression (PKWARE's APPNOTE 6.3). Entries are dated 1980, so that
//! the same files yield the same bytes.

use super::File;

/// Returns a zip archive of files, without compression. Each file has a local header followed by
/// its contents. The central directory and its end record come last.
pub fn zip(files: &[File]) -> Vec<u8> {
    let (mut archive, mut directory) = (Vec::new(), Vec::new());
    for File { name, bytes: content } in files {
        let size = length(content.len());
        let offset = length(archive.len());
        // The fields are: version 2.0, UTF-8 names, "stored", and midnight of 1 January 1980.
        let mut header: Vec<u8> = [20_u16, 1 << 11, 0, 0, 33].map(u16::to_le_bytes).concat();
        header.extend([crc32fast::hash(content), size, size].map(u32::to_le_bytes).concat());
        // The last fields are the lengths of the name and of the extra field, which is empty.
        let name_length = u16::try_from(name.len()).expect("a short name");
        header.extend([name_length, 0].map(u16::to_le_bytes).concat());
        archive.extend(b"PK\x03\x04");
        archive.extend(&header);
        archive.extend(name.as_bytes());
        archive.extend(content);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&header);
        // There is no comment, the disk is the first one, and there are no attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (n, offset) = (u16::try_from(files.len()).expect("a few files"), length(archive.len()));
    let end = [n, n].map(u16::to_le_bytes).concat();
    let sizes = [length(directory.len()), offset].map(u32::to_le_bytes).concat();
    archive.extend([directory, b"PK\x05\x06\0\0\0\0".to_vec(), end, sizes, vec![0; 2]].concat());
    archive
}

/// Returns a length in the form in which the archive stores it.
fn length(n: usize) -> u32 {
    u32::try_from(n).expect("an archive below 4 GiB")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_archive_names_its_files_twice() {
        let bytes = zip(&[File::new("a.csv", "123456789".into())]);
        assert_eq!(bytes.len(), 30 + 5 + 9 + 46 + 5 + 22);
        assert_eq!(&bytes[14..18], &0xCBF4_3926_u32.to_le_bytes(), "the check value of CRC-32");
        assert_eq!(&bytes[bytes.len() - 6..bytes.len() - 2], &44_u32.to_le_bytes());
    }
}
