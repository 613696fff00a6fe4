//! The messages of the recording, served to viewers while the ride goes on: Foxglove's WebSocket protocol.
//!
//! A [`McapRecorder`](super::McapRecorder) that is [given a server](super::McapRecorder::with_live) hands it every message it
//! writes, the same bytes on the same topics with the same simulated times. What a viewer sees is what the file holds.
//!
//! Nobody waits for a viewer: each has a queue of [`LiveOptions::backlog`] messages, and one that reads too slowly loses the oldest of
//! them. What stands (map, plan, belief, obstacles) is sent again to whoever subscribes later, so it may come at any time.
//! This is the one place of the crate that opens a socket; who is served, and when, never changes a run.

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel};
use foxglove::{WebSocketServer, WebSocketServerHandle};
use thiserror::Error;

use super::messages::Topic;
use crate::clock::SimTime;

/// How long viewers have to take leave when the server ends.
const LEAVE: Duration = Duration::from_millis(500);

/// Where and how to serve.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LiveOptions {
    /// Where to listen; port 0 takes any that is free.
    pub address: SocketAddr,
    /// What viewers show as the source's name.
    pub name: String,
    /// Messages that are kept for a viewer that reads slowly.
    pub backlog: usize,
}

impl LiveOptions {
    /// Where viewers look by default: this machine alone, the port of Foxglove.
    pub const ADDRESS: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8765);
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self {
            address: Self::ADDRESS,
            name: "bikebot".into(),
            // About two simulated seconds of a ride with a laser.
            backlog: 1024,
        }
    }
}

/// Why there is nothing to see.
#[derive(Debug, Error)]
pub enum LiveError {
    /// The address cannot be listened on.
    #[error("cannot serve on {address}: {source}")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// A topic could not be set up.
    #[error("cannot serve the topic {topic}: {cause}")]
    Topic {
        /// Which.
        topic: &'static str,
        /// Why.
        cause: String,
    },
}

/// Serves a run to any number of viewers.
pub struct LiveServer {
    handle: WebSocketServerHandle,
    address: SocketAddr,
    shared: Arc<Shared>,
    /// The channels live as long as it does.
    _context: Arc<Context>,
}

impl std::fmt::Debug for LiveServer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LiveServer")
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

impl LiveServer {
    /// Begins to listen. Viewers see all topics at once, before the first message.
    ///
    /// # Errors
    ///
    /// [`LiveError::Listen`] where the address is taken or is not ours.
    pub fn start(options: &LiveOptions) -> Result<Self, LiveError> {
        let context = Context::new();
        let mut channels = Vec::with_capacity(Topic::ALL.len());
        for topic in Topic::ALL {
            let (schema, encoding) = topic.schema();
            let channel = ChannelBuilder::new(topic.name())
                .schema(schema)
                .message_encoding(encoding)
                .context(&context)
                .build_raw()
                .map_err(|error| LiveError::Topic {
                    topic: topic.name(),
                    cause: error.to_string(),
                })?;
            channels.push(channel);
        }
        let shared = Arc::new(Shared {
            channels,
            standing: Mutex::default(),
        });
        let handle = WebSocketServer::new()
            .name(&options.name)
            .bind(options.address.ip().to_string(), options.address.port())
            .message_backlog_size(options.backlog.max(1))
            .context(&context)
            .listener(Arc::new(Latecomers(Arc::clone(&shared))))
            .start_blocking()
            .map_err(|error| LiveError::Listen {
                address: options.address,
                source: match error {
                    FoxgloveError::Bind(source) => source,
                    other => io::Error::other(other),
                },
            })?;
        Ok(Self {
            address: SocketAddr::new(options.address.ip(), handle.port()),
            handle,
            shared,
            _context: context,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// How many viewers are connected.
    #[must_use]
    pub fn viewers(&self) -> usize {
        self.handle.client_count()
    }

    pub(super) fn shared(&self) -> Arc<Shared> {
        Arc::clone(&self.shared)
    }

    /// Takes leave of the viewers and ends. One that does not read any more is left half a second.
    pub fn stop(self) {
        let ending = self.handle.stop();
        let (done, wait) = mpsc::channel();
        // A viewer that does not read would keep us for ever; the thread ends with it or with the program.
        thread::spawn(move || {
            ending.wait_blocking();
            let _ = done.send(());
        });
        let _ = wait.recv_timeout(LEAVE);
    }
}

/// Time in ns and bytes of messages, by the number of their topic and its part.
type Standing = BTreeMap<(usize, u8), (u64, Vec<u8>)>;

/// What recorder and server have in common.
pub(super) struct Shared {
    /// In the order of [`Topic::ALL`].
    channels: Vec<Arc<RawChannel>>,
    /// The last message of what stands.
    standing: Mutex<Standing>,
}

impl Shared {
    /// Hands a message to whoever has subscribed to its topic, and keeps it for others where it stands.
    pub(super) fn publish(&self, topic: Topic, part: u8, time: SimTime, message: &[u8]) {
        let index = topic as usize;
        let time = time.nanoseconds();
        if topic.stands() {
            let mut standing = self.standing();
            let (at, kept) = standing.entry((index, part)).or_default();
            *at = time;
            kept.clear();
            kept.extend_from_slice(message);
        }
        self.channels[index].log_with_meta(message, at(time));
    }

    /// Nothing that is kept can be half written: a panic elsewhere leaves it as it was.
    fn standing(&self) -> MutexGuard<'_, Standing> {
        self.standing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn at(time: u64) -> PartialMetadata {
    PartialMetadata {
        log_time: Some(time),
    }
}

/// Sends what stands to those who come later.
struct Latecomers(Arc<Shared>);

impl ServerListener for Latecomers {
    fn on_subscribe(&self, client: Client, channel: ChannelView) {
        let shared = &self.0;
        let Some(index) = shared
            .channels
            .iter()
            .position(|own| own.id() == channel.id())
        else {
            return;
        };
        let kept: Vec<(u64, Vec<u8>)> = shared
            .standing()
            .range((index, 0)..=(index, u8::MAX))
            .map(|(_, message)| message.clone())
            .collect();
        for (time, message) in kept {
            shared.channels[index].log_with_meta_to_sink(&message, at(time), client.sink_id());
        }
    }
}

#[cfg(test)]
mod tests;
