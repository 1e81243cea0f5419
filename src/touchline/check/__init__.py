# SPDX-License-Identifier: Apache-2.0
"""Is a robot description consistent with itself and with a recording of the robot?"""
