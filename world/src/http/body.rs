//! The body of a request, which is received whole.

use std::sync::Arc;
use std::time::Duration;

use http_body_util::BodyExt;
use hyper::StatusCode;
use hyper::body::{Body, Incoming};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Time in which more of a body has to come.
const BODY_TIME: Duration = Duration::from_secs(30);
/// Most bytes of the body of a request.
const BODY: u64 = 64 << 20;

type Received = (Vec<u8>, Vec<OwnedSemaphorePermit>);

/// Receives the body of a request, and the room that it takes.
pub(super) async fn receive(
    mut body: Incoming,
    room: &Arc<Semaphore>,
) -> Result<Received, (StatusCode, String)> {
    let too_long = || (StatusCode::PAYLOAD_TOO_LARGE, format!("a body has at most {BODY} bytes"));
    // The header `Content-Length` is the lower bound.
    if body.size_hint().lower() > BODY {
        return Err(too_long());
    }
    let (mut bytes, mut taken) = (Vec::new(), Vec::new());
    loop {
        let frame = match tokio::time::timeout(BODY_TIME, body.frame()).await {
            Ok(None) => return Ok((bytes, taken)),
            Ok(Some(Ok(frame))) => frame,
            Ok(Some(Err(error))) => {
                return Err((StatusCode::BAD_REQUEST, format!("the body is invalid: {}", innermost(&error))));
            }
            Err(_) => return Err((StatusCode::REQUEST_TIMEOUT, "the body has not arrived in time".into())),
        };
        // Trailers are not for the program.
        let Ok(data) = frame.into_data() else { continue };
        if (bytes.len() + data.len()) as u64 > BODY {
            return Err(too_long());
        }
        bytes.extend_from_slice(&data);
        let wanted = bytes
            .len()
            .div_ceil(1024)
            .saturating_sub(taken.iter().map(OwnedSemaphorePermit::num_permits).sum());
        if wanted > 0 {
            let permit = room.clone().try_acquire_many_owned(u32::try_from(wanted).unwrap_or(u32::MAX));
            taken.push(permit.map_err(|_| {
                (StatusCode::SERVICE_UNAVAILABLE, "there is no room for the body at this time".to_owned())
            })?);
        }
    }
}

/// Returns the text of the innermost cause of an error.
fn innermost(error: &hyper::Error) -> String {
    let mut reason: &dyn std::error::Error = error;
    while let Some(source) = reason.source() {
        reason = source;
    }
    reason.to_string()
}
