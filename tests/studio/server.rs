//! The server over a real socket: what it answers, and whom it refuses.

use crate::http::{Reply, request};
use crate::support::{Running, studio};
use phyture::Result;
use phyture::studio::server::LARGEST_BODY;

/// A request as the page makes it, with one header replaced or added.
fn ask(server: &Running, path: &str, other: (&str, &str), body: &[u8]) -> Result<Reply> {
    let host = format!("127.0.0.1:{}", server.port);
    let mut headers: Vec<(&str, &str)> =
        vec![("host", &host), ("x-studio-token", &server.token), ("sec-fetch-site", "same-origin")];
    headers.retain(|header| header.0 != other.0);
    if !other.1.is_empty() {
        headers.push(other);
    }
    request(server.port, "POST", path, &headers, body)
}

const NOTHING: (&str, &str) = ("accept", "*/*");

#[test]
fn whoever_is_not_the_page_is_refused_with_a_clear_status() -> Result<()> {
    let server = Running::new(studio(None)?)?;
    let status = |path: &str, other: (&str, &str), body: &[u8]| Ok::<_, phyture::Error>(ask(&server, path, other, body)?.status);
    assert_eq!(status("/api/overview", NOTHING, b"{}")?, 200);
    assert_eq!(status("/api/overview", ("x-studio-token", ""), b"{}")?, 401);
    assert_eq!(status("/api/overview", ("x-studio-token", "0123"), b"{}")?, 403);
    assert_eq!(status("/api/overview", ("host", "evil.example"), b"{}")?, 421);
    assert_eq!(status("/api/overview", ("sec-fetch-site", "cross-site"), b"{}")?, 403);
    assert_eq!(status("/api/overview", ("origin", "http://evil.example"), b"{}")?, 403);
    assert_eq!(status("/api/overview", ("origin", "null"), b"{}")?, 403);
    assert_eq!(status("/api/no_such_thing", NOTHING, b"{}")?, 404);
    assert_eq!(status("/api/", NOTHING, b"{}")?, 404);
    assert_eq!(status("/app.css", NOTHING, b"")?, 405, "files are asked for by GET");
    let long = vec![b' '; LARGEST_BODY + 1];
    assert_eq!(status("/api/trace", NOTHING, &long)?, 413);
    let malformed = ask(&server, "/api/trace", NOTHING, b"{\"flight\": ")?;
    assert_eq!(malformed.status, 400);
    let message = malformed.json()["error"]["message"].as_str().unwrap_or("").to_owned();
    assert!(message.contains("line 1") && message.contains("column"), "{message}");
    assert_eq!(status("/api/trace", NOTHING, b"{\"flight\": \"one\"}")?, 400);
    assert_eq!(status("/api/trace", NOTHING, b"{\"flight\": 99, \"channel\": 0, \"pixels\": 400}")?, 422);
    assert_eq!(status("/api/edit", NOTHING, b"{\"do\": \"melt\"}")?, 400);
    Ok(())
}

#[test]
fn files_come_from_a_table_and_no_path_leads_out_of_it() -> Result<()> {
    let server = Running::new(studio(None)?)?;
    let host = format!("127.0.0.1:{}", server.port);
    let get = |path: &str| request(server.port, "GET", path, &[("host", &host)], b"");
    for (path, kind) in
        [("/", "text/html"), ("/main.js", "text/javascript"), ("/app.css", "text/css"), ("/vendor/uPlot.esm.js", "text/javascript")]
    {
        let reply = get(path)?;
        assert_eq!((reply.status, reply.header("content-type").starts_with(kind)), (200, true), "{path}");
        assert!(!reply.body.is_empty() && reply.header("content-security-policy").starts_with("default-src 'none'"));
        assert_eq!((reply.header("x-content-type-options"), reply.header("cache-control")), ("nosniff", "no-store"));
    }
    for path in
        ["/../Cargo.toml", "/vendor/../../mod.rs", "/%2e%2e/mod.rs", "/main.js/", "//main.js", "/etc/passwd", "/favicon.ico"]
    {
        assert_eq!(get(path)?.status, 404, "{path}");
    }
    assert_eq!(get("/api/overview")?.status, 401, "nothing of the data without the token");
    let page = String::from_utf8_lossy(&get("/")?.body).into_owned();
    assert!(!page.contains(&server.token), "the token is in the address alone");
    Ok(())
}

#[test]
fn requests_change_the_model_and_errors_say_which_character() -> Result<()> {
    let mut server = Running::new(studio(None)?)?;
    let steps = ask(&server, "/api/edit", NOTHING, b"{\"do\": \"add\", \"effect\": \"weathercock\"}")?;
    assert_eq!((steps.status, steps.json()["at"].as_u64()), (200, Some(1)));
    let formula = b"{\"do\": \"formula\", \"name\": \"own\", \"owner\": {\"channel\": 0}, \"formula\": \"vx * (\"}";
    let refused = ask(&server, "/api/edit", NOTHING, formula)?;
    assert_eq!(refused.status, 422);
    assert_eq!((refused.json()["error"]["kind"].as_str(), refused.json()["error"]["at"].as_u64()), (Some("formula"), Some(6)));
    assert_eq!(ask(&server, "/api/undo", NOTHING, b"")?.json()["at"].as_u64(), Some(0));
    server.end()?;
    assert!(ask(&server, "/api/steps", NOTHING, b"{}").is_err(), "it has ended");
    Ok(())
}

#[test]
fn a_port_that_is_taken_is_said() -> Result<()> {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").map_err(phyture::Error::io("socket"))?;
    let port = taken.local_addr().map_err(phyture::Error::io("socket"))?.port();
    let refused = phyture::studio::server::Server::bind(port).map(|server| server.port());
    assert!(refused.is_err_and(|error| error.to_string().contains("--port")));
    Ok(())
}
