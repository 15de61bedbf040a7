//! Lines of text out of bytes that come in pieces, with a bound.

use crate::board::Fault;

/// Gathers the bytes of a line until its end.
#[derive(Clone, Debug)]
pub struct Lines {
    end: u8,
    most: usize,
    text: String,
    /// Why what has come of this line cannot be a line any more.
    spoilt: Option<Fault>,
}

impl Lines {
    /// Lines that end with `end` and have at most `most` letters before it.
    #[must_use]
    pub const fn new(end: u8, most: usize) -> Self {
        Self { end, most, text: String::new(), spoilt: None }
    }
    /// Forgets what has come of a line.
    pub fn clear(&mut self) {
        self.text.clear();
        self.spoilt = None;
    }
    /// Takes a byte. At the end of a line it gives the line, or what is wrong with it; carriage returns and line feeds
    /// that are not the end are no letters.
    ///
    /// # Errors
    /// A line that was too long, or had bytes that are no ASCII text.
    pub fn push(&mut self, byte: u8) -> Option<Result<String, Fault>> {
        if byte == self.end {
            let text = std::mem::take(&mut self.text);
            return Some(self.spoilt.take().map_or(Ok(text), Err));
        }
        match byte {
            b'\r' | b'\n' => {}
            b' '..=b'~' | b'\t' if self.text.len() < self.most => self.text.push(char::from(byte)),
            b' '..=b'~' | b'\t' => self.spoil(Fault::Overlong),
            _ => self.spoil(Fault::Garbage),
        }
        None
    }
    fn spoil(&mut self, fault: Fault) {
        self.text.clear();
        self.spoilt.get_or_insert(fault);
    }
    /// How many letters wait for the end of their line.
    #[must_use]
    pub const fn waiting(&self) -> usize {
        self.text.len()
    }
}

/// The first letters of a line, for people.
pub(crate) fn excerpt(line: &str) -> String {
    line.chars().take(24).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &mut Lines, bytes: &[u8]) -> Vec<Result<String, Fault>> {
        bytes.iter().filter_map(|byte| lines.push(*byte)).collect()
    }

    #[test]
    fn lines_come_out_whole_whatever_pieces_they_come_in() {
        let mut lines = Lines::new(b'\n', 8);
        assert_eq!(read(&mut lines, b"ab\r\nc"), [Ok("ab".to_owned())]);
        assert_eq!(read(&mut lines, b"d\n\n"), [Ok("cd".to_owned()), Ok(String::new())]);
    }

    #[test]
    fn what_is_too_long_or_no_text_spoils_its_line_only() {
        let mut lines = Lines::new(b'\r', 8);
        assert_eq!(read(&mut lines, b"123456789abc\rok\r"), [Err(Fault::Overlong), Ok("ok".to_owned())]);
        assert_eq!(read(&mut lines, b"a\xffb\rok\r"), [Err(Fault::Garbage), Ok("ok".to_owned())]);
        assert_eq!(read(&mut lines, &[b'x'; 10_000]), []);
        assert!(lines.waiting() <= 8);
    }
}
