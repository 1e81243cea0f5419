# SPDX-License-Identifier: Apache-2.0
"""The native core, in the build for this processor; all builds give the same numbers."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from touchline import _core as core
else:
    try:
        from touchline import _core_avx2 as core
    except ImportError:  # not built, or a processor without AVX2
        from touchline import _core as core

__all__ = ["core"]
