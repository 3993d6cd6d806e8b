//! Bytes as a connection of a session: a secret, and requests.

use std::task::{Context, Poll, Waker};

use super::datum::{codes_of, form_of};
use super::form::WireForm;
use super::packet::{LARGEST, read_async};
use super::session::OperatorSession;
use super::{SECRET, Secrets};
use crate::slime;

/// Takes bytes as those that come over a connection: a secret, and requests, of which none is done. Returns
/// the number of those that were understood.
pub(crate) fn understand(secrets: &Secrets, bytes: &[u8]) -> usize {
    let mut rest = bytes;
    let Some(said) = taken(&mut rest, SECRET) else { return 0 };
    let form = WireForm::parse(&said).ok();
    let text = form.as_ref().and_then(WireForm::as_text).unwrap_or(said.trim_end());
    let mut understood = usize::from(secrets.role_of(text.as_bytes()).is_some());
    while let Some(text) = taken(&mut rest, LARGEST) {
        let Ok(request) = WireForm::parse(&text) else { continue };
        assert_eq!(
            WireForm::parse(&request.to_string()).as_ref(),
            Ok(&request),
            "a written form is read back"
        );
        let items = request.items().unwrap_or_default();
        let form = items.get(1).and_then(WireForm::items).unwrap_or_default();
        let name = form.first().and_then(WireForm::name).unwrap_or_default();
        let arguments = form.get(1..).unwrap_or_default();
        let is_known = OperatorSession::role_for(&name).is_some();
        understood +=
            usize::from(is_known && slime::step(&name, arguments).is_none_or(|step| step.1.is_ok()));
        for data in arguments.iter().filter_map(WireForm::as_text).filter_map(|text| codes_of(text).ok()) {
            drop(form_of(&data));
        }
    }
    understood
}

/// Takes a packet of at most `most` bytes off the bytes that have come over a connection, as [`read_async`]
/// does; `None` if they hold none.
fn taken(bytes: &mut &[u8], most: usize) -> Option<String> {
    let packet = std::pin::pin!(read_async(bytes, most));
    match packet.poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(packet) => packet.ok(),
        // All bytes are there, so it waits for nothing.
        Poll::Pending => None,
    }
}
