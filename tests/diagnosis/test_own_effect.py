"""An effect of one's own, in one file outside the package, hidden in recordings: it is named and fitted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.rollover.test_effects_contract import OWN, outside

HIDDEN = {"stiffness": 4.0e4, "depth": 0.06}
MAKE = (
    "import json, sys\n"
    "import numpy as np\n"
    "from pathlib import Path\n"
    "from rollover.recording.importers import write_recording\n"
    "from tests.diagnosis.drops import recorded\n"
    "hidden, out = json.loads(sys.argv[1]), Path(sys.argv[2])\n"
    "changes = {f'effects.soil-roots.{k}': v for k, v in hidden.items()}\n"
    "for name, r in recorded(changes, 31, speeds=(1.2, 2.2, 3.2)):\n"
    "    write_recording(r, out / f'{name}.csv')\n"
)


def test_an_own_law_is_named_among_all_candidates(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    made = outside("-c", MAKE, json.dumps(HIDDEN), str(folder), ROLLOVER_EFFECTS=str(OWN))
    assert made.returncode == 0, made.stderr
    command = ("-m", "tests.rollover.command", "--effects", str(OWN), "diagnose", "drop_test", str(folder))
    done = outside(*command, "--out", str(tmp_path / "out"), "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["verdict"] == "missing-physics"
    assert [e["id"] for e in answer["effects"]] == ["soil-roots"]
    for name, value in HIDDEN.items():
        fitted = answer["effects"][0]["parameters"][name]
        assert fitted["value"] == pytest.approx(value, rel=0.05), name
    again = outside(
        "-m",
        "tests.rollover.command",
        "--effects",
        str(OWN),
        "check",
        str(tmp_path / "out" / "scenario-diagnosed.yaml"),
    )
    assert again.returncode == 0, again.stderr
    # without the file the name means nothing
    refused = outside("-m", "tests.rollover.command", "check", str(tmp_path / "out" / "scenario-diagnosed.yaml"))
    assert refused.returncode == 2
    assert "unknown effect, got 'soil-roots'" in refused.stderr
