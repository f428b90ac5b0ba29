"""Benchmarks: the same problems through vigauge and its peers. Run with ``make bench``."""
