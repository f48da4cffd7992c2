//! What a program says while it runs: whole lines, however many programs share the terminal.

use std::fmt::Arguments;
use std::io::Write;

/// Writes a line to standard error by one system call. `eprintln!` makes one for each piece of the text, so that what emulator
/// and controller say at once is mixed within a line. A terminal that is gone is no reason to end.
pub fn line(text: Arguments<'_>) {
    let _ = write_line(&mut std::io::stderr(), text);
}

/// [`line()`] of a format and its values, as `eprintln!` takes them.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::say::line(::std::format_args!($($text)*)) };
}

fn write_line(to: &mut impl Write, text: Arguments<'_>) -> std::io::Result<()> {
    to.write_all(format!("{text}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_one_write() {
        struct Writes(Vec<Vec<u8>>);
        impl Write for Writes {
            fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
                self.0.push(bytes.to_vec());
                Ok(bytes.len())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let mut writes = Writes(Vec::new());
        write_line(&mut writes, format_args!("{} frames, {} lost", 3, 0)).unwrap();
        assert_eq!(writes.0, [b"3 frames, 0 lost\n"]);
    }
}
