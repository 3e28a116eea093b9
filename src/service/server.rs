//! Listening, serving, shutting down; and the worker on another machine.

use super::access::{Access, TokenError, random_hex};
use super::app::Shared;
use super::hub::{self, Hub};
use super::limits::Limits;
use super::log;
use super::metrics::Metrics;
use super::open_files;
use super::paced::Paced;
use super::problem::Problem;
use super::quota::Quota;
use super::router::{Peer, router};
use super::runner::{self, WorkerSettings};
use super::signal::Signal;
use super::store::{Store, StoreError};
use super::turns::Turns;
use crate::job::ScratchFolder;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, watch};
use tower::ServiceExt;

/// Settings of the service.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Where to listen.
    pub listen: SocketAddr,
    /// Data folder.
    pub data: PathBuf,
    /// `postgres://…` instead of SQLite in the data folder.
    pub database: Option<String>,
    /// File of tokens.
    pub tokens: Option<PathBuf>,
    /// Tasks at a time in this process; 0 leaves all to workers.
    pub slots: usize,
    /// Limits.
    pub limits: Limits,
    /// How long a lease lasts.
    pub lease: Duration,
    /// Ended jobs and recordings older than this are deleted; never without it.
    pub keep: Option<Duration>,
}

/// Settings of a worker.
#[derive(Clone, Debug)]
pub struct WorkerOptions {
    /// `postgres://…`.
    pub database: String,
    /// Tasks at a time.
    pub slots: usize,
    /// How long a lease lasts.
    pub lease: Duration,
    /// The worker ends after this long without a task; never without it.
    pub idle_exit: Option<Duration>,
}

/// Why the service or a worker does not run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address is not of this machine alone and there are no tokens.
    #[error(
        "{listen} can be reached from other machines; give --tokens FILE (make one with --add-token NAME:ROLE) or listen on 127.0.0.1"
    )]
    TokensNeeded {
        /// The address.
        listen: SocketAddr,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {listen}: {source}")]
    Listen {
        /// The address.
        listen: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// Tokens.
    #[error(transparent)]
    Tokens(#[from] TokenError),
    /// Storage.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Threads or folders of this process.
    #[error("{what}: {source}")]
    System {
        /// What failed.
        what: &'static str,
        /// Why.
        source: std::io::Error,
    },
}

/// How long a service that was told to stop still answers that it is not ready, so that a load balancer hears of it.
const DRAIN: Duration = Duration::from_secs(1);
/// How often old jobs and recordings are looked for.
const DELETION_PERIOD: Duration = Duration::from_secs(600);
/// How long open requests may take to end at shutdown.
const GRACE: Duration = Duration::from_secs(10);

fn runtime() -> Result<tokio::runtime::Runtime, ServeError> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(64)
        .enable_all()
        .build()
        .map_err(|source| ServeError::System { what: "threads", source })
}

fn scratch() -> Result<ScratchFolder, ServeError> {
    ScratchFolder::new().map_err(|source| ServeError::System { what: "a folder for checkpoints", source })
}

/// Resolves at SIGINT or SIGTERM.
async fn interrupted() {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        if let (Ok(mut interrupt), Ok(mut terminate)) =
            (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
        {
            tokio::select! { _ = interrupt.recv() => {}, _ = terminate.recv() => {} }
            return;
        }
    }
    let _ = tokio::signal::ctrl_c().await;
}

/// Host names of a service that only this machine reaches; a page elsewhere whose name resolves here sends its own.
fn hosts(listen: &SocketAddr, is_closed: bool) -> Vec<String> {
    if is_closed || !listen.ip().is_loopback() {
        return Vec::new();
    }
    vec!["localhost".into(), "127.0.0.1".into(), "[::1]".into(), listen.ip().to_string()]
}

/// Runs the service until it is told to stop. `on_ready` is given the address listened on.
///
/// # Errors
/// [`ServeError`].
pub fn serve(options: &ServeOptions, on_ready: &dyn Fn(SocketAddr)) -> Result<(), ServeError> {
    let access = match &options.tokens {
        Some(path) => Access::read(path)?,
        None => Access::default(),
    };
    if !options.listen.ip().is_loopback() && !access.is_closed() {
        return Err(ServeError::TokensNeeded { listen: options.listen });
    }
    // Bound before the storage is touched: a second service on the same address changes nothing.
    let fail = |source| ServeError::Listen { listen: options.listen, source };
    let listener = std::net::TcpListener::bind(options.listen).map_err(fail)?;
    listener.set_nonblocking(true).map_err(fail)?;
    let listen = listener.local_addr().map_err(fail)?;
    let store = Arc::new(match &options.database {
        Some(url) => Store::connect(url)?,
        None => Store::open_folder(&options.data)?,
    });
    let changed =
        Problem::new("version-changed", "the program was replaced by another version; resume the job to run it anew");
    store.start_service(&changed.to_json())?;
    let runtime = runtime()?;
    let signal = Arc::new(Signal::default());
    let scratch = scratch()?;
    let slots = if options.slots == 0 {
        Vec::new()
    } else {
        let name = format!("service-{}", random_hex::<4>()?);
        let settings =
            WorkerSettings { name, slots: options.slots, lease: options.lease, scratch: scratch.path().into() };
        runner::start(&store, &settings, &signal)
    };
    let (stop, stopping) = watch::channel(false);
    let hub = Arc::new(Hub::default());
    let app = Arc::new(Shared {
        hosts: hosts(&listen, access.is_closed()),
        store: store.clone(),
        access,
        limits: options.limits,
        hub: hub.clone(),
        metrics: Metrics::default(),
        signal: signal.clone(),
        stopping: stopping.clone(),
        requests: quota("requests in work", options.limits.max_requests),
        bodies: quota("bodies coming in", options.limits.max_bodies),
        upload_bodies: quota("uploads coming in", options.limits.max_upload_bodies),
        streams: quota("event streams", options.limits.max_streams),
        answers: quota("large answers going out", options.limits.max_answers),
        quick: Turns::new(2),
        uploads: Arc::new(Semaphore::new(1)),
        ready: tokio::sync::Mutex::default(),
    });
    let limits = options.limits;
    let slots_signal = signal.clone();
    // A thread of the runtime cannot close a connection to PostgreSQL: the last hold on the storage is let go here.
    let held_store = store.clone();
    let result = runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener).map_err(fail)?;
        if let Some(keep) = options.keep {
            tokio::spawn(delete_old(store.clone(), keep));
        }
        tokio::spawn(hub::run(hub, store, stopping));
        log::info(
            "listening",
            &serde_json::json!({ "address": listen.to_string(), "version": crate::provenance::VERSION }),
        );
        on_ready(listen);
        accept(listener, router(app), &limits, || {
            // Streams end; running tasks keep their checkpoints and go back into the queue.
            let _ = stop.send(true);
            slots_signal.stop();
        })
        .await;
        Ok(())
    });
    signal.stop();
    for slot in slots {
        let _ = slot.join();
    }
    drop(scratch);
    runtime.shutdown_timeout(Duration::from_secs(2));
    drop(held_store);
    log::info("stopped", &serde_json::json!({}));
    result
}

/// Deletes what is older than `keep`, again and again.
async fn delete_old(store: Arc<Store>, keep: Duration) {
    let keep_ms = i64::try_from(keep.as_millis()).unwrap_or(i64::MAX);
    loop {
        let store = store.clone();
        match tokio::task::spawn_blocking(move || store.delete_older_than(keep_ms)).await {
            Ok(Ok([0, 0])) => {}
            Ok(Ok([jobs, recordings])) => {
                log::info("deleted", &serde_json::json!({ "jobs": jobs, "recordings": recordings }));
            }
            Ok(Err(error)) => log::error("deletion", &error.to_string()),
            Err(_) => return,
        }
        tokio::time::sleep(DELETION_PERIOD).await;
    }
}

fn quota(what: &'static str, [max, of_caller]: [usize; 2]) -> Arc<Quota> {
    Quota::new(what, max, of_caller)
}

/// Takes connections until the service is told to stop. Their number is bounded for each address, so that one cannot
/// hold them all.
async fn accept(listener: tokio::net::TcpListener, router: axum::Router, limits: &Limits, on_stop: impl Fn()) {
    let graceful = GracefulShutdown::new();
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(limits.head_time).max_headers(64).max_buf_size(64 << 10);
    let connections = quota("connections", open_files::connections(limits.max_connections));
    let Limits { least_bytes_per_s, body_grace, .. } = *limits;
    let mut stopped = std::pin::pin!(interrupted());
    let mut end: Option<tokio::time::Instant> = None;
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = &mut stopped, if end.is_none() => {
                log::info("stopping", &serde_json::json!({}));
                on_stop();
                end = Some(tokio::time::Instant::now() + DRAIN);
                continue;
            }
            () = tokio::time::sleep_until(end.unwrap_or_else(tokio::time::Instant::now)), if end.is_some() => break,
        };
        let Ok((socket, peer)) = accepted else {
            // Out of file descriptors, say: connections end and free some.
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let address = peer.ip().to_string();
        let Ok(entered) = connections.enter(&address) else { continue };
        let _ = socket.set_nodelay(true);
        let paced = Paced::new(socket, least_bytes_per_s, body_grace);
        let peer = Peer(address.into());
        let named = router.clone().map_request(move |mut request: hyper::Request<hyper::body::Incoming>| {
            request.extensions_mut().insert(peer.clone());
            request.map(axum::body::Body::new)
        });
        let service = TowerToHyperService::new(named);
        let connection = graceful.watch(http.serve_connection(TokioIo::new(paced), service));
        tokio::spawn(async move {
            let _entered = entered;
            let _ = connection.await;
        });
    }
    drop(listener);
    tokio::select! {
        () = graceful.shutdown() => {}
        () = tokio::time::sleep(GRACE) => {}
    }
}

/// Runs a worker until it is told to stop, or has been idle for as long as its options say.
///
/// # Errors
/// [`ServeError`].
pub fn work(options: &WorkerOptions) -> Result<(), ServeError> {
    let store = Arc::new(Store::connect(&options.database)?);
    store.check_version()?;
    let runtime = runtime()?;
    let signal = Arc::new(Signal::default());
    let scratch = scratch()?;
    let name = format!("worker-{}", random_hex::<4>()?);
    log::info(
        "worker",
        &serde_json::json!({ "name": name, "slots": options.slots, "version": crate::provenance::VERSION }),
    );
    let settings = WorkerSettings { name, slots: options.slots, lease: options.lease, scratch: scratch.path().into() };
    let slots = runner::start(&store, &settings, &signal);
    let other = runtime.block_on(async {
        let mut stopped = std::pin::pin!(interrupted());
        let (mut idle_since, mut checked, mut tasks) = (Instant::now(), Instant::now(), 0);
        loop {
            tokio::select! {
                () = &mut stopped => return None,
                () = tokio::time::sleep(Duration::from_secs(1)) => {}
            }
            let so_far = signal.finished.load(Ordering::Relaxed) + signal.failed.load(Ordering::Relaxed);
            if signal.running.load(Ordering::SeqCst) > 0 || so_far != tasks {
                (idle_since, tasks) = (Instant::now(), so_far);
            }
            if options.idle_exit.is_some_and(|limit| idle_since.elapsed() >= limit) {
                log::info("worker", &serde_json::json!({ "name": settings.name, "outcome": "idle", "tasks": so_far }));
                return None;
            }
            if checked.elapsed() < Duration::from_secs(10) {
                continue;
            }
            checked = Instant::now();
            // A service of another version that starts meanwhile is noticed too.
            let store = store.clone();
            if let Ok(Err(error @ StoreError::OtherVersion { .. })) =
                tokio::task::spawn_blocking(move || store.check_version()).await
            {
                return Some(error);
            }
        }
    });
    signal.stop();
    for slot in slots {
        let _ = slot.join();
    }
    drop(scratch);
    match other {
        Some(error) => Err(error.into()),
        None => Ok(()),
    }
}
