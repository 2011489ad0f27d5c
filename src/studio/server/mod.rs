//! The studio in a browser on this machine: a server on 127.0.0.1 that hands out the app and answers its requests. It computes nothing.
//!
//! Whoever is asked for: static files by GET, requests by POST to `/api/NAME` with JSON. Every request has to name this server as its host and
//! come from the server's own page; those to `/api/` also carry the token that stands in the address which the program prints.

mod fault;
mod files;
mod guard;
mod routes;

use fault::Refusal;
pub use guard::Token;

use super::Studio;
use crate::error::{Error, Result};
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, Method, Response, StatusCode, header};
use axum::routing::any;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Bytes that the body of a request may have: a formula and a few numbers are some hundred.
pub const LARGEST_BODY: usize = 64 * 1024;

/// How often is looked whether the server is to end.
const LOOK: Duration = Duration::from_millis(100);

/// Where requests to the studio begin.
const API: &str = "/api/";

/// What the page may do: load and ask this server, nothing else.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Sent with every answer.
const HEADERS: [(&str, &str); 6] = [
    ("content-security-policy", POLICY),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cache-control", "no-store"),
];

/// A server that is bound and not yet running.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    token: Token,
}

/// What every request needs.
struct Shared {
    studio: Arc<Studio>,
    port: u16,
    token: Token,
}

impl Server {
    /// Binds to 127.0.0.1; port 0 is a free one.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where the port is taken, or the system has no random numbers.
    pub fn bind(port: u16) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|error| {
            Error::Undetermined(format!("port {port} of 127.0.0.1 cannot be had: {error}; give another with --port, or none"))
        })?;
        let address = listener.local_addr().map_err(Error::io("127.0.0.1"))?;
        listener.set_nonblocking(true).map_err(Error::io("127.0.0.1"))?;
        Ok(Self { listener, address, token: Token::random()? })
    }

    /// The address to open, with the token.
    pub fn url(&self) -> String {
        format!("http://{}/#token={}", self.address, self.token.text())
    }

    /// Port.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// The token.
    pub fn token(&self) -> &str {
        self.token.text()
    }

    /// Answers until `end` is raised.
    ///
    /// # Errors
    /// [`Error::Io`] where the socket fails.
    pub fn run(self, studio: Arc<Studio>, end: &AtomicBool) -> Result<()> {
        let fault = || Error::io(format!("http://{}", self.address));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(fault())?;
        let shared = Arc::new(Shared { studio, port: self.address.port(), token: self.token.clone() });
        let served: std::io::Result<()> = runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener)?;
            let app = Router::new().fallback(any(answer)).with_state(shared);
            let ended = async {
                while !end.load(Ordering::Relaxed) {
                    tokio::time::sleep(LOOK).await;
                }
            };
            // A page that is open keeps its connection: it is not waited for.
            tokio::select! {
                served = async { axum::serve(listener, app).await } => served,
                () = ended => Ok(()),
            }
        });
        // Nor is a search that runs.
        runtime.shutdown_background();
        let address = self.address;
        served.map_err(Error::io(format!("http://{address}")))
    }
}

/// One request.
async fn answer(State(shared): State<Arc<Shared>>, request: Request) -> Response<Body> {
    let answered = admitted(&shared, request).await;
    let (status, kind, body) = answered.unwrap_or_else(|refusal| (refusal.status, files::JSON, refusal.body().into()));
    let mut response = Response::new(body);
    *response.status_mut() = StatusCode::from_u16(status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    for (name, value) in HEADERS {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    response
}

/// Status, content type and body of what is answered.
type Answer = (u16, &'static str, Body);

async fn admitted(shared: &Arc<Shared>, request: Request) -> std::result::Result<Answer, Refusal> {
    let (parts, body) = request.into_parts();
    guard::host(&parts.headers, shared.port)?;
    guard::origin(&parts.headers, shared.port)?;
    let path = parts.uri.path();
    let Some(name) = path.strip_prefix(API) else {
        let (kind, content) = files::find(path).ok_or_else(|| Refusal::new(404, "path", format!("nothing is at `{path}`")))?;
        if parts.method != Method::GET && parts.method != Method::HEAD {
            return Err(Refusal::new(405, "method", "files are asked for by GET"));
        }
        return Ok((200, kind, Body::from(content)));
    };
    shared.token.admit(&parts.headers)?;
    if parts.method != Method::POST {
        return Err(Refusal::new(405, "method", "requests to /api/ are made by POST"));
    }
    let body = to_bytes(body, LARGEST_BODY)
        .await
        .map_err(|_| Refusal::new(413, "body", format!("the body is cut off, or longer than {LARGEST_BODY} bytes")))?;
    let (studio, name) = (Arc::clone(&shared.studio), name.to_owned());
    let answered = tokio::task::spawn_blocking(move || routes::answer(&studio, &name, &body)).await;
    let json = answered.map_err(|_| Refusal::new(500, "panic", "the request broke off; the terminal of the studio says why"))??;
    Ok((200, files::JSON, Body::from(json)))
}
