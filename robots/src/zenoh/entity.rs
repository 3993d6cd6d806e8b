//! Entities that a program declares in a session: subscriptions, servers of queries, signs of life and
//! watches of them.

use std::sync::{Arc, Mutex, PoisonError};

use esl_host::{HostFailure, HostInput, HostObject, IntoDatum, Keyword};
use zenoh::Wait;
use zenoh::sample::{Sample, SampleKind};

use super::delivery::InputDelivery;
use super::payload::{PayloadForm, datum_of_attachment, datum_of_payload};
use super::query::QueryHandles;
use super::runtime::in_background;
use super::session::OpenSession;

/// Something that a program has declared.
pub(crate) struct DeclaredEntity {
    declared: Mutex<Option<Box<dyn Send>>>,
    delivery: Option<Arc<InputDelivery>>,
}

impl HostObject for DeclaredEntity {
    const KIND: &'static str = "ZENOH-ENTITY";
}

impl DeclaredEntity {
    /// Returns what was declared, whose arrivals are delivered by `delivery`.
    pub(crate) fn new(declared: impl Send + 'static, delivery: Option<Arc<InputDelivery>>) -> DeclaredEntity {
        DeclaredEntity { declared: Mutex::new(Some(Box::new(declared))), delivery }
    }

    /// Returns how many arrivals were dropped.
    pub(crate) fn lost(&self) -> u64 {
        self.delivery.as_ref().map_or(0, |delivery| delivery.lost())
    }

    /// Ends it.
    pub(crate) fn end(&self) {
        if let Some(delivery) = &self.delivery {
            delivery.end();
        }
        let declared = self.declared.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(declared) = declared {
            // The network is told, which may take its time.
            in_background(async move { drop(declared) });
        }
    }
}

impl Drop for DeclaredEntity {
    fn drop(&mut self) {
        self.end();
    }
}

/// Returns the keyword for a kind of sample.
fn kind(sample: &Sample) -> Keyword {
    match sample.kind() {
        SampleKind::Put => Keyword("PUT"),
        SampleKind::Delete => Keyword("DELETE"),
    }
}

/// Signals an input with key, payload, attachment, encoding and kind of what is put under keys.
pub(crate) async fn subscribe(
    session: &OpenSession,
    input: HostInput,
    key: String,
    form: PayloadForm,
) -> Result<DeclaredEntity, HostFailure> {
    let delivery = InputDelivery::begin(input)?;
    let delivering = delivery.clone();
    let deliver = move |sample: Sample| {
        delivering.put(sample.payload().len(), || {
            let payload = datum_of_payload(sample.payload(), sample.encoding(), form);
            vec![
                sample.key_expr().as_str().into_datum(),
                payload,
                datum_of_attachment(sample.attachment()),
                sample.encoding().to_string().into_datum(),
                kind(&sample).into_datum(),
            ]
        });
    };
    let declare = move |session: &zenoh::Session| session.declare_subscriber(key).callback(deliver).wait();
    let subscriber = session.call(declare).await?;
    Ok(DeclaredEntity::new(subscriber, Some(delivery)))
}

/// Signals an input with the queries for keys: of each its handle, the key, the parameters, payload,
/// attachment and encoding.
pub(crate) async fn serve(
    session: &OpenSession,
    input: HostInput,
    key: String,
    form: PayloadForm,
) -> Result<DeclaredEntity, HostFailure> {
    let delivery = InputDelivery::begin(input)?;
    let delivering = delivery.clone();
    let handles = QueryHandles::new(session.requests().clone());
    let deliver = move |query: zenoh::query::Query| {
        let bytes = query.payload().map_or(0, |payload| payload.len());
        delivering.put(bytes, || {
            let encoding = query.encoding().cloned().unwrap_or_default();
            let payload = query.payload().map(|payload| datum_of_payload(payload, &encoding, form));
            let mut values = vec![
                query.key_expr().as_str().into_datum(),
                query.parameters().as_str().into_datum(),
                payload.into_datum(),
                datum_of_attachment(query.attachment()),
                encoding.to_string().into_datum(),
            ];
            values.insert(0, handles.add(query).into_datum());
            values
        });
    };
    let declare = move |session: &zenoh::Session| {
        session.declare_queryable(key).complete(true).callback(deliver).wait()
    };
    let queryable = session.call(declare).await?;
    Ok(DeclaredEntity::new(queryable, Some(delivery)))
}

/// Declares a sign of life, which others see as long as it and the session last.
pub(crate) async fn declare_alive(session: &OpenSession, key: String) -> Result<DeclaredEntity, HostFailure> {
    let token = session.call(move |session| session.liveliness().declare_token(key).wait()).await?;
    Ok(DeclaredEntity::new(token, None))
}

/// Signals an input with `:PUT` and the key when a sign of life comes, `:DELETE` and the key when it goes.
/// Those that are there come first.
pub(crate) async fn watch_alive(
    session: &OpenSession,
    input: HostInput,
    key: String,
) -> Result<DeclaredEntity, HostFailure> {
    let delivery = InputDelivery::begin(input)?;
    // Signs that an earlier declaration has seen may be gone.
    delivery.put(0, || vec![Keyword("BEGIN").into_datum()]);
    let delivering = delivery.clone();
    let deliver = move |sample: Sample| {
        let arguments = || vec![kind(&sample).into_datum(), sample.key_expr().as_str().into_datum()];
        delivering.put(sample.key_expr().as_str().len(), arguments);
    };
    let declare = move |session: &zenoh::Session| {
        session.liveliness().declare_subscriber(key).history(true).callback(deliver).wait()
    };
    let subscriber = session.call(declare).await?;
    Ok(DeclaredEntity::new(subscriber, Some(delivery)))
}
