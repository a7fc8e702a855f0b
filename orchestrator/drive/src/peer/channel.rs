//! How a connection is opened, and with which certificates.

use super::{SETUP, SideError};
use experiment::Tls;
use proto::bounds::CERTIFICATE_BYTES;
use proto_host::{CONNECTION_WINDOW_BYTES, HEADER_LIST_BYTES, STREAM_WINDOW_BYTES};
use std::fs::File;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};

/// Connects to a side.
///
/// # Errors
///
/// It cannot be reached, or a certificate cannot be read.
pub(super) async fn channel(
    side: &'static str,
    url: &str,
    tls: Option<&Tls>,
) -> Result<Channel, SideError> {
    let unreachable = |reason: String| SideError::Unreachable { side, url: url.to_owned(), reason };
    let mut endpoint = Endpoint::from_shared(url.to_owned())
        .map_err(|error| unreachable(error.to_string()))?
        .connect_timeout(SETUP)
        .tcp_nodelay(true)
        .initial_stream_window_size(STREAM_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .http2_max_header_list_size(HEADER_LIST_BYTES);
    if url.starts_with("https://") {
        let tls = tls.ok_or_else(|| {
            unreachable(
                "https requires the certificate authority; give --tls-ca or [experiment.tls] ca"
                    .to_owned(),
            )
        })?;
        let read = |path: &Path| {
            let content = File::open(path).and_then(|file| CERTIFICATE_BYTES.read(file));
            content.map_err(|error| SideError::Certificate {
                path: path.to_owned(),
                reason: error.to_string(),
            })
        };
        let mut config =
            ClientTlsConfig::new().ca_certificate(Certificate::from_pem(read(&tls.ca)?));
        if let Some((cert, key)) = &tls.identity {
            private(key)?;
            config = config.identity(Identity::from_pem(read(cert)?, read(key)?));
        }
        endpoint = endpoint.tls_config(config).map_err(|error| unreachable(innermost(&error)))?;
    }
    // The endpoint's own limit does not cover the handshake of TLS.
    tokio::time::timeout(SETUP, endpoint.connect())
        .await
        .map_err(|_| unreachable(format!("no connection within {} s", SETUP.as_secs())))?
        .map_err(|error| unreachable(innermost(&error)))
}

/// A key that other users can read is no secret.
fn private(key: &Path) -> Result<(), SideError> {
    // One that is missing is named when it is read.
    let Ok(metadata) = std::fs::metadata(key) else { return Ok(()) };
    let mode = metadata.permissions().mode() & 0o777;
    if mode & 0o077 == 0 {
        return Ok(());
    }
    Err(SideError::Certificate {
        path: key.to_owned(),
        reason: format!(
            "other users can read this private key (its mode is {mode:03o}); run: chmod 600 {}",
            key.display()
        ),
    })
}

fn innermost(error: &dyn std::error::Error) -> String {
    let mut error = error;
    while let Some(source) = error.source() {
        error = source;
    }
    error.to_string()
}
