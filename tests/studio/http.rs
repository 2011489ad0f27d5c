//! One HTTP request over a socket, written by hand: a test has to be able to send what no client would.

use phyture::{Error, Result};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Longer than anything that is waited for.
const PATIENCE: Duration = Duration::from_secs(120);

pub struct Reply {
    pub status: u16,
    pub headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Reply {
    pub fn header(&self, name: &str) -> &str {
        self.headers.iter().find(|header| header.0 == name).map_or("", |header| &header.1)
    }

    pub fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).unwrap_or(serde_json::Value::Null)
    }
}

/// Sends a request with these headers, and nothing besides but the length of its body.
pub fn request(port: u16, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Result<Reply> {
    let fault = || Error::io(format!("127.0.0.1:{port}"));
    let mut stream = TcpStream::connect(("127.0.0.1", port)).map_err(fault())?;
    stream.set_read_timeout(Some(PATIENCE)).map_err(fault())?;
    let mut text = format!("{method} {path} HTTP/1.1\r\n");
    headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
    text += &format!("content-length: {}\r\nconnection: close\r\n\r\n", body.len());
    stream.write_all(text.as_bytes()).map_err(fault())?;
    // A server that refuses an oversized body may close before it has read it.
    let _ = stream.write_all(body);
    let mut reader = BufReader::new(stream);
    let line = |reader: &mut BufReader<TcpStream>| -> Result<String> {
        let mut line = String::new();
        reader.read_line(&mut line).map_err(fault())?;
        Ok(line.trim_end().to_owned())
    };
    let first = line(&mut reader)?;
    let status = first.split(' ').nth(1).and_then(|status| status.parse().ok());
    let status = status.ok_or_else(|| Error::Undetermined(format!("no status in `{first}`")))?;
    let mut reply = Reply { status, headers: Vec::new(), body: Vec::new() };
    loop {
        let header = line(&mut reader)?;
        let Some((name, value)) = header.split_once(':') else { break };
        reply.headers.push((name.to_ascii_lowercase(), value.trim().to_owned()));
    }
    match reply.header("content-length").parse() {
        Ok(length) => {
            reply.body = vec![0; length];
            reader.read_exact(&mut reply.body).map_err(fault())?;
        }
        Err(_) => drop(reader.read_to_end(&mut reply.body).map_err(fault())?),
    }
    Ok(reply)
}
