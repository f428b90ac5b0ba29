"""Shared by the tests of the estimator: problems to test on, numerical derivatives, dense algebra."""
