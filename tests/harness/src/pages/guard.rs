//! Who may ask: those who know the token, on this server's own name, from its own pages.
//!
//! # Model
//! Every path begins with the token, 128 random bits that are only in the printed address. A name that was made to
//! point here (DNS rebinding) is refused by its Host; a foreign page's request by its Origin. Both are checked
//! although the token alone would do: it may end up in a history or a screenshot.

use std::net::{IpAddr, SocketAddr};

use anyhow::{Result, anyhow};
use axum::http::{HeaderMap, Method, StatusCode, header};

/// The secret part of an address: 32 hexadecimal digits.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// # Errors
    /// The system has no random numbers.
    pub fn random() -> Result<Self> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes).map_err(|e| anyhow!("no random numbers for the address: {e}"))?;
        Ok(Self(bytes.iter().map(|b| format!("{b:02x}")).collect()))
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Takes as long for every wrong guess of the right length.
    fn is(&self, guess: &str) -> bool {
        let differs = self.0.bytes().zip(guess.bytes()).fold(0, |differs, (a, b)| differs | (a ^ b));
        guess.len() == self.0.len() && differs == 0
    }
}

/// A request that is not answered, and what its sender can do.
pub type Refusal = (StatusCode, &'static str);

/// Checks a request to the server at `own`.
///
/// # Errors
/// The first of Host, Origin and token that is wrong.
pub fn admit(own: SocketAddr, token: &Token, method: &Method, path: &str, headers: &HeaderMap) -> Result<(), Refusal> {
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
    let host = text(header::HOST).unwrap_or_default();
    if headers.get_all(header::HOST).iter().count() != 1 || !is_own_name(own, host) {
        return Err((StatusCode::FORBIDDEN, "this host name is not the server's; open the address that it printed\n"));
    }
    let origin = text(header::ORIGIN);
    let changes = !matches!(*method, Method::GET | Method::HEAD);
    if origin.is_some_and(|origin| origin.strip_prefix("http://") != Some(host)) || (changes && origin.is_none()) {
        return Err((StatusCode::FORBIDDEN, "only the server's own pages may ask this\n"));
    }
    if text(header::HeaderName::from_static("sec-fetch-site")).is_some_and(|site| site == "cross-site") && changes {
        return Err((StatusCode::FORBIDDEN, "only the server's own pages may ask this\n"));
    }
    let first = path.strip_prefix('/').and_then(|path| path.split('/').next()).unwrap_or_default();
    if !token.is(first) {
        return Err((
            StatusCode::FORBIDDEN,
            "the address lacks the server's token; open the address that it printed\n",
        ));
    }
    Ok(())
}

/// Whether a Host is an address of this server, as numbers or as `localhost`; other names may be anybody's.
fn is_own_name(own: SocketAddr, host: &str) -> bool {
    let Some(name) = host.strip_suffix(&format!(":{}", own.port())) else { return false };
    if name == "localhost" {
        return true;
    }
    let number = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    number.parse::<IpAddr>().is_ok_and(|ip| ip == own.ip() || ip.is_loopback() || own.ip().is_unspecified())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef0123456789abcdef";

    fn ask(method: Method, path: &str, headers: &[(&'static str, &str)]) -> Result<(), Refusal> {
        let own = "127.0.0.1:8000".parse().unwrap();
        let headers = headers.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect();
        admit(own, &Token(TOKEN.to_owned()), &method, path, &headers)
    }

    #[test]
    fn the_pages_themselves_are_admitted() {
        let path = format!("/{TOKEN}/labels");
        assert!(ask(Method::GET, &path, &[("host", "127.0.0.1:8000")]).is_ok());
        assert!(ask(Method::GET, &path, &[("host", "[::1]:8000")]).is_ok());
        assert!(ask(Method::PUT, &path, &[("host", "localhost:8000"), ("origin", "http://localhost:8000")]).is_ok());
    }

    #[test]
    fn a_foreign_host_is_refused_even_with_the_token() {
        let path = format!("/{TOKEN}/");
        for host in ["evil.example:8000", "127.0.0.1:8001", "127.0.0.1", "localhost.evil:8000", "10.0.0.1:8000", ""] {
            assert!(ask(Method::GET, &path, &[("host", host)]).is_err(), "{host}");
        }
        assert!(ask(Method::GET, &path, &[]).is_err());
        assert!(ask(Method::GET, &path, &[("host", "127.0.0.1:8000"), ("host", "127.0.0.1:8000")]).is_err(), "two");
    }

    #[test]
    fn a_foreign_or_missing_origin_changes_nothing() {
        let path = format!("/{TOKEN}/labels");
        let host = ("host", "127.0.0.1:8000");
        for origin in ["http://evil.example", "null", "https://127.0.0.1:8000", "http://127.0.0.1:8001"] {
            assert!(ask(Method::PUT, &path, &[host, ("origin", origin)]).is_err(), "{origin}");
            assert!(ask(Method::GET, &path, &[host, ("origin", origin)]).is_err(), "{origin}");
        }
        assert!(ask(Method::PUT, &path, &[host]).is_err());
    }

    #[test]
    fn without_the_whole_token_nothing_is_answered() {
        for path in ["/", "", "/labels", &format!("/{}/", &TOKEN[..31]), &format!("/{TOKEN}0/"), &format!("//{TOKEN}/")]
        {
            assert!(ask(Method::GET, path, &[("host", "127.0.0.1:8000")]).is_err(), "{path}");
        }
        assert!(Token::random().unwrap().0 != Token::random().unwrap().0);
    }

    #[test]
    fn a_server_on_all_addresses_is_asked_by_number_only() {
        let own = "0.0.0.0:8000".parse().unwrap();
        assert!(is_own_name(own, "192.168.1.7:8000") && !is_own_name(own, "evil.example:8000"));
        assert!(!is_own_name("192.168.1.7:8000".parse().unwrap(), "192.168.1.8:8000"));
    }
}
