//! The studio: as a library, over a real socket, and in a real browser where there is one.
#![cfg(feature = "studio")]

mod access;
mod browser;
mod http;
mod library;
mod mishaps;
mod rollouts;
mod runs;
mod server;
mod support;
mod training;
mod unsaved;
mod views;
mod webdriver;
