"""A frame of elastic-plastic members alone: its mesh, its fibres, its equilibrium under a load that grows."""
