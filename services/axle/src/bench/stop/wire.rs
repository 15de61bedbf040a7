//! A wire between a commander and the router that can be cut and mended: while it is cut nothing passes, and when it is mended
//! everything that waited in it passes at once, as TCP does after an outage.

use std::sync::Arc;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::{JoinHandle, JoinSet};

/// Links through one wire at a time; a commander has one.
const LINKS: usize = 4;

/// The wire of one commander.
pub(super) struct Wire {
    /// Where the commander connects to.
    pub(super) endpoint: String,
    is_cut: Arc<watch::Sender<bool>>,
    carrying: JoinHandle<()>,
}

impl Wire {
    /// A wire to the router at `address` (`127.0.0.1:7447`).
    pub(super) async fn to(address: String) -> std::io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0").await?;
        let endpoint = format!("tcp/{}", listener.local_addr()?);
        let is_cut = Arc::new(watch::channel(false).0);
        let watched = Arc::clone(&is_cut);
        let carrying = tokio::spawn(async move {
            let mut links = JoinSet::new();
            while let Ok((near, _)) = listener.accept().await {
                while links.try_join_next().is_some() {}
                if links.len() < LINKS {
                    links.spawn(carry(near, address.clone(), watched.subscribe()));
                }
            }
        });
        Ok(Self { endpoint, is_cut, carrying })
    }
    /// Cuts it.
    pub(super) fn cut(&self) {
        self.is_cut.send_replace(true);
    }
    /// Mends it.
    pub(super) fn mend(&self) {
        self.is_cut.send_replace(false);
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        self.carrying.abort();
    }
}

/// Carries one link until either end closes it.
async fn carry(near: TcpStream, address: String, is_cut: watch::Receiver<bool>) {
    let Ok(far) = TcpStream::connect(address).await else { return };
    // Bytes pass as they come; whoever would rather wait for more has done so already.
    let _ = (near.set_nodelay(true), far.set_nodelay(true));
    let ((near_out, near_in), (far_out, far_in)) = (near.into_split(), far.into_split());
    tokio::select! {
        () = pass(near_out, far_in, is_cut.clone()) => {}
        () = pass(far_out, near_in, is_cut) => {}
    }
}

async fn pass(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, mut is_cut: watch::Receiver<bool>) {
    let mut bytes = vec![0; 64 * 1024];
    while let Ok(count @ 1..) = from.read(&mut bytes).await {
        if is_cut.wait_for(|is_cut| !*is_cut).await.is_err() || to.write_all(&bytes[..count]).await.is_err() {
            return;
        }
    }
}
