//! The responses of the server: the page's files, and the upgrade to the websocket. GET and HEAD only.

use bytes::Bytes;
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use crate::access::Access;
use crate::assets::asset;

/// The headers of every response, in addition to [`policy`].
const HEADERS: [(HeaderName, &str); 6] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("permissions-policy"), "camera=(), microphone=(), geolocation=()"),
];

/// A response.
pub enum Reply {
    /// A complete response.
    Plain(Response<Full<Bytes>>),
    /// The connection becomes a websocket after it.
    Socket(Response<Full<Bytes>>),
}

/// The reply to a request; `is_full`: there is no place for another websocket.
pub fn reply(request: &Request<Incoming>, access: &Access, is_full: bool) -> Reply {
    let is_socket = request.uri().path() == "/ws";
    if let Err(text) = admit(request, access, is_socket) {
        return Reply::Plain(sentence(StatusCode::FORBIDDEN, &text));
    }
    let is_head = request.method() == Method::HEAD;
    if request.method() != Method::GET && !is_head {
        let mut refused = sentence(StatusCode::METHOD_NOT_ALLOWED, "GET and HEAD only");
        refused.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET, HEAD"));
        return Reply::Plain(refused);
    }
    if is_socket {
        return socket(request, is_full);
    }
    let mut found = match asset(request.uri().path()) {
        Some(file) => {
            let mut response = Response::new(Full::new(Bytes::from_static(if is_head { b"" } else { file.bytes })));
            let headers = response.headers_mut();
            headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(file.media));
            headers.insert(header::CONTENT_LENGTH, HeaderValue::from(file.bytes.len()));
            let cached = if file.is_hashed { "public, max-age=31536000, immutable" } else { "no-cache" };
            headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(cached));
            response
        }
        None => sentence(StatusCode::NOT_FOUND, "not found; the page is at /"),
    };
    // The request has been admitted: its Host is one of the server's names.
    guard(found.headers_mut(), only(request.headers(), header::HOST).ok().flatten());
    Reply::Plain(found)
}

/// Checks Host and Origin.
fn admit(request: &Request<Incoming>, access: &Access, is_socket: bool) -> Result<(), String> {
    let host = only(request.headers(), header::HOST)?;
    let origin = only(request.headers(), header::ORIGIN)?;
    // A request in a proxy's form names the server again.
    if let Some(authority) = request.uri().authority() {
        access.admits(Some(authority.as_str()), None, false).map_err(|denied| denied.to_string())?;
    }
    access.admits(host, origin, is_socket).map_err(|denied| denied.to_string())
}

/// The header's value; it may occur once, as text.
fn only(headers: &HeaderMap, name: HeaderName) -> Result<Option<&str>, String> {
    let mut values = headers.get_all(&name).iter();
    let first = values.next().map(|value| value.to_str().map_err(|_| format!("{name} is not text"))).transpose()?;
    match values.next() {
        Some(_) => Err(format!("{name} is given twice")),
        None => Ok(first),
    }
}

/// The handshake of the websocket (RFC 6455, section 4.2).
fn socket(request: &Request<Incoming>, is_full: bool) -> Reply {
    let headers = request.headers();
    let contains = |name: HeaderName, word: &str| {
        let values =
            headers.get_all(name).iter().filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(','));
        values.map(str::trim).any(|value| value.eq_ignore_ascii_case(word))
    };
    let key = headers.get(header::SEC_WEBSOCKET_KEY).filter(|key| key.len() == 24);
    let asks = request.method() == Method::GET
        && contains(header::CONNECTION, "upgrade")
        && contains(header::UPGRADE, "websocket")
        && contains(header::SEC_WEBSOCKET_VERSION, "13");
    let Some(key) = key.filter(|_| asks) else {
        let mut refused = sentence(StatusCode::UPGRADE_REQUIRED, "this is the page's websocket");
        refused.headers_mut().insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        refused.headers_mut().insert(header::SEC_WEBSOCKET_VERSION, HeaderValue::from_static("13"));
        return Reply::Plain(refused);
    };
    if is_full {
        return Reply::Plain(sentence(StatusCode::SERVICE_UNAVAILABLE, "too many pages are open"));
    }
    let mut response = Response::new(Full::default());
    *response.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
    let headers = response.headers_mut();
    headers.insert(header::CONNECTION, HeaderValue::from_static("Upgrade"));
    headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
    // Base64 is ASCII.
    if let Ok(accept) = HeaderValue::from_str(&derive_accept_key(key.as_bytes())) {
        headers.insert(header::SEC_WEBSOCKET_ACCEPT, accept);
    }
    Reply::Socket(response)
}

/// A response of one sentence.
fn sentence(status: StatusCode, text: &str) -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::new(Bytes::from(format!("{text}\n"))));
    *response.status_mut() = status;
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    // After a refusal the connection is closed.
    response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    guard(response.headers_mut(), None);
    response
}

/// The page loads and runs the server's files only, and cannot be framed. `host` is the server's own name, for browsers that do not count
/// its websocket among 'self'.
fn policy(host: Option<&str>) -> String {
    let socket = host.map_or(String::new(), |host| format!(" ws://{host}"));
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; connect-src 'self'{socket}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
}

fn guard(headers: &mut HeaderMap, host: Option<&str>) {
    if let Ok(policy) = HeaderValue::from_str(&policy(host)) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
}
