"""Grid worlds: moves by hand, published maps, editing."""

import json
from typing import Any

import gymnasium
import numpy as np
import pytest

from labs.algorithms.policy_evaluation import exact_values
from labs.algorithms.policy_iteration import optimum
from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.tasks.grid_world.map import FALL_COST, MAPS, GridWorld
from labs.tasks.grid_world.params import MAP_LENGTH

UP, RIGHT, DOWN, LEFT = range(4)


def step(world: GridWorld, row: int, column: int, u: int) -> tuple[int, int]:
    """The cell a control leads to."""
    successor, _ = world.table
    row, column = map(int, world.cells[successor[world.index[row, column], u]])
    return row, column


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("kings", [False, True])
def test_the_named_maps_are_worlds(name: str, kings: bool) -> None:
    world = GridWorld.parse(MAPS[name], kings)
    assert world.text == MAPS[name].replace("F", ".")
    assert GridWorld.parse(world.text, kings) == world
    for slip in (0.0, 0.3):
        mdp = world.mdp(1.0, slip)
        assert mdp.can_end.all()
        assert mdp.C.shape[1] == (8 if kings else 4)
        assert mdp.deterministic == (slip == 0.0)
    assert (world.index[tuple(world.cells.T)] == np.arange(mdp.X)).all()


def test_edges_and_walls_stop() -> None:
    world = GridWorld.parse("S.#\n..G")
    assert step(world, 0, 0, UP) == (0, 0)
    assert step(world, 0, 0, LEFT) == (0, 0)
    assert step(world, 0, 1, RIGHT) == (0, 1)
    assert step(world, 0, 1, DOWN) == (1, 1)
    assert step(world, 1, 1, RIGHT) == (1, 2)
    assert step(world, 1, 2, LEFT) == (1, 2), "the goal is terminal"
    np.testing.assert_array_equal(world.mdp(0.9).terminal, [False, False, False, False, True])
    # A diagonal slides along a wall.
    kings = GridWorld.parse("S.#\n..G", kings=True)
    assert step(kings, 1, 1, 4) == (1, 2), "up and right: first right"
    assert step(kings, 0, 1, 5) == (1, 1), "down and right: right is a wall"


def test_the_wind_carries_upwards() -> None:
    world = GridWorld.parse(MAPS["windy"])
    assert world.wind == (0, 0, 0, 1, 1, 1, 2, 2, 1, 0)
    assert step(world, 3, 3, RIGHT) == (2, 4)
    assert step(world, 3, 6, RIGHT) == (1, 7)
    assert step(world, 3, 6, DOWN) == (2, 6)
    assert step(world, 0, 6, LEFT) == (0, 5)
    assert step(world, 6, 3, DOWN) == (6, 3)
    assert world.kinds[world.start] == "S"


def test_the_wind_stops_at_a_wall() -> None:
    world = GridWorld.parse("..\n#.\n..\nSG\n20")
    assert step(world, 3, 0, UP) == (2, 0)


def test_a_fall_costs_and_leads_back() -> None:
    world = GridWorld.parse(MAPS["cliff"])
    assert len(world.cells) == 38
    successor, cost = world.table
    x = int(world.index[2, 5])
    assert (successor[x, DOWN], cost[x, DOWN]) == (world.start, FALL_COST)
    assert (successor[world.start, RIGHT], cost[world.start, RIGHT]) == (world.start, FALL_COST)
    assert cost[x, RIGHT] == 1.0
    laid = world.on_map(np.arange(38.0), -1.0)
    assert laid[3, 5] == -1.0
    assert laid[3, 11] == 37.0


def test_slip_mixes_the_controls() -> None:
    world = GridWorld.parse("...\nS..\n..G")
    mdp = world.mdp(0.9, slip=0.4)
    row = mdp.probabilities[RIGHT, world.index[1, 1]]
    for cell, wanted in (((1, 2), 0.7), ((0, 1), 0.1), ((2, 1), 0.1), ((1, 0), 0.1)):
        assert row[world.index[cell]] == pytest.approx(wanted)
    cliff = GridWorld.parse(MAPS["cliff"])
    wanted = 1.0 + 0.4 / 4 * (FALL_COST - 1.0)
    assert cliff.mdp(0.9, 0.4).C[cliff.index[2, 5], RIGHT] == pytest.approx(wanted)


def test_cells_are_edited() -> None:
    world = GridWorld.parse("S.\n.G")
    assert world.with_cell(0, 1, "#").text == "S#\n.G"
    assert world.with_cell(0, 1, "S").text == ".S\n.G"
    assert world.with_cell(0, 1, "G").text == "SG\n.."
    assert GridWorld.parse("G.\n.G").with_cell(0, 1, "G").text == "GG\n.G"
    with pytest.raises(LabError, match="no goal"):
        world.with_cell(1, 1, "#")
    with pytest.raises(LabError, match="no start"):
        world.with_cell(0, 1, "C").with_cell(0, 0, ".")


@pytest.mark.parametrize(
    ("text", "wanted", "note"),
    [
        ("SFFF\nFHFG\nH=0", "S...\n.H.G\nH = cost 0", "Read F as . (free)."),
        ("S X\n  G", "S.#\n..G", "Read a space as . (free), X as # (wall)."),
        ("\ufeffs.g\r\n...\r\n", "S.G\n...", "Read s as S, g as G."),
        ("S . #\n. . G", "S.#\n..G", ""),
        ("S,.,#\n.,.,G", "S.#\n..G", ""),
        ('["SFF", "FFG"]', "S..\n..G", "Read F as . (free)."),
        ("S  \n # \n  G", "S..\n.#.\n..G", "Read a space as . (free)."),
        ('[["S", "F"], ["H", "G"]]\nH = cost 0', "S.\nHG\nH = cost 0", "Read F as . (free)."),
        ("[[b'S' b'.']\n [b'#' b'G']]", "S.\n#G", ""),
        ("array([['S', '.'],\n       ['#', 'G']], dtype='<U1')", "S.\n#G", ""),
        ("array(['S.', '#G'], dtype='<U2')", "S.\n#G", ""),
        ('"S","."\n"#","G"', "S.\n#G", ""),
        ('"S.",\n"#G"', "S.\n#G", ""),
        ('["S", ".", "G"]', "S\n.\nG", ""),
    ],
    ids=[
        "lake",
        "spaces",
        "small letters",
        "blanks between",
        "commas",
        "list",
        "ends of rows",
        "lists of cells",
        "printed bytes",
        "array of cells",
        "array of rows",
        "quoted CSV",
        "quoted rows",
        "list of one column",
    ],
)
def test_maps_of_others_are_read(text: str, wanted: str, note: str) -> None:
    world = GridWorld.parse(text)
    assert world.text == wanted
    assert world.notes == ((note,) if note else ())


def test_the_description_of_a_gymnasium_map_is_read_and_a_shortened_one_refused() -> None:
    lake: Any = gymnasium.make("FrozenLake-v1", map_name="8x8").unwrapped
    for text in (str(lake.desc), repr(lake.desc), json.dumps(lake.desc.astype(str).tolist())):
        assert GridWorld.parse(text).rows == GridWorld.parse(MAPS["frozen lake 8x8"]).rows
    large = np.full((32, 32), b".")
    large[0, 0], large[31, 31] = b"S", b"G"
    whole = json.dumps(large.astype(str).tolist())
    assert len(whole) < MAP_LENGTH
    assert GridWorld.parse(whole).shape == (32, 32)
    with pytest.raises(LabError, match=r"cut short by '\.\.\.'"):
        GridWorld.parse(str(large))


def test_holes_and_other_ends_end() -> None:
    world = GridWorld.parse("SHT\nm+G\nT = reward 5, end\nm = cost 3/2\nG: reward 1")
    np.testing.assert_array_equal(world.terminal, [False, True, True, False, True, True])
    np.testing.assert_array_equal(world.goals, [False, False, True, False, False, False])
    _, cost = world.table
    assert (cost[0, DOWN], cost[0, RIGHT], cost[0, UP]) == (2.5, 101.0, 1.0)
    assert (cost[3, UP], cost[3, DOWN]) == (1.0, 2.5), "staying there costs again"
    assert cost[3, RIGHT] == 0.0
    assert not cost[world.terminal].any()
    np.testing.assert_array_equal(world.mdp(1.0, living=0.1).C[0, [UP, DOWN]], [0.1, 1.6])
    assert GridWorld.parse(world.text) == world
    assert "T = reward 5, end\nm = cost 1.5\nG = reward 1" in world.text
    assert world.with_cell(0, 1, ".").text.startswith("S.T")
    assert world.notes == ("A hole H ends an episode and costs 100; H = cost 0 below the map: 0.",)


def test_slip_sideways_goes_to_the_two_sides() -> None:
    world = GridWorld.parse("...\nS..\n..G", kings=True)
    mdp = world.mdp(0.9, 0.2, sideways=True)
    middle = world.index[1, 1]
    for u, ways in ((RIGHT, ((1, 2), (0, 1), (2, 1))), (4, ((0, 2), (0, 0), (2, 2)))):
        row = mdp.probabilities[u, middle]
        for cell, wanted in zip(ways, (0.8, 0.1, 0.1), strict=True):
            assert row[world.index[cell]] == pytest.approx(wanted)


def test_a_large_map_is_solved_at_once() -> None:
    """32 x 32, slippery: few outcomes are kept, not all pairs of states."""
    rng = np.random.default_rng(3)
    cells = np.where(rng.random((32, 32)) < 0.2, "#", ".")
    cells[0, 0], cells[-1, -1] = "S", "G"
    world = GridWorld.parse("\n".join("".join(row) for row in cells))
    mdp = world.mdp(0.99, 0.2, sideways=True)
    assert mdp.P is not None
    assert mdp.P.shape == (4, len(world.cells), 3)
    V, policy, _ = optimum(mdp, random_policy(mdp))
    ahead = np.einsum("uxk,uxk->xu", mdp.P, V[mdp.outcomes])
    np.testing.assert_allclose((mdp.C + 0.99 * ahead).min(axis=1), V, atol=1e-9)
    dense = FiniteMDP(mdp.C, 0.99, mdp.terminal, P=mdp.probabilities)
    np.testing.assert_allclose(exact_values(dense, policy), V, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "at least one row"),
        ("012", "at least one row"),
        ("S.\n.G.", "row 2 of the map, '.G.', has 3 cells and the first 2"),
        ("S.\n.?\n.G", "row 2 of the map has '?'"),
        ("SG\n012", "the wind has 3 digits: one for each of 2"),
        ("SS\n.G", "2 starts"),
        ("S.", "no goal"),
        (".C\n.G", "no start"),
        ("G" * 33, "too large"),
        ("SQ\n.G", "or say below the map what it costs: Q = cost 3"),
        ("Sm\n.G\nm = dear", "'m = dear': a letter has a cost or a reward"),
        ("S#\n.G\n# = cost 1", "nobody gets into a wall"),
    ],
)
def test_what_is_no_map_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(LabError, match=sentence):
        GridWorld.parse(text)
