"""What one call of `seek` found: the best inputs, what they give, which seeker sought, and what speaks against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mgdd.loop.lower_limits import plain_name
from mgdd.loop.plant_loop import LoopRun
from mgdd.loop.seek_doubts import Mean, Readings, doubts_about
from mgdd.optimize.inputs import unit_of_input
from mgdd.results.describe import Row
from mgdd.results.finding import Finding, findings_html, unique
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.results.result import Result
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.loop.seek_choice import Question


@dataclass(frozen=True, kw_only=True, repr=False)
class SeekResult(Result):
    """Best inputs that were found on a plant, and how far to trust them.

    Parameters
    ----------
    inputs : dict of str to float
        The best inputs by name, in their units, on the steps of those that have some.
    value, value_sd : float
        J expected there, and its standard deviation without the noise of a reading [unit of J]: by the process of the
        seeker where it has one, otherwise by the ten readings nearest to it.
    gain, gain_sd : float
        By how much the mean J of the last quarter of the cycles is better than the reading at the start, positive is
        better, and the standard deviation of that [unit of J].
    start : dict of str to float
        Where it began.
    limits : dict of str to float
        Mean of the ten readings nearest to the best inputs, by limit.
    seeker : Seeker
        What sought; ``seek(plant, seeker=found.seeker)`` goes on with it.
    reason : str
        Why that one.
    findings : tuple of Finding
        What speaks against the result: codes ``few_cycles``, ``moving``, ``not_settled``, ``at_bound``, ``no_gain``,
        ``start_unknown``, ``start_above_limit``, ``limit_broken``, ``no_reading``, ``unexplained``, ``handed_over``,
        ``untrusted_guide``, ``delay``, ``interrupted``, and those of the seeker.
    run : LoopRun
        Every cycle.
    asked : Question
        Inputs, limits and what was said of J.

    Examples
    --------
    >>> from mgdd.loop import seek
    >>> found = seek(lambda x: -0.03 * (x["soc_cad"] + 4.0) ** 2, {"soc_cad": (-25.0, 15.0)}, cycles=40)
    >>> round(found.inputs["soc_cad"], 1), found.seeker.kind, found.findings
    (-4.0, 'CurveSeeking', ())
    """

    inputs: dict[str, float]
    value: float
    value_sd: float
    gain: float
    gain_sd: float
    start: dict[str, float]
    limits: dict[str, float]
    seeker: Any
    reason: str
    findings: tuple[Finding, ...]
    run: LoopRun
    asked: Question

    @property
    def _kind(self) -> str:
        return str(getattr(self.seeker, "_seeker_kind", None) or self.seeker.kind)

    def _title(self) -> str:
        return f"{self._kind}: {self.reason}"

    def _rows(self) -> list[Row]:
        rows = [
            Row(one.name, f"{self.inputs[one.name]:.6g} (from {self.start[one.name]:.6g})", unit_of_input(one))
            for one in self.asked.inputs
        ]
        rows.append(Row("J", f"{self.value:.6g} ± {self.value_sd:.2g}", "unit of J"))
        rows.append(Row("gain", f"{self.gain:.4g} ± {self.gain_sd:.2g}", "unit of J"))
        for limit in self.asked.limits:
            name, side = plain_name(limit.name)
            said = f"{self.limits[name]:.6g} ({'limit' if side > 0.0 else 'lower limit'} {side * limit.upper:.6g})"
            rows.append(Row(name, said, unit_of(name)))
        rows.append(Row("cycles", str(self.run.dataset.sizes["cycle"])))
        return rows + [Row("doubt", str(finding)) for finding in self.findings]

    def _repr_html_(self) -> str:
        return super()._repr_html_() + findings_html("What speaks against it", self.findings)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it before all its cycles."""
        return self.run.interrupted

    @property
    def dataset(self) -> xr.Dataset:
        """Every cycle as in `LoopRun`, and what was found; seeker, reason and findings as attributes."""
        names = list(self.inputs)
        unit = "unit of the input"
        columns: dict[str, tuple[Any, ...]] = {
            "input": ("input", names, "-", "input of the plant"),
            "best": ("input", list(self.inputs.values()), unit, "best input found"),
            "start": ("input", list(self.start.values()), unit, "input at the start"),
            "value": ((), self.value, "unit of J", "J expected at the best inputs"),
            "value_sd": ((), self.value_sd, "unit of J", "its standard deviation"),
            "gain": ((), self.gain, "unit of J", "gain of J over the start"),
            "gain_sd": ((), self.gain_sd, "unit of J", "its standard deviation"),
        }
        if self.limits:
            measured = [str(name) for name in self.run.dataset["limit"].to_numpy()]
            sides = [plain_name(name) for name in measured]
            at_best = [side * self.limits.get(name, math.nan) for name, side in sides]
            own = "unit of the limit"
            columns["limit"] = ("limit", measured, "-", "limited quantity")
            columns["limits_at_best"] = ("limit", at_best, own, "limited quantity at the best inputs")
        out = self.run.dataset.assign(labelled_dataset(columns).variables)
        out.attrs |= {"seeker": self._kind, "reason": self.reason}
        if self.findings:
            out.attrs["findings"] = "\n".join(map(str, self.findings))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the cycles as plain values.

        Returns
        -------
        dict
            Fields by name; ``seeker`` as the name of its kind, ``figures`` as the summary of the run,
            ``estimate_sd`` and ``trust`` of a seeker that has them, None otherwise. `mgdd engine seek --json` and the
            figures of an experiment begin with them.
        """
        names = ("inputs", "value", "value_sd", "gain", "gain_sd", "start", "limits", "reason", "interrupted")
        out = {name: getattr(self, name) for name in names}
        out |= {"seeker": self._kind, "findings": [finding.to_dict() for finding in self.findings]}
        out |= {name: _known(getattr(self.seeker, name, None)) for name in ("estimate_sd", "trust")}
        figures = {name: value for name, value in self.run.summary.items() if math.isfinite(value)}
        plain: dict[str, Any] = to_jsonable(out | {"cycles": self.run.dataset.sizes["cycle"], "figures": figures})
        return plain

    def _draw(self, ax: Axes | None) -> Axes:
        return self.run._draw(ax)


def found_by(seeker: Any, reason: str, run: LoopRun, start: Mapping[str, float], asked: Question) -> SeekResult:
    """Sum up a run of what was asked."""
    sign = 1.0 if asked.maximize else -1.0
    readings = Readings(run.dataset, asked.inputs, seeker.estimate, float(getattr(seeker, "noise_sd", math.nan)))
    at_best = readings.near_estimate(readings.j, asked.late_cycles)
    if getattr(seeker, "expected_sd", 0.0) > 0.0:  # 0 before the process is fitted
        at_best = Mean(float(seeker.expected), float(seeker.expected_sd))
    gained = readings.gain(asked.late_cycles)
    kept = {
        limit.name: readings.near_estimate(readings.limit(limit.name), limit.delay_cycles + limit.lag_cycles)
        for limit in asked.limits
    }
    gain = Mean(sign * gained.value, gained.sd)
    doubts = doubts_about(seeker, run, readings, gain, kept, asked)
    return SeekResult(
        inputs=dict(zip([one.name for one in asked.inputs], seeker.settable.tolist(), strict=True)),
        value=at_best.value,
        value_sd=at_best.sd,
        gain=gain.value,
        gain_sd=gain.sd,
        start=dict(start),
        limits={name: sign * kept[given].value for given in kept for name, sign in [plain_name(given)]},
        seeker=seeker,
        reason=reason,
        findings=unique([*seeker.findings, *doubts]),
        run=run,
        asked=asked,
    )


def _known(value: Any) -> float | None:
    return float(value) if isinstance(value, float) and math.isfinite(value) else None
