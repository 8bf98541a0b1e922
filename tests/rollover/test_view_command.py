"""`rollover view --html`: where the page goes, what it says of the run, and what it does not overwrite."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.assessment import results as store
from rollover.cli.main import app
from tests.viz import example


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    store.write(Path("run"), example.drop(), (), picture=lambda path: path.write_bytes(b"rrd"))
    return Path("run")


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    calls: list[dict[str, Any]] = []

    def write_page(recording: Path, path: Path, **about: Any) -> None:
        calls.append({"recording": recording, **about})
        path.write_text("page")

    monkeypatch.setattr("viz.pages.web_page.write_page", write_page)
    return calls


def view(*words: object) -> Any:
    return CliRunner().invoke(app, ["view", *map(str, words)])


def test_it_says_what_it_rests_on(results: Path, made: list[dict[str, Any]]) -> None:
    done = view(results, "--html", "drop.html")
    assert done.exit_code == 0, done.output
    assert "Written: drop.html" in done.stdout
    (call,) = made
    answer = store.read_run_json(results)
    assert call["recording"] == results / "recording.rrd"
    assert call["title"] == answer["title"]
    assert call["footer"] == f"rollover {answer['versions']['rollover']}, scenario {answer['scenario_hash']}."
    view(results / "recording.rrd", "--html", "other.html")
    assert made[1]["title"] == answer["title"], "also by the file itself"
    (Path("alone") / "x").mkdir(parents=True)
    (Path("alone") / "compare.rrd").write_bytes(b"rrd")
    view("alone", "--html", "alone.html")
    assert (made[2]["recording"], made[2]["title"]) == (Path("alone/compare.rrd"), "compare")


def test_nothing_is_overwritten_unasked(results: Path, made: list[dict[str, Any]]) -> None:
    Path("drop.html").write_text("mine")
    done = view(results, "--html", "drop.html")
    assert (done.exit_code, done.stderr) == (2, "drop.html: exists; --force replaces it\n")
    assert Path("drop.html").read_text() == "mine"
    assert view(results, "--html", "drop.html", "--force").exit_code == 0
    assert Path("drop.html").read_text() == "page"


def test_in_a_results_folder_it_has_a_name_of_its_own(results: Path, made: list[dict[str, Any]]) -> None:
    done = view(results, "--html", results / "page.html")
    assert done.exit_code == 2
    assert "a page in a results folder is viewer.html, got 'page.html'" in done.stderr
    assert view(results, "--html", results / "viewer.html").exit_code == 0
    # and the run may be written again, which clears the page of the one before
    store.write(results, example.drop(), ())
    assert not (results / "viewer.html").exists()


def test_of_several_recordings_one_is_to_be_named(results: Path, made: list[dict[str, Any]]) -> None:
    Path("many").mkdir()
    for name in ("compare-a.rrd", "compare-b.rrd"):
        (Path("many") / name).write_bytes(b"rrd")
    done = view("many", "--html", "many.html")
    assert (done.exit_code, made) == (2, [])
    assert "several recordings, got compare-a.rrd, compare-b.rrd; name one of them" in done.stderr


def test_a_viewer_that_does_not_serve_is_one_line(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(*words: Any, **about: Any) -> None:
        raise OSError("viewer: it did not serve its web page on this machine")

    monkeypatch.setattr("viz.pages.web_page.write_page", silent)
    done = view(results, "--html", "drop.html")
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert "did not serve its web page" in done.stderr


def test_without_a_display_there_are_cures(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    opened: list[Path] = []
    monkeypatch.setattr("viz.recordings.viewer.open_viewer", lambda path: opened.append(path) or 0)
    done = view(results)
    assert done.exit_code == 2
    assert opened == []
    assert done.stderr.count("\n") == 1
    assert "`rollover view run --html viewer.html`" in done.stderr
    assert "tests.viz.picture" in done.stderr
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert view(results).exit_code == 0
    assert len(opened) == 1
