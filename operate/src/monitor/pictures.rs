//! The pictures that a program has defined. All viewers share them, so that many take no more of the run's
//! time than one does.

use std::pin::Pin;
use std::time::{Duration, Instant};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{Answer, FunctionRef, Question, Sender};
use serde_json::{Value, json};
use tokio::sync::Mutex;

use crate::attach::datum::integer;

/// Time for which pictures are shown.
const PERIOD: Duration = Duration::from_secs(1);
/// Time in which the program answers.
const PATIENCE: Duration = Duration::from_secs(1);
/// Ticks that a picture may take.
const TICKS: i64 = 5_000_000;
/// Most bytes of all pictures.
const BYTES: usize = 4 << 20;

/// The latest pictures, and when they were asked for.
#[derive(Default)]
struct LatestPictures {
    then: Option<Instant>,
    value: Value,
    /// A question without an answer. There is one at a time, however slow the program is.
    asked: Option<Pin<Box<dyn Future<Output = Answer> + Send>>>,
}

/// The pictures for all viewers.
#[derive(Default)]
pub(super) struct PictureBook(Mutex<LatestPictures>);

impl PictureBook {
    /// Returns the pictures: objects with a name, and the texts in SVG or the report of a failure. Null if
    /// the program has not answered in time.
    pub(super) async fn latest(&self, sender: &Sender) -> Value {
        let mut latest = self.0.lock().await;
        if latest.then.is_none_or(|then| then.elapsed() >= PERIOD) {
            let mut asked = latest.asked.take().unwrap_or_else(|| {
                let function = FunctionRef::Named("ESL::%SESSION-PICTURES".into());
                let arguments = vec![integer(TICKS)];
                Box::pin(sender.ask(Question::Call { function, arguments, goes_first: false }))
            });
            latest.value = match tokio::time::timeout(PATIENCE, &mut asked).await {
                Ok(Answer::Values(values)) => values.first().map_or(Value::Null, pictures),
                Ok(_) => Value::Null,
                Err(_) => {
                    latest.asked = Some(asked);
                    Value::Null
                }
            };
            latest.then = Some(Instant::now());
        }
        latest.value.clone()
    }
}

/// Returns the pictures in a list of the library's, as far as there is room.
fn pictures(list: &Datum) -> Value {
    let mut left = BYTES;
    let mut texts = |items: &[&Datum]| -> Vec<String> {
        let fits = |text: &String| {
            let fits = text.len() <= left;
            left = left.saturating_sub(text.len());
            fits
        };
        items.iter().copied().filter_map(text).filter(fits).collect()
    };
    let rows = list.as_list().unwrap_or_default();
    rows.iter()
        .filter_map(|row| {
            let row = row.as_list()?;
            let (name, rest) = row.split_first()?;
            let failure = rest.first().and_then(|first| first.as_list()).and_then(|list| text(list.first()?));
            Some(json!({ "name": text(name)?, "texts": texts(rest), "failure": failure }))
        })
        .collect()
}

fn text(datum: &Datum) -> Option<String> {
    match datum.kind() {
        DatumKind::String(text) => Some(text.to_string()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attach::datum::{list, string};

    #[test]
    fn pictures_and_failures_are_told_apart() {
        let rows = list([
            list([string("map"), string("<svg/>"), string("<svg></svg>")]),
            list([string("plan"), list([string("No plan.")])]),
            list([string("none")]),
            integer(3),
        ]);
        let expected = json!([
            { "name": "map", "texts": ["<svg/>", "<svg></svg>"], "failure": null },
            { "name": "plan", "texts": [], "failure": "No plan." },
            { "name": "none", "texts": [], "failure": null },
        ]);
        assert_eq!(pictures(&rows), expected);
    }

    #[test]
    fn pictures_beyond_the_limit_are_left_out() {
        let large = "x".repeat(BYTES - 1);
        let rows = list([list([string("map"), string(&large), string("yy"), string("")])]);
        assert_eq!(pictures(&rows)[0]["texts"], json!([large, ""]));
    }
}
