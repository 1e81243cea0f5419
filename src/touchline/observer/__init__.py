# SPDX-License-Identifier: Apache-2.0
"""Residuals and wrenches from the sensors' signals."""
