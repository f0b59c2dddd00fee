"""What can be configured, by environment variables `ORCLAB_*`. All bounds have safe defaults."""

import re
from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_settings import BaseSettings, SettingsConfigDict


def _check_origin(text: str) -> str:
    if not re.fullmatch(r"https?://([\w.-]+|\[[0-9a-f:]+\])(:\d{1,5})?", text, re.IGNORECASE):
        raise ValueError("an origin is http or https of a host, with its port where there is one")
    return text.lower()


def _check_root_path(text: str) -> str:
    path = text.rstrip("/")
    if not re.fullmatch(r"(/[\w.~%@+-]+)*", path):
        raise ValueError("a path begins with a slash: /user/student/proxy/8301")
    return path


Seconds = Annotated[float, Field(gt=0)]


class Settings(BaseSettings):
    """`ORCLAB_PORT=9000 orclab` sets `port`, and so on."""

    model_config = SettingsConfigDict(env_prefix="ORCLAB_", frozen=True)

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8000
    max_sessions: Annotated[int, Field(ge=1, le=256)] = 16
    """Live sessions at once; a further one is told so."""
    spares: Annotated[int, Field(ge=0, le=8)] = 1
    """Workers kept warm for the next session."""
    viewerless_seconds: Seconds = 60.0
    """A session nobody watches ends after this long."""
    untouched_seconds: Seconds = 3600.0
    """A session nobody touches ends after this long, watched or not."""
    hang_seconds: Seconds = 5.0
    """A worker silent for this long is taken for hung, and replaced."""
    max_body_bytes: Annotated[int, Field(ge=1024)] = 65536
    """A larger request body is refused."""
    max_solution_bytes: Annotated[int, Field(ge=1024, le=2**26)] = 2**24
    """A larger file of a solution is refused."""
    origins: tuple[Annotated[str, AfterValidator(_check_origin)], ...] = ()
    """Further origins (scheme://host:port) whose pages may connect, beside the server's own."""
    root_path: Annotated[str, AfterValidator(_check_root_path)] = ""
    """The path under which a proxy shows this server: /user/student/proxy/8301."""
