"""The native backend: a unit as C sources under a small runtime, and compiled for one platform or several."""

from urmpipe_fmus.fmu_file import this_platform
from urmpipe_fmus.native.compile import (
    guid_header,
    native_binaries,
    native_sources,
    native_unavailable_reason,
)

__all__ = ["guid_header", "native_binaries", "native_sources", "native_unavailable_reason", "this_platform"]
