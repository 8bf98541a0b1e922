#!/usr/bin/env bash
# A TDMS file that was appended to: LabVIEW writes a new segment, and with it a new wf_start_time of the waveform.
# Expected by anyone who reads "the properties of a channel": each segment keeps its start, or a warning is given.
# Seen: nptdms keeps the last wf_start_time for all samples. Two records of 1 s that lie an hour apart become one of
# 2 s without a gap, which begins when the second one began: the first is dated an hour and a second too late.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet "npTDMS==1.13.0" "numpy==2.4.6"
"$work/venv/bin/python" - "$work/a.tdms" <<'P'
import sys

import nptdms
import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

first = np.datetime64("2024-05-01T10:00:00", "us")
second = first + np.timedelta64(1, "h")
with TdmsWriter(sys.argv[1]) as file:
    for start in (first, second):
        how = {"wf_start_time": start, "wf_start_offset": 0.0, "wf_increment": 0.1}
        file.write_segment([ChannelObject("run", "force", np.arange(10.0), properties=how)])
channel = TdmsFile.read(sys.argv[1])["run"]["force"]
time = channel.time_track(absolute_time=True)
print("npTDMS", nptdms.__version__)
print("written: 10 samples from", first, "and 10 samples from", second)
print("read:   ", time.size, "samples from", time[0], "to", time[-1])
longest = np.diff(time).max() / np.timedelta64(1, "s")
print("longest step:", longest, "s")
sys.exit(0 if time[0] == second and longest < 0.11 else 1)
P
