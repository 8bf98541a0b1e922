"""The page of a study: what it says, and what a real browser makes of it, from disk and without a network."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.assessment import results
from rollover.spec import document
from rollover.studies.summary import answers
from tests.rollover.studies import made_up
from tests.viz.html import Parts
from viz.content.blocks import Cases, Footer, Headline
from viz.pages.page import render
from viz.pages.study import page

CASES = 240
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def json_of(study: Any, done: Any) -> dict[str, Any]:
    """What the command writes, but for the parts that need a folder."""
    head = {
        "title": study.title,
        "scenario_hash": document.content_hash(study.scenario),
        "versions": results.versions(),
    }
    found = {**head, **answers(study, done), "reliability": None}
    found["worst"] = {**found["outputs"][0]["worst"], "file": "worst.yaml"}
    plain: dict[str, Any] = results.plain(found)
    return plain


def written(folder: Path, cases: int) -> Path:
    study, done = made_up(folder, cases)
    path = folder / f"report-{cases}.html"
    path.write_text(page(study, done, json_of(study, done), command="rollover study drops"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("report"), CASES)


def test_what_it_says_without_a_script(report: Path) -> None:
    parts = Parts(report.read_text(encoding="utf-8"))
    assert parts.fetched() == ["script", "script"], "the data of the table, and what sorts it; nothing from elsewhere"
    said = parts.said
    assert "12 of 240 cases failed" in said
    assert "its process ended with exit code -6" in said
    assert ["impact-speed", "228", "100 %", "47.4 %"] in parts.rows
    assert "rollover run worst.yaml repeats it" in said
    heading = parts.rows.index(next(row for row in parts.rows if row[:3] == ["point", "speed, m/s", "soil, factor"]))
    first = parts.rows[heading + 1]
    assert first[0] == "0"
    assert float(first[3]) == pytest.approx(float(first[1]) ** 2 * float(first[2]), rel=1e-5)
    assert len([t for t, _ in parts.tags if t == "svg"]) == 8  # two outputs: distribution, tornado, two responses


def test_a_plan_says_how_many_cases_pass_the_limit(tmp_path: Path) -> None:
    study, done = made_up(tmp_path, 40)
    found = json_of(study, done)
    limit = found["outputs"][0]["limit"]
    beyond = {"beyond": "above", "limit": limit, "hits": 11, "cases": 38, "failed": 2}
    found["outputs"][0] |= {"exceedance": None, "beyond_limit": beyond}
    text = page(study, done, {**found, "drawn": False}, command="rollover study drops")
    head = text[text.index('class="headline') :].partition("</div>")[0]
    assert f", above {1e-3 * limit:.4g} kN in 11 of 38 cases." in head


def test_data_cannot_break_out_of_the_page() -> None:
    words = ["</script><b>", 'a "quoted" & <i>']
    cases = Cases(columns=[("x", [1.0, None]), ("in words", words)])
    text = render(title="t", headline=Headline(sentence="s"), blocks=[cases], footer=Footer(command="c"))
    parts = Parts(text)
    assert not [t for t, _ in parts.tags if t in ("b", "i")]
    data = text.split('<script type="application/json">')[1].split("</script>")[0]
    assert json.loads(data) == [[1, None], words]


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="of different lengths"):
        Cases(columns=[("x", [1.0]), ("y", [])])


# ---------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (group browser)")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("no Chromium on this machine")
    with sync.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def opened(browser: Any, report: Path) -> Iterator[Any]:
    """The page opened from disk, offline; whatever goes wrong or is asked for elsewhere is an error."""
    context = browser.new_context(offline=True)
    tab = context.new_page()
    wrong: list[str] = []
    tab.on("pageerror", lambda e: wrong.append(str(e)))
    tab.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    tab.on("request", lambda r: wrong.append(r.url) if r.url != report.as_uri() else None)
    tab.goto(report.as_uri())
    yield tab
    context.close()
    assert wrong == []


def column(tab: Any, k: int) -> list[str]:
    found: list[str] = tab.locator(f".cases tbody tr td:nth-child({k})").all_inner_texts()
    return found


def test_every_figure_is_there(opened: Any) -> None:
    boxes = opened.locator("figure svg").evaluate_all(
        "all => all.map(s => [s.getBoundingClientRect(), s.querySelectorAll('path, use, rect').length])"
    )
    assert len(boxes) == 8
    for box, shapes in boxes:
        assert box["width"] > 200
        assert box["height"] > 60
        assert shapes > 10


def test_sorting(opened: Any) -> None:
    force = opened.locator(".cases th button", has_text="ground/force_normal")
    force.click()
    rising = [float(x) for x in column(opened, 4)]
    assert len(rising) == 50
    assert rising == sorted(rising)
    force.click()
    falling = [float(x) for x in column(opened, 4)]
    assert falling == sorted(falling, reverse=True)
    assert falling[0] > rising[-1]
    assert opened.locator('.cases th[aria-sort="descending"]').count() == 1
    while opened.locator(".on").is_enabled():
        opened.locator(".on").click()
    assert column(opened, 4)[-12:] == [""] * 12, "what failed comes last, whichever way"


def test_filtering(opened: Any, report: Path) -> None:
    where = opened.locator(".where")
    assert where.inner_text() == "1 to 50 of 240"
    opened.get_by_label("filter status").fill("cra")
    assert where.inner_text() == "1 to 12 of 12, filtered from 240"
    assert set(column(opened, 6)) == {"crash"}
    opened.get_by_label("filter point").fill(">107")
    assert [int(x) for x in column(opened, 1)] == [k for k in range(108, 240) if k % 20 == 7]
    opened.get_by_label("filter point").fill("7..27")
    assert column(opened, 1) == ["7", "27"]
    opened.get_by_label("filter point").fill("nonsense")
    assert where.inner_text() == "0 to 0 of 0, filtered from 240"
    opened.locator(".clear").click()
    assert where.inner_text() == "1 to 50 of 240"
    _, done = made_up(report.parent, CASES)
    speed = np.asarray(done.points.columns["speed"])
    opened.get_by_label("filter speed").fill("<=2")
    assert where.inner_text().endswith(f"of {int((speed <= 2.0).sum())}, filtered from 240")


def test_ten_thousand_cases_are_a_page_like_any_other(browser: Any, tmp_path: Path) -> None:
    path = written(tmp_path, 10_000)
    assert path.stat().st_size < 3_000_000
    tab = browser.new_page()
    tab.goto(path.as_uri())
    assert tab.locator(".where").inner_text() == "1 to 50 of 10000"
    assert tab.locator(".cases tbody tr").count() == 50
    tab.get_by_label("filter point").fill("9999")
    assert column(tab, 1) == ["9999"]
    tab.close()
