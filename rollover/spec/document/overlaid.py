"""Which key that was laid over a base breaks a rule: the one that a user can change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from rollover.spec.document.tree import Node, Place

Steps = tuple[str | int, ...]


def breaker(root: Node, at: Steps, holds: Callable[[Node], bool]) -> Place | None:
    """Place of the key without which the rule of the node at `at` holds; None where no key over a base breaks it.

    Keys are taken back from the first on, so that where several break the rule together it is the last of them. Where
    it is broken without all of them, the fault is that of the base: keys of the base over its own base come next.
    """
    while laid := list(_laid(_at(root, at), at)):
        bare = _without(root, {path for path, _ in laid})
        if not holds(bare):
            root = bare
            continue
        low, high = 0, len(laid)  # it does not hold without the first `low`, and does without the first `high`
        while high - low > 1:
            middle = (low + high) // 2
            if holds(_without(root, {path for path, _ in laid[:middle]})):
                high = middle
            else:
                low = middle
        _, node = laid[low]
        return node.laid
    return None


def _at(node: Node, steps: Steps) -> Node:
    for step in steps:
        node = dict(_children(node))[step]
    return node


def _children(node: Node) -> Sequence[tuple[str | int, Node]]:
    if isinstance(node.value, Mapping):
        return list(node.value.items())
    return list(enumerate(node.value)) if isinstance(node.value, tuple) else ()


def _laid(node: Node, path: Steps = ()) -> Iterator[tuple[Steps, Node]]:
    """Values that were laid over a base, the smallest that can be taken back by themselves, in the files' order."""
    for step, child in _children(node):
        below, at = child.over, (*path, step)
        is_part = below is not None and isinstance(child.value, (Mapping, tuple)) and child.kind == below.kind
        if child.laid is None or (is_part and any(True for _ in _laid(child))):
            yield from _laid(child, at)
        else:
            yield at, child


def _without(node: Node, paths: set[Steps], path: Steps = ()) -> Node:
    """The tree with what stood there before at `paths`, or nothing where nothing did."""
    if isinstance(node.value, Mapping):
        left = {key: _one(child, paths, (*path, key)) for key, child in node.value.items()}
        return replace(node, value={key: child for key, child in left.items() if child is not None})
    if isinstance(node.value, tuple):
        elements = [_one(child, paths, (*path, i)) for i, child in enumerate(node.value)]
        return replace(node, value=tuple(child for child in elements if child is not None))
    return node


def _one(child: Node, paths: set[Steps], path: Steps) -> Node | None:
    return child.over if path in paths else _without(child, paths, path)
