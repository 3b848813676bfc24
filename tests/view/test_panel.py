"""What stands beside the scene: channels as the trace has them, events when they happen, keys that step."""

import json
import re
import shutil
import subprocess
from html import unescape

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.view.film import Film
from rover_pin.view.page import write_page
from rover_pin.view.panel import events_of, plotted
from rover_pin.view.subject import Subject

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def filmed(name, **settings):
    made = scenario(name, **settings)
    return Film.of(made.drive(), made.model.rover, made.model.terrain)


def test_plots_have_the_channels_of_the_trace():
    film = filmed("flat", duration=0.5)
    data = plotted(film)
    assert data["t"] == pytest.approx(film.t - film.t[0], abs=1e-3)
    lines = {plot["label"]: plot["lines"] for plot in data["plots"]}
    for channel, label, scale in (("slip", "slip S [-]", 1.0), ("sinkage", "sinkage [mm]", 1e3)):
        expected = scale * film.trace[f"{channel}_ml"][film.rows]
        assert lines[label]["ml"] == pytest.approx(expected, rel=1e-3)
    assert not data["events"]


def test_a_stuck_drive_says_since_when():
    film = filmed("ditch", soil="table-1", duration=12.0)
    (event,) = events_of(film)
    assert event.words == "stuck"
    assert f"since {event.t:.1f} s" in film.trace.attrs["happened"]


KEYS = """<pre id="said"></pre><iframe id="f" width=900 height=700 src="SRC"></iframe><script>
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
document.getElementById("f").onload = async () => {
  const page = document.getElementById("f").contentWindow, root = page.document, times = [];
  for (let n = 0; n < 100 && !root.querySelector("#root [role=slider]"); n++) await wait(100);
  for (const key of ["Home", "ArrowRight", "ArrowRight", "ArrowLeft"]) {
    page.dispatchEvent(new page.KeyboardEvent("keydown", {key, bubbles: true}));
    await wait(300);
    times.push(Number(root.querySelector("#root [role=slider]").getAttribute("aria-valuenow")));
  }
  const cursors = [...root.querySelectorAll(".cursor")].map((line) => Number(line.getAttribute("x1")));
  document.getElementById("said").textContent = JSON.stringify({times, cursors, title: root.title});
};
</script>"""


@pytest.mark.nightly
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_arrow_keys_step_and_the_cursors_follow(tmp_path):
    made = scenario("flat", duration=1.0)
    subject = Subject("a flat", made.drive(), made.model.rover, made.model.terrain, None)
    frame = tmp_path / "frame.html"
    frame.write_text(KEYS.replace("SRC", write_page(tmp_path / "view.html", subject).as_uri()))
    options = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
               "--allow-file-access-from-files", "--virtual-time-budget=30000", "--dump-dom"]  # fmt: skip
    out = subprocess.run([BROWSER, *options, frame.as_uri()], capture_output=True, text=True, check=True).stdout
    said = json.loads(unescape(re.search(r'<pre id="said">(.*?)</pre>', out, re.DOTALL)[1]))
    assert said["times"] == pytest.approx([0.0, 0.05, 0.1, 0.05], abs=1e-3)
    assert said["title"] == "a flat"
    assert len(said["cursors"]) == 3
    assert np.ptp(said["cursors"]) == 0.0
    assert said["cursors"][0] == pytest.approx(44 + 290 * 0.05 / np.ptp(subject.trace.t), abs=0.1)
