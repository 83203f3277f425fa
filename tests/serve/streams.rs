//! The contents of streams.

use crate::connection::{Posting, close_code, connect, get, list, next_json};
use lightcast::net::{Client, ClientOptions, ServerOptions};
use lightcast::rt::{Metrics, Shutdown, monotonic_ns};
use lightcast::wire::{Message as List, Subscription, binary, json, write_list};
use std::net::TcpStream;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::client_with_config;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;

#[test]
fn a_client_gets_the_newest_list_at_once_and_then_every_list() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..10);
    let mut client = posting.client("queue=64");
    assert_eq!(next_json(&mut client)["sequence"], 9);
    for sequence in 10..200 {
        posting.post(sequence..sequence + 1);
        let message = next_json(&mut client);
        assert_eq!((message["sequence"].as_u64(), &message["stream"]["lost"]), (Some(sequence), &0.into()));
    }
}

#[test]
fn messages_say_when_their_frame_was_captured_and_when_they_were_sent() {
    let posting = Posting::new(ServerOptions::default());
    let before_ns = monotonic_ns();
    posting.post(5..6);
    let message = next_json(&mut posting.client(""));
    let time_ns = |key: &str| message["stream"][key].as_i64().unwrap();
    assert_eq!(time_ns("capture_monotonic_ns"), 5 * 40_000_000, "the epoch of this test is 0");
    assert!((before_ns..=monotonic_ns()).contains(&time_ns("sent_monotonic_ns")));
    let offset_ns = time_ns("sent_utc_ns") - time_ns("sent_monotonic_ns");
    assert_eq!(time_ns("capture_utc_ns") - time_ns("capture_monotonic_ns"), offset_ns);
    let year_2020_ns = 1_577_836_800_000_000_000;
    assert!(time_ns("sent_utc_ns") > year_2020_ns);
}

#[test]
fn the_json_of_a_message_without_its_last_key_is_the_line_of_the_list() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(7..8);
    let mut client = posting.client("");
    let Message::Text(text) = client.read().unwrap() else { panic!("no text") };
    let (head, _) = text.rsplit_once(",\"stream\":").unwrap();
    let mut line = Vec::new();
    write_list(&list(7, 100), &mut line).unwrap();
    assert_eq!(format!("{head}}}"), String::from_utf8(line).unwrap());
    assert_eq!(get(posting.address(), "/lights", &[]), (200, format!("{head}}}")));
}

/// A client that refuses longer frames gets the list whole, in several of them.
#[test]
fn a_long_list_comes_in_frames_that_bound_what_a_slow_client_holds() {
    let posting = Posting::new(ServerOptions::default());
    let whole = list(7, 16_000);
    posting.post_list(whole.clone());
    let config = WebSocketConfig::default().max_frame_size(Some(1 << 16));
    for protocol in ["lightcast.v1.json", "lightcast.v1.bin"] {
        let stream = TcpStream::connect(posting.address()).unwrap();
        let request = posting.request("", protocol);
        let (mut socket, _) = client_with_config(request, stream, Some(config)).unwrap();
        let received = socket.read().unwrap();
        let mut found = List::default();
        match &received {
            Message::Text(text) => json::decode(text.as_bytes(), &mut found).unwrap(),
            Message::Binary(bytes) => binary::decode(bytes, &mut found).unwrap(),
            _ => panic!("no list: {received:?}"),
        }
        assert_eq!(found.list.lights.len(), 16_000);
        if received.is_text() {
            assert_eq!(found.list.lights, whole.lights);
        }
    }
}

#[test]
fn each_client_takes_what_it_needs_and_may_change_its_mind() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..1);
    let mut few = posting.client("lights=8");
    let mut good = posting.client("error=0.02");
    assert_eq!(next_json(&mut few)["lights"].as_array().unwrap().len(), 8);
    assert_eq!(next_json(&mut good)["lights"].as_array().unwrap().len(), 32, "the first under 0.02");
    few.send(Message::text("{\"subscribe\":{\"lights\":16,\"queue\":64}}")).unwrap();
    let answer = next_json(&mut few);
    assert_eq!(answer["subscribed"]["lights"], 16, "{answer}");
    posting.post(1..2);
    let message = next_json(&mut few);
    assert_eq!(message["lights"].as_array().unwrap().len(), 16);
    assert_eq!(message["power"], serde_json::to_value(list(1, 100).power).unwrap());
    few.send(Message::text("{\"subscribe\":{\"lights\":0}}")).unwrap();
    let answer = next_json(&mut few);
    assert!(answer["error"].as_str().unwrap().contains("lights: give 1 to"), "{answer}");
    posting.post(2..3);
    assert_eq!(next_json(&mut few)["lights"].as_array().unwrap().len(), 16, "as before");
}

#[test]
fn a_lower_rate_is_kept() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("rate_hz=5&queue=64");
    posting.wait_for_clients(1.0);
    posting.post(0..51);
    let got: Vec<u64> = (0..11).map(|_| next_json(&mut client)["sequence"].as_u64().unwrap()).collect();
    assert_eq!(got, (0..=50).step_by(5).collect::<Vec<u64>>());
}

#[test]
fn a_client_that_does_not_read_skips_to_the_newest_learns_its_loss_and_holds_up_nobody() {
    let posting = Posting::new(ServerOptions::default());
    let mut slow = posting.client("");
    let mut quick = posting.client("queue=64");
    posting.wait_for_clients(2.0);
    // 20 MB: far more than the kernel buffers for a client.
    for sequence in 0..2000 {
        posting.post(sequence..sequence + 1);
        let message = next_json(&mut quick);
        assert_eq!((message["sequence"].as_u64(), &message["stream"]["lost"]), (Some(sequence), &0.into()));
    }
    let (mut received, mut lost, mut last) = (0, 0, 0);
    while last != 1999 {
        let message = next_json(&mut slow);
        let (sequence, missed) =
            (message["sequence"].as_u64().unwrap(), message["stream"]["lost"].as_u64().unwrap());
        received += 1;
        lost += missed;
        assert_eq!(received + lost, sequence + 1, "every list came or is counted");
        last = sequence;
    }
    assert!(lost > 500, "{lost} lost: it was not slow");
    assert_eq!(posting.metric("lightcast_stage_drops_total{stage=\"serve\"}"), lost as f64);
}

#[test]
fn when_the_server_ends_clients_get_the_rest_and_a_reason() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("queue=64");
    posting.wait_for_clients(1.0);
    // As many as the kernel buffers for a client that reads only afterwards.
    posting.post(0..5);
    posting.stop();
    for sequence in 0..5 {
        assert_eq!(next_json(&mut client)["sequence"], sequence);
    }
    assert_eq!(close_code(&mut client), 1001);
}

#[test]
fn new_rules_make_clients_come_again() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("");
    posting.wait_for_clients(1.0);
    posting.server().set_options(ServerOptions::default());
    posting.server().set_options(ServerOptions { clients_max: 1, ..ServerOptions::default() });
    assert_eq!(close_code(&mut client), 1001);
    drop(client);
    posting.wait_for_clients(0.0);
    let _first = posting.client("");
    let refused = connect(posting.request("", "lightcast.v1.bin"), posting.address());
    assert!(refused.unwrap_err().to_string().contains("503"));
}

/// Receives `count` lists with the program's own client from a server that posts them.
fn taken(is_binary: bool, count: u64) -> Vec<List> {
    let posting = Posting::new(ServerOptions::default());
    let mut options = ClientOptions::new(&posting.address().to_string()).unwrap();
    options.is_binary = is_binary;
    options.subscription = Subscription { queue: 64, ..Subscription::default() };
    let taken = Arc::new(Mutex::new(Vec::new()));
    let kept = taken.clone();
    let client = Client::start(options, &Metrics::new("client"), &Shutdown::new(), move |message| {
        let mut kept = kept.lock().unwrap();
        kept.push(message.clone());
        Ok((kept.len() as u64) < count)
    });
    posting.wait_for_clients(1.0);
    let mut posted = 0;
    client
        .unwrap()
        .join(Duration::from_millis(1), || {
            if posted < count {
                posting.post(posted..posted + 1);
                posted += 1;
            }
        })
        .unwrap();
    Arc::into_inner(taken).unwrap().into_inner().unwrap()
}

#[test]
fn the_programs_client_gets_what_was_posted_to_the_byte_as_json_and_rounded_as_bytes() {
    let json = taken(false, 100);
    assert_eq!(json.len(), 100);
    for (sequence, message) in json.iter().enumerate() {
        let (mut line, mut expected) = (Vec::new(), Vec::new());
        write_list(&message.list, &mut line).unwrap();
        write_list(&list(sequence as u64, 100), &mut expected).unwrap();
        assert_eq!(line, expected);
    }
    for (message, exact) in taken(true, 100).iter().zip(&json) {
        let (mut body, mut bytes, mut expected) = (Vec::new(), Vec::new(), List::default());
        binary::encode_list(&exact.list, &mut body).unwrap();
        binary::encode(&body, &message.delivery, &mut bytes);
        binary::decode(&bytes, &mut expected).unwrap();
        assert_eq!(message.list, expected.list);
        assert_eq!(message.list.power, exact.list.power);
    }
}
