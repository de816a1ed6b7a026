"""Exit codes."""

import pytest

from swarmctl import errors
from swarmctl.ops import exit_codes as outcome
from swarmctl.ops.live import AbandonedError


@pytest.mark.parametrize(
    ("result", "code"),
    [
        ("located", 0),
        ("not_located", 1),
        ("vehicle_lost", 3),
        ("arming_refused", 3),
        ("feed_silent", 3),
        ("cancelled", 130),
    ],
)
def test_every_result_has_its_exit_code(result: str, code: int) -> None:
    assert outcome.exit_code(result) == code


def test_every_exit_code_is_documented() -> None:
    raised = {getattr(errors, name).exit_code for name in dir(errors) if name.endswith("Error")}
    assert raised | {AbandonedError.exit_code} <= outcome.MEANING.keys()
