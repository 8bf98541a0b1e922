"""The documentation site: `python docs/build.py [FOLDER]` collects pages, adds the reference, and builds them strict.

Pages stay where they are read in the repository; what is built is a copy in which links to files that are no page are
plain text. Tutorials become notebooks, which are run (`notebooks.py`). No network is needed: theme and search come
with the packages.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import notebooks
import reference

ROOT = Path(__file__).resolve().parents[1]
HERE = ROOT / "docs"
TUTORIALS = HERE / "tutorials"
SITE = {  # caption -> pages, in the order of the menu
    "Tutorials": [
        f"docs/tutorials/{n}"
        for n in ("first_overturn", "notebook", "own_tractor", "design_load", "logger_data", "own_model", "ci_gate")
    ],
    "How to": [
        "docs/how_to_add",
        "docs/own_law",
        "docs/plan_next_test",
        "docs/engineers_day",
        "docs/rops_from_sections",
        "docs/inputs",
        "docs/occupant",
        "docs/articulated",
        "docs/machines",
        "docs/viewing",
        "docs/commands",
        "docs/python",
        "scenarios/studies/README",
        "rollover/recording/importers/README",
        "scenarios/README",
    ],
    "Explanation": [
        "ground/README",
        "docs/integrators",
        "docs/estimation",
        "docs/discrepancy",
        "docs/validation",
        "docs/proof",
        "rollover/proof/README",
        "rollover/proof/overturns/README",
        "rollover/diagnosis/README",
        "rollover/effects/README",
    ],
    "Source": [
        "rollover/README",
        "rollover/spec/document/README",
        "viz/README",
        "tests/README",
        "tests/corpus/README",
        "CHANGELOG",
    ],
}
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")


def stage(folder: Path) -> None:
    """Write every page and the generated ones into a folder."""
    pages = [ROOT / f"{name}.md" for names in SITE.values() for name in names]
    for page in [ROOT / "README.md", *pages]:
        goal = folder / ("index.md" if page == ROOT / "README.md" else page.relative_to(ROOT))
        goal.parent.mkdir(parents=True, exist_ok=True)
        text = _linked(page, {ROOT / "README.md", *pages}, folder)
        goal.write_text(notebooks.notebook(text, page.stem) if page.parent == TUTORIALS else text, encoding="utf-8")
    generated = reference.pages()
    (folder / "reference").mkdir()
    for name, text in generated.items():
        (folder / "reference" / f"{name}.md").write_text(text, encoding="utf-8")
    menu = {**SITE, "Reference": [f"reference/{name}" for name in generated]}
    trees = [f"```{{toctree}}\n:hidden:\n:caption: {c}\n\n" + "\n".join(names) + "\n```\n" for c, names in menu.items()]
    index = folder / "index.md"
    index.write_text("\n".join([index.read_text(encoding="utf-8"), *trees]), encoding="utf-8")


def _linked(page: Path, pages: set[Path], folder: Path) -> str:
    """Text of a page whose links lead to pages, pictures or elsewhere; a link to another file is its text alone."""

    def link(found: re.Match[str]) -> str:
        picture, text, target = found.groups()
        path, _, _ = target.partition("#")
        if "://" in target or not path:
            return found[0]
        aim = (page.parent / path).resolve()
        if picture:
            goal = folder / aim.relative_to(ROOT)
            goal.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(aim, goal)
            return found[0]
        if aim == ROOT / "README.md":
            return f"[{text}]({target.replace('README.md', 'index.md')})"
        if aim in pages:
            return found[0]
        if not aim.exists():
            raise SystemExit(f"{page.relative_to(ROOT)}: no such file, got {target}; a path from this page is needed")
        return text

    return LINK.sub(link, page.read_text(encoding="utf-8"))


def build(site: Path) -> int:
    """Build the site into a folder; answers 0, or 1 where there is a warning."""
    from sphinx.cmd.build import build_main

    source = site.with_name(site.name + "-source")
    for folder in (site, source):
        shutil.rmtree(folder, ignore_errors=True)
    source.mkdir(parents=True)
    stage(source)
    strict = ["--fail-on-warning", "--keep-going", "--nitpicky", "--quiet"]
    os.environ["IPYTHONDIR"] = str(source / "ipython")  # nobody's own start-up files take part in a notebook
    notebooks.prepare(source / "ipython" / "profile_default")
    return int(build_main([*strict, "-b", "html", "-c", str(HERE), str(source), str(site)]))


def main(words: Sequence[str] | None = None) -> int:
    """Build from the command line."""
    parser = argparse.ArgumentParser(description="Build the documentation site, strict.")
    parser.add_argument("site", nargs="?", type=Path, default=ROOT / "out" / "site")
    return build(parser.parse_args(words).site.resolve())


if __name__ == "__main__":
    sys.exit(main())
