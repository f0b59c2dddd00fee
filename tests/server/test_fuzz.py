"""The API's own description, turned against it."""

from typing import Any

import pytest
import schemathesis
from hypothesis import given, settings
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import positive_data_acceptance

from tests.fuzzing import FUZZ_SETTINGS
from tests.server_process import ServerProcess, wait_until

OPERATIONS = [
    "GET /healthz",
    "GET /api/labs",
    "POST /api/sessions",
    "GET /api/sessions/{session_id}",
    "DELETE /api/sessions/{session_id}",
    "PATCH /api/sessions/{session_id}/params",
    "POST /api/sessions/{session_id}/commands",
    "GET /api/sessions/{session_id}/command",
    "GET /api/sessions/{session_id}/export.{form}",
    "GET /api/sessions/{session_id}/plots.{form}",
    "GET /api/sessions/{session_id}/solution.{form}",
    "PUT /api/sessions/{session_id}/solution",
]


def takes_input(operation: str) -> bool:
    """Whether the description forbids anything: a session's id may be any text."""
    return operation.startswith(("POST", "PATCH")) or "{form}" in operation


def test_every_operation_is_fuzzed(shared_server: ServerProcess) -> None:
    paths = shared_server.http.get("/openapi.json").json()["paths"]
    found = {f"{method.upper()} {path}" for path, methods in paths.items() for method in methods}
    assert found == set(OPERATIONS)


@pytest.mark.parametrize(
    ("operation", "mode"),
    [(operation, GenerationMode.POSITIVE) for operation in OPERATIONS]
    + [(operation, GenerationMode.NEGATIVE) for operation in OPERATIONS if takes_input(operation)],
)
def test_the_api_withstands_fuzzing(
    shared_server: ServerProcess, operation: str, mode: GenerationMode
) -> None:
    """Allowed input gets what is promised, any other a refusal; never a server error."""
    method, path = operation.split()
    schema = schemathesis.openapi.from_url(f"{shared_server.address}/openapi.json")
    target = schema[path][method]
    with shared_server.session("oscillator") as session:
        live = session.info["id"]

        @settings(FUZZ_SETTINGS, max_examples=60)
        @given(case=target.as_strategy(generation_mode=mode))
        def attack(case: Any) -> None:
            if "session_id" in case.path_parameters and method != "DELETE":
                case.path_parameters["session_id"] = live
            response = case.call()
            if operation == "POST /api/sessions" and response.status_code == 201:
                shared_server.http.delete(f"/api/sessions/{response.json()['id']}")
            # What a lab takes is more than the description can say: 422 is an answer.
            case.validate_response(response, excluded_checks=[positive_data_acceptance])

        attack()
        assert shared_server.http.get(session.path).status_code == 200
    wait_until(lambda: shared_server.health()["spares"] == 1)
