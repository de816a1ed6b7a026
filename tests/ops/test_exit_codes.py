"""Exit codes."""

import pytest

from swarmctl import errors
from swarmctl.ops import exit_codes
from swarmctl.ops.live import AbandonedError
from swarmctl.results import MissionResult


@pytest.mark.parametrize("result", [*MissionResult, None])
def test_every_result_has_its_exit_code(result: MissionResult | None) -> None:
    own = {"located": 0, "not_located": 1, "cancelled": 130}
    assert exit_codes.exit_code(result) == own.get(str(result), 3)


def test_every_exit_code_is_documented() -> None:
    raised = {getattr(errors, name).exit_code for name in dir(errors) if name.endswith("Error")}
    assert raised | {AbandonedError.exit_code} <= exit_codes.MEANING.keys()
