"""Whether a pressure file can be trusted: every check by name, with its verdict, the cause and the remedy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mgdd.engine.record_doubts import hidden, record_doubts
from mgdd.engine.trace import analyze
from mgdd.engine.trace_cycles import CYCLE
from mgdd.errors import DataError, ParameterError
from mgdd.io.pressure import as_trace
from mgdd.presets.meant import cylinder_of, point_of, stated
from mgdd.results.describe import Row
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.presets.meant import CylinderLike, PointLike

Verdict = Literal["no fault found", "open", "doubt", "fail"]
_WORST: tuple[Verdict, ...] = ("no fault found", "open", "doubt", "fail")
# Kinds of doubts of `analyze` by the check that they belong to, in the order of a look at a file.
_CHECKS: dict[str, tuple[str, ...]] = {
    "file": ("reading", "coverage"),
    "samples": ("spike", "clipped", "stuck", "copies"),
    "amplifier": ("soft",),
    "crank angle": ("turn", "slip"),
    "top dead centre": ("tdc", "strokes"),
    "level": ("level", "pegging"),
    "compression": ("compression",),
    "expansion": ("expansion",),
    "charge": ("mass",),
    "burn": ("no_burn", "early_burn", "window", "window_sensitivity"),
    "work and heat": ("gain",),
    "gas exchange": ("exchange",),
    "cycles": ("misfire", "partial_burn", "odd_level", "drift"),
}
_FATAL = ("clipped", "stuck", "copies", "turn")  # the figures are not those of the gas
_REMEDIES = {
    "coverage": "record at least from IVC to EVO",
    "spike": "look for ignition noise and loose contacts; repair or drop the sample",
    "clipped": "lower the gain of the amplifier or widen its range, and measure again",
    "stuck": "look for lost samples, and measure again",
    "copies": "look at the recorder's buffer, and measure again",
    "soft": "lower the gain of the amplifier or widen its range, and measure again",
    "turn": "look for lost pulses, and cut the record there",
    "slip": "look for lost pulses; leave these cycles out",
    "tdc": "shift the angles by tdc_offset_cad, or measure TDC by a motored run or a sensor",
    "strokes": "take the offset off by tdc_offset_cad; first repair what wall heat or a peak names",
    "level": "peg it: pegging='inlet' with the measured pressure, or 'two_point'; correct the unit",
    "pegging": "peg it: pegging='inlet' with the measured pressure, or 'two_point'; then look at TDC",
    "compression": "look at pegging, then TDC, unit and compression ratio",
    "expansion": "shield or cool the sensor, or take another; peg every cycle",
    "mass": "state trapped_mass_g in g per cycle, and the conditions of this record",
    "no_burn": "give heat_window_cad to analyze",
    "early_burn": "state soi_cad of the first injection in °CA aTDC",
    "window": "give heat_window_cad to analyze",
    "window_sensitivity": "smooth more, or give heat_window_cad to analyze",
    "gain": "look at the gain of the amplifier, then at the stated figure",
    "exchange": "peg it by the intake pressure; look at the cylinder that the channel belongs to",
    "misfire": "leave these cycles out of means; look at injection or ignition",
    "partial_burn": "leave these cycles out of means; look at injection or ignition",
    "odd_level": "peg every cycle; look at the charge amplifier and the connectors",
    "drift": "peg every cycle; warm the sensor up, and let the amplifier settle",
}
# What a speed that swings within a turn makes of angles at one speed, 5 % of it an eighth of the work.
_SWINGS = (
    "tdc", "strokes", "level", "pegging", "compression", "expansion", "mass", "gain", "exchange", "drift", "slip",
)  # fmt: skip
_SWING = (
    "take the angle of an encoder: it is made of time at one speed, and a speed that swings within a turn does this"
)
ENGINE = "engine"  # the check that is there only without a given geometry
_ONE = "one cycle: nothing to compare it with"


@dataclass(frozen=True)
class Check:
    """One check: what was looked at, the verdict, what was seen, and what to do."""

    name: str
    verdict: Verdict
    text: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.verdict}{': ' if self.text else ''}{self.text}{'; ' if self.remedy else ''}{self.remedy}"


@dataclass(frozen=True, repr=False)
class PressureCheck(Result):
    """The checks of one pressure file.

    Parameters
    ----------
    file : str
        Its name.
    checks : tuple of Check
        ``no fault found``, ``open`` (not decided by what the file holds), ``doubt``, or ``fail``: the figures cannot be
        right.
    analysis : xarray.Dataset, optional
        What `analyze` found; None where it refused the file.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.engine import check_pressure
    >>> report = check_pressure(datasets.read("hd_diesel_128x144")[1], "hd_diesel_128x144", bmep_bar=12.5)
    >>> report["work and heat"].verdict, report["gas exchange"].text
    ('no fault found', 'the record has no 720 degrees')
    >>> report.summary().splitlines()[0]
    'pressure_a50_bar: no fault found, 8 of 13 checks made'
    """

    file: str
    checks: tuple[Check, ...]
    analysis: xr.Dataset | None = None

    @property
    def verdict(self) -> Verdict:
        """The worst verdict; ``open`` where no check was made, or without a given engine."""
        worst = max((check.verdict for check in self.checks), key=_WORST.index)
        decided = self.made and all(check.name != ENGINE for check in self.checks)
        return "no fault found" if worst == "open" and decided else worst

    @property
    def made(self) -> int:
        """How many of the checks were decided."""
        return sum(check.verdict != "open" for check in self.checks)

    def __getitem__(self, name: str) -> Check:
        """Return a check by name."""
        named = next((check for check in self.checks if check.name == name), None)
        if named is None:
            raise ParameterError(f"no check {name!r}: there are {', '.join(check.name for check in self.checks)}")
        return named

    @property
    def dataset(self) -> xr.Dataset:
        """The checks: ``verdict``, ``text`` and ``remedy`` over ``check``."""
        columns = {name: [getattr(check, name) for check in self.checks] for name in ("verdict", "text", "remedy")}
        names = {"verdict": "verdict", "text": "what was seen", "remedy": "what to do"}
        variables = {name: ("check", np.array(values), "-", names[name]) for name, values in columns.items()}
        check = ("check", np.array([each.name for each in self.checks]), "-", "check")
        return labelled_dataset({"check": check, **variables}, attrs={"file": self.file, "verdict": self.verdict})

    @property
    def title(self) -> str:
        """File, verdict, and how many checks were made where none found a fault."""
        made = f", {self.made} of {len(self.checks)} checks made" if self.verdict in ("no fault found", "open") else ""
        return f"{self.file}: {self.verdict}{made}"

    def _title(self) -> str:
        return self.title

    def _rows(self) -> list[Row]:
        return [Row(check.name, str(check)) for check in self.checks]

    def summary(self) -> str:
        """Return the verdict and all checks, one per line.

        Returns
        -------
        str
            What fails comes first.
        """
        ordered = sorted(self.checks, key=lambda check: -_WORST.index(check.verdict))
        return "\n".join([self._title(), *(f"  {check.name:16}{check}" for check in ordered)])


def check_pressure(
    trace: Any,
    cylinder: CylinderLike,
    *,
    point: PointLike | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    bmep_bar: float | None = None,
    brake_torque_nm: float | None = None,
    n_cylinders: int = 1,
    fuel_mg: float | None = None,
    assumed: str = "",
) -> PressureCheck:
    """Check a pressure file before its figures are used.

    Parameters
    ----------
    trace : Dataset, DataFrame, mapping, DataArray, Series, pair of array_like, or path-like
        As of `analyze`: one cycle or many; more can be checked of 720 degrees and of many cycles.
    cylinder : Cylinder, Preset, str or path-like
        As of `analyze`.
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        As of `analyze`.
    pegging, pegging_exponent, inlet_pressure_kpa
        As of `analyze`.
    bmep_bar, brake_torque_nm, n_cylinders, fuel_mg
        As of `analyze`: without them nothing judges the gain of the amplifier.
    assumed : str
        What of the geometry is a guess of the caller's, in words: then the check ``engine`` is open, and the verdict is
        never more than that.

    Returns
    -------
    PressureCheck
        Every check with its verdict. A file that `analyze` refuses fails the check ``file``; it raises nothing.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.ParameterError
        An option outside its domain.

    Notes
    -----
    Bounds come from spark- and compression-ignition engines that share no code with the package, over four wall-heat
    laws: ``docs/validation.md`` has how many faults of which size are met, and which are out of reach. An error of TDC
    of a fired trace is out of reach and stays ``open``, see `mgdd.identify.estimate_tdc`.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.engine import check_pressure
    >>> sound = datasets.read("hd_diesel_128x144")[1]
    >>> check_pressure(sound, "hd_diesel_128x144").verdict
    'no fault found'
    >>> clipped = sound.assign(pressure_bar=sound["pressure_bar"].clip(max=100.0))
    >>> check_pressure(clipped, "hd_diesel_128x144")["samples"].verdict
    'fail'
    """
    name = str(getattr(trace, "attrs", {}).get("file", trace if isinstance(trace, str) else "trace"))
    try:
        made = as_trace(trace)
        name = str(made.attrs.get("file", name))
        figures = analyze(
            made, cylinder, point=point, pegging=pegging, pegging_exponent=pegging_exponent,
            inlet_pressure_kpa=inlet_pressure_kpa, bmep_bar=bmep_bar, brake_torque_nm=brake_torque_nm,
            n_cylinders=n_cylinders, fuel_mg=fuel_mg, keep_traces=made.sizes.get(CYCLE, 1) == 1, quiet=True,
        )  # fmt: skip
    except DataError as error:
        return PressureCheck(name, (Check("file", "fail", str(error)),))
    doubts = list(zip(figures.attrs["doubts"].splitlines(), figures.attrs["warnings"].splitlines(), strict=True))
    doubts = [(kind, text) for kind, text in doubts if not (kind == "reading" and _of_angle(text))]
    engine = cylinder_of(cylinder)
    doubts += record_doubts(made, figures, engine, point_of(point))
    fuel_mg = stated("fuel_mg", fuel_mg, point)
    judged = {"bmep_bar": bmep_bar, "brake_torque_nm": brake_torque_nm, "fuel_mg": fuel_mg}
    given = [key for key, value in judged.items() if value or not math.isnan(float(made.attrs.get(key, math.nan)))]
    skipped = _skipped(made, figures, given) | hidden(made, figures, engine)
    swing = _SWING if made.attrs.get("angle_from") == "time" else ""
    checks = [_check(check, kinds, doubts, skipped, swing) for check, kinds in _CHECKS.items()]
    if assumed:
        text = f"no engine is given: read with {assumed}"
        remedy = "give the engine: cylinder= in Python, --preset or --set bore_mm=... on the command line"
        checks.insert(0, Check(ENGINE, "open", text, remedy))
    return PressureCheck(name, tuple(checks), figures)


def _of_angle(text: str) -> bool:
    """Whether a line of the reader is one that the record repeats."""
    return "crank angle slips" in text or "a turn of the shaft is missing" in text


def _check(
    name: str, kinds: tuple[str, ...], doubts: list[tuple[str, str]], skipped: dict[str, tuple[str, str]], swing: str
) -> Check:
    """Combine the doubts of one check; `swing` is the first cause of what looks like an uneven turn."""
    findings = [(kind, text) for kind, text in doubts if kind in kinds]
    if not findings:
        return Check(name, "open", *skipped[name]) if name in skipped else Check(name, "no fault found")
    verdict: Verdict = "fail" if any(kind in _FATAL for kind, _ in findings) else "doubt"
    remedies = dict.fromkeys(_REMEDIES[kind] for kind, _ in findings if kind in _REMEDIES)
    if swing and any(kind in _SWINGS for kind, _ in findings):
        remedies = {swing: None, **remedies}
    first: dict[str, str] = {}
    for kind, text in findings:  # each line of the reader is a doubt of its own
        first.setdefault(text if kind == "reading" else kind, text)
    return Check(name, verdict, "; ".join(first.values()), "; ".join(remedies))


def _skipped(trace: xr.Dataset, figures: xr.Dataset, given: list[str]) -> dict[str, tuple[str, str]]:
    """Name the checks that these data cannot decide, and what would."""
    reasons = {}
    cycles = trace.sizes.get(CYCLE, 1)
    motored = int(figures.attrs["motored"]) == max(cycles, 1)
    if motored:
        reasons["burn"] = reasons["work and heat"] = ("no cycle burns", "")
    if not given and not motored:
        reasons["work and heat"] = ("no brake work and no fuel is stated", "state bmep_bar, brake_torque_nm or fuel_mg")
    if not np.isfinite(figures["imep_net_bar"]).all():
        reasons["gas exchange"] = ("the record has no 720 degrees", "")
    if cycles == 1:
        reasons["cycles"] = reasons["crank angle"] = (_ONE, "")
    return reasons
