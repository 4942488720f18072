"""Records of the best timing: what one model answers for a load, and what a family of them does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mgdd.errors import ConvergenceError
from mgdd.identify.engine.family import Member
from mgdd.results.describe import described
from mgdd.results.labels import Label, labelled_dataset, named_label
from mgdd.results.result import Result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

RANGED = (
    "soc_cad", "ca50_cad", "shift_cad", "gain_percent",
    "free_soc_cad", "free_ca50_cad", "free_shift_cad", "free_gain_percent",
)  # fmt: skip


def undetermined(shift_cad: Sequence[float]) -> bool:
    """Return whether a range of moves leaves open if earlier or later is better."""
    return shift_cad[0] <= 0.0 <= shift_cad[1]


def _direction(shift_cad: tuple[float, float]) -> str:
    if not math.isfinite(shift_cad[0]) or undetermined(shift_cad):
        return "not determined"
    return "later" if shift_cad[0] > 0.0 else "earlier"


def _label(name: str) -> Label:
    label = named_label(name)
    return Label("°CA", label.long_name) if name.endswith(("shift_cad", "soi_cad")) else label


@described
@dataclass(frozen=True, kw_only=True)
class MemberTiming:
    """What one member of the family answers for one load.

    Parameters
    ----------
    member : Member
        The model; its fit has the burn of every load.
    plausible : bool
        Whether it counts for this load.
    why_not : str
        Why not; empty if it does.
    rmse_percent, left_out_percent, imep_closed_error_percent : float
        Pressure RMSE, the same with gamma and wall heat of the other loads [% of p_max]; error of closed IMEP [%].
    fitted_soc_cad, fitted_ca50_cad, soc_minus_soi_cad : float
        Fitted start and half of the burn [°CA aTDC]; the start after the injection [°CA], NaN where none is stated.
    efficiency_gross : float
        Gross efficiency at the measured timing [-].
    soc_cad, ca50_cad, shift_cad, gain_percent : float
        Best timing with the load's own p_max kept [°CA aTDC], how far that is from the measured one [°CA, positive =
        later], and its gain over it [%]; NaN where that does no work.
    free_soc_cad, free_ca50_cad, free_shift_cad, free_gain_percent : float
        The same without that limit. All are NaN for a member that is not plausible and has no timing within the limits.
    free_p_max_bar : float
        Peak pressure there [bar].
    p_max_model_error_bar : float
        Peak pressure of the model minus the measured one, at the measured timing [bar].
    p_max_limit_bar : float
        The limit kept: the trace's own highest sample, or the model's at the measured timing where that is higher
        [bar].
    at_bound : bool
        Whether a best timing lies at the end of the searched range.
    """

    member: Member = field(repr=False)
    plausible: bool
    why_not: str
    rmse_percent: float
    left_out_percent: float
    imep_closed_error_percent: float
    fitted_soc_cad: float
    fitted_ca50_cad: float
    soc_minus_soi_cad: float
    efficiency_gross: float
    soc_cad: float
    ca50_cad: float
    shift_cad: float
    gain_percent: float
    free_soc_cad: float
    free_ca50_cad: float
    free_shift_cad: float
    free_gain_percent: float
    free_p_max_bar: float
    p_max_model_error_bar: float
    p_max_limit_bar: float
    at_bound: bool

    def to_dict(self) -> dict[str, Any]:
        """Give law, gamma and wall heat of the member and its answer as plain values."""
        names = ("law", "gamma_model", "gamma", "wall_heat_model", "wall_heat_scale")
        model = {name: getattr(self.member, name) for name in names}
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "member"}
        return {"name": self.member.name, **model, "fitted": self.member.fitted, "score": self.member.score, **fields}


@dataclass(frozen=True, kw_only=True, repr=False)
class BestTiming(Result):
    """Best timing of one load, over a family of models.

    Parameters
    ----------
    file : str
        Name of the trace.
    members : tuple of MemberTiming
        Every member's answer, in the order of the family.
    soc_cad, ca50_cad, shift_cad, gain_percent : tuple of float
        Lowest and highest answer of the plausible members, as in `MemberTiming`; angles with the ``misfit_cad`` of the
        family on both sides, gains from 0 where the range of moves spans it. NaN without any.
    free_soc_cad, free_ca50_cad, free_shift_cad, free_gain_percent : tuple of float
        The same without the limit of the load's own p_max.
    """

    file: str
    members: tuple[MemberTiming, ...] = field(repr=False)
    soc_cad: tuple[float, float]
    ca50_cad: tuple[float, float]
    shift_cad: tuple[float, float]
    gain_percent: tuple[float, float]
    free_soc_cad: tuple[float, float]
    free_ca50_cad: tuple[float, float]
    free_shift_cad: tuple[float, float]
    free_gain_percent: tuple[float, float]

    @property
    def plausible(self) -> tuple[MemberTiming, ...]:
        """Answers of the members that are plausible for this load."""
        return tuple(answer for answer in self.members if answer.plausible)

    @property
    def best(self) -> MemberTiming:
        """The plausible answer with the least score; ConvergenceError where no member is plausible for this load."""
        if not self.plausible:
            near = min(self.members, key=lambda answer: answer.member.score)
            raise ConvergenceError(
                f"{self.file}: no model of the family is plausible; {near.member.name}: {near.why_not}; suspect "
                "geometry, TDC, pegging, speed or trapped mass"
            )
        return min(self.plausible, key=lambda answer: answer.member.score)

    @property
    def direction(self) -> str:
        """Where the best timing with the load's own p_max kept lies: ``earlier``, ``later`` or ``not determined``."""
        return _direction(self.shift_cad)

    @property
    def free_direction(self) -> str:
        """The same without that limit."""
        return _direction(self.free_shift_cad)

    @property
    def dataset(self) -> xr.Dataset:
        """Every member's answer over ``member``; attributes name the trace and the best member."""
        rows = [member.to_dict() for member in self.members]
        names = [name for name in (rows[0] if rows else ()) if name != "name"]
        columns = {name: ("member", [row[name] for row in rows], *_label(name)) for name in names}
        members = ("member", [row["name"] for row in rows], "-", "member of the family")
        best = self.best.member.name if self.plausible else ""
        low, high = self.free_ca50_cad
        attrs = {"file": self.file, "best": best, "free_ca50_low_cad": low, "free_ca50_high_cad": high}
        return labelled_dataset({"member": members, **columns}, attrs=attrs)

    def to_dict(self) -> dict[str, Any]:
        """Give file, ranges, directions, best member and all members as plain values."""
        return {
            "file": self.file,
            **{name: list(getattr(self, name)) for name in RANGED},
            "direction": self.direction,
            "free_direction": self.free_direction,
            "best": self.best.to_dict() if self.plausible else None,
            "members": [member.to_dict() for member in self.members],
        }

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot.calibration import family_strip

        return family_strip(self, ax=ax)
