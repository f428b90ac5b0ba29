"""Stages, stamps, configuration."""
