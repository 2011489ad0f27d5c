//! A studio on simulated flights that hide an effect, and a server for it that ends with the test.

use phyture::flight::split::Split;
use phyture::physics::Model;
use phyture::sim::{INERTIA_KG_M2, Level, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::studio::server::Server;
use phyture::studio::{Opening, Studio};
use phyture::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// What the flights hide. It turns the nose into the wind of the aircraft's own motion: an error of the yaw acceleration alone.
pub const HIDDEN: &str = "weathercock";

const SEED: u64 = 7;

/// A model without numbers, as it lies beside simulated flights.
pub fn blank() -> Model {
    Model::paper("truth-helicopter", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)
}

/// Ten minutes of flight, a flight of each of twenty classes. `file` is the model's file, which is written.
pub fn studio(file: Option<&Path>) -> Result<Arc<Studio>> {
    let simulation = Simulation { minutes: 10.0, seed: SEED, level: Level::ZERO, ..Simulation::baseline() };
    let set = simulate(&simulation.hide(HIDDEN, 1.0)?)?;
    let split = Split::for_search(&set.flights, SEED);
    file.map_or(Ok(()), |file| blank().write(file))?;
    let opening = Opening { set, split, model: blank(), data: "simulated".into(), file: file.map(PathBuf::from), seed: SEED };
    Ok(Arc::new(Studio::open(opening)?))
}

/// A server that runs in this process.
pub struct Running {
    pub port: u16,
    pub token: String,
    pub url: String,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl Running {
    pub fn new(studio: Arc<Studio>) -> Result<Self> {
        let server = Server::bind(0)?;
        let (port, token, url) = (server.port(), server.token().to_owned(), server.url());
        let end = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&end);
        let thread = Some(std::thread::spawn(move || server.run(studio, &seen)));
        Ok(Self { port, token, url, end, thread })
    }

    /// Ends the server, as Ctrl-C does.
    pub fn end(&mut self) -> Result<()> {
        self.end.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map_or(Ok(Ok(())), JoinHandle::join);
        ended.map_err(|_| Error::Undetermined("the server panicked".into()))?
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A test that failed has its own message.
        let _ = self.end();
    }
}

pub fn folder() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(Error::io("temporary folder"))
}
