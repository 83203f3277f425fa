//! The server's answers to HTTP requests.

use super::access::{self, Refusal};
use super::metrics;
use super::page;
use super::places::Visit;
use super::session::Session;
use super::shared::{EncodedMap, Peer, Shared};
use super::upgrade::{Upgrade, protocol};
use crate::error::{Error, Result};
use crate::files::encode_map_exr;
use crate::picture::encode_map_png;
use crate::wire::{self, Subscription};
use axum::extract::{RawQuery, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_TYPE, RETRY_AFTER, SEC_WEBSOCKET_VERSION, WWW_AUTHENTICATE,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use lightcast_core::image::PolarMap;
use std::sync::Arc;
use std::time::Duration;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;

/// A server whose newest list is older than this, and than five frames, is not ready.
const READY_WITHIN: Duration = Duration::from_secs(5);

/// Where the program says how it is.
const HEALTH: [&str; 2] = ["/healthz", "/readyz"];

/// Number of the newest item in its sequence.
const SEQUENCE: HeaderName = HeaderName::from_static("lightcast-sequence");
/// Not among the names that the library has.
const CROSS_ORIGIN_RESOURCE_POLICY: HeaderName = HeaderName::from_static("cross-origin-resource-policy");
/// Polar angle of the lower rim of a map.
const THETA_MAX_RAD: HeaderName = HeaderName::from_static("lightcast-theta-max-rad");

pub(super) fn router(shared: &Arc<Shared>) -> Router {
    let protected = Router::new()
        .route("/ws", get(stream))
        .route("/lights", get(lights))
        .route("/map.png", get(map_png))
        .route("/map.exr", get(map_exr))
        .route("/metrics", get(metrics))
        .route_layer(middleware::from_fn_with_state(shared.clone(), needs_token));
    Router::new()
        .route(HEALTH[0], get(|| async { "ok\n" }))
        .route(HEALTH[1], get(ready))
        .merge(page::router())
        .merge(protected)
        .fallback(|| async { refused(StatusCode::NOT_FOUND, "there is nothing of this name here") })
        .layer(middleware::from_fn_with_state(shared.clone(), needs_no_token))
        .with_state(shared.clone())
}

async fn needs_token(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    check(&shared, true, request, next).await
}

async fn needs_no_token(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let is_for_health = request.extensions().get::<Arc<Visit>>().is_some_and(|visit| visit.is_for_health);
    let is_busy = is_for_health && !HEALTH.contains(&request.uri().path());
    let is_allowed = access::is_from_allowed(request.headers(), &shared.options());
    let mut response = if is_busy {
        shared.counters.refused.add(1);
        refused(StatusCode::SERVICE_UNAVAILABLE, "all connections are busy; try again later")
    } else {
        check(&shared, false, request, next).await
    };
    let is_upgrade = response.status() == StatusCode::SWITCHING_PROTOCOLS;
    let headers = response.headers_mut();
    if !is_upgrade {
        // A page requests maps again and again: if its connections were kept alive, a few pages would take
        // all connection slots.
        headers.insert(CONNECTION, HeaderValue::from_static("close"));
    }
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.entry(CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    // Against pages from other sites that embed pictures, for which browsers send no origin.
    let who = if is_allowed { "cross-origin" } else { "same-origin" };
    headers.insert(CROSS_ORIGIN_RESOURCE_POLICY, HeaderValue::from_static(who));
    response
}

async fn check(shared: &Shared, needs_token: bool, request: Request, next: Next) -> Response {
    let options = shared.options();
    let peer = request.extensions().get::<Peer>().copied();
    match access::check((request.version(), request.headers()), &options, &shared.names, needs_token) {
        Ok(()) => next.run(request).await,
        Err(refusal) => {
            shared.counters.refused.add(1);
            if let Some(subject) = access::subject(request.headers(), refusal) {
                shared.tell_of_refused(refusal, subject);
            }
            let mut response = refused(refusal.status(), refusal.reason());
            if refusal == Refusal::Token {
                shared.tell_of_stranger(peer);
                response.headers_mut().insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
            }
            response
        }
    }
}

/// A refusal with one sentence for the reader.
fn refused(status: StatusCode, reason: impl Into<String>) -> Response {
    (status, reason.into() + "\n").into_response()
}

fn not_yet(what: &str) -> Response {
    let mut response = refused(StatusCode::SERVICE_UNAVAILABLE, format!("there is no {what} yet"));
    response.headers_mut().insert(RETRY_AFTER, HeaderValue::from_static("1"));
    response
}

async fn stream(
    State(shared): State<Arc<Shared>>,
    Extension(Peer(peer)): Extension<Peer>,
    Extension(visit): Extension<Arc<Visit>>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Response {
    let subscription = match Subscription::from_query(query.as_deref().unwrap_or("")) {
        Ok(subscription) => subscription,
        Err(error) => return refused(StatusCode::BAD_REQUEST, error.to_string()),
    };
    let protocol = protocol(request.headers(), [wire::BINARY, wire::JSON]);
    let upgrade = match Upgrade::of(request) {
        Ok(upgrade) => upgrade,
        Err(error) => {
            let mut response = refused(StatusCode::UPGRADE_REQUIRED, format!("lists are streamed: {error}"));
            response.headers_mut().insert(SEC_WEBSOCKET_VERSION, HeaderValue::from_static("13"));
            return response;
        }
    };
    let Some(protocol) = protocol else {
        let reason = format!("name a subprotocol: {} or {}", wire::JSON, wire::BINARY);
        return refused(StatusCode::BAD_REQUEST, reason);
    };
    let phase = shared.phase();
    let options = shared.options();
    let Some(slot) = shared.admit(options.clients_max) else {
        shared.counters.refused.add(1);
        return refused(StatusCode::SERVICE_UNAVAILABLE, "all connection slots are taken; try again later");
    };
    visit.becomes_stream();
    let config = WebSocketConfig::default()
        .max_message_size(Some(wire::DEMAND_MAX_BYTES))
        .max_frame_size(Some(wire::DEMAND_MAX_BYTES))
        // The buffer is cleared before every read, for every client.
        .read_buffer_size(wire::DEMAND_MAX_BYTES);
    upgrade.with_protocol(protocol).begin(config, move |socket| async move {
        let is_binary = protocol == wire::BINARY;
        let session = Session::new(socket, &shared, visit, phase, subscription, is_binary, options.patience);
        session.run(peer).await;
        drop(slot);
    })
}

async fn lights(State(shared): State<Arc<Shared>>, RawQuery(query): RawQuery) -> Response {
    let subscription = match Subscription::from_query(query.as_deref().unwrap_or("")) {
        Ok(subscription) => subscription,
        Err(error) => return refused(StatusCode::BAD_REQUEST, error.to_string()),
    };
    let Some((post, _)) = shared.board.newest() else { return not_yet("list") };
    let Some(body) = shared.board.body(&post, &subscription, false) else {
        return refused(StatusCode::INTERNAL_SERVER_ERROR, "the newest list cannot be put into JSON");
    };
    let sequence = HeaderValue::from(post.list.stamp.sequence);
    let kind = HeaderValue::from_static("application/json");
    ([(CONTENT_TYPE, kind), (SEQUENCE, sequence)], body).into_response()
}

async fn map_png(State(shared): State<Arc<Shared>>) -> Response {
    map(&shared, 0, "image/png", encode_map_png).await
}

async fn map_exr(State(shared): State<Arc<Shared>>) -> Response {
    map(&shared, 1, "image/x-exr", encode_map_exr).await
}

/// The newest map as a file. Encoding takes milliseconds: it is done once for all clients that request the
/// same map, one at a time, and not on the thread that streams. It continues when its client has gone, and
/// the next client still waits for it.
async fn map(
    shared: &Arc<Shared>,
    kept: usize,
    kind: &'static str,
    encode: fn(&PolarMap) -> Result<Vec<u8>>,
) -> Response {
    let mut kept = shared.maps[kept].clone().lock_owned().await;
    let board = shared.board.clone();
    let encoded = tokio::task::spawn_blocking(move || -> Result<Option<EncodedMap>> {
        let Some(number) = board.map_number() else { return Ok(None) };
        if kept.as_ref().is_none_or(|kept| kept.number != number)
            && let Some((number, map)) = board.map()
        {
            *kept = Some(EncodedMap {
                number,
                sequence: map.stamp.sequence,
                theta_max_rad: map.shape.theta_max_rad(),
                bytes: encode(&map)?.into(),
            });
        }
        Ok(kept.clone())
    });
    let encoded = match encoded.await {
        Ok(Ok(Some(encoded))) => encoded,
        Ok(Ok(None)) => return not_yet("map"),
        Ok(Err(error)) => return failed(&error),
        Err(error) => return failed(&Error::failed("the map cannot be encoded").because(error)),
    };
    let theta_max = HeaderValue::try_from(encoded.theta_max_rad.to_string());
    let headers = [
        (CONTENT_TYPE, HeaderValue::from_static(kind)),
        (SEQUENCE, HeaderValue::from(encoded.sequence)),
        (THETA_MAX_RAD, theta_max.unwrap_or(HeaderValue::from_static(""))),
    ];
    (headers, encoded.bytes).into_response()
}

async fn metrics(State(shared): State<Arc<Shared>>) -> Response {
    match metrics::text(&shared) {
        Ok(text) => ([(CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response(),
        Err(error) => failed(&Error::failed("the figures cannot be put into text").because(error)),
    }
}

/// Whether lists flow.
async fn ready(State(shared): State<Arc<Shared>>) -> Response {
    let Some((post, posted_at)) = shared.board.newest() else { return not_yet("list") };
    let rate_hz = post.list.stamp.frame_rate_hz;
    let five_frames = Duration::try_from_secs_f64(5.0 / rate_hz).unwrap_or(READY_WITHIN);
    let age = posted_at.elapsed();
    if age > READY_WITHIN.max(five_frames) {
        let reason = format!("the newest list is {:.1} s old", age.as_secs_f64());
        return refused(StatusCode::SERVICE_UNAVAILABLE, reason);
    }
    "lists flow\n".into_response()
}

fn failed(error: &Error) -> Response {
    tracing::error!("{error}");
    refused(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
}
