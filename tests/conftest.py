"""What was not tested, in one line; `--strict-skips` fails for a test that was skipped for any other reason."""

from __future__ import annotations

from collections import Counter

import pytest

# part of a reason -> what is missing, and how to get it
MISSING = {
    "ROLLOVER_DATA": "measured recordings (ROLLOVER_DATA=FOLDER, see tests/real)",
    "vulkan": "a graphics driver (Debian: mesa-vulkan-drivers)",
    "CalculiX": "CalculiX (Debian: calculix-ccx)",
    "chromium": "a browser (Debian: chromium)",
    "rerun wheel": "the viewer, which has no wheel for this platform",
    "platform": "another platform",
}


# with tests that take a minute: begun at the end one of them would leave the other workers idle for as long
LONG = (
    "tests/corpus/",
    "tests/viz/test_shipped.py",
    "tests/fuzz/",
    "tests/diagnosis/test_blind.py",
    "tests/diagnosis/test_discrepancy.py",
    "tests/diagnosis/test_whole_pairs.py",
    "tests/rollover/test_killed.py",
    "tests/rollover/test_study_faults.py",
    "tests/rollover/test_readme.py",
    "tests/real/",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: not item.nodeid.startswith(LONG))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--strict-skips", action="store_true", help="fail where a skip is not the machine's or the data's")


def _reasons(reporter: pytest.TerminalReporter) -> Counter[str]:
    found: Counter[str] = Counter()
    for report in reporter.stats.get("skipped", []):
        where = report.longrepr
        found[str(where[2] if isinstance(where, tuple) else where).removeprefix("Skipped: ")] += 1
    return found


def _is_known(reason: str) -> bool:
    return any(mark.lower() in reason.lower() for mark in MISSING)


def pytest_sessionfinish(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or not session.config.getoption("--strict-skips"):
        return
    if not all(map(_is_known, _reasons(reporter))):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reasons = _reasons(terminalreporter)
    if not reasons:
        return
    counts: Counter[str] = Counter()
    for reason, count in reasons.items():
        cause = next((text for mark, text in MISSING.items() if mark.lower() in reason.lower()), f"not known: {reason}")
        counts[cause] += count
    each = "; ".join(f"{count} for want of {cause}" for cause, count in counts.items())
    terminalreporter.write_line(f"Not tested: {each}")
