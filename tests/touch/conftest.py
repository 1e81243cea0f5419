# SPDX-License-Identifier: Apache-2.0
from hypothesis import settings

# The same examples every time, and no clock that a busy machine could trip over.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.load_profile("steady")
