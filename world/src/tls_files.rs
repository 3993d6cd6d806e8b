//! Files by which connections are secured, as programs name them.

use esl_host::{ArgumentReader, FromCall, HostFailure};

/// Files of a client, arguments `ca-file`, `certificate` and `key`: certificates to trust, in place of those
/// of the system, and an identity, for a server that asks for one.
#[derive(Clone, Debug, Default)]
#[cfg_attr(not(feature = "tls"), allow(dead_code, reason = "connections are refused"))]
pub(crate) struct ClientFiles {
    pub(crate) trusted: Option<String>,
    pub(crate) identity: Option<(String, String)>,
}

impl FromCall for ClientFiles {
    const COUNT: usize = 3;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<ClientFiles, HostFailure> {
        let trusted = Option::from_call(call)?;
        let certificate: Option<String> = Option::from_call(call)?;
        let key = Option::from_call(call)?;
        Ok(ClientFiles { trusted, identity: certificate.zip(key) })
    }
}
