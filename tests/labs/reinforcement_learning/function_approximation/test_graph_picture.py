"""The counterexamples as a narrow window frames them."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.scene import NullScene
from server.camera import FrameContents
from server.framing import Window


class CameraScene(NullScene):
    """Keeps what a narrow window shows, and labels."""

    core = np.zeros((0, 3))

    def __init__(self) -> None:
        super().__init__()
        self.labels: list[tuple[np.ndarray, int]] = []

    def camera(self, position: ArrayLike, look_at: ArrayLike, core: ArrayLike = ()) -> None:
        self.core = np.asarray(core, float)

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        self.labels.append((np.asarray(position, float), len(text)))


@pytest.mark.parametrize(("example", "states"), [("pair", 2), ("star", 7)])
def test_a_narrow_window_shows_the_names_of_the_states_and_little_above(
    example: str, states: int
) -> None:
    world, scene = World(find_lab("function-approximation"), {"world": example}), CameraScene()
    world.lab.draw(scene, world.params, world.state)
    seen = FrameContents(scene.core, scene.labels, scene.core).visible_in(Window(1.3, 300.0))
    assert len(seen.labels) == len(scene.labels) == states
    assert scene.core[:, 2].max() < 0.7
