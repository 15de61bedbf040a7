//! The terminal: a screen of its own, put back however the program ends.

use super::board::{Line, Mood};
use crossterm::cursor::{Hide, MoveTo, Show};
use crossterm::style::{Attribute, Print, SetAttribute};
use crossterm::terminal::{self, Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen};
use crossterm::{execute, queue};
use std::io::{self, Write as _};

/// Where no size is known.
const SIZE: (u16, u16) = (120, 40);

pub(super) struct Screen;

impl Screen {
    pub(super) fn open() -> io::Result<Self> {
        terminal::enable_raw_mode()?;
        let screen = Self;
        execute!(io::stdout(), EnterAlternateScreen, Hide)?;
        Ok(screen)
    }
    /// Draws lines from the top; what does not fit is left out, its last line excepted.
    pub(super) fn draw(&mut self, lines: &[Line]) -> io::Result<()> {
        let (width, height) = match terminal::size() {
            Ok((width, height)) if width > 0 && height > 0 => (width, height),
            _ => SIZE,
        };
        let mut out = io::stdout().lock();
        for (row, line) in (0..height).zip(lines) {
            let text: String = line
                .text
                .chars()
                .map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c })
                .take(width.into())
                .collect();
            let mood = match line.mood {
                Mood::Plain => Attribute::Reset,
                Mood::Head => Attribute::Bold,
                Mood::Chosen => Attribute::Reverse,
                Mood::Faint => Attribute::Dim,
            };
            queue!(out, MoveTo(0, row), SetAttribute(mood), Print(text), SetAttribute(Attribute::Reset))?;
            queue!(out, Clear(ClearType::UntilNewLine))?;
        }
        queue!(out, Clear(ClearType::FromCursorDown))?;
        out.flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A terminal that is gone needs nothing put back.
        drop(execute!(io::stdout(), Show, LeaveAlternateScreen));
        drop(terminal::disable_raw_mode());
    }
}
