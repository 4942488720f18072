"""A calibration as a report: measured traces, cycle models, their best timing, and what the traces do not identify."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from mgdd import _core, datasets, plot, presets
from mgdd.engine import analyze, timing_sweep
from mgdd.errors import Interrupted
from mgdd.identify import best_timing, estimate_tdc, wall_heat_profile
from mgdd.identify.engine.best_timing import doubts_of, headline_of
from mgdd.identify.engine.calibration import TDC_SPAN_CAD, compare_laws, law_row
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.family import Member, ModelFamily
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import CylinderFit, Load, figures_of, starts_of
from mgdd.identify.engine.request import GAMMA_PARAMETER, listed, pegged
from mgdd.identify.engine.timing_records import undetermined
from mgdd.parallel.finished import hand_over
from mgdd.plot.calibration import family_strips
from mgdd.plot.calibration import wall_heat_profile as draw_profile
from mgdd.plot.style import drawn, new_figure
from mgdd.presets.meant import cylinder_of, point_of
from mgdd.report.report import Report
from mgdd.report.sections import Section, Table, as_number
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.results.result import Figures

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from mgdd.identify.engine.family import Member
    from mgdd.identify.engine.tdc import TdcEstimate
    from mgdd.identify.engine.timing_records import BestTiming
    from mgdd.presets.meant import CylinderLike, PointLike

_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")


def calibration_report(
    traces: Sequence[Any],
    cylinder: CylinderLike,
    *,
    point: PointLike | None = None,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    profiles: bool = True,
    figures: bool = True,
    name: str = "mgdd.report.calibration_report",
    data: str = "Files of the user.",
    progress: Callable[[str], None] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> Report:
    """Check, analyse and calibrate measured traces, find their best timing, and report all of it.

    Parameters
    ----------
    traces, cylinder, point, fuel_heat_j, pegging, pegging_exponent, inlet_pressure_kpa, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`.
    profiles : bool
        Also profile the wall heat and estimate TDC: a third of the time.
    figures : bool
        Draw the figures.
    name : str
        What the page names as its maker.
    data : str
        Where the traces come from, for the page.
    progress : callable, optional
        Called with a short text before each step.

    Returns
    -------
    Report
        For `write_report`. Its summary holds ``traces``, ``laws``, ``common``, ``unidentifiable``, ``warnings`` and
        ``best_timing``.

    Raises
    ------
    mgdd.errors.ConvergenceError, mgdd.errors.DataError, mgdd.errors.ParameterError
        As in `mgdd.identify.best_timing`.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the report over the models that were finished, or None.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.report import calibration_report
    >>> traces = datasets.read("hd_diesel_128x144")[2:3]
    >>> report = calibration_report(traces, "hd_diesel_128x144", profiles=False, figures=False)
    >>> print(report.verdict[0][:49])
    pressure_a75_bar: no direction is determined, ran
    """
    step = progress or (lambda _: None)
    cylinder = cylinder_of(cylinder)
    scheme: dict[str, Any] = {"step_cad": step_cad, "integrator": integrator}
    how: dict[str, Any] = {
        "pegging": pegging,
        "pegging_exponent": pegging_exponent,
        "inlet_pressure_kpa": inlet_pressure_kpa,
    }
    absolute = [pegged(trace, cylinder, point_of(point), **how) for trace in listed(traces)]
    inputs: dict[str, Any] = {"point": point, "fuel_heat_j": fuel_heat_j, "progress": step}
    step("analyse the traces")
    analyses = [analyze(trace, cylinder, point=point, quiet=True) for trace in absolute]
    timing, stop = _timing(absolute, cylinder, **inputs, **scheme)
    main = headline_of(timing)
    fits, scans = [main.fit], dict[str, WallHeatProfile]()
    tdc: TdcEstimate | None = None
    if stop is None:
        try:
            fits = compare_laws(absolute, cylinder, **inputs, **scheme)
            if profiles:
                tdc = estimate_tdc(absolute, cylinder, span_cad=TDC_SPAN_CAD, **inputs)
                scans = _profiles(main, step)
        except KeyboardInterrupt:
            stop = Interrupted("interrupted: the models and their best timing are in .partial, not all checks of them")
    summary = summarize(analyses, fits, main, scans, timing)
    summary["interrupted"] = stop is not None
    summary["warnings"] = doubts_of(timing, tdc)
    if stop is not None:
        done = len(timing[0].members)
        summary["warnings"].insert(
            0, f"interrupted: ranges over {done} finished model(s), and not every check was made"
        )
    summary["engine"] = {name: getattr(cylinder, name) for name in _GEOMETRY}
    summary["data"] = data
    plain = to_jsonable(summary)
    drawn = draw(analyses, main, scans, timing) if figures else {}
    report = Report(
        name=name,
        title="Measured pressure, calibrated cycle model, best timing",
        dataset=law_table(fits),
        figures=drawn,
        summary=Figures(plain),
        sections=sections_of(plain, drawn),
        verdict=tuple(move_of(row) for row in plain["best_timing"]),
    )
    return hand_over(report, stop)


def shipped_report(**options: Any) -> Report:
    """Make the report of the four traces that the package brings; options as of `calibration_report`."""
    preset = presets.load("hd_diesel_128x144")
    shipped = datasets.read("hd_diesel_128x144")
    return calibration_report(shipped, preset.cylinder, point=preset.point, data=_PROVENANCE, **options)


def _timing(*traces: Any, **options: Any) -> tuple[list[BestTiming], Interrupted | None]:
    """Find the best timing by all models, or by those that were finished before Ctrl-C."""
    try:
        return best_timing(*traces, **options), None
    except Interrupted as stop:
        if stop.partial is None:
            raise
        return stop.partial, stop


def _profiles(main: Member, progress: Callable[[str], None]) -> dict[str, WallHeatProfile]:
    """Profile the wall heat with the law of the headline: gamma held at its value, and gamma refitted."""
    request = replace(main.fit.request, cylinder=main.fit.model, start_values=starts_of(main.fit))
    gamma = GAMMA_PARAMETER[main.gamma_model]
    burn = tuple(name for name in request.free if name not in (gamma, "wall_heat_scale"))
    tables = {}
    for text, common in (("held", ()), ("refitted", (gamma,))):
        fit = fit_request(replace(request, free=("wall_heat_scale", *common, *burn)))
        value = f" at {main.gamma:.4g}" if text == "held" else ""
        tables[f"{main.law}, {main.gamma_model} gamma {text}{value}"] = wall_heat_profile(fit, progress=progress)
    return tables


_PROVENANCE = (
    "Four cycle-averaged closed-valve pressure traces of a heavy-duty diesel at 25, 50, 75 and 100 % load, from "
    "LibICE-post (F. Ramognino), MIT licence."
)
_ANALYSIS = (
    "n_compression n_expansion ca10_cad ca50_cad ca90_cad heat_net_j heat_gross_j imep_closed_bar p_max_bar p_max_cad"
).split()


def summarize(
    analyses: Sequence[xr.Dataset],
    fits: Sequence[CylinderFit],
    main: Member,
    profiles: Mapping[str, WallHeatProfile],
    timing: Sequence[BestTiming],
) -> dict[str, Any]:
    """Collect the numbers of a calibration as plain values."""
    rows = []
    for analysis, load, best in zip(analyses, main.fit.loads, timing, strict=True):
        rows.append(
            {
                "file": load.file,
                "analysis": {name: float(analysis[name]) for name in _ANALYSIS},
                "calibrated": figures_of(load),
                "best_timing": {name: value for name, value in best.to_dict().items() if name != "members"},
                "warnings": analysis.attrs["warnings"].splitlines(),
            }
        )
    unknown = [] if all(profile.identifiable for profile in profiles.values()) else ["wall_heat_scale"]
    return {
        "rows": [_trace_row(load, best) for load, best in zip(main.fit.loads, timing, strict=True)],
        "mgdd": _core.__version__,
        "law": main.name,
        "headline": main_row(main),
        "traces": rows,
        "laws": [law_row(fit) for fit in fits],
        "common": {"wall_heat_scale": {law: profile.to_dict() for law, profile in profiles.items()}},
        "unidentifiable": sorted({*main.fit.report.unidentifiable, *unknown}),
        "best_timing": [row.to_dict() for row in timing],
    }


def main_row(main: Member) -> dict[str, Any]:
    """Give the headline member as plain values."""
    return {
        "law": main.law,
        "gamma_model": main.gamma_model,
        "gamma": main.gamma,
        "wall_heat_scale": main.wall_heat_scale,
        "fitted": main.fitted,
        "plausible": [not why for why in main.why_not],
    }


def _trace_row(load: Load, best: BestTiming) -> dict[str, Any]:
    """Give one trace as a flat row; best timing and gain are ranges over the plausible models, its own p_max kept."""
    (early, late), (least, most) = best.soc_cad, best.gain_percent
    return {
        "trace": load.file,
        "p_max_bar": load.p_max_bar,
        "ca50_cad": load.ca50_cad,
        "rmse_percent": load.rmse_percent,
        "imep_closed_error_percent": load.imep_closed_error_percent,
        "best_soc_from_cad": early,
        "best_soc_to_cad": late,
        "gain_from_percent": least,
        "gain_to_percent": most,
    }


def law_table(fits: Sequence[CylinderFit]) -> xr.Dataset:
    """Tabulate the comparison of burn laws over law and trace."""
    files = [load.file for load in fits[0].loads]
    laws = [fit.kind for fit in fits]

    def grid(name: str) -> list[list[float]]:
        return [[float(getattr(load, name)) for load in fit.loads] for fit in fits]

    dims = ("law", "file")
    scales = [fit.model.wall_heat_scale for fit in fits]
    return labelled_dataset(
        {
            "law": ("law", laws, "-", "burn law and gamma"),
            "file": ("file", files, "-", "trace"),
            "rmse_percent": (dims, grid("rmse_percent")),
            "imep_closed_error_percent": (dims, grid("imep_closed_error_percent")),
            "soc_cad": (dims, grid("soc_cad")),
            "onset_against_soi_cad": (dims, grid("onset_against_soi_cad"), "°CA", "fitted burn start minus SOI"),
            "largest_error_bar": (dims, grid("largest_error_bar"), "bar", "largest local error, model minus measured"),
            "largest_error_cad": (dims, grid("largest_error_cad"), "°CA aTDC", "angle of the largest local error"),
            "wall_heat_scale": ("law", scales),
        }
    )


_ANALYSIS_COLUMNS = {
    "p_max_bar": ("p_max [bar]", ".1f"),
    "p_max_cad": ("at [°CA aTDC]", ".1f"),
    "imep_closed_bar": ("closed IMEP [bar]", ".2f"),
    "ca10_cad": ("CA10 [°CA aTDC]", ".1f"),
    "ca50_cad": ("CA50 [°CA aTDC]", ".1f"),
    "ca90_cad": ("CA90 [°CA aTDC]", ".1f"),
    "heat_net_j": ("net heat [J]", ".0f"),
    "n_compression": ("n_c [-]", ".3f"),
    "n_expansion": ("n_e [-]", ".3f"),
}
_BURN = {
    "soc_cad": ("SOC [°CA aTDC]", ".2f"),
    "burn_duration_cad": ("duration [°CA]", ".1f"),
    "fuel_heat_j": ("fuel heat [J]", ".0f"),
    "ca50_cad": ("CA50 [°CA aTDC]", ".1f"),
    "rmse_bar": ("RMSE [bar]", ".2f"),
    "heat_loss_fraction": ("wall heat over fuel heat [-]", ".3f"),
}
_WALL = {
    "value": ("scale [-]", ".2f"),
    "stderr": ("standard error [-]", ".3f"),
    "correlation": ("strongest correlation [-]", ".2f"),
}
_TIMING = {
    "soc_cad": ("best SOC, own p_max kept [°CA aTDC]", 1),
    "ca50_cad": ("best CA50, own p_max kept [°CA aTDC]", 1),
    "shift_cad": ("move by, own p_max kept [°CA]", 1),
    "gain_percent": ("gain [%]", 2),
    "free_soc_cad": ("best SOC, no limit [°CA aTDC]", 1),
    "free_ca50_cad": ("best CA50, no limit [°CA aTDC]", 1),
    "free_shift_cad": ("move by, no limit [°CA]", 1),
    "free_gain_percent": ("gain, no limit [%]", 2),
}
_MEMBERS = {
    "rmse_percent": ("RMSE [% of p_max]", ".2f"),
    "imep_closed_error_percent": ("closed IMEP error [%]", "+.1f"),
    "soc_minus_soi_cad": ("SOC minus SOI [°CA]", "+.1f"),
    "efficiency_gross": ("gross efficiency [-]", ".3f"),
    "ca50_cad": ("best CA50, own p_max kept [°CA aTDC]", ".1f"),
    "free_ca50_cad": ("best CA50, no limit [°CA aTDC]", ".1f"),
}
_TIMING_TEXT = (
    "{kept} of {n} models are plausible for at least one load. Each cell: the answer of the headline model, then the "
    "range over all plausible ones, angles with {misfit:g} °CA on both sides for crevices, blow-by and gas properties "
    "that no model has. Where the range is wide, these traces do not determine the best timing: wall heat and gamma "
    "cannot be separated. What to set is 'move by': later than measured if positive; 'open' where the range spans "
    "zero, so that no direction is determined. CA50 is that of the modelled burn, some tenths later than that of the "
    "net heat below. Own p_max is the highest measured sample, or the model's where that is higher at the measured "
    "timing. Gains are those of the models, in closed-cycle work over the measured timing."
)
_HEADLINE_TEXT = (
    "Headline: {law}. It has the least distance from the best fit and from the textbook wall heat (1 ± 0.25) of the "
    "models that are plausible."
)
_MEMBERS_TEXT = (
    "Every model is fitted to all loads together, the burn bounded by the injection. Plausible: wall heat 0.3 to 1.5 "
    "of the textbook law, closed efficiency at most 0.55, heat 0.86 to 1.04 of a stated fuel, closed IMEP within 2 %, "
    "RMSE at most twice the least (of which less than 0.2 % counts as 0.2), no burn before the injection, a fit that "
    "converged, and wall heat and gamma of the other loads serve the one left out."
)
_LAWS_TEXT = (
    "Pressure error over the closed cycle, error of the closed IMEP, fitted burn start against injection, and the "
    "largest local error. A small pressure error alone proves nothing."
)


def sections_of(s: Mapping[str, Any], figures: Mapping[str, Figure]) -> tuple[Section, ...]:
    """Make the sections from the summary."""
    profiles = s["common"]["wall_heat_scale"]
    return (
        Section(title="Best timing", text=_headline(s), table=_timing_table(s["best_timing"])),
        Section(title="Limitations found", items=tuple(_limitations(s))),
        Section(title="Every member of the family", text=(_MEMBERS_TEXT,), table=_members(s["best_timing"])),
        Section(title="Every burn law, free to start before the injection", text=(_LAWS_TEXT,), table=_laws(s["laws"])),
        Section(
            title="Wall heat",
            text=() if profiles else ("Not profiled in this quick run.",),
            table=_wall_heat(profiles) if profiles else None,
        ),
        Section(title=f"Calibrated burn ({s['law']})", table=_per_trace(s["traces"], "calibrated", _BURN)),
        Section(
            title="Analysis of the measured traces",
            text=("Net heat release with gamma 1.33 in the window found from each trace, which is taken as absolute.",),
            table=_per_trace(s["traces"], "analysis", _ANALYSIS_COLUMNS),
        ),
        *((Section(title="Figures", figures=figures),) if figures else ()),
    )


def _limitations(s: Mapping[str, Any]) -> list[str]:
    out = []
    for law, profile in s["common"]["wall_heat_scale"].items():
        if not profile["identifiable"]:
            out.append(
                f"The wall-heat scale is not identifiable from these traces ({law}): {'; '.join(profile['reasons'])}."
            )
    not_identifiable = "wall_heat_scale is not identifiable from these traces"
    out += [f"{text}." for text in s["warnings"] if not (out and text.endswith(not_identifiable))]
    for row in s["traces"]:
        out += [f"{row['file']}: {text}." for text in row["warnings"]]
    out.append(
        "Standard errors of the wall heat take the residual as white noise; it is model error, so the true ones are "
        "larger."
    )
    errors = [abs(row["best"]["p_max_model_error_bar"]) for row in s["best_timing"] if row["best"]] or [0.0]
    out.append(
        f"At the measured timing the headline's p_max is wrong by up to {max(errors):.1f} bar: gains of a tenth of a "
        "percent under the trace's own p_max lie within that error."
    )
    out.append("NOx is a proxy from the maximum bulk gas temperature with unfitted constants: read its trend only.")
    out.append("The gas exchange is not in these traces: gains leave out pumping work, emissions and exhaust enthalpy.")
    return out


def _headline(s: Mapping[str, Any]) -> tuple[str, ...]:
    rows = s["best_timing"]
    n = len(rows[0]["members"])
    good = sum(any(row["members"][at]["plausible"] for row in rows) for at in range(n))
    if not good:
        return (
            (
                f"None of {n} models is plausible for these traces: no best timing is given. The member that comes "
                f"nearest is {s['law']}; what it fails stands below. Suspect geometry, TDC, pegging, speed or mass."
            ),
        )
    return _HEADLINE_TEXT.format(law=s["law"]), _TIMING_TEXT.format(kept=good, n=n, misfit=ModelFamily().misfit_cad)


def move_of(row: Mapping[str, Any]) -> str:
    """State how far to move the timing of a trace, what that gains, and how sure that is."""
    best = row["best"]
    if best is None:
        return f"{row['file']}: no plausible model, so no best timing."
    limited, free = (_part(row, prefix) for prefix in ("", "free_"))
    same = abs(best["shift_cad"] - best["free_shift_cad"]) < 0.05
    if same and undetermined(row["shift_cad"]) == undetermined(row["free_shift_cad"]):
        return f"{row['file']}: {free}; its own p_max kept, range {_ends(row['shift_cad'])} °CA."
    return f"{row['file']}: {limited}, its own p_max kept; without that limit {free}."


def _part(row: Mapping[str, Any], prefix: str) -> str:
    """Describe the move of one question; a range that spans zero gives none."""
    best, ends = row["best"], row[f"{prefix}shift_cad"]
    if undetermined(ends):
        return f"no direction is determined, range {_ends(ends)} °CA"
    to = f" to a p_max of {best['free_p_max_bar']:.0f} bar" if prefix else ""
    return (
        f"{_move(best[f'{prefix}shift_cad'])}{to}, gain {best[f'{prefix}gain_percent']:.2f} %, range {_ends(ends)} °CA"
    )


def _move(cad: float) -> str:
    return f"{'retard' if cad > 0 else 'advance'} by {abs(cad):.1f} °CA" if abs(cad) >= 0.05 else "leave the timing"


def _ends(pair: Sequence[float]) -> str:
    return " to ".join(dict.fromkeys(f"{value:+z.1f}".replace("-", "−") for value in pair))


def _table(first: Sequence[str], columns: Mapping[str, tuple[str, Any]], rest: Sequence[str], body: Any) -> Table:
    heads = (*first, *(head for head, _ in columns.values()), *rest)
    return Table(columns=heads, rows=tuple(map(tuple, body)))


def _cells(values: Mapping[str, Any], columns: Mapping[str, tuple[str, str]]) -> list[str]:
    return [as_number(values[name], form) for name, (_, form) in columns.items()]


def _timing_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    def cell(row: Mapping[str, Any], name: str, digits: int) -> str:
        if row["best"] is None:
            return "not known"
        prefix = "free_" if name.startswith("free_") else ""
        is_open = undetermined(row[f"{prefix}shift_cad"])
        first = (
            "open"
            if is_open and name.endswith(("shift_cad", "gain_percent"))
            else as_number(row["best"][name], f"z.{digits}f")
        )
        return f"{first} ({_span(row[name], digits)})"

    body = ((row["file"], *(cell(row, name, digits) for name, (_, digits) in _TIMING.items())) for row in rows)
    return _table(["trace"], _TIMING, [], body)


def _members(rows: Sequence[Mapping[str, Any]]) -> Table:
    body = (
        (first["name"] if row is rows[0] else "", row["file"], *_cells(row["members"][at], _MEMBERS),
         row["members"][at]["why_not"] or "yes")
        for at, first in enumerate(rows[0]["members"]) for row in rows
    )  # fmt: skip
    return _table(["model", "trace"], _MEMBERS, ["plausible"], body)


def _laws(laws: Sequence[Mapping[str, Any]]) -> Table:
    head = ["law", "wall-heat scale [-]", "trace", "RMSE [% of p_max]", "closed IMEP error [%]", "SOC [°CA aTDC]"]
    onset = all("onset_against_soi_cad" in law for law in laws)
    head += ["SOC minus SOI [°CA]"] if onset else []
    head += ["largest error [bar]", "at [°CA aTDC]"]
    body = []
    for law in laws:
        for i, file in enumerate(law["file"]):
            row = [law["law"], f"{law['wall_heat_scale']:.2f}"] if i == 0 else ["", ""]
            row += [file, f"{law['rmse_percent'][i]:.2f}", f"{law['imep_closed_error_percent'][i]:+.1f}"]
            row += [f"{law['soc_cad'][i]:.1f}"]
            row += [as_number(law["onset_against_soi_cad"][i], "+.1f")] if onset else []
            body.append((*row, f"{law['largest_error_bar'][i]:+.1f}", f"{law['largest_error_cad'][i]:.0f}"))
    return Table(columns=tuple(head), rows=tuple(body))


def _wall_heat(profiles: Mapping[str, Mapping[str, Any]]) -> Table:
    body = (
        (
            law, *_cells(profile, _WALL), str(profile["correlated_with"]),
            _span((profile["range_low"], profile["range_high"]), 2),
            _span((profile["possible_low"], profile["possible_high"]), 2),
            "yes" if profile["identifiable"] else "no",
        )
        for law, profile in profiles.items()
    )  # fmt: skip
    return _table(["law"], _WALL, ["with", "as good within 10 % [-]", "possible in all [-]", "identifiable"], body)


def _per_trace(rows: Sequence[Mapping[str, Any]], part: str, columns: Mapping[str, tuple[str, str]]) -> Table:
    return _table(["trace"], columns, [], ((row["file"], *_cells(row[part], columns)) for row in rows))


def _span(pair: Sequence[float], digits: int) -> str:
    low, high = (as_number(value, f"z.{digits}f") for value in pair)
    return low if low == high else f"{low} to {high}"


def draw(
    analyses: Sequence[xr.Dataset], main: Member, profiles: Mapping[str, WallHeatProfile], timing: Sequence[BestTiming]
) -> dict[str, Figure]:
    """Draw the figures by caption; nothing is registered with pyplot."""
    figures = {
        "Best timing by every member of the family, without a pressure limit": family_strips(timing),
        "Measured pressure and apparent heat release": _grid(analyses, plot.pressure),
        "log p over log V with the polytropic slopes of compression and expansion": _grid(
            analyses, partial(plot.pressure, log_pv=True)
        ),
        f"Calibration, {main.name}": _grid(main.fit.loads, Load.plot),
    }
    for law, profile in profiles.items():
        figures[f"What the traces show of wall heat: refitted RMSE over the wall-heat scale, {law}"] = drawn(
            draw_profile, profile.dataset, size=(13.0, 4.8)
        )
    sweeps = [timing_sweep(load.cylinder, load.point).assign_attrs(file=load.file) for load in main.fit.loads]
    figures[f"Efficiency and NOx proxies over timing, {main.name}"] = _grid(sweeps, plot.timing, label=True)
    return figures


def _grid(datasets: Sequence[Any], function: Any, *, label: bool = False) -> Figure:
    columns = min(2, len(datasets))
    rows = -(-len(datasets) // columns)
    figure = new_figure(13.0, 4.8 * rows)
    for i, dataset in enumerate(datasets):
        part = figure.add_subplot(rows, columns, i + 1)
        function(dataset, ax=part)
        if label:  # plots of a trace name their file themselves
            part.annotate(dataset.attrs["file"], (0.5, 0.04), xycoords="axes fraction", ha="center")
    return figure
