//! A server of pages: one thread, one address with a token, until it is stopped.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};

use anyhow::{Context, Result};
use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};

use super::guard::{self, Token};
use super::patience::Patient;

/// Only this machine.
pub const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

/// What every answer says: nothing from elsewhere, in no other page's frame, kept by nobody.
const HEADERS: [(header::HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'self'; img-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
];

/// A port that is taken, and the address that leads to it.
pub struct Server {
    listener: TcpListener,
    own: SocketAddr,
    token: Token,
}

impl Server {
    /// Takes a port; 0 for any that is free.
    ///
    /// # Errors
    /// The address is not this machine's, or the port is taken.
    pub fn bind(ip: IpAddr, port: u16) -> Result<Self> {
        let at = SocketAddr::new(ip, port);
        let listener = TcpListener::bind(at).with_context(|| format!("cannot serve pages at {at}"))?;
        let own = listener.local_addr().with_context(|| format!("cannot serve pages at {at}"))?;
        Ok(Self { listener, own, token: Token::random()? })
    }

    /// The address to open.
    pub fn url(&self) -> String {
        format!("http://{}{}", self.own, self.path("/"))
    }

    /// A path as it is asked for, with the token.
    pub fn path(&self, path: &str) -> String {
        format!("/{}{path}", self.token.as_str())
    }

    /// Answers until the program ends. Paths of the routes are those of [`Server::path`].
    ///
    /// # Errors
    /// The port is lost.
    pub fn serve(self, routes: Router) -> Result<()> {
        let Self { listener, own, token } = self;
        let routes = routes.fallback(missing).layer(from_fn_with_state((own, token), admit));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        runtime.context("cannot start the server")?.block_on(async {
            listener.set_nonblocking(true)?;
            axum::serve(Patient(tokio::net::TcpListener::from_std(listener)?), routes).await
        })?;
        Ok(())
    }
}

async fn admit(State((own, token)): State<(SocketAddr, Token)>, request: Request, next: Next) -> Response {
    let admitted = guard::admit(own, &token, request.method(), request.uri().path(), request.headers());
    let mut response = match admitted {
        Ok(()) => next.run(request).await,
        Err(refusal) => refusal.into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn missing() -> (StatusCode, &'static str) {
    (StatusCode::NOT_FOUND, "there is nothing here\n")
}
