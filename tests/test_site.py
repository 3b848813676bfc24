"""The site in a browser, on a phone and on a desk: nothing is wider than the screen, every equation is typeset and does
not overlap its number, and the letters in pictures are large enough to be read.
"""

import json
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
WIDTHS = {"phone": 375, "desk": 1280}
LOOK = """<!doctype html><pre id="seen"></pre><script>
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
async function look(page, width) {
  const frame = document.createElement("iframe");
  Object.assign(frame, {src: page, width, height: 800});
  document.body.append(frame);
  await new Promise((done) => { frame.onload = done; });
  await wait(300);
  const root = frame.contentDocument, count = (what) => root.querySelectorAll(what).length;
  const edge = (thing, side) => thing.getBoundingClientRect()[side];
  const numbered = [...root.querySelectorAll(".katex-html:has(> .katex-tag)")];
  const overlaps = (line) => edge(line.querySelector(":scope > .katex-tag"), "left")
    < Math.max(...[...line.querySelectorAll(":scope > .katex-base")].map((part) => edge(part, "right")));
  const shown = [...root.images].filter((each) => each.naturalWidth > 400);
  const loaded = frame.contentWindow.performance.getEntriesByType("resource").map((each) => each.name);
  const seen = {
    page, width, wide: root.documentElement.scrollWidth - root.documentElement.clientWidth,
    equations: count(".arithmatex"), typeset: count(".arithmatex .katex"), wrong: count(".katex-error"),
    numbered: numbered.length, overlapped: numbered.filter(overlaps).map((line) => line.textContent),
    small: shown.filter((each) => each.width < 0.5 * each.naturalWidth).map((each) => each.src),
    broken: [...root.images].filter((each) => each.complete && !each.naturalWidth).map((each) => each.src),
    foreign: loaded.filter((each) => each.startsWith("http")), search: count(".md-search__input"),
  };
  frame.remove();
  return seen;
}
(async () => {
  const seen = [];
  for (const width of WIDTHS) for (const page of PAGES) seen.push(await look(page, width));
  document.getElementById("seen").textContent = JSON.stringify(seen);
})();
</script>"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """What a browser sees of each page at each width."""
    if BROWSER is None:
        pytest.skip("needs Chromium")
    site = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(site)]
    subprocess.run(build, cwd=ROOT, check=True)
    pages = sorted(str(path.relative_to(site)) for path in site.rglob("*.html") if path.name != "404.html")
    script = LOOK.replace("WIDTHS", json.dumps(list(WIDTHS.values()))).replace("PAGES", json.dumps(pages))
    (site / "look.html").write_text(script, encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--dump-dom"]
    address = (site / "look.html").as_uri()
    looked = subprocess.run(
        [BROWSER, *options, "--virtual-time-budget=900000", address], capture_output=True, text=True, check=True
    )
    (match,) = re.findall(r'<pre id="seen">(.*?)</pre>', looked.stdout, re.DOTALL)
    return json.loads(unescape(match))


@pytest.mark.nightly
def test_no_page_is_wider_than_its_screen(pages):
    assert {page["width"] for page in pages} == set(WIDTHS.values())
    assert not [(page["page"], page["width"], page["wide"]) for page in pages if page["wide"] > 0]


@pytest.mark.nightly
def test_every_equation_is_typeset_without_a_network(pages):
    assert sum(page["equations"] for page in pages if page["page"] == "paper.html") > 2 * 9
    assert not [page for page in pages if page["typeset"] != page["equations"] or page["wrong"] or page["foreign"]]


@pytest.mark.nightly
def test_no_number_of_an_equation_overlaps_it(pages):
    assert min(page["numbered"] for page in pages if page["page"] == "paper.html") == 9
    assert not [(page["page"], page["width"], page["overlapped"]) for page in pages if page["overlapped"]]


@pytest.mark.nightly
def test_pictures_are_not_shrunk_until_nobody_can_read_them(pages):
    """A picture has letters of 11 pixels or more in its own size."""
    assert not [(page["page"], page["width"], page["small"]) for page in pages if page["small"]]


@pytest.mark.nightly
def test_pictures_and_search_are_on_every_page(pages):
    assert not [page for page in pages if page["broken"] or not page["search"]]
