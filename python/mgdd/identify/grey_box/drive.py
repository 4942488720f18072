"""Sampled inputs, and what of them acts between the samples, late, or on stretches of a record side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError, ShapeError
from mgdd.signals.even_grid import even_step

Interpolation = Literal["hold", "linear", "cubic"]


@dataclass(frozen=True)
class Acting:
    """Inputs at the samples, (n, inputs), and at begin, middle and end of every step, (steps, 3, inputs).

    Where they differ between the m columns of a run, they have a last axis of length m; so have the times then.
    """

    time_s: NDArray[np.float64]
    samples: NDArray[np.float64]
    steps: NDArray[np.float64]
    substeps: int
    step_s: float

    def held(self) -> NDArray[np.float64]:
        """Return the input of every sample as it acts until the next one, shape (n, inputs) or (n, inputs, m)."""
        whole: NDArray[np.float64] = np.concatenate([self.steps[:: self.substeps, 0], self.samples[-1:]])
        return whole

    def stretches(self, length: int, columns: int) -> Acting:
        """Cut into stretches of `length` samples and the one after, `columns` columns for each, side by side.

        What lies beyond the end of the record repeats its last sample.
        """
        n = self.time_s.shape[0]
        first = length * np.arange(-(-n // length))
        at = np.minimum(first + np.arange(length + 1)[:, None], n - 1)
        step = self.substeps * first + np.arange(self.substeps * length)[:, None]

        def side_by_side(rows: NDArray[np.float64], ndim: int) -> NDArray[np.float64]:
            """Move the stretches, the second axis, behind the input, before the columns."""
            moved = np.moveaxis(rows, 1, ndim)
            if moved.ndim == ndim + 1:
                moved = np.repeat(moved[..., None], columns, axis=-1)
            return np.ascontiguousarray(moved.reshape(*moved.shape[:ndim], -1))

        samples = side_by_side(self.samples[at], 2)
        steps = side_by_side(self.steps[np.minimum(step, len(self.steps) - 1)], 3)
        return Acting(side_by_side(self.time_s[at], 1), samples, steps, self.substeps, self.step_s)


@dataclass(frozen=True)
class Drive:
    """Sampled inputs, shape (samples, inputs), and what lies between the samples."""

    time_s: NDArray[np.float64]
    inputs: NDArray[np.float64]
    substeps: int
    interpolation: Interpolation

    def __post_init__(self) -> None:
        known = ("hold", "linear", "cubic")
        ParameterError.unless(self.interpolation in known, "interpolation", self.interpolation, f"one of {known}")
        if self.interpolation == "cubic" and self.time_s.size < 4:
            raise ShapeError(f"interpolation = 'cubic': needs 4 samples, the record has {self.time_s.size}")

    @property
    def step_s(self) -> float:
        """Length of an integration step."""
        return even_step(self.time_s) / self.substeps

    def acting(self, delay_s: float | NDArray[np.float64]) -> Acting:
        """Return what acts of the inputs; a delay for each of m columns adds an axis of length m.

        Of inputs that are held a step sees their mean over it, so that what a delay does is continuous.
        """
        several, which = np.unique(delay_s, return_inverse=True)
        each = [self._late(float(one)) for one in several]
        samples, steps = each[0]
        if len(each) > 1:
            samples, steps = (np.stack(parts, axis=-1)[..., which] for parts in zip(*each, strict=True))
        return Acting(self.time_s, samples, steps, self.substeps, self.step_s)

    def _late(self, delay_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        from scipy.interpolate import make_interp_spline

        n = (self.time_s.size - 1) * self.substeps
        ends = self.time_s[0] + self.step_s * np.arange(n + 1) - delay_s
        if self.interpolation != "hold":
            spline = make_interp_spline(self.time_s, self.inputs, k=1 if self.interpolation == "linear" else 3)
            first, last = self.time_s[0], self.time_s[-1]
            middles = 0.5 * (ends[:-1] + ends[1:])
            samples, *nodes = (
                spline(np.clip(at, first, last)) for at in (self.time_s - delay_s, ends[:-1], middles, ends[1:])
            )
            return samples, np.stack(nodes, axis=1)
        if delay_s == 0.0:
            held = np.repeat(self.inputs[:-1], self.substeps, axis=0)
            return self.inputs, np.repeat(held[:, None], 3, axis=1)
        knots = np.concatenate([[self.time_s[0] - delay_s - 1.0], self.time_s, [self.time_s[-1] + 1.0]])
        areas = np.vstack([self.inputs[:1], self.inputs]) * np.diff(knots)[:, None]
        whole = np.vstack([np.zeros_like(areas[:1]), np.cumsum(areas, axis=0)])
        until = np.column_stack([np.interp(ends, knots, column) for column in whole.T])
        mean = np.diff(until, axis=0) / self.step_s
        at = np.searchsorted(self.time_s, self.time_s - delay_s, side="right") - 1
        return self.inputs[np.maximum(at, 0)], np.repeat(mean[:, None], 3, axis=1)
