"""EuRoC from its archive."""
