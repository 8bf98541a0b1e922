"""Files written whole or not at all, child processes, limits of cost, faults of what others made and of the machine."""
