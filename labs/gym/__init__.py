"""The labs' tasks as Gymnasium environments (the extra `gym`). Importing this registers them:

    import gymnasium
    import labs.gym
    env = gymnasium.make("orclab/Pendulum-v0")

The reward is the negative cost. What ends a task for good terminates an episode; after its
horizon it is truncated.
"""

try:
    from gymnasium.envs.registration import register
except ImportError as error:
    raise ImportError("the extra gym is missing: pip install 'orclab[gym]'") from error

CONTINUOUS_HORIZONS = {"Pendulum": 200, "DoublePendulum": 200, "UR5Reach": 60}
"""States are continuous, torques few; with the horizon of each [steps]."""
FINITE_HORIZONS = {"GridWorld": 500, "RandomWalk": 50_000}
"""Finite MDPs, likewise."""

for _name, _horizon in (CONTINUOUS_HORIZONS | FINITE_HORIZONS).items():
    _module = "torques" if _name in CONTINUOUS_HORIZONS else "tables"
    register(
        f"orclab/{_name}-v0",
        entry_point=f"labs.gym.{_module}:{_name}Env",
        max_episode_steps=_horizon,
    )
