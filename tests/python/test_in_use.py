"""One object, several threads: a call that would run into another one is refused, nothing is corrupted or lost."""

import copy
import pickle
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Self

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd import presets
from mgdd.errors import Error, InUseError, ParameterError
from mgdd.identify import OnlineUpdate
from mgdd.loop import VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import (
    ExtremumSeeking,
    IterativeLearning,
)
from mgdd.throttle import PseudoWiener

SPACE = {"start": -12.0, "bounds": (-30.0, 10.0)}
SEEKERS = stepped(**SPACE)


def together(*calls: Callable[[], Any]) -> list[Any]:
    """What each call returned or raised, all started at the same moment in threads of their own."""
    barrier, results = threading.Barrier(len(calls)), [None] * len(calls)

    def work(place: int) -> None:
        barrier.wait()
        try:
            results[place] = calls[place]()
        except Exception as error:  # noqa: BLE001 - handed to the test
            results[place] = error

    threads = [threading.Thread(target=work, args=(place,)) for place in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results


class Running:
    """A call in another thread: entered once the call has begun, left when it has ended."""

    def __init__(self, call: Callable[[], Any]) -> None:
        self.thread = threading.Thread(target=call)

    def __enter__(self) -> Self:
        self.thread.start()
        time.sleep(0.05)
        return self

    def __exit__(self, *_: object) -> None:
        self.thread.join()


@pytest.mark.parametrize("kind", SEEKERS)
def test_three_threads_cannot_corrupt_one_seeker(kind: str) -> None:
    seeker = SEEKERS[kind]()
    for _ in range(4):
        before = seeker.cycle
        results = together(*[lambda: run_seeker(VirtualEngine(), seeker, 1000) for _ in range(3)])
        done = [result for result in results if not isinstance(result, Exception)]
        assert done
        assert all(isinstance(result, InUseError) for result in results if isinstance(result, Exception)), results
        assert seeker.cycle == before + 1000 * len(done)
        np.testing.assert_array_equal(seeker.history["cycle"], np.arange(seeker.cycle))


def test_a_seeker_in_a_run_refuses_everything_but_what_is_constant() -> None:
    seeker, other = ExtremumSeeking(**SPACE), ExtremumSeeking(**SPACE)
    bench = VirtualEngine()
    settings = seeker.settings
    told: list[Callable[[], Any]] = [
        seeker.ask,
        lambda: seeker.tell(1.0),
        seeker.restart,
        lambda: seeker.estimate,
        lambda: seeker.gradient,
        lambda: seeker.cycle,
        lambda: seeker.state,
        lambda: setattr(seeker, "state", other.state),
        lambda: seeker.history,
        seeker.clear_history,
        lambda: pickle.dumps(seeker),
        lambda: copy.deepcopy(seeker),
        lambda: run_seeker(VirtualEngine(), seeker, 1),
        lambda: monte_carlo(VirtualEngine(), seeker, [1], cycles=1),
        lambda: bench.step(-6.0),
        lambda: bench.run([-6.0]),
        bench.reset,
        lambda: bench.state,
        lambda: setattr(bench, "state", VirtualEngine().state),
        lambda: bench.cycle,
        lambda: bench.point,
        lambda: repr(bench),
        lambda: pickle.dumps(bench),
        lambda: run_seeker(bench, other, 1),
        lambda: monte_carlo(bench, other, [1], cycles=1),
    ]
    with Running(lambda: run_seeker(bench, seeker, 40_000)) as run:
        for number, call in enumerate(told):
            with pytest.raises(InUseError, match=r"(ExtremumSeeking|VirtualEngine) is in use .* its own copy"):
                call()
            assert run.thread.is_alive(), number
        assert seeker.settings == settings
        assert (seeker.limit_names, seeker.component_count) == ([], 1)
        assert bench.settings["seed"] == 0
        assert bench.window_cad == VirtualEngine().window_cad
    assert (seeker.cycle, bench.cycle, other.cycle) == (40_000, 40_000, 0)
    twin = ExtremumSeeking(**SPACE)
    run_seeker(VirtualEngine(), twin, 40_000)
    assert seeker.state == twin.state
    np.testing.assert_array_equal(seeker.history["estimate"], twin.history["estimate"])


def test_two_threads_cannot_race_on_one_bench() -> None:
    bench, soc = VirtualEngine(seed=3), np.linspace(-20.0, 0.0, 2000)
    results = together(*[lambda: bench.run(soc) for _ in range(3)])
    done = [result for result in results if not isinstance(result, Exception)]
    assert done
    assert all(isinstance(result, InUseError) for result in results if isinstance(result, Exception)), results
    assert bench.cycle == 2000 * len(done)


def test_a_learner_refuses_a_second_trial_at_the_same_time() -> None:
    learner = IterativeLearning(np.zeros(900), impulse_response=0.5 ** np.arange(20.0), law="norm_optimal")
    for trial in range(10):
        learner.ask()
        results = together(*[lambda: learner.tell(np.ones(900)) for _ in range(3)])
        assert results.count(None) == 1
        assert all(result is None or isinstance(result, InUseError | ParameterError) for result in results), results
        assert learner.trial == trial + 1


def test_an_online_update_takes_a_column_once_or_not_at_all() -> None:
    model = PseudoWiener.of_throttle(presets.load("P1").throttle)
    duty = np.tile(np.repeat([0.2, 0.35], 500), 60)
    record = {"time_s": 1e-3 * np.arange(duty.size), "duty": duty}
    angle = model.simulate(record, initial_state={"angle_deg": 10.0})["angle_deg"].to_numpy()
    for method in ("recursive_least_squares", "window", "gradient"):
        update, twin = OnlineUpdate(model, method=method), OnlineUpdate(model, method=method)
        results = together(*[partial(update.update, duty, angle)] * 3)
        done = [result for result in results if not isinstance(result, Exception)]
        assert all(isinstance(result, InUseError) for result in results if isinstance(result, Exception)), results
        for _ in done:
            twin.update(duty, angle)
        assert update.state() == twin.state()


def test_in_use_is_an_error_of_ours() -> None:
    assert issubclass(InUseError, Error)
    assert issubclass(InUseError, RuntimeError)
