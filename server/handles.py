"""What a hand can drag."""

import math
from typing import Any

import viser

from server.mailbox import Mailbox
from server.nodes import COLORS, Node

MIN_RADIUS = 15.0
"""[px] radius on any screen."""
STEP = 1.15
"""A ball grows by this factor at a time: it is sent seldom."""


class HandleNode(Node):
    """A ball that sends where it is dragged: as large as a hand needs it, with a core."""

    def __init__(
        self, server: viser.ViserServer, path: str, name: str, radius: float, mailbox: Mailbox
    ) -> None:
        ball = server.scene.add_icosphere(
            path, radius, color=COLORS["force"], opacity=0.35, cast_shadow=False
        )
        core = server.scene.add_icosphere(
            f"{path}/core", 0.45 * radius, color=COLORS["force"], cast_shadow=False
        )

        self.held = False

        # Asynchronous: these run in order on Viser's event loop.
        async def dragged(event: Any) -> None:
            self.held = event.phase != "end"
            point = tuple(map(float, event.end_position)) if self.held else None
            mailbox.put("hold", handle=name, point=point)

        ball.on_drag("left")(dragged)
        super().__init__(ball)
        self._core, self._radius = Node(core), radius

    def scale_to_screen(self, metres_per_pixel: float) -> float:
        """Never smaller than a hand can hit. Its radius [m] now."""
        wanted = max(1.0, MIN_RADIUS * metres_per_pixel / self._radius)
        scale = STEP ** math.ceil(math.log(wanted, STEP))
        self.set_property("scale", scale)
        self._core.set_property("scale", scale)
        return self._radius * scale
