//! Sessions of Zenoh in plain Rust, which `benches/robots/measure` runs beside programs in ESL and in Python.
//!
//! ```text
//! zenoh_peer pong ADDRESS                               answers each message of `ping` by one of `pong`
//! zenoh_peer ping ADDRESS COUNT                         prints the microseconds of a way there and back
//! zenoh_peer flood ADDRESS KEY RATE SECONDS FILE        publishes the contents of a file
//! zenoh_peer count ADDRESS                              prints the messages of `data` until one of `end` comes, and the
//!                                                       microseconds of the processor for each
//! zenoh_peer router ADDRESS                             passes on what others publish and ask
//! ```
#![allow(clippy::print_stdout, reason = "this is a command")]

use std::error::Error;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use zenoh::{Config, Session, Wait};

/// Trips before the measurement.
const WARM_UP: u64 = 500;

type Outcome = Result<(), Box<dyn Error + Send + Sync>>;

fn open(mode: &str, side: &str, address: &str) -> Result<Session, Box<dyn Error + Send + Sync>> {
    let mut config = Config::default();
    config.insert_json5("mode", &format!("{mode:?}"))?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    config.insert_json5("listen/endpoints", "[]")?;
    config.insert_json5(&format!("{side}/endpoints"), &format!("[\"tcp/{address}\"]"))?;
    zenoh::open(config).wait()
}

fn pong(address: &str) -> Outcome {
    let session = open("peer", "listen", address)?;
    let answering = session.clone();
    let answer = move |sample: zenoh::sample::Sample| {
        // A session that is closed takes nothing.
        _ = answering.put("pong", sample.payload().clone()).wait();
    };
    let _subscriber = session.declare_subscriber("ping").callback(answer).wait()?;
    println!("ready");
    std::thread::park();
    Ok(())
}

fn ping(address: &str, count: u64) -> Outcome {
    let session = open("client", "connect", address)?;
    let (done, ended) = channel();
    let (sending, trips) = (session.clone(), AtomicU64::new(0));
    let again = move |sample: zenoh::sample::Sample| {
        let trip = trips.fetch_add(1, Ordering::Relaxed) + 1;
        if trip == WARM_UP || trip == WARM_UP + count {
            _ = done.send(Instant::now());
        }
        if trip < WARM_UP + count {
            _ = sending.put("ping", sample.payload().clone()).wait();
        }
    };
    let _subscriber = session.declare_subscriber("pong").callback(again).wait()?;
    // The other side learns of the subscription.
    std::thread::sleep(Duration::from_millis(500));
    session.put("ping", vec![7_u8; 64]).wait()?;
    let (begun, end) = (ended.recv()?, ended.recv()?);
    println!("{}", (end - begun).as_secs_f64() * 1e6 / count as f64);
    Ok(())
}

fn flood(address: &str, key: &str, rate: f64, seconds: f64, file: &str) -> Outcome {
    let payload = std::fs::read(file)?;
    let session = open("client", "connect", address)?;
    let publisher = session
        .declare_publisher(key.to_owned())
        .congestion_control(zenoh::qos::CongestionControl::Block)
        .wait()?;
    while !publisher.matching_status().wait()?.matching() {
        std::thread::sleep(Duration::from_millis(10));
    }
    let (begun, mut sent) = (Instant::now(), 0_u64);
    while begun.elapsed().as_secs_f64() < seconds {
        // As many as are due: the sleep of a millisecond is the resolution.
        while (sent as f64) < begun.elapsed().as_secs_f64() * rate {
            publisher.put(payload.clone()).wait()?;
            sent += 1;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    println!("{sent}");
    // The messages under way arrive.
    std::thread::sleep(Duration::from_millis(500));
    session.put("end", "end").wait()?;
    std::thread::sleep(Duration::from_millis(200));
    session.close().wait()
}

/// Returns the time of the processor that this process has taken, in microseconds, by the ticks of the system.
fn processor_time() -> Result<f64, Box<dyn Error + Send + Sync>> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    let fields = text.rsplit(") ").next().unwrap_or_default();
    let ticks = fields.split(' ').skip(11).take(2).map(str::parse::<f64>);
    Ok(ticks.sum::<Result<f64, _>>()? * 1e4)
}

fn count(address: &str) -> Outcome {
    let session = open("router", "listen", address)?;
    let (done, ended) = channel();
    let (taken, begun) = (std::sync::Arc::new(AtomicU64::new(0)), std::sync::OnceLock::new());
    let counted = taken.clone();
    let take = move |sample: zenoh::sample::Sample| {
        begun.get_or_init(|| processor_time().unwrap_or_default());
        if sample.key_expr().as_str() == "end" {
            _ = done.send(*begun.get_or_init(|| 0.0));
        } else {
            counted.fetch_add(1, Ordering::Relaxed);
        }
    };
    let _subscriber = session.declare_subscriber("*").callback(take).wait()?;
    println!("ready");
    let begun = ended.recv()?;
    let taken = taken.load(Ordering::Relaxed);
    println!("{taken} {}", (processor_time()? - begun) / taken.max(1) as f64);
    Ok(())
}

fn router(address: &str) -> Outcome {
    let _session = open("router", "listen", address)?;
    println!("ready");
    std::thread::park();
    Ok(())
}

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["pong", address] => pong(address),
        ["ping", address, count] => ping(address, count.parse()?),
        ["flood", address, key, rate, seconds, file] => {
            flood(address, key, rate.parse()?, seconds.parse()?, file)
        }
        ["count", address] => count(address),
        ["router", address] => router(address),
        _ => Err("expected pong, ping, flood, count or router, and its arguments".into()),
    }
}
