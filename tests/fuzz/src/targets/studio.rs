//! The studio's server on a short simulated flight: requests by name, and any bytes that come over its socket. An input that changes the model
//! has a studio of its own, so that what it finds is found again. What writes files, and the search, which works for seconds behind the answer, are not asked for.

use phyture::flight::split::{Part, Split};
use phyture::flight::{DataSet, Span};
use phyture::physics::{Model, calibrate};
use phyture::sim::{INERTIA_KG_M2, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::studio::server::Server;
use phyture::studio::{Opening, Studio};
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Requests of one input that are made.
const MOST_REQUESTS: usize = 4;

/// Longer than any answer takes.
const PATIENCE: Duration = Duration::from_secs(30);

/// What these names are in is not asked for: it writes files, or is the search.
const SPARED: [&str; 2] = ["save", "diagnose"];

/// What this name is in may leave another model behind.
const CHANGING: &str = "edit";

/// Lines of a request's name and its JSON.
pub fn requests(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let studio = if text.contains(CHANGING) { opened() } else { Arc::clone(shared()) };
    let served = Served::new(studio);
    let mut is_taken = false;
    for line in text.lines().take(MOST_REQUESTS) {
        let (name, body) = line.split_once(' ').unwrap_or((line, ""));
        let is_plain = name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
        if !is_plain || SPARED.iter().any(|spared| name.contains(spared)) {
            continue;
        }
        let head = format!("POST /api/{name} HTTP/1.1\r\nhost: {{host}}\r\nx-studio-token: {{token}}\r\nconnection: close\r\n");
        let reply = served.exchange(format!("{head}content-length: {}\r\n\r\n{body}", body.len()).as_bytes(), PATIENCE);
        let status = String::from_utf8_lossy(&reply).split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        assert!([200, 400, 404, 409, 422].contains(&status), "{line}: {}", String::from_utf8_lossy(&reply));
        is_taken |= status == 200;
    }
    is_taken
}

/// What a connection carries, `{host}` and `{token}` standing for those of the server.
pub fn http(bytes: &[u8]) -> bool {
    if SPARED.iter().chain([&CHANGING]).any(|spared| contains(bytes, spared.as_bytes())) {
        return false;
    }
    let reply = Served::new(Arc::clone(shared())).exchange(bytes, Duration::from_millis(20));
    assert!(reply.is_empty() || reply.starts_with(b"HTTP/1."), "{}", String::from_utf8_lossy(&reply));
    assert!(!reply.starts_with(b"HTTP/1.1 500"), "{}", String::from_utf8_lossy(&reply));
    reply.starts_with(b"HTTP/1.1 200")
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

/// With one text in the place of another.
fn replaced(bytes: &[u8], mark: &[u8], by: &[u8]) -> Vec<u8> {
    let (mut made, mut rest) = (Vec::new(), bytes);
    while let Some(at) = rest.windows(mark.len()).position(|window| window == mark) {
        made.extend_from_slice(&rest[..at]);
        made.extend_from_slice(by);
        rest = &rest[at + mark.len()..];
    }
    [made.as_slice(), rest].concat()
}

/// A server of a studio.
struct Served {
    port: u16,
    token: String,
    end: Arc<AtomicBool>,
}

impl Served {
    fn new(studio: Arc<Studio>) -> Self {
        let server = Server::bind(0).expect("a port of this machine");
        let (port, token, end) = (server.port(), server.token().to_owned(), Arc::new(AtomicBool::new(false)));
        let seen = Arc::clone(&end);
        // It is not waited for when it ends.
        std::thread::spawn(move || server.run(studio, &seen));
        Self { port, token, end }
    }

    /// Sends, and takes all that is answered. Where the server waits for more, there is no more.
    fn exchange(&self, bytes: &[u8], patience: Duration) -> Vec<u8> {
        let bytes = replaced(bytes, b"{host}", format!("127.0.0.1:{}", self.port).as_bytes());
        let bytes = replaced(&bytes, b"{token}", self.token.as_bytes());
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("the server listens");
        // A server that refuses may close before it has read all.
        let _ = stream.write_all(&bytes);
        let mut reply = Vec::new();
        for wait in [patience, PATIENCE] {
            stream.set_read_timeout(Some(wait)).expect("a time to wait");
            match stream.read_to_end(&mut reply) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => drop(stream.shutdown(Shutdown::Write)),
                _ => return reply,
            }
        }
        panic!("the connection stays open");
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
    }
}

/// A studio that nothing has changed.
fn opened() -> Arc<Studio> {
    static MADE: OnceLock<(DataSet, Split, Model)> = OnceLock::new();
    let (set, split, model) = MADE.get_or_init(|| made().expect("a simulated flight and a model of it")).clone();
    let opening = Opening { set, split, model, data: "simulated".into(), file: None, seed: 7 };
    Studio::open(opening).map(Arc::new).expect("a studio on a simulated flight")
}

/// One for all inputs that change nothing.
fn shared() -> &'static Arc<Studio> {
    static SHARED: OnceLock<Arc<Studio>> = OnceLock::new();
    SHARED.get_or_init(opened)
}

/// Four seconds of a simulated flight, the last of which judges: a studio on them opens in some milliseconds.
fn made() -> phyture::Result<(DataSet, Split, Model)> {
    let mut set = simulate(&Simulation { minutes: 0.2, seed: 7, ..Simulation::baseline() })?;
    set.flights = set.flights.iter().filter_map(|flight| flight.slice(200..600, "a")).take(1).collect();
    let span = |start, end| vec![Span { flight: 0, start, end }];
    let split = Split { training: span(0, 300), validation: Vec::new(), test: span(300, 400), tested: Part::Test };
    let blank = Model::paper("small", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
    let (model, _) = calibrate(&blank, &set.flights, &split.training)?;
    Ok((set, split, model))
}
