"""What a throttle loop shall follow: a step, a sine, a log, or any angles, and the sample from which it counts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, Error, ParameterError, ShapeError
from mgdd.io.files import existing_file
from mgdd.io.table import read_table
from mgdd.results.describe import described


@described
@dataclass(frozen=True, kw_only=True)
class Reference:
    """Wanted angles of a throttle plate, one per sample.

    Parameters
    ----------
    angle_deg : ndarray, shape (n,)
        Wanted angles [deg].
    sample_s : float
        Time between them [s].
    from_s : float
        Time from which a run is judged [s]; the step of a step.
    band_deg : float
        Error within which a run counts as settled [deg].
    name : str
        For tables and figures.

    Raises
    ------
    mgdd.errors.ParameterError
        A bad sample time, a start beyond the end, a band that is not positive.
    mgdd.errors.ShapeError
        No angles, or more than one dimension.
    mgdd.errors.DataError
        Angles that are not finite.

    Examples
    --------
    >>> from mgdd.loop import Reference
    >>> step = Reference.parse("step:20:60")
    >>> step.angle_deg[498:502].tolist(), step.from_s
    ([20.0, 20.0, 60.0, 60.0], 0.5)
    >>> round(float(Reference.parse("sine:40:10:1").angle_deg.max()), 6)
    50.0
    """

    angle_deg: NDArray[np.float64] = field(compare=False)
    sample_s: float = 1e-3
    from_s: float = 0.0
    band_deg: float = 0.2
    name: str = "reference"

    def __post_init__(self) -> None:
        """Check the fields; ParameterError, ShapeError or DataError otherwise."""
        angles = np.array(self.angle_deg, float)
        object.__setattr__(self, "angle_deg", angles)
        if angles.ndim != 1 or len(angles) == 0:
            raise ShapeError(f"angle_deg has shape {angles.shape}: must be a column of at least one angle")
        if not np.isfinite(angles).all():
            raise DataError(f"angle_deg[{int(np.argmin(np.isfinite(angles)))}] is not finite")
        ParameterError.unless(0.0 < self.sample_s <= 1.0, "sample_s", self.sample_s, "in (0, 1] s")
        if not 0.0 <= self.from_s < len(angles) * self.sample_s:
            raise ParameterError.of("from_s", self.from_s, f"in [0, {len(angles) * self.sample_s:g}) s, inside the run")
        ParameterError.unless(self.band_deg > 0.0, "band_deg", self.band_deg, "> 0 deg")

    @property
    def from_sample(self) -> int:
        """Number of the first sample that is judged."""
        return min(round(self.from_s / self.sample_s), len(self.angle_deg) - 1)

    @classmethod
    def step(
        cls,
        from_deg: float,
        to_deg: float,
        *,
        hold_s: float = 0.5,
        after_s: float = 1.0,
        sample_s: float = 1e-3,
        band_deg: float = 0.2,
    ) -> Reference:
        """Give a step after a hold.

        Parameters
        ----------
        from_deg, to_deg : float
            Angles before and after it [deg].
        hold_s, after_s : float
            Time before and after it [s].
        sample_s, band_deg : float
            As in `Reference`.

        Returns
        -------
        Reference
            Judged from the step on.
        """
        before, after = round(hold_s / sample_s), round(after_s / sample_s)
        if before < 1 or after < 1:
            raise ParameterError.of("hold_s and after_s", (hold_s, after_s), f">= {sample_s:g} s each")
        angles = np.r_[np.full(before, float(from_deg)), np.full(after, float(to_deg))]
        return cls(
            angle_deg=angles,
            sample_s=sample_s,
            from_s=before * sample_s,
            band_deg=band_deg,
            name=f"step:{from_deg:g}:{to_deg:g}",
        )

    @classmethod
    def sine(
        cls,
        mean_deg: float,
        amplitude_deg: float,
        frequency_hz: float,
        *,
        duration_s: float = 6.0,
        skip_s: float = 1.0,
        sample_s: float = 1e-3,
    ) -> Reference:
        """Give a sine that starts at its mean.

        Parameters
        ----------
        mean_deg, amplitude_deg : float
            Its angles [deg].
        frequency_hz : float
            Its frequency [Hz].
        duration_s, skip_s : float
            Length of the run, and of its start that is not judged [s].
        sample_s : float
            As in `Reference`.

        Returns
        -------
        Reference
            Judged behind its start.
        """
        if not 0.0 < frequency_hz < 0.5 / sample_s:
            raise ParameterError.of("frequency_hz", frequency_hz, f"in (0, {0.5 / sample_s:g}) Hz, below half a sample")
        time_s = np.arange(round(duration_s / sample_s)) * sample_s
        return cls(
            angle_deg=mean_deg + amplitude_deg * np.sin(2.0 * math.pi * frequency_hz * time_s),
            sample_s=sample_s,
            from_s=skip_s,
            name=f"sine:{mean_deg:g}:{amplitude_deg:g}:{frequency_hz:g}",
        )

    @classmethod
    def parse(cls, text: str, *, sample_s: float = 1e-3) -> Reference:
        """Read ``step:FROM:TO``, ``sine:MEAN:AMPLITUDE:HZ`` or the name of a CSV file with ``time_s, reference_deg``.

        Parameters
        ----------
        text : str
            One of the three.
        sample_s : float
            Time between samples [s]; a file brings its own.

        Returns
        -------
        Reference
            A file is judged from its start on.

        Raises
        ------
        mgdd.errors.ParameterError
            A text that is none of the three.
        mgdd.errors.DataError
            A file that does not exist, without these columns, or with an uneven time.
        """
        kind, _, rest = text.partition(":")
        counts = {"step": 2, "sine": 3}
        if kind in counts and rest:
            try:
                numbers = [float(part) for part in rest.split(":")]
            except ValueError:
                numbers = []
            if len(numbers) != counts[kind] or not all(map(math.isfinite, numbers)):
                form = "step:FROM:TO, for example step:40:42" if kind == "step" else "sine:MEAN:AMPLITUDE:HZ"
                raise ParameterError.of("reference", text, form)
            if kind == "step":
                return cls.step(numbers[0], numbers[1], sample_s=sample_s)
            return cls.sine(numbers[0], numbers[1], numbers[2], sample_s=sample_s)
        try:
            file = existing_file(text)
        except (FileNotFoundError, ParameterError) as error:
            form = "step:FROM:TO, sine:MEAN:AMPLITUDE:HZ or a CSV file that exists"
            raise ParameterError.of("reference", text, form) from error
        return _from_csv(file)


def _from_csv(path: Path) -> Reference:
    from mgdd.signals.even_grid import even_step

    table = read_table(path, units_row=False)
    places = [table.index(name) for name in ("time_s", "reference_deg")]
    if len(table.lines) < 2:
        raise DataError(f"{path}: has {len(table.lines)} samples: must have at least 2")
    time_s, angle_deg = table.matrix(places)
    try:
        return Reference(angle_deg=angle_deg, sample_s=even_step(time_s), name=path.stem)
    except Error as error:
        raise error.reworded(f"{path}: {error}") from error
