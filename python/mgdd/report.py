"""One self-contained HTML page from a study, with its summary as JSON beside it."""

from __future__ import annotations

import base64
import html
import io
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mgdd.studies import StudyResult

__all__ = ["write_report"]

_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#1a1a1a}
h1{font-size:1.6rem}h2{font-size:1.2rem;margin-top:2.2rem;border-bottom:1px solid #ccc}
table{border-collapse:collapse;font-size:.9rem;margin:1rem 0}td,th{padding:.25rem .6rem;border-bottom:1px solid #ddd}
th{text-align:left;background:#f4f4f4}td{text-align:right}td:first-child,td.name{text-align:left}
td{white-space:nowrap}figure{margin:1.5rem 0;break-inside:avoid}img{max-width:100%}
figcaption{font-size:.9rem;color:#444}
.scroll{overflow-x:auto}li{margin:.3rem 0}
"""


def write_report(result: StudyResult, folder: str | os.PathLike[str] = "mgdd-report") -> Path:
    """Write ``index.html`` and ``summary.json`` of a measured-traces study.

    Parameters
    ----------
    result : mgdd.studies.StudyResult
        From `mgdd.studies.run_measured_traces`.
    folder : path-like
        Made if missing; the two files in it are replaced.

    Returns
    -------
    pathlib.Path
        The page. It holds its figures itself and needs no network.

    Examples
    --------
    >>> import tempfile
    >>> from mgdd.report import write_report
    >>> from mgdd.studies import run_measured_traces
    >>> result = run_measured_traces(quick=True, figures=False)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(result, folder).name
    'index.html'
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    page = _page(result)
    text = json.dumps(result.summary, indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    (folder / "index.html").write_text(page, encoding="utf-8")
    return folder / "index.html"


def _page(result: StudyResult) -> str:
    s = result.summary
    body = [
        "<h1>Measured pressure, calibrated cycle model, best timing</h1>",
        f"<p>{_text(s['data'])} Angles are °CA aTDC (firing TDC = 0, compression negative). mgdd {s['mgdd']}.</p>",
        f"<p>Engine: {_text(', '.join(f'{name} {value:g}' for name, value in s['engine'].items()))}.</p>",
        "<h2>Best timing</h2>",
        (
            "<p>The traces do not carry the wall heat, so each best timing is a range over a wall-heat scale of "
            f"{_span(s['best_timing'][0]['wall_heat_scale'], 1)} with everything else refitted ({_text(s['law'])}). "
            "Gains are in closed-cycle efficiency over the measured timing.</p>"
        ),
        _timing_table(s["best_timing"]),
        "<h2>What to distrust</h2>",
        _list(_distrust(s)),
        "<h2>Every burn law, side by side</h2>",
        (
            "<p>Pressure error over the closed cycle, error of the closed IMEP, fitted burn start against injection, "
            "and the largest local error. A small pressure error alone proves nothing.</p>"
        ),
        _law_table(s["laws"]),
        "<h2>Wall heat</h2>",
        _wall_heat(s["common"]["wall_heat_scale"]),
        f"<h2>Calibrated burn ({_text(s['law'])})</h2>",
        _burn_table(s["traces"]),
        "<h2>Analysis of the measured traces</h2>",
        "<p>Net heat release with gamma 1.33 from -10 CAD on; the trace is taken as absolute.</p>",
        _analysis_table(s["traces"]),
        "<h2>Figures</h2>",
        *[_figure(caption, figure) for caption, figure in result.figures.items()],
    ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>mgdd report</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def _distrust(s: Mapping[str, Any]) -> list[str]:
    out = []
    for law, profile in s["common"]["wall_heat_scale"].items():
        if not profile["identifiable"]:
            out.append(
                f"The wall-heat scale is not identifiable from these traces ({law}): {'; '.join(profile['reasons'])}."
            )
    told = "wall_heat_scale is not identifiable from these traces"
    out += [f"{text}." for text in s["warnings"] if not (out and text.endswith(told))]
    for row in s["traces"]:
        out += [f"{row['file']}: {text}." for text in row["warnings"]]
    out.append("Standard errors take the residual as white noise; it is model error, so true uncertainties are larger.")
    errors = [abs(point["p_max_model_error_bar"]) for row in s["best_timing"] for point in row["points"]]
    out.append(
        f"At the measured timing the model's p_max is wrong by up to {max(errors):.1f} bar: gains of a tenth of a "
        "percent under the trace's own p_max lie within that error."
    )
    out.append("NOx is a proxy from the maximum bulk gas temperature with unfitted constants: read its trend only.")
    out.append("The gas exchange is not in these traces: gains leave out pumping work, emissions and exhaust enthalpy.")
    return out


def _timing_table(rows: Sequence[Mapping[str, Any]]) -> str:
    head = (
        "trace",
        "SOC as fitted [°CA aTDC]",
        "best SOC, own p_max kept [°CA aTDC]",
        "gain [%]",
        "p_max limit [bar]",
        "best SOC, no limit [°CA aTDC]",
        "CA50, no limit [°CA aTDC]",
        "gain, no limit [%]",
    )
    body = [
        (
            r["file"],
            _span(r["fitted_soc_cad"], 1),
            _span(r["soc_cad"], 1),
            _span(r["gain_percent"], 2),
            f"{r['p_max_limit_bar']:.1f}",
            _span(r["free_soc_cad"], 1),
            _span(r["free_ca50_cad"], 1),
            _span(r["free_gain_percent"], 2),
        )
        for r in rows
    ]
    return _table(head, body)


def _law_table(laws: Sequence[Mapping[str, Any]]) -> str:
    head = (
        "law",
        "wall-heat scale [-]",
        "trace",
        "RMSE [% of p_max]",
        "closed IMEP error [%]",
        "SOC [°CA aTDC]",
        "SOC minus SOI [°CA]",
        "largest error [bar]",
        "at [°CA aTDC]",
    )
    onset = all("onset_against_soi_cad" in law for law in laws)
    body = []
    for law in laws:
        for i, file in enumerate(law["file"]):
            body.append(
                [
                    law["law"] if i == 0 else "",
                    f"{law['wall_heat_scale']:.2f}" if i == 0 else "",
                    file,
                    f"{law['rmse_percent'][i]:.2f}",
                    f"{law['imep_closed_error_percent'][i]:+.1f}",
                    f"{law['soc_cad'][i]:.1f}",
                    _number(law["onset_against_soi_cad"][i], "+.1f") if onset else "",
                    f"{law['largest_error_bar'][i]:+.1f}",
                    f"{law['largest_error_cad'][i]:.0f}",
                ]
            )
    kept = [i for i, name in enumerate(head) if onset or name != "SOC minus SOI [°CA]"]
    return _table([head[i] for i in kept], ([row[i] for i in kept] for row in body))


def _wall_heat(profiles: Mapping[str, Mapping[str, Any]]) -> str:
    if not profiles:
        return "<p>Not profiled in this quick run.</p>"
    head = (
        "law",
        "scale [-]",
        "standard error [-]",
        "strongest correlation",
        "with",
        "possible range [-]",
        "identifiable",
    )
    body = [
        (
            law,
            _number(p["value"], ".2f"),
            _number(p["stderr"], ".3f"),
            _number(p["correlation"], ".2f"),
            p["correlated_with"],
            _span((p["range_low"], p["range_high"]), 2),
            "yes" if p["identifiable"] else "no",
        )
        for law, p in profiles.items()
    ]
    return _table(head, body)


def _burn_table(rows: Sequence[Mapping[str, Any]]) -> str:
    head = (
        "trace",
        "SOC [°CA aTDC]",
        "duration [°CA]",
        "fuel heat [J]",
        "CA50 [°CA aTDC]",
        "RMSE [bar]",
        "wall heat over fuel heat [-]",
    )
    body = []
    for row in rows:
        c = row["calibrated"]
        body.append(
            (
                row["file"],
                f"{c['soc_cad']:.2f}",
                f"{c['burn_duration_cad']:.1f}",
                f"{c['fuel_heat_j']:.0f}",
                f"{c['ca50_cad']:.1f}",
                f"{c['rmse_bar']:.2f}",
                _number(c["heat_loss_fraction"], ".3f"),
            )
        )
    return _table(head, body)


def _analysis_table(rows: Sequence[Mapping[str, Any]]) -> str:
    head = (
        "trace",
        "p_max [bar]",
        "at [°CA aTDC]",
        "closed IMEP [bar]",
        "CA10",
        "CA50",
        "CA90 [°CA aTDC]",
        "net heat [J]",
        "n_c",
        "n_e",
    )
    names = (
        "p_max_bar p_max_cad imep_closed_bar ca10_cad ca50_cad ca90_cad heat_net_j n_compression n_expansion".split()
    )
    digits = (1, 1, 2, 1, 1, 1, 0, 3, 3)
    body = [
        (row["file"], *(_number(row["analysis"][n], f".{d}f") for n, d in zip(names, digits, strict=True)))
        for row in rows
    ]
    return _table(head, body)


def _table(head: Iterable[str], body: Iterable[Iterable[str]]) -> str:
    top = "".join(f"<th>{_text(cell)}</th>" for cell in head)
    rows = "".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>\n" for row in body)
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>\n{rows}</tbody></table></div>'


def _cell(text: str) -> str:
    name = ' class="name"' if text[:1].isalpha() else ""
    return f"<td{name}>{_text(text)}</td>"


def _figure(caption: str, figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    text = _text(caption)
    return f'<figure><img alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption></figure>'


def _list(items: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{_text(item)}</li>" for item in items) + "</ul>"


def _span(pair: Sequence[float], digits: int) -> str:
    low, high = (_number(value, f".{digits}f") for value in pair)
    return low if low == high else f"{low} to {high}"


def _number(value: float | None, form: str) -> str:
    return "–" if value is None or value != value else format(value, form)


def _text(value: object) -> str:
    return html.escape(str(value))
