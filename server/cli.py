"""The `orclab` command: serve the labs, list them, run one headless."""

import argparse
import asyncio
import json
import socket
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from labs.engine.catalog import catalog, find
from labs.engine.events import Event, events_of, parse_event
from labs.engine.headless import run
from labs.engine.record import versions
from labs.engine.run import World
from labs.engine.solution import FORMS as SOLUTION_FORMS
from labs.engine.solution import Solution
from labs.errors import LabError

FORMS = ("json", "csv", "npz")


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns the exit code: 0, or 2 for wrong use."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        return {"serve": _serve, "list": _list, "run": _run}[options.command or "serve"](options)
    except LabError as error:
        print(f"orclab: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="orclab", description="An interactive lab for optimization-based robot control."
    )
    parser.add_argument("--version", action="version", version=versions()["orclab"])
    _serving(parser)
    commands = parser.add_subparsers(dest="command", metavar="{serve,list,run}")
    _serving(commands.add_parser("serve", help="serve the labs (what orclab alone does)"))
    commands.add_parser("list", help="list the labs")
    runner = commands.add_parser(
        "run",
        help="run a lab headless",
        description="Prints the final measurements as one JSON object; progress goes to stderr.",
    )
    runner.add_argument("lab", nargs="?", help="a lab's name, as orclab list prints it")
    runner.add_argument(
        "--set", action="append", default=[], metavar="K=V", help="a parameter at t = 0"
    )
    runner.add_argument(
        "--at",
        action="append",
        default=[],
        nargs=2,
        metavar=("T", "K=V"),
        help="a change at T seconds: a parameter, press=ACTION, hold=HANDLE:x,y,z or "
        "hold=HANDLE:release; or of the solver iterate=N or show=ITERATION",
    )
    runner.add_argument("--seconds", type=float, help="simulated time (10)")
    runner.add_argument("--seed", type=int, help="seed of all randomness (0, or the solution's)")
    runner.add_argument("--replay", type=Path, metavar="F.json", help="run an exported run again")
    runner.add_argument(
        "--out", type=Path, metavar="F", help="write the trajectory: F.json, F.csv or F.npz"
    )
    runner.add_argument(
        "--solution", type=Path, metavar="F", help="start from a solution: F.json or F.npz"
    )
    runner.add_argument(
        "--solution-out", type=Path, metavar="F", help="write the solution: F.json or F.npz"
    )
    return parser


def _serving(parser: argparse.ArgumentParser) -> None:
    for flag, kind, help in (
        ("--host", str, "address to listen on (127.0.0.1)"),
        ("--port", _port, "port to listen on (8000; 0: any free one)"),
    ):
        parser.add_argument(flag, type=kind, default=argparse.SUPPRESS, help=help)
    parser.add_argument(
        "--open", action="store_true", default=argparse.SUPPRESS, help="open the browser"
    )


def _serve(options: argparse.Namespace) -> int:
    import uvicorn  # on demand: a headless run needs no web server
    from pydantic_settings import SettingsError

    from server.app import create_app
    from server.settings import Settings

    given = {name: getattr(options, name) for name in ("host", "port") if name in options}
    try:
        settings = Settings(**given)
    except (ValidationError, SettingsError) as error:
        raise LabError(_wrong_settings(error)) from None
    listener = _listen(settings.host, settings.port)
    host, port = listener.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    address = f"http://{shown}:{port}"
    config = uvicorn.Config(
        create_app(settings),
        loop="uvloop",
        ws="websockets-sansio",
        ws_max_size=64 * 2**20,
        ws_per_message_deflate=False,
        log_level="warning",
        timeout_graceful_shutdown=2,
        server_header=False,
    )
    server = uvicorn.Server(config)

    async def announce() -> None:
        while not server.started:
            await asyncio.sleep(0.02)
        print(f"orclab is at {address}  (Ctrl+C ends it)", flush=True)
        if getattr(options, "open", False):
            import webbrowser

            await asyncio.to_thread(webbrowser.open, address)

    async def serve() -> None:
        announcing = asyncio.create_task(announce())
        await server.serve([listener])
        announcing.cancel()

    with asyncio.Runner(loop_factory=config.get_loop_factory()) as runner:
        runner.run(serve())
    return 0


def _wrong_settings(error: Exception) -> str:
    if not isinstance(error, ValidationError):
        return f"ORCLAB_ORIGINS takes a JSON list of addresses ({error})"
    return "; ".join(
        f"ORCLAB_{str(e['loc'][0]).upper()} = {str(e['input'])[:80]}: {e['msg']}"
        for e in error.errors()
    )


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise LabError(
            f"cannot listen on {host} port {port} ({error.strerror}): "
            "choose another with --port, or --port 0 for any free one"
        ) from None
    return listener


def _list(_: argparse.Namespace) -> int:
    for slug, entry in catalog().items():
        print(f"{slug:24} {entry.lab.section:8} {entry.lab.title}: {entry.lab.summary}")
    return 0


def _run(options: argparse.Namespace) -> int:
    outputs: list[tuple[str, Path, Callable[[World, str], bytes]]] = []
    if options.out:
        _check_output("--out", options.out, FORMS)
        outputs.append(("--out", options.out, lambda world, form: world.recording().write(form)))
    if options.solution_out:
        _check_output("--solution-out", options.solution_out, SOLUTION_FORMS)
        outputs.append(
            ("--solution-out", options.solution_out, lambda w, form: w.solution().write(form))
        )
    plan = _arguments_of_recording(options) if options.replay else _arguments_of_options(options)
    if options.seconds is not None:
        plan["seconds"] = options.seconds
    world = run(**plan, progress=_progress if sys.stderr.isatty() else None)
    for option, path, content in outputs:
        try:
            path.write_bytes(content(world, path.suffix[1:]))
        except OSError as error:
            raise LabError(f"{option} {path}: {error.strerror}") from None
        print(f"wrote {path}", file=sys.stderr)
    if world.trouble:
        print(world.trouble, file=sys.stderr)
    measured = {
        name: value if isinstance(value, float | int) else value.tolist()
        for name, value in world.lab.measure(world.params, world.state).items()
    }
    final = {
        "lab": world.entry.slug,
        "seed": world.seed,
        "t": world.t,
        "trouble": world.trouble,
        "solver": (world.latest and world.latest.done) or None,
    }
    print(json.dumps(final | measured))
    return 0


def _check_output(option: str, path: Path, forms: Sequence[str]) -> None:
    if path.suffix[1:] not in forms:
        *first, last = (f"F.{form}" for form in forms)
        raise LabError(f"{option} {path}: the file is named {', '.join(first)} or {last}")
    if not path.parent.is_dir():
        raise LabError(f"{option} {path}: there is no folder {path.parent}")


def _arguments_of_options(options: argparse.Namespace) -> dict[str, Any]:
    if options.lab is None:
        raise LabError(f"say which lab to run: {', '.join(catalog())}")
    entry = find(options.lab)
    texts = dict(_parse_assignment(text) for text in options.set)
    return {
        "slug": options.lab,
        "changes": entry.lab.Params.read(texts),
        "seed": _seed(options.seed),
        "events": [parse_event(entry, at, what) for at, what in options.at],
        "solution": _solution(options.solution) if options.solution else None,
    }


def _solution(path: Path) -> Solution:
    try:
        return Solution.read(path.read_bytes())
    except OSError as error:
        raise LabError(f"--solution {path}: {error.strerror}") from None
    except LabError as error:
        raise LabError(f"--solution {path}: {error}") from None


def _arguments_of_recording(options: argparse.Namespace) -> dict[str, Any]:
    path = options.replay
    if options.lab or options.set or options.at or options.seed is not None or options.solution:
        raise LabError("--replay takes the lab, its parameters, changes and seed from the file")
    try:
        about = json.loads(path.read_bytes())
        events: list[Event] = events_of(about)
        return {
            "slug": str(about["lab"]),
            "changes": dict(about["params"]),
            "seed": _seed(int(about["seed"])),
            "seconds": float(about["covers"]["to"]),
            "events": events,
            "solution": Solution.from_dict(about["solution"]) if "solution" in about else None,
        }
    except OSError as error:
        raise LabError(f"--replay {path}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LabError(f"--replay {path}: not a JSON export of orclab ({error!r})") from None


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text}: takes a whole number from 0 to 65535")
    return int(text)


def _seed(seed: int | None) -> int | None:
    if seed is not None and not 0 <= seed < 2**32:
        raise LabError(f"seed {seed}: takes a whole number from 0 to {2**32 - 1}")
    return seed


def _parse_assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise LabError(f"--set {text}: write name=value")
    return name, value


def _progress(part: float) -> None:
    print(f"\r{100 * part:3.0f} %", end="\r", file=sys.stderr, flush=True)
