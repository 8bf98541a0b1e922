"""Words from data on every kind of page, in a real browser: they are shown, and nothing of them runs or is fetched."""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.assessment import results
from rollover.assessment.loads import peak_loads
from rollover.calibration.calibrate import Calibration, Estimate, Score, Scores
from rollover.comparison.misfit import misfit
from rollover.comparison.run_pair import pair, read
from rollover.proof.summary import tally
from rollover.recording import Recording
from rollover.recording.time_stamps import Zero
from rollover.studies.baseline import Answer
from tests.rollover.diagnosed import overlays, sensor_at_fault
from tests.rollover.studies import made_up
from tests.viz import example, spoilt
from tests.viz.browser import CHROMIUM, has_browser
from tests.viz.html import Parts
from tests.viz.test_proof_page import row
from tests.viz.test_study_page import json_of as made_account
from viz import pages
from viz.content.blocks import Cases, Details, Figure, Footer, Headline, Note, Pairs, Section, Table
from viz.content.embedded import embedded, in_script, policy
from viz.figures.plots import Curve, history
from viz.pages import calibration, comparison, diagnosis, proof, regression, report
from viz.pages import pair as pair_page
from viz.pages import study as study_page
from viz.pages.page import render
from viz.pages.web_page import Viewer
from viz.pages.web_page import page as viewer_page

RUN = "document.documentElement.dataset.marked='yes'"
MARKS = (
    f"</script><script>{RUN}</script>",
    f"</SCRIPT ><ScRiPt>{RUN}</ScRiPt>",
    f"<!--<script>{RUN}</script>-->",
    f'</title></style></svg><svg onload="{RUN}">',
    f'<img src=x onerror="{RUN}">',
    f'" autofocus onfocus="{RUN}" x="',
    f']]><a href="javascript:{RUN}">a</a>{{{{ 7*7 }}}}',
    f"\u2028;{RUN};//\u2029",
    "$\\frac{$ & </p>",
)
HOSTILE = " ".join(MARKS)
KINDS = (
    "run",
    "compare",
    "two runs",
    "diagnose",
    "prove",
    "score",
    "regress",
    "study",
    "calibrate",
    "every block",
    "viewer",
)
KINDS += tuple(spoilt.PAGES)
ABOUT: dict[str, Any] = {"scenario_hash": HOSTILE, "versions": {HOSTILE: HOSTILE}}


def calibrated() -> Calibration:
    """A calibration with the marks in every word that is not the program's own."""
    score = Score(over_noise=1.0, nrmse=0.1, iso18571=0.9, peak_force_error=0.01)
    scores = Scores(recordings=(HOSTILE,), before=score, after=score)
    values = dict.fromkeys(("start", "value", "low", "high", "alone_low", "alone_high"), 1.0)
    words: dict[str, Any] = {"path": HOSTILE, "unit": HOSTILE, "method": "profile", "at_bound": "", "why": HOSTILE}
    estimate = Estimate(**words, **values, bounds=(0.0, 2.0), open_low=False, open_high=False, determined=False)
    scenario = replace(example.drop().scenario, title=HOSTILE)
    return Calibration(
        scenario=scenario,
        calibrated=scenario,
        estimates=(estimate, estimate),
        correlation=np.eye(2),
        condition=1.0,
        combinations=(HOSTILE,),
        clocks={HOSTILE: 0.001},
        clock_errors={HOSTILE: 1e-4},
        zeros={HOSTILE: Zero(late=0.001, sigma=1e-4, by="onset", why="unknown", channels=(HOSTILE,))},
        clock_sigma=1e-3,
        noise={},
        training=scores,
        held_out=scores,
        samples=9,
        independent=3.0,
        outliers=0,
        widening=1.0,
        starts_agreeing=(1, 1),
        warnings=(HOSTILE,),
    )


def page_of(kind: str, folder: Path) -> str:
    """A page with the marks wherever words from data stand."""
    if kind == "run":
        run = example.overturn()
        run = replace(run, scenario=replace(run.scenario, title=HOSTILE), sentence=HOSTILE)
        answer = {**ABOUT, "files": [HOSTILE], "half_step": None}
        return report.page(run, peak_loads(run), answer, command=HOSTILE)
    if kind == "compare":
        run = example.drop()
        force = {n: 1.1 * v for n, v in run.recording.channels.items() if n.startswith("ground/f")}
        measured = Recording(title=HOSTILE, time=run.recording.time, channels=force, notes=(HOSTILE,))
        found = misfit(run, measured, name=HOSTILE, noise=lambda r, c: 20.0)
        return comparison.page([found], title=HOSTILE, command=HOSTILE, **ABOUT)
    if kind == "two runs":
        for name, run in (("was", example.drop()), ("now", example.drop(2.0))):
            results.write(folder / name, replace(run, scenario=replace(run.scenario, title=HOSTILE)), peak_loads(run))
        return pair_page.page(
            pair(read(folder / "was"), read(folder / "now")), command=HOSTILE, versions={"a": HOSTILE}
        )
    if kind == "diagnose":
        found = replace(sensor_at_fault(), notes=(HOSTILE,), sentence=HOSTILE)
        shown = tuple(replace(t, recording=HOSTILE) for t in overlays())
        return diagnosis.page(found, shown, title=HOSTILE, command=HOSTILE, **ABOUT)
    if kind in ("prove", "score"):
        rows = [row(HOSTILE, "single", "mass", "mass"), row("case-0002", "null", "", HOSTILE)]
        whose = {"seed": 7} if kind == "prove" else {"by": HOSTILE}
        proved = {**whose, "summary": tally(rows), "rows": rows, "seal": {"digest": HOSTILE, "algorithm": HOSTILE}}
        return proof.page(proved, command=HOSTILE, versions={HOSTILE: HOSTILE})
    if kind == "regress":
        answer_ = Answer(scenario=HOSTILE, verdict="failed", sentence=HOSTILE, notes=(HOSTILE,))
        return regression.page([answer_], command=HOSTILE, scenario_hash=HOSTILE)
    if kind == "study":
        study, done = made_up(folder, 120)
        study = replace(study, title=HOSTILE)
        return study_page.page(study, done, made_account(study, done), command=HOSTILE)
    if kind in spoilt.PAGES:
        return spoilt.PAGES[kind](HOSTILE)
    if kind == "calibrate":
        return calibration.page(calibrated(), command=HOSTILE, **ABOUT)
    if kind == "viewer":
        script = "var wasm_bindgen = async () => {}; // WebHandle </SCRIPT><script>" + RUN
        return viewer_page(b"rrd", Viewer(script=script, program=b""), title=HOSTILE, footer=HOSTILE)
    svg = history(
        [Curve(x=[0.0, 1.0], y=[0.0, 1.0], name=HOSTILE, role="first")], label=HOSTILE, phases=[(0.0, HOSTILE)]
    )
    blocks = [
        Pairs(rows=[(HOSTILE, HOSTILE)]),
        Table(columns=[HOSTILE], rows=[[HOSTILE]], caption=HOSTILE),
        Figure(svg=svg, caption=HOSTILE),
        Note(text=HOSTILE, warning=True),
        Cases(columns=[(HOSTILE, [HOSTILE, *MARKS] * 10), ("n", list(range(100)))], caption=HOSTILE),
    ]
    inside = [Section(title=HOSTILE, blocks=blocks), Details(summary=HOSTILE, blocks=blocks)]
    headline = Headline(sentence=HOSTILE, detail=HOSTILE)
    footer = Footer(command=HOSTILE, **ABOUT, hash_of=HOSTILE)
    return render(title=HOSTILE, subtitle=HOSTILE, headline=headline, blocks=inside, footer=footer)


def test_no_kind_of_page_is_left_out() -> None:
    """Whatever writes a page is among `KINDS`: one that is added later is tried too."""
    by_kind = {"run": "report", "compare": "comparison", "two runs": "pair", "diagnose": "diagnosis", "prove": "proof"}
    by_kind |= {"score": "proof", "identification of a cone": "identification"}
    by_kind |= {"regress": "regression", "calibrate": "calibration", "viewer": "web_page", "every block": "page"}
    write = {m.name for m in pkgutil.iter_modules(pages.__path__) if _writes_a_page(m.name)}
    assert write == {by_kind.get(kind, kind) for kind in KINDS} - {"page"}


def _writes_a_page(name: str) -> bool:
    return callable(getattr(importlib.import_module(f"viz.pages.{name}"), "page", None))


@pytest.mark.skipif(not has_browser(), reason="no chromium with playwright")
@pytest.mark.parametrize("kind", KINDS)
def test_no_mark_runs_and_nothing_is_fetched(kind: str, tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    path = tmp_path / "page.html"
    path.write_text(page_of(kind, tmp_path), encoding="utf-8")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = browser.new_context(offline=True).new_page()
        asked: list[str] = []
        said: list[str] = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.on("console", lambda message: said.append(message.text))
        tab.goto(path.as_uri())
        tab.wait_for_timeout(300)
        assert tab.evaluate("document.documentElement.dataset.marked") is None, "a mark ran"
        assert asked == [path.as_uri()]
        assert not [s for s in said if "Content Security Policy" in s], "a mark got as far as the policy"
        if kind != "viewer":
            assert MARKS[0] in tab.inner_text("body"), "it is shown as the words that it is"
        if kind in ("study", "every block"):
            assert tab.locator(".cases .tools").first.is_visible(), "the page's own script runs"
            tab.locator(".cases .on").first.click()
            assert tab.evaluate("document.documentElement.dataset.marked") is None
        browser.close()


@pytest.mark.skipif(not has_browser(), reason="no chromium with playwright")
def test_the_policy_stops_what_would_get_into_a_page(tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    for kind in ("every block", "viewer"):
        text = page_of(kind, tmp_path).replace("<body>", f'<body><script>{RUN}</script><img src=x onerror="{RUN}">')
        (tmp_path / "page.html").write_text(text, encoding="utf-8")
        with sync_playwright() as play:
            browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            tab = browser.new_context(offline=True).new_page()
            tab.goto((tmp_path / "page.html").as_uri())
            tab.wait_for_timeout(300)
            assert tab.evaluate("document.documentElement.dataset.marked") is None, kind
            browser.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_parser_sees_no_element_of_a_mark(kind: str, tmp_path: Path) -> None:
    text = page_of(kind, tmp_path)
    rules = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text, re.IGNORECASE)
    assert rules is not None
    import html

    rule = dict(r.strip().split(" ", 1) for r in html.unescape(rules[1]).split(";"))
    assert "unsafe-inline" not in rule["script-src"]
    assert rule["default-src"] == rule["connect-src"] == rule["base-uri"] == rule["form-action"] == "'none'"
    if kind != "viewer":
        parts = Parts(text)
        assert not [a for _, a in parts.tags if any(k.startswith("on") for k in a)]
        assert not [t for t, _ in parts.tags if t == "img"]


@pytest.mark.parametrize("mark", MARKS)
def test_embedded_values_come_back_and_hold_no_sign_of_a_page(mark: str) -> None:
    text = embedded([mark, {"a": mark}])
    assert json.loads(text) == [mark, {"a": mark}]
    assert not set("<>&\u2028\u2029") & set(text)


def test_a_script_keeps_what_its_strings_mean() -> None:
    assert in_script("a = '</ScRiPt><!--'; b < c") == "a = '<\\/ScRiPt><\\!--'; b < c"
    assert "script-src 'none'" in policy([])
