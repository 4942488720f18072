"""The adapters of the page "How to" to Gymnasium and cernml, as they stand there."""

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mgdd.loop import seek

PAGE = Path(__file__).resolve().parents[3] / "docs" / "howto.md"
BEST = np.array([-4.0, 0.15])
BOX = SimpleNamespace(
    low=np.array([-25.0, 0.0], np.float32), high=np.array([15.0, 0.4], np.float32), shape=(2,), dtype=np.float32
)


def of_page(name: str) -> Callable[..., Any]:
    """Take a function from the page."""
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    (block,) = [block for block in blocks if block.startswith(f"def {name}(")]
    assert len(block.splitlines()) <= 12
    space: dict[str, Any] = {"np": np, "seek": seek}
    exec(compile(block, PAGE.name, "exec"), space)  # noqa: S102
    return space[name]


def efficiency(x: Any) -> float:
    timing, egr = np.asarray(x, np.float64) - BEST
    return float(56.0 - 0.03 * timing**2 - 300.0 * egr**2)


class Steps:
    """What an environment does, of whatever class it is; an episode has ten steps."""

    def __init__(self) -> None:
        self.rng, self.steps, self.episodes = np.random.default_rng(1), 0, 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:  # noqa: ARG002
        self.steps, self.episodes = 0, self.episodes + 1
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        assert self.steps < 10, "an episode that is over goes on"
        assert action.dtype == np.float32
        self.steps += 1
        reward = efficiency(action) + self.rng.normal(0.0, 0.2)
        return np.zeros(1, np.float32), reward, self.steps == 10, False, {}


class Task:
    """What an optimizable does, of whatever class it is."""

    param_names: tuple[str, ...] = ("soc_cad", "egr")

    def get_initial_params(self, *, seed: int | None = None, options: Any = None) -> Any:  # noqa: ARG002
        return np.array([6.0, 0.3])

    def compute_single_objective(self, params: Any) -> float:
        return -efficiency(params)


def test_an_environment_is_sought() -> None:
    class Env(Steps):
        action_space = BOX

    env = Env()
    found = of_page("seek_env")(env, cycles=80)
    assert efficiency(list(found.inputs.values())) > 55.8
    assert list(found.inputs) == ["action_0", "action_1"]
    assert env.episodes == 9


def test_an_optimizable_is_sought() -> None:
    class Optimizable(Task):
        optimization_space = BOX

    found = of_page("seek_optimizable")(Optimizable(), cycles=60)
    assert found.inputs["soc_cad"] == pytest.approx(-4.0, abs=0.5)
    assert found.start == {"soc_cad": 6.0, "egr": 0.3}
    assert found.value == pytest.approx(-56.0, abs=0.1)
    Optimizable.param_names = ()
    assert list(of_page("seek_optimizable")(Optimizable(), cycles=10).inputs) == ["parameter_0", "parameter_1"]


def test_the_lines_of_the_page_about_one_call_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    section = text.split("## Find the best settings")[1].split("\n## ")[0]
    space: dict[str, Any] = {}
    for block in re.findall(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL):
        exec(compile(block, PAGE.name, "exec"), space)  # noqa: S102
    assert space["found"].limits["p_max_bar"] < 96.0
    assert space["front"].dataset.sizes["point"] == 21
