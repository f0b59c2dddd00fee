"""The `orclab` command: serve the labs, list them, run one headless."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from labs.engine.catalog import catalog, find_lab
from labs.engine.events import Event, events_from_recording, parse_event
from labs.engine.headless import run_headless
from labs.engine.plot_data import PlotData
from labs.engine.record import versions
from labs.engine.run import World
from labs.engine.solution import FILE_FORMATS as SOLUTION_FORMS
from labs.engine.solution import Solution
from labs.errors import LabError

Writer = Callable[[World, str], bytes]
OUTPUTS: Mapping[str, tuple[Sequence[str], Writer]] = {
    "--out": (("json", "csv", "npz"), lambda world, form: world.recording().write(form)),
    "--solution-out": (SOLUTION_FORMS, lambda world, form: world.solution().write(form)),
    "--plots-out": (("json", "zip"), lambda world, form: PlotData.of(world).write(form)),
}
"""What a run writes: the forms, by a file's ending, and how."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns the exit code: 0, 2 for wrong use, or what a signal would end it with."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        code = {"serve": _serve, "list": _list, "run": _run}[options.command or "serve"](options)
        sys.stdout.flush()
        return code
    except LabError as error:
        print(f"orclab: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # who read it has seen enough, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="orclab", description="An interactive lab for optimization-based robot control."
    )
    parser.add_argument("--version", action="version", version=versions()["orclab"])
    _add_serve_options(parser)
    commands = parser.add_subparsers(dest="command", metavar="{serve,list,run}")
    _add_serve_options(commands.add_parser("serve", help="serve the labs (what orclab alone does)"))
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
    runner.add_argument(
        "--plots-out", type=Path, metavar="F", help="write the data of all plots: F.json or F.zip"
    )
    return parser


def _add_serve_options(parser: argparse.ArgumentParser) -> None:
    for flag, kind, help in (
        ("--host", str, "address to listen on (127.0.0.1)"),
        ("--port", _parse_port, "port to listen on (8000; 0: any free one)"),
    ):
        parser.add_argument(flag, type=kind, default=argparse.SUPPRESS, help=help)
    parser.add_argument(
        "--open", action="store_true", default=argparse.SUPPRESS, help="open the browser"
    )


def _serve(options: argparse.Namespace) -> int:
    from server.serving import serve  # on demand: a headless run needs no web server

    return serve(options)


def _list(_: argparse.Namespace) -> int:
    for slug, entry in catalog().items():
        print(f"{slug:24} {entry.lab.section:8} {entry.lab.title}: {entry.lab.summary}")
    return 0


def _run(options: argparse.Namespace) -> int:
    outputs: list[tuple[str, Path, Writer]] = []
    for option, (forms, write) in OUTPUTS.items():
        path = getattr(options, option[2:].replace("-", "_"))
        if path:
            _check_output(option, path, forms)
            outputs.append((option, path, write))
            if option == "--out" and path.suffix == ".csv":
                beside = path.with_suffix(".about.json")
                outputs.append((option, beside, lambda world, _: world.recording().description()))
    plan = _arguments_of_recording(options) if options.replay else _arguments_of_options(options)
    if options.seconds is not None:
        plan["seconds"] = options.seconds
    from labs.compiled import CACHE_NOTE  # on demand: help needs no Numba

    if CACHE_NOTE:
        print(CACHE_NOTE, file=sys.stderr)
    world = run_headless(**plan, progress=_progress if sys.stderr.isatty() else None)
    for option, path, write in outputs:
        try:
            path.write_bytes(write(world, path.suffix[1:]))
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
    notes = world.lab.notes(world.params, world.state)
    print(json.dumps(final | measured | ({"notes": dict(notes)} if notes else {})))
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
    entry = find_lab(options.lab)
    texts = dict(_parse_assignment(text) for text in options.set)
    return {
        "slug": options.lab,
        "changes": entry.lab.Params.read(texts),
        "seed": _check_seed(options.seed),
        "events": [parse_event(entry, at, what) for at, what in options.at],
        "solution": _read_solution(options.solution) if options.solution else None,
    }


def _read_solution(path: Path) -> Solution:
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
        events: list[Event] = events_from_recording(about)
        return {
            "slug": str(about["lab"]),
            "changes": dict(about["params"]),
            "seed": _check_seed(int(about["seed"])),
            "seconds": float(about["covers"]["to"]),
            "events": events,
            "solution": Solution.from_dict(about["solution"]) if "solution" in about else None,
        }
    except OSError as error:
        raise LabError(f"--replay {path}: {error.strerror}") from None
    except (
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise LabError(f"--replay {path}: not a JSON export of orclab ({error!r})") from None


def _parse_port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text}: takes a whole number from 0 to 65535")
    return int(text)


def _check_seed(seed: int | None) -> int | None:
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
