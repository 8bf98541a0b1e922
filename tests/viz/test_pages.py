"""Every kind of page in a real browser: one look, no script needed, nothing fetched, and A4 paper."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rollover.assessment import results
from rollover.assessment.loads import peak_loads
from rollover.comparison.misfit import misfit
from rollover.comparison.run_pair import pair, read
from rollover.proof.summary import tally
from rollover.recording import Recording
from rollover.studies.baseline import Answer, Difference
from tests.rollover.diagnosed import overlays, sensor_at_fault
from tests.viz import example, spoilt
from tests.viz.browser import CHROMIUM, has_browser
from tests.viz.html import Parts
from tests.viz.test_proof_page import row
from tests.viz.test_study_page import written
from viz.content.blocks import Footer, Headline, Table
from viz.pages import comparison, diagnosis, proof, regression, report
from viz.pages import pair as pair_page
from viz.pages.page import render

KINDS = ("run", "compare", "two runs", "diagnose", "prove", "regress", "study")
EVERY = (*KINDS, *spoilt.PAGES)
KEPT = Path(__file__).parents[2] / "out" / "pages"  # pictures, to be looked at
HASH = "c0ffee" * 10 + "beef"
PAPER = (179, 261)  # mm, what A4 leaves within its margins
VERSIONS = {"rollover": "0.1.0", "exudyn": "1.13.6"}


def page_of(kind: str, folder: Path) -> str:
    """A page with everything on it, from made-up results."""
    if kind in spoilt.PAGES:
        return spoilt.PAGES[kind]("drop 1")
    if kind == "run":
        run = example.overturn()
        answer = {"scenario_hash": HASH, "versions": VERSIONS, "files": ["run.json"], "half_step": None}
        return report.page(run, peak_loads(run), answer, command="rollover run side_overturn")
    about = {"scenario_hash": HASH, "versions": VERSIONS}
    if kind == "compare":
        run = example.drop()
        channels = {
            name: 1.1 * values for name, values in run.recording.channels.items() if name.startswith("ground/f")
        }
        measured = Recording(title="Drop", time=run.recording.time, channels=channels)
        found = misfit(run, measured, name="drop 1", noise=lambda r, c: 20.0)
        return comparison.page([found], title="Drop", command="rollover compare drop_test rec/d3.csv", **about)
    if kind == "two runs":
        for name, run in (("was", example.drop()), ("now", example.drop(2.0))):
            results.write(folder / name, run, peak_loads(run))
        found_pair = pair(read(folder / "was"), read(folder / "now"))
        return pair_page.page(found_pair, command="rollover compare was now", versions=VERSIONS)
    if kind == "diagnose":
        return diagnosis.page(
            sensor_at_fault(), overlays(), title="Drop", command="rollover diagnose drop_test rec", **about
        )
    if kind == "prove":
        rows = [row("case-0001", "single", "mass", "mass"), row("case-0002", "null", "", "soil-layer")]
        proved = {"seed": 7, "summary": tally(rows), "rows": rows, "seal": {"digest": HASH, "algorithm": "sha256"}}
        return proof.page(proved, command="rollover prove --cases 2", versions=VERSIONS)
    if kind == "study":
        return written(folder, 24).read_text(encoding="utf-8")
    load = Difference(
        load="rops/force", filter="CFC 60", unit="N", was=18e3, now=19e3, time_was=2.0, time_now=2.1, change=0.06,
        tolerance=0.02, same=False,
    )  # fmt: skip
    answers = [Answer(scenario="tip", verdict="changed", sentence="1 of 1 changed", differences=(load,))]
    return regression.page(answers, command="rollover regress tip", scenario_hash=HASH)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    found = {}
    for kind in EVERY:
        found[kind] = folder / f"{kind.replace(' ', '_')}.html"
        found[kind].write_text(page_of(kind, folder), encoding="utf-8")
    return found


def test_all_share_one_look_and_say_what_they_rest_on(pages: dict[str, Path]) -> None:
    styles = set()
    for kind in KINDS:
        text = pages[kind].read_text(encoding="utf-8")
        parts = Parts(text)
        (style,) = re.findall(r"<style>(.*?)</style>", text, flags=re.DOTALL)
        styles.add(style)
        fetched = set(parts.fetched()) - ({"script"} if kind == "study" else set())  # its own, for sorting
        assert fetched == set(), kind
        footer = re.sub(r"\s+", " ", text[text.index("<footer>") :])
        assert re.search(r"<code>rollover \w+ [^<]+</code>", footer), kind
        assert re.search(r"(Scenario|Scenarios|Seal) <code>[0-9a-f]{64}( and [0-9a-f]{64})?</code>", footer), kind
        assert re.search(r"rollover \d+\.\d+\.\d+", footer), kind
    assert len(styles) == 1


def kept(kind: str, name: str) -> Path:
    """Where a picture of a kind of page is kept."""
    KEPT.mkdir(parents=True, exist_ok=True)
    return KEPT / f"{kind.replace(' ', '_')}-{name}"


needs_browser = pytest.mark.skipif(not has_browser(), reason="no chromium with playwright")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


@needs_browser
@pytest.mark.parametrize("kind", EVERY)
def test_it_reads_without_a_script_and_without_a_network(kind: str, pages: dict[str, Path], browser: Any) -> None:
    context = browser.new_context(java_script_enabled=False, offline=True, viewport={"width": 420, "height": 800})
    tab = context.new_page()
    asked: list[str] = []
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(pages[kind].as_uri())
    assert asked == [pages[kind].as_uri()]
    headline = tab.locator(".headline p").first
    assert headline.is_visible()
    assert len(headline.inner_text()) > 10
    for drawing in tab.locator("main > section > figure svg").all():
        box = drawing.bounding_box()
        assert box is not None
        assert box["width"] > 100
        assert box["height"] > 15
    kept(kind, "phone.png").write_bytes(tab.screenshot(full_page=True))
    tab.set_viewport_size({"width": 1200, "height": 900})
    kept(kind, "wide.png").write_bytes(tab.screenshot(full_page=True))
    tab.set_viewport_size({"width": 420, "height": 800})
    # on a narrow screen tables scroll by themselves, the page does not
    wide = tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 1
    context.close()


@needs_browser
@pytest.mark.parametrize("kind", EVERY)
def test_it_prints_in_full_on_light_paper(kind: str, pages: dict[str, Path], browser: Any, tmp_path: Path) -> None:
    width = round(PAPER[0] / 25.4 * 96)
    context = browser.new_context(color_scheme="dark", offline=True, viewport={"width": width, "height": 900})
    tab = context.new_page()
    tab.goto(pages[kind].as_uri())
    dark = tab.evaluate("getComputedStyle(document.body).backgroundColor")
    tab.emulate_media(media="print", color_scheme="dark")
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)" != dark
    assert tab.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    for folded in tab.locator("details").all():
        inside = folded.locator(":scope > *:not(summary)").first
        assert inside.bounding_box(), "folded away on paper"
        assert inside.bounding_box()["height"] > 0
    beyond = tab.evaluate(
        "[...document.querySelectorAll('table, svg, pre, code')].filter(e => e.getBoundingClientRect().width > 0)"
        ".map(e => e.getBoundingClientRect().right - document.documentElement.clientWidth)"
    )
    assert max(beyond, default=0.0) <= 1.0, "cut off at the edge of the paper"
    paper = tab.pdf(prefer_css_page_size=True)
    assert paper.startswith(b"%PDF")
    kept(kind, "paper.pdf").write_bytes(paper)
    sheets = {tuple(round(float(x)) for x in m) for m in re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", paper)}
    assert sheets <= {(595, 842), (596, 842)}, "A4 in points"
    context.close()


LEAST_LETTERS = 8  # px: two thirds of the 12 px of a caption, as small print is
BROKEN = """[...document.querySelectorAll("th, td.number")].flatMap(cell => {
  const walk = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT), found = [];
  for (let node = walk.nextNode(); node; node = walk.nextNode())
    for (const word of node.data.matchAll(/[^\\s-]+/g)) {
      const range = document.createRange();
      range.setStart(node, word.index); range.setEnd(node, word.index + word[0].length);
      if (new Set([...range.getClientRects()].map(r => Math.round(r.top))).size > 1) found.push(word[0]);
    }
  return found;
})"""


@needs_browser
@pytest.mark.parametrize("kind", EVERY)
def test_figures_and_captions_can_be_read_on_a_phone(kind: str, pages: dict[str, Path], browser: Any) -> None:
    context = browser.new_context(offline=True, viewport={"width": 390, "height": 800})
    tab = context.new_page()
    tab.goto(pages[kind].as_uri())
    letters = tab.evaluate("[...document.querySelectorAll('svg text')].map(e => e.getBoundingClientRect().height)")
    assert min((h for h in letters if h > 0), default=LEAST_LETTERS) >= LEAST_LETTERS
    seen = tab.evaluate(
        "[...document.querySelectorAll('caption span, figcaption')].map(e => e.getBoundingClientRect())"
        ".filter(r => r.width > 0 && (r.left < 0 || r.right > innerWidth)).length"
    )
    assert seen == 0, "captions that only a push to the side shows"
    wide = tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 1
    context.close()


@needs_browser
@pytest.mark.parametrize("kind", EVERY)
def test_no_number_and_no_heading_is_broken_on_paper(kind: str, pages: dict[str, Path], browser: Any) -> None:
    width = round(PAPER[0] / 25.4 * 96)
    context = browser.new_context(offline=True, viewport={"width": width, "height": 900})
    tab = context.new_page()
    tab.goto(pages[kind].as_uri())
    tab.emulate_media(media="print")
    assert tab.evaluate(BROKEN) == []
    context.close()


@needs_browser
def test_a_table_of_long_words_leaves_numbers_and_headings_whole(browser: Any, tmp_path: Path) -> None:
    words = (
        "load 'crush-rear' reached at 2 mm and 60.0 kN, 0 mm permanent set, of what the sequence asks of such a tractor"
    )
    rows = [[f"OECD Code 4: {words}", "43.5 kN", "1234.567 kN", "impact-speed, momentum", words, "2.836", "14.79"]] * 2
    heads = ("requirement", "asked", "simulated", "verdict", "how", "at, s", "CFC 60")
    table = Table(columns=heads, rows=rows, numeric=(1, 2, 5, 6))
    path = tmp_path / "table.html"
    path.write_text(
        render(
            title="Table", headline=Headline(sentence="A table."), blocks=[table], footer=Footer(command="rollover x")
        ),
        encoding="utf-8",
    )
    context = browser.new_context(offline=True, viewport={"width": round(PAPER[0] / 25.4 * 96), "height": 900})
    tab = context.new_page()
    tab.goto(path.as_uri())
    tab.emulate_media(media="print")
    assert tab.evaluate(BROKEN) == []
    wide = tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 1, "and nothing is cut off"
    context.close()
