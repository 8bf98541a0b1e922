"""A small Python file with a model of one's own, with odd declarations where `rng` says so; all harmless."""

from __future__ import annotations

import random
import re

from tests.fuzz import seeds
from tests.fuzz.seeds import TIME, Files

LOAD, READING = "bench/load", "bench/reading"
MODEL = f'''\
"""A straight line."""

from ground.quantity import Quantity
from rollover import Parameter, Term


class Line:
    title = "A straight line"
    inputs = {{"{LOAD}": Quantity("N", "what is put on")}}
    outputs = {{"{READING}": Quantity("V", "what is read")}}
    parameters = {{"slope": Parameter(unit="V/N", low=0.0, high=10.0, start=1.0)}}
    terms = (
        Term(
            id="bend",
            family="a curve",
            equation="y = c u^2",
            parameters={{"c": Parameter(unit="V/N2", low=-2.0, high=2.0, start=0.5, null=0.0)}},
        ),
    )
    sensors = ()

    def simulate(self, time, inputs, values):
        u = inputs["{LOAD}"]
        return {{"{READING}": values["slope"] * u + values["bend.c"] * u * u}}


model = Line()
'''
RECORDED = f"""\
format: rollover-recording/1
title: a line
channels:
  t: {{channel: time, unit: s}}
  u: {{channel: {LOAD}, unit: N}}
  y: {{channel: {READING}, unit: V, noise: 0.01}}
"""
# in the place of a number, a text or a name of such a file
VALUES = ("None", "-1", "0", "1e400", "float('nan')", "10**400", "True", "'x'", "''", "()", "[]", "{}", "1j", "b'x'")
VALUES += ("'\\x1b[31m'", "'</script>'", "'../x'", "object()", "len", "'é\\u202e'", "'n' * 400", "1 / 0", "nothing")
_TOKEN = re.compile(r"""(?<![\w.])-?\d+\.?\d*\b|"[^"\n]*"(?!"")|\b(?:values|inputs|Quantity|Parameter|Term|u)\b""")


def odd(text: str, rng: random.Random) -> str:
    """Python text in which up to three numbers, texts or names are others, or a line is lost."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        if rng.random() < 0.2:
            lines = text.split("\n")
            del lines[rng.randrange(len(lines))]
            text = "\n".join(lines)
            continue
        found = list(_TOKEN.finditer(text))
        if found:
            at = rng.choice(found)
            text = text[: at.start()] + rng.choice(VALUES) + text[at.end() :]
    return text


def model(rng: random.Random | None = None) -> Files:
    """A model and two recordings of it."""
    files: Files = {"own.py": (MODEL if rng is None else odd(MODEL, rng)).encode()}
    for k in (1, 2):
        columns = {"t": TIME, "u": 100.0 * k * TIME, "y": 130.0 * k * TIME}
        files |= {f"r{k}.csv": seeds.csv(columns), f"r{k}.yaml": RECORDED.encode()}
    return files
