"""Handles are as large as a hand needs them."""

import pytest
import viser

from server.handles import MIN_RADIUS, STEP, HandleNode
from server.mailbox import Mailbox


def test_a_ball_is_never_too_small_to_hit() -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        node = HandleNode(server, "/pull", "pull", 0.05, Mailbox())
        for metres_per_pixel in (0.0, 0.001, 0.004, 0.03):
            shown = node.scale_to_screen(metres_per_pixel)
            assert shown == pytest.approx(0.05 * node._handle.scale)
            wanted = max(0.05, MIN_RADIUS * metres_per_pixel)
            assert wanted == pytest.approx(shown) or wanted < shown < 1.01 * STEP * wanted
    finally:
        server.stop()
