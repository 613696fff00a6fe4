//! A recorder that fails costs the recording, never the ride.

mod common;

use bikebot_sim::clock::SimTime;
use bikebot_sim::record::{Event, RecordError, Recorder};
use bikebot_sim::{RunOutcome, RunReport};

/// Fails at its n-th event.
struct FailsAt(usize);

impl Recorder for FailsAt {
    fn record(&mut self, _: SimTime, _: &Event<'_>) -> Result<(), RecordError> {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 {
            Err(RecordError::Finished)
        } else {
            Ok(())
        }
    }
}

fn ride(recorder: &mut dyn Recorder) -> RunReport {
    let text = "format = 1\nname = \"line\"\n[path]\nwaypoints = [[0, 0, 0], [3, 0, 0]]\n";
    common::ride(&common::setup(text, &[]), recorder)
}

#[test]
fn the_ride_goes_on_and_the_failure_is_told() {
    let whole = ride(&mut ());
    assert_eq!(whole.outcome, RunOutcome::Arrived);
    assert_eq!(whole.recording_failed, None);
    for n in [1, 2, 3, 10, 500] {
        let report = ride(&mut FailsAt(n));
        assert_eq!(
            report.result_hash, whole.result_hash,
            "failure at event {n}"
        );
        assert!(report.recording_failed.is_some(), "failure at event {n}");
    }
}
