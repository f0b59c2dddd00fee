"""What tests share that say whatever can be said."""

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

FUZZ_SETTINGS = settings(
    deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
)
"""The same examples everywhere, however slow the machine is."""
SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
"""Of JSON."""
