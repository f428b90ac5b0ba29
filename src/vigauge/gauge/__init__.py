"""Gauges: what each holds, adds and constrains."""
