"""Conversions of MDF from raw to physical: numbers stay numbers beside texts, formulas are computed or refused.

asammdf makes text of a whole column where one of its raw values stands for a text, hands over raw numbers where it
cannot compute a formula, and takes whole numbers out of their ranges; so these three are applied here.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FORMULA, _TEXTS, _RANGES_OF_TEXTS = {"4": 3, "3": 10}, {"4": 7, "3": 11}, {"4": 8, "3": 12}
_RANGES = 6  # of MDF 4
_NO_NUMBERS = {9: "numbers made of text", 10: "text", 11: "text of bits"}  # of MDF 4
_FUNCTIONS = ("abs", "sqrt", "exp", "sin", "cos", "tan", "sinh", "cosh", "tanh", "log10", "floor", "ceil", "pow")
_AS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "ln": "log", "arcsin": "arcsin", "arccos": "arccos"}
_AS |= {"arctan": "arctan", **{name: name for name in _FUNCTIONS}, "pow": "power"}
_OPERATIONS = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power}
_LONGEST = 2000  # characters of a formula: the parser's time and depth are bounded by it


@dataclass
class Converted:
    """Physical numbers, with gaps where the raw value is a text; which texts, how often; the unit if said."""

    values: NDArray[np.float64]
    texts: Counter[str] = field(default_factory=Counter)
    units: set[str] = field(default_factory=set)


def converted(raw: NDArray[Any], conversion: Any, version: str) -> Converted:
    """Raw numbers of a channel, (n,), by its conversion block of an MDF `version`. Raises ``ValueError``."""
    if conversion is None:
        return Converted(raw.astype(np.float64))
    major, kind = version[:1], int(conversion.conversion_type)
    major = "4" if major == "4" else "3"
    if major == "4" and kind in _NO_NUMBERS:
        raise ValueError(_NO_NUMBERS[kind])
    if kind == _FORMULA[major]:
        found = Converted(computed(_text(conversion.formula), raw))
    elif major == "4" and kind == _RANGES:
        found = Converted(_by_ranges(raw, conversion))
    elif kind in (_TEXTS[major], _RANGES_OF_TEXTS[major]):
        found = _beside_texts(raw, conversion, major)
    else:
        found = Converted(np.asarray(conversion.convert(raw), dtype=np.float64))
    if not found.units and (unit := _text(conversion.unit)):  # parts of a table know better than the table
        found.units = {unit}
    return found


def _beside_texts(raw: NDArray[Any], conversion: Any, major: str) -> Converted:
    """A table of values or ranges, each a text or a conversion of its own; what it leaves out goes by its default."""
    found = Converted(np.full(raw.size, np.nan))
    free = np.ones(raw.size, dtype=bool)
    is_table = int(conversion.conversion_type) == _TEXTS[major]
    texts = conversion.referenced_blocks or {}
    for k in range(sum(key.startswith("text_") for key in texts) if texts else int(conversion.ref_param_nr)):
        if is_table:
            hit = raw == conversion[f"val_{k}" if major == "4" else f"param_val_{k}"]
        else:
            hit = _within(raw, conversion, k)
        _fill(found, raw, hit & free, texts[f"text_{k}"] if texts else conversion[f"text_{k}"], major)
        free &= ~hit
    _fill(found, raw, free, texts.get("default_addr"), major)
    return found


def _by_ranges(raw: NDArray[Any], conversion: Any) -> NDArray[np.float64]:
    values = np.full(raw.size, float(conversion.default))
    free = np.ones(raw.size, dtype=bool)
    for k in range((int(conversion.val_param_nr) - 1) // 3):
        hit = _within(raw, conversion, k) & free
        values[hit], free = conversion[f"phys_{k}"], free & ~hit
    return values


def _within(raw: NDArray[Any], conversion: Any, k: int) -> NDArray[np.bool_]:
    """Whether raw values lie in range k, whose upper end belongs to it for whole numbers only."""
    low, high = conversion[f"lower_{k}"], conversion[f"upper_{k}"]
    return np.asarray((raw >= low) & ((raw <= high) if raw.dtype.kind in "iu" or low == high else (raw < high)))


def _fill(found: Converted, raw: NDArray[Any], hit: NDArray[np.bool_], by: Any, major: str) -> None:
    """Values where `hit`: by a conversion, as they are where there is none, or gaps where it is a text."""
    if isinstance(by, (bytes, str)) and (text := _text(by)):
        linear = re.fullmatch(r'.*"(.*\{X\}.*)".*', text) if major == "3" else None  # a formula in the words of MDF 3
        if linear:
            found.values[hit] = computed(linear.group(1).replace("{X}", "X"), raw[hit])
        elif hit.any():
            found.texts[text] += int(hit.sum())
        return
    if by is None or isinstance(by, (bytes, str)):
        found.values[hit] = raw[hit]
        return
    inner = converted(raw[hit], by, major)
    found.values[hit] = inner.values
    found.texts += inner.texts
    found.units |= inner.units


def computed(formula: str, raw: NDArray[Any]) -> NDArray[np.float64]:
    """A formula in X or X1, such as `0.5*X1 + pow(X1, 3)`, of raw numbers. Raises ``ValueError``.

    `^` is a power of real numbers; of whole ones it is a power to some writers and exclusive or to others.
    """
    x = raw.astype(np.float64)
    try:
        if len(formula) > _LONGEST:
            raise ValueError("too long")
        if "^" in formula and raw.dtype.kind in "iu":
            raise ValueError("^ of whole numbers is a power or exclusive or; pow() is clear")
        tree = ast.parse(formula.replace("^", "**").strip(), mode="eval")
        return np.broadcast_to(np.asarray(_value(tree.body, x), dtype=np.float64), x.shape).copy()
    except (ValueError, SyntaxError, TypeError, RecursionError) as e:
        reason = e.msg if isinstance(e, SyntaxError) else e
        raise ValueError(f"its formula cannot be computed, got {formula[:80]!r}: {reason}") from None


def _value(node: ast.expr, x: NDArray[np.float64]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id="X" | "X1" | "x" | "x1"):
            return x
        case ast.UnaryOp(op=ast.USub()):
            return -_value(node.operand, x)
        case ast.UnaryOp(op=ast.UAdd()):
            return _value(node.operand, x)
        case ast.BinOp() if type(node.op) in _OPERATIONS:
            with np.errstate(all="ignore"):
                return _OPERATIONS[type(node.op)](_value(node.left, x), _value(node.right, x))
        case ast.Call(func=ast.Name(id=name), keywords=[]) if name.lower() in _AS:
            with np.errstate(all="ignore"):
                return getattr(np, _AS[name.lower()])(*(_value(each, x) for each in node.args))
    raise ValueError(f"unknown, got {ast.unparse(node)[:40]!r}; numbers, X1, + - * / ^ and {', '.join(sorted(_AS))}")


def _text(value: Any) -> str:
    text = value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value or "")
    return text.strip("\0 ")
