"""README and documentation as a new user follows them: every block is run in order, and all that is named exists.

Tutorials are run where the site is built; other pages here.
"""

from __future__ import annotations

import html
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

import rollover as rollover_package
from rollover.cli.main import app
from rollover.spec.document import shipped_folder
from tests.rollover import forked
from tests.viz.picture import has_software_driver

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
import notebooks  # noqa: E402
import widths  # noqa: E402

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
FOLDERS = ("docs", "ground", "rollover", "viz", "scenarios", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(p for folder in FOLDERS for p in (ROOT / folder).rglob("*.md"))])
BY_CI = "make demo"  # what .ci/run does by itself; here the line that make runs
COMMANDS = {c.name or c.callback.__name__ for c in app.registered_commands if c.callback}


KEEPERS = (  # commands that leave a folder of results
    "calibrate", "compare", "diagnose", "identify", "plan", "regress", "rolling", "rops", "run", "stability", "study",
    "synthesize",
)  # fmt: skip
BLOCK = re.compile(r"(^<!-- not run: .*? -->\n)?^```(\w+)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
ANSWERS = {  # tutorial -> what stands among the outputs on its page
    "first_overturn": ("ROPS force: at most", "Converged:", "Written: side_overturn.html", "within the step"),
    "notebook": ("rops/force", "<img", "3600 kg:", "ground/force_normal", "missing-physics", "above 4000 N:", "True "),
    "own_tractor": ("own_tractor.yaml: vehicle, valid", "Least static stability", "not met", "All 9 requirements"),
    "design_load": ("design.yaml: study, valid", "lies above 4 kN in", "64 cases, 95 %"),
    "logger_data": ("no fault of a sensor found", "ISO 18571", "stiffness_scale", "missing-physics: Below 0.1 m"),
    "own_model": ("missing-physics: ", "cubic-stiffness", "Results: out/shaken"),
    "ci_gate": ("1 baseline written", "No peak load has moved"),
}
TUTORIALS = [f"docs/tutorials/{name}.md" for name in ANSWERS]
RUN = [
    "README.md",
    "docs/commands.md",
    "docs/inputs.md",
    "docs/occupant.md",
    "docs/articulated.md",
    "docs/machines.md",
    "docs/own_law.md",
    "docs/viewing.md",
    "docs/python.md",
    "docs/proof.md",
    "docs/validation.md",
    "docs/estimation.md",
    "docs/discrepancy.md",
    "docs/integrators.md",
    "docs/plan_next_test.md",
    "docs/rops_from_sections.md",
    "rollover/README.md",
]
ELSEWHERE = {  # page -> its blocks that are not run here, and why
    "docs/engineers_day.md": 0,  # a table
    "docs/how_to_add.md": 6,  # diffs, tried by test_how_to_add.py; a profile of a folder that is nobody's
    "scenarios/studies/README.md": 5,  # studies of 256 overturns, a cluster, readers of their tables
    "ground/README.md": 1,  # a law, tried by test_laws_contract.py
    "viz/README.md": 1,  # a fragment of a page
}
NOT_RUN = {"docs/proof.md": 8}  # blocks that say why: campaigns of hours


def blocks(page: str) -> list[tuple[bool, str, str]]:
    """Blocks of a page: whether it is said not to be run, its language, its text."""
    found = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    return [(bool(mark), language, body) for mark, language, body in found]


def shell_lines(page: str) -> list[str]:
    """Commands of all sh blocks of a page that are to be run, without their comments."""
    bodies = [body for skipped, language, body in blocks(page) if language == "sh" and not skipped]
    lines = [re.split(r"\s+#\s", line)[0].strip() for body in bodies for line in body.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def made_by_make() -> str:
    """What `make demo` runs after setting up."""
    (line,) = re.findall(r"^demo: setup\n\t(\S*rollover .*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    return str(line)


def rollover(line: str) -> Any:
    command, _, target = line.partition(" > ")
    done = CliRunner().invoke(app, shlex.split(command)[1:])
    if target:
        Path(target).write_text(done.stdout)
    return done


def run_line(line: str, here: Path) -> None:
    """One command as a reader types it."""
    if line == "make test":  # which runs this
        return
    if line == BY_CI:
        line = made_by_make()
    if line.startswith(".venv/bin/rollover ") and ".py" in line:  # what it loads stays in the process for good
        apart = forked.command(*shlex.split(line)[1:], cwd=here)
        assert apart.returncode == 0, f"{line}\n{apart.stdout}{apart.stderr}"
    elif line.startswith(".venv/bin/rollover "):
        done = rollover(line)
        assert done.exit_code == 0, f"{line}\n{done.output}\n{done.exception!r}"
        assert (done.stdout + done.stderr).strip() or " view " in line, f"{line}: said nothing"
        if line == made_by_make():
            assert "Not converged" not in done.output, "the first command must not end with doubts"
    elif line.startswith(".venv/bin/python -m "):
        if has_software_driver():
            words = [sys.executable, *shlex.split(line)[1:]]
            subprocess.run(words, cwd=here, check=True, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"})
    else:
        raise AssertionError(f"nobody knows how to try {line!r}")


@pytest.mark.parametrize("page", RUN)
def test_every_block_of_a_page_works_in_order(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shelf = tmp_path / "shelf"
    shutil.copytree(shipped_folder(), shelf)  # one of the lines writes a baseline anew,
    stale = shelf / "baselines" / "drop_test.yaml"  # of which nothing is new on the machine that made it
    stale.write_text(stale.read_text().replace("numpy ", "numpy 0."))
    for module in ("rollover.spec.document.include", "rollover.spec.document"):
        monkeypatch.setattr(f"{module}.shipped_folder", lambda: shelf)
    shown: list[Path] = []
    monkeypatch.setattr("viz.recordings.viewer.open_viewer", lambda path: (shown.append(path), 0)[1])
    monkeypatch.setenv("DISPLAY", ":0")  # the viewer is a stand-in: no window is opened
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert BY_CI in (ROOT / ".ci" / "run").read_text()
    names: dict[str, Any] = {}
    passed_over = 0
    for skipped, language, body in blocks(page):
        file = re.match(r"# (\S+\.(?:yaml|csv))\n", body)
        if skipped:
            passed_over += 1
        elif language == "sh":
            for line in body.splitlines():
                command = re.split(r"\s+#\s", line)[0].strip()
                if command and not command.startswith("#"):
                    run_line(command, here)
        elif language == "python":
            exec(compile(body, page, "exec"), names)
        elif language == "yaml" and file:
            (here / file[1]).parent.mkdir(exist_ok=True)
            (here / file[1]).write_text(body)
        else:
            assert language == "text", f"{page}: nobody knows how to try {language}"
    assert passed_over == NOT_RUN.get(page, 0)
    CHECKS.get(page, lambda here, shelf, shown: None)(here, shelf, shown)


def after_the_readme(here: Path, shelf: Path, shown: list[Path]) -> None:
    assert shown == [Path("out/demo/recording.rrd")]


def after_the_commands(here: Path, shelf: Path, shown: list[Path]) -> None:
    for written in ("shared/d3.mme.zip", "scenario.schema.json"):
        assert (here / written).stat().st_size > 1000
    assert "clay of another field" in (shelf / "baselines" / "drop_test.yaml").read_text()
    assert "clay of another field" not in (shipped_folder() / "baselines" / "drop_test.yaml").read_text()


CHECKS: dict[str, Callable[[Path, Path, list[Path]], None]] = {
    "README.md": after_the_readme,
    "docs/commands.md": after_the_commands,
}


def test_no_block_of_a_page_is_passed_over_in_silence() -> None:
    pages = {str(p.relative_to(ROOT)) for p in PAGES}
    assert {str(p.relative_to(ROOT)) for p in (ROOT / "docs" / "tutorials").glob("*.md")} == set(TUTORIALS)
    rest = {page: len(blocks(page)) for page in pages - {*RUN, *TUTORIALS}}
    listed = {page: count for page, count in rest.items() if count or page.startswith("docs/")}
    assert listed == ELSEWHERE


def test_the_readme_is_one_screen() -> None:
    assert len(TEXT.splitlines()) <= 120


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """Strict: a heading, a link or a table that is wrong is an error; what is built asks nobody for anything."""
    pytest.importorskip("sphinx", reason="the documentation is built with the group `docs`")
    words = [sys.executable, str(ROOT / "docs" / "build.py"), str(tmp_path / "site")]
    done = subprocess.run(words, text=True, capture_output=True)
    assert done.returncode == 0, done.stderr
    built = {p.stem for p in (tmp_path / "site" / "reference").glob("*.html")}
    assert {"commands", "channels", "effects", "standards", "scenario", "vehicle", "rops", "profile"} <= built
    for page in (tmp_path / "site").rglob("*.html"):
        fetched = re.findall(r"<(?:script|img|link|iframe)[^>]+(?:src|href)=\"(?:https?:)?//[^\"]*", page.read_text())
        assert not fetched, f"{page}: {fetched}"
    python = (tmp_path / "site" / "reference" / "python.html").read_text()
    for name in set(rollover_package.__all__) - {"__version__"}:
        assert f"<h2>{name}<" in python, f"{name}: a public name that the reference does not have"
    assert "Path of a YAML file, or a name such as" in python
    for name, answers in ANSWERS.items():
        told = outputs((tmp_path / "site" / "docs" / "tutorials" / f"{name}.html").read_text())
        for answer in answers:
            assert answer in told, f"{name}: {answer}: not among what the cells answered"
        assert list((tmp_path / "site").rglob(f"{name}.ipynb")), f"{name}: no notebook to take along"
    rops = (tmp_path / "site" / "reference" / "rops.html").read_text()
    assert "upper corner whose deflection is reported" in rops


def outputs(page: str) -> str:
    """Text and tags of all outputs of a page."""
    shown = re.findall(r'<div class="cell_output.*?(?=<div class="cell |</section>)', page, flags=re.DOTALL)
    return re.sub(r"</?span[^>]*>", "", html.unescape("\n".join(shown)))


def test_long_names_break_behind_their_parts() -> None:
    name = '<span class="pre">rops/mount/NAME/force_x</span>'
    assert widths.breakable(name) == '<span class="pre">rops/<wbr>mount/<wbr>NAME/<wbr>force_<wbr>x</span>'
    whole = '<a href="a/b_c.html">a/b</a> <span class="pre">--out</span> <span class="pre">0.5</span>'
    assert widths.breakable(whole) == whole
    line = '<div class="highlight-sh notranslate"><pre>run<span class="w"> </span>--no-half-step</pre></div>'
    assert '<span class="w"> </span><span class="whole">--no-half-step</span></pre>' in widths.breakable(line)


def test_a_page_is_a_notebook_with_its_blocks_as_cells() -> None:
    shell, file, bare = "```sh\nrun a \\\n  b\nrun c\n```", "```yaml\n# d/e.yaml\nx: 1\n```", "```yaml\nx: 1\n```\n"
    text = "\n\n".join(("# Title", "Words.", shell, file, bare))
    made = notebooks.notebook(text, "page")
    assert made.startswith("---\nfile_format: mystnb\n")
    assert "# Title\n\nRun when" in made
    assert "{nb-download}`page.ipynb`" in made
    cells = re.findall(r"^```\{code-cell\} ipython3\n:tags: \[(.*?)\]\n\n(.*?)^```$", made, flags=re.M | re.DOTALL)
    assert cells == [
        ("scroll-output", "%%sh\nrun a \\\n  b\n"),
        ("scroll-output", "%%sh\nrun c\n"),
        ("remove-output", "%%writefile d/e.yaml\n# d/e.yaml\nx: 1\n"),
    ]
    assert made.endswith("```yaml\nx: 1\n```\n"), "a file without a name is no cell"


def test_the_workflow_runs_what_the_page_of_the_gate_runs() -> None:
    page = "docs/tutorials/ci_gate.md"
    (flow,) = (body for _, language, body in blocks(page) if language == "yaml" and not body.startswith("# "))
    steps = [step["run"] for step in YAML(typ="safe").load(flow)["jobs"]["regress"]["steps"] if "run" in step]
    assert {step for step in steps if step.startswith(".venv")} <= set(shell_lines(page))


def test_no_page_writes_where_another_page_has_written() -> None:
    """Who follows all pages in one folder is not refused: a folder of results is that of one command alone."""
    wrote: dict[str, set[str]] = {}
    for page in (*RUN, *TUTORIALS):
        for line in shell_lines(page):
            words = shlex.split(line)
            if "rollover" not in words[0] or len(words) < 3 or words[1] not in KEEPERS:
                continue
            given = dict(pairwise(words))
            folder = given.get("--out", f"out/{words[1]}/{Path(words[2]).stem}")
            wrote.setdefault(f"{folder}/{given.get('--name', '')}", set()).add(f"{page}: {line}")
    commands = {place: {line.partition(": ")[2] for line in lines} for place, lines in wrote.items()}
    assert not [wrote[place] for place, lines in commands.items() if len(lines) > 1]
    inside = [(a, b) for a in wrote for b in wrote if b != a and b.startswith(a) and "--name" not in str(wrote[a])]
    assert not [(wrote[a], wrote[b]) for a, b in inside]


def test_commands_named_in_passing_exist() -> None:
    named = set(re.findall(r"`(?:\.venv/bin/)?rollover ([a-z]+)", TEXT))
    assert named
    assert named <= COMMANDS
    for page in (*RUN, *TUTORIALS):
        assert set(re.findall(r"rollover ([a-z]+) ", "\n".join(shell_lines(page)))) <= COMMANDS


def test_modules_and_tests_named_exist() -> None:
    texts = {page: (ROOT / page).read_text(encoding="utf-8") for page in (*RUN, *TUTORIALS)}
    modules = set(re.findall(r"python -m (tests[\w.]+)", "\n".join(texts.values())))
    assert len(modules) >= 5
    for module in modules:
        assert find_spec(module) is not None, module
    files = re.findall(r"\| `([\w/]+\.py)` \|$", texts["docs/validation.md"], flags=re.MULTILINE)
    assert len(files) >= 10
    for file in files:
        assert (ROOT / "tests" / file).is_file(), file


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_every_folder_that_people_change_has_its_page() -> None:
    pages = {str(p.relative_to(ROOT)) for p in PAGES}
    for folder in ("ground", "rollover", "rollover/diagnosis", "rollover/proof", "rollover/effects"):
        assert f"{folder}/README.md" in pages
        assert f"({folder}/README.md)" in TEXT
    for folder in ("rollover/recording/importers", "viz", "scenarios", "tests"):
        assert f"({folder}/README.md)" in TEXT


def test_the_picture_is_small() -> None:
    (picture,) = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", TEXT)
    assert 20_000 < (ROOT / picture).stat().st_size < 200_000
