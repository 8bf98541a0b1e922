"""Pictures of results: recordings for the viewer, figures, pages. Reads results, changes nothing."""

import os

# what the recorder would say of a file that it cannot write, `viz.recordings.saved` finds out and raises, in one line
os.environ.setdefault("RUST_LOG", "off")

DISTRIBUTION = "rollover"  # marker: other distributions own this import name too
