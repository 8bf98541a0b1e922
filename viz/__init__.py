"""Pictures of results: recordings for the viewer, figures, pages. Reads results, changes nothing."""

DISTRIBUTION = "rollover"  # marker: other distributions own this import name too
