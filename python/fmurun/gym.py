"""Environments of Gymnasium on `Batch`: one, or many that step in one call.

The task is three functions of arrays with a row for each instance, so that both kinds of environment accept the same:

    reward(observations, actions) -> n numbers
    terminated(observations) -> n Booleans; by default an episode ends only if its instance fails
    randomize(generator, n) -> {start value: n numbers}, new for each episode
"""

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as _VectorEnv
from gymnasium.vector.utils import batch_space

from ._batch import Batch
from ._error import FmuError
from ._instance import _described, _open

__all__ = ["Env", "VectorEnv"]


class _Task:
    """A batch with spaces and functions."""

    def __init__(self, fmu, n, actions, observations, step_size, reward, terminated=None, *, repeat=1, max_steps=None,
                 bounds=None, start_values=None, randomize=None, threads=1):  # fmt: skip
        self.batch = Batch(fmu, n, actions=actions, observations=observations, step_size=step_size, start_values=start_values,
                           threads=threads)  # fmt: skip
        variables = {v.name: v for v in _described(_open(fmu)).modelVariables}
        self.action_space = _box(variables, actions, bounds or {}, "action")
        self.observation_space = _box(variables, observations, bounds or {}, None)
        self.reward, self.terminated = reward, terminated
        self.repeat, self.max_steps, self.start_values, self.randomize = repeat, max_steps, dict(start_values or {}), randomize

    def reset(self, generator, mask=None):
        start = None if self.randomize is None else {**self.start_values, **self.randomize(generator, self.batch.n)}
        return self.batch.reset(mask, start)


def _box(variables, names, bounds, what):
    """A space from the given bounds, otherwise from the minima and maxima of the variables."""
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for k, name in enumerate(names):
        variable = variables.get(name)
        own = (variable.min, variable.max) if variable else (None, None)
        lower, upper = bounds.get(name, own)
        low[k], high[k] = -np.inf if lower is None else float(lower), np.inf if upper is None else float(upper)
        if what and not np.isfinite([low[k], high[k]]).all():
            raise ValueError(f"the {what} {name} has no bounds: give bounds={{{name!r}: (lower, upper)}}")
    return gymnasium.spaces.Box(low, high, dtype=np.float64)


class Env(gymnasium.Env):
    """One instance of an FMU as an environment.

    Args:
        fmu: an .fmu file
        actions, observations: names of its variables
        step_size: communication step (s)
        reward, terminated, randomize: see this module
        repeat: communication steps of one step
        max_steps: length of an episode
        bounds: name -> (lower, upper), where the FMU has none; actions need them
        start_values: name -> value, the same in all episodes
    """

    metadata = {"render_modes": []}

    def __init__(self, fmu, actions, observations, step_size, reward, terminated=None, **options):
        self._task, self._steps = _Task(fmu, 1, actions, observations, step_size, reward, terminated, **options), 0
        self.action_space, self.observation_space = self._task.action_space, self._task.observation_space
        # A step takes about a microsecond, so its data are kept at hand.
        task = self._task
        self._advance, self._repeat, self._most = task.batch.step, task.repeat, task.max_steps
        self._reward, self._terminated = task.reward, task.terminated

    def reset(self, *, seed=None, options=None):
        """Begin an episode."""
        super().reset(seed=seed)
        self._steps = 0
        return self._task.reset(self.np_random)[0], {}

    def step(self, action):
        """Take one step."""
        action = np.asarray(action, dtype=np.float64)
        failed = False
        try:
            seen = self._advance(action, self._repeat)
        except FmuError:
            batch = self._task.batch
            seen, failed = np.zeros((1, len(batch.observations))), bool(batch.failed)
            if not failed:
                raise
        self._steps += 1
        ended = failed or (self._terminated is not None and bool(self._terminated(seen)[0]))
        return seen[0], float(self._reward(seen, action[None])[0]), ended, not ended and self._steps == self._most, {}


class VectorEnv(_VectorEnv):
    """`num_envs` instances of an FMU as a vector environment; arguments as for `Env`, and `threads`.

    An instance whose episode has ended begins the next one with its next step (AutoresetMode.NEXT_STEP).
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, fmu, num_envs, actions, observations, step_size, reward, terminated=None, **options):
        self._task = _Task(fmu, num_envs, actions, observations, step_size, reward, terminated, **options)
        self.num_envs = num_envs
        self.single_action_space, self.single_observation_space = self._task.action_space, self._task.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._ended, self._steps = np.zeros(num_envs, dtype=bool), np.zeros(num_envs, dtype=np.int64)

    def reset(self, *, seed=None, options=None):
        """Begin an episode in each."""
        super().reset(seed=seed)
        self._ended[:], self._steps[:] = False, 0
        return self._task.reset(self.np_random), {}

    def step(self, actions):
        """Take one step in each; those whose episode had ended begin a new one."""
        task, ended = self._task, self._ended
        actions = np.asarray(actions, dtype=np.float64)
        try:
            seen = task.batch.step(actions, task.repeat)
        except FmuError:
            if len(task.batch.failed) < self.num_envs:
                raise
            seen = np.full((self.num_envs, len(task.batch.observations)), np.nan)
        failed = np.isnan(seen).all(axis=1)
        seen[failed] = 0.0
        self._steps += 1
        rewards = np.asarray(task.reward(seen, actions), dtype=np.float64)
        terminated = failed if task.terminated is None else failed | np.asarray(task.terminated(seen), dtype=bool)
        truncated = ~terminated & (self._steps >= (task.max_steps or np.inf))
        if ended.any():
            seen[ended] = task.reset(self.np_random, ended)[ended]
            rewards[ended], terminated[ended], truncated[ended], self._steps[ended] = 0.0, False, False, 0
        self._ended = terminated | truncated
        return seen, rewards, terminated, truncated, {}
