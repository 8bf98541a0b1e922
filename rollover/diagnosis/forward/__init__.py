"""Parameters in, channels out: drop tests, ensembles of full runs, and what a run may cost."""
