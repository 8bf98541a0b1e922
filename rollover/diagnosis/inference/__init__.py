"""What the residuals say: lack of fit, intervals, dependence, residual laws, faults of recordings."""
