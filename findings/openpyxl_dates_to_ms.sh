#!/usr/bin/env bash
# A column of date-times in a workbook, sampled at 4 kHz: every stamp is another number in the file.
# Expected: as many different stamps when it is read back; a day is kept to 7e-12 of itself, less than 1 us.
# Seen: openpyxl rounds each cell of a date to a whole millisecond, so that four samples share a stamp, and at 600 Hz
# the steps are 1 ms and 2 ms in turn. With the cells' format set to a number the same file gives them to 1 us.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet "openpyxl==3.1.5"
"$work/venv/bin/python" - "$work" <<'P'
import datetime as dt
import sys

import openpyxl

start = dt.datetime(2024, 5, 1, 10)
found = {}
for rate in (4000, 600):
    stamps = [start + dt.timedelta(seconds=k / rate) for k in range(40)]
    book = openpyxl.Workbook()
    for stamp in stamps:
        book.active.append([stamp])
    book.save(f"{sys.argv[1]}/{rate}.xlsx")
    sheet = openpyxl.load_workbook(f"{sys.argv[1]}/{rate}.xlsx").active
    back = [row[0] for row in sheet.iter_rows(values_only=True)]
    steps = sorted({round((b - a).total_seconds() * 1e6) for a, b in zip(back, back[1:])})
    found[rate] = (len(set(stamps)), len(set(back)), steps)
    print(f"{rate} Hz: {found[rate][0]} stamps written, {found[rate][1]} different ones read, steps of {steps} us")
print("openpyxl", openpyxl.__version__)
sys.exit(0 if found[4000][1] < 15 and found[600][2] == [1000, 2000] else 1)
P
