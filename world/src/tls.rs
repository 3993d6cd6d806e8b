//! TLS for connections: rustls, with the certificates that the system trusts or those of a file; for
//! listeners, with one of their own.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use esl_vm::host::HostFailure;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, ServerConfig};
use tokio_rustls::{TlsAcceptor, TlsConnector};

use crate::data::failure;

fn tls_failure(reason: impl ToString) -> HostFailure {
    failure("TLS-ERROR", reason)
}

/// Returns what clients need that trust these certificates.
fn config_with(roots: RootCertStore) -> Result<Arc<ClientConfig>, String> {
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let builder = builder.with_safe_default_protocol_versions().map_err(|error| error.to_string())?;
    Ok(Arc::new(builder.with_root_certificates(roots).with_no_client_auth()))
}

/// Returns what clients need that trust what the system trusts. It is read once.
fn config_of_system() -> Result<Arc<ClientConfig>, String> {
    static CONFIG: OnceLock<Result<Arc<ClientConfig>, String>> = OnceLock::new();
    let make = || {
        let mut roots = RootCertStore::empty();
        let found = rustls_native_certs::load_native_certs();
        // Systems have some that are not well-formed; only none at all is a fault.
        if roots.add_parsable_certificates(found.certs).0 == 0 {
            return Err("the system has no certificates to trust; `:ca-file` names others".into());
        }
        config_with(roots)
    };
    CONFIG.get_or_init(make).clone()
}

/// Returns what clients need that trust the certificates of a file, in PEM.
fn config_of_file(path: &Path) -> Result<Arc<ClientConfig>, String> {
    let unread = |error: &dyn std::fmt::Display| format!("the certificates of `{}`: {error}", path.display());
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(path).map_err(|error| unread(&error))? {
        let certificate = certificate.map_err(|error| unread(&error))?;
        roots.add(certificate).map_err(|error| unread(&error))?;
    }
    if roots.is_empty() {
        return Err(unread(&"there are none"));
    }
    config_with(roots)
}

/// Returns what clients need that trust what the system trusts, or the certificates of a file.
pub(crate) async fn client_config(ca_file: Option<String>) -> Result<Arc<ClientConfig>, HostFailure> {
    let load = move || match ca_file {
        Some(path) => config_of_file(Path::new(&path)),
        None => config_of_system(),
    };
    tokio::task::spawn_blocking(load).await.map_err(tls_failure)?.map_err(tls_failure)
}

/// Reads what a listener needs that proves by the certificates of one file, in PEM, and the key of another,
/// who it is.
fn read_acceptor(certificate: &Path, key: &Path) -> Result<TlsAcceptor, String> {
    let unread = |path: &Path, error: &dyn std::fmt::Display| format!("`{}`: {error}", path.display());
    let chain = CertificateDer::pem_file_iter(certificate).map_err(|error| unread(certificate, &error))?;
    let chain = chain.collect::<Result<Vec<_>, _>>().map_err(|error| unread(certificate, &error))?;
    if chain.is_empty() {
        return Err(unread(certificate, &"there is no certificate in it"));
    }
    let private = PrivateKeyDer::from_pem_file(key).map_err(|error| match error {
        pem::Error::NoItemsFound => unread(key, &"there is no private key in it"),
        error => unread(key, &error),
    })?;
    let builder = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let builder = builder.with_safe_default_protocol_versions().map_err(|error| error.to_string())?;
    let config = builder.with_no_client_auth().with_single_cert(chain, private);
    Ok(TlsAcceptor::from(Arc::new(config.map_err(|error| unread(key, &error))?)))
}

/// Returns the same, read where nobody waits for it.
pub(crate) async fn acceptor(certificate: String, key: String) -> Result<TlsAcceptor, HostFailure> {
    let load = move || read_acceptor(Path::new(&certificate), Path::new(&key));
    tokio::task::spawn_blocking(load).await.map_err(tls_failure)?.map_err(tls_failure)
}

/// What servers of an embedder secure their connections with.
#[derive(Clone)]
pub struct TlsIdentity(TlsAcceptor);

impl TlsIdentity {
    /// Reads the certificates of one file and the key of another, in PEM.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn read(certificate: &Path, key: &Path) -> Result<TlsIdentity, String> {
        read_acceptor(certificate, key).map(TlsIdentity)
    }

    /// Begins TLS over a connection to a client.
    ///
    /// # Errors
    /// What the peer does wrong.
    pub async fn accept<S: AsyncRead + AsyncWrite + Unpin>(
        &self,
        stream: S,
    ) -> std::io::Result<tokio_rustls::server::TlsStream<S>> {
        self.0.accept(stream).await
    }
}

/// Begins TLS over a connection to the server of this name, which has to prove that it is that: by a
/// certificate that the system trusts, or by one of a file.
///
/// # Errors
/// Why it is not secure.
pub async fn begin_tls<S: AsyncRead + AsyncWrite + Unpin>(
    stream: S,
    name: &str,
    ca_file: Option<&Path>,
) -> Result<TlsStream<S>, String> {
    let config = ca_file.map_or_else(config_of_system, config_of_file)?;
    let name = ServerName::try_from(name.trim_matches(['[', ']']).to_owned());
    let name = name.map_err(|error| error.to_string())?;
    TlsConnector::from(config).connect(name, stream).await.map_err(|error| error.to_string())
}

/// Begins TLS over a connection to the server of this name, which has to prove that it is that.
pub(crate) async fn begin(
    stream: TcpStream,
    name: &str,
    ca_file: Option<String>,
) -> Result<TlsStream<TcpStream>, HostFailure> {
    let config = client_config(ca_file).await?;
    let name = name.trim_matches(['[', ']']).to_owned();
    let name = ServerName::try_from(name).map_err(tls_failure)?;
    TlsConnector::from(config).connect(name, stream).await.map_err(tls_failure)
}
