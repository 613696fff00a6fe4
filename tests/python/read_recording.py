"""Reads a recording with the official Python packages and checks its promises.

    pip install mcap mcap-protobuf-support
    python tests/python/read_recording.py fig7-1.mcap [more.mcap …]

An independent reader: nothing of ours but the file. Checked are topics and
schemas, times that never go back, transforms before what needs them, frames that
hang together, and metadata and attachments enough to run the recording again.
"""

import hashlib
import math
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

SCHEMAS = {
    "/tf": "foxglove.FrameTransforms",
    "/map": "foxglove.Grid",
    "/map/occupancy": "foxglove.Grid",
    "/plan/path": "foxglove.PosesInFrame",
    "/plan/scene": "foxglove.SceneUpdate",
    "/plan/samples": "pathtable.PathTable",
    "/plan/followed": "pathtable.PathTable",
    "/bike/pose": "foxglove.PoseInFrame",
    "/bike/joints": "foxglove.JointStates",
    "/bike/state": "bikestate.BikeState",
    "/bike/footprint": "foxglove.SceneUpdate",
    "/bike/model": "foxglove.SceneUpdate",
    "/control/debug": "controldebug.ControlDebug",
    "/obstacles": "foxglove.SceneUpdate",
    "/scan": "foxglove.LaserScan",
    "/belief": "foxglove.Grid",
    "/events": "runevent.RunEvent",
    "/log": "foxglove.Log",
}
FRAMES = {("map", "base_link"), ("base_link", "laser"), ("base_link", "fork"), ("base_link", "balancer")}
# Messages that every ride has.
EXPECTED = ["/tf", "/bike/pose", "/bike/joints", "/bike/state"]


def nanoseconds(stamp):
    return stamp.seconds * 1_000_000_000 + stamp.nanos


def frames_used(message):
    if hasattr(message, "frame_id"):
        yield message.frame_id
    for entity in getattr(message, "entities", []):
        yield entity.frame_id


def stamps(message):
    if hasattr(message, "timestamp"):
        yield message.timestamp
    for part in ("transforms", "entities"):
        for item in getattr(message, part, []):
            yield item.timestamp


def check_grid(message):
    rows = len(message.data) // message.row_stride
    assert len(message.data) == rows * message.row_stride, "map: rows are not whole"
    assert message.row_stride == message.column_count * message.cell_stride, "map: strides"
    assert {field.name for field in message.fields} in (
        {"red", "green", "blue", "alpha"},
        {"occupancy"},
    ), "map: fields"


def check_recording(path):
    counts, links, known, last, placed = {}, set(), set(), 0, None
    states = 0
    with open(path, "rb") as file:
        # Order of the file, not sorted by the reader: that is what is to be checked.
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        topics = {channel.topic: channel for channel in summary.channels.values()}
        for topic, schema in SCHEMAS.items():
            assert topic in topics, f"{topic} is missing"
            channel = topics[topic]
            assert summary.schemas[channel.schema_id].name == schema, f"{topic}: wrong schema"
            assert channel.message_encoding == "protobuf", f"{topic}: not protobuf"
        for _, channel, record, message in reader.iter_decoded_messages(log_time_order=False):
            topic = channel.topic
            assert record.log_time >= last, f"{topic}: time goes back at {record.log_time} ns"
            assert record.log_time == record.publish_time, f"{topic}: two times"
            last = record.log_time
            counts[topic] = counts.get(topic, 0) + 1
            for stamp in stamps(message):
                lateness = record.log_time - nanoseconds(stamp)
                if topic == "/scan":
                    # A sweep is stamped in its middle and logged when it is handed out.
                    assert 0 <= lateness <= 1_000_000_000, f"{topic}: stamped {lateness} ns before its log time"
                else:
                    assert lateness == 0, f"{topic}: stamp is not log time"
            if topic == "/tf":
                assert placed != last, f"a message before the transforms of its stamp {last} ns"
                for link in message.transforms:
                    links.add((link.parent_frame_id, link.child_frame_id))
                    known |= {link.parent_frame_id, link.child_frame_id}
                    q = link.rotation
                    norm = math.hypot(q.x, q.y, q.z, q.w)
                    assert abs(norm - 1.0) < 1e-9, "/tf: rotation is not of unit length"
            for frame in frames_used(message):
                placed = last
                assert frame in known, f"{topic}: frame {frame} before any transform named it"
            if topic.startswith("/map") or topic == "/belief":
                check_grid(message)
            if topic == "/bike/state":
                states += 1
                # Zeros are absent from the wire and read as zero.
                assert abs(message.time_s - record.log_time * 1e-9) < 1e-9, "/bike/state: time_s"
                assert math.isfinite(message.roll_rad), "/bike/state: roll_rad"
        for topic in EXPECTED:
            assert counts.get(topic), f"{topic} has no messages"
        assert links == FRAMES, f"frames are {sorted(links)}"
        assert sum(counts.values()) == summary.statistics.message_count, "count in the summary"

        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
        run, result = metadata["bikebot.run"], metadata["bikebot.result"]
        for key in ("schema_version", "version", "scenario", "seed", "overrides"):
            assert key in run, f"bikebot.run has no {key}"
        digest = hashlib.sha256(attachments["scenario.toml"]).hexdigest()
        assert run["scenario_sha256"] == digest, "scenario.toml is not the one that was run"
        assert result["outcome"], "bikebot.result has no outcome"
    print(f"{path}: {sum(counts.values())} messages in {last * 1e-9:.3f} s, {result['outcome']}")
    for topic in sorted(counts):
        print(f"  {topic:16} {counts[topic]:7}")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for path in sys.argv[1:]:
        check_recording(path)


if __name__ == "__main__":
    main()
