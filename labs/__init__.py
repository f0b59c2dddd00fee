"""Numerics and labs. Nothing here knows the web."""

import os

# Before NumPy is loaded. On matrices of this size BLAS threads wait for each other, on a busy
# machine for seconds; and one thread sums in the same order everywhere.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

try:
    import pinocchio  # noqa: F401
except ImportError as error:
    if "libgomp" not in str(error):
        raise
    raise ImportError(
        "Pinocchio needs the library libgomp.so.1, which this machine lacks: on Debian or "
        "Ubuntu, apt-get install libgomp1"
    ) from error
