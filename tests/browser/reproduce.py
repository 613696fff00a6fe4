"""Makes the reduced form of `bikebot reproduce` and opens its page in a real browser, as a reader would.

    pip install websockets
    python tests/browser/reproduce.py target/release/bikebot [--pictures DIR]

Without a browser the page is not opened; what it is made of is looked at all the same.
"""

import argparse
import asyncio
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

FAILED = []


def check(holds, what):
    print(("ok      " if holds else "FAILED  ") + what)
    if not holds:
        FAILED.append(what)


def made(program, folder):
    """The folder, and what was told of it."""
    out = folder / "paper"
    command = [program, "reproduce", "--quick", "-o", str(out), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    check(done.returncode == 0, f"no claim fails (exit {done.returncode}) {done.stderr}")
    told = json.loads(done.stdout)
    print(f"        {told['holds']} hold, {told['differs']} differ, {told['fails']} fail, {told['not_measured']} not measured")
    for claim in told["claims"]:
        if claim["verdict"] == "fails":
            print("        ", claim["id"], claim["ours"], "against", claim["paper"])
    return out, told


def figures(out):
    for number in [5, 6, 7, 8]:
        picture = (out / f"fig{number}.png").read_bytes()
        width, height = struct.unpack(">II", picture[16:24])
        check(picture[:8] == b"\x89PNG\r\n\x1a\n" and width > 800 and height > 600, f"fig{number}.png is a picture of {width} x {height}")
        check("NaN" not in (out / f"fig{number}.svg").read_text(), f"fig{number}.svg has numbers alone")


def commands(program, out, told):
    """A command of the page, run in the folder, gives the figure that stands beside it."""
    seed = told["seed"]
    line = [program, "run", "scenarios/fig7.toml", "--seed", str(seed), "-o", "again.mcap", "--json", "-q"]
    ride = json.loads(subprocess.run(line, cwd=out, capture_output=True, text=True, check=True).stdout)
    measured = json.loads((out / "measured.json").read_text())
    row = next(row for row in measured["flywheel"] if row["seed"] == seed)
    check(ride["result_hash"] == row["result_hash"], "the ride of Fig. 7, ridden by itself, is the same ride")
    (out / "again.mcap").unlink()


async def opened(browser, page, told, pictures):
    for width, height in [(1280, 900), (390, 844)]:
        for scheme in ["light", "dark"]:
            await browser.open(page, width, height, scheme, ready="!!document.querySelector('footer')")
            what = f"{width} px, {scheme}"
            check(browser.complaints() == [], f"{what}: the browser complains of nothing {browser.complaints() or ''}")
            check(browser.requests() == [], f"{what}: nothing is asked of the network {browser.requests() or ''}")
            wide = await browser.run("document.documentElement.scrollWidth")
            check(wide <= width, f"{what}: nothing sticks out at the side ({wide} px)")
            rows = await browser.run("document.querySelectorAll('table.claims tbody tr').length")
            check(rows == len(told["claims"]), f"{what}: every claim has its row ({rows})")
            small = await browser.run(
                "[...document.querySelectorAll('.claims td.claim p, .claims td.ours')].filter(it => it.offsetWidth < 120 || parseFloat(getComputedStyle(it).fontSize) < 12).length"
            )
            check(small == 0, f"{what}: the claims can be read")
            paper = await browser.run("getComputedStyle(document.querySelector('#fig7 svg > path')).fill")
            light = sum(int(part) for part in paper[4:-1].split(",")) > 600
            check(light == (scheme == "light"), f"{what}: the figures are as dark as the page ({paper})")
            await browser.run("document.querySelectorAll('details').forEach(it => it.open = true)")
            wide = await browser.run("document.documentElement.scrollWidth")
            check(wide <= width, f"{what}: nor does it with everything unfolded ({wide} px)")
            if pictures:
                await browser.run("document.querySelectorAll('details').forEach(it => it.open = false)")
                pictures.mkdir(parents=True, exist_ok=True)
                tall = await browser.run("document.documentElement.scrollHeight")
                await browser.picture(pictures / f"page-{width}-{scheme}.png", tall, width)


async def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the program bikebot")
    parser.add_argument("--pictures", type=pathlib.Path, help="a folder for pictures of the page")
    arguments = parser.parse_args()
    program = str(pathlib.Path(arguments.program).resolve())
    with tempfile.TemporaryDirectory(prefix="bikebot-reproduce-") as folder:
        out, told = made(program, pathlib.Path(folder))
        figures(out)
        commands(program, out, told)
        try:
            from devtools import Browser, installed
        except ModuleNotFoundError as error:
            sys.exit(f"{error}: pip install websockets")
        browser = installed()
        if browser is None:
            print("skipped: no Chromium on this machine (BIKEBOT_BROWSER names one elsewhere)")
        else:
            async with Browser(browser) as page:
                await opened(page, out / "index.html", told, arguments.pictures)
    print(f"\n{len(FAILED)} failed" if FAILED else "\nall of it holds")
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    asyncio.run(main())
