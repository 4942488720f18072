"""Identify and track on any throttle with the right inputs: simulated, behind a bus, or recorded."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core, identify, presets
from mgdd.control.supervised import note_sent
from mgdd.errors import ParameterError
from mgdd.io import throttle_log
from mgdd.loop import Plant, Reference
from mgdd.loop.controller_families import groups_of
from mgdd.loop.track import FIGURES
from mgdd.loop.tuned import tuned_with_doubts
from mgdd.optimize import FitOptions
from mgdd.plot.identification import validation_figure
from mgdd.plot.style import drawn
from mgdd.results.fit import figures_of
from mgdd.results.labels import labelled_dataset
from mgdd.rig.experiment.settings import IdentifyTask, TrackTask, beside
from mgdd.rig.safety import SafetyEnvelope, bounded_by

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mgdd.loop.track import AngleController
    from mgdd.throttle import Throttle

_OF_THE_DUTY = "total_variation"  # the one figure that no angle enters
_SETTLE_S = 1.0  # before an excitation: the plate comes to rest at limp-home


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a task came to."""

    figures: Mapping[str, Any]  # numbers and short texts, as JSON holds them
    dataset: xr.Dataset
    interrupted: bool = False  # whether Ctrl-C cut it
    files: Mapping[str, str | xr.Dataset] = field(default_factory=dict)  # by file name, as a fitted model
    drawings: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)  # by file name without ending


def compared(samples: int, recorded: int, differences: Sequence[tuple[int, float]]) -> dict[str, Any]:
    """Say how what was asked for agrees with a record, bit for bit, from the samples and sizes of the differences."""
    return {
        "samples": samples,
        "recorded": recorded,
        "different": len(differences),
        "first_different": differences[0][0] if differences else None,
        "largest_difference": max((size for _, size in differences), default=0.0),
    }


def throttle_named(name: str, folder: Path) -> Throttle:
    """Load the throttle of a preset or of a TOML file."""
    return presets.load(beside(folder, name), kind="throttle").throttle


class TrackPlan:
    """A controller along a reference, made and checked before anything moves."""

    def __init__(self, task: TrackTask, *, sample_s: float, folder: Path, envelope: SafetyEnvelope) -> None:
        self.task, self.sample_s, self.envelope = task, sample_s, envelope
        self.reference = Reference.parse(str(beside(folder, task.reference)), sample_s=sample_s)
        if abs(self.reference.sample_s / sample_s - 1.0) > 1e-9:
            raise ParameterError.of(
                f"reference {task.reference}: time between samples", self.reference.sample_s,
                f"{sample_s:g} s, as that of the plant",
            )  # fmt: skip
        self.samples = len(self.reference.angle_deg)
        fitted, model = task.model.endswith(".toml"), task.model
        self.model: Any = (
            identify.load_throttle_model(beside(folder, model)) if fitted else throttle_named(model, folder)
        )
        _, self.doubts = self._made()

    def controller(self) -> AngleController:
        """Make the controller, at its beginning."""
        return self._made()[0]

    def _made(self) -> tuple[AngleController, tuple[str, ...]]:
        delay = self.task.delay_samples
        if delay is None and groups_of(self.model).delay_s is None:
            delay = 0  # a rig answers within its cycle, and a preset says nothing about it
        made, doubts = tuned_with_doubts(self.task.controller, self.model, sample_s=self.sample_s, delay_samples=delay)
        return bounded_by(made, self.envelope), doubts

    def run(self, plant: Plant, first_angle_deg: float, most: int | None = None) -> Outcome:
        """Run it on a plant whose last measured angle is given, for at most so many samples."""
        controller = self.controller()
        reference_deg = self.reference.angle_deg

        def duty_at(sample: int, measured_deg: float) -> float:
            return float(controller.step(float(reference_deg[sample]), measured_deg))

        sent = partial(note_sent, controller)
        columns, interrupted = _drive(plant, fewer(self.samples, most), duty_at, first_angle_deg, sent)
        return self.outcome(columns, interrupted=interrupted)

    def outcome(self, columns: dict[str, NDArray[np.float64]], *, interrupted: bool) -> Outcome:
        """Give the figures and signals of columns: ``asked_duty``, ``duty`` and the angle that followed."""
        reference_deg = self.reference.angle_deg
        n = len(columns["asked_duty"])
        if n == 0:
            return Outcome(figures={}, dataset=_dataset(columns, self.sample_s, {}, {}), interrupted=True)
        more = {"reference_deg": reference_deg[:n]}
        # `settling_ms` and so on are those of `mgdd.loop.track`, of the true angle: most plants do not give it.
        sensed = self._figures(columns, "sensed_angle_deg")
        numbers = {name if name == _OF_THE_DUTY else f"sensed_{name}": value for name, value in sensed.items()}
        if "angle_deg" in columns:
            more["angle_deg"] = columns["angle_deg"]
            numbers = {**self._figures(columns, "angle_deg"), **numbers}
        dataset = _dataset(columns, self.sample_s, more, numbers)
        return Outcome(
            figures={
                "reference": self.reference.name,
                "controller": self.task.controller,
                **numbers,
                "warnings": list(self.doubts),
            },
            dataset=dataset,
            interrupted=interrupted,
            drawings={"track": partial(_draw_track, dataset)},
        )

    def _figures(self, columns: dict[str, NDArray[np.float64]], angle: str) -> dict[str, float]:
        target, n = self.reference, len(columns["duty"])
        figures = _core.loop.tracking_figures(
            reference_deg=target.angle_deg[:n], angle_deg=columns[angle], duty=columns["duty"], sample_s=self.sample_s,
            from_sample=min(target.from_sample, n - 1), band_deg=target.band_deg,
        )  # fmt: skip
        return {name: float(figures[name]) for name in FIGURES}


class IdentifyPlan:
    """An excitation that the prior model has been asked about, and the fit of what it shows."""

    def __init__(self, task: IdentifyTask, *, sample_s: float, seed: int, folder: Path) -> None:
        self.task, self.sample_s, self.seed = task, sample_s, seed
        self.prior = throttle_named(task.prior, folder)
        signal, _ = identify.design_excitation(
            task.excitation, self.prior, side=task.side, duration_s=task.duration_s, sample_s=sample_s
        )
        settle = round(_SETTLE_S / sample_s)
        self.duty = np.r_[np.zeros(settle), signal["duty"].to_numpy()]
        self.samples = len(self.duty)

    def run(self, plant: Plant, first_angle_deg: float, most: int | None = None) -> Outcome:
        """Run it on a plant, for at most so many samples, and fit."""
        samples = fewer(self.samples, most)
        columns, interrupted = _drive(plant, samples, lambda sample, _: float(self.duty[sample]), first_angle_deg)
        dataset = _dataset(columns, self.sample_s, {}, {})
        figures: dict[str, Any] = {"excitation": self.task.excitation, "samples": len(columns["duty"])}
        if interrupted or samples < self.samples:
            return Outcome(figures=figures, dataset=dataset, interrupted=interrupted)
        time_s = np.arange(len(columns["duty"])) * self.sample_s
        angle_deg = np.r_[first_angle_deg, columns["sensed_angle_deg"][:-1]]  # a log holds the angle before its duty
        log = throttle_log(time_s, columns["duty"], angle_deg, name="recorded")
        fit = identify.identify_throttle(
            log, self.task.model, two_sided=self.task.side == "both", options=FitOptions(seed=self.seed)
        )
        figures |= {
            "model": fit.kind, **figures_of(fit), "parameters": dict(fit.to_dict()["parameters"]),
            "findings": [str(finding) for finding in fit.findings], "success": bool(fit.report.success),
        }  # fmt: skip
        validation = identify.validate_throttle(fit, log)
        return Outcome(
            figures=figures,
            dataset=dataset,
            files={"fit.toml": fit.to_toml()},
            drawings={"identify": partial(validation_figure, validation)},
        )


def fewer(samples: int, most: int | None) -> int:
    """Give the samples of a task, at most so many."""
    return samples if most is None else min(samples, most)


def _drive(
    plant: Plant,
    samples: int,
    duty_at: Callable[[int, float], float],
    first_angle_deg: float,
    sent: Callable[[float], None] | None = None,
) -> tuple[dict[str, NDArray[np.float64]], bool]:
    """Step a plant; give columns of what was asked, applied and measured, and whether Ctrl-C cut them.

    ``sent`` is called with each duty that was applied.
    """
    asked, applied, angle, true = (np.empty(samples) for _ in range(4))
    measured_deg, done, interrupted = first_angle_deg, 0, False
    try:
        for sample in range(samples):
            duty = duty_at(sample, measured_deg)
            plant.apply({"duty": duty})
            measured = plant.measure()
            measured_deg = measured.values["sensed_angle_deg"]
            true[sample] = measured.values.get("angle_deg", math.nan)
            asked[sample], applied[sample], angle[sample] = duty, measured.applied.get("duty", duty), measured_deg
            done = sample + 1
            if sent is not None:
                sent(float(applied[sample]))
    except KeyboardInterrupt:
        interrupted = True
    columns = {"asked_duty": asked[:done], "duty": applied[:done], "sensed_angle_deg": angle[:done]}
    if np.isfinite(true[:done]).all():
        columns["angle_deg"] = true[:done]
    return columns, interrupted


def _dataset(
    columns: dict[str, NDArray[np.float64]], sample_s: float, more: dict[str, Any], numbers: dict[str, float]
) -> xr.Dataset:
    n = len(columns["duty"])
    variables: dict[str, tuple[Any, ...]] = {
        "time_s": ("time_s", np.arange(n) * sample_s),
        "duty": ("time_s", columns["duty"]),
        "asked_duty": ("time_s", columns["asked_duty"], "-", "duty that the controller asked for"),
        "sensed_angle_deg": ("time_s", columns["sensed_angle_deg"]),
    }
    variables |= {name: ("time_s", column) for name, column in more.items()}
    variables |= {name: ((), value) for name, value in numbers.items()}
    return labelled_dataset(variables)


def _draw_track(dataset: xr.Dataset) -> Figure:
    from mgdd.plot import throttle_run

    seen = dataset.assign(angle_deg=dataset["sensed_angle_deg"])
    return drawn(throttle_run, seen, size=(7.0, 5.4))
