"""A controller as C++ for a target: its settings, its step, what compiles them, and the samples of a run as a test."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mgdd._core import __version__
from mgdd._core.control import SinglePrecision
from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode
from mgdd.errors import ParameterError
from mgdd.io.files import write_whole_text
from mgdd.loop.plates import PlateLike
from mgdd.loop.track import reference_of, track

if TYPE_CHECKING:
    import os

    from mgdd.results.dataset import Dataset

    Exported = GuidedPredictive | Pid | SlidingMode

CPP = Path(str(resources.files("mgdd"))) / "cpp"  # what the package has for C++
FILES = ("controller_settings.hpp", "test_vectors.hpp", "main.cpp", "CMakeLists.txt")
_HEADERS = {GuidedPredictive: "guided_predictive", Pid: "pid", SlidingMode: "sliding_mode"}
_PROBES, _MARGIN = 16, 8.0  # of what functions that another library rounds otherwise may change


def export_controller(
    controller: Exported,
    folder: str | os.PathLike[str],
    *,
    reference: Any = "step:4:60",
    throttle: PlateLike | None = None,
    delay_samples: int | None = None,
    noise_deg: float = 0.03,
    seed: int = 0,
    single_precision: bool = False,
) -> Dataset:
    """Write a controller as C++ for a target, with a run of it as the test there.

    The folder gets the settings as a header, the samples of the run as test vectors, a ``main.cpp`` that steps through
    them, and a ``CMakeLists.txt`` that takes the controllers of mgdd from `mgdd.cmake_dir` and compiles them with the
    compiler of the target: C++20, no Eigen, no exceptions or run-time types needed, no heap in the step.

    Parameters
    ----------
    controller : GuidedPredictive, Pid or SlidingMode
        What to write, as made: the run goes through a copy, and what was learnt is not written.
    folder : str or path-like
        Made if it is not there. The two headers are replaced; a ``main.cpp`` and ``CMakeLists.txt`` in it stay.
    reference : Reference, str, array_like, or a signal with its time
        What the run follows, as of `track`, at the samples of the controller.
    throttle : Throttle, Preset, Fit, its model, str or path-like, or an object with `step` and `output`, optional
        The plant of the run, as of `track`; the preset ``P1`` if left out.
    delay_samples : int, optional
        Whole samples between the computed duty and its effect, 0 to 20; the delay of a fit, to the nearest sample, or
        1 if left out.
    noise_deg : float
        Standard deviation of the measured angle [deg].
    seed : int
        Of the noise.
    single_precision : bool
        Use numbers of 32 bits in the step, for a target that computes no wider ones in hardware; the run is then that
        of the controller on such numbers.

    Returns
    -------
    xarray.Dataset
        The run as of `track`, with ``measured_deg``, what the controller got at each sample.
        ``attrs["allowed_difference"]`` is the largest difference of a duty [-] at which the test passes.

    Raises
    ------
    mgdd.errors.ParameterError
        Another kind of controller, a reference of other samples than the controller's, or a bad setting of the run.

    Notes
    -----
    On x86-64 the duties are equal bit by bit: no multiply-add is fused, and the step uses operations that IEEE 754
    rounds correctly. A few coefficients go through ``exp``, and the prediction of ``nmpc`` through ``tanh``, which
    another library may round otherwise. The test allows 8 times the largest change of a duty when every setting moves
    by one unit of its last place, at random up or down, in 16 runs.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from mgdd.loop import export_controller, tuned_controller
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = export_controller(tuned_controller("pid"), folder, single_precision=True)
    ...     sorted(file.name for file in Path(folder).iterdir())
    ['CMakeLists.txt', 'controller_settings.hpp', 'main.cpp', 'test_vectors.hpp']
    >>> bool(run["settling_ms"] < 200.0), run.attrs["allowed_difference"] < 1e-3
    (True, True)
    """
    if type(controller) not in _HEADERS:
        raise ParameterError.of("controller", controller, _what_is_exported(controller))
    target = reference_of(reference)
    sample_s = controller.settings["sample_s"]
    if abs(target.sample_s - sample_s) > 1e-9 * sample_s:
        bound = f"one with samples of {sample_s:g} s, for which the controller is made"
        raise ParameterError.of("reference", f"samples of {target.sample_s:g} s", bound)
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise ParameterError.of("folder", str(folder), "a folder, and this is a file: name another")
    number: type = np.float32 if single_precision else np.float64
    recorded = _Recorded(_made(controller, controller.settings, number))
    run = track(recorded, target, throttle=throttle, delay_samples=delay_samples, noise_deg=noise_deg, seed=seed)
    samples: NDArray[Any] = np.array(recorded.samples, number)
    allowed = _allowed_difference(controller, samples)
    place.mkdir(parents=True, exist_ok=True)
    settings, vectors, *programs = FILES
    write_whole_text(place / settings, _settings_text(controller, single_precision))
    write_whole_text(place / vectors, _vectors_text(samples, allowed))
    for name in programs:
        if not (place / name).exists():
            write_whole_text(place / name, (CPP / "export" / name).read_text(encoding="utf-8"))
    run["measured_deg"] = ("time_s", samples[:, 1].astype(float), dict(run["sensed_angle_deg"].attrs))
    return run.assign_attrs(folder=str(place), allowed_difference=allowed)


class _Recorded:
    """A controller that keeps what it was asked and what it answered."""

    def __init__(self, controller: Any) -> None:
        self._controller = controller
        self.samples: list[tuple[float, float, float]] = []

    def step(self, reference_deg: float, measurement_deg: float, /) -> float:
        duty = float(self._controller.step(reference_deg, measurement_deg))
        self.samples.append((reference_deg, measurement_deg, duty))
        return duty


def _made(controller: Exported, settings: dict[str, Any], number: type) -> Any:
    new = type(controller)(**settings)
    return SinglePrecision(new) if number is np.float32 else new


def _what_is_exported(controller: object) -> str:
    bound = "a GuidedPredictive, Pid or SlidingMode"
    if isinstance(controller, Mgdd1):
        return f"{bound}: the guide of an Mgdd1 may be any object; tuned_controller('guided', ...) has its model inside"
    inner = getattr(controller, "controller", None)
    return f"{bound}: give its .controller" if type(inner) in _HEADERS else bound


def _allowed_difference(controller: Exported, samples: NDArray[Any]) -> float:
    """Bound the change of a duty by functions that another library rounds otherwise: of settings an ulp away."""
    epsilon = float(np.finfo(samples.dtype).eps)
    worst, rng, fields = epsilon, np.random.default_rng(0), controller.fields()
    for _ in range(_PROBES):
        settings = dict(controller.settings)
        for name, value in settings.items():
            if isinstance(value, float):
                rounded = value * (1.0 + epsilon * float(rng.choice((-1.0, 1.0))))
                if fields[name]["lower"] < rounded <= fields[name]["upper"]:
                    settings[name] = rounded
        other = _made(controller, settings, samples.dtype.type)
        duties = [other.step(float(reference), float(measured)) for reference, measured, _duty in samples]
        worst = max(worst, float(np.abs(np.subtract(duties, samples[:, 2])).max()))
    return _MARGIN * worst


def _settings_text(controller: Exported, single_precision: bool) -> str:
    """Write the settings, each with its unit and meaning, in decimals that give the same number again."""
    kind, fields = type(controller).__name__, controller.fields()
    lines = []
    for name, member in controller._members().items():
        unit = "" if fields[name]["unit"] == "-" else f"[{fields[name]['unit']}] "
        value = _written(controller.settings[name], member)
        lines.append(f"  s.{member} = {value};  // {unit}{fields[name]['meaning']}")
    return f"""// {kind} of a throttle plate, as mgdd {__version__} wrote it: a new export replaces this file.
// Angles in deg, duty -1..1, time in s: one step every {controller.settings["sample_s"]!r} s.
#pragma once

#include "mgdd/control/{_HEADERS[type(controller)]}.hpp"

namespace throttle_controller {{

using Number = {"float" if single_precision else "double"};
using Controller = mgdd::control::Basic{kind}<Number>;

inline constexpr mgdd::control::{kind}Settings settings = [] {{
  mgdd::control::{kind}Settings s;
{chr(10).join(lines)}
  return s;
}}();

}}  // namespace throttle_controller
"""


def _written(value: Any, member: str) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"decltype(s.{member})::{value}"
    if isinstance(value, list | tuple):
        return f"{{{', '.join(map(str, value))}}}"
    return repr(value)


def _vectors_text(samples: NDArray[Any], allowed: float) -> str:
    suffix = "F" if samples.dtype == np.float32 else ""
    rows = (", ".join(f"{number!s}{suffix}" for number in row) for row in samples)
    return f"""// Samples of a tracked run, as mgdd {__version__} wrote them: a new export replaces this file.
#pragma once

#include "controller_settings.hpp"

namespace throttle_controller {{

struct Sample {{
  Number reference_deg, measured_deg, duty;
}};

/// Largest difference of a duty that a library may make which rounds exp and tanh otherwise.
inline constexpr double allowed_difference = {allowed!r};

inline constexpr Sample samples[] = {{
{chr(10).join(f"    {{{row}}}," for row in rows)}
}};

}}  // namespace throttle_controller
"""
