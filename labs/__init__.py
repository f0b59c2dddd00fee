"""Numerics and labs. Nothing here knows the web."""

try:
    import pinocchio  # noqa: F401
except ImportError as error:
    if "libgomp" not in str(error):
        raise
    raise ImportError(
        "Pinocchio needs the library libgomp.so.1, which this machine lacks: on Debian or "
        "Ubuntu, apt-get install libgomp1"
    ) from error
