"""States, measurements and the problem that they make; its archive and errors of an estimate."""
