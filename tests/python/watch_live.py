"""Watches rides of `bikebot run --live` as a viewer would, over a real socket.

    pip install websockets mcap mcap-protobuf-support
    python tests/python/watch_live.py target/release/bikebot

What it sees is decoded by the schemas the server advertises, with Google's protobuf, and held against the recording as the
official MCAP packages read it: nothing of ours is in between.
"""

import argparse
import asyncio
import base64
import json
import pathlib
import re
import struct
import sys
import tempfile
import time

import websockets
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "unknown-yard.toml"
STANDING = {"/map", "/map/occupancy", "/obstacles", "/plan/path", "/plan/scene", "/plan/samples", "/plan/followed", "/belief", "/bike/model"}
FAILED = []


def check(holds, what):
    print(("ok      " if holds else "FAILED  ") + what, flush=True)
    if not holds:
        FAILED.append(what)


def decoder(channel):
    """A class for the messages of an advertised channel, made of its schema alone."""
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


class Ride:
    """`bikebot run --live` as a process of its own."""

    def __init__(self, program, folder, *arguments):
        self.command = [program, "run", str(SCENARIO), "--live", ":0", "-o", str(folder / "ride.mcap"), "--force", "--json", *arguments]

    async def __aenter__(self):
        self.began = time.monotonic()
        pipe = asyncio.subprocess.PIPE
        self.process = await asyncio.create_subprocess_exec(*self.command, stdout=pipe, stderr=pipe)
        line = (await self.process.stderr.readline()).decode()
        found = re.search(r"ws://\S+", line)
        if not found:
            sys.exit(f"no address: {line}{(await self.process.stderr.read()).decode()}")
        self.address = found[0]
        return self

    async def ended(self):
        out, err = await self.process.communicate()
        self.took = time.monotonic() - self.began
        return self.process.returncode, json.loads(out), err.decode()

    async def __aexit__(self, *_):
        if self.process.returncode is None:
            self.process.kill()
            await self.process.wait()


async def connect(ride):
    return await websockets.connect(ride.address, subprotocols=["foxglove.sdk.v1"], max_size=None, compression=None)


async def offered(socket):
    """The channels of a server: it tells of itself, then of them."""
    channels = []
    while True:
        told = json.loads(await asyncio.wait_for(socket.recv(), 30))
        if told["op"] == "advertise":
            channels += told["channels"]
        if len(channels) >= 18:
            return channels


async def subscribe(socket, channels):
    wanted = [{"id": number, "channelId": channel["id"]} for number, channel in enumerate(channels, 1)]
    await socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


async def messages(socket):
    """Number of the subscription, time in ns and bytes of each message until the server takes leave."""
    try:
        async for frame in socket:
            if isinstance(frame, bytes) and frame[0] == 1:
                number, at = struct.unpack_from("<IQ", frame, 1)
                yield number, at, frame[13:]
    except websockets.ConnectionClosed:
        return


async def sees_what_is_recorded(program, folder):
    async with Ride(program, folder, "--speed", "4") as ride:
        socket = await connect(ride)
        channels = await offered(socket)
        decoders = [decoder(channel) for channel in channels]
        await subscribe(socket, channels)
        seen, broken = {}, 0
        async for number, at, data in messages(socket):
            topic = channels[number - 1]["topic"]
            try:
                decoders[number - 1].FromString(data)
            except Exception as error:  # noqa: BLE001
                broken += 1
                print(topic, error)
            seen.setdefault(topic, set()).add((at, data))
        code, told, _ = await ride.ended()
    check(code == 0 and told["outcome"] == "arrived", f"the ride ends as ever ({told['outcome']})")
    topics = {channel["topic"] for channel in channels}
    check(set(seen) == topics, f"every advertised topic was received ({len(seen)} of {len(topics)}{' without ' + ', '.join(topics - set(seen)) if topics - set(seen) else ''})")
    check(broken == 0, f"every message decodes by its advertised schema ({sum(map(len, seen.values()))} messages)")
    written = {}
    with open(folder / "ride.mcap", "rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            written.setdefault(channel.topic, set()).add((message.log_time, message.data))
    strangers = sum(len(seen[topic] - written.get(topic, set())) for topic in seen)
    check(strangers == 0, "every message seen is one of the recording, to the byte")
    share = sum(map(len, seen.values())) / sum(map(len, written.values()))
    check(share > 0.9, f"{100 * share:.1f} % of the recording was seen (the rest came before the subscription)")
    return told["result_hash"]


async def latecomers_and_leavers(program, folder, wanted):
    async with Ride(program, folder, "--speed", "4") as ride:
        first = await connect(ride)
        channels = await offered(first)
        await subscribe(first, channels)
        await asyncio.wait_for(first.recv(), 30)
        # Gone without a word.
        first.transport.abort()
        await asyncio.sleep(1.5)
        late = await connect(ride)
        channels = await offered(late)
        await subscribe(late, channels)
        seen = set()
        until = time.monotonic() + 2
        async for number, _, _ in messages(late):
            seen.add(channels[number - 1]["topic"])
            if STANDING <= seen or time.monotonic() > until:
                break
        check(STANDING <= seen, f"a viewer that comes late is told what stands{' but for ' + ', '.join(STANDING - seen) if STANDING - seen else ''}")
        await late.close()
        code, told, _ = await ride.ended()
    check(code == 0 and told["result_hash"] == wanted, "viewers that come and go do not change the ride")


async def slow_readers(program, folder, wanted):
    async def alone():
        async with Ride(program, folder, "--speed", "max") as ride:
            await ride.ended()
            return ride.took

    quiet = await alone()
    async with Ride(program, folder, "--speed", "max") as ride:
        socket = await connect(ride)
        channels = await offered(socket)
        await subscribe(socket, channels)
        # Reads no more: nothing empties the buffers on the way.
        socket.transport.pause_reading()
        code, told, _ = await ride.ended()
        took = ride.took
        socket.transport.abort()
    check(code == 0 and told["result_hash"] == wanted, "a viewer that does not read does not change the ride")
    # A bound for sanity: nobody may hang. How much it costs is measured elsewhere.
    check(took < 3 * quiet + 10, f"a viewer that does not read delays nothing ({took:.2f} s, {quiet:.2f} s without it)")


async def interrupted(program, folder):
    async with Ride(program, folder, "--speed", "0.5") as ride:
        socket = await connect(ride)
        await subscribe(socket, await offered(socket))
        await asyncio.wait_for(socket.recv(), 30)
        socket.transport.pause_reading()
        ride.process.send_signal(2)
        began = time.monotonic()
        code, told, _ = await ride.ended()
        socket.transport.abort()
    check(code == 130 and told["outcome"] == "interrupted", f"Ctrl-C ends it (exit {code})")
    check(time.monotonic() - began < 20, f"at once, whoever does not read ({time.monotonic() - began:.1f} s)")
    with open(folder / "ride.mcap", "rb") as stream:
        check(make_reader(stream).get_summary() is not None, "and the recording is whole")


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", type=pathlib.Path)
    program = str(parser.parse_args().program.resolve())
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        result = await sees_what_is_recorded(program, folder)
        await latecomers_and_leavers(program, folder, result)
        await slow_readers(program, folder, result)
        await interrupted(program, folder)
    sys.exit(1 if FAILED else 0)


asyncio.run(main())
