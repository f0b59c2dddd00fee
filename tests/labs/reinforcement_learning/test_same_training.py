"""Page, scene and headless run train the same, in every lab where something is learned."""

from collections.abc import Mapping

import pytest

from labs.engine.catalog import find_lab
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.engine.solution import Solution
from labs.lab import State
from labs.params import Value
from tests.labs.contract import comparable
from tests.labs.solving import solved_world
from tests.server_process import ServerProcess
from tests.viser_client import SceneClient

SETTINGS: Mapping[str, Mapping[str, Value]] = {
    "prediction": {"world": "grid", "episodes": 20.0},
    "td-lambda": {"method": "td0", "episodes": 3.0},
    "bandits": {"turns": 200.0, "drift": 0.05, "kind": "active"},
    "function-approximation": {"data": "replay", "batch": 20.0, "passes": 10.0},
    "dqn": {"steps": 4000.0, "learners": 2.0, "capacity": 2000.0},
}


@pytest.mark.parametrize("slug", SETTINGS)
def test_page_scene_and_headless_run_train_the_same_bit_for_bit(
    shared_server: ServerProcess, slug: str
) -> None:
    """Through the API that the page uses, in a worker that also draws the scene."""
    setting = SETTINGS[slug]
    with shared_server.session(slug, params=setting, seed=7) as session:
        with SceneClient(session) as scene, session.stream() as stream:
            scene.read_for(0.2)
            stream.next("status", lambda s: s["solver"]["done"])
        answer = shared_server.http.get(f"{session.path}/solution.npz")
    live = World(find_lab(slug), solution=Solution.read(answer.content))
    headless = run_headless(slug, setting, seconds=0.0, seed=7)
    assert learned(live.state) == learned(headless.state)
    assert learned(live.state) != learned(solved_world(slug, setting).state)


def learned(state: State) -> object:
    """All that the solver made; the rest moves on meanwhile."""
    made = next(name for name in ("training", "game", "sweep") if hasattr(state, name))
    return comparable(dict(vars(state)[made]))
