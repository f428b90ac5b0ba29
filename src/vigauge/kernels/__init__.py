"""Compiled loops over observations, landmarks and inertial factors (Numba).

Everything here takes and fills plain arrays and knows no class of the package. What the
loops compute is defined by the batched NumPy forms in the tests, which are their oracle.
Machine code is kept on disk, next to these files or in the user's cache folder, so only
the first process on a machine waits for the compiler. It is made anew when any of them has changed.
"""
