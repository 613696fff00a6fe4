"""Opens pages of `bikebot report` in a real browser and does what a reader would do.

    pip install websockets mcap mcap-protobuf-support
    python tests/browser/report.py target/release/bikebot [--pictures DIR]

The values a page shows are held against the recording as the official MCAP packages read it: nothing of ours is in
between. Without a browser it says so and ends well.
"""

import argparse
import asyncio
import bisect
import json
import math
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FAILED = []


def check(holds, what):
    print(("ok      " if holds else "FAILED  ") + what)
    if not holds:
        FAILED.append(what)


def read(path):
    """Times and columns of /bike/state, as the official packages read them."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        rows = [message for *_, message in reader.iter_decoded_messages(topics=["/bike/state"])]
    return [row.time_s for row in rows], rows


class Program:
    """The program, and a folder for what it makes."""

    def __init__(self, program, folder):
        self.program, self.folder = str(pathlib.Path(program).resolve()), pathlib.Path(folder)

    def __call__(self, *arguments, code=0):
        done = subprocess.run([self.program, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True)
        if done.returncode != code:
            sys.exit(f"{arguments} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
        return done

    def ride(self, scenario, name, *more):
        self("run", ROOT / "scenarios" / scenario, "-o", name, "-q", *more)
        return self.folder / name

    def page(self, name, *recordings):
        told = json.loads(self("report", *recordings, "-o", name, "--json", "-q").stdout)
        return self.folder / told["report"], told


async def opens_clean(browser, page, width, scheme):
    height = 844 if width < 600 else 900
    await browser.open(page, width, height, scheme)
    what = f"{page.name} at {width} px, {scheme}"
    check(browser.complaints() == [], f"{what}: the browser complains of nothing {browser.complaints() or ''}")
    check(browser.requests() == [], f"{what}: nothing is asked of the network {browser.requests() or ''}")
    wide = await browser.run("document.documentElement.scrollWidth")
    check(wide <= width, f"{what}: nothing sticks out at the side ({wide} px)")


async def slider_moves_the_bike(browser, times, rows, width):
    picture = "document.getElementById('map').toDataURL()"
    before, at_first = await browser.run(picture), await browser.run("bikebot.time")
    x, y, w, h = await browser.box("#time")
    await browser.click(x + 0.4 * w, y + h / 2)
    now, end = await browser.run("bikebot.time"), await browser.run("bikebot.end")
    check(abs(now - 0.4 * end) < 0.03 * end and now != at_first, f"{width} px: a click on the slider goes there ({now:.2f} s of {end:.2f})")
    check(await browser.run(picture) != before, f"{width} px: the picture from above changes")
    pose = await browser.run("bikebot.pose()")
    i = min(max(bisect.bisect_right(times, now) - 1, 0), len(rows) - 2)
    share = (now - times[i]) / (times[i + 1] - times[i])
    there = [rows[i].x_m + share * (rows[i + 1].x_m - rows[i].x_m), rows[i].y_m + share * (rows[i + 1].y_m - rows[i].y_m)]
    off = math.hypot(pose["x"] - there[0], pose["y"] - there[1])
    check(off < 2e-3, f"{width} px: the bike is where the recording has it ({1e3 * off:.3f} mm)")


async def hover_reads_the_recording(browser, times, rows, width):
    for chart, name, factor in [("roll", "roll_rad", 180 / math.pi), ("speed", "speed_mps", 1.0), ("clearance", "clearance_m", 1.0)]:
        x, y, w, h = await browser.box(f".chart[data-chart={chart}] .u-over")
        for share in [0.2, 0.55, 0.83]:
            await browser.mouse("mouseMoved", x + share * w, y + h / 2)
            await browser.settle()
            at = await browser.run("bikebot.hover")
            text = await browser.run(f"document.querySelector('.chart[data-chart={chart}] [data-column={name}] b').textContent")
            if at is None:
                check(False, f"{width} px: hovering {chart} names a time")
                continue
            row = rows[min(range(len(times)), key=lambda i: abs(times[i] - at))]
            wanted, shown = factor * getattr(row, name), float(text.replace("−", "-"))
            digits = len(text.partition(".")[2])
            # Half a unit of the last digit shown, and the stated precision of the page.
            close = abs(shown - wanted) <= 0.5 * 10**-digits + 2e-4 * max(1.0, abs(wanted))
            check(close, f"{width} px: {chart} at {at:.2f} s reads {text}, the recording says {wanted:.5f}")
        await browser.click(x + 0.3 * w, y + h / 2)
        hover, now = await browser.run("bikebot.hover"), await browser.run("bikebot.time")
        check(abs(hover - now) < 0.1, f"{width} px: a click on {chart} goes there ({now:.2f} s)")
        await browser.mouse("mouseMoved", 2, 2)


async def keys_play_and_step(browser, width):
    await browser.run("document.activeElement.blur()")
    await browser.key("Home")
    check(await browser.run("bikebot.time") == 0, f"{width} px: Home is the start")
    await browser.key("ArrowRight")
    check(abs(await browser.run("bikebot.time") - 0.1) < 1e-9, f"{width} px: an arrow is a tenth of a second")
    await browser.key("End")
    check(await browser.run("bikebot.time === bikebot.end"), f"{width} px: End is the end")
    for follows in [False, True]:
        await browser.key("Home")
        if follows:
            await browser.key("f", "KeyF", "f")
        await browser.key(" ", "Space", " ")
        check(await browser.run("bikebot.playing"), f"{width} px: space plays")
        await asyncio.sleep(2.2)
        fps, now = await browser.run("bikebot.fps"), await browser.run("bikebot.time")
        await browser.key(" ", "Space", " ")
        check(not await browser.run("bikebot.playing") and now > 0.5, f"{width} px: space pauses ({now:.2f} s)")
        # How fast depends on the machine and what else it does: this is a bound for sanity alone.
        check(fps > 3, f"{width} px: {fps:.0f} frames/s{' following the bike' if follows else ''}")
    await browser.key("f", "KeyF", "f")


async def events_and_layers(browser, width):
    count = await browser.run("document.querySelectorAll('.events button').length")
    if count:
        x, y, w, h = await browser.box(".events button")
        await browser.click(x + 60, y + h / 2)
        wanted = await browser.run("Number(document.querySelector('.events button').dataset.time)")
        check(abs(await browser.run("bikebot.time") - wanted) < 1e-6, f"{width} px: an event goes to its time ({wanted:.2f} s)")
    for layer in await browser.run("[...document.querySelectorAll('[data-layer]')].map(it => it.dataset.layer)"):
        await browser.run("bikebot.seek(0.5 * bikebot.end)")
        await browser.settle()
        before = await browser.run("document.getElementById('map').toDataURL()")
        await browser.run(f"document.querySelector('[data-layer={layer}]').click()")
        await browser.settle()
        after = await browser.run("document.getElementById('map').toDataURL()")
        check(before != after, f"{width} px: the layer {layer} can be switched")
        await browser.run(f"document.querySelector('[data-layer={layer}]').click()")


async def works(program, browser, pictures):
    fig7 = program.ride("fig7.toml", "fig7.mcap")
    times, rows = read(fig7)
    page, _ = program.page("fig7.html", fig7)
    check(page.stat().st_size < 3_000_000, f"the page has {page.stat().st_size} bytes")
    again, _ = program.page("again.html", fig7)
    check(again.read_bytes() == page.read_bytes(), "made again it is the same to the byte")
    for width in [1280, 390]:
        await opens_clean(browser, page, width, "dark")
        await opens_clean(browser, page, width, "light")
        await slider_moves_the_bike(browser, times, rows, width)
        await hover_reads_the_recording(browser, times, rows, width)
        await keys_play_and_step(browser, width)
        await events_and_layers(browser, width)
        check(browser.complaints() == [], f"{width} px: no complaints after all that {browser.complaints() or ''}")

    print("-- what the bike has seen, and what moves")
    crossing = program.ride("crossing.toml", "crossing.mcap")
    page, _ = program.page("crossing.html", crossing)
    for width in [1280, 390]:
        await opens_clean(browser, page, width, "light")
        await keys_play_and_step(browser, width)
    # Backwards in time the belief is what it was.
    state = "(bikebot.seek({}), new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(document.getElementById('map').toDataURL())))))"
    early = await browser.run(state.format(5))
    await browser.run(state.format(20))
    check(early == await browser.run(state.format(5)), "going back shows what was shown then")

    print("-- several, odd and broken recordings")
    other = program.ride("fig7-balancer.toml", "fig7-balancer.mcap")
    page, _ = program.page("two.html", fig7, other)
    for width in [1280, 390]:
        await opens_clean(browser, page, width, "light")
        await keys_play_and_step(browser, width)

    evil = "</script><script>window.broken = 1</script><img src=http://localhost:1/x onerror='window.broken = 1'>"
    # A comment may hold anything, and stands in the page with the rest of the scenario.
    scenario = program.folder / "evil.toml"
    scenario.write_text((ROOT / "scenarios" / "balance-recover.toml").read_text() + f"\n# {evil}\n")
    page, _ = program.page("evil.html", program.ride(scenario, "evil.mcap"))
    await opens_clean(browser, page, 1280, "light")
    check(await browser.run("window.broken === undefined"), "a scenario cannot bring in a script")
    check(evil in await browser.run("document.getElementById('scenario-0').textContent"), "what it holds is shown as it is")

    walled = program.folder / "walled.toml"
    walled.write_text("""format = 1
name = "walled"
map = { bounds_m = [0, 0, 12, 6], box = [{ min_m = [5, 0], max_m = [6, 6] }] }
start = { x_m = 2, y_m = 3, heading_deg = 0 }
goal = { x_m = 10, y_m = 3 }
""")
    program("run", walled, "-o", "walled.mcap", "-q", code=1)
    page, _ = program.page("walled.html", "walled.mcap")
    for width in [1280, 390]:
        await opens_clean(browser, page, width, "light")
    check(await browser.run("document.getElementById('transport').hidden"), "where nothing was ridden there is nothing to play")

    whole = fig7.read_bytes()
    for share in [0.95, 0.5, 0.1]:
        (program.folder / "cut.mcap").write_bytes(whole[: int(share * len(whole))])
        program("report", "cut.mcap", "-o", "cut.html", "--force", "-q")
        await opens_clean(browser, program.folder / "cut.html", 1280, "light")
        said = await browser.run("document.querySelector('.banner')?.textContent ?? ''")
        check(len(said) > 20, f"cut to {share:.0%} it says what is missing: {' '.join(said.split())[:90]}")
    (program.folder / "foreign.mcap").write_bytes(b"GIF89a" + bytes(100))
    program("report", "foreign.mcap", "-o", "foreign.html", code=3)
    check(not (program.folder / "foreign.html").exists(), "of a file that is no recording no page is made")

    if pictures:
        pictures = pathlib.Path(pictures)
        pictures.mkdir(parents=True, exist_ok=True)
        for name in ["fig7", "crossing", "two"]:
            for width, height in [(1280, 900), (390, 844)]:
                for scheme in ["light", "dark"]:
                    await browser.open(program.folder / f"{name}.html", width, height, scheme)
                    await browser.run("bikebot.seek(0.52 * bikebot.end)")
                    await browser.settle()
                    await browser.picture(pictures / f"{name}-{width}-{scheme}.png")


async def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the program bikebot")
    parser.add_argument("--pictures", help="a folder for pictures of the pages")
    arguments = parser.parse_args()
    try:
        from devtools import Browser, installed
    except ModuleNotFoundError as error:
        sys.exit(f"{error}: pip install websockets mcap mcap-protobuf-support")
    browser = installed()
    if browser is None:
        print("skipped: no Chromium on this machine (BIKEBOT_BROWSER names one elsewhere)")
        return
    with tempfile.TemporaryDirectory(prefix="bikebot-report-") as folder:
        async with Browser(browser) as page:
            await works(Program(arguments.program, folder), page, arguments.pictures)
    print(f"\n{len(FAILED)} failed" if FAILED else "\nall of it holds")
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    asyncio.run(main())
