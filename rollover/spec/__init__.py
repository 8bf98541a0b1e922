"""What is simulated, as data: vehicles, structures, starts, stands, channels; the documents they are written in."""
