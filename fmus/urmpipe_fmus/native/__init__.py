"""The native backend: a block model as C sources with a small runtime, compiled for one or more platforms."""

from urmpipe_fmus.fmu_file import this_platform
from urmpipe_fmus.native.compile import (
    guid_header,
    native_binaries,
    native_sources,
    native_unavailable_reason,
)

__all__ = ["guid_header", "native_binaries", "native_sources", "native_unavailable_reason", "this_platform"]
