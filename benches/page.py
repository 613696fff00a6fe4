"""How smoothly the page of a ride plays and scrubs, by its own counter, and what a frame costs.

    pip install websockets
    python benches/page.py street.html

Chromium without a window and without a graphics card draws it: the least that a reader's browser does.
"""

import asyncio
import os
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "browser"))
from devtools import Browser, installed  # noqa: E402

SCRUB = """(async () => {
  const frames = 120, begun = performance.now();
  for (let i = 0; i < frames; i++) {
    bikebot.seek(bikebot.end * (i * 37 % frames) / frames);
    await new Promise((done) => requestAnimationFrame(done));
  }
  return 1000 * frames / (performance.now() - begun);
})()"""


def processor_time(root):
    """Of a process and all below it, s."""
    below, times = {}, {}
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            fields = pathlib.Path("/proc", name, "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        below.setdefault(int(fields[1]), []).append(int(name))
        times[int(name)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    todo, total = [root], 0.0
    while todo:
        one = todo.pop()
        total += times.get(one, 0.0)
        todo += below.get(one, [])
    return total


async def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    async with Browser(installed()) as browser:
        for page in sys.argv[1:]:
            for width, height in [(1280, 900), (390, 844)]:
                for follows in [False, True]:
                    await browser.open(page, width, height)
                    await browser.run("document.activeElement.blur()")
                    await browser.key("Home")
                    if follows:
                        await browser.key("f", "KeyF", "f")
                    await browser.key(" ", "Space", " ")
                    await asyncio.sleep(1)
                    rates, before, count = [], processor_time(browser.process.pid), await browser.run("bikebot.frames")
                    for _ in range(6):
                        await asyncio.sleep(0.6)
                        rates.append(await browser.run("bikebot.fps"))
                    count = await browser.run("bikebot.frames") - count
                    each = 1e3 * (processor_time(browser.process.pid) - before) / max(count, 1)
                    await browser.run("bikebot.pause()")
                    scrubbed = await browser.run(SCRUB)
                    print(f"{page} {width} px, {'following' if follows else 'field'}: {sorted(rates)[len(rates) // 2]:.0f} frames/s, "
                          f"{each:.1f} ms of processor time each; scrubbing {scrubbed:.0f} frames/s")


if __name__ == "__main__":
    asyncio.run(main())
