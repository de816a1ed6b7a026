"""The kinds of fields in a mission file: numbers with bounds, names, URLs, positions."""

from __future__ import annotations

import math
import re
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Altitude = Annotated[float, Field(ge=-500.0, le=9000.0)]
SysId = Annotated[int, Field(ge=1, le=250)]


def _matching(pattern: str, allowed: str) -> AfterValidator:
    """A validator whose fault says in words what is allowed."""

    def check(value: str) -> str:
        if re.fullmatch(pattern, value) is None:
            raise PydanticCustomError("form", "should be {allowed}", {"allowed": allowed})
        return value

    return AfterValidator(check)


Name = Annotated[
    str, _matching(r"[A-Za-z0-9_-]{1,32}", "1 to 32 letters, digits, hyphens and underscores")
]
_LINK_URL = r"(udpin|udpout|tcp)://[^/\s]+:\d{1,5}|serial:///[^:\s]+:\d{1,8}"


def _links(value: object) -> object:
    """One URL is a list of one; every item is checked here, so that the fault names the field."""
    urls = value if isinstance(value, list | tuple) else (value,)
    if not urls or not all(isinstance(u, str) and re.fullmatch(_LINK_URL, u) for u in urls):
        raise PydanticCustomError(
            "form",
            "should be one or a list of udpin://host:port (as in udpin://0.0.0.0:14550),"
            " udpout://host:port, tcp://host:port and serial:///dev/name:baud",
        )
    return urls


Links = Annotated[tuple[str, ...], BeforeValidator(_links)]
BrokerUrl = Annotated[
    str, _matching(r"mqtts?://[^/\s]+", "mqtt://[user:password@]host[:port], or mqtts:// for TLS")
]


class Section(BaseModel):
    """Base of all sections: frozen, and a misspelt field is a fault."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)


class Position(Section):
    """A point on or above the earth.

    Attributes:
        lat_deg: Latitude, degrees.
        lon_deg: Longitude, degrees.
        alt_amsl_m: Altitude above mean sea level, m.
    """

    lat_deg: Annotated[float, Field(ge=-85.0, le=85.0)]
    lon_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    alt_amsl_m: Altitude

    @property
    def geodetic(self) -> tuple[float, float, float]:
        """Latitude, longitude (rad) and altitude AMSL (m)."""
        return math.radians(self.lat_deg), math.radians(self.lon_deg), self.alt_amsl_m
