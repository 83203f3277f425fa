//! Access control: the names of the server, the origins of the pages that may connect, the token.

use super::ServerOptions;
use axum::http::header::{AUTHORIZATION, HOST, HeaderName, ORIGIN, REFERER, SEC_WEBSOCKET_PROTOCOL};
use axum::http::{HeaderMap, StatusCode, Version};
use std::net::IpAddr;

/// Prefix of a token that a page passes as a subprotocol of a WebSocket, the only header that a browser lets
/// a page set.
const TOKEN_PROTOCOL: &str = "lightcast.token.";

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It names more than one host.
    Hosts,
    /// It was sent to another name than the server's: a page has made its own name point here (DNS
    /// rebinding).
    Host,
    /// A page from another site sent it.
    Origin,
    /// It has no token, or a wrong one.
    Token,
}

impl Refusal {
    pub fn status(self) -> StatusCode {
        match self {
            Self::Hosts => StatusCode::BAD_REQUEST,
            Self::Host | Self::Origin => StatusCode::FORBIDDEN,
            Self::Token => StatusCode::UNAUTHORIZED,
        }
    }

    /// The message to the client.
    pub fn reason(self) -> &'static str {
        match self {
            Self::Hosts => "a request has one Host header",
            Self::Host => {
                "call this server by its address or the name it listens on; [server] origins can have others"
            }
            Self::Origin => "pages of this origin may not connect; [server] origins names those that may",
            Self::Token => {
                "a token is needed: Authorization: Bearer TOKEN, or the subprotocol lightcast.token.TOKEN"
            }
        }
    }
}

/// The names of a server.
#[derive(Debug)]
pub(super) struct Names {
    /// The host that it listens on.
    host: String,
    is_loopback: bool,
}

impl Names {
    /// For a server that listens on `address`, HOST:PORT.
    pub fn new(address: &str, is_loopback: bool) -> Self {
        Self { host: name_of(address).to_owned(), is_loopback }
    }

    /// An IP address cannot be redirected; a name can, so the name from which a stranger's page was loaded
    /// may point here.
    fn have(&self, name: &str) -> bool {
        let number = name.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(name);
        // The root of all names may be written: `localhost.`.
        let name = name.strip_suffix('.').unwrap_or(name);
        let is_one_of = [self.host.as_str(), "localhost"].iter().any(|own| name.eq_ignore_ascii_case(own));
        is_one_of || number.parse::<IpAddr>().is_ok()
    }
}

/// Checks a request. A server that is for this machine only, or that asks for no token, must be addressed by
/// one of its own names.
pub(super) fn check(
    (version, headers): (Version, &HeaderMap),
    options: &ServerOptions,
    names: &Names,
    needs_token: bool,
) -> Result<(), Refusal> {
    if headers.get_all(HOST).iter().count() > 1 {
        return Err(Refusal::Hosts);
    }
    let host = text(headers, HOST).unwrap_or("");
    // Only programs speak HTTP/1.0, which needs no host.
    let has_none = version <= Version::HTTP_10 && !headers.contains_key(HOST);
    let is_allowed = || options.origins.iter().any(|origin| host_of(origin) == Some(host));
    let is_known = || has_none || names.have(name_of(host)) || is_allowed();
    if (names.is_loopback || options.token.is_none()) && !is_known() {
        return Err(Refusal::Host);
    }
    // Programs do not send an origin; browsers always do where it matters.
    if let Some(origin) = text(headers, ORIGIN)
        && !is_own(origin, host)
        && !options.origins.iter().any(|allowed| allowed == origin)
    {
        return Err(Refusal::Origin);
    }
    match &options.token {
        Some(token) if needs_token => {
            let is_shown = shown_tokens(headers).any(|shown| token.is(shown));
            if is_shown { Ok(()) } else { Err(Refusal::Token) }
        }
        _ => Ok(()),
    }
}

/// What a refusal is about, for the log: the origin of the page, or the name by which the server was called.
pub(super) fn subject(headers: &HeaderMap, refusal: Refusal) -> Option<&str> {
    match refusal {
        Refusal::Origin => text(headers, ORIGIN),
        Refusal::Host => text(headers, HOST),
        Refusal::Hosts | Refusal::Token => None,
    }
}

/// Whether a page of an allowed origin has sent a request: by its Origin, or, where it embeds a picture, by
/// the page that it comes from.
pub(super) fn is_from_allowed(headers: &HeaderMap, options: &ServerOptions) -> bool {
    let is_of = |page: &str, origin: &str| {
        page.strip_prefix(origin).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let page = text(headers, ORIGIN).or_else(|| text(headers, REFERER));
    page.is_some_and(|page| options.origins.iter().any(|origin| is_of(page, origin)))
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name).map(|value| value.to_str().unwrap_or("?"))
}

/// Whether this is the origin of the server's own page, which comes over plain HTTP.
fn is_own(origin: &str, host: &str) -> bool {
    origin.strip_prefix("http://").is_some_and(|own| !own.is_empty() && own.eq_ignore_ascii_case(host))
}

/// Host and port of an origin, as a Host header has them.
fn host_of(origin: &str) -> Option<&str> {
    origin.split_once("://").map(|(_, host)| host)
}

/// A host without its port.
fn name_of(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    }
}

fn shown_tokens(headers: &HeaderMap) -> impl Iterator<Item = &[u8]> {
    let bearer = headers.get_all(AUTHORIZATION).iter().filter_map(|value| {
        let bytes = value.as_bytes();
        let (scheme, token) = bytes.split_at_checked("Bearer ".len())?;
        scheme.eq_ignore_ascii_case(b"Bearer ").then_some(token.trim_ascii())
    });
    let protocols = headers
        .get_all(SEC_WEBSOCKET_PROTOCOL)
        .iter()
        .flat_map(|value| value.as_bytes().split(|&byte| byte == b','))
        .filter_map(|name| name.trim_ascii().strip_prefix(TOKEN_PROTOCOL.as_bytes()));
    bearer.chain(protocols)
}

#[cfg(test)]
mod tests {
    use super::super::Token;
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect()
    }

    fn names(is_loopback: bool) -> Names {
        Names::new("studio:7300", is_loopback)
    }

    fn checked_at(
        version: Version,
        options: &ServerOptions,
        pairs: &[(&'static str, &'static str)],
    ) -> Result<(), Refusal> {
        check((version, &headers(pairs)), options, &names(true), true)
    }

    fn checked(options: &ServerOptions, pairs: &[(&'static str, &'static str)]) -> Result<(), Refusal> {
        checked_at(Version::HTTP_11, options, pairs)
    }

    #[test]
    fn a_server_goes_by_addresses_and_its_own_names() {
        let options = ServerOptions { origins: vec!["https://light.example".into()], ..Default::default() };
        for host in [
            "localhost:7300",
            "127.0.0.1:1",
            "127.0.1.1",
            "[::1]:80",
            "localhost",
            "[::1]",
            "studio:7300",
            "Studio",
            "LOCALHOST",
            "localhost.:7300",
            "studio.",
            "192.168.1.5:7300",
            "light.example",
        ] {
            assert_eq!(checked(&options, &[("host", host)]), Ok(()), "{host}");
        }
        let with_token = ServerOptions { token: Some(token()), ..options.clone() };
        for pairs in [&[("host", "evil.example:7300")][..], &[("host", "localhost.evil.example")], &[]] {
            assert_eq!(checked(&options, pairs), Err(Refusal::Host), "{pairs:?}");
            let check = |options: &ServerOptions, is_loopback| {
                check((Version::HTTP_11, &headers(pairs)), options, &names(is_loopback), false)
            };
            assert_eq!(check(&options, false), Err(Refusal::Host));
            assert_eq!(check(&with_token, true), Err(Refusal::Host));
            let elsewhere = check(&with_token, false);
            assert_eq!(elsewhere, Ok(()), "with a token it may have any name");
        }
    }

    fn token() -> Token {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        std::fs::write(&path, "0123456789abcdef").unwrap();
        Token::load(&path).unwrap()
    }

    #[test]
    fn pages_of_others_are_refused() {
        let options = ServerOptions { origins: vec!["https://studio.example".into()], ..Default::default() };
        let host = ("host", "localhost:7300");
        for origin in ["http://localhost:7300", "https://studio.example"] {
            assert_eq!(checked(&options, &[host, ("origin", origin)]), Ok(()), "{origin}");
        }
        for origin in [
            "http://localhost:7301",
            "https://localhost:7300",
            "http://studio.example",
            "null",
            "",
            "http://",
            "https://studio.example.evil",
        ] {
            assert_eq!(checked(&options, &[host, ("origin", origin)]), Err(Refusal::Origin), "{origin}");
        }
    }

    #[test]
    fn the_token_is_taken_from_either_place() {
        let options = ServerOptions { token: Some(token()), ..Default::default() };
        let host = ("host", "localhost");
        for shown in [
            ("authorization", "Bearer 0123456789abcdef"),
            ("authorization", "bearer 0123456789abcdef"),
            ("sec-websocket-protocol", "lightcast.v1.json, lightcast.token.0123456789abcdef"),
        ] {
            assert_eq!(checked(&options, &[host, shown]), Ok(()), "{shown:?}");
        }
        for shown in [
            ("authorization", "Bearer 0123456789abcdeF"),
            ("authorization", "Basic 0123456789abcdef"),
            ("authorization", "0123456789abcdef"),
            ("authorization", "Bearer "),
            ("sec-websocket-protocol", "lightcast.v1.json, lightcast.token.0123456789abcde"),
            ("sec-websocket-protocol", "0123456789abcdef"),
            ("x-token", "0123456789abcdef"),
        ] {
            assert_eq!(checked(&options, &[host, shown]), Err(Refusal::Token), "{shown:?}");
        }
        let anybody = check((Version::HTTP_11, &headers(&[host])), &options, &names(true), false);
        assert_eq!(anybody, Ok(()), "what anybody may see");
    }

    #[test]
    fn a_request_has_one_host_or_is_of_http_1_0() {
        let options = ServerOptions::default();
        assert_eq!(checked_at(Version::HTTP_10, &options, &[]), Ok(()));
        assert_eq!(checked_at(Version::HTTP_10, &options, &[("host", "evil.example")]), Err(Refusal::Host));
        let mut two = headers(&[("host", "localhost")]);
        two.append(HOST, "evil.example".parse().unwrap());
        let checked = check((Version::HTTP_11, &two), &options, &names(true), true);
        assert_eq!(checked.unwrap_err().status(), StatusCode::BAD_REQUEST);
    }

    #[test]
    fn pages_of_an_allowed_origin_are_told_by_their_origin_or_address() {
        let options = ServerOptions { origins: vec!["https://studio.example".into()], ..Default::default() };
        for (pair, is_allowed) in [
            (("origin", "https://studio.example"), true),
            (("referer", "https://studio.example/"), true),
            (("referer", "https://studio.example/page?a=b"), true),
            (("referer", "https://studio.example.evil/"), false),
            (("origin", "null"), false),
            (("accept", "https://studio.example"), false),
        ] {
            assert_eq!(is_from_allowed(&headers(&[pair]), &options), is_allowed, "{pair:?}");
        }
    }
}
