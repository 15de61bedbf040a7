//! A functional service, replayed: the same questions, the same answers.

use super::{Log, Report, params};
use crate::run::functional::Served;
use axle_schema::codec::{Message, encode};
use axle_schema::trace::Answered;
use std::path::Path;

/// Asks a functional service everything again that it was asked.
///
/// # Errors
/// Never; what cannot be judged is in the report.
pub(crate) fn functional<F: Served>(
    log: &Log,
    _: &'static str,
    against: Option<&Path>,
) -> anyhow::Result<Report>
where
    Answered<F::Ask, F::Answer>: Message,
{
    let mut report = Report::default();
    let stream = F::ANSWERED.port().to_string();
    for item in log.stream(&stream) {
        let answered: Answered<F::Ask, F::Answer> = match item.read() {
            Ok(answered) => answered,
            Err(refusal) => {
                report.skip(format!("a question cannot be read: {refusal}"));
                continue;
            }
        };
        let params: F::Params = match params(&answered.setting, against) {
            Ok(params) => params,
            Err(why) => {
                report.skip(why);
                continue;
            }
        };
        let time = log.seconds(item.received);
        match (F::answer(&params, &answered.ask), &answered.answer, &answered.refusal) {
            (Ok(now), Some(recorded), _) => match encode(recorded) {
                Ok(bytes) => report.compare(time, &stream, &bytes, &now),
                Err(refusal) => report.skip(format!("a recorded answer is none: {refusal}")),
            },
            (Err(now), None, Some(recorded)) => {
                report.compare_words(time, &stream, &recorded.to_string(), &now.to_string());
            }
            (Ok(_), None, Some(recorded)) => {
                report.compare_words(time, &stream, &recorded.to_string(), "an answer");
            }
            (Err(now), Some(_), _) => report.compare_words(time, &stream, "an answer", &now.to_string()),
            (_, None, None) => report.skip("a question was recorded without its answer"),
        }
    }
    Ok(report)
}
