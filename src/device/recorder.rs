//! Middleware that shows every piece of traffic to a recorder.

use std::time::Duration;

use super::{Link, LinkError, LinkStatus, Traffic};
use crate::time::HostTime;

/// Takes a copy of the traffic. It must not block: it runs on the receiving thread.
pub trait TrafficSink: Send {
    /// One piece of traffic, as received at `at`.
    fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>);
}

/// A link whose traffic is also shown to a [`TrafficSink`], unchanged and in order.
#[derive(Debug)]
pub struct Tap<L, S> {
    link: L,
    sink: S,
}

impl<L: Link, S: TrafficSink> Tap<L, S> {
    /// Shows the traffic of `link` to `sink`.
    pub fn new(link: L, sink: S) -> Self {
        Self { link, sink }
    }
}

impl<L: Link, S: TrafficSink> Link for Tap<L, S> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let received = self.link.receive(timeout)?;
        if let Some((at, traffic)) = received {
            self.sink.traffic(at, traffic);
        }
        Ok(received)
    }

    fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
        self.link.send(traffic)
    }

    fn status(&self) -> LinkStatus {
        self.link.status()
    }

    fn port(&self) -> Option<&str> {
        self.link.port()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::device::testing::{ScriptLink, drain};

    #[derive(Clone, Default)]
    struct Pieces(Arc<Mutex<Vec<Piece>>>);

    type Piece = (HostTime, Vec<u8>);

    impl TrafficSink for Pieces {
        fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>) {
            let Traffic::Bytes(bytes) = traffic else { panic!("bytes only") };
            self.0.lock().expect("not poisoned").push((at, bytes.to_vec()));
        }
    }

    #[test]
    fn the_sink_sees_what_the_reader_gets() {
        let sink = Pieces::default();
        let mut tap = Tap::new(ScriptLink::pieces(5), sink.clone());
        tap.send(Traffic::Bytes(b"hi")).expect("forwarded");
        assert_eq!(tap.link.sent, [b"hi".to_vec()]);
        let read = drain(&mut tap);
        assert_eq!(read.len(), 5);
        assert_eq!(read, *sink.0.lock().expect("not poisoned"));
    }
}
