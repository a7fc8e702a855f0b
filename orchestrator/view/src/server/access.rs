//! Who may ask.

use super::Refused;
use super::connections::Trust;
use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use proto::digest::hex;
use sha2::{Digest as _, Sha256};
use std::sync::Arc;

/// Length of what opens a page.
const KEY_DIGITS: usize = 32;

/// What the page may do: run its own script and style, show pictures that it makes itself, ask this server.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What lets someone ask.
#[derive(Clone)]
pub struct Access {
    token: Arc<str>,
    port: u16,
}

impl Access {
    /// With a new token.
    pub(super) fn new(port: u16) -> std::io::Result<Self> {
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(std::io::Error::other)?;
        let token: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { token: token.into(), port })
    }

    /// The token.
    pub(super) fn token(&self) -> &str {
        &self.token
    }

    /// Lets requests pass that bring the token.
    pub fn guard<S: Clone + Send + Sync + 'static>(&self, calls: Router<S>) -> Router<S> {
        calls.layer(middleware::from_fn_with_state(self.clone(), with_token))
    }

    /// What lets someone open one page, of which nobody can guess the token or what opens another page: hexadecimal digits.
    #[must_use]
    pub fn key_of(&self, page: &str) -> String {
        let digest = Sha256::digest(format!("{} {page}", self.token));
        hex(&digest)[..KEY_DIGITS].to_owned()
    }

    fn is_here(&self, host: &str) -> bool {
        ["127.0.0.1", "localhost", "[::1]"]
            .iter()
            .any(|name| host.strip_prefix(name) == Some(&format!(":{}", self.port)))
    }
}

/// Lets requests pass that name this server as their host and as their origin, and forbids the page all that it does not need.
pub(super) async fn from_here(
    State(access): State<Access>,
    request: Request,
    next: Next,
) -> Response {
    let headers = request.headers();
    let refused = |text: String| Refused(StatusCode::FORBIDDEN, text).into_response();
    let host = text(headers, header::HOST);
    if !host.is_some_and(|host| access.is_here(host)) {
        let got = host.unwrap_or("none");
        return refused(format!("this server is at 127.0.0.1:{}, not at {got}", access.port));
    }
    // One that is no ASCII text is no origin of this server.
    let is_other = |origin: &HeaderValue| {
        let host = origin.to_str().ok().and_then(|origin| origin.strip_prefix("http://"));
        !host.is_some_and(|host| access.is_here(host))
    };
    if headers.get_all(header::ORIGIN).iter().any(is_other) {
        return refused("another site may not ask here".to_owned());
    }
    let mut response = next.run(request).await;
    // A page that is no part of the program has a policy of its own.
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ] {
        response.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Lets requests pass that bring the token.
async fn with_token(State(access): State<Access>, request: Request, next: Next) -> Response {
    let brought = text(request.headers(), header::AUTHORIZATION);
    let brought = brought.and_then(|value| value.strip_prefix("Bearer ")).unwrap_or_default();
    if !is_same(brought.as_bytes(), access.token.as_bytes()) {
        let text =
            "open the address that the program printed: its token is missing or of another run";
        return Refused(StatusCode::UNAUTHORIZED, text.to_owned()).into_response();
    }
    if let Some(trust) = request.extensions().get::<Trust>() {
        trust.has_token();
    }
    next.run(request).await
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// Whether two texts are the same. Compares in a time that does not depend on where both differ.
pub fn is_same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}
