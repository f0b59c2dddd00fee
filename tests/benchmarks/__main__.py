"""Measures: `python -m tests.benchmarks [NAME ...]`; without names, everything.

Figures of one run stand side by side; compare ratios, not seconds, across machines."""

import argparse
import platform

from tests.benchmarks import (
    ddp,
    direct,
    drag,
    dynamic_programming,
    frames,
    headless,
    knob,
    latency,
    load,
    lqr,
    mpc,
    resolve,
    rl,
    td_control,
)

MEASURES = {
    "headless": headless.ratio_to_bare_calls,
    "lqr": lqr.riccati,
    "ddp": ddp.iteration_ratio,
    "ddp-growth": ddp.growth,
    "direct": direct.beside_ipopt,
    "direct-iteration": direct.on_the_ur5,
    "direct-drag": drag.target_to_motion,
    "mpc": mpc.mpc_benchmarks,
    "value-iteration": dynamic_programming.on_the_pendulum,
    "q-learning": td_control.q_learning_steps,
    "rl": rl.rl_benchmarks,
    "slider": latency.slider_to_telemetry,
    "scene": latency.slider_to_scene,
    "knob": knob.knob_to_telemetry,
    "knob-scene": knob.knob_to_scene,
    "resolve": resolve.weight_to_motion,
    "frames": frames.while_solving,
    "page": latency.page_to_motion,
    "twelve": load.twelve_sessions,
    "growing": load.step_time_by_sessions,
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MEASURES))
    names = parser.parse_args().names or list(MEASURES)
    unknown = sorted(set(names) - set(MEASURES))
    if unknown:
        parser.error(f"no measure is named {', '.join(unknown)}; there are {', '.join(MEASURES)}")
    print(f"Python {platform.python_version()}, {platform.machine()}")
    for name in names:
        print(f"\n== {name}", flush=True)
        MEASURES[name]()


if __name__ == "__main__":
    main()
