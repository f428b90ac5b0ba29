"""Residuals, normal equations, elimination of the landmarks, Levenberg-Marquardt."""
