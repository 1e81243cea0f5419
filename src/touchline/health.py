# SPDX-License-Identifier: Apache-2.0
"""The health bits of a sample."""

from enum import IntFlag


class Health(IntFlag):
    """Why the estimates of a sample may be worse than usual; 0 when all is well."""

    SETTLING = 1  # less than 5 / bandwidth since the start, a long gap or a reset
    GAP = 2  # samples are lost: the first one after them; beyond 2 / bandwidth filters restart
    BAD_TIME = 4  # the time stamp repeats or goes back: the sample is ignored
    MISSING = 8  # a signal that should be there is NaN
    NON_FINITE = 16  # a signal is infinite or absurdly large
    SATURATED = 32  # a reading is at the end of its range
    SENSOR_EXCLUDED = 64  # a sensor has been absent for longer than a gap
    MODEL_LIMIT = 128  # a joint is outside its limits in the model
    PERIOD = 256  # stamps are not as far apart as the pipeline was told: thresholds do not fit
    NO_ROOM = 512  # more events at a time than there is room for: the oldest was ended
    FAULTY = 1024  # a channel is not believed: `Result.faults` names it
    OFFSET = 2048  # what stands there without a touch exceeds a threshold: `Pipeline.standing`
    NOISY = 4096  # a residual's noise is over 1.5 times what was told: `Pipeline.standing`
