"""Ground laws and the array of ground impact elements: points in, forces out."""

DISTRIBUTION = "rollover"  # marker: other distributions own this import name too
