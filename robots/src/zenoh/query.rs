//! Queries: those of the program, and those of others that it answers.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use esl_bytecode::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostHandle, HostObject, IntoDatum, Keyword};
use tokio::sync::oneshot;
use zenoh::Wait;
use zenoh::cancellation::CancellationToken;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Reply};

use super::payload::{PayloadForm, datum_of_attachment, datum_of_payload};
use super::runtime::in_background;
use super::session::{OpenSession, Requests, short};
use super::zenoh_failure;

/// Most bytes of the replies to a query.
const MOST_BYTES: usize = 256 << 20;
/// Most replies to a query.
const MOST_REPLIES: usize = 100_000;
/// Time for which a query without a limit waits.
const LONGEST: Duration = Duration::from_secs(10 * 365 * 86_400);

/// A query of another session, which the program answers. Without an answer it ends when it is dropped.
pub(crate) struct PendingQuery {
    query: Mutex<Option<Query>>,
    requests: Requests,
}

impl HostObject for PendingQuery {
    const KIND: &'static str = "ZENOH-QUERY";
}

impl PendingQuery {
    fn get(&self) -> Result<Query, HostFailure> {
        let query = self.query.lock().unwrap_or_else(PoisonError::into_inner).clone();
        query.ok_or_else(|| zenoh_failure("the query is answered already"))
    }

    /// Sends a reply, under `key`, or under that of the query.
    pub(crate) async fn reply(
        &self,
        key: Option<String>,
        payload: Bytes,
        encoding: Option<String>,
        attachment: Option<Bytes>,
    ) -> Result<(), HostFailure> {
        let query = self.get()?;
        let send = move || {
            let key = key.unwrap_or_else(|| query.key_expr().as_str().to_owned());
            let reply = query.reply(key, payload).encoding(encoding.unwrap_or_default());
            reply.attachment(attachment).wait()
        };
        self.requests.call(send).await?.map_err(zenoh_failure)
    }

    /// Sends an error.
    pub(crate) async fn reply_error(&self, text: String) -> Result<(), HostFailure> {
        let query = self.get()?;
        let send = move || query.reply_err(text).encoding("zenoh/string").wait();
        self.requests.call(send).await?.map_err(zenoh_failure)
    }

    /// Has the query have no further replies.
    pub(crate) fn finish(&self) {
        let query = self.query.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(query) = query {
            // Behind the replies.
            self.requests.try_put(move || drop(query));
        }
    }
}

impl Drop for PendingQuery {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Makes the handles of queries that arrive, with numbers in the order of their arrival.
pub(crate) struct QueryHandles {
    made: AtomicI64,
    requests: Requests,
}

impl QueryHandles {
    pub(crate) fn new(requests: Requests) -> QueryHandles {
        QueryHandles { made: AtomicI64::new(0), requests }
    }

    pub(crate) fn add(&self, query: Query) -> HostHandle<PendingQuery> {
        let number = self.made.fetch_add(1, Ordering::Relaxed) + 1;
        let query = Mutex::new(Some(query));
        HostHandle::new(number, PendingQuery { query, requests: self.requests.clone() })
    }
}

impl QueryHandles {
    /// Replies an error to a query that the program does not see.
    pub(crate) fn refuse(&self, query: Query, text: String) {
        self.requests.try_put(move || _ = query.reply_err(text).encoding("zenoh/string").wait());
    }
}

/// A query of the program's, whose replies are gathered until there are no more.
pub(crate) struct QueryRequest {
    pub(crate) selector: String,
    pub(crate) payload: Option<Bytes>,
    pub(crate) encoding: Option<String>,
    pub(crate) attachment: Option<Bytes>,
    /// Time after which no further replies are waited for.
    pub(crate) timeout: Option<Duration>,
    /// Whether each reply counts, and not only the newest one for a key.
    pub(crate) is_call: bool,
    /// Whether only those are asked that answer for all keys.
    pub(crate) asks_complete: bool,
}

#[derive(Default)]
struct Gathered {
    replies: Vec<Reply>,
    bytes: usize,
}

/// Says by its end that there are no further replies.
struct End(Option<oneshot::Sender<()>>);

impl Drop for End {
    fn drop(&mut self) {
        if let Some(end) = self.0.take() {
            // The call may have been left.
            _ = end.send(());
        }
    }
}

/// Ends a query if it is left.
struct QueryInFlight(CancellationToken);

impl Drop for QueryInFlight {
    fn drop(&mut self) {
        let token = self.0.clone();
        in_background(async move { _ = token.cancel().await });
    }
}

/// Sends a query, and returns the replies when there are no more.
///
/// # Errors
/// `:zenoh-error`, if the selector is invalid, or the replies are too many.
pub(crate) async fn get(session: &OpenSession, request: QueryRequest) -> Result<Vec<Reply>, HostFailure> {
    let gathered = Arc::<Mutex<Gathered>>::default();
    let (end, ended) = oneshot::channel();
    let end = End(Some(end));
    let gathering = gathered.clone();
    let gather = move |reply: Reply| {
        let _ = &end;
        let mut gathered = gathering.lock().unwrap_or_else(PoisonError::into_inner);
        gathered.bytes += match reply.result() {
            Ok(sample) => sample.payload().len(),
            Err(error) => error.payload().len(),
        };
        if gathered.bytes <= MOST_BYTES && gathered.replies.len() <= MOST_REPLIES {
            gathered.replies.push(reply);
        }
    };
    let token = CancellationToken::default();
    let leaving = QueryInFlight(token.clone());
    let ask = move |session: &zenoh::Session| {
        let target = if request.asks_complete { QueryTarget::AllComplete } else { QueryTarget::All };
        let mut builder =
            session.get(request.selector).timeout(request.timeout.unwrap_or(LONGEST)).target(target);
        if request.is_call {
            builder = builder.consolidation(ConsolidationMode::None);
        }
        if let Some(payload) = request.payload {
            builder = builder.payload(payload).encoding(request.encoding.unwrap_or_default());
        }
        builder.attachment(request.attachment).cancellation_token(token).callback(gather).wait()
    };
    session.call(ask).await?;
    // It comes also when the session is closed.
    _ = ended.await;
    drop(leaving);
    let gathered = std::mem::take(&mut *gathered.lock().unwrap_or_else(PoisonError::into_inner));
    if gathered.bytes > MOST_BYTES || gathered.replies.len() > MOST_REPLIES {
        return Err(zenoh_failure(format!(
            "the replies are too many: at most {MOST_REPLIES} with {MOST_BYTES} bytes are taken"
        )));
    }
    Ok(gathered.replies)
}

/// Returns a reply as data: a property list. Errors that say that the time is over are none.
pub(crate) fn datum_of_reply(reply: &Reply, form: PayloadForm) -> Option<Datum> {
    let keyword = |name| Keyword(name).into_datum();
    Some(match reply.result() {
        Ok(sample) => vec![
            keyword("KEY"),
            sample.key_expr().as_str().into_datum(),
            keyword("PAYLOAD"),
            datum_of_payload(sample.payload(), sample.encoding(), form),
            keyword("ATTACHMENT"),
            datum_of_attachment(sample.attachment()),
            keyword("ENCODING"),
            sample.encoding().to_string().into_datum(),
        ],
        Err(error) => {
            let text = error_text(error);
            if text == "Timeout" {
                return None;
            }
            vec![keyword("ERROR"), text.into_datum()]
        }
    })
    .map(|items| items.into_datum())
}

/// Returns the text of an error in a reply.
pub(crate) fn error_text(error: &zenoh::query::ReplyError) -> String {
    short(&String::from_utf8_lossy(&error.payload().to_bytes()))
}
