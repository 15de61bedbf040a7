//! TLS before the page: handshakes beside each other, bounded, and each with a deadline.
//!
//! A browser that opens a connection and says nothing must hold nobody up, and whoever typed `http://` is told so instead
//! of being shown an error of the browser.

use crate::out::usage;
use anyhow::Context as _;
use axle_gateway::door::Site;
use axle_mesh::identity::served_names;
use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{self, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt as _, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::time::timeout;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::server::TlsStream;
use tokio_rustls::{TlsAcceptor, rustls};

/// A browser has so long for its handshake.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// The most connections at a time, those whose handshake is not done among them.
const CONNECTIONS: usize = 256;
/// What every handshake of TLS begins with.
const HELLO: u8 = 0x16;
/// For whoever speaks plain HTTP here.
const PLAIN: &[u8] =
    b"HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain; charset=utf-8\r\nconnection: close\r\n\
                       content-length: 50\r\n\r\nthis page speaks TLS: begin its address with https";

/// A certificate and its key, and the site that they make.
pub(super) fn read(certificate: &Path, key: &Path) -> anyhow::Result<(TlsAcceptor, Site)> {
    let wrong = |path: &Path, why: &dyn std::fmt::Display| usage(format!("{}: {why}", path.display()));
    let chain = CertificateDer::pem_file_iter(certificate)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|fault| {
        wrong(
            certificate,
            &format!("{fault}; `axle keys issue page@HOST` issues one, for a host of the topology"),
        )
    })?;
    let leaf = chain.first().ok_or_else(|| wrong(certificate, &"it holds no certificate"))?;
    let (names, expires) = served_names(leaf).map_err(|fault| wrong(certificate, &fault))?;
    if names.is_empty() {
        return Err(wrong(
            certificate,
            &"it holds no name of a host; `axle keys issue page@HOST` issues one that does",
        ));
    }
    if expires <= axle_mesh::clock::wall() {
        return Err(wrong(certificate, &"it has expired: issue it anew with `axle keys issue page@HOST`"));
    }
    axle_mesh::identity::check_private(key).map_err(|fault| wrong(key, &fault))?;
    let secret = PrivateKeyDer::from_pem_file(key).map_err(|fault| wrong(key, &fault))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .context("choose the versions of TLS")?
        .with_no_client_auth()
        .with_single_cert(chain, secret)
        .map_err(|fault| wrong(key, &format!("it does not fit {}: {fault}", certificate.display())))?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok((TlsAcceptor::from(Arc::new(config)), Site::secured(&names)))
}

/// A listener whose connections are encrypted.
pub(super) struct Secured {
    done: mpsc::Receiver<(Link, SocketAddr)>,
    address: SocketAddr,
}

/// An encrypted connection, and its place among all.
pub(super) struct Link {
    stream: TlsStream<TcpStream>,
    _place: OwnedSemaphorePermit,
}

impl Secured {
    /// Accepts connections until it is dropped.
    pub(super) fn new(mut listener: TcpListener, acceptor: TlsAcceptor) -> io::Result<Self> {
        let address = listener.local_addr()?;
        let (sender, done) = mpsc::channel(16);
        tokio::spawn(async move {
            let places = Arc::new(Semaphore::new(CONNECTIONS));
            loop {
                let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
                let (stream, from) = tokio::select! {
                    () = sender.closed() => return,
                    accepted = axum::serve::Listener::accept(&mut listener) => accepted,
                };
                let (acceptor, sender) = (acceptor.clone(), sender.clone());
                tokio::spawn(async move {
                    match timeout(HANDSHAKE, shake(acceptor, stream)).await {
                        Ok(Ok(stream)) => drop(sender.send((Link { stream, _place: place }, from)).await),
                        Ok(Err(fault)) => tracing::debug!(%from, "no handshake: {fault}"),
                        Err(_) => tracing::debug!(%from, "no handshake in time"),
                    }
                });
            }
        });
        Ok(Self { done, address })
    }
}

async fn shake(acceptor: TlsAcceptor, mut stream: TcpStream) -> io::Result<TlsStream<TcpStream>> {
    let mut first = [0];
    if stream.peek(&mut first).await? == 1 && first[0] != HELLO {
        stream.write_all(PLAIN).await?;
        stream.shutdown().await?;
        return Err(io::Error::new(io::ErrorKind::InvalidData, "plain HTTP"));
    }
    // What drives a robot does not wait for a packet to fill.
    stream.set_nodelay(true)?;
    acceptor.accept(stream).await
}

impl axum::serve::Listener for Secured {
    type Io = Link;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Link, SocketAddr) {
        match self.done.recv().await {
            Some(link) => link,
            // The task above ends only with this listener.
            None => std::future::pending().await,
        }
    }
    fn local_addr(&self) -> io::Result<SocketAddr> {
        Ok(self.address)
    }
}

impl AsyncRead for Link {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut task::Context<'_>,
        bytes: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, bytes)
    }
}

impl AsyncWrite for Link {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut task::Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }
    fn poll_flush(mut self: Pin<&mut Self>, context: &mut task::Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }
    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut task::Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
