"""The report page in a real browser: the console stays empty, nothing is loaded from outside, and a phone needs no
sideways scrolling.
"""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rover_pin.report.drive.report import write_report

pytestmark = pytest.mark.slow

WIDTHS = (1200, 768, 375)
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
SECONDS = 120


def found():
    """Return the browser on the path. If there is none, skip the test and state the reason."""
    program = next((shutil.which(name) for name in NAMES if shutil.which(name)), None)
    if program is None:
        pytest.skip(f"no browser on the path: none of {', '.join(NAMES)}")
    return program


def ran(*words, profile):
    """Run the browser until it ends by itself, and return its output and its log."""
    still = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
             "--disable-background-networking", "--virtual-time-budget=3000")  # fmt: skip
    done = subprocess.run(
        [found(), *still, f"--user-data-dir={profile}", *words],
        capture_output=True, text=True, timeout=SECONDS, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout, done.stderr


LOOKED = """
    frame.onload = () => {
      const inside = frame.contentDocument, root = inside.documentElement;
      const wide = [...inside.querySelectorAll('body *')].filter(
        each => each.getBoundingClientRect().right > root.clientWidth + 1 && !each.closest('svg'));
      said.textContent = JSON.stringify({
        first: inside.querySelector('.first').getBoundingClientRect().bottom,
        reach: root.scrollWidth, room: root.clientWidth, wide: wide.map(each => each.tagName + ' ' + each.className),
        loaded: frame.contentWindow.performance.getEntriesByType('resource').map(each => each.name)});
    };
"""


def framed(page, width, height, script=LOOKED):
    """Return a page that shows another page as wide as a phone, and that writes the width of its content and its
    requests.
    """
    head = "const frame = document.getElementById('f'), said = document.createElement('pre');"
    head += "said.id = 'said'; document.body.append(said);"
    return (
        f"<!doctype html><title>frame</title><body style='margin:0'><iframe id=f style='border:0' width={width} "
        f"height={height} src='{Path(page).as_uri()}'></iframe><script>{head}{script}</script>"
    )


ZOOMED = """
    const number = (said) => Number(said.replace('\u2212', '-')), centre = (node) => {
      const box = node.getBoundingClientRect();
      return {x: box.left + box.width / 2, y: box.top + box.height / 2};
    };
    const read = (svg, name) => {
      const ticks = [...svg.querySelectorAll(`[id*="-${name}tick_"]`)].filter((tick) => tick.style.display !== 'none');
      const [a, b] = [ticks[0], ticks[ticks.length - 1]].map((tick) => {
        const text = tick.querySelector('text'), walk = document.createTreeWalker(tick, NodeFilter.SHOW_COMMENT);
        const said = text ? text.textContent : walk.nextNode().data.trim();
        return {value: number(said), at: centre(tick.querySelector('use[x]'))[name]};
      });
      const points = svg.querySelectorAll('[clip-path] use[x]:not([id*="tick"] use)');
      const value = (at) => a.value + (at - a.at) * (b.value - a.value) / (b.at - a.at);
      return {span: Math.abs(b.value - a.value), points: [...points].map((point) => value(centre(point)[name]))};
    };
    frame.onload = () => {
      const svg = frame.contentDocument.querySelector('svg.figure'), at = centre(svg);
      const before = [read(svg, 'x'), read(svg, 'y')];
      svg.dispatchEvent(new frame.contentWindow.WheelEvent('wheel', {
        deltaY: -500, ctrlKey: true, clientX: at.x, clientY: at.y, cancelable: true}));
      said.textContent = JSON.stringify({before, after: [read(svg, 'x'), read(svg, 'y')]});
    };
"""
"""Turns the wheel over the first plot, and reads its points off its axes before and after."""


@pytest.fixture(scope="module")
def page(sag_fits, verdict, tmp_path_factory):
    found()
    return write_report(verdict, sag_fits[0], tmp_path_factory.mktemp("report"))[0]


def test_the_console_stays_empty_and_nothing_is_loaded(page, tmp_path):
    frame = tmp_path / "frame.html"
    frame.write_text(framed(page, 1200, 2000))
    words = ("--allow-file-access-from-files", "--enable-logging=stderr", "--dump-dom", frame.as_uri())
    out, log = ran(*words, profile=tmp_path / "profile")
    console = [line for line in log.splitlines() if ":CONSOLE" in line]
    assert not console
    report = json.loads(html.unescape(re.search(r'<pre id="said">(.*?)</pre>', out, re.DOTALL)[1]))
    assert [name for name in report["loaded"] if not name.startswith("data:")] == []


@pytest.mark.parametrize("width", WIDTHS)
def test_it_does_not_scroll_sideways(page, tmp_path, width):
    frame = tmp_path / "frame.html"
    frame.write_text(framed(page, width, 3000))
    words = ("--allow-file-access-from-files", "--dump-dom", f"--window-size={max(width, 500)},3000", frame.as_uri())
    out, _ = ran(*words, profile=tmp_path / "profile")
    widths = json.loads(html.unescape(re.search(r'<pre id="said">(.*?)</pre>', out, re.DOTALL)[1]))
    assert widths["room"] == width
    assert widths["wide"] == []
    assert widths["reach"] <= width
    if width == 1200:
        assert widths["first"] <= 900  # what a laptop's window shows at once


def test_a_plot_zooms_and_its_axes_stay_right(page, tmp_path):
    frame = tmp_path / "frame.html"
    frame.write_text(framed(page, 1200, 2000, ZOOMED))
    out, _ = ran("--allow-file-access-from-files", "--dump-dom", frame.as_uri(), profile=tmp_path / "profile")
    axes_seen = json.loads(html.unescape(re.search(r'<pre id="said">(.*?)</pre>', out, re.DOTALL)[1]))
    for before, after in zip(axes_seen["before"], axes_seen["after"], strict=True):
        assert after["span"] < 0.7 * before["span"]  # ticks chosen anew
        assert len(before["points"]) > 5
        assert after["points"] == pytest.approx(before["points"], abs=0.01 * before["span"])
