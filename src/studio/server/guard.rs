//! Who may ask: a page of this very server, with the token. Against other sites in the same browser (which can send requests to 127.0.0.1, and can
//! give themselves a name that means 127.0.0.1) and against other users of the machine.

use super::Refusal;
use crate::error::{Error, Result};
use axum::http::{HeaderMap, HeaderName, header};

/// Bytes of the token.
const TOKEN_BYTES: usize = 24;

/// Carries the token.
const TOKEN_HEADER: HeaderName = HeaderName::from_static("x-studio-token");

/// Names under which a browser may know this machine. No other name can be made to mean it by somebody else's name server.
const HOSTS: [&str; 2] = ["127.0.0.1", "localhost"];

/// Secret of one run of the server.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// A new one from the operating system.
    pub(super) fn random() -> Result<Self> {
        let mut bytes = [0_u8; TOKEN_BYTES];
        getrandom::fill(&mut bytes)
            .map_err(|error| Error::Undetermined(format!("the system gives no random numbers for the token: {error}")))?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// As text.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Lets a request through that carries the token.
    pub(super) fn admit(&self, headers: &HeaderMap) -> std::result::Result<(), Refusal> {
        let hint = "open the address that `phyture studio` printed when it was started";
        let Some(given) = headers.get(TOKEN_HEADER) else {
            return Err(Refusal::new(401, "token", format!("the request has no token; {hint}")));
        };
        if is_same(given.as_bytes(), self.0.as_bytes()) {
            return Ok(());
        }
        Err(Refusal::new(403, "token", format!("the token is not that of this studio, which was perhaps started anew; {hint}")))
    }
}

/// Compares in a time that does not tell where they differ.
fn is_same(left: &[u8], right: &[u8]) -> bool {
    left.len() == right.len() && left.iter().zip(right).fold(0, |differs, (left, right)| differs | (left ^ right)) == 0
}

/// Refuses a request that takes this server for another.
pub(super) fn host(headers: &HeaderMap, port: u16) -> std::result::Result<(), Refusal> {
    let named = headers.get(header::HOST).and_then(|host| host.to_str().ok());
    if named.is_some_and(|named| HOSTS.iter().any(|host| named == format!("{host}:{port}"))) {
        return Ok(());
    }
    Err(Refusal::new(421, "host", format!("this server is 127.0.0.1:{port} and no other")))
}

/// Refuses a request that another site made.
pub(super) fn origin(headers: &HeaderMap, port: u16) -> std::result::Result<(), Refusal> {
    let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or("?").to_owned());
    let own = |origin: &String| HOSTS.iter().any(|host| *origin == format!("http://{host}:{port}"));
    // A browser says `none` where a person typed the address.
    let site = text(HeaderName::from_static("sec-fetch-site")).is_none_or(|site| site == "same-origin" || site == "none");
    if site && text(header::ORIGIN).is_none_or(|origin| own(&origin)) {
        return Ok(());
    }
    Err(Refusal::new(403, "origin", "the request comes from another site"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value))).collect()
    }

    fn status(result: std::result::Result<(), Refusal>) -> u16 {
        result.map_or_else(|refusal| refusal.status, |()| 200)
    }

    #[test]
    fn only_this_machine_under_its_own_names_is_the_host() {
        for (named, expected) in [
            ("127.0.0.1:81", 200),
            ("localhost:81", 200),
            ("127.0.0.1:82", 421),
            ("127.0.0.1", 421),
            ("evil.example:81", 421),
            ("127.0.0.1:81.evil.example", 421),
        ] {
            assert_eq!(status(host(&headers(&[("host", named)]), 81)), expected, "{named}");
        }
        assert_eq!(status(host(&HeaderMap::new(), 81)), 421);
    }

    #[test]
    fn other_sites_are_refused_and_a_typed_address_is_not() {
        assert_eq!(status(origin(&HeaderMap::new(), 81)), 200);
        assert_eq!(status(origin(&headers(&[("sec-fetch-site", "none")]), 81)), 200);
        assert_eq!(status(origin(&headers(&[("sec-fetch-site", "same-origin"), ("origin", "http://127.0.0.1:81")]), 81)), 200);
        assert_eq!(status(origin(&headers(&[("sec-fetch-site", "cross-site")]), 81)), 403);
        assert_eq!(status(origin(&headers(&[("sec-fetch-site", "same-site")]), 81)), 403);
        assert_eq!(status(origin(&headers(&[("origin", "http://127.0.0.1:82")]), 81)), 403);
        assert_eq!(status(origin(&headers(&[("origin", "null")]), 81)), 403);
    }

    #[test]
    fn tokens_are_long_differ_and_have_to_be_right() -> Result<()> {
        let (one, other) = (Token::random()?, Token::random()?);
        assert!(one.text().len() == 2 * TOKEN_BYTES && one.text() != other.text());
        assert_eq!(status(one.admit(&HeaderMap::new())), 401);
        let of = |token: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(TOKEN_HEADER, HeaderValue::from_str(token).unwrap_or(HeaderValue::from_static("")));
            headers
        };
        assert_eq!(status(one.admit(&of(one.text()))), 200);
        assert_eq!(status(one.admit(&of(other.text()))), 403);
        assert_eq!(status(one.admit(&of(""))), 403);
        Ok(())
    }
}
