"""A surrogate of a measured engine, run cycle by cycle with its sensor lag and recorded residuals, as a plant."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, ParameterError, RigError
from mgdd.loop.plant import Measurement, checked_inputs
from mgdd.optimize import Limit
from mgdd.optimize.optimum import limit_names_of
from mgdd_studies.measured_engine.signal_model import decay_of
from mgdd_studies.measured_engine.surrogate import EngineSurrogate

_LEVERAGE = "leverage_share"
_HALVINGS = 40  # of the way to a boundary


class SurrogatePlant:
    """A virtual measured engine: a surrogate run cycle by cycle, by `step` or, as a plant, by a seeker.

    A fast signal answers in the cycle of its command; a signal with a longer lag comes later by the difference, and
    a slow sensor adds its first-order lag. Residuals are drawn as stretches of the log, the same row for all
    signals, so that they keep their correlation with each other and in time. They hold cyclic scatter *and* what
    the surfaces miss (compare `SignalModel.residual_sd` with ``cyclic_sd``).

    Parameters
    ----------
    surrogate : EngineSurrogate
        The surfaces.
    objective : str or mapping of str to float
        A signal, or the weight of each signal; every weighted signal is one component of J.
    limits : sequence of str, or limits by name or as Limit
        Signals to report as limits, and ``leverage_share``: the leverage of the inputs, as a share of the highest in
        the support. It is known exactly, and a seeker that keeps it at 1 stays where the surfaces are known.
    inputs : sequence of str
        Which inputs of the surrogate are steered, ``soi_cad`` first; the others keep the values of `at`.
    at : mapping of str to float, optional
        The other inputs, in their units; their medians if left out.
    start_soi_cad : float, optional
        Command of all cycles before the first [°CA aTDC]; its median if left out.
    seed : int
        Seed of the stretches.
    residuals : bool
        Whether to add them; without, readings are those of the surfaces.
    block_cycles : int
        Length of a stretch [cycles]; at its end the next begins, with a jump in slow residuals.
    outside : {"flag", "raise", "clamp"}
        What to do with a command outside the support; clamped, it is applied as far from the medians as the support
        reaches, and `Measurement.applied` says so.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, an unknown signal or input; medians outside the support, with ``outside="clamp"``.
    mgdd.errors.DataError
        No stretch of that length without a gap in the residuals.

    Examples
    --------
    >>> from mgdd_studies.measured_engine import SurrogatePlant, fit_surrogate, random_step_records
    >>> surrogate = fit_surrogate(random_step_records(1500))
    >>> plant = SurrogatePlant(surrogate, "imep_bar", limits=["mprr"], residuals=False)
    >>> reading = plant.step(-4.0)
    >>> sorted(reading), round(reading["imep_bar"], 1)
    (['imep_bar', 'mfb50_cad', 'mprr', 'nox_ppm', 'supported'], 7.2)
    >>> plant.apply({"soi_cad": -4.0})
    >>> sorted(plant.measure().limits)
    ['mprr']
    """

    def __init__(
        self,
        surrogate: EngineSurrogate,
        objective: str | Mapping[str, float] = "imep_bar",
        *,
        limits: Mapping[str, float] | Sequence[Limit | str] = (),
        inputs: Sequence[str] = ("soi_cad",),
        at: Mapping[str, float] | None = None,
        start_soi_cad: float | None = None,
        seed: int = 0,
        residuals: bool = True,
        block_cycles: int = 100,
        outside: str = "flag",
    ) -> None:
        ParameterError.unless(outside in ("flag", "raise", "clamp"), "outside", outside, "'flag', 'raise' or 'clamp'")
        ParameterError.unless(block_cycles >= 1, "block_cycles", block_cycles, ">= 1")
        self.objective = {objective: 1.0} if isinstance(objective, str) else dict(objective)
        if not self.objective:
            raise ParameterError("objective = {}: must name at least one signal")
        self.input_names, self.limit_names = tuple(inputs), tuple(limit_names_of(limits))
        signals = list(surrogate.signals)
        for what, names in (("objective", self.objective), ("limits", [n for n in self.limit_names if n != _LEVERAGE])):
            if unknown := [name for name in names if name not in signals]:
                raise ParameterError(f"{what}: {unknown[0]!r} is not a signal: must be one of {signals}")
        model_inputs = tuple(surrogate.support.inputs)
        if tuple(inputs)[:1] != ("soi_cad",) or len(set(inputs)) < len(inputs) or not set(inputs) <= set(model_inputs):
            raise ParameterError(
                f"inputs = {list(inputs)}: must begin with soi_cad and be among {list(model_inputs)}, once each"
            )
        self._applied: tuple[float, ...] | None = None
        self.surrogate = surrogate
        self._at = dict(at or {})
        self._outside = outside
        self._inside = self._point(surrogate.medians["soi_cad"])
        if outside == "clamp" and not self._steady(self._inside)[1]:
            raise ParameterError(f"at = {self._at}: no command can be clamped, the medians of the others are outside")
        self._names = tuple(surrogate.signals)
        models = list(surrogate.signals.values())
        first = min(model.lag_cycles for model in models)
        self._delays = np.array([model.lag_cycles - first for model in models])
        self._decays = np.array([decay_of(m.sensor.tau_cycles) if m.sensor is not None else 0.0 for m in models])
        self._floor = np.array([0.0 if name in surrogate.nonnegative else -np.inf for name in self._names])
        self._block = block_cycles
        self._starts = _starts(surrogate.residuals, block_cycles) if residuals else None
        self._generator = np.random.default_rng(seed)
        steady, _ = self._steady(self._point(surrogate.medians["soi_cad"] if start_soi_cad is None else start_soi_cad))
        self._history = np.tile(steady, (int(self._delays.max()) + 1, 1))
        self._sensor = steady.copy()
        self._row = self._left = self._cycles = 0

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the injection of the next cycle."""
        self._applied = checked_inputs(inputs, self.input_names)

    def measure(self) -> Measurement:
        """Run one cycle at the inputs applied last.

        Returns
        -------
        Measurement
            ``values`` holds the reading of every signal, and ``supported`` as 0 or 1; ``noise_free_limits`` are the
            limits without the residuals, lags included.
        """
        if self._applied is None:
            raise RigError("measure() before apply(): apply the inputs first")
        soi, *others = self._applied
        reading = self.step(soi, dict(zip(self.input_names[1:], others, strict=True)))
        support, point = self.surrogate.support, self._point_applied
        applied = dict(zip(support.inputs, point.tolist(), strict=True)) if self._outside == "clamp" else {}
        values = {**reading, _LEVERAGE: float(support.leverage(point[None])[0]) / support.leverage_limit}
        return Measurement(
            components=tuple(weight * float(reading[name]) for name, weight in self.objective.items()),
            limits={name: float(values[name]) for name in self.limit_names},
            values={name: float(value) for name, value in reading.items()},
            noise_free_limits={name: self._noise_free.get(name, values[name]) for name in self.limit_names},
            applied={name: value for name, value in applied.items() if name in self.input_names},
        )

    def step(self, soi_cad: float, at: Mapping[str, float] | None = None) -> dict[str, float | bool]:
        """Run one cycle.

        Parameters
        ----------
        soi_cad : float
            Command of this cycle [°CA aTDC].
        at : mapping of str to float, optional
            Other inputs of this cycle, in their units, instead of the plant's own.

        Returns
        -------
        dict
            The reading of every signal in its unit, and ``supported``: whether the command lies where the surrogate
            was fitted.

        Raises
        ------
        mgdd.errors.ParameterError
            A command that is not finite, or outside the support with ``outside="raise"``; the plant has not moved.
        """
        point = self._point(soi_cad, at)
        steady, supported = self._steady(point)
        if not supported and self._outside == "raise":
            raise ParameterError(f"soi_cad = {soi_cad:g}: outside the support of the records; stay inside")
        if not supported and self._outside == "clamp":
            point = farthest_inside(self._inside, point, lambda at: self._steady(at)[1])
            steady, supported = self._steady(point)
        self._point_applied = point
        self._history = np.vstack([steady, self._history[:-1]])
        arriving = self._history[self._delays, np.arange(self._delays.size)]
        self._sensor = self._decays * self._sensor + (1.0 - self._decays) * arriving
        self._cycles += 1
        self._noise_free = dict(zip(self._names, np.maximum(self._sensor, self._floor).tolist(), strict=True))
        reading = np.maximum(self._sensor + self._residual(), self._floor)
        return {**{name: float(v) for name, v in zip(self._names, reading, strict=True)}, "supported": supported}

    @property
    def cycles(self) -> int:
        """Cycles run so far."""
        return self._cycles

    @property
    def state(self) -> dict[str, Any]:
        """All that changes from cycle to cycle, as plain numbers that JSON can hold.

        Setting it resumes a run of a plant with the same surrogate and options.
        """
        return {
            "cycles": self._cycles,
            "row": self._row,
            "left": self._left,
            "history": self._history.tolist(),
            "sensor": self._sensor.tolist(),
            "generator": copy.deepcopy(dict(self._generator.bit_generator.state)),
        }

    @state.setter
    def state(self, saved: Mapping[str, Any]) -> None:
        missing = [name for name in self.state if name not in saved]
        if missing:
            raise ParameterError(f"state: {missing[0]} is missing: give what .state returned")
        history, sensor = np.array(saved["history"], dtype=float), np.array(saved["sensor"], dtype=float)
        if history.shape != self._history.shape or sensor.shape != self._sensor.shape:
            raise ParameterError(f"state: history has shape {history.shape}: must be {self._history.shape}")
        row, left = int(saved["row"]), int(saved["left"])
        if not 0 <= left <= self._block or not 0 <= row <= len(self.surrogate.residuals) - left:
            raise ParameterError(f"state: row = {row}, left = {left}: must lie in the residuals, for this block_cycles")
        generator = np.random.default_rng()
        generator.bit_generator.state = copy.deepcopy(dict(saved["generator"]))
        self._history, self._sensor, self._generator = history, sensor, generator
        self._row, self._left, self._cycles = row, left, int(saved["cycles"])

    def _point(self, soi_cad: float, at: Mapping[str, float] | None = None) -> NDArray[np.float64]:
        point: NDArray[np.float64] = self.surrogate.points(np.array([float(soi_cad)]), {**self._at, **(at or {})})[0]
        return point

    def _steady(self, point: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool]:
        values, supported = self.surrogate.evaluate(point[None])
        return values[0], bool(supported[0])

    def _residual(self) -> NDArray[np.float64]:
        if self._starts is None:
            return np.zeros(len(self._names))
        if self._left == 0:
            self._row = int(self._generator.choice(self._starts))
            self._left = self._block
        row: NDArray[np.float64] = self.surrogate.residuals[self._row]
        self._row += 1
        self._left -= 1
        return row


def _starts(residuals: NDArray[np.float64], block: int) -> NDArray[np.intp]:
    """Rows from which a stretch of the given length has every residual of every signal."""
    whole = np.all(np.isfinite(residuals), axis=1).astype(np.int64)
    total = np.r_[0, np.cumsum(whole)]
    starts = np.flatnonzero(total[block:] - total[:-block] == block)
    if starts.size == 0:
        raise DataError(f"no {block} cycles in a row have all residuals: take a smaller block_cycles")
    return starts


def farthest_inside(
    inside: NDArray[np.float64], outside: NDArray[np.float64], is_inside: Callable[[NDArray[np.float64]], bool]
) -> NDArray[np.float64]:
    """Find how far one can go from a point inside towards one outside; both of shape (m,)."""
    least, most = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (least + most)
        least, most = (middle, most) if is_inside(inside + middle * (outside - inside)) else (least, middle)
    return inside + least * (outside - inside)
