"""The multibody system of a scenario and its run: placement, equilibrium, model, time loop, result."""
