# SPDX-License-Identifier: Apache-2.0
"""The types of arrays, for annotations."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]  # of any precision
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]
