# SPDX-License-Identifier: Apache-2.0
"""`touchline bench imperfect`: arms that are not as told, and that nobody has calibrated."""
