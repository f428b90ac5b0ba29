"""What every command does around its work: arguments, log file, threads of BLAS, exit status."""

from __future__ import annotations

import argparse
import atexit
import errno
import gc
import logging
import sys
from collections.abc import Callable
from pathlib import Path

from threadpoolctl import threadpool_limits

from ..errors import OutputError, VigaugeError

EXIT_BAD_INPUT = 2
# sysexits.h: a defect of this program, which must not look like a finding about the data.
EXIT_DEFECT = 70

# The commands' own messages; libraries (fonts, images) are heard from warnings on.
LOG = logging.getLogger("vigauge")

# What the operating system says where nothing can be written: no defect of the command.
_REFUSED = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EFBIG})


class _LogFile(logging.FileHandler):
    """A log file that is given up, with one line on the terminal, once it cannot be written."""

    def handleError(self, record: logging.LogRecord) -> None:
        LOG.removeHandler(self)
        LOG.warning("%s: the log cannot be written: %s", self.baseFilename, sys.exc_info()[1])


def _log_file(path: Path) -> logging.Handler:
    """A handler that writes the log, or OutputError where it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return _LogFile(path, mode="w")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error


def parser(description: str | None) -> argparse.ArgumentParser:
    """An argument parser with the flag that all commands share."""
    out = argparse.ArgumentParser(description=(description or "").split("\n\n")[0])
    out.add_argument("--log", type=Path, help="also write the log to this file")
    return out


def run(
    work: Callable[[argparse.Namespace], None], arguments: argparse.ArgumentParser, *, defect_status: int = 1
) -> None:
    """Parse the command line and do the work.

    Bad input, and results that cannot be written, end in one line and exit status 2. Any other
    exception is a defect: its traceback goes to the terminal and the log, and the exit status is
    ``defect_status``. BLAS runs on one thread: at these sizes several are slower, and sums depend
    on their number.
    """
    # The process ends after the work: what Numba made is left to the system, which saves a fifth of a second.
    atexit.register(gc.freeze)
    options = arguments.parse_args()
    logging.basicConfig(level=logging.WARNING, format="%(message)s", force=True)
    LOG.setLevel(logging.INFO)
    try:
        if options.log:
            LOG.addHandler(_log_file(options.log))
        with threadpool_limits(limits=1, user_api="blas"):
            work(options)
    except VigaugeError as error:
        LOG.error("error: %s", error)
        sys.exit(EXIT_BAD_INPUT)
    except OSError as error:
        if error.errno not in _REFUSED:
            LOG.exception("%s failed", arguments.prog)
            sys.exit(defect_status)
        LOG.error("error: %s: cannot be written: %s", error.filename or "output", error.strerror)
        sys.exit(EXIT_BAD_INPUT)
    except Exception:
        LOG.exception("%s failed", arguments.prog)
        sys.exit(defect_status)
