"""A truth that was changed after it was sealed is not the sealed truth."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest

from rollover.proof.commitment import digest, opened, sealed, write_truth
from rollover.system.errors import InputError

TRUTHS = [{"case": "case-0001", "kind": "single", "effects": [{"id": "soil-crust", "parameters": {"ratio": 1.25}}]}]


def test_what_was_sealed_can_be_opened(tmp_path: Path) -> None:
    seal = sealed(TRUTHS)
    path = write_truth(TRUTHS, seal, tmp_path)
    assert opened(seal.digest, path) == TRUTHS
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    public = json.dumps(seal.public())
    assert seal.digest in public
    assert seal.salt not in public


@pytest.mark.parametrize("what", ["number", "order", "salt", "digest", "not json", "not there"])
def test_a_changed_truth_is_refused(what: str, tmp_path: Path) -> None:
    truths = [*TRUTHS, {"case": "case-0002", "kind": "null", "effects": []}]
    seal = sealed(truths)
    path = write_truth(truths, seal, tmp_path)
    shown = seal.digest
    found = json.loads(path.read_text())
    if what == "number":
        found["truths"][0]["effects"][0]["parameters"]["ratio"] = 1.2500000000000002
    elif what == "order":
        found["truths"].reverse()
    elif what == "salt":
        found["salt"] = "0" * 64
    path.write_text("{" if what == "not json" else json.dumps(found))
    if what == "digest":
        shown = digest(TRUTHS, seal.salt)
    elif what == "not there":
        path.unlink()
    with pytest.raises(InputError):
        opened(shown, path)


def test_the_same_truth_has_another_hash_each_time() -> None:
    assert sealed(TRUTHS).digest != sealed(TRUTHS).digest
    assert sealed(TRUTHS, salt="a").digest == sealed(TRUTHS, salt="a").digest
