"""The commands and their kinds."""

from swarmctl import commands
from swarmctl.commands import Arm, Command, UploadFence
from swarmctl.events import CommandKind


def test_every_command_has_a_kind_and_every_kind_is_that_of_a_command() -> None:
    classes = [
        member
        for member in vars(commands).values()
        if isinstance(member, type) and issubclass(member, Command) and not member.__subclasses__()
    ]
    assert sorted(CommandKind) == sorted(command.__name__ for command in classes)


def test_a_command_knows_its_kind() -> None:
    assert Arm(sysid=1).kind is CommandKind.ARM
    fence = UploadFence(sysid=1, lat_rad=0.0, lon_rad=0.0, radius_m=1.0)
    assert fence.kind is CommandKind.UPLOAD_FENCE
