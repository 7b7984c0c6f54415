"""Time zones by name, as settings have them."""

from typing import Annotated
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import AfterValidator


def _known(name: str) -> str:
    try:
        ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise ValueError("is no time zone; write it as Europe/Berlin, or UTC") from error
    return name


TimeZone = Annotated[str, AfterValidator(_known)]
