"""Names from data and the command line that become files, and words from data that a terminal shows."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from rollover.cli import console
from rollover.cli.main import app
from rollover.recording import Recording
from rollover.recording.importers import read_recording, write_recording
from rollover.system.errors import Fault, InputError
from rollover.system.names import distinct, inside, spelt

BAD = [
    "",
    ".",
    "..",
    "a/b",
    "../a",
    "/etc/a",
    "a\\b",
    "a\0b",
    "a\nb",
    "a\x1b[2Jb",
    "con",
    "NUL.csv",
    "a.",
    ".a",
    "x" * 256,
]
BAD += ["a:b", "a\u202eb", "lpt1", "é" * 128, "a ", "a?"]


@pytest.mark.parametrize("name", BAD)
def test_a_name_that_is_no_files_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        inside(tmp_path, name, file="--name")
    said = str(caught.value)
    assert said.startswith("--name: not a file's name")
    assert "one plain name of at most 255 bytes is allowed" in said
    assert said.isprintable()


@pytest.mark.parametrize("name", ["toss001", "Versuch 3 – Lehm.csv", "a.b", "-1", "名前", "x" * 251])
def test_any_other_name_stays_as_it_is(name: str, tmp_path: Path) -> None:
    assert inside(tmp_path, name) == tmp_path / name
    assert spelt(name, ".csv") == name


@pytest.mark.parametrize("name", BAD)
def test_a_name_from_data_is_spelt_so_that_it_is_one(name: str, tmp_path: Path) -> None:
    path = inside(tmp_path, f"{spelt(name, '.csv')}.csv")
    assert path.parent == tmp_path
    path.write_text("")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_long_names_stay_apart() -> None:
    made = distinct(["x" * 300 + "a", "x" * 300 + "b"], ".csv", file="f")
    assert len(set(made.values())) == 2


@pytest.mark.parametrize("names", [("a/b", "a:b"), ("a", "a"), ("Kies", "kies"), ("e\u0301", "\xe9"), ("a\0", "a\x1b")])
def test_two_names_that_would_be_one_file_are_refused(names: tuple[str, str]) -> None:
    with pytest.raises(InputError, match=r"^set\.csv: two recordings would be one file"):
        distinct(names, ".csv", file="set.csv")


BALLS = "ball,drop,t_s,h_m,v_mps\n" + "".join(
    f"{ball},{drop},{t},{5 - t},{-t}\n" for ball, drop in (("Golf", "{0}"), ("Golf", "2")) for t in (0.0, 0.1, 0.2)
)


def balls(folder: Path, cell: str) -> Path:
    path = folder / "ball_drops.csv"
    path.write_text(BALLS.replace("{0}", cell))
    (folder / "balls.txt").write_text("")
    return path


@pytest.mark.parametrize("cell", ["../../out", "/elsewhere/x", "..", "1/../../x", "a\x1b[31m"])
def test_a_cell_that_is_part_of_a_name_leads_nowhere_else(cell: str, tmp_path: Path) -> None:
    source = balls(tmp_path, cell)
    out = tmp_path / "deep" / "out"
    before = set(tmp_path.rglob("*"))
    result = rollover("import", source, "--as", "falling-balls", "--out", out)
    assert result.exit_code == 0, result.output
    new = set(tmp_path.rglob("*")) - before - {out, out.parent}
    assert len(new) == 4
    assert {p.parent for p in new} == {out}
    odd = next(p for p in new if p.suffix == ".csv" and p.stem != "golf-2")
    assert f"{odd}: stands for" in result.stderr
    assert "which is no name for a file" in read_recording(odd).notes[-1]
    assert "\x1b" not in result.output


def test_two_cells_that_would_be_one_file_are_not_one(tmp_path: Path) -> None:
    source = balls(tmp_path, "a/b")
    source.write_text(source.read_text().replace("Golf,2", "Golf,a:b"))
    result = rollover("import", source, "--as", "falling-balls", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "two recordings would be one file" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["../d", "a/b", "x" * 300, "nul"])
def test_a_name_on_the_command_line_stays_in_out_too(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rollover.dynamics.simulate.run", lambda *a, **k: pytest.fail("it was simulated first"))
    result = rollover("synthesize", "drop_test", "--out", tmp_path / "out", "--name", name)
    assert result.exit_code == 2
    assert result.stderr.startswith("--name: not a file's name")
    assert list(tmp_path.iterdir()) == []


def test_what_a_process_left_beside_recordings_is_none(tmp_path: Path) -> None:
    from rollover.recording.importers import recordings_at

    made = Recording(title="d", time=np.arange(3.0), channels={"ground/sinkage": np.arange(3.0)})
    write_recording(made, tmp_path / "d.csv")
    (tmp_path / ".d.csv.lock").write_text("1")
    assert recordings_at(tmp_path) == [tmp_path / "d.csv"]


# ---- what a terminal shows

MARKS = "\x1b]0;title\x07\r\x1b[2J\u202eevil\u2066\x9b31m\u2028\x00\ud800"


def test_a_fault_shows_no_sign_that_a_terminal_obeys() -> None:
    said = str(Fault(file=f"a{MARKS}.csv", path=f"vehicle.{MARKS}", message=f"unknown, got {MARKS}; x is allowed"))
    assert said.isprintable()
    assert said.startswith("a\\x1b]0;title\\x07\\r")
    assert said.endswith("; x is allowed")
    said.encode("utf-8")


@pytest.mark.parametrize(
    "message",
    ["not a number, got '{0}'; a number is allowed", "not a number, got {0}; a number is allowed", "'{0}': no such; a"],
)
@pytest.mark.parametrize("value", ["x" * 5000, "x y; " * 900, "'\"" * 2000])
def test_of_a_long_value_the_beginning_is_shown(message: str, value: str) -> None:
    said = str(Fault(file="a.yaml", line=3, message=message.replace("{0}", value)))
    assert "characters)" in said
    assert len(said) < 1600
    if "got" in message:
        assert len(said) < 400
        assert said.endswith("; a number is allowed"), "what is allowed is still said"


def test_words_of_another_script_are_shown() -> None:
    for text in ("Lehmboden, 3 ‰ – naß", "خاک\u200cرس", "粘土 🚜"):
        assert str(Fault(message=text)) == text


def test_tables_sentences_and_progress_show_none_either(capsys: pytest.CaptureFixture[str]) -> None:
    from rich.table import Table

    table = Table(MARKS)
    table.add_row(f"{MARKS}[red]{'y' * 2000}")
    out = console.Plain(
        file=io.StringIO(), force_terminal=True, width=1000, highlight=False, markup=False, color_system=None
    )
    out.print(table)
    out.print(f":bomb: {MARKS}")
    written = out.file.getvalue()
    assert not set("\x07\r\u202e\u2066\x9b\u2028\x00\x1b") & set(written)
    assert "y" * 301 not in written
    assert "[red]" in written
    assert ":bomb:" in written
    console.say(MARKS)
    console.tell(f"a\n{MARKS}")
    with console.counting("cases") as show:
        show(1, 2, MARKS)
    said = capsys.readouterr()
    assert (said.out + said.err).replace("\n", "").isprintable()


def test_a_bar_takes_a_name_as_it_is(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with console.progress("simulating {task.nothing} [/red] \x1b[2J", 0.0, 1.0) as show:
        show(0.5, 9.0)  # neither a field to fill in nor a colour


def test_a_title_from_data_moves_no_cursor(tmp_path: Path) -> None:
    made = Recording(
        title=f"d{MARKS[:-1]}" + "t" * 5000, time=np.arange(99.0), channels={"ground/sinkage": np.sin(np.arange(99.0))}
    )
    write_recording(made, tmp_path / "d.csv")
    result = rollover("check", tmp_path / "d.csv")
    assert result.exit_code == 0, result.output
    assert result.output.replace("\n", "").isprintable()
    assert "t" * 301 not in result.output


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, [str(w) for w in words])


@pytest.mark.parametrize("quote", ["'", '"'])
@pytest.mark.parametrize(
    "allowed",
    ["the file's name, 'drop_test', is needed", "what the file's \"kind\" and the folder's name are is needed"],
)
def test_a_long_value_takes_nothing_of_its_cure_along(allowed: str, quote: str) -> None:
    """The value is cut before its closing quote, and an apostrophe of the cure is none of it."""
    said = str(Fault(file="a.yaml", path="scenario", message=f"got {quote}{'7' * 1000}{quote}; {allowed}"))
    assert said.endswith(f"characters); {allowed}"), said
    assert said.count("characters)") == 1
    assert 300 < len(said) < 450
