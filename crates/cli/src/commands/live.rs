//! Watching a ride while it goes on: where it is served, and how fast it goes.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::str::FromStr;
use std::thread;
use std::time::{Duration, Instant};

use bikebot_sim::clock::SimTime;
use bikebot_sim::record::{Event, RecordError, Recorder};

use crate::interrupt;

/// Where viewers look by default.
pub const PORT: u16 = 8765;

/// An address to serve on: `ADDR:PORT`, `ADDR`, `:PORT` or `PORT`.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let local = IpAddr::V4(Ipv4Addr::LOCALHOST);
    let plain = text.replacen("localhost", "127.0.0.1", 1);
    let port = plain.strip_prefix(':').unwrap_or(&plain);
    if let Ok(address) = plain.parse::<SocketAddr>() {
        Ok(address)
    } else if let Ok(ip) = plain.parse::<IpAddr>() {
        Ok(SocketAddr::new(ip, PORT))
    } else if let Ok(port) = port.parse::<u16>() {
        Ok(SocketAddr::new(local, port))
    } else {
        Err(format!(
            "`{text}` is not an address; say ADDR:PORT, like 127.0.0.1:{PORT}, and name the scenario before --live"
        ))
    }
}

/// How fast simulated time goes by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// So many simulated seconds each second, if the machine can.
    Times(f64),
    /// As fast as it goes.
    Max,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Self::Max);
        }
        match text.parse::<f64>() {
            // Slower than this a tick would take hours.
            Ok(speed) if speed.is_finite() && speed >= 1e-6 => Ok(Self::Times(speed)),
            Ok(_) => Err("it must be a finite number above 0, or max".into()),
            Err(_) => Err(format!(
                "`{text}` is not a number; 1 is real time, 2 twice as fast, max as fast as it goes"
            )),
        }
    }
}

/// A recorder that keeps to the clock on the wall: an event is passed on when its time has come.
pub struct Paced<R> {
    inner: R,
    speed: Speed,
    /// When simulated time 0 was; from the first event after it, since planning takes its own time.
    began: Option<Instant>,
}

impl<R: Recorder> Paced<R> {
    /// Passes on to `inner`.
    pub fn new(inner: R, speed: Speed) -> Self {
        Self {
            inner,
            speed,
            began: None,
        }
    }

    /// The recorder behind it.
    pub fn into_inner(self) -> R {
        self.inner
    }

    fn wait_until(&mut self, time: SimTime) {
        let Speed::Times(speed) = self.speed else {
            return;
        };
        if time == SimTime::ZERO {
            return;
        }
        let began = *self.began.get_or_insert_with(Instant::now);
        let Ok(due) = Duration::try_from_secs_f64(time.seconds() / speed) else {
            return;
        };
        // In short naps, so that Ctrl-C is heard.
        while !interrupt::asked() {
            let left = due.saturating_sub(began.elapsed());
            if left.is_zero() {
                return;
            }
            thread::sleep(left.min(Duration::from_millis(50)));
        }
    }
}

impl<R: Recorder> Recorder for Paced<R> {
    fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
        self.wait_until(time);
        self.inner.record(time, event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_taken_as_people_write_them() {
        for (text, wanted) in [
            ("0.0.0.0:9000", "0.0.0.0:9000"),
            ("192.168.1.7", "192.168.1.7:8765"),
            ("localhost", "127.0.0.1:8765"),
            ("localhost:1", "127.0.0.1:1"),
            (":9000", "127.0.0.1:9000"),
            ("9000", "127.0.0.1:9000"),
            ("[::1]:9000", "[::1]:9000"),
        ] {
            assert_eq!(address(text).map(|it| it.to_string()), Ok(wanted.into()));
        }
        for text in ["ride.toml", "", "1.2.3.4:70000", "70000", ":"] {
            assert!(address(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_speed_is_a_number_above_nothing_or_max() {
        assert_eq!("max".parse(), Ok(Speed::Max));
        assert_eq!("0.5".parse(), Ok(Speed::Times(0.5)));
        for text in ["0", "-1", "nan", "inf", "fast", "1e-9"] {
            assert!(text.parse::<Speed>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_ride_takes_as_long_as_it_is_told_to() {
        let mut paced = Paced::new((), Speed::Times(10.0));
        let began = Instant::now();
        let event = Event::Log {
            level: bikebot_sim::record::LogLevel::Info,
            text: "",
        };
        for step in 0..=10 {
            let time = SimTime::from_nanoseconds(100_000_000 * step);
            paced.record(time, &event).unwrap();
        }
        // 0.9 s after the first event beyond 0, ten times as fast: never shorter, however busy the machine is.
        assert!(began.elapsed() >= Duration::from_millis(90));
    }
}
