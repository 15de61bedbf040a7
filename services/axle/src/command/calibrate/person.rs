//! The person with a ruler: asked for where the robot stands, over standard input, while the robot stands.

use crate::command::go::Bar;
use crate::out::usage;
use anyhow::Context as _;
use axle_calibrator::{Procedure, Question};
use axle_schema::{Metres, Refusal};
use std::io::{BufRead as _, Read as _};
use tokio::sync::mpsc::error::TryRecvError;
use tokio::sync::mpsc::{Receiver, channel};

/// Letters of an answer.
const LONGEST: u64 = 200;
/// Answers that may wait for their questions.
const WAITING: usize = 16;

/// Asks, and hears answers.
pub(super) struct Person {
    lines: Receiver<String>,
    asked: Option<Question>,
}

impl Person {
    /// Begins to read standard input, on a thread of its own that nobody waits for.
    pub(super) fn new() -> anyhow::Result<Self> {
        let (told, lines) = channel(WAITING);
        let read = move || {
            let mut stdin = std::io::stdin().lock();
            loop {
                let mut line = String::new();
                let count = stdin.by_ref().take(LONGEST).read_line(&mut line);
                if count.is_ok_and(|count| count > 0) && told.blocking_send(line).is_ok() {
                    continue;
                }
                return;
            }
        };
        std::thread::Builder::new().name("answers".into()).spawn(read).context("listen to answers")?;
        Ok(Self { lines, asked: None })
    }

    /// Asks what is to be asked, once, and gives the procedure what was answered.
    pub(super) fn attend(&mut self, procedure: &mut Procedure, bar: &Bar) -> anyhow::Result<()> {
        let question = procedure.question();
        if question != self.asked {
            self.asked = question;
            if let Some(question) = question {
                bar.say(&words(question));
            }
        }
        let Some(question) = question else { return Ok(()) };
        match self.lines.try_recv() {
            Ok(line) => {
                let answered = read(question, &line).and_then(|(ahead, left)| procedure.answer(ahead, left));
                if let Err(refusal) = answered {
                    bar.say(&format!("{refusal}; once more:"));
                }
                Ok(())
            }
            Err(TryRecvError::Empty) => Ok(()),
            Err(TryRecvError::Disconnected) => Err(usage(
                "--by-hand asks questions, and standard input has ended: answer them in a terminal",
            )),
        }
    }
}

fn words(question: Question) -> String {
    let side = |left: bool| if left { "left" } else { "right" };
    match question {
        Question::Mark { left } => format!(
            "Next is a square to the {}. Put the robot into the middle of its room, looking along its length, and mark where \
             it stands and where its nose points. Then press Enter.",
            side(left)
        ),
        Question::End { left } => format!(
            "The square to the {} is over. How far is the robot from its mark? Two numbers in millimetres, ahead and to the \
             left as it looked at first; behind and to the right are negative:",
            side(left)
        ),
    }
}

/// Reads two numbers in millimetres; before a square any line will do.
fn read(question: Question, line: &str) -> Result<(Metres, Metres), Refusal> {
    if matches!(question, Question::Mark { .. }) {
        return Ok((Metres::ZERO, Metres::ZERO));
    }
    let wrong = || Refusal::malformed("the answer", "write two numbers in millimetres, such as 12 -5");
    let numbers: Vec<f64> = line
        .split([' ', '\t', ',', ';'])
        .map(str::trim)
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()))
        .collect::<Option<_>>()
        .ok_or_else(wrong)?;
    let [ahead, left] = numbers[..] else { return Err(wrong()) };
    Ok((Metres(ahead / 1000.0), Metres(left / 1000.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_two_numbers_in_millimetres() {
        let end = Question::End { left: true };
        for line in ["12 -5", " 12.0 ,-5\n", "12;\t-5"] {
            assert_eq!(read(end, line), Ok((Metres(0.012), Metres(-0.005))), "{line:?}");
        }
        for line in ["", "12", "12 -5 3", "12 mm", "nan 1", "1e999 0"] {
            assert!(read(end, line).expect_err(line).to_string().contains("12 -5"), "{line:?}");
        }
        assert!(read(Question::Mark { left: true }, "\n").is_ok());
    }
}
