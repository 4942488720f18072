"""What every model can be asked, whatever it is a model of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, Self, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr


@runtime_checkable
class Model(Protocol):
    """A model with sampled inputs and outputs: it runs free, predicts ahead, and is written to a file.

    Inputs and records are a Dataset, a DataFrame or a mapping of columns; ``time_s`` [s] is one of them.
    """

    @property
    def kind(self) -> str:
        """Name of the structure, as it stands in a file."""

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Values by name; the name ends in the unit."""

    def simulate(
        self, inputs: Any, *, initial_state: Mapping[str, float] | Sequence[float] | None = None
    ) -> xr.Dataset:
        """Run free from a state, at rest without one; entry k of an input acts from ``time_s[k]`` to the next."""

    def predict(self, record: Any, horizon: int) -> xr.Dataset:
        """Predict `horizon` samples ahead of every sample of a record, from its data up to that sample."""

    def to_toml(self) -> str:
        """Write the model as TOML, with the standard errors and figures of the fit that it comes from."""

    @classmethod
    def from_toml(cls, text: str) -> Self:
        """Read what `to_toml` wrote."""
