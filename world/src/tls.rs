//! TLS for connections: rustls, with the certificates that the system trusts or those of a file; for
//! listeners, with one of their own.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use esl_host::HostFailure;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, InvalidDnsNameError, PrivateKeyDer, ServerName};
use tokio_rustls::rustls::server::{VerifierBuilderError, WebPkiClientVerifier};
use tokio_rustls::rustls::{self, ClientConfig, RootCertStore, ServerConfig};
use tokio_rustls::{TlsAcceptor, TlsConnector};

fn tls_failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("TLS-ERROR", reason)
}

/// Reason why a connection could not be secured.
#[derive(Debug)]
#[non_exhaustive]
pub enum TlsError {
    /// The system has no certificates to trust.
    NothingTrusted,
    /// The certificates of this file, which are to be trusted, cannot be used.
    Trusted(PathBuf, PemFault),
    /// This file of the certificates or the key of one's own cannot be used.
    Own(PathBuf, PemFault),
    /// The server cannot have this name.
    Name(InvalidDnsNameError),
    /// TLS cannot be set up.
    Setup(rustls::Error),
    /// The peer does not prove its identity, or the connection ends.
    Connection(io::Error),
}

/// A fault of a file of certificates or keys in PEM.
#[derive(Debug)]
#[non_exhaustive]
pub enum PemFault {
    /// The file cannot be read, or is not PEM.
    Unreadable(pem::Error),
    /// The file has no certificate.
    NoCertificate,
    /// The file has no private key.
    NoKey,
    /// Its contents cannot be used, or do not belong together.
    Refused(rustls::Error),
}

impl fmt::Display for TlsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TlsError::NothingTrusted => {
                f.write_str("the system has no certificates to trust; `:ca-file` names others")
            }
            TlsError::Trusted(path, fault) => {
                write!(f, "the certificates of `{}`: {fault}", path.display())
            }
            TlsError::Own(path, fault) => write!(f, "`{}`: {fault}", path.display()),
            TlsError::Name(error) => error.fmt(f),
            TlsError::Setup(error) => error.fmt(f),
            TlsError::Connection(error) => error.fmt(f),
        }
    }
}

impl fmt::Display for PemFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PemFault::Unreadable(error) => error.fmt(f),
            PemFault::NoCertificate => f.write_str("there is no certificate in it"),
            PemFault::NoKey => f.write_str("there is no private key in it"),
            PemFault::Refused(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for TlsError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            TlsError::NothingTrusted => None,
            TlsError::Trusted(_, fault) | TlsError::Own(_, fault) => Some(fault),
            TlsError::Name(error) => Some(error),
            TlsError::Setup(error) => Some(error),
            TlsError::Connection(error) => Some(error),
        }
    }
}

impl std::error::Error for PemFault {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            PemFault::Unreadable(error) => Some(error),
            PemFault::NoCertificate | PemFault::NoKey => None,
            PemFault::Refused(error) => Some(error),
        }
    }
}

/// An identity of one's own: certificates, and the key that belongs to the first of them.
type OwnIdentity = (Vec<CertificateDer<'static>>, PrivateKeyDer<'static>);

/// Reads the certificates of one file, in PEM, and the key of another.
fn read_identity(certificate: &Path, key: &Path) -> Result<OwnIdentity, TlsError> {
    let chain = certificates(certificate).map_err(|fault| TlsError::Own(certificate.into(), fault))?;
    let wrong_key = |fault| TlsError::Own(key.into(), fault);
    let private = PrivateKeyDer::from_pem_file(key).map_err(|error| match error {
        pem::Error::NoItemsFound => wrong_key(PemFault::NoKey),
        error => wrong_key(PemFault::Unreadable(error)),
    })?;
    Ok((chain, private))
}

/// Returns what clients need that trust these certificates.
fn config_with(roots: RootCertStore) -> Result<Arc<ClientConfig>, TlsError> {
    Ok(Arc::new(builder_with(roots)?.with_no_client_auth()))
}

fn builder_with(
    roots: RootCertStore,
) -> Result<rustls::ConfigBuilder<ClientConfig, rustls::client::WantsClientCert>, TlsError> {
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let builder = builder.with_safe_default_protocol_versions().map_err(TlsError::Setup)?;
    Ok(builder.with_root_certificates(roots))
}

/// Returns what clients need that trust what the system trusts. It is read until it can be used.
fn config_of_system() -> Result<Arc<ClientConfig>, TlsError> {
    static CONFIG: OnceLock<Arc<ClientConfig>> = OnceLock::new();
    if let Some(config) = CONFIG.get() {
        return Ok(config.clone());
    }
    let config = config_with(roots_of_system()?)?;
    Ok(CONFIG.get_or_init(|| config).clone())
}

fn roots_of_system() -> Result<RootCertStore, TlsError> {
    let mut roots = RootCertStore::empty();
    let found = rustls_native_certs::load_native_certs();
    // Systems have some that are not well-formed; only none at all is a fault.
    match roots.add_parsable_certificates(found.certs).0 {
        0 => Err(TlsError::NothingTrusted),
        _ => Ok(roots),
    }
}

/// Reads certificates of a file, in PEM.
fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, PemFault> {
    let found = CertificateDer::pem_file_iter(path).map_err(PemFault::Unreadable)?;
    let found = found.collect::<Result<Vec<_>, _>>().map_err(PemFault::Unreadable)?;
    if found.is_empty() { Err(PemFault::NoCertificate) } else { Ok(found) }
}

/// Returns what clients need that trust the certificates of a file, in PEM.
fn config_of_file(path: &Path) -> Result<Arc<ClientConfig>, TlsError> {
    config_with(roots_of_file(path)?)
}

fn roots_of_file(path: &Path) -> Result<RootCertStore, TlsError> {
    let refused = |fault| TlsError::Trusted(path.into(), fault);
    let mut roots = RootCertStore::empty();
    for certificate in certificates(path).map_err(refused)? {
        roots.add(certificate).map_err(|error| refused(PemFault::Refused(error)))?;
    }
    Ok(roots)
}

/// Returns what clients need that have an identity of their own.
#[cfg(feature = "http")]
fn config_of_identity(
    ca_file: Option<&Path>,
    certificate: &Path,
    key: &Path,
) -> Result<Arc<ClientConfig>, TlsError> {
    let builder = builder_with(ca_file.map_or_else(roots_of_system, roots_of_file)?)?;
    let (chain, private) = read_identity(certificate, key)?;
    let config = builder.with_client_auth_cert(chain, private);
    Ok(Arc::new(config.map_err(|error| TlsError::Own(key.into(), PemFault::Refused(error)))?))
}

/// Returns what clients need that trust what the system trusts, or the certificates of a file.
pub(crate) async fn client_config(ca_file: Option<String>) -> Result<Arc<ClientConfig>, HostFailure> {
    let load = move || match ca_file {
        Some(path) => config_of_file(Path::new(&path)),
        None => config_of_system(),
    };
    tokio::task::spawn_blocking(load).await.map_err(tls_failure)?.map_err(tls_failure)
}

/// Reads the identity of a listener: the certificates in one file, in PEM, and the key in another. With a
/// file of `clients`, only clients are served that prove by these certificates who they are.
fn read_acceptor(certificate: &Path, key: &Path, clients: Option<&Path>) -> Result<TlsAcceptor, TlsError> {
    let (chain, private) = read_identity(certificate, key)?;
    let provider = Arc::new(ring::default_provider());
    let builder = ServerConfig::builder_with_provider(provider.clone());
    let builder = builder.with_safe_default_protocol_versions().map_err(TlsError::Setup)?;
    let builder = match clients {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let roots = Arc::new(roots_of_file(path)?);
            let verifier = WebPkiClientVerifier::builder_with_provider(roots, provider).build();
            let refused = |error: VerifierBuilderError| rustls::Error::General(error.to_string());
            let fault = |error| TlsError::Trusted(path.into(), PemFault::Refused(refused(error)));
            builder.with_client_cert_verifier(verifier.map_err(fault)?)
        }
    };
    let config = builder.with_single_cert(chain, private);
    let wrong_key = |error| TlsError::Own(key.into(), PemFault::Refused(error));
    Ok(TlsAcceptor::from(Arc::new(config.map_err(wrong_key)?)))
}

/// Returns the same, read in another thread.
pub(crate) async fn acceptor(
    certificate: String,
    key: String,
    clients: Option<String>,
) -> Result<TlsAcceptor, HostFailure> {
    let load =
        move || read_acceptor(Path::new(&certificate), Path::new(&key), clients.as_deref().map(Path::new));
    tokio::task::spawn_blocking(load).await.map_err(tls_failure)?.map_err(tls_failure)
}

/// The identity by which servers of an embedder secure their connections.
#[derive(Clone)]
pub struct TlsIdentity(TlsAcceptor);

impl TlsIdentity {
    /// Reads the certificates of one file and the key of another, in PEM.
    ///
    /// # Errors
    /// The fault in them.
    pub fn read(certificate: &Path, key: &Path) -> Result<TlsIdentity, TlsError> {
        read_acceptor(certificate, key, None).map(TlsIdentity)
    }

    /// Begins TLS over a connection to a client.
    ///
    /// # Errors
    /// The fault of the peer.
    pub async fn accept<S: AsyncRead + AsyncWrite + Unpin>(
        &self,
        stream: S,
    ) -> io::Result<tokio_rustls::server::TlsStream<S>> {
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
) -> Result<TlsStream<S>, TlsError> {
    connect(ca_file.map_or_else(config_of_system, config_of_file)?, stream, name).await
}

/// Begins TLS over a connection to the server of this name, by what its client needs.
async fn connect<S: AsyncRead + AsyncWrite + Unpin>(
    config: Arc<ClientConfig>,
    stream: S,
    name: &str,
) -> Result<TlsStream<S>, TlsError> {
    let name = ServerName::try_from(name.trim_matches(['[', ']']).to_owned()).map_err(TlsError::Name)?;
    TlsConnector::from(config).connect(name, stream).await.map_err(TlsError::Connection)
}

/// Begins TLS over a connection to the server of this name, which has to prove that it is that.
pub(crate) async fn begin(
    stream: TcpStream,
    name: &str,
    ca_file: Option<String>,
) -> Result<TlsStream<TcpStream>, HostFailure> {
    connect(client_config(ca_file).await?, stream, name).await.map_err(tls_failure)
}

/// As [`begin`], for a client that may have an identity of its own.
#[cfg(feature = "http")]
pub(crate) async fn begin_as(
    stream: TcpStream,
    name: &str,
    files: crate::tls_files::ClientFiles,
) -> Result<TlsStream<TcpStream>, HostFailure> {
    let Some((certificate, key)) = files.identity else { return begin(stream, name, files.trusted).await };
    let load = move || {
        config_of_identity(files.trusted.as_deref().map(Path::new), Path::new(&certificate), Path::new(&key))
    };
    let config = tokio::task::spawn_blocking(load).await.map_err(tls_failure)?.map_err(tls_failure)?;
    connect(config, stream, name).await.map_err(tls_failure)
}
