"""A virtual measured engine: a surrogate run cycle by cycle, with its sensor lag and its recorded residuals."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.results.describe import described
from mgdd.surrogate.sensor_lag import decay_of
from mgdd.surrogate.surrogate import EngineSurrogate

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["SurrogateEngine"]


class SurrogateEngine:
    """Run a surrogate as an engine: one command of SOI per cycle, one row of readings back.

    A fast signal answers in the cycle of its command; a signal with a longer lag comes later by the difference, and
    a slow sensor adds its first-order lag. Residuals are drawn as stretches of the log, the same row for all
    signals, so that they keep their correlation with each other and in time. They hold cyclic scatter *and* what
    the surfaces miss (compare `SignalModel.residual_sd` with ``cyclic_sd``).

    Parameters
    ----------
    surrogate : EngineSurrogate
        The surfaces.
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
    outside : {"flag", "raise"}
        What to do with a command outside the support.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, or an unknown input.
    mgdd.errors.DataError
        No stretch of that length without a gap in the residuals.

    Examples
    --------
    >>> from mgdd.surrogate import SurrogateEngine, fit_surrogate, random_step_records
    >>> surrogate = fit_surrogate(random_step_records(1500))
    >>> engine = SurrogateEngine(surrogate, residuals=False)
    >>> reading = engine.step(-4.0)
    >>> sorted(reading)
    ['imep_bar', 'mfb50_cad', 'mprr', 'nox_ppm', 'supported']
    >>> round(reading["imep_bar"], 1)
    7.2
    """

    def __init__(
        self,
        surrogate: EngineSurrogate,
        at: Mapping[str, float] | None = None,
        *,
        start_soi_cad: float | None = None,
        seed: int = 0,
        residuals: bool = True,
        block_cycles: int = 100,
        outside: str = "flag",
    ) -> None:
        if outside not in ("flag", "raise"):
            raise ParameterError.of("outside", outside, "'flag' or 'raise'")
        if block_cycles < 1:
            raise ParameterError.of("block_cycles", block_cycles, ">= 1")
        self.surrogate = surrogate
        self._at = dict(at or {})
        self._outside = outside
        self._names = tuple(surrogate.signals)
        models = list(surrogate.signals.values())
        first = min(model.lag_cycles for model in models)
        self._delays = np.array([model.lag_cycles - first for model in models])
        self._decays = np.array([decay_of(m.sensor.tau_cycles) if m.sensor is not None else 0.0 for m in models])
        self._floor = np.array([0.0 if name in surrogate.nonnegative else -np.inf for name in self._names])
        self._block = block_cycles
        self._starts = _starts(surrogate.residuals, block_cycles) if residuals else None
        self._generator = np.random.default_rng(seed)
        steady, _ = self._steady(surrogate.medians["soi_cad"] if start_soi_cad is None else start_soi_cad)
        self._history = np.tile(steady, (int(self._delays.max()) + 1, 1))
        self._sensor = steady.copy()
        self._row = self._left = self._cycles = 0

    def step(self, soi_cad: float, at: Mapping[str, float] | None = None) -> dict[str, float | bool]:
        """Run one cycle.

        Parameters
        ----------
        soi_cad : float
            Command of this cycle [°CA aTDC].
        at : mapping of str to float, optional
            Other inputs of this cycle, in their units, instead of the engine's own.

        Returns
        -------
        dict
            The reading of every signal in its unit, and ``supported``: whether the command lies where the surrogate
            was fitted.

        Raises
        ------
        mgdd.errors.ParameterError
            A command that is not finite, or outside the support with ``outside="raise"``; the engine has not moved.
        """
        steady, supported = self._steady(soi_cad, at)
        if not supported and self._outside == "raise":
            raise ParameterError(f"soi_cad = {soi_cad:g}: outside the support of the records; stay inside")
        self._history = np.vstack([steady, self._history[:-1]])
        arriving = self._history[self._delays, np.arange(self._delays.size)]
        self._sensor = self._decays * self._sensor + (1.0 - self._decays) * arriving
        self._cycles += 1
        reading = np.maximum(self._sensor + self._residual(), self._floor)
        return {**{name: float(v) for name, v in zip(self._names, reading, strict=True)}, "supported": supported}

    @property
    def cycles(self) -> int:
        """Cycles run so far."""
        return self._cycles

    @property
    def state(self) -> dict[str, Any]:
        """All that changes from cycle to cycle, as plain numbers that JSON can hold.

        Setting it resumes a run of an engine with the same surrogate and options.
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

    def _steady(self, soi_cad: float, at: Mapping[str, float] | None = None) -> tuple[NDArray[np.float64], bool]:
        values, supported = self.surrogate.evaluate(
            self.surrogate.points(np.array([float(soi_cad)]), {**self._at, **(at or {})})
        )
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


described(
    SurrogateEngine,
    rows=lambda engine: {
        "signals": tuple(engine.surrogate.signals),
        "inputs": engine.surrogate.inputs,
        "cycles": engine.cycles,
        "block_cycles": engine._block,
        "residuals": engine._starts is not None,
        "outside": engine._outside,
    },
)


def _starts(residuals: NDArray[np.float64], block: int) -> NDArray[np.intp]:
    """Rows from which a stretch of the given length has every residual of every signal."""
    whole = np.all(np.isfinite(residuals), axis=1).astype(np.int64)
    total = np.r_[0, np.cumsum(whole)]
    starts = np.flatnonzero(total[block:] - total[:-block] == block)
    if starts.size == 0:
        raise DataError(f"no {block} cycles in a row have all residuals: take a smaller block_cycles")
    return starts
