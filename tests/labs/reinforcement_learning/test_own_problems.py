"""Published problems from their text to the published policy, by Python, by the command line and
learned; the page is in tests/browser/test_own_problems.py."""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from labs.engine.headless import run_headless
from labs.engine.solution import Solution
from labs.params import Value
from labs.reinforcement_learning.dynamic_programming.lab import DynamicProgramming
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.mdp_table.params import TAXICAB
from labs.tasks.mdp_table.table import parse_table
from labs.tasks.mdp_table.world import TableWorld
from server.cli import main
from tests.labs.tasks.published import LAKES, UTILITIES, frozen_lake, optimal_rewards
from tests.labs.tasks.published import TAXICAB as PUBLISHED

SLUG = "dynamic-programming"
PRESETS = DynamicProgramming.presets


@pytest.mark.parametrize("name", LAKES)
def test_frozen_lake_has_its_known_optimum(name: str) -> None:
    rows = LAKES[name]
    assert str(PRESETS[name]["map"]).split("\n")[: len(rows)] == list(rows), "as published"
    world = run_headless(SLUG, PRESETS[name])
    best = optimal_rewards(*frozen_lake(rows), 0.99)
    np.testing.assert_allclose(-world.state.iterates.V[1:], [best] * 3, atol=1e-4)
    assert "Read F as . (free)." in world.lab.notes(world.params, world.state)["about"]
    assert best[0] == pytest.approx({4: 0.542, 8: 0.415}[len(rows)], abs=5e-4)


def test_the_4_x_3_world_has_its_utilities() -> None:
    world = run_headless(SLUG, PRESETS["4 x 3 world"])
    place = world.state.tabular_task.place
    assert isinstance(place, GridWorld)
    values = place.on_map(-world.state.iterates.V[3], np.nan)
    np.testing.assert_allclose(values, UTILITIES, atol=5e-4)


@pytest.mark.parametrize(
    ("name", "reward"), [("FrozenLake", 0.542), ("FrozenLake 8 x 8", 0.415), ("4 x 3 world", 0.705)]
)
def test_published_maps_are_solved_on_the_command_line(
    name: str, reward: float, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = [f"--set={key}={value}" for key, value in PRESETS[name].items()]
    assert main(["run", SLUG, "--seconds", "0", *settings]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["at_start"] == pytest.approx(-reward, abs=5e-4)


def check_published_values(by_state: str) -> None:
    """What is said of the taxicab is what is published."""
    for line, (town, reward) in zip(by_state.splitlines(), PUBLISHED.items(), strict=True):
        said, _, value = line.partition(", V = ")
        assert said == f"{town}: stand"
        assert -float(value.replace("−", "-")) == pytest.approx(reward, abs=5e-3)


def test_the_taxicab_is_solved_from_a_file_on_the_command_line(tmp_path: Path) -> None:
    pasted = "\ufeffsep=;\r\n" + TAXICAB.replace(",", ";").replace("\n", ";\r\n")
    file = tmp_path / "taxicab.csv"
    file.write_text(pasted, encoding="utf-8")
    settings = ["--set", "world=table", "--set", "gamma=0.9"]
    command = [sys.executable, "-m", "server", "run", SLUG, "--seconds", "0", *settings]
    table = f"table={file.read_text(encoding='utf-8')}"
    found = subprocess.run(
        [*command, "--set", table], check=True, capture_output=True, text=True, timeout=60
    )
    notes = json.loads(found.stdout)["notes"]
    check_published_values(notes["by_state"])
    assert "Rewards are read as costs" in notes["about"]


def test_the_taxicab_is_one_linear_programme() -> None:
    world = run_headless(SLUG, PRESETS["Taxicab"])
    mdp = world.state.tabular_task.mdp
    best = optimal_rewards(mdp.probabilities, -mdp.C, 0.9)
    np.testing.assert_allclose(-world.state.iterates.V[1:], [best] * 3, rtol=1e-6)
    np.testing.assert_allclose(best, list(PUBLISHED.values()), atol=5e-3)
    check_published_values(world.lab.notes(world.params, world.state)["by_state"])


def test_a_random_taxi_takes_what_there_is_alike() -> None:
    """In B there is no radio: cruise and stand with 1/2 each."""
    world = run_headless(SLUG, {**PRESETS["Taxicab"], "shown": "evaluation"}, seconds=3.0)
    table = world.state.tabular_task.place.table
    alike = table.available / table.available.sum(axis=1, keepdims=True)
    P = np.einsum("xu,uxy->xy", alike, table.P)
    V = np.linalg.solve(np.eye(3) - 0.9 * P, (alike * table.C).sum(axis=1))
    np.testing.assert_allclose(world.state.iterates.V[0], V, rtol=1e-6)


def test_the_taxicab_is_learned() -> None:
    settings: Mapping[str, Value] = {
        "system": "table", "table": TAXICAB, "gamma": 0.9, "anywhere": True, "second": "none",
        "alpha": 1.0, "omega": 0.6, "epsilon": 0.3, "episodes": 1000.0,
    }  # fmt: skip
    world = run_headless("td-control", settings)
    V = world.state.training["q"][0].min(axis=2)
    np.testing.assert_allclose(-V.mean(axis=0), list(PUBLISHED.values()), rtol=0.01)
    lines = world.lab.notes(world.params, world.state)["by_state"].splitlines()
    assert all(": stand" in line for line in lines)


def test_solutions_have_values_controls_and_names() -> None:
    """Of B, which has no radio, the control counts as what it does."""
    for slug, settings in (
        (SLUG, PRESETS["Taxicab"]),
        ("td-control", {"system": "table", "gamma": 0.9, "anywhere": True, "episodes": 250.0}),
    ):
        world = run_headless(slug, settings)
        solution = world.solution()
        results, place = solution.results, TableWorld(parse_table(TAXICAB))
        assert results["state_names"].tolist() == ["A", "B", "C"]
        assert results["control_names"].tolist() == ["cruise", "stand", "radio"]
        control, V = results["greedy_control"], results["V"]
        assert control.shape == V.shape == (*V.shape[:-1], 3)
        assert set(control[..., 1].ravel()) <= {-1, 0, 1}
        assert "policy" not in results, "a table has no arrows"
        for form in ("json", "npz"):
            assert Solution.read(solution.write(form)).results == {}
        if slug == SLUG:
            assert control.tolist() == [[-1, -1, -1], [1, 1, 1], [1, 1, 1], [1, 1, 1]]
            np.testing.assert_allclose(-V[3], list(PUBLISHED.values()), atol=5e-3)
    every = place.results(np.zeros(3), np.array([2, 2, 2]))["greedy_control"]
    np.testing.assert_array_equal(every, [2, 0, 2])
    grid = run_headless(SLUG, PRESETS["4 x 3 world"]).solution().results
    assert grid["V"].shape == grid["greedy_control"].shape == (4, 11)
    assert grid["policy"].shape[1] == 4


def test_costs_without_an_end_are_named_and_nothing_is_called_optimal() -> None:
    said = "With gamma = 1 the cost-to-go of 3 of 3 states grows without bound. Take a smaller"
    world = run_headless("td-control", {"system": "table", "episodes": 250.0})
    assert world.latest is not None
    assert world.latest.done.startswith(f"250 episodes learned. {said}")
    assert said in world.lab.notes(world.params, world.state)["about"]
    labels = world.lab.labels(world.params)
    assert (labels["optimal"], labels["distance"]) == ("", "no Q* with γ = 1")
    planned = run_headless(SLUG, {"world": "table", "gamma": 1.0})
    assert planned.lab.notes(planned.params, planned.state)["by_state"] == "\n".join(
        f"{town}: no finite V" for town in PUBLISHED
    )
    discounted = run_headless("td-control", {"system": "table", "gamma": 0.9, "episodes": 250.0})
    assert discounted.latest is not None
    assert discounted.latest.done == "250 episodes learned."
    assert discounted.lab.labels(discounted.params)["optimal"] == "optimal"
