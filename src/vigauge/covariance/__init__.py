"""Covariances in any gauge."""
