"""What a browser may say over a session's WebSockets, and what it may not."""

import contextlib
import json
import random
from typing import Any, cast

import orjson
from hypothesis import given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed

from labs.engine.catalog import find_lab
from server.session import Session
from server.stream import answer_request
from tests.fuzzing import FUZZ_SETTINGS, SCALARS
from tests.server_process import ServerProcess, run_in_thread
from tests.viser_client import SceneClient, message

COMMANDS = ["run", "pause", "step", "reset", "speed", "seed", "apply", "press", "view"]
COMMANDS += ["reset_view", "solver_run", "solver_step", "solver_show", "solver_pace", "dance"]
NAMES = ["factor", "count", "seed", "params", "action", "view", "pace", "iteration", "compare"]
json_values = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=6,
)
arguments = st.dictionaries(st.sampled_from(NAMES) | st.text(max_size=8), json_values, max_size=2)


class RecordingSession:
    """In the place of a session: notes what would reach the worker."""

    entry = find_lab("oscillator")

    def __init__(self) -> None:
        self.heard: list[bytes] = []

    async def change(self, changes: dict[str, Any]) -> None:
        self.heard.append(orjson.dumps(changes))

    async def ask(self, do: str, **arguments: Any) -> None:
        self.heard.append(orjson.dumps([do, arguments]))


def test_every_message_is_answered() -> None:
    """Whatever it is; and what reaches the worker can be sent there."""
    taken = 0

    @settings(FUZZ_SETTINGS, max_examples=300)
    @given(data=st.data())
    def attack(data: st.DataObject) -> None:
        nonlocal taken
        command = {"command": data.draw(st.sampled_from(COMMANDS))} | data.draw(arguments)
        request = data.draw(
            st.fixed_dictionaries(
                {"type": st.just("command"), "ref": st.integers(0, 9), "command": st.just(command)}
            )
            | st.fixed_dictionaries(
                {"type": st.just("params"), "ref": st.integers(0, 9), "changes": arguments}
            )
            | json_values
        )
        text = json.dumps(request)
        if data.draw(st.integers(0, 3)) == 3:
            place = data.draw(st.integers(0, len(text)))
            text = text[:place] + data.draw(st.text(max_size=3)) + text[place + 1 :]
        session = RecordingSession()
        answer = run_in_thread(answer_request(cast(Session, session), text))
        taken += bool(session.heard)
        assert bool(answer.error) != bool(session.heard)
        assert len(answer.error) < 2000
        assert answer.model_dump_json().encode()

    attack()
    assert taken > 20


def test_frames_that_are_none_end_their_connection_alone(shared_server: ServerProcess) -> None:
    """Random messages to the stream and to the scene of a live session, which goes on."""
    dice = random.Random(5)
    kinds = ["ViserCameraMessage", "GuiUpdateMessage", "ScenePointerMessage", "FileTransferPart"]
    with shared_server.session("oscillator") as session, session.stream() as healthy:
        for _ in range(6):
            with session.stream() as stream:
                stream.socket.send(dice.randbytes(200))
                assert stream.next("answer")["error"]
            scene = SceneClient(session)
            junk = [dice.randbytes(dice.randrange(300)) for _ in range(3)]
            junk.append(message(dice.choice(kinds), uuid="x", updates=dice.choice([None, 1, {}])))
            with contextlib.suppress(ConnectionClosed):
                for part in dice.sample(junk, len(junk)):
                    scene.socket.send(part)
                scene.socket.send(dice.randbytes(50).hex())
            scene.socket.close()
        now = healthy.next("status")
        assert healthy.next("status", lambda s: s["t"] > now["t"])["run"] == now["run"]
