# SPDX-License-Identifier: Apache-2.0
"""The health bits of a sample."""

from enum import IntFlag


class Health(IntFlag):
    """Why the estimates of a sample may be worse than usual; 0 when all is well.

    HEALTH_MEANING has the meaning of each bit.
    """

    SETTLING = 1
    GAP = 2
    BAD_TIME = 4
    MISSING = 8
    NON_FINITE = 16
    SATURATED = 32
    SENSOR_EXCLUDED = 64
    MODEL_LIMIT = 128
    PERIOD = 256
    NO_ROOM = 512
    FAULTY = 1024
    OFFSET = 2048
    NOISY = 4096


HEALTH_MEANING = {
    Health.SETTLING: "less than 5/K since the start, a long gap or a reset; no event begins",
    Health.GAP: "first sample after lost ones; a gap beyond 2/K restarts the filters",
    Health.BAD_TIME: "the time stamp repeats or goes back; the sample is ignored",
    Health.MISSING: "a signal that should be there is missing",
    Health.NON_FINITE: "a signal is infinite or absurdly large",
    Health.SATURATED: "a reading is at the end of its range",
    Health.SENSOR_EXCLUDED: "a sensor has been absent for longer than a gap",
    Health.MODEL_LIMIT: "a joint is outside its limits in the model",
    Health.PERIOD: "stamps are not as far apart as expected; thresholds do not fit",
    Health.NO_ROOM: "more events at a time than there is room for; the oldest was ended",
    Health.FAULTY: "a channel reports what cannot be; it is held or left out",
    Health.OFFSET: "what stands there without a touch exceeds a threshold",
    Health.NOISY: "a residual has over 1.5 times the noise that the description tells",
}
