# SPDX-License-Identifier: Apache-2.0
"""Builds the arms that ship with Touchline: shapes, meshes, inertias and files."""
