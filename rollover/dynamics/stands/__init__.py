"""Test stands as constraints and loads of the system: static loading, pendulum, tilt table, exciter."""
