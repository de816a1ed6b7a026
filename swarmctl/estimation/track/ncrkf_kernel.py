"""The consistent NCRKF as a track's filter: linear in the state, at half the full one's cost."""

from __future__ import annotations

from swarmctl.errors import EstimationError
from swarmctl.estimation.integrity.gate import Screened, tells_echoes
from swarmctl.estimation.kernels import ncrkf
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.kernel import Residual
from swarmctl.estimation.track.single_mode_kernel import SingleModeKernel
from swarmctl.units import Array


class NcrkfKernel(SingleModeKernel):
    """Updates by :func:`swarmctl.estimation.kernels.ncrkf.update`, one reference at a time."""

    def tells_echoes(self, S: Array, rows: Rows) -> bool:
        """Whether the prior is good enough: with a poor one nothing is set aside or judged."""
        return tells_echoes(S, rows)

    def innovate(self, rows: Rows) -> list[Residual]:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.innovate`: one residual.

        Raises:
            EstimationError: The rows have several references.
        """
        if len(set(rows.first)) != 1:
            raise EstimationError("The linear filter takes the rows of one reference at a time.")
        return super().innovate(rows)

    def use(self, x: Array, P: Array, rows: Rows, screened: Screened) -> tuple[Array, Array]:
        """Measurement update with the rows that are kept."""
        if not screened.kept.any():
            return x, P
        good = rows.where(screened.kept)
        updated = ncrkf.update(
            x, P, good.first_at[0], good.second_at, good.rd, good.covariance, 0.0
        )
        return updated.x, updated.P
