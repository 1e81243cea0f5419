# SPDX-License-Identifier: Apache-2.0
"""A robot in MuJoCo with its sensors: logs whose truth is known.

The plant shares no dynamics code with the estimator: MuJoCo moves, the native core estimates.
"""
