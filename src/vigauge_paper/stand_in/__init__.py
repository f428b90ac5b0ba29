"""The rendered sequences that take EuRoC's place."""
