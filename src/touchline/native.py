# SPDX-License-Identifier: Apache-2.0
"""The native core, in the build for this processor; all builds give the same numbers."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import touchline._core as core
else:
    try:
        import touchline._core_avx2 as core
    except ImportError:  # not built, or a processor without AVX2
        import touchline._core as core

__all__ = ["core"]
