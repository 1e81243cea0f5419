# SPDX-License-Identifier: Apache-2.0
"""The benchmark: how soon pushes are found, at which rate of false alarms."""
