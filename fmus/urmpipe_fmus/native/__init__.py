"""The native backend: a unit as C sources under a small runtime, and compiled for one platform or several."""

from urmpipe_fmus.native.compile import native_binaries, native_missing
from urmpipe_fmus.native.sources import guid_header, native_sources
from urmpipe_fmus.platforms import this_platform

__all__ = ["guid_header", "native_binaries", "native_missing", "native_sources", "this_platform"]
